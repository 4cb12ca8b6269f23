#include "core/compile/schemes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <optional>
#include <string_view>

#include "core/analysis/assembly.h"
#include "core/analysis/places.h"
#include "core/laws/laws.h"
#include "core/model/topology.h"

namespace ressort {
namespace {

constexpr double soft_contact = 0.08;  // K/M
constexpr double soft_damper = 0.5;    // Z/M
constexpr double soft_bow = 0.3;
constexpr double hard_bow = 2.5;
constexpr double soft_snap = 2.0;     // 0.9 K/M
constexpr double slow_samples = 20;   // from where a pluck is felt to where it is not any more
constexpr double soft_tangent = 1.5;  // (dF/dd)/M

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

// What would go wrong as published, in words, and how bad it is: the worst of its kind is told.
struct Finding {
  LinkScheme scheme;
  double badness = 0.0;  // against what is still safe; above 1 it is not
  std::string trouble;
};

class Judge {
 public:
  Judge(const Network& network, const Preset& preset, const Conditions& conditions,
        bool is_physical, const Progress& progress)
      : network_(network),
        progress_(progress),
        preset_(preset),
        is_physical_(is_physical),
        r_(conditions.rate_ratio),
        stiffer_(r_ * r_ * conditions.stiffness_factor),
        grippier_(r_ * std::sqrt(conditions.stiffness_factor)),
        ranges_(argument_ranges(network, conditions.box)) {
    find_reach();
  }

  // Nothing where the law is linear.
  std::optional<Finding> judge(const Link& link) const {
    if (link.law == Law::spring) {
      return std::nullopt;
    }
    const LawFacts& law = facts_of(link.law);
    const double g = give(link.a) + give(link.b);
    const LawNumbers numbers = most(link);
    const Slopes slopes = steepest(link.law, least(link), numbers, farthest(link));
    const double damping = numbers[law.slot(Role::damping)];
    switch (law.family) {
      case Family::spring:
        return spring(
            stiffer_ * slopes.stiffness * g,
            law.contains_spring ? 0.0 : (r_ * damping + stiffer_ * slopes.stiff_damping) * g);
      case Family::contact:
        return contact(stiffer_ * slopes.stiffness * g, r_ * damping * g);
      case Family::bow:
        return bow(grippier_ * damping * g);
      case Family::pluck:
        return pluck(link, stiffer_ * numbers[law.slot(Role::stiffness)] * g);
    }
    return std::nullopt;
  }

 private:
  // The arguments' largest values, and their smallest; not below 0.
  LawNumbers most(const Link& link) const { return ends(link, &Range::highest); }
  LawNumbers least(const Link& link) const { return ends(link, &Range::lowest); }
  LawNumbers ends(const Link& link, double Range::*end) const {
    LawNumbers values{};
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = std::max(0.0, range_at(ranges_, link.arguments[i]).*end);
    }
    return values;
  }

  double inverse_mass(std::uint32_t mass) const {
    const Mass& m = network_.masses[mass];
    return !moves(m) || m.mass == no_argument ? 0.0 : 1.0 / std::max(0.0, ranges_[m.mass].lowest);
  }

  // How far a node moves by a force of 1 at most; a live place like the lightest node it may be at.
  double give(std::uint32_t mass) const {
    double sum = 0.0;
    if (is_live_place(network_, mass)) {
      const Tap& tap = network_.taps[network_.masses[mass].tap];
      const auto [known, is_new] = lightest_.try_emplace(tap.first, 0.0);
      progress_.spend(is_new ? tap.length * tap.width : 1);
      for (std::uint32_t i = 0; is_new && i < tap.length * tap.width; ++i) {
        known->second = std::max(known->second, inverse_mass(tap.first + i));
      }
      return known->second;
    }
    each_share(network_, mass, [&](std::uint32_t node, double share) {
      sum += share * share * inverse_mass(node);
    });
    return sum;
  }

