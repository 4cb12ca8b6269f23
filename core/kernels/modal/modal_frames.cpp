// The modes that all frames of a body share, if they do.
#include <algorithm>
#include <cmath>

#include "core/kernels/modal/modal_body.h"
#include "core/linear_algebra/eigen.h"

namespace ressort {
namespace {

constexpr double shared_tolerance = 1e-12;  // of a matrix' largest element: is it diagonal?
constexpr double zero_factor = 1e-13;       // of the largest: is it anything?

}  // namespace

Eigenmodes::Eigenmodes(const LinearBody& body, const Progress& progress) : body_(body) {
  groups_ = tied_together(body);
  place_.resize(body.count);
  std::vector<Matrix> mixture;
  for (std::uint32_t group = 0, first = 0; group < groups_.size(); ++group) {
    const auto size = static_cast<std::uint32_t>(groups_[group].size());
    for (std::uint32_t i = 0; i < size; ++i) {
      place_[groups_[group][i]] = {group, i, first};
    }
    mixture.emplace_back(size, size);
    first += size;
  }
  double share = 1.0;
  for (auto* frames : {&body.stiffness, &body.damping}) {
    for (const Frame& frame : *frames) {
      share = std::fmod(share + 0.6180339887498949, 1.0) + 0.1;
      std::map<std::uint32_t, Matrix> matrices;  // [group]
      double most = 0.0;
      for (const std::uint32_t group : groups_of(frame)) {
        const std::size_t size = groups_[group].size();
        progress.spend(size * size / 8);
        Matrix& matrix = matrices.try_emplace(group, size, size).first->second;
        for (const Bar& bar : frame.bars) {
          if (place_[bar.shares[0].mass].group == group) {
            add(matrix, bar);
          }
        }
        most = std::max(most, largest(matrix.values));
      }
      for (const auto& [group, matrix] : matrices) {
        if (most > 0.0) {
          mixture[group].values += share / most * matrix.values;
        }
      }
    }
  }
  shape_.assign(body.count, Vector(body.count));
  for (std::uint32_t group = 0; group < groups_.size(); ++group) {
    const std::vector<std::uint32_t>& masses = groups_[group];
    const std::size_t size = masses.size();
    progress.spend(size * size * size / 8);
    const Eigenpairs pairs = symmetric_eigenpairs(mixture[group]);
    for (std::size_t j = 0; j < size; ++j) {
      for (std::size_t i = 0; i < size; ++i) {
        shape_[masses[i]][place_[masses[0]].first_mode + j] = pairs.vectors(i, j);
      }
    }
  }
}

std::vector<std::uint32_t> Eigenmodes::groups_of(const Frame& frame) const {
  std::vector<std::uint32_t> groups;
  for (const Bar& bar : frame.bars) {
    groups.push_back(place_[bar.shares[0].mass].group);
  }
  std::sort(groups.begin(), groups.end());
  groups.erase(std::unique(groups.begin(), groups.end()), groups.end());
  return groups;
}

void Eigenmodes::add(Matrix& matrix, const Bar& bar) const {
  for (const auto& [a, share] : bar.shares) {
    for (const auto& [b, other] : bar.shares) {
      matrix(place_[a].index, place_[b].index) +=
          bar.weight * share * body_.root[a] * other * body_.root[b];
    }
  }
}

// Bar by bar: as sums of squares the factors are exact even where small.
bool Eigenmodes::measure(std::vector<Frame>& frames, const Progress& progress) const {
  for (Frame& frame : frames) {
    const std::vector<std::uint32_t> groups = groups_of(frame);
    const auto first_of = [&](std::uint32_t group) { return place_[groups_[group][0]].first_mode; };
    frame.first = first_of(groups.front());
    const std::size_t modes = first_of(groups.back()) + groups_[groups.back()].size() - frame.first;
    progress.spend((frame.bars.size() + modes) * modes / 8);
    frame.factor.resize(modes);
    std::map<std::uint32_t, Vector> image;  // [mass][mode]
    for (const std::uint32_t group : groups) {
      for (const std::uint32_t mass : groups_[group]) {
        image.emplace(mass, Vector(modes));
      }
    }
    for (const Bar& bar : frame.bars) {
      Vector stretch(modes);
      for (const auto& [mass, share] : bar.shares) {
        stretch += share * body_.root[mass] * frame.part_of(shape_[mass]);
      }
      for (const auto& [mass, share] : bar.shares) {
        image[mass] += bar.weight * share * body_.root[mass] * stretch;
      }
      frame.factor += bar.weight * stretch * stretch;
    }
    const double most = largest(frame.factor);
    for (const auto& [mass, moved] : image) {
      if (!(largest(moved - frame.factor * frame.part_of(shape_[mass])) <=
            shared_tolerance * most)) {
        return false;
      }
    }
    // A mode that moves as a whole is not held at all.
    for (double& factor : frame.factor) {
      factor = std::fabs(factor) < zero_factor * most ? 0.0 : factor;
    }
  }
  return true;
}

Vector Eigenmodes::pull_of(const Frame& frame) const {
  Vector pull(frame.factor.size());
  for (const auto& [mass, force] : frame.pull) {
    pull += body_.root[mass] * force * frame.part_of(shape_[mass]);
  }
  return pull;
}

}  // namespace ressort
