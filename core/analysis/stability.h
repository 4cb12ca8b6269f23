// core/analysis: what can be said of a network's stability before it sounds.
//
// With symmetric M > 0 and K, Z >= 0 the explicit scheme is stable if, and only if, 4M - K - 2Z is
// positive definite (on what is no rigid motion), whether or not the damping is proportional. That
// matrix falls with every stiffness and every damping and grows with every mass. So one Cholesky
// factorisation at the worst corner of a box proves the whole box, and whatever is safe is one
// interval of each parameter.
//
// Stiffness and damping of plucks, bows and contacts count as if always felt, with their steepest
// slopes; quadratic and cubic springs as they are at rest. So this is about what a network does
// numerically, not about the energy that a hard contact may gain.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/analysis/interval.h"
#include "core/model/network.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::analysis {

// The factor on every stiffness up to which the explicit scheme is certainly stable, anywhere in
// the box: the edge bound max over links of (d_i/m_i + d_j/m_j) < 3.92, with d the sum of k + 2z
// at a mass; a place counts with the masses around it, a live one with whichever is the worst.
// `rate_ratio` is 44100 / rate. At most 0 where the dampers alone are too strong; that much where
// there is nothing to bound. No more than two times too careful where no place is live. For a
// network without macros. O(masses + links). [any thread but audio]
inline constexpr double most_bounded = 1e9;
double highest_stiffness_factor(const Network& network, const ParameterBox& box, double rate_ratio);

enum class Quantity { mass, stiffness, damping };
const char* quantity_name(Quantity quantity);

// The element to blame, and which of its arguments.
struct Culprit {
  std::string name;  // of the mass, link or macro
  SourceLocation location;
  Quantity quantity = Quantity::stiffness;
  std::string argument;  // as written: "m_K", "2*p", "5"
  double value = 0.0;    // what it amounts to at worst
  std::optional<double>
      limit;               // below it, for a mass above it, all is well; nothing: not by itself
  std::size_t others = 0;  // elements with the same argument, which the limit is for too
};

enum class Verdict {
  stable,    // proved
  unstable,  // somewhere in the box, each element being at its worst
  unproved,  // too large for a factorisation, or something is negative
};

struct Certificate {
  Verdict verdict = Verdict::stable;
  double factor = 1.0;  // on all stiffness and damping, up to which it is stable; if it is not
  std::optional<Culprit> culprit;
};

// A limit in six digits, rounded towards the safe side.
std::string print_limit(double value, bool is_upper);

// What to tell of a network that is not stable, with the culprit's place.
Error complaint(const Certificate& certificate);

// An open interval, but for ends that are 0; infinite where nothing limits.
struct SafeRange {
  double lowest = 0.0;
  double highest = 0.0;
};

// Whether its stiffness or damping is below 0 somewhere, with these values of the parameters:
// motion may grow by itself there, however its force is found.
bool pushes(const Network& network, const Link& link, std::span<const double> parameters);

// What is always felt: springs, dampers, oscillators, and what nonlinear springs are at rest.
// Without plucks, bows and contacts, of which nothing may ever touch, but for what pushes.
Network always_felt(Network network);

// "stable below 1.31568", "stable between 0.1 and 4", "stable anywhere".
std::string describe(const SafeRange& safe);

class Proofs;

// Proofs and limits for one network; takes its macros apart once. Exact up to `most_exact` masses
// that do not hang together at random (Cholesky::most_work), else by the edge bound, on the safe
// side. Where places move, each link on one counts at the worst of its nodes: safe, not exact.
// [any thread but audio]
class Stability {
 public:
  static constexpr std::size_t most_exact_masses = 40'000;

  Stability(Network network, double rate_ratio, std::size_t most_exact = most_exact_masses,
            Progress progress = {});
  ~Stability();
  Stability(Stability&&) noexcept;
  Stability& operator=(Stability&&) noexcept;

  // Whether it is; else by the bound.
  bool is_exact();
  // How many links and oscillators it has to do with.
  std::size_t size() const;

  // Is it stable with the parameters anywhere in the box? O(links) where the edge bound says yes,
  // one factorisation otherwise.
  Verdict prove(const ParameterBox& box);

  // The same, and who is to blame if not: some twenty factorisations more.
  Certificate certify(const ParameterBox& box);

  // Where one parameter keeps the network stable with the others anywhere in the box, around
  // `start` if that is stable: exact if every argument is a straight line along it, else what is
  // proved by intervals. On the side of 0 on which `start` is, on both from 0. Nothing where no
  // value was found.
  std::optional<SafeRange> safe_range(const ParameterBox& box, std::size_t parameter, double start);

  // How far of the way from one box, where it is stable, to one that holds it: 0..1.
  double share(const ParameterBox& safe, const ParameterBox& wide);

  // The exact factor on every stiffness up to which it is stable anywhere in the box; bows count
  // with its root. 0 where the dampers alone are too strong, infinite where nothing bounds.
  double stiffness_factor(const ParameterBox& box);

 private:
  std::unique_ptr<Proofs> proofs_;
};

}  // namespace ressort::analysis
