// core/compile: the poles of a linear network as a form steps it: logarithms of the growth per
// sample. For masses of 1, with stiffness and damping per sample.
#pragma once

#include <complex>
#include <optional>
#include <utility>
#include <vector>

#include "core/compile/accuracy/springs.h"
#include "core/kernels/form.h"

namespace ressort::compile {

// The scheme of a form and its time step in samples.
struct Stepping {
  enum class Scheme { published, exact };

  // Returns the pole of a single mode, or nothing if it does not oscillate.
  std::optional<std::complex<double>> pole(double stiffness, double damping) const;
  // Returns the poles of coupled modes with a positive frequency. Not for the exact scheme.
  std::vector<std::complex<double>> poles(const Springs& springs) const;
  // Returns the K and Z with which one step of the published scheme is the same.
  std::pair<Matrix, Matrix> as_published(const Springs& springs) const;

  Scheme scheme = Scheme::published;
  double step = 1.0;

  bool operator==(const Stepping&) const = default;
};

Stepping stepping_of(const Form& form);

// Returns the pole of a mode of the continuous network, or nothing if it does not oscillate.
std::optional<std::complex<double>> continuous_pole(double stiffness, double damping);

}  // namespace ressort::compile
