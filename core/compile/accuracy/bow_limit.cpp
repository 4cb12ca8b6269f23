#include "core/compile/accuracy/bow_limit.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/analysis/assembly.h"
#include "core/analysis/places.h"
#include "core/format.h"
#include "core/kernels/oversampled/oversampled_form.h"
#include "core/laws/law.h"
#include "core/model/language/expression.h"

namespace ressort::compile {
namespace {

constexpr double highest_ratio = 3.0;         // Z / M
constexpr double steps_of_oversampled = 4.0;  // steps of --method oversampled
constexpr double highest_rate_hz = 768'000.0;

bool is_bow(Law law, Scheme scheme) {
  return facts_of(law).is_friction && scheme != Scheme::plain;
}

// Returns the displacement of both ends for a force of 1 during one sample, 1/M summed over the
// masses behind them.
double inverse_mass_of(const Network& network, const Link& link, std::span<const Range> arguments,
                       std::span<const double> start) {
  std::map<std::uint32_t, double> shares;
  const auto add = [&](std::uint32_t end, double sign) {
    each_share(
        network, end, [&](std::uint32_t mass, double share) { shares[mass] += sign * share; },
        start);
  };
  add(link.a, 1.0);
  add(link.b, -1.0);
  double sum = 0.0;
  for (const auto& [mass, share] : shares) {
    const Mass& moved = network.masses[mass];
    if (moves(moved)) {
      sum += share * share / range_at(arguments, moved.mass).lowest;
    }
  }
  return sum;
}

}  // namespace

std::optional<Bow> find_strongest_bow(const Network& network, std::span<const Scheme> schemes,
                                      const ParameterBox& box, std::span<const double> start,
                                      double rate_ratio) {
  std::optional<Bow> strongest;
  std::vector<Range> arguments;
  for (std::size_t i = 0; i < schemes.size(); ++i) {
    const Link& link = network.links[i];
    const auto is_junction = [&](std::uint32_t mass) {
      return network.masses[mass].kind == MassKind::junction;
    };
    if (!is_bow(link.law, schemes[i]) || is_junction(link.a) || is_junction(link.b)) {
      continue;
    }
    if (arguments.empty()) {
      arguments = argument_ranges(network, box);
    }
    const double inverse_mass = inverse_mass_of(network, link, arguments, start);
    const ArgumentId z = link.arguments[facts_of(link.law).slot(Role::damping)];
    const double strength = rate_ratio * range_at(arguments, z).highest;
    if (inverse_mass > 0.0 && (!strongest || strength * inverse_mass * strongest->limit >
                                                 highest_ratio * strongest->strength)) {
      strongest =
          Bow{std::string(link.name), link.location, strength, highest_ratio / inverse_mass};
    }
  }
  return strongest;
}

double bow_steps_per_sample(const Machine& machine) {
  double fewest = HUGE_VAL;
  for (const Program& program : machine.parts) {
    const bool has_bow = std::ranges::any_of(
        program.link_runs, [](const LinkRun& run) { return is_bow(run.law, run.scheme); });
    const auto* fine = program.form.get_if<Oversampled>();
    const double steps = fine != nullptr && !fine->coarse ? fine->times : 1.0;
    fewest = has_bow ? std::min(fewest, steps) : fewest;
  }
  return std::isfinite(fewest) ? fewest : 1.0;
}

std::optional<Error> check_bow(const Bow& bow, double steps, double rate_hz) {
  const double needed = bow.strength / bow.limit;
  if (!(needed > steps)) {
    return std::nullopt;
  }
  const auto rounded = [](double value) { return formatted("%.3g", value); };
  const double higher_hz = std::ceil(needed / steps * rate_hz / 1000.0) * 1000.0;
  std::string remedy = "lower Z";
  if (higher_hz <= highest_rate_hz) {
    remedy += ", or use ";
    remedy += steps < steps_of_oversampled && needed < steps_of_oversampled
                  ? "--method oversampled or a rate of "
                  : "a rate of ";
    remedy += print_number(higher_hz) + " Hz";
  }
  return Error{"the bow '" + bow.name + "' is too strong: its Z of " +
                   rounded(bow.strength / steps) + " per time step exceeds the limit of " +
                   rounded(bow.limit) +
                   ", three times the mass that it moves. It slips too early, " +
                   "and a single mass squeaks far above its pitch; " + remedy,
               bow.location.line, bow.location.column};
}

double highest_bow_factor(const Bow& bow, double steps) {
  const double root = steps * bow.limit / bow.strength;
  return root * root;
}

}  // namespace ressort::compile
