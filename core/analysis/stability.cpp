#include "core/analysis/stability.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/laws/law.h"
#include "core/model/topology.h"

namespace ressort::analysis {
namespace {

constexpr double unbounded = std::numeric_limits<double>::infinity();
constexpr double safe_limit = 4.0 * (1.0 - 1e-9);  // The limit 4 less a margin for rounding.

}  // namespace

bool pushes(const Network& network, const Link& link, std::span<const double> parameters) {
  LawNumbers numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    numbers[i] = argument_value(network, link.arguments[i], parameters);
  }
  const Slopes least = gentlest(link.law, numbers);
  return least.pull < 0.0 || least.damping < 0.0;
}

Network always_felt(Network network) {
  const std::vector<double> values = parameter_values(network);
  std::erase_if(network.links, [&](const Link& link) {
    const LinearPart part = linear_part(link);
    return part.stiffness == no_argument && part.damping == no_argument &&
           !pushes(network, link, values);
  });
  for (Link& link : network.links) {
    if (pushes(network, link, values)) {
      continue;
    }
    const LinearPart part = linear_part(link);
    link.law = linear_law;
    link.arguments.fill(no_argument);
    link.arguments[0] = part.stiffness;
    link.arguments[1] = part.damping;
  }
  return network;
}

Stability::Stability(Network network, double rate_ratio, std::size_t most_exact, Progress progress)
    : macros_(network.macros),
      network_(network.macros.empty() ? std::move(network) : expand_macros(network)),
      rate_ratio_(rate_ratio),
      progress_(std::move(progress)),
      assembly_(assemble(network_)),
      boundary_(assembly_, assembly_.masses.size() <= most_exact, progress_) {
  progress_.spend(assembly_.entries.size());
}

// --- weights ------------------------------------------------------------------------------------

std::span<const Range> Stability::ranges(const ParameterBox& box) {
  const std::size_t count = box.lowest.size();
  std::vector<bool> has_moved(count, true);
  for (std::size_t i = 0; i < std::min(count, box_.lowest.size()); ++i) {
    has_moved[i] = box.lowest[i] != box_.lowest[i] || box.highest[i] != box_.highest[i];
  }
  const bool is_first = ranges_.empty();
  ranges_.resize(network_.arguments.size());
  for (std::size_t i = 0; i < ranges_.size(); ++i) {
    const Formula& formula = network_.arguments[i];
    if (is_first || std::ranges::any_of(formula, [&](const Step& step) {
          return step.op == Op::parameter && has_moved[step.index];
        })) {
      ranges_[i] = formula_range(formula, box);
    }
  }
  box_ = box;
  return ranges_;
}

std::span<const Load> Stability::update(LastLoads& last, std::span<const Range> arguments,
                                        LoadOfTerm load_of) const {
  const std::size_t count = assembly_.terms.size();
  progress_.spend(count);
  const bool is_first = last.arguments.empty();
  std::vector<bool> has_moved(arguments.size(), true);
  for (std::size_t i = 0; !is_first && i < arguments.size(); ++i) {
    has_moved[i] = !(arguments[i] == last.arguments[i]);
  }
  const auto moves = [&](ArgumentId id) { return id != no_argument && has_moved[id]; };
  last.loads.resize(count);
  for (std::size_t t = 0; t < count; ++t) {
    const Assembly::Term& term = assembly_.terms[t];
    bool is_new = is_first;
    if (term.is_link) {
      const auto& used = network_.links[term.element].arguments;
      is_new = is_new || std::ranges::any_of(used, moves);
    } else {
      const Mass& mass = network_.masses[term.element];
      is_new = is_new || moves(mass.mass) || moves(mass.stiffness) || moves(mass.damping);
    }
    if (is_new) {
      last.loads[t] = load_of(network_, term, arguments, rate_ratio_);
    }
  }
  last.arguments.assign(arguments.begin(), arguments.end());
  return last.loads;
}

