// core/identification: fits a sum of damped sinusoids to a sound in the least-squares sense.
// Gauss-Newton with Levenberg-Marquardt damping moves all poles and amplitudes at once; the
// Cramer-Rao bound at the level of the residual gives the uncertainty of each number. [any thread
// but audio]
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "core/identification/damped.h"
#include "core/progress.h"

namespace ressort::identification {

// Re(c z^n) in each channel. All channels share log z.
struct DampedMode {
  Complex log_z;
  std::vector<Complex> c;  // [channel]
};

// Returns log z of each mode.
std::vector<Complex> poles_of(std::span<const DampedMode> modes);

// Standard deviations for noise of variance 1. The deviation of a complex amplitude is the root
// mean square of the deviations of its two parts.
struct DampedDeviation {
  double alpha = 0.0;
  double omega = 0.0;
  std::vector<double> c;  // [channel]
  // [channel] Covariance of an amplitude with its log_z: of the part along the amplitude with the
  // real part, and of the part across it with the imaginary part.
  std::vector<double> with_alpha;
  std::vector<double> with_omega;
};

class DampedFit {
 public:
  // Takes channels of equal length. A constant offset is fitted as well.
  explicit DampedFit(std::span<const std::vector<double>> sound);

  // Limits the modes that are fitted from now on: to frequencies of `lowest_omega`, above 0, and
  // more, to decays of `least_alpha` and more, and to a Q of 1/2 and more.
  void limit(double lowest_omega, double least_alpha) {
    lowest_omega_ = lowest_omega;
    least_alpha_ = least_alpha;
  }
  double lowest_omega() const { return lowest_omega_; }
  // Sets the poles and solves for the best amplitudes. Returns false if the poles cannot be
  // distinguished.
  bool set_poles(const std::vector<Complex>& log_z);
  // Removes modes one after the other. `next` gets by how much the residual's energy would grow
  // without each mode, HUGE_VAL for those already removed, and returns the next mode to remove, or
  // the number of modes to stop. The remaining amplitudes stay the best ones. Returns the number of
  // removed modes. O(modes^3 + removed * modes^2 + samples * modes)
  std::size_t eliminate(const std::function<std::size_t(const std::vector<double>& drops)>& next);
  // Sets all modes without fitting.
  void set_modes(std::vector<DampedMode> modes);

  // Moves poles and amplitudes for at most `steps` Gauss-Newton steps, or until a step reduces the
  // residual's energy by less than the share `settled`. The residual never grows.
  // O(steps * (modes * samples * channels + modes^3))
  void refine(int steps, double settled, const Progress& progress);

  const std::vector<DampedMode>& modes() const { return modes_; }
  const std::vector<double>& constant() const { return constant_; }       // [channel]
  const std::vector<std::vector<double>>& rest() const { return rest_; }  // [channel][sample]
  double rest_energy() const;
  std::size_t version() const { return version_; }  // Changes with the residual.

  // Returns the deviations of all current modes. With `with_poles` the poles are treated as
  // unknown, too, which makes the amplitudes less certain.
  std::vector<DampedDeviation> deviations(bool with_poles) const;

 private:
  Complex allowed(Complex log_z) const;  // Returns the nearest pole within the limits.
  void find_rest();

  std::span<const std::vector<double>> sound_;
  std::vector<DampedMode> modes_;
  std::vector<double> constant_;
  std::vector<std::vector<double>> rest_;
  double lowest_omega_ = 0.0;  // 0: no limits
  double least_alpha_ = 0.0;
  std::size_t version_ = 0;
};

}  // namespace ressort::identification
