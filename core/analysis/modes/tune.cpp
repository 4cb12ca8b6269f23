#include "core/analysis/modes/tune.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/analysis/modes/scaling.h"
#include "core/format.h"
#include "core/linear_algebra/eigen.h"
#include "core/model/topology.h"

namespace ressort::analysis {
namespace {

using Complex = std::complex<double>;

// Relative error of a frequency or decay that ends the iteration.
constexpr double near_enough = 1e-9;
constexpr int most_steps = 300;
constexpr int most_stalls = 12;

std::string hertz(double frequency_hz) {
  return formatted("%.2f Hz", frequency_hz);
}

// Computes the modes of one network while the factors of its lines change.
class ModeTuner {
 public:
  ModeTuner(const Network& network, std::span<const double> parameters, std::string_view part,
            const ModeOptions& options)
      : options_(options),
        e_(scheme_e(options.scheme)),
        rate_hz_(Network::reference_rate_hz / scheme_step(options)) {
    auto lines = spring_lines(network, part);
    if (!lines) {
      failure_ = lines.error();
      return;
    }
    lines_ = *std::move(lines);
    const Network expanded = evaluated(expand_macros(network), parameters);
    system_ =
        make_linear_system(expanded, scheme_step(options), options.scheme == ModeScheme::published);
    of_ = lines_of(network, expanded, system_, lines_);
    if (!system_.is_sound) {
      failure_ = Error{"a mass is not above 0, or a stiffness or damping is not finite"};
    }
    stiffness.assign(lines_.size(), 1.0);
    damping.assign(lines_.size(), 1.0);
  }

  const std::optional<Error>& failure() const { return failure_; }
  const std::vector<SpringLine>& lines() const { return lines_; }

  Result<Done> find(std::size_t count) {
    std::vector<double> k(system_.springs.size(), 1.0);
    std::vector<double> z(k);
    for (std::size_t s = 0; s < k.size(); ++s) {
      if (of_[s] < lines_.size()) {
        k[s] = stiffness[of_[s]];
        z[s] = damping[of_[s]];
      }
    }
    ModeOptions options = options_;
    options.count = count;
    auto found = find_swings(system_, options, k, z);
    if (!found) {
      return found.error();
    }
    swings = std::move(found->swings.all);
    return Done{};
  }

  double frequency_hz(const Swing& swing) const {
    return pole_of(swing.mu, options_.scheme).imag() * rate_hz_ / (2.0 * std::numbers::pi);
  }
  Complex pole(const Swing& swing) const { return pole_of(swing.mu, options_.scheme); }

  // Converts a frequency and a decay to a pole.
  double angle(double frequency_hz) const {
    return 2.0 * std::numbers::pi * frequency_hz / rate_hz_;
  }
  double growth(double t60_s) const { return -3.0 * std::numbers::ln10 / (t60_s * rate_hz_); }

  // Derivatives of the pole by the logarithm of each line's factor.
  struct Slopes {
    std::vector<Complex> stiffness;  // [line]
    std::vector<Complex> damping;
  };
  Slopes slopes(const Swing& swing) const {
    Slopes out{std::vector<Complex>(lines_.size()), std::vector<Complex>(lines_.size())};
    const Complex is(0.0, 2.0 * swing.mu.imag());
    for (std::size_t s = 0; s < system_.springs.size(); ++s) {
      const std::size_t line = of_[s];
      if (line == lines_.size()) {
        continue;
      }
      const ModalSpring& spring = system_.springs[s];
      Complex stretch;
      for (const auto& [row, share] : system_.of(spring)) {
        stretch += share * swing.shape[row];
      }
      const Complex square = stretch * stretch / is;
      out.stiffness[line] -= spring.stiffness * stiffness[line] * square;
      out.damping[line] -=
          spring.damping * damping[line] * swing.mu / (1.0 + e_ * swing.mu) * square;
    }
    return out;
  }

  std::vector<Swing> swings;
  std::vector<double> stiffness;  // [line] Factors.
  std::vector<double> damping;

