#include "core/analysis/timbre/struck.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "core/analysis/modes/linear_system.h"
#include "core/analysis/modes/scaling.h"
#include "core/model/topology.h"

namespace ressort {
namespace {

constexpr double quietest_share = 1e-3;  // of the loudest mode: what is less is no pitch
constexpr double in_tune = 1e-9;         // of a frequency
constexpr int most_tunings = 12;

constexpr AskedFigureRow figure_rows[] = {
    {AskedFigure::f0, "f0_hz", 0.0028922, true, "high", "low"},  // 5 cents
    {AskedFigure::t60, "t60_s", 0.05, true, "long", "short"},
    {AskedFigure::centroid, "centroid_hz", 0.03, true, "bright", "dark"},
    {AskedFigure::spread, "spread_hz", 0.05, true, "wide", "narrow"},
    {AskedFigure::inharmonicity, "inharmonicity", 1e-3, false, "bell-like", "harmonic"},
    {AskedFigure::odd_to_even, "odd_to_even", 0.2589254, true, "hollow", "full"},  // 1 dB
    {AskedFigure::rolloff, "rolloff95_hz", 0.05, true, "high in rolloff", "low in rolloff"},
    {AskedFigure::skewness, "skewness", 0.1, false, "skewed", "little skewed", true},
    {AskedFigure::kurtosis, "kurtosis", 0.05, true, "peaked", "flat"},
    // As much as 3 % of a centroid of 1400 Hz moves it.
    {AskedFigure::slope, "slope", 1e-9, false, "little sloped", "steeply sloped", true},
};

// How stiff a mode of the published scheme is, k/m in samples, by its pole (other than its decay).
double stiffness_of(double frequency_hz, double t60_s, double rate_hz) {
  const double r = pole_radius(t60_s, rate_hz);
  const double angle = 2.0 * std::numbers::pi * frequency_hz / rate_hz;
  return (1.0 - r) * (1.0 - r) + 4.0 * r * std::pow(std::sin(0.5 * angle), 2.0);
}

// The mean over all outputs of what a blow of one sample at an input leaves.
std::complex<double> mean_residue(const NetworkModes& modes, const NetworkMode& mode,
                                  std::size_t input) {
  std::complex<double> sum;
  for (std::size_t output = 0; output < modes.outputs; ++output) {
    sum += mode.residues[input * modes.outputs + output];
  }
  return sum / static_cast<double>(modes.outputs);
}

// How much more a raised cosine of so many frames excites a motion of a pole than all of it in its
// first sample does: a sum of three geometric series, and of two such pulses where they are no
// whole number.
std::complex<double> pulse_response(double frames, std::complex<double> pole) {
  const auto whole = [&](double count) -> std::complex<double> {
    if (count < 2.0) {
      return 1.0;
    }
    const double turn = 2.0 * std::numbers::pi / count;
    const auto series = [&](std::complex<double> a) {
      return std::abs(a) < 1e-12 ? std::complex<double>(count)
                                 : (std::exp(a * count) - 1.0) / (std::exp(a) - 1.0);
    };
    const std::complex<double> i(0.0, 1.0);
    return (series(-pole) - 0.5 * std::exp(0.5 * i * turn) * series(-pole + i * turn) -
            0.5 * std::exp(-0.5 * i * turn) * series(-pole - i * turn)) /
           count;
  };
  const double below = std::floor(frames);
  return whole(below) + (frames - below) * (whole(below + 1.0) - whole(below));
}

// As smooth as the lines move: between the line before the 95 % of energy and the one there.
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

// The slope that a frame's bins have where this is their centroid.
double slope_of_bins(double centroid_hz, double rate_hz, std::size_t frame) {
  const double bins = static_cast<double>(frame / 2 + 1);
  const double apart_hz = rate_hz / static_cast<double>(frame);
  const double mean_hz = 0.5 * (bins - 1.0) * apart_hz;
  const double variance = (bins * bins - 1.0) / 12.0 * apart_hz * apart_hz;
  return (centroid_hz - mean_hz) / (bins * variance);
}

// With every stiffness that keys move times `factor`. Of a network without macros.
Network at_key(const Network& network, double factor) {
  std::vector<SpringLine> lines = *spring_lines(network);
  std::erase_if(lines, [&](const SpringLine& line) {
    return line.kind == SpringLine::Kind::link ? network.links[line.index].is_fixed
                                               : network.masses[line.index].is_fixed;
  });
  return scaled(network, lines, std::vector<double>(lines.size(), factor),
                std::vector<double>(lines.size(), 1.0));
}

}  // namespace

std::span<const AskedFigureRow> asked_figure_rows() {
  return figure_rows;
}

const AskedFigureRow& row_of(AskedFigure figure) {
  return figure_rows[static_cast<std::size_t>(figure)];
}

std::string_view wrong_with(AskedFigure figure, double value) {
  const AskedFigureRow& row = row_of(figure);
  const bool is_right =
      std::isfinite(value) && (row.is_signed || value > 0.0 || (value == 0.0 && !row.is_ratio));
  return is_right        ? ""
         : row.is_signed ? "must be a number"
         : row.is_ratio  ? "must be a number above 0"
                         : "must be a number from 0 on";
}

double noticed_between(AskedFigure figure, double value, double target) {
  const AskedFigureRow& row = row_of(figure);
  return row.is_ratio ? std::log(value / target) / std::log1p(row.noticed)
                      : (value - target) / row.noticed;
}

StruckModel::StruckModel(const Network& network, const StrikeOptions& options)
    : network_(expand_macros(network)), options_(options) {}

Result<StruckModel::TunedModes> StruckModel::tuned_modes(std::span<const double> parameters) const {
  const ModeOptions how{.rate_hz = options_.rate_hz, .progress = options_.progress};
  double factor = options_.key_factor.value_or(1.0);
  const Network written = settled(network_, parameters);
  for (int i = 0; i < most_tunings; ++i) {
    auto modes = find_modes(factor == 1.0 ? written : at_key(written, factor), parameters, how);
    if (!modes) {
      return modes.error();
    }
    if (!options_.key_hz || options_.key_factor) {
      return TunedModes{*std::move(modes), factor};
    }
    if (options_.pitch_mode >= modes->modes.size()) {
      return Error{"there is no mode " + std::to_string(options_.pitch_mode + 1) +
                   " that swings, so no key has a pitch"};
    }
    const NetworkMode& mode = modes->modes[options_.pitch_mode];
    if (std::fabs(mode.frequency_hz / *options_.key_hz - 1.0) < in_tune) {
      return TunedModes{*std::move(modes), factor};
    }
    factor *= stiffness_of(*options_.key_hz, mode.t60_s, options_.rate_hz) /
              stiffness_of(mode.frequency_hz, mode.t60_s, options_.rate_hz);
    if (!(factor > 0.0 && std::isfinite(factor))) {
      break;
    }
  }
  return Error{"the key has no pitch: stiffness alone does not bring the mode there"};
}

Result<double> StruckModel::key_factor(std::span<const double> parameters) const {
  const auto tuned = tuned_modes(parameters);
  return tuned ? Result<double>(tuned->factor) : tuned.error();
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
  return blow.length_s * options_.rate_hz / std::sqrt(factor);
}

FrameTimbre StruckModel::analysed(const TunedModes& tuned, double f0_hz) const {
  const NetworkModes& modes = tuned.modes;
  std::vector<std::vector<double>> pulses;  // [blow] [sample]
  for (const StrikePulse& blow : options_.blows) {
    const double frames = std::rint(blow_frames(blow, tuned.factor));
    std::vector<double>& pulse = pulses.emplace_back();
    for (double n = 0.0; n < frames && frames >= 2.0; n += 1.0) {
      const double turn = 2.0 * std::numbers::pi * (n + 0.5) / frames;
      pulse.push_back(blow.strength / frames * (1.0 - std::cos(turn)));
    }
    if (pulse.empty()) {
      pulse = {blow.strength};
    }
  }
  std::vector<double> samples(options_.frame);
  for (const NetworkMode& mode : modes.modes) {
    std::vector<std::complex<double>> drive;
    for (std::size_t b = 0; b < pulses.size(); ++b) {
      const auto residue = mean_residue(modes, mode, options_.blows[b].input);
      drive.resize(std::max(drive.size(), pulses[b].size()));
      for (std::size_t n = 0; n < pulses[b].size(); ++n) {
        drive[n] += residue * pulses[b][n];
      }
    }
    const std::complex<double> turn = std::exp(pole_of(mode.mu, modes.scheme));
    std::complex<double> state;
    for (std::size_t n = 0; n < samples.size(); ++n) {
      state = turn * (n < drive.size() ? state + drive[n] : state);
      samples[n] += state.imag();
    }
  }
  FrameAnalysis analysis({.rate_hz = options_.rate_hz, .size = options_.frame, .f0_hz = f0_hz});
  return analysis.next(samples);
}

Result<AskedValues> StruckModel::figures(std::span<const double> parameters) const {
  const auto tuned = tuned_modes(parameters);
  if (!tuned) {
    return tuned.error();
  }
  const NetworkModes* const modes = &tuned->modes;
  if (!modes->is_linear() || has_waveguide(network_)) {
    return Error{"it is not linear"};
  }
  std::vector<DecayingPartial> partials;
  double loudest = 0.0;
  for (const NetworkMode& mode : modes->modes) {
    std::complex<double> heard;
    const std::complex<double> pole = pole_of(mode.mu, modes->scheme);
    for (const StrikePulse& blow : options_.blows) {
      heard += blow.strength * mean_residue(*modes, mode, blow.input) *
               pulse_response(blow_frames(blow, tuned->factor), pole);
    }
    const double level = std::abs(heard);
    if (!(mode.t60_s > 0.0)) {
      return Error{"a mode at " + std::to_string(mode.frequency_hz) + " Hz grows"};
    }
    if (!std::isfinite(level)) {
      return Error{"a level is no finite number"};
    }
    partials.push_back({mode.frequency_hz, pole_radius(mode.t60_s, options_.rate_hz), level});
    loudest = std::max(loudest, level);
  }
  if (!(loudest > 0.0)) {
    return Error{"nothing is heard: no mode that swings reaches the output"};
  }
  const auto heard = std::find_if(
      partials.begin(), partials.end(),
      [&](const DecayingPartial& partial) { return partial.residue > quietest_share * loudest; });
  const std::size_t pitch =
      options_.key_hz ? options_.pitch_mode : static_cast<std::size_t>(heard - partials.begin());
  AskedValues values;
  const auto set = [&](AskedFigure figure, std::optional<double> value) {
    const bool is_there =
        value && std::isfinite(*value) && (*value > 0.0 || !row_of(figure).is_ratio);
    values[static_cast<std::size_t>(figure)] = is_there ? value : std::nullopt;
  };
  if (pitch >= partials.size()) {
    return Error{"no mode that swings is left to be the pitch"};
  }
  const double f0_hz = modes->modes[pitch].frequency_hz;
  set(AskedFigure::f0, f0_hz);
  set(AskedFigure::t60, std::min(modes->modes[pitch].t60_s, longest_t60_s));
  const FrameTimbre timbre =
      options_.by_samples ? analysed(*tuned, f0_hz) : lines_of(partials, f0_hz);
  if (timbre.shape) {
    set(AskedFigure::centroid, timbre.shape->centroid_hz);
    set(AskedFigure::spread, timbre.shape->spread_hz);
    set(AskedFigure::rolloff, timbre.shape->rolloff95_hz);
    set(AskedFigure::skewness, timbre.shape->skewness);
    set(AskedFigure::kurtosis, timbre.shape->kurtosis);
    set(AskedFigure::slope, timbre.shape->slope);
  }
  if (timbre.harmonics) {
    set(AskedFigure::inharmonicity, timbre.harmonics->inharmonicity);
    set(AskedFigure::odd_to_even, timbre.harmonics->odd_to_even);
  }
  return values;
}

}  // namespace ressort
