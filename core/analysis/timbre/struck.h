// core/analysis/timbre: the timbre of a linear model after one strike, as a function of its
// parameters, computed from its modes. Pure. [one thread but audio]
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/analysis/modes/known_shapes.h"
#include "core/analysis/timbre/descriptors.h"
#include "core/analysis/timbre/frame_analysis.h"
#include "core/analysis/timbre/modal_sound.h"
#include "core/analysis/timbre/modal_spectrum.h"
#include "core/model/network.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::analysis {

// Figures that can be targets. Other figures are discontinuous in the parameters, or depend on the
// number of bins.
enum class TargetFigure : std::uint8_t {
  f0,
  t60,
  centroid,
  spread,
  inharmonicity,
  odd_to_even,
  rolloff,
  skewness,
  kurtosis,
  slope,
  attack
};
inline constexpr std::size_t target_figure_count = 11;

struct TargetFigureRow {
  TargetFigure figure = TargetFigure::f0;
  std::string_view name;  // Name with its unit, as in descriptions.
  // Just noticeable difference: relative, or absolute if `is_ratio` is false.
  double noticed = 0.0;
  bool is_ratio = true;
  std::string_view more;  // Adjective for a higher value, such as "bright".
  std::string_view less;
  // May be below 0. Otherwise a ratio must be above 0, and other figures at least 0.
  bool is_signed = false;
};
// Returns the fault of a target value, such as "must be a number above 0"; empty if valid.
std::string_view target_error(TargetFigure figure, double value);
const TargetFigureRow& row_of(TargetFigure figure);
std::span<const TargetFigureRow> target_figure_rows();

// [figure] Absent if the sound does not have it.
using TargetValues = std::array<std::optional<double>, target_figure_count>;

// Returns the difference of a figure from its target in JND; above 0 if it is more. Both must be
// above 0 if the figure is a ratio.
double jnd_between(TargetFigure figure, double value, double target);

// A pulse of force, or of displacement if the input is a position: one sample, or a raised cosine
// of the same sum.
struct StrikePulse {
  std::size_t input = 0;  // Index into Network::inputs.
  double strength = 1.0;
  // Length at the model's own pitch. If it follows the pitch, a key shortens it in proportion to
  // its period.
  double length_s = 0.0;
  bool follows_pitch = true;
};

struct StrikeOptions {
  double rate_hz = Network::reference_rate_hz;
  // Simultaneous strikes; the output is the mean of all outputs.
  std::vector<StrikePulse> blows = {{}};
  // If set, every stiffness that is not fixed is scaled so that the mode has this frequency, as a
  // key does. Otherwise the model is used as written.
  std::optional<double> key_hz;
  // Samples from the strike on, analysed as amplitudes under a Hann window.
  std::size_t frame = 2048;
  bool has_attack = false;  // The attack needs more of the sound than one frame.
  Progress progress = {};
};

// `lines`: modes are spectral lines and figures are smooth. `samples`: the frame is synthesised and
// analysed like a recording, which is exact, but figures jump when a peak moves to another bin or
// the attack's threshold to another ripple.
enum class StruckAs { lines, samples };

class StruckModel {
 public:
  // Takes a network with at least one input and one output.
  StruckModel(const Network& network, const StrikeOptions& options);

  // Returns the figures. f0 is the mode that a key tunes, or else the lowest mode within 60 dB of
  // the loudest; T60 belongs to the same mode, `longest_t60_s` if it is undamped. The error gives
  // the reason if there are none: no mode oscillates or is heard, a mode grows, a value is not
  // finite, the model is not linear, or `stopped`. O(masses^3), and O(masses^2) if the last
  // parameters had modes of the same shapes.
  Result<TargetValues> figures(std::span<const double> parameters, StruckAs how);

  // Returns the attack of figures() by samples, whether or not `has_attack` is set; empty if there
  // are no figures.
  std::optional<double> attack_ms(std::span<const double> parameters);

  static constexpr double longest_t60_s = 1e6;

 private:
  struct Tuned {
    std::vector<HeardMode> modes;  // A residue for each strike.
    double factor = 1.0;
  };
  Result<Tuned> tuned(std::span<const double> parameters);
  Result<std::vector<HeardMode>> modes_at(std::span<const double> parameters, double factor);
  std::vector<std::size_t> pushed() const;
  Result<TargetValues> figures_of(const Tuned& tuned, StruckAs how) const;
  FrameTimbre lines_of(std::span<const DecayingPartial> partials, double f0_hz) const;
  ModalSound sound_of(const Tuned& tuned) const;
  FrameTimbre analysed(const Tuned& tuned, double f0_hz) const;
  std::optional<double> attack_of(const Tuned& tuned, StruckAs how) const;
  std::optional<TemporalShape> rising(const Tuned& tuned, StruckAs how) const;
  double blow_frames(const StrikePulse& blow, double factor) const;

  Network network_;
  StrikeOptions options_;
  double factor_ = 1.0;               // Stiffness factor of the last key; 1 without a key.
  std::optional<KnownShapes> known_;  // The shapes that were found last.
};

}  // namespace ressort::analysis
