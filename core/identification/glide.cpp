#include "core/identification/glide.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <span>

#include "core/identification/bands.h"
#include "core/identification/fit.h"

namespace ressort::identification {
namespace {

constexpr double analysed_s = 1.0;
constexpr double least_rate_hz = 2500.0;
constexpr double highest = 0.4;  // analysed frequency, relative to this rate
constexpr double lowest_tone_hz = 30.0;
constexpr std::size_t most_modes = 5;
constexpr double most_size = 0.26;         // 450 cents
constexpr double most_correlation = 0.98;  // of the errors of size and decay
// A glide counts if it leaves less than this share of what as many modes alone leave.
constexpr double much_less = 0.8;
// A number of modes is enough if it leaves at most this ratio of the least, and this share of all.
constexpr double about = 1.25;
constexpr double negligible = 1e-3;
constexpr double certain = 3.0;  // number of standard deviations between the size and 0

// A sinc with a Hann window, at `parts` places between two samples.
class Interpolation {
 public:
  Interpolation() {
    for (std::size_t row = 0; row <= parts; ++row) {
      for (std::size_t k = 0; k < taps; ++k) {
        const double away = static_cast<double>(row) / parts - tap(k);
        const double turn = std::numbers::pi * away;
        const double window = std::cos(turn / taps);
        table_[row * taps + k] = away == 0.0 ? 1.0 : window * window * std::sin(turn) / turn;
      }
    }
  }
  // Returns the sound between samples. It is 0 before its start and after its end.
  double operator()(const std::vector<double>& sound, double time) const {
    const double whole = std::floor(time);
    const double place = (time - whole) * parts;
    const auto row = static_cast<std::size_t>(place);
    const double share = place - static_cast<double>(row);
    const double* const here = &table_[row * taps];
    double sum = 0.0;
    for (std::size_t k = 0; k < taps; ++k) {
      const double n = whole + tap(k);
      if (n >= 0.0 && n < static_cast<double>(sound.size())) {
        sum += sound[static_cast<std::size_t>(n)] * (here[k] + share * (here[k + taps] - here[k]));
      }
    }
    return sum;
  }

 private:
  static constexpr std::size_t taps = 32;
  static constexpr std::size_t parts = 512;
  static double tap(std::size_t k) { return static_cast<double>(k) - (taps / 2.0 - 1.0); }

  std::array<double, taps*(parts + 1)> table_{};
};

const Interpolation& interpolation() {
  static const Interpolation only;
  return only;
}

// Returns the times at which modes of constant frequency have the phases 0, 1, 2 and so on.
std::vector<double> times_of(const Glide& glide, std::size_t frames) {
  std::vector<double> times;
  const double last = glide.straight(static_cast<double>(frames) - 1.0);
  double time = 0.0;
  for (double phase = 0.0; phase <= last; phase += 1.0) {
    for (int step = 0; step < 3; ++step) {  // Newton's method from the previous sample's time
      time += (phase - glide.straight(time)) / std::exp(glide.size * std::exp(-time / glide.decay));
    }
    times.push_back(std::max(0.0, time));
  }
  return times;
}

// A low band of the sound, whose modes are fitted at several glides.
class GlideFit {
 public:
  GlideFit(const Channels& sound, double rate_hz, const Progress& progress)
      : step_(std::bit_floor(
            std::max<std::size_t>(1, static_cast<std::size_t>(rate_hz / least_rate_hz)))),
        progress_(progress) {
    for (const std::vector<double>& channel : sound) {
      const auto frames = std::min(channel.size(), static_cast<std::size_t>(analysed_s * rate_hz));
      const BandSplit split(std::span<const double>(channel).first(frames));
      low_.push_back(split.between(0.0, highest / static_cast<double>(step_), step_));
    }
    const double lowest_omega =
        2.0 * std::numbers::pi * lowest_tone_hz * static_cast<double>(step_) / rate_hz;
    grid_ = damped_grid(lowest_omega, 2.0 * std::numbers::pi * highest, 1.06, 400.0);
  }

  // Chooses modes one after the other, those that explain the most. Returns the energy that each
  // number of them leaves, from one mode on.
  std::vector<double> choose(const Glide& glide, std::size_t count = most_modes) {
    const Straight straight = without(glide);
    std::vector<double> left;
    poles_.clear();
    while (left.size() < count) {
      DampedFit fit(straight.sound);
      fit.limit(grid_.front().imag(), 0.0);
      fit.set_poles(poles_);
      const std::vector<double> explained = explained_energies(fit.rest(), grid_);
      progress_.spend(grid_.size() * straight.weights.size() / 4);
      const auto best = std::ranges::max_element(explained) - explained.begin();
      poles_.push_back(grid_[static_cast<std::size_t>(best)]);
      left.push_back(refine(straight, 6));
    }
    return left;
  }
  // Returns the damping of the first mode, per sample of the sound.
  double damping() const { return -poles_[0].real() / static_cast<double>(step_); }
  const std::vector<Complex>& poles() const { return poles_; }
  void set_poles(const std::vector<Complex>& poles) { poles_ = poles; }
  // Moves the chosen modes and returns the energy left.
  double refine(const Glide& glide) { return refine(without(glide), 30); }
  double energy() const { return energy_in(low_); }
  double freedoms() const {
    return 2.0 * highest * static_cast<double>(low_.size() * low_[0].size());
  }

