// core/compile: the factors on every stiffness at which the tuned mode, as the form steps it, has
// the frequency of each key. The frequency is that of the damped pole.
#pragma once

#include <complex>
#include <span>

#include "core/analysis/linear.h"
#include "core/compile/accuracy/stepping.h"
#include "core/engine/engine.h"

namespace ressort::compile {

// A mode whose pole z = e^(-decay + j theta), per sample, depends on a factor on every stiffness.
class TunedMotion {
 public:
  virtual ~TunedMotion() = default;
  // Rounds delays to whole samples at this factor, for residual(). Returns whether one has changed.
  virtual bool round_at(double /*log_factor*/) { return false; }
  // 0 at a pole, and of first order near it.
  virtual std::complex<double> residual(double log_factor, double decay, double theta) const = 0;
  // The factor at this angle if no other mode were coupled to it: Newton's initial value.
  virtual double alone_at(double theta) const = 0;
  // The decay of the uncoupled mode, per sample.
  virtual double decay_at(double factor) const = 0;
};

// The semitones of a table: all of them, or those within half an octave of one frequency, where
// another table of similar motion is known.
struct PitchWindow {
  const Pitches* near = nullptr;  // the other table; null: all semitones
  double frequency_hz = 0.0;
  double ratio = 1.0;  // of the table's factors to those of `near`, roughly
};

// Returns a factor for each semitone of 440 Hz from a tenth of a hertz to half the rate, or in the
// window, by Newton's method on the complex pole. [any thread but audio]
Pitches make_pitches(TunedMotion& motion, double rate_hz, const PitchWindow& window = {});

// The same for the first mode of `shapes`, which are per sample at 44,100 Hz, as the form steps it
// at rate_hz. Keys do not change dampers. [any thread but audio]
Pitches make_pitches(const LowestShapes& shapes, const Stepping& stepping, double rate_hz,
                     double rate_ratio, const PitchWindow& window = {});

// Returns the stepping of the part that contains the lowest mode, at these values of the
// parameters. The modes of bodies are stepped exactly in every form.
Stepping stepping_of_lowest(const Machine& machine, const LowestShapes& shapes,
                            std::span<const double> parameters);

}  // namespace ressort::compile
