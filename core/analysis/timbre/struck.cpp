#include "core/analysis/timbre/struck.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "core/analysis/modes/linear_system.h"
#include "core/analysis/timbre/envelope.h"
#include "core/model/topology.h"
#include "core/raised_cosine.h"
#include "core/ranges.h"

namespace ressort::analysis {
namespace {

// Smallest residue, relative to the loudest mode, that can be the pitch.
constexpr double least_residue = 1e-3;
constexpr double in_tune = 1e-9;  // Relative error of a frequency.
constexpr int most_tunings = 12;
constexpr double longest_attack_s = 3.0;  // Later peaks are ignored.
constexpr std::size_t coarse_step = 8;    // Samples.

constexpr TargetFigureRow figure_rows[] = {
    {TargetFigure::f0, "f0_hz", 0.0028922, true, "high", "low"},  // 5 cents
    {TargetFigure::t60, "t60_s", 0.05, true, "long", "short"},
    {TargetFigure::centroid, "centroid_hz", 0.03, true, "bright", "dark"},
    {TargetFigure::spread, "spread_hz", 0.05, true, "wide", "narrow"},
    {TargetFigure::inharmonicity, "inharmonicity", 1e-3, false, "bell-like", "harmonic"},
    {TargetFigure::odd_to_even, "odd_to_even", 0.2589254, true, "hollow", "full"},  // 1 dB
    {TargetFigure::rolloff, "rolloff95_hz", 0.05, true, "high in rolloff", "low in rolloff"},
    {TargetFigure::skewness, "skewness", 0.1, false, "skewed", "little skewed", true},
    {TargetFigure::kurtosis, "kurtosis", 0.05, true, "peaked", "flat"},
    // Equals a change of 3 % in a centroid of 1400 Hz.
    {TargetFigure::slope, "slope", 1e-9, false, "little sloped", "steeply sloped", true},
    {TargetFigure::attack, "attack_ms", 0.2589254, true, "slow", "sudden"},  // 0.1 of its log10.
};

// Returns the stiffness k/m, in samples, of a mode of the published scheme from its pole.
double stiffness_of(double frequency_hz, double t60_s, double rate_hz) {
  const double r = pole_radius(t60_s, rate_hz);
  const double angle = 2.0 * std::numbers::pi * frequency_hz / rate_hz;
  return (1.0 - r) * (1.0 - r) + 4.0 * r * std::pow(std::sin(0.5 * angle), 2.0);
}

// Returns how much more a raised cosine over so many frames excites a mode than a single-sample
// impulse of the same sum does: a sum of three geometric series.
std::complex<double> pulse_response(double frames, std::complex<double> pole) {
  const RaisedCosine pulse(frames);
  if (pulse.count == 1) {
    return 1.0;
  }
  const auto count = static_cast<double>(pulse.count);
  const auto series = [&](std::complex<double> a) {
    return std::abs(a) < 1e-12 ? std::complex<double>(count)
                               : (std::exp(a * count) - 1.0) / (std::exp(a) - 1.0);
  };
  const std::complex<double> turn(0.0, pulse.turn);
  return (series(-pole) - 0.5 * std::exp(0.5 * turn) * series(-pole + turn) -
          0.5 * std::exp(-0.5 * turn) * series(-pole - turn)) /
         pulse.sum;
}

// Interpolates the rolloff between the line before 95 % of the energy and the line that reaches it,
// so that it changes smoothly with the lines.
double smooth_rolloff_hz(std::span<const Partial> lines) {
  double energy = 0.0;
  for (const Partial& line : lines) {
    energy += line.amplitude * line.amplitude;
  }
  double so_far = 0.0;
  double before_hz = 0.0;
  for (const Partial& line : lines) {
    const double more = line.amplitude * line.amplitude;
    if (so_far + more >= 0.95 * energy) {
      return more > 0.0
                 ? before_hz + (line.frequency_hz - before_hz) * (0.95 * energy - so_far) / more
                 : line.frequency_hz;
    }
    so_far += more;
    before_hz = line.frequency_hz;
  }
  return before_hz;
}

// Returns the slope of a frame's bins that have this centroid.
double slope_of_bins(double centroid_hz, double rate_hz, std::size_t frame) {
  const std::size_t count = frame / 2 + 1;
  const auto bins = static_cast<double>(count);
  const double apart_hz = rate_hz / static_cast<double>(frame);
  const double mean_hz = 0.5 * (bins - 1.0) * apart_hz;
  const double variance = (bins * bins - 1.0) / 12.0 * apart_hz * apart_hz;
  return (centroid_hz - mean_hz) / (bins * variance);
}

}  // namespace

std::span<const TargetFigureRow> target_figure_rows() {
  return figure_rows;
}

const TargetFigureRow& row_of(TargetFigure figure) {
  return figure_rows[static_cast<std::size_t>(figure)];
}

std::string_view target_error(TargetFigure figure, double value) {
  const TargetFigureRow& row = row_of(figure);
  const bool is_right =
      std::isfinite(value) && (row.is_signed || value > 0.0 || (value == 0.0 && !row.is_ratio));
  return is_right        ? ""
         : row.is_signed ? "must be a number"
         : row.is_ratio  ? "must be a number above 0"
                         : "must be a number of at least 0";
}

double jnd_between(TargetFigure figure, double value, double target) {
  const TargetFigureRow& row = row_of(figure);
  return row.is_ratio ? std::log(value / target) / std::log1p(row.noticed)
                      : (value - target) / row.noticed;
}

StruckModel::StruckModel(const Network& network, const StrikeOptions& options)
    : network_(expand_macros(network)), options_(options) {}

// Uses the known shapes if they are exact. Otherwise solves for the modes and keeps their shapes.
Result<std::vector<HeardMode>> StruckModel::modes_at(std::span<const double> parameters,
                                                     double factor) {
  const Network written = evaluated(network_, parameters);
  const ModeOptions how{
      .rate_hz = options_.rate_hz, .key_factor = factor, .progress = options_.progress};
  const LinearSystem system = make_linear_system(written, scheme_step(how), true, factor);
  if (known_ && system.is_sound) {
    if (auto modes = known_->modes_of(system)) {
      return *std::move(modes);
    }
  }
  auto found = find_modes(written, parameters, how);
  if (!found) {
    return found.error();
  }
  if (!found->is_linear() || has_waveguide(network_)) {
    return Error{"it is not linear"};
  }
  std::vector<HeardMode> modes = heard_modes(*found, pushed());
  known_.reset();
  if (found->basis.rows() > 0) {
    known_.emplace(*std::move(found), pushed(), how);
  }
  return modes;
}

std::vector<std::size_t> StruckModel::pushed() const {
  return mapped(options_.blows, &StrikePulse::input);
}

Result<StruckModel::Tuned> StruckModel::tuned(std::span<const double> parameters) {
  double factor = factor_;
  for (int i = 0; i < most_tunings; ++i) {
    auto modes = modes_at(parameters, factor);
    if (!modes) {
      return modes.error();
    }
    if (!options_.key_hz) {
      return Tuned{*std::move(modes), factor};
    }
    if (modes->empty()) {
      return Error{"no mode oscillates, so keys cannot set the pitch"};
    }
    const ModeTone tone = modes->front().tone;
    if (std::fabs(tone.frequency_hz / *options_.key_hz - 1.0) < in_tune) {
      factor_ = factor;
      return Tuned{*std::move(modes), factor};
    }
    factor *= stiffness_of(*options_.key_hz, tone.t60_s, options_.rate_hz) /
              stiffness_of(tone.frequency_hz, tone.t60_s, options_.rate_hz);
    if (!(factor > 0.0 && std::isfinite(factor))) {
      break;
    }
  }
  factor_ = 1.0;
  return Error{"the key has no pitch: stiffness alone cannot move the mode to its frequency"};
}

FrameTimbre StruckModel::lines_of(std::span<const DecayingPartial> partials, double f0_hz) const {
  const std::vector<Partial> lines =
      partials_in_frame(partials, {.size = options_.frame}, options_.rate_hz);
  FrameTimbre timbre{.shape = spectral_shape(lines, SpectrumKind::magnitude),
                     .harmonics = harmonic_shape(harmonics_of(lines, f0_hz), f0_hz)};
  if (timbre.shape) {
    timbre.shape->rolloff95_hz = smooth_rolloff_hz(lines);
    timbre.shape->slope =
        slope_of_bins(timbre.shape->centroid_hz, options_.rate_hz, options_.frame);
  }
  return timbre;
}

double StruckModel::blow_frames(const StrikePulse& blow, double factor) const {
  return blow.length_s * options_.rate_hz / (blow.follows_pitch ? std::sqrt(factor) : 1.0);
}

ModalSound StruckModel::sound_of(const Tuned& tuned) const {
  std::vector<std::vector<double>> pulses;  // [strike][sample]
  for (const StrikePulse& blow : options_.blows) {
    const RaisedCosine shape(blow_frames(blow, tuned.factor));
    std::vector<double>& pulse = pulses.emplace_back();
    for (std::size_t n = 0; n < shape.count; ++n) {
      pulse.push_back(blow.strength * shape.at(n));
    }
  }
  std::vector<ModalSound::Motion> motions;
  for (const HeardMode& mode : tuned.modes) {
    motions.push_back({pole_of(mode.mu, ModeScheme::published), mode.residues});
  }
  return {motions, std::move(pulses)};
}

FrameTimbre StruckModel::analysed(const Tuned& tuned, double f0_hz) const {
  std::vector<double> samples(options_.frame);
  sound_of(tuned).next(samples);
  FrameAnalysis analysis({.rate_hz = options_.rate_hz, .size = options_.frame, .f0_hz = f0_hz});
  return analysis.next(samples);
}

// Computes the envelope until it can no longer exceed its maximum: as for a recording, or in
// coarser steps as the magnitude of the modal sum.
std::optional<TemporalShape> StruckModel::rising(const Tuned& tuned, StruckAs how) const {
  constexpr std::size_t block = 1024;
  constexpr double more = 1.05;  // Allowance for the overshoot of the filter.
  const std::size_t step = how == StruckAs::samples ? 1 : coarse_step;
  const double rate_hz = options_.rate_hz / static_cast<double>(step);
  ModalSound sound = sound_of(tuned);
  EnvelopeSums sums;
  std::vector<double> levels;
  const auto take = [&](double level) {
    sums.add(level);
    levels.push_back(level);
  };
  std::vector<double> samples(block);
  std::vector<double> left;  // [block] Bound at its end.
  const auto is_over = [&] {
    const std::size_t told = levels.size() / block;
    return told > 0 && more * left[told - 1] < sums.largest();
  };
  const auto blocks = static_cast<std::size_t>(longest_attack_s * rate_hz) / block;
  const auto go_on = [&](auto&& compute) {
    while (!is_over() && left.size() < blocks) {
      compute();
      left.push_back(sound.is_pushed()
                         ? std::numeric_limits<double>::infinity()
                         : sound.most_left(options_.rate_hz, 1.0 / Envelope::cutoff_hz));
    }
  };
  if (how == StruckAs::samples) {
    Envelope envelope(rate_hz, take);
    go_on([&] {
      sound.next(samples);
      envelope.add(samples);
    });
    if (!is_over()) {
      envelope.end();
    }
  } else {
    EnvelopeFilter filter(rate_hz);
    long long late = filter.delay();
    go_on([&] {
      sound.next_magnitudes(samples, step);
      for (const double magnitude : samples) {
        const double level = filter.next(magnitude);
        if (late-- <= 0) {
          take(level);
        }
      }
    });
  }
  return temporal_shape(levels, rate_hz);
}

std::optional<double> StruckModel::attack_ms(std::span<const double> parameters) {
  const auto found = tuned(parameters);
  return found ? attack_of(*found, StruckAs::samples) : std::nullopt;
}

std::optional<double> StruckModel::attack_of(const Tuned& tuned, StruckAs how) const {
  const auto shape = rising(tuned, how);
  if (!shape) {
    return std::nullopt;
  }
  return 1e3 * (how == StruckAs::samples ? std::pow(10.0, shape->log_attack_time)
                                         : shape->smooth_attack_s);
}

Result<TargetValues> StruckModel::figures(std::span<const double> parameters, StruckAs how) {
  const auto found = tuned(parameters);
  return found ? figures_of(*found, how) : found.error();
}

Result<TargetValues> StruckModel::figures_of(const Tuned& tuned, StruckAs how) const {
  std::vector<DecayingPartial> partials;
  double loudest = 0.0;
  for (const HeardMode& mode : tuned.modes) {
    std::complex<double> heard;
    const std::complex<double> pole = pole_of(mode.mu, ModeScheme::published);
    for (std::size_t b = 0; b < options_.blows.size(); ++b) {
      const StrikePulse& blow = options_.blows[b];
      heard +=
          blow.strength * mode.residues[b] * pulse_response(blow_frames(blow, tuned.factor), pole);
    }
    const double level = std::abs(heard);
    if (!(mode.tone.t60_s > 0.0)) {
      return Error{"a mode at " + std::to_string(mode.tone.frequency_hz) + " Hz grows"};
    }
    if (!std::isfinite(level)) {
      return Error{"a level is not finite"};
    }
    partials.push_back(
        {mode.tone.frequency_hz, pole_radius(mode.tone.t60_s, options_.rate_hz), level});
    loudest = std::max(loudest, level);
  }
  if (!(loudest > 0.0)) {
    return Error{"the output is silent: no oscillating mode reaches it"};
  }
  const auto heard = std::ranges::find_if(partials, [&](const DecayingPartial& partial) {
    return partial.residue > least_residue * loudest;
  });
  const std::size_t pitch =
      options_.key_hz ? 0 : static_cast<std::size_t>(heard - partials.begin());
  TargetValues values;
  const auto set = [&](TargetFigure figure, std::optional<double> value) {
    const bool is_there =
        value && std::isfinite(*value) && (*value > 0.0 || !row_of(figure).is_ratio);
    values[static_cast<std::size_t>(figure)] = is_there ? value : std::nullopt;
  };
  if (pitch >= partials.size()) {
    return Error{"no oscillating mode is left that could be the pitch"};
  }
  const auto& [f0_hz, t60_s] = tuned.modes[pitch].tone;
  set(TargetFigure::f0, f0_hz);
  set(TargetFigure::t60, std::min(t60_s, longest_t60_s));
  const FrameTimbre timbre =
      how == StruckAs::samples ? analysed(tuned, f0_hz) : lines_of(partials, f0_hz);
  if (timbre.shape) {
    set(TargetFigure::centroid, timbre.shape->centroid_hz);
    set(TargetFigure::spread, timbre.shape->spread_hz);
    set(TargetFigure::rolloff, timbre.shape->rolloff95_hz);
    set(TargetFigure::skewness, timbre.shape->skewness);
    set(TargetFigure::kurtosis, timbre.shape->kurtosis);
    set(TargetFigure::slope, timbre.shape->slope);
  }
  if (timbre.harmonics) {
    set(TargetFigure::inharmonicity, timbre.harmonics->inharmonicity);
    set(TargetFigure::odd_to_even, timbre.harmonics->odd_to_even);
  }
  if (options_.has_attack) {
    set(TargetFigure::attack, attack_of(tuned, how));
  }
  return values;
}

}  // namespace ressort::analysis
