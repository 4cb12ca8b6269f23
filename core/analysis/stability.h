// core/analysis: proves the stability of a network before it is played.
//
// With symmetric M > 0 and K, Z >= 0 the explicit scheme is stable if and only if 4M - K - 2Z is
// positive definite (apart from rigid motions), whether or not the damping is proportional. The
// matrix decreases with every stiffness and damping and increases with every mass. One Cholesky
// factorisation at the worst corner of a box therefore proves the whole box, and the safe values of
// each parameter form one interval.
//
// Stiffness and damping of plucks, bows and contacts count as if they always acted, with their
// steepest slopes; quadratic and cubic springs with their slope at rest. So this proves numerical
// stability, and does not bound the energy that a hard contact may gain.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/analysis/assembly.h"
#include "core/analysis/boundary.h"
#include "core/analysis/interval.h"
#include "core/model/network.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::analysis {

inline constexpr double most_bounded = 1e9;  // The edge bound of a network that nothing limits.

enum class Quantity { mass, stiffness, damping };
const char* quantity_name(Quantity quantity);

// The element that causes the instability, and which of its arguments.
struct Culprit {
  std::string name;  // Name of the mass, link or macro.
  SourceLocation location;
  Quantity quantity = Quantity::stiffness;
  std::string argument;  // The argument as written: "m_K", "2*p", "5".
  double value = 0.0;    // Worst value in the box.
  std::optional<double>
      limit;  // Stable below it (for a mass: above it); empty if no value of it alone is enough.
  // Number of other elements with the same argument, to which the limit applies, too.
  std::size_t others = 0;
};

enum class Verdict {
  stable,    // Proved stable.
  unstable,  // Unstable somewhere in the box, with each element at its worst.
  unproved,  // Too large for a factorisation, or something is negative.
};

struct Certificate {
  Verdict verdict = Verdict::stable;
  // Factor on all stiffness and damping up to which it is stable, if it is not stable.
  double factor = 1.0;
  std::optional<Culprit> culprit;
};

// Formats a limit with six digits, rounded to the safe side.
std::string print_limit(double value, bool is_upper);

// Returns the error message for an unstable network, at the culprit's place in the file.
Error complaint(const Certificate& certificate);

// An interval, open except for ends that are 0; infinite if unlimited.
struct SafeRange {
  double lowest = 0.0;
  double highest = 0.0;
};

// Returns whether the link's stiffness or damping is below 0 somewhere, for these parameter values.
// Such a link can make motion grow with any scheme.
bool pushes(const Network& network, const Link& link, std::span<const double> parameters);

// Returns the network with the links that always act: springs, dampers, oscillators, and nonlinear
// springs with their slope at rest. Plucks, bows and contacts, which may never touch, are left out
// unless their stiffness or damping is negative.
Network always_felt(Network network);

// Returns "stable below 1.31568", "stable between 0.1 and 4" or "stable anywhere".
std::string describe(const SafeRange& safe);

// Proofs and limits for one network, whose macros are expanded once. Exact up to `most_exact`
// masses unless their links are too random for a factorisation (Cholesky::most_work); otherwise by
// the edge bound, on the safe side. A link at a moving place counts at the worst of its nodes:
// safe, but not exact. [any thread but audio]
class Stability {
 public:
  static constexpr std::size_t most_exact_masses = 40'000;

  Stability(Network network, double rate_ratio, std::size_t most_exact = most_exact_masses,
            Progress progress = {});
  Stability(const Stability&) = delete;

  // Returns whether results are exact; otherwise they come from the edge bound.
  bool is_exact() { return boundary_.is_exact(); }
  // Returns the number of links and oscillators.
  std::size_t size() const { return assembly_.terms.size(); }

  // Returns whether the network is stable with the parameters anywhere in the box. O(links) if the
  // edge bound proves it, else one factorisation.
  Verdict prove(const ParameterBox& box);

  // Does the same and finds the culprit if it is unstable: about twenty more factorisations.
  Certificate certify(const ParameterBox& box);

  // Returns the range of one parameter, around `start`, in which the network is stable with the
  // others anywhere in the box. Exact if every argument is affine in it, else proved by interval
  // arithmetic. The range stays on the side of 0 on which `start` lies, and covers both sides if
  // `start` is 0. Empty if no stable value was found.
  std::optional<SafeRange> safe_range(const ParameterBox& box, std::size_t parameter, double start);

  // Returns the largest share, 0 to 1, of the way from a stable box to a wider one that contains
  // it.
  double share(const ParameterBox& safe, const ParameterBox& wide);

  // Returns the exact factor on every stiffness up to which the network is stable anywhere in the
  // box; bows scale with its square root. 0 if the dampers alone are too strong, infinite if
  // unlimited.
  double stiffness_factor(const ParameterBox& box);
  // Returns such a factor from the edge bound: max over links of (d_i/m_i + d_j/m_j) < 3.92, where
  // d is the sum of k + 2z at a mass. Not above 0 if the dampers alone are too strong; most_bounded
  // if nothing limits it; 0 if the assembly is incomplete. At most two times too small if no place
  // is live. O(masses + links)
  double bounded_stiffness_factor(const ParameterBox& box);

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
  std::optional<SafeRange> safe_range_beside(const ParameterBox& box, std::size_t parameter,
                                             double start);
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