 private:
  ModeOptions options_;
  double e_;
  double rate_hz_;
  std::vector<SpringLine> lines_;
  LinearSystem system_;
  std::vector<std::size_t> of_;  // [spring of the system] Its line.
  std::optional<Error> failure_;
};

// Returns the similarity of two shapes, 0 to 1 (modal assurance criterion).
double likeness(const ComplexVector& a, const ComplexVector& b) {
  Complex both;
  double aa = 0.0;
  double bb = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    both += std::conj(a[i]) * b[i];
    aa += std::norm(a[i]);
    bb += std::norm(b[i]);
  }
  return std::abs(both) / std::sqrt(aa * bb);
}

}  // namespace

Result<Tuned> tune_mode(const Network& network, std::span<const double> parameters,
                        const TuneTarget& target, const ModeOptions& options) {
  ModeTuner tuner(network, parameters, target.part, options);
  if (tuner.failure()) {
    return *tuner.failure();
  }
  const std::size_t count = target.mode + 12;  // Includes neighbours, which may change places.
  if (auto found = tuner.find(count); !found) {
    return found.error();
  }
  if (target.mode >= tuner.swings.size()) {
    return Error{"there is no mode " + std::to_string(target.mode + 1) + "; there are " +
                 std::to_string(tuner.swings.size())};
  }
  Swing swing = tuner.swings[target.mode];
  const std::string what = "mode " + std::to_string(target.mode + 1) + " cannot be tuned to ";
  double k = 0.0;  // Logarithms of the factors.
  double z = 0.0;
  for (int step = 0; step < most_steps; ++step) {
    const Complex pole = tuner.pole(swing);
    const double high = tuner.angle(target.frequency_hz) - pole.imag();
    const double loud = target.t60_s ? tuner.growth(*target.t60_s) - pole.real() : 0.0;
    if (std::fabs(high) <= near_enough * pole.imag() &&
        std::fabs(loud) <= near_enough * std::fabs(pole.real())) {
      return Tuned{scaled(network, tuner.lines(), tuner.stiffness, tuner.damping), std::exp(k),
                   std::exp(z)};
    }
    Complex by_k;
    Complex by_z;
    const ModeTuner::Slopes slopes = tuner.slopes(swing);
    for (std::size_t i = 0; i < tuner.lines().size(); ++i) {
      by_k += slopes.stiffness[i];
      by_z += slopes.damping[i];
    }
    if (std::fabs(by_k.imag()) < 1e-6 * pole.imag()) {
      return Error{what + hertz(target.frequency_hz) + ": the springs of " +
                   (target.part.empty() ? "the model" : "'" + target.part + "'") +
                   " hardly change its pitch"};
    }
    double step_z = 0.0;
    double step_k = high / by_k.imag();
    if (target.t60_s) {
      const double area = by_k.imag() * by_z.real() - by_k.real() * by_z.imag();
      if (std::fabs(by_z.real()) <= 1e-9 * std::fabs(tuner.growth(*target.t60_s))) {
        return Error{what + "a new decay: no damper of " +
                     (target.part.empty() ? "the model" : "'" + target.part + "'") + " damps it"};
      }
      step_k = (high * by_z.real() - loud * by_z.imag()) / area;
      step_z = (loud * by_k.imag() - high * by_k.real()) / area;
    }
    // Limits a step to a fifth of an octave, so that the shape can be followed.
    k += std::clamp(step_k, -0.3, 0.3);
    z += std::clamp(step_z, -0.7, 0.7);
    tuner.stiffness.assign(tuner.lines().size(), std::exp(k));
    tuner.damping.assign(tuner.lines().size(), std::exp(z));
    if (auto found = tuner.find(count); !found) {
      return found.error();
    }
    if (tuner.swings.empty()) {
      break;
    }
    swing = *std::ranges::max_element(tuner.swings, [&](const Swing& a, const Swing& b) {
      return likeness(a.shape, swing.shape) < likeness(b.shape, swing.shape);
    });
  }
  return Error{what + hertz(target.frequency_hz) + "; the nearest is " +
               hertz(tuner.frequency_hz(swing))};
}

