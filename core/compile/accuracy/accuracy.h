// core/compile: how far the partials of what will run are off those of the continuous network that
// its numbers describe, M x'' + Z x' + K x = 0: poles beside poles.
//
// What is nonlinear counts as open, but for the spring that its law contains. A partial counts up
// to 20 kHz and half the sample rate, and if it lasts for a period; a decay of more than an hour
// counts as none. Poles are found mode by mode where damping is proportional, else as the
// eigenvalues of what one step makes of every state. Rounding is not counted.
#pragma once

#include <complex>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/compile/accuracy/stepping.h"
#include "core/kernels/program.h"
#include "core/model/preset/budget.h"
#include "core/progress.h"

namespace ressort::compile {

// The worst of all partials, without signs.
struct Accuracy {
  double cents = 0.0;
  double t60_percent = 0.0;
  bool is_known = true;   // else it was not looked for, as that would take too long
  bool is_bound = false;  // these are the most that it may be

  bool meets(const Budget& budget) const {
    return is_known && cents <= budget.cents && t60_percent <= budget.t60_percent;
  }
};

// The worst of two, and what two say that come one after the other.
Accuracy worse_of(const Accuracy& a, const Accuracy& b);
Accuracy sum_of(const Accuracy& a, const Accuracy& b);

// Numbers that a network is played with.
struct Corner {
  std::vector<double> parameters;  // [parameter]
  double stiffness_factor = 1.0;
};

// What is looked at of ranges: the start; each parameter at either of its ends while the others
// start, up to most_single_parameters of them; all where the network is at its stiffest, with the
// start's pitch and with `highest_factor`. Empty ranges: the start alone.
inline constexpr std::size_t most_single_parameters = 8;
std::vector<Corner> corners_of(const Program& program, std::span<const double> start,
                               std::span<const double> lowest, std::span<const double> highest,
                               double highest_factor);

// Masses of a part up to which eigenvalues are sought where damping is not proportional; the time
// grows with the third power, and with the corners.
inline constexpr std::size_t most_coupled_masses = 200;

// Judges the forms of a part, all at the same corners. What it finds of the continuous network it
// keeps. [any thread but audio]
class Judge {
 public:
  // The Program outlives it. `most_masses`: for how many modes are sought where damping is
  // proportional.
  Judge(const Program& program, std::vector<Corner> corners, std::size_t most_masses,
        const Progress& progress = {});

  // Of the Program in a form of its own. O(corners * masses^3)
  Accuracy of(const Form& form);

 private:
  struct Mode {
    double stiffness = 0.0;
    double damping = 0.0;
  };
  // The continuous network at one corner.
  struct Course {
    bool is_known = true;
    bool is_proportional = true;
    std::vector<Mode> modes;                  // if it is
    std::vector<std::complex<double>> poles;  // of those that swing
  };
  const Course& course(std::size_t corner);
  Accuracy of_bodies(std::size_t corner, const Stepping& stepping);
  Accuracy at(std::size_t corner, const Stepping& stepping);

  const Program& program_;
  std::vector<Corner> corners_;
  std::size_t most_masses_;
  const Progress& progress_;
  std::vector<std::optional<Course>> courses_;  // [corner]
};

}  // namespace ressort::compile