  // How far apart two ends may come as far as is known, and what else may set them in motion.
  void find_reach() {
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    const auto include = [&](double position) {
      low = std::min(low, position);
      high = std::max(high, position);
    };
    for (std::uint32_t i = 0; i < network_.masses.size(); ++i) {
      const Mass& mass = network_.masses[i];
      include(mass.position);
      if (moves(mass) && mass.mass != no_argument) {
        const double v = initial_velocity(network_, mass);
        energy_ += 0.5 * ranges_[mass.mass].highest * v * v;
      }
    }
    for (const ControlSetting& control : preset_.controls) {
      const double size = std::max(std::fabs(control.low), std::fabs(control.high));
      const Input* const input = input_of(control);
      if (input == nullptr) {
        continue;
      }
      const GestureRow& gesture = row_of(control.gesture);
      if (gesture.is_blow && input->is_force) {
        energy_ += 0.5 * size * size * inverse_mass(input->mass);
      } else if (input->is_force) {
        force_ += size;
      } else if (gesture.extent == Extent::travel) {
        include(control.travel);
        include(-control.travel);
      } else if (gesture.extent == Extent::range) {
        include(control.low);
        include(control.high);
      }
    }
    reach_ = high > low ? high - low : 0.0;
  }

  const Input* input_of(const ControlSetting& control) const {
    for (const Input& input : network_.inputs) {
      if (control.gesture != Gesture::parameter &&
          control.target == "in" + std::to_string(input.number)) {
        return &input;
      }
    }
    return nullptr;
  }

  // How far a link may be stretched: to where masses and hands stand, where the energy is all in
  // the spring, or twice to where the forces that last would hold it.
  double farthest(const Link& link) const {
    const LawFacts& law = facts_of(link.law);
    const double q = law.has(Role::bend) ? most(link)[law.slot(Role::bend)] : 0.0;
    if (q == 0.0 || law.exponent == 1) {
      return reach_;
    }
    const double n = law.exponent;
    const double k = most(link)[law.slot(Role::stiffness)];
    const double by_energy = std::pow((n + 1.0) * energy_ / q, 1.0 / (n + 1.0));
    const double by_k = k > 0.0 ? std::sqrt(2.0 * energy_ / k) : by_energy;
    const double by_force = 2.0 * std::pow(force_ / q, 1.0 / n);
    return std::max({reach_, std::min(by_energy, by_k), by_force});
  }

  static Finding contact(double k, double z) {
    const LinkScheme passive{Scheme::discrete_gradient, 1};
    if (k / soft_contact >= z / soft_damper) {
      return {passive, k / soft_contact,
              "could gain " + number(12.5 * k) + " % of speed at a touch (K/M up to " + number(k) +
                  ")"};
    }
    return {passive, z / soft_damper, "would damp too hard (Z/M up to " + number(z) + ")"};
  }

  static Finding bow(double z) {
    const bool is_hard = z > hard_bow;
    return {{is_hard ? Scheme::substeps : Scheme::discrete_gradient,
             is_hard ? static_cast<std::uint16_t>(least_substeps) : std::uint16_t{1}},
            z / soft_bow,
            "would grip a sample too late (Z/M up to " + number(z) + ")"};
  }

  Finding pluck(const Link& link, double k) const {
    const double scale = least(link)[facts_of(link.law).slot(Role::reach)];
    double speed = 0.0;
    for (const ControlSetting& control : preset_.controls) {
      const Input* const input = input_of(control);
      if (input != nullptr && !input->is_force && row_of(control.gesture).is_sweep &&
          (input->mass == link.a || input->mass == link.b)) {
        speed = std::max({speed, std::fabs(control.low) * r_, std::fabs(control.high) * r_});
      }
    }
    const double steps = std::max(std::ceil(std::sqrt(1.2 * k)),
                                  scale > 0.0 ? std::ceil(10.0 * speed / scale) : 0.0);
    const LinkScheme scheme{Scheme::substeps, static_cast<std::uint16_t>(std::clamp<double>(
                                                  steps, least_substeps, most_substeps))};
    const double samples = speed > 0.0 ? 2.0 * scale / speed : 2.0 * slow_samples;
    if (!is_physical_ || 0.9 * k / soft_snap >= slow_samples / samples) {
      return {scheme, 0.9 * k / soft_snap, "could snap wrongly (K/M up to " + number(k) + ")"};
    }
    return {scheme, slow_samples / samples, "may be passed in " + number(samples) + " samples"};
  }

