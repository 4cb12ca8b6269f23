// core/compile: by which factor on every stiffness the motion that keys tune has the frequency of a
// key: of its damped pole, in the form that plays it.
#pragma once

#include <complex>
#include <span>

#include "core/analysis/linear.h"
#include "core/compile/accuracy/stepping.h"
#include "core/engine/engine.h"

namespace ressort::compile {

// A motion whose pole a factor on every stiffness moves. Poles are those of a sample at the rate
// that is played, z = e^(-decay + j theta).
class TunedMotion {
 public:
  virtual ~TunedMotion() = default;
  // What goes by whole samples is from now on, for residual(), as it is at this factor. Whether
  // that has changed anything.
  virtual bool round_at(double /*log_factor*/) { return false; }
  // 0 where this is its pole, and else about as large as it is off.
  virtual std::complex<double> residual(double log_factor, double decay, double theta) const = 0;
  // The factor at which it would be if nothing else swung along.
  virtual double alone_at(double theta) const = 0;
  // How fast it would decay then.
  virtual double decay_at(double factor) const = 0;
};

// For every semitone of 440 Hz from a tenth of a hertz to half the rate, by Newton on the pole.
// [any thread but audio]
Pitches make_pitches(TunedMotion& motion, double rate_hz);

// The same of the mode that is lowest without dampers, of `shapes`, per sample at 44 100 Hz, as the
// form steps them at rate_hz; dampers stay while stiffness changes. [any thread but audio]
Pitches make_pitches(const LowestShapes& shapes, const Stepping& stepping, double rate_hz,
                     double rate_ratio);

// How the part of a machine steps that the lowest mode is in; that of a body is exact everywhere.
Stepping stepping_of_lowest(const Machine& machine, const LowestShapes& shapes,
                            std::span<const double> parameters);

}  // namespace ressort::compile
