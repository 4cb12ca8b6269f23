#include "core/kernels/modal/modal_body.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/groups.h"
#include "core/kernels/taps.h"
#include "core/laws/law.h"
#include "core/linear_algebra/eigen.h"

namespace ressort::kernels {

using namespace linear_algebra;

namespace {

// Each frame has a vector over all modes. With more frames the form would be too slow.
constexpr std::size_t most_frames = 256;
constexpr std::size_t most_runs = 65'536;
constexpr double shared_tolerance =
    1e-12;  // share of the largest element, below which an element off the diagonal counts as 0
constexpr double zero_factor = 1e-13;  // share of the largest, below which a factor counts as 0

void add_share(std::vector<MassShare>& shares, std::uint32_t mass, double weight) {
  for (MassShare& share : shares) {
    if (share.mass == mass) {
      share.weight += weight;
      return;
    }
  }
  shares.push_back({mass, weight});
}

constexpr std::uint32_t nowhere = 0xffffffffu;

class BodyMaker {
 public:
  BodyMaker(const Program& program, bool is_exact) : program_(program), is_exact_(is_exact) {
    body_.count = program.moving;
  }

  std::optional<LinearBody> make() {
    find_live_coefficients();
    if (program_.link_runs.size() > most_runs || has_sliding_ground() || has_moving_place() ||
        !weigh_masses()) {
      return std::nullopt;
    }
    read_nodes();
    if (!sort_links()) {
      return std::nullopt;
    }
    return std::move(body_);
  }

 private:
  void find_live_coefficients() {
    body_.is_live.assign(program_.coefficients.size(), false);
    for (const auto& depending : program_.depending) {
      for (const std::uint32_t c : depending) {
        body_.is_live[c] = !is_exact_ || has_parameter(program_.coefficients[c]);
      }
    }
    for (const Coefficient& coefficient : program_.coefficients) {
      const auto value = is_exact_ ? continuous_value : sampled_value;
      body_.value.push_back(value(program_, coefficient, program_.parameters, 1.0));
    }
    body_.input.assign(program_.position.size(), LinearBody::nowhere);
    for (std::uint32_t i = 0; i < program_.inputs.size(); ++i) {
      if (!program_.inputs[i].is_force) {
        body_.input[program_.inputs[i].node] = i;
      }
    }
  }

  // A sampled number of a body's mode depends on all of the mode's numbers. A continuous one
  // depends on itself alone: a changing T60 does not change the mass.
  bool has_parameter(const Coefficient& coefficient) const {
    const auto first = program_.steps.begin() + coefficient.first;
    return std::any_of(first, first + coefficient.count,
                       [](const Step& step) { return step.op == Op::parameter; });
  }

  std::size_t first_place() const {
    return program_.taps.empty() ? program_.position.size() : program_.taps[0].node;
  }

  // Grounds with a velocity, which links see although the ground stays, need the direct form.
  bool has_sliding_ground() const {
    for (std::uint32_t node = body_.count; node < first_place(); ++node) {
      if (body_.input[node] == LinearBody::nowhere && program_.velocity[node] != 0.0) {
        return true;
      }
    }
    return false;
  }
  bool has_moving_place() const {
    return std::any_of(program_.taps.begin(), program_.taps.end(), [&](const TapSlot& tap) {
      return body_.is_live[tap.u] || body_.is_live[tap.v];
    });
  }

  // Checks that all masses depend on one coefficient, or on none.
  bool weigh_masses() {
    body_.root = Vector(1.0, body_.count);
    const std::uint32_t first = program_.mass_runs.front().inverse_mass;
    const bool together =
        std::all_of(program_.mass_runs.begin(), program_.mass_runs.end(),
                    [&](const MassRun& run) { return run.inverse_mass == first; });
    body_.inverse_mass = together ? first : Modes::own_mass;
    for (const MassRun& run : program_.mass_runs) {
      const double inverse = body_.value[run.inverse_mass];
      if (!together &&
          (body_.is_live[run.inverse_mass] || !(inverse > 0.0) || !std::isfinite(inverse))) {
        return false;
      }
      body_.root[std::slice(run.first, run.count, 1)] = together ? 1.0 : std::sqrt(inverse);
    }
    return true;
  }