 private:
  struct Straight {
    Channels sound;
    std::vector<double> weights;  // of the samples' energies, as in the sound with its glide
  };
  Straight without(Glide glide) const {
    glide.decay /= static_cast<double>(step_);
    glide.damping *= static_cast<double>(step_);
    Straight straight{without_glide(low_, glide), {}};
    for (const double time : times_of(glide, low_[0].size())) {
      const auto phase = static_cast<double>(straight.weights.size());
      straight.weights.push_back(std::exp(2.0 * glide.damping * (phase - time) -
                                          glide.size * std::exp(-time / glide.decay)));
    }
    // The first samples contain the transient of the band's filter.
    straight.weights.erase(straight.weights.begin(), straight.weights.begin() + left_out);
    for (std::vector<double>& channel : straight.sound) {
      channel.erase(channel.begin(), channel.begin() + left_out);
    }
    return straight;
  }
  double refine(const Straight& straight, int steps) {
    DampedFit fit(straight.sound);
    fit.limit(grid_.front().imag(), 0.0);
    if (!fit.set_poles(poles_)) {
      return HUGE_VAL;
    }
    fit.refine(steps, 1e-7, progress_);
    poles_ = poles_of(fit.modes());
    double left = 0.0;
    for (const std::vector<double>& channel : fit.rest()) {
      for (std::size_t n = 0; n < channel.size(); ++n) {
        left += straight.weights[n] * channel[n] * channel[n];
      }
    }
    return left;
  }

  static constexpr int left_out = 16;

  Channels low_;
  std::size_t step_;
  std::vector<Complex> grid_;  // log z of the modes to choose from
  std::vector<Complex> poles_;
  const Progress& progress_;
};

Glide moved(const Glide& glide, double size, double log_decay) {
  return {glide.size + size, glide.decay * std::exp(log_decay), glide.damping};
}

// The energy left at a glide and at its neighbours, which differ by steps of the size and of the
// logarithm of the decay.
struct Neighbours {
  Neighbours(GlideFit& fit, const Glide& glide)
      : size_step(std::max(0.002, 0.1 * glide.size)), left(fit.refine(glide)), lowest_left(left) {
    const std::vector<Complex> poles = fit.poles();
    const auto left_at = [&](double size, double log_decay) {
      fit.set_poles(poles);
      const Glide there = moved(glide, size, log_decay);
      const double energy = fit.refine(there);
      lowest = energy < lowest_left ? there : lowest;
      lowest_left = std::min(lowest_left, energy);
      return energy;
    };
    larger = left_at(size_step, 0.0);
    smaller = left_at(-size_step, 0.0);
    slower = left_at(0.0, decay_step);
    faster = left_at(0.0, -decay_step);
    both = left_at(size_step, decay_step);
    neither = left_at(-size_step, -decay_step);
    fit.set_poles(poles);
  }
  // Returns the mixed second derivative. The modes may settle elsewhere in the corners, so it is
  // limited to what a minimum allows beside the other two.
  double mixed(double of_size, double of_decay) const {
    const double found = (both + neither - larger - smaller - slower - faster + 2.0 * left) /
                         (2.0 * size_step * decay_step);
    const double most = most_correlation * std::sqrt(std::fabs(of_size * of_decay));
    return std::clamp(found, -most, most);
  }