Weights Stability::weights_for(std::span<const Range> arguments) {
  Weights weights;
  for (const std::uint32_t mass : assembly_.masses) {
    weights.masses.push_back(range_at(arguments, network_.masses[mass].mass).lowest);
  }
  for (const Load& load : loads(arguments)) {
    weights.terms.push_back(load.total());
  }
  weights.gains_energy = gains_energy(arguments);
  return weights;
}

Weights Stability::weights_for(std::span<const Range> arguments, const RangeOverride& instead) {
  std::vector<Range> changed(arguments.begin(), arguments.end());
  changed[instead.argument] = {instead.value, instead.value};
  Weights weights = weights_for(arguments);
  if (instead.quantity == Quantity::mass) {
    weights.masses = weights_for(changed).masses;
    return weights;
  }
  const std::span<const Load> now = loads(arguments);
  const std::vector<Load> before(now.begin(), now.end());
  const std::span<const Load> after = loads(changed);
  for (std::size_t t = 0; t < before.size(); ++t) {
    weights.terms[t] = instead.quantity == Quantity::stiffness
                           ? after[t].stiff + before[t].damped + before[t].rubbed
                           : before[t].stiff + after[t].damped + after[t].rubbed;
  }
  return weights;
}

// Single terms may be negative as long as their sum is not: a spring that pushes beside one that
// pulls. A link on a waveguide is not part of a sum.
bool Stability::gains_energy(std::span<const Range> arguments) {
  if (std::ranges::none_of(arguments, [](const Range& range) { return range.lowest < 0.0; })) {
    return false;
  }
  std::vector<double> stiff;
  std::vector<double> damped;
  double least = 0.0;
  for (const Load& load : lowest_loads(arguments)) {
    const double less = std::min(load.stiff, load.damped);
    if (less < 0.0 && assembly_.terms[stiff.size()].is_passive) {
      return true;
    }
    stiff.push_back(load.stiff);
    damped.push_back(load.damped);
    least = std::min(least, less);
  }
  return least < 0.0 && !(boundary_.is_exact() && is_positive(stiff) && is_positive(damped));
}

bool Stability::is_positive(std::span<const double> terms) {
  double largest = 0.0;
  std::vector<double> negated;
  for (const double term : terms) {
    if (!std::isfinite(term)) {
      return false;
    }
    largest = std::max(largest, std::fabs(term));
    negated.push_back(-term);
  }
  const std::vector<double> rounding(assembly_.masses.size(), 1e-12 * largest);
  return largest == 0.0 || boundary_.is_definite(rounding, negated);
}

// Returns how the stability-relevant numbers depend on one parameter.
Stability::Course Stability::course_along(std::size_t parameter) const {
  const auto index = static_cast<std::uint32_t>(parameter);
  std::vector<bool> is_used(network_.arguments.size(), false);
  const auto use = [&](ArgumentId id) {
    if (id != no_argument) {
      is_used[id] = true;
    }
  };
  for (const std::uint32_t i : assembly_.masses) {
    const Mass& mass = network_.masses[i];
    use(mass.mass);
    use(mass.stiffness);
    use(mass.damping);
  }
  for (const Link& link : network_.links) {
    std::for_each(link.arguments.begin(), link.arguments.end(), use);
  }
  Course course = Course::flat;
  for (std::size_t id = 0; id < is_used.size(); ++id) {
    if (!is_used[id]) {
      continue;
    }
    const Formula& formula = network_.arguments[id];
    if (!is_affine(formula, index)) {
      return Course::bent;
    }
    if (std::ranges::any_of(formula, [&](const Step& step) {
          return step.op == Op::parameter && step.index == index;
        })) {
      course = Course::straight;
    }
  }
  return course;
}

// --- queries ------------------------------------------------------------------------------------

Verdict Stability::prove(const ParameterBox& box) {
  const std::span<const Range> arguments = ranges(box);
  const Weights weights = weights_for(arguments);
  return boundary_.holds(weights, safe_limit)                            ? Verdict::stable
         : find_invalid_number_in(arguments) || boundary_.fails(weights) ? Verdict::unstable
                                                                         : Verdict::unproved;
}

