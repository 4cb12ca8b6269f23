#include "core/kernels/waveguides/design.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

namespace ressort::kernels {
namespace {

using Complex = std::complex<double>;

constexpr double turn = 2.0 * std::numbers::pi;
// Longest delay of the allpass in samples; the shortest is one less.
constexpr double most_allpass_delay = 1.5;
// Tolerance for a delay halfway between two N: the lower N is taken, whatever the rounding.
constexpr double tie = 1e-9;
constexpr int halvings = 12;
constexpr int line_steps = 3;
constexpr int most_newton_steps = 12;

// NaN becomes the lowest value.
double within(double value, double lowest, double highest) {
  return value > lowest ? std::min(value, highest) : lowest;
}

// Returns 1 - 1/z at the pole z = e^(theta j - decay) without cancellation.
Complex rise_at(double decay, double theta) {
  const double half = std::sin(0.5 * theta);
  const double size = std::exp(decay);
  return {2.0 * size * half * half - std::expm1(decay), size * std::sin(theta)};
}

// Returns ln((1 - a)/(1 - a/z)), the loss filter without its gain, where 1 - a = e^room.
Complex log_of_loss(double room, Complex rise) {
  return -std::log(1.0 + std::expm1(-room) * rise);
}

// Returns its derivative by `room`.
Complex slope_of_loss(double room, Complex rise) {
  return rise / (std::exp(room) - std::expm1(room) * rise);
}

// The loop with a delay of any length in place of N and the allpass, at its pole.
struct Line {
  double log_gain;
  double decay;  // per sample
  double theta;  // the pole's angle
  Complex rise;

  // Returns the delay for which the phase is right.
  double delay(double room) const { return (turn + log_of_loss(room, rise).imag()) / theta; }
  // Returns the excess of the loop gain at that delay. It falls as `room` falls.
  double over(double room) const {
    return log_gain + log_of_loss(room, rise).real() + decay * delay(room);
  }
};

// Finds the `room` at which the gain is right as well: by bisection, because 1 - a may be small,
// then by Newton's method.
double room_of(const Line& line) {
  double low = -60.0;
  double high = 0.0;
  if (!(line.over(0.0) > 0.0)) {
    return 0.0;
  }
  for (int i = 0; i < halvings; ++i) {
    const double middle = 0.5 * (low + high);
    (line.over(middle) > 0.0 ? high : low) = middle;
  }
  for (int i = 0; i < line_steps; ++i) {
    const Complex by_room = slope_of_loss(low, line.rise);
    low -= line.over(low) / (by_room.real() + line.decay * by_room.imag() / line.theta);
  }
  return low;
}

struct Loop {
  double log_gain;
  double decay;
  double theta;
  Complex rise;
  double samples;
  Complex back = std::polar(std::exp(decay), -theta);  // 1/z at the pole