  void read_nodes() {
    for (std::uint32_t node = 0; node < program_.position.size(); ++node) {
      std::vector<MassShare> around;
      if (node < first_place()) {
        around.push_back({node, 1.0});
      } else {
        const TapSlot& tap = program_.taps[node - first_place()];
        const auto corners = corners_at(tap, body_.value[tap.u], body_.value[tap.v]);
        each_behind(program_, tap, corners, [&](std::uint32_t at, double weight) {
          if (weight != 0.0) {
            around.push_back({at, weight});
          }
        });
      }
      Readout readout;
      for (const MassShare& share : around) {
        if (share.mass < body_.count) {
          readout.shares.push_back(share);
        } else {
          readout.offset += share.weight * program_.position[share.mass];
        }
      }
      body_.readout.push_back(std::move(readout));
      body_.around.push_back(std::move(around));
    }
  }

  // Returns the frame of a coefficient. Constants that keys scale alike share a frame, which has
  // the coefficient of the first; the weight of a bar is relative to it.
  Frame& frame_of(std::vector<Frame>& frames, std::uint32_t c, bool is_late, double& weight) {
    weight = 1.0;
    for (Frame& frame : frames) {
      if (frame.is_late != is_late) {
        continue;
      }
      if (frame.coefficient == c) {
        return frame;
      }
      const bool is_alike =
          program_.coefficients[c].is_fixed == program_.coefficients[frame.coefficient].is_fixed;
      if (!body_.is_live[c] && !body_.is_live[frame.coefficient] && is_alike) {
        weight = body_.value[c] / body_.value[frame.coefficient];
        return frame;
      }
    }
    frames.push_back({.coefficient = c, .is_late = is_late});
    return frames.back();
  }

  void add_bar(std::vector<Frame>& frames, std::uint32_t c, bool is_late, Bar bar) {
    if (body_.is_nothing(c) || bar.shares.empty()) {
      return;
    }
    Frame& frame = frame_of(frames, c, is_late, bar.weight);
    for (const auto& [mass, weight] : bar.shares) {
      if (bar.position != 0.0) {
        add_share(frame.pull, mass, bar.weight * weight * bar.position);
      }
    }
    frame.bars.push_back(std::move(bar));
  }

  Bar bar_between(Ends ends) const {
    Bar bar{.shares = body_.readout[ends.a].shares};
    for (const auto& [mass, weight] : body_.readout[ends.b].shares) {
      add_share(bar.shares, mass, -weight);
    }
    std::erase_if(bar.shares, [](const MassShare& share) { return share.weight == 0.0; });
    bar.position = body_.readout[ends.b].offset - body_.readout[ends.a].offset;
    return bar;
  }

  // Adds linear links and oscillators to the frames. Returns false if there are too many frames.
  bool sort_links() {
    for (const MassRun& run : program_.mass_runs) {
      for (std::uint32_t i = run.first; run.is_oscillator && i < run.first + run.count; ++i) {
        add_bar(body_.stiffness, run.stiffness, false, {.shares = {{i, 1.0}}});
        add_bar(body_.damping, run.damping, false, {.shares = {{i, 1.0}}});
      }
    }
    for (const LinkRun& run : program_.link_runs) {
      for (std::uint32_t i = run.first; is_linear(run.law) && i < run.first + run.count; ++i) {
        Bar bar = bar_between(program_.ends[i]);
        add_bar(body_.stiffness, run.coefficients[0], true, bar);
        bar.position = 0.0;
        add_bar(body_.damping, run.coefficients[1], true, std::move(bar));
      }
      if (body_.stiffness.size() + body_.damping.size() > most_frames) {
        return false;
      }
    }
    return true;
  }

