// core/analysis/timbre: what a linear model is like when it is struck once, as a function of its
// parameters, from its modes. Pure. [one thread but audio]
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/analysis/modes/nearby_modes.h"
#include "core/analysis/timbre/descriptors.h"
#include "core/analysis/timbre/frame_analysis.h"
#include "core/analysis/timbre/modal_sound.h"
#include "core/analysis/timbre/modal_spectrum.h"
#include "core/model/network.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::analysis {

// What may be asked of a timbre. Other figures jump while parameters move, or count bins.
enum class AskedFigure : std::uint8_t {
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
inline constexpr std::size_t asked_figures = 11;

struct AskedFigureRow {
  AskedFigure figure = AskedFigure::f0;
  std::string_view name;  // with its unit, as descriptions have it
  // What is just noticed: a share of it; of some figures so much.
  double noticed = 0.0;
  bool is_ratio = true;
  std::string_view more;  // "bright", for people
  std::string_view less;
  bool is_signed = false;  // it may be below 0; else a ratio is above 0, and others from 0 on
};
// What is wrong with asking for a value, "must be a number above 0"; empty: nothing.
std::string_view wrong_with(AskedFigure figure, double value);
const AskedFigureRow& row_of(AskedFigure figure);
std::span<const AskedFigureRow> asked_figure_rows();

// [figure] Nothing where the sound has none.
using AskedValues = std::array<std::optional<double>, asked_figures>;

// How far a figure is from a target, in just noticeable differences: above 0 where it is more.
// Both above 0 where the figure is a ratio.
double noticed_between(AskedFigure figure, double value, double target);

// A pulse of force, or of displacement where the input is a position: one sample, or a raised
// cosine of the same sum.
struct StrikePulse {
  std::size_t input = 0;  // index into Network::inputs
  double strength = 1.0;
  double length_s = 0.0;  // at the model's own pitch; on a key as much shorter as its periods are
};

struct StrikeOptions {
  double rate_hz = Network::reference_rate_hz;
  std::vector<StrikePulse> blows = {{}};  // all at once; heard is the mean of all outputs
  // With it every stiffness that is not fixed gets the factor that brings the mode there, as a key
  // does it; else the model is as it is written.
  std::optional<double> key_hz;
  std::size_t pitch_mode = 0;  // from the lowest that swings
  std::size_t frame = 2048;    // samples from the blow on, of which the spectrum is, of amplitudes
                               // under a Hann window
  bool has_attack = false;     // which needs more of the sound than a frame
  Progress progress = {};
};

// Modes are lines, and figures are smooth. Or the frame is computed sample by sample and analysed
// as a recording is: exact, but figures jump where a peak moves to another bin, or an attack's
// threshold to another ripple.
enum class StruckAs { lines, samples };

class StruckModel {
 public:
  // Of a network with one input and one output at least.
  StruckModel(const Network& network, const StrikeOptions& options);

  // f0 is the mode that a key tunes, or else the lowest within 60 dB of the loudest; T60 is its.
  // That of a mode that nothing damps is `longest_t60_s`. The error says why there are none: no
  // mode swings or is heard, one grows, a number is none; not linear; or `stopped`. O(masses^3),
  // and O(masses^2) where the last parameters had modes of the same shapes.
  Result<AskedValues> figures(std::span<const double> parameters, StruckAs how);

  // The same, to first order in how far the parameters are from a place: for slopes. The first time
  // at a place O(masses^3), then O(masses^2) where no modes are alike that the way tells apart.
  Result<AskedValues> figures_near(std::span<const double> place,
                                   std::span<const double> parameters, StruckAs how);

  // As of figures(), by samples, whether `has_attack` or not; nothing where there are no figures.
  std::optional<double> attack_ms(std::span<const double> parameters);

  static constexpr double longest_t60_s = 1e6;

 private:
  struct Tuned {
    std::vector<HeardMode> modes;  // residues by blow
    double factor = 1.0;
  };
  using Place = std::optional<std::span<const double>>;  // near which modes are wanted
  Result<Tuned> tuned(std::span<const double> parameters, const Place& place);
  Result<std::vector<HeardMode>> modes_at(std::span<const double> parameters, double factor,
                                          const Place& place);
  Result<std::vector<HeardMode>> found_modes(const Network& written,
                                             std::span<const double> parameters,
                                             const ModeOptions& how);
  ModeOptions mode_options(double factor) const;
  std::vector<std::size_t> pushed() const;
  Result<AskedValues> figures_of(const Tuned& tuned, StruckAs how) const;
  FrameTimbre lines_of(std::span<const DecayingPartial> partials, double f0_hz) const;
  ModalSound sound_of(const Tuned& tuned) const;
  FrameTimbre analysed(const Tuned& tuned, double f0_hz) const;
  std::optional<double> attack_of(const Tuned& tuned, StruckAs how) const;
  std::optional<TemporalShape> rising(const Tuned& tuned, StruckAs how) const;
  double blow_frames(const StrikePulse& blow, double factor) const;

  Network network_;
  StrikeOptions options_;
  double factor_ = 1.0;               // of a key, the last; 1 without one
  std::optional<NearbyModes> known_;  // with the shapes that were found last...
  std::vector<double> known_at_;      // ...for these parameters
};

}  // namespace ressort::analysis
