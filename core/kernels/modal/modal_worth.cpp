#include "core/kernels/modal/modal_worth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace ressort::kernels {
namespace {

constexpr double least_ringing = 1e-4;  // share of lK; modes nearer to critical damping do not ring
constexpr double never = std::numeric_limits<double>::infinity();
constexpr double most_work = 1e7;  // operations for the peaks
constexpr std::size_t least_samples = 128;
constexpr std::size_t most_samples = 4096;

using Row = std::vector<double>;

// The free motion of a mode, q = A r^n cos(...).
struct Ring {
  bool rings = false;
  double swing = 0.0;  // A for a unit impulse
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

// The matrix that advances q and d of a mode by some samples.
struct Advance {
  static Advance of(double k, double z, std::size_t steps) {
    Advance power{1.0, 0.0, 0.0, 1.0};
    for (Advance square{1.0 - k, 1.0 - z, -k, 1.0 - z}; steps > 0; steps /= 2) {
      power = steps % 2 == 1 ? power * square : power;
      square = square * square;
    }
    return power;
  }
  Advance operator*(const Advance& b) const {
    return {qq * b.qq + qd * b.dq, qq * b.qd + qd * b.dd, dq * b.qq + dd * b.dq,
            dq * b.qd + dd * b.dd};
  }

  double qq, qd, dq, dd;
};

class Scales {
 public:
  Scales(const ModalResponse& hearing, double most) : hearing_(hearing), most_(most) {
    for (std::size_t i = 0; i < hearing.stiffness.size(); ++i) {
      rings_.push_back(ring_of(hearing.stiffness[i], hearing.damping[i]));
    }
    for (const Row& blow : hearing.blows) {
      const Row peaks = peaks_of(blow, blow);  // one sample later
      weigh_source([&](std::size_t i) { return rings_[i].swing * std::fabs(blow[i]); }, peaks);
      weigh_source(
          [&](std::size_t i) {
            return rings_[i].swing * std::fabs(blow[i]) / (1.0 - rings_[i].kept);
          },
          {});
    }
    weigh_source([&](std::size_t i) { return swing_at_start(i); },
                 peaks_of(hearing.starts[0], hearing.starts[1]));
  }

  ModeSelection select_modes() {
    ModeSelection worth;
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

  // Returns the peak at each listener of the free motion from this q and d. It samples the first
  // samples, and then at a spacing that reaches half a period of the slowest mode.
  Row peaks_of(Row q, Row d) const {
    const std::size_t modes = rings_.size();
    Row peaks(hearing_.listeners.size(), 0.0);
    Row ringing_peaks = peaks;  // without modes that drift
    const auto listen = [&] {
      for (std::size_t l = 0; l < peaks.size(); ++l) {
        double heard = 0.0;
        double ringing = 0.0;
        for (std::size_t i = 0; i < modes; ++i) {
          const double part = hearing_.listeners[l][i] * q[i];
          heard += part;
          ringing += rings_[i].rings ? part : 0.0;
        }
        peaks[l] = std::max(peaks[l], std::fabs(heard));
        ringing_peaks[l] = std::max(ringing_peaks[l], std::fabs(ringing));
      }
    };
    const double per_sample =
        static_cast<double>(modes * (peaks.size() + 2) * (hearing_.blows.size() + 1));
    const auto samples = static_cast<std::size_t>(std::clamp(most_work / std::max(per_sample, 1.0),
                                                             static_cast<double>(least_samples),
                                                             static_cast<double>(most_samples)));
    double slowest = 1.0;
    for (std::size_t i = 0; i < modes; ++i) {
      slowest = rings_[i].rings ? std::min(slowest, hearing_.stiffness[i]) : slowest;
    }
    const double half_period = std::min(4.0 / std::sqrt(std::max(slowest, 1e-16)), 1e8);
    const auto apart =
        static_cast<std::size_t>(std::ceil(2.0 * half_period / static_cast<double>(samples)));
    listen();
    for (const std::size_t steps : {std::size_t{1}, std::max<std::size_t>(apart, 1)}) {
      std::vector<Advance> advance;
      for (std::size_t i = 0; i < modes; ++i) {
        advance.push_back(Advance::of(hearing_.stiffness[i], hearing_.damping[i], steps));
      }
      for (std::size_t n = 0; n < samples / 2; ++n) {
        for (std::size_t i = 0; i < modes; ++i) {
          const double now = q[i];
          q[i] = advance[i].qq * now + advance[i].qd * d[i];
          d[i] = advance[i].dq * now + advance[i].dd * d[i];
        }
        listen();
      }
    }
    for (std::size_t l = 0; l < peaks.size(); ++l) {
      peaks[l] = std::min(peaks[l], ringing_peaks[l]);
    }
    return peaks;
  }

  // Computes each mode's share of the peak at each pair of a source and a listener. Without a peak,
  // the share of the sum over all modes that ring. With undamped modes the sum over time diverges
  // and is not used.
  template <class Swing>
  void weigh_source(Swing&& swing, const Row& peaks) {
    for (std::size_t l = 0; l < hearing_.listeners.size(); ++l) {
      const Row& listener = hearing_.listeners[l];
      Row share(rings_.size(), 0.0);
      double all = 0.0;
      for (std::size_t i = 0; i < share.size(); ++i) {
        share[i] = rings_[i].rings && listener[i] != 0.0 ? swing(i) * std::fabs(listener[i]) : 0.0;
        all += share[i];
      }
      if (all > 0.0 && !peaks.empty()) {
        all = std::min(all, std::max(peaks[l], 1e-30 * all));
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

  // Sorts by the time in which a mode decays to a small part of the budget.
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

  const ModalResponse& hearing_;
  double most_;
  std::vector<Ring> rings_;  // [mode]
  std::vector<Row> shares_;  // [source at a listener][mode]
};

}  // namespace

ModeSelection select_modes(const ModalResponse& hearing, double most) {
  return Scales(hearing, most).select_modes();
}

}  // namespace ressort::kernels