  const Program& program_;
  const bool is_exact_;
  LinearBody body_;
};

// Returns the share of a force on one node that acts at another. They may be grounds and inputs.
double share_felt(const LinearBody& body, std::uint32_t from, std::uint32_t at) {
  double sum = 0.0;
  for (const MassShare& pushed : body.around[from]) {
    for (const MassShare& felt : body.around[at]) {
      sum += pushed.mass == felt.mass ? pushed.weight * felt.weight : 0.0;
    }
  }
  return sum;
}

}  // namespace

Vector LinearBody::force_at(std::uint32_t node) const {
  Vector force(count);
  for (const auto& [mass, weight] : readout[node].shares) {
    force[mass] += weight;
  }
  return force;
}

FeltForce force_felt(const Program& program, const LinearBody& body, std::uint32_t node,
                     const Vector& rest, const std::map<std::uint32_t, std::uint32_t>& held) {
  FeltForce felt{.force = {.scale = 1.0 / (program.rate_ratio * program.rate_ratio)}};
  for (const LinkRun& run : program.link_runs) {
    std::vector<MassShare> shares;
    double constant = 0.0;
    for (std::uint32_t i = run.first; is_linear(run.law) && i < run.first + run.count; ++i) {
      const auto [a, b] = program.ends[i];
      const double share = share_felt(body, b, node) - share_felt(body, a, node);
      if (share == 0.0) {
        continue;
      }
      for (const std::uint32_t end : {a, b}) {
        const double weight = end == a ? share : -share;
        constant += weight * body.readout[end].offset;
        for (const auto& [mass, part] : body.readout[end].shares) {
          add_share(shares, mass, weight * part);
          constant += weight * part * rest[mass];
        }
        if (body.input[end] != LinearBody::nowhere) {
          felt.force.hands.push_back({.input = body.input[end],
                                      .stiffness = run.coefficients[0],
                                      .damping = run.coefficients[1],
                                      .start = program.position[end],
                                      .weight = weight});
        }
      }
    }
    if (!shares.empty() || constant != 0.0) {
      felt.force.parts.push_back({run.coefficients[0], false, constant, {}});
      felt.force.parts.push_back({run.coefficients[1], true, 0.0, {}});
      felt.shares.insert(felt.shares.end(), 2, shares);
    }
  }
  for (std::uint32_t i = 0; i < program.inputs.size(); ++i) {
    const double share = share_felt(body, program.inputs[i].node, node);
    if (program.inputs[i].is_force && share != 0.0) {
      felt.force.inputs.push_back({i, share});
    }
  }
  for (const auto& [at, end] : held) {
    if (const double share = share_felt(body, at, node); share != 0.0) {
      felt.force.ends.push_back({end, share});
    }
  }
  return felt;
}

std::optional<LinearBody> linear_body(const Program& program, bool is_exact) {
  return program.moving == 0 ? std::nullopt : BodyMaker(program, is_exact).make();
}

std::uint32_t most_tied_masses(const Program& program) {
  if (program.modes.empty()) {
    return program.moving;
  }
  Groups tied(program.moving);
  for (const LinkRun& run : program.link_runs) {
    for (std::uint32_t i = run.first; is_linear(run.law) && i < run.first + run.count; ++i) {
      std::uint32_t first = nowhere;
      const auto tie = [&](std::uint32_t node) {
        if (node < program.moving) {
          first = first == nowhere ? node : first;
          tied.join(node, first);
        }
      };
      for (const std::uint32_t end : {program.ends[i].a, program.ends[i].b}) {
        tie(end);
        for (const TapSlot& tap : program.taps) {
          for (std::uint32_t k = 0; tap.node == end && k < tap.length * tap.width; ++k) {
            tie(program.tap_nodes[tap.first + k]);
          }
        }
      }
    }
  }
  std::vector<std::uint32_t> count(program.moving);
  std::uint32_t most = 0;
  for (std::uint32_t i = 0; i < program.moving; ++i) {
    most = std::max(most, ++count[tied.find(i)]);
  }
  return most;
}

std::vector<std::vector<std::uint32_t>> tied_together(const LinearBody& body) {
  Groups tied(body.count);
  for (const auto* frames : {&body.stiffness, &body.damping}) {
    for (const Frame& frame : *frames) {
      for (const Bar& bar : frame.bars) {
        for (const MassShare& share : bar.shares) {
          tied.join(share.mass, bar.shares[0].mass);
        }
      }
    }
  }
  std::map<std::uint32_t, std::vector<std::uint32_t>> groups;
  for (std::uint32_t mass = 0; mass < body.count; ++mass) {
    groups[tied.find(mass)].push_back(mass);
  }
  std::vector<std::vector<std::uint32_t>> parts;
  for (auto& [root, masses] : groups) {
    parts.push_back(std::move(masses));
  }
  return parts;
}

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

// Computes the factors bar by bar: as sums of squares they have a small relative error even if
// small.
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
    // Rigid-body modes have a factor of exactly 0.
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

}  // namespace ressort::kernels