Result<Network> tune_modes(const Network& network, std::span<const double> parameters,
                           std::span<const double> frequencies_hz, const ModeOptions& options) {
  const std::size_t count = frequencies_hz.size();
  const auto lines = spring_lines(network);
  if (!lines) {
    return lines.error();
  }
  if (lines->size() < count && !network.macros.empty()) {
    const auto is_place = [&](std::uint32_t mass) {
      return network.masses[mass].kind == MassKind::point;
    };
    if (std::ranges::any_of(network.links, [&](const Link& link) {
          return is_place(link.a) || is_place(link.b);
        })) {
      return Error{"the model has " + std::to_string(lines->size()) + " lines of springs for " +
                   std::to_string(count) +
                   " frequencies, and its strings and meshes cannot be expanded into masses, "
                   "because links are attached between their masses"};
    }
    return tune_modes(canonical(expand_macros(network)), parameters, frequencies_hz, options);
  }
  if (!std::is_sorted(frequencies_hz.begin(), frequencies_hz.end()) ||
      std::ranges::any_of(frequencies_hz, [](double hz) { return !(hz > 0.0); })) {
    return Error{"expected frequencies above 0 Hz in ascending order"};
  }
  ModeTuner tuner(network, parameters, "", options);
  if (tuner.failure()) {
    return *tuner.failure();
  }
  const std::size_t springs = tuner.lines().size();
  Vector logarithms(springs);  // Logarithms of the factors.
  // Returns the error of each mode as a logarithm.
  const auto off = [&]() -> std::optional<Vector> {
    for (std::size_t i = 0; i < springs; ++i) {
      tuner.stiffness[i] = std::exp(logarithms[i]);
    }
    if (!tuner.find(count) || tuner.swings.size() < count) {
      return std::nullopt;
    }
    Vector distance(count);
    for (std::size_t i = 0; i < count; ++i) {
      distance[i] = std::log(frequencies_hz[i] / tuner.frequency_hz(tuner.swings[i]));
    }
    return distance;
  };
  std::optional<Vector> distance = off();
  if (!distance) {
    return Error{"the model has fewer than " + std::to_string(count) + " modes"};
  }
  int stalls = 0;
  for (int step = 0; step < most_steps; ++step) {
    if (largest(*distance) < near_enough) {
      return scaled(network, tuner.lines(), tuner.stiffness, tuner.damping);
    }
    Matrix slopes(count, springs);
    for (std::size_t i = 0; i < count; ++i) {
      const ModeTuner::Slopes of = tuner.slopes(tuner.swings[i]);
      const double angle = tuner.pole(tuner.swings[i]).imag();
      for (std::size_t j = 0; j < springs; ++j) {
        slopes(i, j) = of.stiffness[j].imag() / angle;
      }
    }
    Matrix square(count, count);
    double size = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = 0; j < count; ++j) {
        for (std::size_t s = 0; s < springs; ++s) {
          square(i, j) += slopes(i, s) * slopes(j, s);
        }
      }
      size = std::max(size, square(i, i));
    }
    const Vector before = logarithms;
    const double was = std::sqrt(dot(*distance, *distance));
    std::optional<Vector> better;
    // Levenberg-Marquardt: increases the damping until the step is an improvement.
    double stay = 1e-12 * size;
    for (int attempt = 0; attempt < 30 && !better; ++attempt) {
      Matrix held = square;
      for (std::size_t i = 0; i < count; ++i) {
        held(i, i) += stay;
      }
      stay = std::max(10.0 * stay, 1e-7 * size);
      const auto way = solution(held, *distance);
      if (!way) {
        continue;
      }
      Vector change(springs);
      for (std::size_t s = 0; s < springs; ++s) {
        for (std::size_t i = 0; i < count; ++i) {
          change[s] += slopes(i, s) * (*way)[i];
        }
      }
      logarithms = before + change * std::min(1.0, 0.5 / std::max(1e-300, largest(change)));
      better = off();
      if (better && !(std::sqrt(dot(*better, *better)) < was)) {
        better.reset();
      }
    }
    if (!better) {
      // Nearly degenerate modes mix; a small displacement of the factors separates them.
      if (++stalls > most_stalls) {
        break;
      }
      for (std::size_t s = 0; s < springs; ++s) {
        logarithms[s] =
            before[s] + 0.01 * stalls * std::sin(12.9898 * static_cast<double>(s + 1) * stalls);
      }
      better = off();
      if (!better) {
        break;
      }
    }
    distance = std::move(better);
  }
  return Error{"no springs give these frequencies; the nearest solution found is up to " +
               std::to_string(1200.0 / std::numbers::ln2 * largest(*distance)) + " cents off"};
}

}  // namespace ressort::analysis
