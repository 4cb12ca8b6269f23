// core/compile: what a form makes of a linear network in one step, as poles: logarithms of what it
// grows by in a sample. Masses are 1, stiffness and damping per sample.
#pragma once

#include <complex>
#include <optional>
#include <utility>
#include <vector>

#include "core/compile/accuracy/springs.h"
#include "core/kernels/forms.h"

namespace ressort::compile {

// By which scheme, and how many samples at a time.
struct Stepping {
  enum class Scheme { published, exact };

  // What a mode that swings alone becomes; nothing where it swings no more.
  std::optional<std::complex<double>> pole(double stiffness, double damping) const;
  // The same of what swings together; not of the exact scheme.
  std::vector<std::complex<double>> poles(const Springs& springs) const;
  // The numbers with which the published scheme does the same in a step.
  std::pair<Matrix, Matrix> as_published(const Springs& springs) const;

  Scheme scheme = Scheme::published;
  double step = 1.0;

  bool operator==(const Stepping&) const = default;
};

Stepping stepping_of(const Form& form);

// Where a continuous mode swings.
std::optional<std::complex<double>> continuous_pole(double stiffness, double damping);

}  // namespace ressort::compile
