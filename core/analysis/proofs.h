// core/analysis: internals of Stability: one network, assembled, and the queries on it.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/analysis/assembly.h"
#include "core/analysis/boundary.h"
#include "core/analysis/stability.h"

namespace ressort::analysis {

class Proofs {
 public:
  Proofs(Network network, double rate_ratio, std::size_t most_exact, Progress progress);

  bool is_exact() { return boundary_.is_exact(); }
  std::size_t size() const { return assembly_.terms.size(); }

  Verdict prove(const ParameterBox& box);
  Certificate certify(const ParameterBox& box);
  std::optional<SafeRange> safe_range(const ParameterBox& box, std::size_t parameter, double start);
  double share(const ParameterBox& safe, const ParameterBox& wide);
  double stiffness_factor(const ParameterBox& box);

 private:
  // Replaces the range of an argument for one quantity. The same text may be a stiffness in one
  // place and a damping in another; only the one quantity changes.
  struct RangeOverride {
    Quantity quantity = Quantity::stiffness;
    ArgumentId argument = no_argument;
    double value = 0.0;
  };
  // The stiffness or damping of a term, or the mass of a row.
  struct Suspect {
    Quantity quantity = Quantity::stiffness;
    std::size_t index = 0;
    bool gains_energy = false;  // Unstable because it is negative, not because it is too large.
  };
  enum class Course { flat, straight, bent };

  // The last query. A query along one parameter changes few formulas and few terms, and only these
  // are computed anew.
  struct LastLoads {
    std::vector<Range> arguments;  // [argument]
    std::vector<Load> loads;       // [term]
  };
  using LoadOfTerm = Load (*)(const Network&, const Assembly::Term&, std::span<const Range>,
                              double);

  std::span<const Range> ranges(const ParameterBox& box);
  std::span<const Load> loads(std::span<const Range> arguments) {
    return update(highest_, arguments, highest_load);
  }
  std::span<const Load> lowest_loads(std::span<const Range> arguments) {
    return update(lowest_, arguments, lowest_load);
  }
  std::span<const Load> update(LastLoads& last, std::span<const Range> arguments,
                               LoadOfTerm load_of) const;
  Weights weights_for(std::span<const Range> arguments);
  Weights weights_for(std::span<const Range> arguments, const RangeOverride& instead);
  bool gains_energy(std::span<const Range> arguments);
  bool is_positive(std::span<const double> terms);
  Course course_along(std::size_t parameter) const;
  SafeRange range_around(const WeightLine& line, double anchor);

  // Defined in culprit.cpp.
  std::optional<Suspect> find_invalid_number_in(std::span<const Range> arguments);
  Suspect feeder(std::span<const Range> arguments);
  Suspect find_worst_link(const Weights& weights, std::span<const Range> arguments,
                          std::span<const double> shape) const;
  std::optional<Suspect> find_lightest_mass(const Weights& weights,
                                            std::span<const double> shape) const;
  Suspect heavier_part(std::size_t term, std::span<const Range> arguments) const;
  Culprit accuse(const Suspect& suspect, std::span<const Range> arguments) const;
  ArgumentId argument_of(const Suspect& suspect, std::span<const Range> arguments) const;
  std::optional<double> limit(const Suspect& suspect, std::span<const Range> arguments);
  std::size_t users(const Suspect& suspect, std::span<const Range> arguments) const;
  const SourceLocation& location_of(const Suspect& suspect) const;

  std::vector<Macro> macros_;
  Network network_;  // Without macros.
  double rate_ratio_;
  Progress progress_;
  Assembly assembly_;
  BoundaryFinder boundary_;
  ParameterBox box_;           // of the last query
  std::vector<Range> ranges_;  // [argument] of the last query
  LastLoads highest_, lowest_;
};

}  // namespace ressort::analysis