  static Finding spring(double k, double z) {
    return {{Scheme::discrete_gradient, 1},
            std::max(k / soft_tangent, z),
            "could blow up where it is the stiffest (K/M up to " + number(k) + ")"};
  }

  const Network& network_;
  const Progress& progress_;
  const Preset& preset_;
  bool is_physical_;
  double r_;
  double stiffer_;                                    // what a stiffness is multiplied by at worst
  double grippier_;                                   // ...and a bow's Z
  std::vector<Range> ranges_;                         // [argument]
  mutable std::map<std::uint32_t, double> lightest_;  // node's 1/M, by a macro's first node
  double reach_ = 0.0;
  double energy_ = 0.0;
  double force_ = 0.0;
};

// All that is told in one sentence.
struct Told {
  Law law{};
  std::size_t count = 0;
  std::optional<Finding> worst;
  LinkScheme scheme;
};

std::string sentence(const Told& told) {
  const LawFacts& law = facts_of(told.law);
  const std::string who =
      std::to_string(told.count) + " " + std::string(told.count == 1 ? law.one : law.many);
  const bool is_bad = told.worst && told.worst->badness > 1.0;
  const std::string how = told.scheme.scheme == Scheme::plain ? " as published"
                          : told.scheme.scheme == Scheme::discrete_gradient
                              ? " made passive"
                              : " in " + std::to_string(told.scheme.substeps) + " steps a sample";
  if (told.scheme.scheme == Scheme::plain) {
    return who + how + ", which " + told.worst->trouble;
  }
  return who + how +
         (is_bad ? ": as published " + std::string(told.count == 1 ? "it " : "they ") +
                       told.worst->trouble
                 : ", as asked for");
}

}  // namespace

Schemes choose_schemes(const Network& network, const Preset& preset, const Conditions& conditions,
                       const Budget& budget, const std::vector<std::uint32_t>& forced,
                       const Progress& progress) {
  Schemes schemes;
  schemes.links.resize(network.links.size());
  const auto is_linear = [](const Link& link) { return link.law == Law::spring; };
  if (forced.empty() && std::all_of(network.links.begin(), network.links.end(), is_linear)) {
    return schemes;
  }
  const Judge judge(network, preset, conditions, budget.is_physical(), progress);
  std::vector<bool> is_forced(network.links.size(), false);
  for (const std::uint32_t link : forced) {
    if (link < is_forced.size()) {
      is_forced[link] = true;
    }
  }
  std::map<std::pair<Law, LinkScheme>, Told> tellings;
  for (std::size_t i = 0; i < network.links.size(); ++i) {
    const Link& link = network.links[i];
    progress.spend(4);
    const std::optional<Finding> finding = judge.judge(link);
    const bool is_bad = finding && finding->badness > 1.0;
    const bool is_wanted = budget.passive == Passivity::always ||
                           (budget.passive == Passivity::where_needed && is_bad);
    if (is_forced[i] || (finding && is_wanted)) {
      schemes.links[i] = finding ? finding->scheme : LinkScheme{Scheme::discrete_gradient, 1};
    } else if (!is_bad) {
      continue;
    }
    Told& told = tellings[{link.law, schemes.links[i]}];
    ++told.count;
    told.law = link.law;
    told.scheme = schemes.links[i];
    if (!told.worst || (finding && finding->badness > told.worst->badness)) {
      told.worst = finding;
    }
  }
  for (const auto& [key, told] : tellings) {
    schemes.notes.push_back(sentence(told));
  }
  return schemes;
}

Network without_passive(const Network& network, std::span<const LinkScheme> schemes) {
  const auto is_plain = [](const LinkScheme& link) { return link.scheme == Scheme::plain; };
  if (std::all_of(schemes.begin(), schemes.end(), is_plain)) {
    return network;
  }
  Network felt = expand_macros(network);
  std::vector<Link> links;
  for (std::size_t i = 0; i < felt.links.size(); ++i) {
    const LawFacts& law = facts_of(felt.links[i].law);
    // Quadratic and cubic springs count with what they are at rest, by their own K and Z.
    if (i >= schemes.size() || is_plain(schemes[i]) || (law.contains_spring && law.is_curved)) {
      links.push_back(std::move(felt.links[i]));
    }
  }
  felt.links = std::move(links);
  return felt;
}

}  // namespace ressort