  // Returns ln L(z). The next functions return its derivatives by ln(1 - a) and by the allpass.
  Complex log(double room, double allpass) const {
    return log_gain + log_of_loss(room, rise) +
           std::log((allpass + back) / (1.0 + allpass * back)) + samples * Complex(decay, -theta);
  }
  Complex by_room(double room) const { return rise / (std::exp(room) - std::expm1(room) * rise); }
  Complex by_allpass(double allpass) const {
    return 1.0 / (allpass + back) - back / (1.0 + allpass * back);
  }
};

// Newton's method for the allpass and the loss, with N samples fixed.
void refine(const Loop& loop, double room, WaveguideDesign& design) {
  double c = design.allpass;
  for (int i = 0; i < most_newton_steps; ++i) {
    const Complex log = loop.log(room, c);
    const Complex off(log.real(), std::remainder(log.imag(), turn));
    const Complex by_a = slope_of_loss(room, loop.rise);
    const Complex by_c = loop.by_allpass(c);
    const double determinant = by_a.real() * by_c.imag() - by_a.imag() * by_c.real();
    const double step_a = (off.real() * by_c.imag() - off.imag() * by_c.real()) / determinant;
    const double step_c = (by_a.real() * off.imag() - by_a.imag() * off.real()) / determinant;
    if (!std::isfinite(step_a) || !std::isfinite(step_c)) {
      return;
    }
    room -= step_a;
    c -= step_c;
    if (!(std::fabs(c) < 1.0)) {
      return;
    }
    if (std::fabs(step_a) < 1e-14 && std::fabs(step_c) < 1e-14) {
      break;
    }
  }
  if (room <= 0.0) {  // A negative pole would amplify the highest frequencies.
    design.pole = -std::expm1(room);
    design.allpass = c;
  }
}

// The same if all partials decay equally: the gain is the unknown.
void refine_flat(const Loop& loop, WaveguideDesign& design) {
  for (int i = 0; i < most_newton_steps; ++i) {
    const double off = std::remainder(loop.log(0.0, design.allpass).imag(), turn);
    const double step = off / loop.by_allpass(design.allpass).imag();
    if (!(std::fabs(design.allpass - step) < 1.0)) {
      return;
    }
    design.allpass -= step;
    if (std::fabs(step) < 1e-15) {
      break;
    }
  }
  design.gain = std::min(1.0, design.gain * std::exp(-loop.log(0.0, design.allpass).real()));
}

}  // namespace

double highest_waveguide_hz(std::uint32_t least_samples, double rate_hz) {
  return rate_hz / (least_samples + most_allpass_delay);
}

WaveguideDesign design_waveguide(const WaveguideNumbers& numbers, std::uint32_t least_samples,
                                 std::uint32_t most_samples, double rate_hz) {
  const double hz =
      within(numbers.frequency_hz, rate_hz / (most_samples + most_allpass_delay - 1.0),
             highest_waveguide_hz(least_samples, rate_hz));
  const double t60 = std::max(within(numbers.t60_s, 0.0, HUGE_VAL), least_t60_periods / hz);
  const double brightness = within(numbers.brightness, 0.0, 1.0);
  const double theta = turn * hz / rate_hz;
  const double decay = 3.0 * std::numbers::ln10 / (t60 * rate_hz);  // Per sample.
  const double loss = decay * rate_hz / hz;                         // Per period.

  const Complex rise = rise_at(decay, theta);
  Line line{-loss * brightness, decay, theta, rise};
  double room = brightness < 1.0 ? room_of(line) : 0.0;
  // The loss filter has a delay, too. If it would exceed the loop's, the filter is left out.
  if (line.delay(room) < least_samples + most_allpass_delay - 1.0) {
    room = 0.0;
    line.log_gain = -loss;
  }
  const double delay = line.delay(room);
  WaveguideDesign design{.samples = static_cast<std::uint32_t>(
                             std::clamp(std::floor(delay - most_allpass_delay + 1.0 - tie),
                                        double(least_samples), double(most_samples))),
                         .period = rate_hz / hz,
                         .pole = -std::expm1(room),
                         .gain = std::exp(line.log_gain)};
  const double rest = (delay - design.samples) * theta;  // Phase left for the allpass, in radians.
  design.allpass = std::sin(0.5 * (theta - rest)) / std::sin(0.5 * (theta + rest));
  const Loop loop{line.log_gain, decay, theta, rise, double(design.samples)};
  room < 0.0 ? refine(loop, room, design) : refine_flat(loop, design);
  return design;
}

void find_places(const WaveguideDesign& design, const FiltersAt& filters, std::span<const double> u,
                 std::span<std::uint32_t> order, std::span<std::uint32_t> delays) {
  const double least_u = 1.0 / design.period;  // Half a sample from an end.
  const auto runs_right = [](std::uint32_t i) { return i % 2 == 1; };
  const auto rank = [&](std::uint32_t i) {
    return order_from_filters(filters, u[i / 2], runs_right(i));
  };
  const auto share = [&](std::uint32_t i) {
    return share_from_filters(filters, within(u[i / 2], least_u, 1.0 - least_u), runs_right(i));
  };
  const auto count = static_cast<std::uint32_t>(2 * u.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    order[i] = i;
    for (std::uint32_t k = i; k > 0 && rank(order[k]) < rank(order[k - 1]); --k) {
      std::swap(order[k], order[k - 1]);
    }
  }
  const long held = std::lround(filters.to_held * design.period);
  std::uint32_t least = 1;
  for (std::uint32_t k = 0; k < count; ++k) {
    const long nearest = held + std::lround((share(order[k]) - filters.to_held) * design.period);
    delays[order[k]] = std::max(static_cast<std::uint32_t>(std::max(nearest, 0l)), least);
    least = delays[order[k]] + 1;
  }
  std::uint32_t most = design.samples;
  for (std::uint32_t k = count; k-- > 0;) {
    delays[order[k]] = std::min(delays[order[k]], most);
    most = delays[order[k]] - 1;
  }
}

}  // namespace ressort::kernels