Certificate Stability::certify(const ParameterBox& box) {
  const Verdict verdict = prove(box);
  if (verdict == Verdict::stable || !assembly_.is_complete) {
    return {.verdict = verdict};
  }
  const std::span<const Range> arguments = ranges(box);
  if (const auto suspect = find_invalid_number_in(arguments)) {
    return {verdict, 0.0, accuse(*suspect, arguments)};
  }
  const Weights weights = weights_for(arguments);
  if (weights.gains_energy) {
    return {verdict, 0.0, accuse(feeder(arguments), arguments)};
  }
  const auto all_together = [&](double factor) {
    Weights scaled = weights;
    for (double& term : scaled.terms) {
      term *= factor;
    }
    return scaled;
  };
  const Boundary boundary = boundary_.between(all_together, 0.0, 1.0);
  // Prefers what an author would change: one link if that is enough, else the mass between several.
  Suspect suspect = find_worst_link(weights, arguments, boundary.shape);
  std::optional<double> enough = limit(suspect, arguments);
  if (!enough || users(suspect, arguments) > 1) {
    const auto mass = find_lightest_mass(weights, boundary.shape);
    const auto heavier =
        mass && users(*mass, arguments) == 1 ? limit(*mass, arguments) : std::nullopt;
    suspect = heavier ? *mass : suspect;
    enough = heavier ? heavier : enough;
  }
  Culprit culprit = accuse(suspect, arguments);
  culprit.limit = enough;
  return {verdict, boundary.value, std::move(culprit)};
}

std::optional<SafeRange> Stability::safe_range(const ParameterBox& box, std::size_t parameter,
                                               double start) {
  auto safe = safe_range_beside(box, parameter, start);
  if (start == 0.0 && safe && safe->lowest == 0.0) {
    // Searches the other side of 0, too, unless it is unstable at once, as a negative stiffness is.
    constexpr double beside = 1e-6;
    const auto below = safe_range_beside(box, parameter, -beside);
    if (below && below->highest > -beside && below->lowest < -beside) {
      safe->lowest = below->lowest;
    }
  }
  return safe;
}

// Searches only the side of 0 on which `start` lies; the positive side from 0.
std::optional<SafeRange> Stability::safe_range_beside(const ParameterBox& box,
                                                      std::size_t parameter, double start) {
  const Course course = course_along(parameter);
  const double side = start < 0.0 ? -1.0 : 1.0;
  // Tests all values from `from` to `to` at once; for a straight course the ends are enough.
  const auto between = [&](double from, double to) {
    ParameterBox moved = box;
    moved.lowest[parameter] = std::min(side * from, side * to);
    moved.highest[parameter] = std::max(side * from, side * to);
    return weights_for(ranges(moved));
  };
  const auto holds = [&](double at) { return boundary_.holds(between(at, at), 4.0); };
  const double size = std::fabs(start);
  std::vector<double> tries = {size, 0.0};
  for (double far = 16.0; course != Course::flat && far < 1e8; far *= 16.0) {
    tries.insert(tries.end(), {(size > 0.0 ? size : 1.0) * far, size / far});
  }
  const auto anchor = std::ranges::find_if(tries, holds);
  if (anchor == tries.end()) {
    return std::nullopt;
  }
  if (course == Course::flat) {
    return SafeRange{-unbounded, unbounded};
  }
  const WeightLine line = [&](double at) {
    return course == Course::straight ? between(at, at) : between(*anchor, at);
  };
  const SafeRange found = range_around(line, *anchor);
  return start < 0.0 ? SafeRange{-found.highest, -found.lowest} : found;
}

