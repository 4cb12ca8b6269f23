// core/kernels: measures the time of a part in one of its forms on this machine. The application
// supplies the clock and the store of earlier results: this room uses neither clocks nor files.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

// Measures forms and keeps the results. Every function may be empty.
struct Timings {
  // Calls `play` once, with denormals flushed to zero, and returns the ns that it took. If it is
  // empty, nothing is measured.
  std::function<double(const Program& program, const std::function<void()>& play)> time;
  // Returns the ns per sample that keep() received for this key, perhaps in an earlier run.
  std::function<std::optional<double>(const std::string& key)> recall;
  std::function<void(const std::string& key, double ns)> keep;
};

// Names a form: "chains", "modal exact", "oversampled 4 direct". Two forms of one part that differ
// in a bit of the output have different names.
std::string form_name(const Form& form);

// Returns the key of a measurement: the form, the structure of the part, the number of voices, the
// precision, the instruction set and the rate. The values of coefficients are not part of it, since
// the time does not depend on them. O(elements)
std::string timing_key(const Program& program, const Workload& load);

// Returns whether a block of the part is short enough to be measured. O(runs)
bool is_measurable(const Program& program, const Workload& load);

// Returns the ns per sample of all voices of the part in the form that it has, with every link that
// can touch touching, except those of masses that nothing holds: from the store, or else measured
// and stored. Measuring takes a few milliseconds: one block to warm up, then the median of at least
// three. Returns nothing if the time is neither known nor measured. [any thread but audio]
std::optional<double> known_ns(const Program& program, const Workload& load,
                               const Timings& timings);

}  // namespace ressort::kernels