  static constexpr double decay_step = 0.1;
  double size_step;
  double left;
  Glide lowest;  // the neighbour that leaves the least, if that is less than `left`
  double lowest_left;
  double larger, smaller;
  double slower, faster;
  double both, neither;
};

struct TriedGlide {
  Glide glide;
  double left = 0.0;
  std::vector<Complex> poles = {};
};

// Finds the nearest glide that leaves the least to the chosen modes, by Newton's method with
// damping, or from neighbour to neighbour.
TriedGlide descended(GlideFit& fit, const Glide& start) {
  TriedGlide best{start, fit.refine(start)};
  best.glide.damping = fit.damping();
  best.left = fit.refine(best.glide);
  double damping = 0.1;
  for (int step = 0; step < 20 && damping < 1e3; ++step) {
    const std::vector<Complex> poles = fit.poles();
    const Neighbours near(fit, best.glide);
    const double h = near.size_step;
    const double g = Neighbours::decay_step;
    const double size_slope = (near.larger - near.smaller) / (2.0 * h);
    const double decay_slope = (near.slower - near.faster) / (2.0 * g);
    const double a =
        std::fabs(near.larger + near.smaller - 2.0 * near.left) / (h * h) * (1.0 + damping);
    const double d =
        std::fabs(near.slower + near.faster - 2.0 * near.left) / (g * g) * (1.0 + damping);
    const double b = near.mixed(a, d);
    const double determinant = a * d - b * b;
    Glide next = moved(best.glide, -(d * size_slope - b * decay_slope) / determinant,
                       std::clamp(-(a * decay_slope - b * size_slope) / determinant, -1.0, 1.0));
    const auto left_at = [&](const Glide& glide) {
      fit.set_poles(poles);
      return glide.size > 0.0 && glide.size < most_size ? fit.refine(glide) : HUGE_VAL;
    };
    double left = left_at(next);
    if (!(left < best.left)) {
      next = near.lowest;
      left = left_at(next);
    }
    if (!(left < best.left)) {
      fit.set_poles(poles);
      damping = 10.0 * damping + 0.1;
      continue;
    }
    damping *= 0.1;
    const bool is_settled = best.left - left < 1e-6 * left;
    best.glide = next;
    best.glide.damping = fit.damping();
    best.left = fit.refine(best.glide);
    if (is_settled) {
      break;
    }
  }
  best.poles = fit.poles();
  return best;
}

}  // namespace

double Glide::straight(double time) const {
  // The integral of exp(size e^(-t / decay)), by the power series of exp.
  constexpr int terms = 5;
  const double kept = std::exp(-time / decay);
  double sum = 0.0;
  double kept_power = 1.0;
  double size_power = 1.0;  // size^n / n!
  for (int n = 1; n <= terms; ++n) {
    kept_power *= kept;
    size_power *= size / n;
    sum += size_power / n * (1.0 - kept_power);
  }
  return time + decay * sum;
}

double Glide::true_damping(double fitted) const {
  const double part = 2.0 * fitted / (2.0 * fitted + 1.0 / decay);
  const double share = size * part * part;
  return (fitted - damping * share) / (1.0 - share);
}

Channels without_glide(const Channels& sound, const Glide& glide) {
  if (glide.size == 0.0) {
    return sound;
  }
  const std::vector<double> times = times_of(glide, sound[0].size());
  Channels straight;
  for (const std::vector<double>& channel : sound) {
    std::vector<double>& samples = straight.emplace_back();
    for (const double time : times) {
      const auto phase = static_cast<double>(samples.size());
      samples.push_back(std::exp(-glide.damping * (phase - time)) * interpolation()(channel, time));
    }
  }
  return straight;
}

FoundGlide find_glide(const Channels& sound, double rate_hz, const Progress& progress) {
  progress.stage("searching for a falling pitch");
  GlideFit fit(sound, rate_hz, progress);
  const std::vector<double> without = fit.choose({});
  std::vector<TriedGlide> candidates;
  for (const double left : without) {
    candidates.push_back({{}, left});
  }
  for (const double cents : {20.0, 50.0, 100.0, 200.0}) {
    for (const double decay_s : {0.03, 0.08, 0.2}) {
      const Glide tried{cents * std::numbers::ln2 / 1200.0, decay_s * rate_hz};
      const std::vector<double> left = fit.choose(tried);
      for (std::size_t k = 0; k < most_modes; ++k) {
        if (left[k] < candidates[k].left) {
          candidates[k] = {tried, left[k]};
        }
      }
    }
  }
  // More modes than needed replace the glide, so the fewest count that leave about as little.
  double least = HUGE_VAL;
  for (std::size_t k = 0; k < most_modes; ++k) {
    if (candidates[k].left < much_less * without[k]) {
      fit.choose(candidates[k].glide, k + 1);
      candidates[k] = descended(fit, candidates[k].glide);
      least = std::min(least, candidates[k].left);
    }
  }
  std::size_t count = 1;
  while (count < most_modes &&
         !(candidates[count - 1].left <= about * least + negligible * fit.energy())) {
    ++count;
  }
  const auto& [glide, left, poles] = candidates[count - 1];
  // The Bayesian information criterion. Each mode of a channel has four numbers.
  const auto criterion = [&](double energy, std::size_t modes) {
    return fit.freedoms() * std::log(energy) +
           4.0 * static_cast<double>(modes) * std::log(fit.freedoms());
  };
  for (std::size_t k = 0; k < most_modes; ++k) {
    if (glide.size == 0.0 || criterion(left, count) > criterion(without[k], k + 1)) {
      return {};
    }
  }
  fit.set_poles(poles);
  // Each second derivative is that of the flatter side, because the energy grows more slowly
  // towards longer decays.
  const Neighbours near(fit, glide);
  const double of_size =
      2.0 * (std::min(near.larger, near.smaller) - near.left) / (near.size_step * near.size_step);
  const double of_decay = 2.0 * (std::min(near.slower, near.faster) - near.left) /
                          (Neighbours::decay_step * Neighbours::decay_step);
  if (!(of_size > 0.0) || !(of_decay > 0.0)) {
    return {};
  }
  const double of_both = near.mixed(of_size, of_decay);
  // The covariance is twice the variance of the noise times the inverse of the second derivatives.
  const double variance = 2.0 * left / fit.freedoms() / (of_size * of_decay - of_both * of_both);
  const double size = std::sqrt(variance * of_decay);
  const double along = -variance * of_both / size;
  const double across = std::sqrt(std::max(0.0, variance * of_size - along * along));
  if (glide.size < certain * size) {
    return {};
  }
  return {.glide = glide, .steps = {{size, glide.decay * along}, {0.0, glide.decay * across}}};
}

}  // namespace ressort::identification