SafeRange Stability::range_around(const WeightLine& line, double anchor) {
  SafeRange range{0.0, unbounded};
  if (const auto boundary =
          boundary_.is_exact() ? std::nullopt : boundary_.bound_crossing(line, anchor)) {
    // Masses have a lower limit, stiffnesses an upper one; the search continues on the other side.
    const bool is_lowest = *boundary < anchor;
    (is_lowest ? range.lowest : range.highest) = *boundary;
    if (boundary_.holds(line(is_lowest ? 1e12 * anchor : 0.0), 4.0)) {
      return range;
    }
    range = {0.0, unbounded};
  }
  if (const auto boundary = boundary_.outwards(line, anchor)) {
    range.highest = boundary->value;
  }
  if (!boundary_.holds(line(0.0), 4.0)) {
    range.lowest = boundary_.between(line, anchor, 0.0).value;
  }
  return range;
}

double Stability::share(const ParameterBox& safe, const ParameterBox& wide) {
  const auto line = [&](double way) {
    ParameterBox box;
    for (std::size_t i = 0; i < safe.lowest.size(); ++i) {
      box.lowest.push_back(std::lerp(safe.lowest[i], wide.lowest[i], way));
      box.highest.push_back(std::lerp(safe.highest[i], wide.highest[i], way));
    }
    return weights_for(ranges(box));
  };
  return boundary_.holds(line(1.0), safe_limit) ? 1.0 : boundary_.between(line, 0.0, 1.0).value;
}

double Stability::stiffness_factor(const ParameterBox& box) {
  const std::span<const Range> arguments = ranges(box);
  const Weights weights = weights_for(arguments);
  const std::span<const Load> all = loads(arguments);
  const auto line = [&](double factor) {
    Weights scaled = weights;
    for (std::size_t t = 0; t < all.size(); ++t) {
      scaled.terms[t] = all[t].stiff * factor + all[t].damped + all[t].rubbed * std::sqrt(factor);
    }
    return scaled;
  };
  if (boundary_.holds(line(1.0), 4.0)) {
    const auto boundary = boundary_.outwards(line, 1.0);
    return boundary ? boundary->value : unbounded;
  }
  return boundary_.holds(line(0.0), 4.0) ? boundary_.between(line, 0.0, 1.0).value : 0.0;
}

double Stability::bounded_stiffness_factor(const ParameterBox& box) {
  // At slightly less than the limit of 4, modes near the Nyquist frequency still decay.
  constexpr double limit = 4.0 * 0.98;
  // The parts that scale with the factor, and the constant rest. Bow friction scales with the
  // square root of the factor; scaling it with the factor itself is conservative above 1.
  struct Sum {
    double stiff = 0.0;
    double damped = 0.0;
    void add(const Sum& other, double share) {
      stiff += share * other.stiff;
      damped += share * other.damped;
    }
  };
  const std::span<const Range> arguments = ranges(box);
  const std::span<const Load> all = loads(arguments);
  std::vector<Sum> sums(assembly_.masses.size());  // [row] d_i, then d_i/m_i
  for (std::size_t t = 0; t < all.size(); ++t) {
    for (const Assembly::Entry& entry : assembly_.of(assembly_.terms[t])) {
      sums[entry.row].add({all[t].stiff + all[t].rubbed, all[t].damped}, std::fabs(entry.share));
    }
  }
  for (std::size_t row = 0; row < sums.size(); ++row) {
    const double mass = range_at(arguments, network_.masses[assembly_.masses[row]].mass).lowest;
    const double inverse = 1.0 / std::max(1e-30, mass);
    sums[row] = {sums[row].stiff * inverse, sums[row].damped * inverse};
  }
  double factor = assembly_.is_complete ? most_bounded : 0.0;
  for (const Assembly::Term& term : assembly_.terms) {
    Sum both;
    for (const Assembly::Entry& entry : assembly_.of(term)) {
      both.add(sums[entry.row], std::fabs(entry.share));
    }
    if (both.stiff > 0.0) {
      factor = std::min(factor, (limit - both.damped) / both.stiff);
    } else if (both.damped > limit) {
      factor = 0.0;
    }
  }
  return factor;
}

}  // namespace ressort::analysis
