// core/identification: the damped sinusoids whose sum is nearest to a sound, all of their numbers
// at once (Gauss-Newton with Levenberg's damping), and how uncertain each number is (the Cramer-Rao
// bound at the noise that is left over). [any thread but audio]
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/identification/damped.h"
#include "core/progress.h"

namespace ressort::identification {

// Re(c z^n) in each channel; log z is shared.
struct DampedMode {
  Complex log_z;
  std::vector<Complex> c;  // [channel]
};

// Standard deviations for noise of variance 1, and that of each complex amplitude: the root of the
// mean of its two parts' variances.
struct DampedDeviation {
  double alpha = 0.0;
  double omega = 0.0;
  std::vector<double> c;  // [channel]
};

class DampedFit {
 public:
  // Channels of one length, in which a constant is fitted as well.
  explicit DampedFit(std::span<const std::vector<double>> sound);

  // The amplitudes that suit these poles best; false where they cannot be told apart.
  bool set_poles(const std::vector<Complex>& log_z);
  // Without these modes; the amplitudes of the others move so that the rest is least again, which
  // it has to be before. O(modes^3 + samples of those that move)
  void remove(const std::vector<bool>& is_removed);
  // Takes these modes as they are.
  void set_modes(std::vector<DampedMode> modes);

  // Moves poles and amplitudes until the rest is least, at most so many steps; never to a larger
  // rest. O(steps * (modes * samples * channels + modes^3))
  void refine(int steps, const Progress& progress);

  const std::vector<DampedMode>& modes() const { return modes_; }
  const std::vector<double>& constant() const { return constant_; }       // [channel]
  const std::vector<std::vector<double>>& rest() const { return rest_; }  // [channel][sample]
  double rest_energy() const;

  // Of all modes as they are now. `with_poles`: the poles are as uncertain as the amplitudes.
  std::vector<DampedDeviation> deviations(bool with_poles) const;

 private:
  void find_rest();

  std::span<const std::vector<double>> sound_;
  std::vector<DampedMode> modes_;
  std::vector<double> constant_;
  std::vector<std::vector<double>> rest_;
};

}  // namespace ressort::identification
