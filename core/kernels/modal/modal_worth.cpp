#include "core/kernels/modal/modal_worth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace ressort {
namespace {

constexpr double least_ringing = 1e-4;  // share of lK: nearer to the aperiodic limit
constexpr double never = std::numeric_limits<double>::infinity();

using Row = std::vector<double>;

// How a mode rings: q = A r^n cos(...).
struct Ring {
  bool rings = false;
  double swing = 0.0;  // A of a blow of 1
  double kept = 0.0;   // r
};

Ring ring_of(double k, double z) {
  const double half = 0.5 * (k + z);
  const double depth = k - half * half;
  if (!(z < 1.0) || !(depth > least_ringing * k)) {
    return {};
  }
  return {true, std::sqrt((1.0 - z) / depth), std::sqrt(1.0 - z)};
}

class Scales {
 public:
  Scales(const Hearing& hearing, double most) : hearing_(hearing), most_(most) {
    for (std::size_t i = 0; i < hearing.stiffness.size(); ++i) {
      rings_.push_back(ring_of(hearing.stiffness[i], hearing.damping[i]));
    }
    for (const Row& blow : hearing.blows) {
      weigh_source([&](std::size_t i) { return rings_[i].swing * std::fabs(blow[i]); });
      weigh_source([&](std::size_t i) {
        return rings_[i].swing * std::fabs(blow[i]) / (1.0 - rings_[i].kept);
      });
    }
    weigh_source([&](std::size_t i) { return swing_at_start(i); });
  }

  Worth weigh() {
    Worth worth;
    worth.kept.resize(rings_.size());
    std::iota(worth.kept.begin(), worth.kept.end(), 0u);
    const Row loudness = loudness_of_modes();
    std::stable_sort(worth.kept.begin(), worth.kept.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return loudness[a] > loudness[b]; });
    std::vector<double> sums(shares_.size(), 0.0);
    while (!worth.kept.empty() && may_go(worth.kept.back(), sums)) {
      worth.left_out.push_back(worth.kept.back());
      worth.kept.pop_back();
    }
    for (const double sum : sums) {
      worth.share = std::max(worth.share, sum);
    }
    sort_by_life(worth.kept, loudness);
    return worth;
  }

 private:
  double swing_at_start(std::size_t i) const {
    const double k = hearing_.stiffness[i];
    const double z = hearing_.damping[i];
    const double q = hearing_.starts[0][i];
    const double d = hearing_.starts[1][i];
    const double square = k * q * q + (z - k) * q * d + (1.0 - z) * d * d;
    return rings_[i].swing * std::sqrt(std::max(square, 0.0));
  }

  // A source at every listener: each mode's share of all that ring. Undamped modes ring for ever:
  // where there are any, the sum over time is of no use.
  template <class Swing>
  void weigh_source(Swing&& swing) {
    for (const Row& listener : hearing_.listeners) {
      Row share(rings_.size(), 0.0);
      double all = 0.0;
      for (std::size_t i = 0; i < share.size(); ++i) {
        share[i] = rings_[i].rings && listener[i] != 0.0 ? swing(i) * std::fabs(listener[i]) : 0.0;
        all += share[i];
      }
      if (all > 0.0 && std::isfinite(all)) {
        for (double& s : share) {
          s /= all;
        }
        shares_.push_back(std::move(share));
      }
    }
  }

  Row loudness_of_modes() const {
    Row loudness(rings_.size(), 0.0);
    for (const Row& share : shares_) {
      for (std::size_t i = 0; i < loudness.size(); ++i) {
        loudness[i] = std::max(loudness[i], share[i]);
      }
    }
    for (std::size_t i = 0; i < loudness.size(); ++i) {
      loudness[i] = rings_[i].rings ? loudness[i] : never;
    }
    return loudness;
  }

  bool may_go(std::uint32_t mode, std::vector<double>& sums) const {
    for (std::size_t p = 0; p < sums.size(); ++p) {
      if (sums[p] + shares_[p][mode] > most_) {
        return false;
      }
    }
    for (std::size_t p = 0; p < sums.size(); ++p) {
      sums[p] += shares_[p][mode];
    }
    return rings_[mode].rings;
  }

  // By the time until a mode has fallen to a small part of the budget.
  void sort_by_life(std::vector<std::uint32_t>& modes, const Row& loudness) const {
    const double inaudible = 0.5 * std::min(most_, 1.0);
    Row life(rings_.size(), never);
    for (const std::uint32_t i : modes) {
      if (rings_[i].rings) {
        life[i] = std::log(std::max(loudness[i], 1e-30) / inaudible) /
                  std::max(-std::log(rings_[i].kept), 1e-15);
      }
    }
    std::stable_sort(modes.begin(), modes.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return life[a] > life[b]; });
  }

  const Hearing& hearing_;
  double most_;
  std::vector<Ring> rings_;  // [mode]
  std::vector<Row> shares_;  // [source at a listener][mode]
};

}  // namespace

Worth weigh(const Hearing& hearing, double most) {
  return Scales(hearing, most).weigh();
}

}  // namespace ressort
