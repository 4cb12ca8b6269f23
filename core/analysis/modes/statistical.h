// core/analysis/modes: draws the modes of a body from statistics. Above its first modes the exact
// modes of a soundboard, a box or a room neither can be computed nor matter: their density, loss
// and mean amplitude do (Lyon and DeJong, Theory and Application of Statistical Energy Analysis,
// 1995).
#pragma once

#include <cstdint>
#include <vector>

#include "core/analysis/modes/body.h"
#include "core/curve.h"

namespace ressort::analysis {

// A mode that is given instead of drawn. Displacements are relative to the root mean square of the
// drawn ones: a mode with the displacement w has an effective mass of mass/w^2 at that place.
struct GivenMode {
  double frequency_hz = 0.0;
  double q = 0.0;
  double bridge = 1.0;
  double left = 1.0;
  double right = 1.0;
};

// Curves have ascending frequencies in Hz. Between two points they are straight over the logarithm
// of the frequency.
struct BodyStatistics {
  std::vector<CurvePoint> density;    // modes per Hz, above 0; no modes are drawn outside of it
  std::vector<CurvePoint> loss;       // loss factor eta = 1/Q, above 0
  std::vector<CurvePoint> radiation;  // dB added to the outputs; empty: 0 dB
  std::vector<GivenMode> given;
  double mass = 1.0;       // of the body: the mean conductance at the bridge is density/(4 mass)
  std::uint64_t seed = 1;  // equal seeds give equal modes
};

inline constexpr double velocity_reference_hz = 1000.0;

// Returns the mean number of modes over all seeds that are drawn from this density.
double mean_mode_count(const std::vector<CurvePoint>& density);

// Returns the given modes, then the drawn ones, at the places bridge, left and right.
//
// Distances between neighbours are Rayleigh distributed, because modes of irregular bodies repel
// each other (Weaver, J. Acoust. Soc. Am. 85, 1989). Displacements are Gaussian and independent,
// with a mean square of 1 in a mode of mass `mass`, so that the mean conductance is that of
// Skudrzyk's mean-value method (J. Acoust. Soc. Am. 67, 1980). The displacements at left and right
// are multiplied by f/velocity_reference_hz: a position output there is proportional to the
// velocity of each ringing mode, as sound pressure is. T60 = 6 ln(10)/(2 pi f eta).
PlacedModes statistical_modes(const BodyStatistics& body);

}  // namespace ressort::analysis
