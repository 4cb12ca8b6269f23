// core/identification: a pitch that falls after the blow. The tension of a membrane or a string
// grows with its amplitude and raises all modes by the same ratio (Fletcher and Rossing 1998). If
// the sound is sampled at equal steps of the modes' phase instead of time, their frequencies are
// constant. [any thread but audio]
#pragma once

#include <cstddef>
#include <vector>

#include "core/progress.h"

namespace ressort::identification {

using Channels = std::vector<std::vector<double>>;

// The logarithm of all frequencies is size e^(-t / decay) above the final one. Times are in
// samples.
struct Glide {
  double size = 0.0;
  double decay = 1.0;
  double damping = 0.0;  // of the loudest mode, in nepers per sample

  // Returns the time after which a mode of constant frequency has the same phase.
  double straight(double time) const;
  // Returns the damping of a mode, in nepers per sample, from the damping that fits best to the
  // sound without its glide. The envelope there is no exponential for modes that decay at another
  // rate than the loudest one: in first order, regression over the decaying energy is off by
  // size (2 a / (2 a + 1/decay))^2 of the difference.
  double true_damping(double fitted) const;
};

struct FoundGlide {
  Glide glide;
  Glide steps[2];  // independent errors of one standard deviation each; the second has no size
};

// Fits a glide together with one to five modes below 1 kHz. Returns a glide of size 0 if modes of
// constant frequency have a lower Bayesian information criterion, or if the size is less than three
// standard deviations.
FoundGlide find_glide(const Channels& sound, double rate_hz, const Progress& progress);

// Returns the sound without its glide, in which the loudest mode decays at the same rate.
// Interpolates with a windowed sinc of 32 samples.
Channels without_glide(const Channels& sound, const Glide& glide);

}  // namespace ressort::identification
