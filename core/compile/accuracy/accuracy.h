// core/compile: the error of a form: the distance of its poles from those of the continuous network
// M x'' + Z x' + K x = 0.
//
// Nonlinear links count as their linear spring, or not at all if they have none. A partial counts
// up to 20 kHz and half the sample rate, if it decays by less than 60 dB in a period; T60 above one
// hour counts as infinite. With proportional damping the poles are computed mode by mode, otherwise
// as the eigenvalues of the matrix of one time step. Rounding errors are not included.
#pragma once

#include <complex>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/compile/accuracy/stepping.h"
#include "core/kernels/program.h"
#include "core/model/preset/budget.h"
#include "core/progress.h"

namespace ressort::compile {

// The largest errors of all partials, as absolute values. Infinite if a partial is missing.
struct Accuracy {
  double cents = 0.0;
  double t60_percent = 0.0;
  bool is_known = true;   // false: computing the errors would take too long
  bool is_bound = false;  // upper bounds

  bool meets(const Budget& budget) const {
    return is_known && cents <= budget.cents && t60_percent <= budget.t60_percent;
  }
};

// Returns the larger of two errors.
Accuracy worse_of(const Accuracy& a, const Accuracy& b);

// Parameter values and pitch at which errors are computed.
struct Corner {
  std::vector<double> parameters;  // [parameter]
  double stiffness_factor = 1.0;
};

// Returns the corners to examine: the start; each parameter at either end of its range with the
// others at their start, for up to most_single_parameters; and the stiffest corner of all ranges,
// at the start's pitch and at `highest_factor`. Empty ranges: the start only.
inline constexpr std::size_t most_single_parameters = 8;
std::vector<Corner> corners_of(const Program& program, std::span<const double> start,
                               std::span<const double> lowest, std::span<const double> highest,
                               double highest_factor);

// Largest part with non-proportional damping whose eigenvalues are computed. The time grows with
// the third power of the masses, and with the number of corners.
inline constexpr std::size_t most_coupled_masses = 200;

// Computes the errors of the forms of one part at the same corners. Keeps the poles of the
// continuous network. [any thread but audio]
class AccuracyMeter {
 public:
  // The Program outlives it. `most_masses`: largest part with proportional damping whose modes are
  // computed.
  AccuracyMeter(const Program& program, std::vector<Corner> corners, std::size_t most_masses,
                const Progress& progress = {});

  // Returns the error of a form of this Program. O(corners * masses^3)
  Accuracy of(const Form& form);

 private:
  // The continuous network at one corner.
  struct Continuous {
    bool is_known = true;
    bool is_proportional = true;
    std::vector<SpringMode> modes;            // modes, with proportional damping
    std::vector<std::complex<double>> poles;  // otherwise, of oscillating modes
    std::vector<std::complex<double>> all_poles() const;
  };
  const Continuous& continuous_at(std::size_t corner);
  Accuracy at(std::size_t corner, const Stepping& stepping);

  const Program& program_;
  std::vector<Corner> corners_;
  std::size_t most_masses_;
  const Progress& progress_;
  std::vector<std::optional<Continuous>> continuous_;  // [corner]
};

}  // namespace ressort::compile
