// Writes a network as a FAUST program. Every moving mass feeds back one signal, its velocity after
// the forces of its links, so the forces need no loop of their own. The time that FAUST needs grows
// with the square of the number of signals that are fed back; this form has the fewest.
#include "core/model/faust/faust.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <set>
#include <vector>

#include "core/model/faust/faust_words.h"
#include "core/model/topology.h"
#include "core/waveguide_places.h"

namespace ressort::model {
namespace {

using Words = std::vector<std::string>;

// --- places on macros and bodies ---------------------------------------------------------------

// The weight of a node in the position of a point, as a factor: "0.3*" or "hat(2.0, row_p)*".
struct FaustShare {
  std::uint32_t node = 0;
  std::string factor;
};

// Returns true if a coordinate is constant.
bool faust_is_fixed(const Network& network, ArgumentId coordinate) {
  return coordinate == no_argument || is_constant(network.arguments[coordinate]);
}

// Returns the weights of the nodes along one side of a macro: those of linear interpolation at a
// constant coordinate, or hat functions of a variable one.
Words side(const Network& network, ArgumentId coordinate, std::uint32_t nodes,
           const std::string& place) {
  Words factors(nodes);
  static const Formula nowhere = {{Op::number, 0, 0.0}};
  const Formula& formula = coordinate == no_argument ? nowhere : network.arguments[coordinate];
  if (!is_constant(formula)) {
    for (std::uint32_t i = 0; i < nodes; ++i) {
      factors[i] = "hat(" + faust_number(i) + ", " + place + ")*";
    }
    return factors;
  }
  const double p = std::clamp(evaluate(formula, {}), 0.0, 1.0) * (nodes - 1);
  for (std::uint32_t i = 0; i < nodes; ++i) {
    const double weight = std::max(0.0, 1.0 - std::fabs(p - i));
    factors[i] = weight == 0.0 ? "0" : weight == 1.0 ? "" : faust_number(weight) + "*";
  }
  return factors;
}

// Returns the weights of a body's modes in the position of a place.
std::vector<FaustShare> shares_of_modes(const Network& network, const Tap& tap,
                                        const std::string& name) {
  const Words places = side(network, tap.u, tap.places, "row_" + name);
  std::vector<FaustShare> all;
  for (std::uint32_t mode = 0; mode < tap.length; ++mode) {
    Words terms;
    double sum = 0.0;  // for a constant coordinate
    for (std::uint32_t place = 0; place < tap.places; ++place) {
      const double shape = network.shapes[tap.shape + place * tap.length + mode];
      if (places[place] == "0" || shape == 0.0) {
        continue;
      }
      terms.push_back("+ " + places[place] + faust_number(shape));
      if (faust_is_fixed(network, tap.u)) {
        sum += shape * (places[place].empty() ? 1.0 : std::stod(places[place]));
      }
    }
    if (!terms.empty() && (!faust_is_fixed(network, tap.u) || sum != 0.0)) {
      all.push_back(
          {tap.first + mode,
           (faust_is_fixed(network, tap.u) ? faust_number(sum) : "(" + faust_sum(terms) + ")") +
               "*"});
    }
  }
  return all;
}

// Returns the weights of all nodes in the position of a point, which is called `name`.
std::vector<FaustShare> faust_shares(const Network& network, std::uint32_t point,
                                     const std::string& name) {
  const Tap& tap = network.taps[network.masses[point].tap];
  if (tap.places > 0) {
    return shares_of_modes(network, tap, name);
  }
  const Words rows = side(network, tap.u, tap.length, "row_" + name);
  const Words columns = side(network, tap.v, tap.width, "column_" + name);
  std::vector<FaustShare> all;
  for (std::uint32_t i = 0; i < tap.length; ++i) {
    for (std::uint32_t j = 0; j < tap.width; ++j) {
      if (rows[i] != "0" && columns[j] != "0") {
        all.push_back({tap.first + i * tap.width + j, rows[i] + columns[j]});
      }
    }
  }
  return all;
}

// --- links that hold waveguides ----------------------------------------------------------------
//
// The engine makes such links passive: it solves their force implicitly, from a discrete gradient
// (core/laws/discrete_gradient.h). The exported program does the same, one link at a time.
//
// Names of a mass, place or point m that such a link holds: o_m is its position one sample ago;
// u_m and y_m are its velocity and position without the force of these links; h_m is that force.

// Returns true for a place on a waveguide.
bool is_junction(const Network& network, std::uint32_t mass) {
  return network.masses[mass].kind == MassKind::junction;
}

// Names and terms of the program.
struct FaustTerms {
  std::span<const std::string> masses;  // [mass] name, without the prefix x_, v_, n_ or to_
  std::span<const std::string> links;   // [link] name, without the prefix f_
  std::function<std::string(ArgumentId)> value;
  // coefficient at the sample rate of the program
  std::function<std::string(ArgumentId, Unit)> scaled;
  std::function<std::vector<FaustShare>(std::uint32_t point)> shares;
  std::function<std::string(std::uint32_t mass)> inverse_mass;
};

// Position and velocity of a link's end at the start, at the reference rate.
struct Start {
  double position = 0.0;
  double speed = 0.0;
};

// Calls `use(mass)` for the masses that a force at a link's end may move.
template <class Use>
void each_behind(const Network& network, std::uint32_t end, Use&& use) {
  const Mass& mass = network.masses[end];
  if (mass.kind != MassKind::point) {
    return use(end);
  }
  const Tap& tap = network.taps[mass.tap];
  for (std::uint32_t i = 0; i < tap.length * tap.width; ++i) {
    use(tap.first + i);
  }
}

Start start_of(const Network& network, std::uint32_t end) {
  Start start{.position = network.masses[end].position};
  each_behind(network, end, [&](std::uint32_t mass) {
    start = {network.masses[mass].position, initial_velocity(network, network.masses[mass])};
  });
  return start;
}

// Returns true if the link's potential is not flat where it starts, or one sample before.
bool exerts_at_start(const Network& network, const Link& link, const LawFacts& law) {
  if (law.is_friction) {
    return false;
  }
  const Start a = start_of(network, link.a);
  const Start b = start_of(network, link.b);
  const Start start{a.position - b.position, a.speed - b.speed};
  if (!law.can_detach()) {
    return start.position != 0.0 || start.speed != 0.0;
  }
  const std::vector<double> parameters = parameter_values(network);
  LawNumbers numbers{};
  for (std::size_t i = 0; i < law.count; ++i) {
    numbers[i] = argument_value(network, link.arguments[i], parameters);
  }
  return !(law.gap(numbers, start.position) >= 0.0 &&
           law.gap(numbers, start.position - start.speed) >= 0.0);
}

bool is_movable(const Network& network, std::uint32_t mass) {
  return moves(network.masses[mass]) || is_junction(network, mass);
}

// Reverses a step of expand_macros, which splits a curved spring at a waveguide into a linear link
// and the rest: the exported program solves them as one.
Network join_springs(Network expanded, std::span<const LawFacts> laws) {
  const auto is_rest = [&](const Link& link, const Link& linear) {
    const LawFacts& law = laws[static_cast<std::size_t>(link.law)];
    return link.a == linear.a && link.b == linear.b && link.name == linear.name &&
           law.contains_spring && law.is_curved &&
           link.arguments[law.slot(Role::stiffness)] == no_argument;
  };
  for (std::size_t i = expanded.links.size(); i-- > 0;) {
    const Link linear = expanded.links[i];
    if (!is_linear(linear.law) ||
        (!is_junction(expanded, linear.a) && !is_junction(expanded, linear.b))) {
      continue;
    }
    const auto rest = std::ranges::find_if(expanded.links,
                                           [&](const Link& link) { return is_rest(link, linear); });
    if (rest != expanded.links.end()) {
      const LawFacts& law = laws[static_cast<std::size_t>(rest->law)];
      rest->arguments[law.slot(Role::stiffness)] = linear.arguments[0];
      rest->arguments[law.slot(Role::damping)] = linear.arguments[1];
      expanded.links.erase(expanded.links.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }
  return expanded;
}

// The links of an expanded network that hold a waveguide.
class FaustPassive {
 public:
  FaustPassive(const Network& network, std::span<const LawFacts> laws)
      : network_(network),
        laws_(laws),
        is_held_(network.masses.size()),
        holds_(network.links.size()) {
    constexpr auto none = std::numeric_limits<std::uint32_t>::max();
    std::vector<std::uint32_t> holder(network.masses.size(), none);
    for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
      is_held_[i] = is_junction(network, i);
    }
    for (std::uint32_t i = 0; i < network.links.size(); ++i) {
      const Link& link = network.links[i];
      neighbour_.push_back(i);
      if (!is_junction(network, link.a) && !is_junction(network, link.b)) {
        continue;
      }
      holds_[i] = true;
      for (const std::uint32_t end : {link.a, link.b}) {
        is_held_[end] = true;
        each_behind(network, end, [&](std::uint32_t mass) {
          is_held_[mass] = true;  // the fixed ends of macros too
          if (!is_movable(network, mass)) {
            return;
          }
          if (holder[mass] != none && holder[mass] != i) {
            neighbour_[i] = holder[mass];
          }
          holder[mass] = i;
        });
      }
    }
  }

  // Returns true for an end of such a link, and for every place on a waveguide.
  bool is_held(std::uint32_t mass) const { return is_held_[mass]; }
  bool holds(std::uint32_t link) const { return holds_[link]; }

  // The reason why these links cannot be exported, with the line.
  std::optional<Error> refusal() const {
    for (std::uint32_t i = 0; i < neighbour_.size(); ++i) {
      if (neighbour_[i] != i) {
        const Link& link = network_.links[i];
        return Error{
            "'" + std::string(link.name) + "' and '" +
                std::string(network_.links[neighbour_[i]].name) +
                "' move the same mass, body or place next to a waveguide. The FAUST export "
                "solves only one such link at a time. Attach them to different places and "
                "bodies, or remove one of them.",
            link.location.line, link.location.column};
      }
    }
    return {};
  }

  // Names of the FAUST definitions that these links call.
  std::set<std::string> definitions() const {
    std::set<std::string> names;
    for (std::uint32_t i = 0; i < holds_.size(); ++i) {
      if (holds_[i]) {
        names.insert({"steady_" + std::string(facts(i).name), solver(i)});
      }
    }
    return names;
  }

  // The forces f_ of these links, and their sum h_ at every mass.
  std::string text(const FaustTerms& terms) const {
    std::string text;
    std::vector<std::vector<std::string>> forces(network_.masses.size());
    for (std::uint32_t i = 0; i < holds_.size(); ++i) {
      if (!holds_[i]) {
        continue;
      }
      text += force(terms, i);
      const Link& link = network_.links[i];
      for (const auto& [end, sign] : {std::pair(link.a, "- "), std::pair(link.b, "+ ")}) {
        if (network_.masses[end].kind != MassKind::point) {
          forces[end].push_back(sign + ("f_" + terms.links[i]));
          continue;
        }
        for (const FaustShare& share : terms.shares(end)) {
          forces[share.node].push_back(sign + share.factor + "f_" + terms.links[i]);
        }
      }
    }
    for (std::uint32_t i = 0; i < forces.size(); ++i) {
      if (is_held_[i] && network_.masses[i].kind != MassKind::point) {
        text += "  h_" + terms.masses[i] + " = " + faust_sum(forces[i]) + ";\n";
      }
    }
    return text;
  }

 private:
  const LawFacts& facts(std::uint32_t link) const {
    return laws_[static_cast<std::size_t>(network_.links[link].law)];
  }
  // Returns the name of the definition that solves the link: start_ handles the first sample of a
  // link that is under tension as it starts.
  std::string solver(std::uint32_t link) const {
    const LawFacts& law = facts(link);
    const bool is_tense = exerts_at_start(network_, network_.links[link], law);
    return (is_tense ? "start_" : "alone_") + std::string(law.name);
  }

  // The displacement of one end by a force of 1 at another: a sum over the masses behind both. ""
  // for 0.
  std::string compliance(const FaustTerms& terms, std::uint32_t from, std::uint32_t at) const {
    const auto behind = [&](std::uint32_t end) {
      return network_.masses[end].kind == MassKind::point ? terms.shares(end)
                                                          : std::vector<FaustShare>{{end, ""}};
    };
    std::vector<std::string> sum;
    for (const FaustShare& pushed : behind(from)) {
      for (const FaustShare& felt : behind(at)) {
        if (pushed.node == felt.node && is_movable(network_, felt.node)) {
          sum.push_back("+ " + pushed.factor + felt.factor + terms.inverse_mass(felt.node));
        }
      }
    }
    return sum.empty() ? "" : "(" + faust_sum(sum) + ")";
  }

  // The gamma of core/laws/discrete_gradient.h: how far the link's own force of 1 shortens it.
  std::string compliance(const FaustTerms& terms, const Link& link) const {
    std::vector<std::string> sum;
    const std::uint32_t ends[] = {link.a, link.b};
    for (const int from : {0, 1}) {
      for (const int at : {0, 1}) {
        if (const std::string by = compliance(terms, ends[from], ends[at]); !by.empty()) {
          sum.push_back((from == at ? "+ " : "- ") + by);
        }
      }
    }
    return faust_sum(sum);
  }

  // Returns the force of one link. The signal c_ is the distance of its ends two samples earlier,
  // e_ is the speed of that distance, s_ is its change without the link, and gamma_ is the
  // compliance. Dampers do not act in the first sample, where 1' is 0.
  std::string force(const FaustTerms& terms, std::uint32_t index) const {
    const Link& link = network_.links[index];
    const LawFacts& law = facts(index);
    const std::string& name = terms.links[index];
    const std::string& a = terms.masses[link.a];
    const std::string& b = terms.masses[link.b];
    const std::string now = "o_" + a + " - o_" + b;
    const std::string free = "y_" + a + " - y_" + b;
    std::vector<std::string> arguments;
    for (std::size_t i = 0; i < law.count; ++i) {
      arguments.push_back(terms.scaled(link.arguments[i], law.arguments[i].unit));
    }
    const std::string all = flow(arguments, ", ", 6);
    return "  e_" + name + " = " + speed_before(terms, link.a) + " - " +
           speed_before(terms, link.b) + ";  c_" + name + " = " + now + " - e_" + name + ";  s_" +
           name + " = " +
           (law.is_friction ? "e_" + name + " + u_" + a + " - u_" + b : free + " - c_" + name) +
           ";  gamma_" + name + " = " + compliance(terms, link) + ";\n  rest_" + name + " = " +
           all + ", " + now + ", e_" + name + ", " + free + " - c_" + name + " : steady_" +
           std::string(law.name) + " : *(1'), *(1');\n  f_" + name + " = " + all + ", rest_" +
           name + ", c_" + name + ", e_" + name + ", s_" + name + ", gamma_" + name + " : " +
           solver(index) + ";\n";
  }

  // The velocity of an end in the sample before.
  std::string speed_before(const FaustTerms& terms, std::uint32_t end) const {
    const std::string& name = terms.masses[end];
    switch (network_.masses[end].kind) {
      case MassKind::ground:
        return "0.0";
      case MassKind::position:
        return "v_" + name + "'";
      case MassKind::junction:
        return "n_" + name;
      default:
        break;
    }
    const Start start = start_of(network_, end);
    const std::string before = faust_number(start.position) +
                               (start.speed == 0.0 ? "" : " - " + faust_number(start.speed) + "*r");
    return "(o_" + name + " - was(" + before + ", o_" + name + "))";
  }

  const Network& network_;
  std::span<const LawFacts> laws_;
  std::vector<bool> is_held_;             // [mass]
  std::vector<bool> holds_;               // [link]
  std::vector<std::uint32_t> neighbour_;  // [link] earlier link at the same mass, or itself
};

// --- waveguides --------------------------------------------------------------------------------
//
// Names of a waveguide: b_ are its waves after the filters and after each place, d_ the positions
// of these places in the loop, in samples.

constexpr double highest_rate_hz = 192000.0;  // the longest delay lines are for this rate
constexpr double lowest_hz = 15.0;

const Macro& guide_of(const Network& network, std::uint32_t junction) {
  return network.waveguides[network.taps[network.masses[junction].tap].macro];
}

bool is_turned(const Network& network, ArgumentId argument) {
  return argument != no_argument && !is_constant(network.arguments[argument]);
}

Error refused(const std::string& why, SourceLocation at) {
  return {why, at.line, at.column};
}

bool is_driven(const Network& network, ArgumentId argument) {
  return argument != no_argument &&
         std::ranges::any_of(network.arguments[argument], [&](const Step& step) {
           return step.op == Op::parameter && network.parameters[step.index].audio_input > 0;
         });
}

bool drives_itself(const Network& network, const Mass& mass) {
  return !mass.is_mode && (is_driven(network, mass.mass) || is_driven(network, mass.stiffness) ||
                           is_driven(network, mass.damping));
}

std::optional<Error> faust_refusal(const Network& network, std::span<const LawFacts> laws) {
  for (const Macro& guide : network.waveguides) {
    for (const ArgumentId argument : {guide.frequency_hz, guide.t60_s, guide.brightness}) {
      if (is_driven(network, argument)) {
        return refused(
            "the waveguide '" + guide.name +
                "' is tuned or damped by an audio input. The FAUST export cannot write that: use a "
                "parameter instead.",
            guide.location);
      }
    }
  }
  for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
    const Mass& mass = network.masses[i];
    if (is_junction(network, i) && is_turned(network, network.taps[mass.tap].u)) {
      const Macro& guide = guide_of(network, i);
      return refused(
          "a place on the waveguide '" + guide.name +
              "' moves with a parameter. The FAUST export cannot write that: use a number.",
          guide.location);
    }
  }
  return FaustPassive(network, laws).refusal();
}

class FaustWaveguides {
 public:
  FaustWaveguides(const Network& network, const FaustPassive& passive,
                  std::span<const LawFacts> laws)
      : network_(network), passive_(passive) {
    std::vector<std::vector<double>> held(network.waveguides.size());
    for (const Link& link : network.links) {
      for (const std::uint32_t end : {link.a, link.b}) {
        if (is_junction(network, end) && laws[static_cast<std::size_t>(link.law)].contains_spring) {
          held[network.taps[network.masses[end].tap].macro].push_back(coordinate(end));
        }
      }
    }
    FaustNames names;
    for (std::uint32_t g = 0; g < network.waveguides.size(); ++g) {
      guides_.push_back({.name = names.add(network.waveguides[g].name),
                         .macro = &network.waveguides[g],
                         .filters = filters_between(held[g]),
                         .passes = {}});
    }
    for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
      if (is_junction(network, i)) {
        auto& passes = guides_[network.taps[network.masses[i].tap].macro].passes;
        passes.push_back({i, false});
        passes.push_back({i, true});
      }
    }
    std::erase_if(guides_, [](const Guide& guide) { return guide.passes.empty(); });
    for (Guide& guide : guides_) {
      const auto rank = [&](const Pass& pass) {
        return order_from_filters(guide.filters, coordinate(pass.mass), pass.runs_right);
      };
      std::ranges::stable_sort(guide.passes, {}, rank);
    }
  }

  // Names of the signals that are fed back, with the prefix "n" or "to": waves and positions, and
  // the velocities of driven masses.
  std::vector<std::string> later(const FaustTerms& terms, const std::string& prefix) const {
    std::vector<std::string> words;
    for (std::uint32_t i = 0; i < network_.masses.size(); ++i) {
      if (is_junction(network_, i)) {
        words.push_back(prefix + "_" + terms.masses[i]);
      }
      if (passive_.is_held(i) && (moves(network_.masses[i]) || is_junction(network_, i))) {
        words.push_back(prefix + "x_" + terms.masses[i]);
      }
      if (passive_.is_held(i) && moves(network_.masses[i]) &&
          drives_itself(network_, network_.masses[i])) {
        words.push_back(prefix + "v_" + terms.masses[i]);
      }
    }
    for (const Guide& guide : guides_) {
      for (std::size_t k = 0; k <= guide.passes.size(); ++k) {
        words.push_back(prefix + "b_" + guide.name + "_" + std::to_string(k));
      }
    }
    return words;
  }

  // Returns the names of the signals that carry each waveguide's filter coefficients and the
  // positions of its places into the model. As plain definitions FAUST would evaluate them again at
  // every use, which would take too long.
  std::vector<std::string> numbers() const {
    std::vector<std::string> words;
    for (const Guide& guide : guides_) {
      for (const char* what : {"samples_", "allpass_", "pole_", "gain_"}) {
        words.push_back(what + guide.name);
      }
      for (std::size_t k = 0; k < guide.passes.size(); ++k) {
        words.push_back("d_" + guide.name + "_" + std::to_string(k + 1));
      }
    }
    return words;
  }

  // The text that feeds these signals into the model, before its inputs.
  std::string feed(int inputs) const {
    std::string text;
    for (const Guide& guide : guides_) {
      text += (text.empty() ? "guide_" : ", guide_") + guide.name;
    }
    if (!text.empty() && inputs > 0) {
      text += ", par(i, " + std::to_string(inputs) + ", _)";
    }
    return text.empty() ? "" : text + " : ";
  }

  std::string guides(const FaustTerms& terms) const {
    std::string text;
    for (const Guide& guide : guides_) {
      const std::string& name = guide.name;
      const std::size_t count = guide.passes.size();
      std::vector<std::string> places;
      for (std::size_t k = 0; k < count; ++k) {
        places.push_back("d" + std::to_string(k + 1));
      }
      places.insert(places.begin(), {"samples", "allpass", "pole", "gain"});
      text += "\nguide_" + name + " = guide(" + faust_number(static_cast<double>(count + 2)) +
              ", " + terms.value(guide.macro->frequency_hz) + ", " +
              terms.value(guide.macro->t60_s) + ", " + terms.value(guide.macro->brightness) +
              ") : places\nwith {\n" + "  places(samples, period, allpass, pole, gain) =\n    " +
              flow(places, ", ", 4) + "\n  with {\n";
      // Each place takes the nearest sample that is free: a pass forwards, then one backwards.
      for (std::size_t k = 0; k < count; ++k) {
        const Pass& pass = guide.passes[k];
        text += "    n" + std::to_string(k + 1) + " = max(" +
                (k == 0 ? "1.0" : "n" + std::to_string(k) + " + 1.0") + ", nearest(" +
                faust_number(guide.filters.share) + ", " + faust_number(guide.filters.to_held) +
                ", " + faust_number(coordinate(pass.mass)) + ", " + (pass.runs_right ? "1" : "0") +
                ", period));\n";
      }
      for (std::size_t k = count; k-- > 0;) {
        const std::string n = std::to_string(k + 1);
        text += "    d" + n + " = min(n" + n + ", " +
                (k + 1 == count ? "samples" : "d" + std::to_string(k + 2) + " - 1.0") + ");\n";
      }
      text += "  };\n};\n";
    }
    return text;
  }

  // The line of a place; `outside` is the force from outside.
  std::string place(const FaustTerms& terms, std::uint32_t mass, const std::string& outside) const {
    const std::string& name = terms.masses[mass];
    const Guide& guide = *std::ranges::find(guides_, &guide_of(network_, mass), &Guide::macro);
    const std::string sign = guide.macro->kind == MacroKind::open_waveguide ? " + " : " - ";
    std::string left;
    std::string right;
    for (std::size_t k = 0; k < guide.passes.size(); ++k) {
      if (guide.passes[k].mass == mass) {
        (guide.passes[k].runs_right ? right : left) =
            "in_" + guide.name + "_" + std::to_string(k + 1);
      }
    }
    const std::string give = terms.inverse_mass(mass);
    return "u_" + name + " = 2.0*(" + right + sign + left + ") - n_" + name +
           (outside == "0.0" ? "" : " + (" + outside + ")*" + give) + ";  o_" + name + " = nx_" +
           name + " + first(" + faust_number(network_.masses[mass].position) + ");  y_" + name +
           " = o_" + name + " + u_" + name + ";  v_" + name + " = u_" + name + " + h_" + name +
           "*" + give + ";  x_" + name + " = o_" + name + " + v_" + name + ";  w_" + name +
           " = 0.5*(v_" + name + " + n_" + name + ") - " + right + (sign == " + " ? " - " : " + ") +
           left + ";  to_" + name + " = v_" + name + ";  tox_" + name + " = x_" + name + ";";
  }

  // The lines of the waves between the places.
  std::string waves(const FaustTerms& terms) const {
    std::string text;
    for (const Guide& guide : guides_) {
      const std::string& name = guide.name;
      const std::size_t count = guide.passes.size();
      const Formula& hz = network_.arguments[guide.macro->frequency_hz];
      const double lowest = is_constant(hz) ? std::max(evaluate(hz, {}), lowest_hz) : lowest_hz;
      const std::string most = faust_number(std::ceil(highest_rate_hz / lowest) + 2.0);
      for (std::size_t k = 0; k < count; ++k) {
        const std::string here = name + "_" + std::to_string(k + 1);
        const std::string before = name + "_" + std::to_string(k);
        const bool turns =
            !guide.passes[k].runs_right && guide.macro->kind != MacroKind::open_waveguide;
        text += "  in_" + here + " = late(" + most + ", d_" + here +
                (k == 0 ? "" : " - d_" + before) + " - 1.0, nb_" + before + ");  tob_" + here +
                " = in_" + here + (turns ? " - w_" : " + w_") + terms.masses[guide.passes[k].mass] +
                ";\n";
      }
      const std::string last = name + "_" + std::to_string(count);
      text += "  tob_" + name + "_0 = filtered(allpass_" + name + ", pole_" + name + ", gain_" +
              name + ", late(" + most + ", samples_" + name + " - d_" + last + ", tob_" + last +
              "));\n";
    }
    return text;
  }

 private:
  struct Pass {  // a wave passes a place
    std::uint32_t mass = 0;
    bool runs_right = false;
  };
  struct Guide {
    std::string name;  // after g_, b_, d_
    const Macro* macro = nullptr;
    FiltersAt filters;
    std::vector<Pass> passes;  // places in the order of the wave, from the filters on
  };

  double coordinate(std::uint32_t mass) const {
    const ArgumentId u = network_.taps[network_.masses[mass].tap].u;
    return u == no_argument ? 0.0 : evaluate(network_.arguments[u], {});
  }

  const Network& network_;
  const FaustPassive& passive_;
  std::vector<Guide> guides_;
};

// --- the program -------------------------------------------------------------------------------

std::string meaning_of_input(const Network& network, std::span<const std::string> masses,
                             int number) {
  std::string text;
  const auto add = [&](const std::string& what) { text += (text.empty() ? "" : ", ") + what; };
  for (const Input& input : network.inputs) {
    if (input.number == number) {
      add((input.is_force ? "force on " : "position of ") + masses[input.mass]);
    }
  }
  for (const Parameter& parameter : network.parameters) {
    if (parameter.audio_input == number) {
      add("parameter " + plain(parameter.name));
    }
  }
  return text.empty() ? "not used" : text;
}

std::string faust_header(const Network& network, std::span<const std::string> masses,
                         const std::string& name, int inputs) {
  const auto moving =
      std::ranges::count_if(network.masses, [](const Mass& mass) { return model::moves(mass); });
  std::string text = "// " + plain(name) +
                     ", a network of masses and springs: " + std::to_string(moving) +
                     " that move, " + std::to_string(network.links.size()) + " links.\n";
  for (int n = 1; n <= inputs; ++n) {
    text += "// input " + std::to_string(n) + ": " + meaning_of_input(network, masses, n) + "\n";
  }
  std::vector<std::string> heard(static_cast<std::size_t>(output_count(network)));
  for (const Output& output : network.outputs) {
    std::string& sum = heard[static_cast<std::size_t>(output.number - 1)];
    sum += (sum.empty() ? "" : ", ") + ((output.is_force          ? "force on "
                                         : output.derivative == 0 ? "position of "
                                         : output.derivative == 1 ? "velocity of "
                                                                  : "acceleration of ") +
                                        masses[output.mass]);
  }
  for (std::size_t n = 0; n < heard.size(); ++n) {
    text += "// output " + std::to_string(n + 1) + ": " +
            (heard[n].empty() ? std::string("silent") : heard[n]) + "\n";
  }
  return text + "declare name \"" + plain(name) + "\";\n\n";
}

class Writer {
 public:
  Writer(const Network& written, Network expanded, const FaustOptions& options)
      : written_(written),
        network_(std::move(expanded)),
        options_(options),
        passive_(network_, options.laws),
        waveguides_(network_, passive_, options.laws) {
    name_parameters();
    name_masses();
    name_links();
    gather_inputs();
    gather_forces();
  }

  std::string text() {
    const std::string body = masses() + links() + waves();  // also collects the definitions in use
    const int inputs = count_inputs();
    Words from;
    Words to;
    for (std::size_t i = 0; i < network_.masses.size(); ++i) {
      if (moves(i)) {
        from.push_back("n_" + mass_[i]);
        to.push_back("to_" + mass_[i]);
      }
    }
    for (auto [prefix, words] : {std::pair("n", &from), std::pair("to", &to)}) {
      const Words later = waveguides_.later(terms(), prefix);
      words->insert(words->end(), later.begin(), later.end());
    }
    const std::string moving = std::to_string(from.size());
    const Words numbers = waveguides_.numbers();
    from.insert(from.end(), numbers.begin(), numbers.end());
    for (int n = 1; n <= inputs; ++n) {
      from.push_back("in" + std::to_string(n));
    }
    const Words heard = outputs();
    to.insert(to.end(), heard.begin(), heard.end());
    const std::string loop = moving == "0"
                                 ? "process = model;\n"
                                 : "process = " + waveguides_.feed(inputs) + "model ~ par(i, " +
                                       moving + ", _) : par(i, " + moving + ", !), par(i, " +
                                       std::to_string(heard.size()) + ", _);\n";
    return faust_header(network_, mass_, options_.name, inputs) + faust_prelude(options_.rescale) +
           faust_laws(used_, options_.laws) + parameters() + waveguides_.guides(terms()) +
           "\n// n_: value of to_ one sample ago; x_, v_: position, velocity; F_: force of the "
           "links on a\n"
           "// mass; f_: force of a link, which pulls its first end down.\nmodel" +
           (from.empty() ? "" : "(" + flow(from, ", ", 6) + ")") + " =\n    " + flow(to, ", ", 4) +
           "\nwith {\n" + body + "};\n\n" + loop;
  }

 private:
  bool moves(std::size_t i) const { return model::moves(network_.masses[i]); }

  // --- names ---------------------------------------------------------------------------------

  void name_parameters() {
    FaustNames names;
    for (const Parameter& parameter : network_.parameters) {
      parameter_.push_back(parameter.audio_input > 0 ? "in" + std::to_string(parameter.audio_input)
                                                     : "p_" + names.add(parameter.name));
    }
  }

  void name_masses() {
    FaustNames names;
    std::vector<std::size_t> points(written_.macros.size());
    for (const Mass& mass : written_.masses) {
      if (mass.kind != MassKind::point) {
        mass_.push_back(names.add(mass.name));
        continue;
      }
      const std::uint32_t macro = network_.taps[mass.tap].macro;
      mass_.push_back(
          names.add(written_.macros[macro].name + "_at" + std::to_string(++points[macro])));
    }
    for (std::uint32_t m = 0; m < written_.macros.size(); ++m) {
      const Macro& macro = written_.macros[m];
      for (std::uint32_t k = 0; k < node_count(macro); ++k) {
        const std::string row = std::to_string(k / macro.width);
        const std::string column = macro.width > 1 ? "_" + std::to_string(k % macro.width) : "";
        mass_.push_back(names.add(macro.name + "_" + row + column));
        macro_of_.push_back(m);
      }
    }
  }

  void name_links() {
    FaustNames names;
    std::vector<std::size_t> counts(written_.macros.size());
    for (std::size_t i = 0; i < network_.links.size(); ++i) {
      const Link& link = network_.links[i];
      if (!link.name.empty()) {  // that of a macro has none
        link_.push_back(names.add(link.name));
        continue;
      }
      const std::uint32_t macro = macro_of_[link.a - written_.masses.size()];
      link_.push_back(
          names.add(written_.macros[macro].name + "_r" + std::to_string(counts[macro]++)));
    }
  }

  // --- numbers -------------------------------------------------------------------------------

  std::string value(ArgumentId argument) const {
    return argument == no_argument ? "0.0"
                                   : faust_formula(network_.arguments[argument], parameter_);
  }
  // The coefficient of an argument at the sample rate of the program.
  std::string scaled(ArgumentId argument, Unit unit) const {
    return argument == no_argument ? "0.0"
                                   : faust_scaled(faust_formula(network_.arguments[argument],
                                                                parameter_, Tightness::product),
                                                  unit);
  }
  // Converts the terms of a force to terms of the change of the mass's velocity.
  Words divided(Words force, const Mass& mass) {
    const Formula& formula = network_.arguments[mass.mass];
    if (mass.is_mode && !force.empty()) {
      return {"+ (" + faust_sum(std::move(force)) + ")/" + of_mode(mass, "_, !, !")};
    }
    if (force.empty() || (is_constant(formula) && evaluate(formula, {}) == 1.0)) {
      return force;
    }
    const std::string over = "/" + faust_formula(formula, parameter_, Tightness::atom);
    return force.size() == 1 ? Words{force[0] + over}
                             : Words{"+ (" + faust_sum(std::move(force)) + ")" + over};
  }

  // Returns M, K or Z of a body's mode at the sample rate, as `which` selects.
  std::string of_mode(const Mass& mass, const std::string& which) {
    used_.insert("sampled");
    return "(sampled(" + value(mass.mass) + ", " + value(mass.stiffness) + ", " +
           value(mass.damping) + ") : " + which + ")";
  }

  // --- forces -------------------------------------------------------------------

  void gather_inputs() {
    pushes_.resize(network_.masses.size());
    for (const Input& input : network_.inputs) {
      if (input.is_force) {
        pushes_[input.mass].push_back("in" + std::to_string(input.number));
      }
    }
    outside_.resize(network_.masses.size());
    for (std::size_t i = 0; i < network_.masses.size(); ++i) {
      for (const std::string& input : pushes_[i]) {
        if (network_.masses[i].kind != MassKind::point) {
          outside_[i].push_back("+ push(" + input + ")");
          continue;
        }
        for (const FaustShare& share : shares(i)) {
          outside_[share.node].push_back("+ " + share.factor + "push(" + input + ")");
        }
      }
    }
  }

  void gather_forces() {
    forces_.resize(network_.masses.size());
    for (std::uint32_t i = 0; i < network_.links.size(); ++i) {
      if (passive_.holds(i)) {
        continue;
      }
      forces_[network_.links[i].a].push_back("- f_" + link_[i]);
      forces_[network_.links[i].b].push_back("+ f_" + link_[i]);
    }
    for (std::size_t i = 0; i < network_.masses.size(); ++i) {
      if (network_.masses[i].kind == MassKind::point && !forces_[i].empty()) {
        for (const FaustShare& share : shares(i)) {
          forces_[share.node].push_back("+ " + share.factor + "F_" + mass_[i]);
        }
      }
    }
  }

  std::vector<FaustShare> shares(std::size_t point) const {
    return faust_shares(network_, static_cast<std::uint32_t>(point), mass_[point]);
  }

  // Returns the interpolated value of a variable, such as "x_" or "F_", at a point.
  std::string interpolated(std::size_t point, const std::string& prefix) const {
    Words terms;
    for (const FaustShare& share : shares(point)) {
      terms.push_back("+ " + share.factor + prefix + mass_[share.node]);
    }
    return faust_sum(terms);
  }

  // --- the lines -----------------------------------------------------------------------------

  std::string masses() {
    std::string text;
    for (std::uint32_t i = 0; i < network_.masses.size(); ++i) {
      const MassKind kind = network_.masses[i].kind;
      if (kind == MassKind::ground && i < written_.masses.size() &&
          written_.masses[i].kind == MassKind::point) {
        continue;  // another junction stands for this place
      }
      text += "  " + mass_line(i) + held_before(i);
      if (kind != MassKind::point || !forces_[i].empty()) {
        text += "  F_" + mass_[i] + " = " + faust_sum(forces_[i]) + ";";
      }
      text += (moves(i) ? leaving(i) : "") + "\n";
    }
    return text;
  }

  std::string mass_line(std::size_t i) {
    const Mass& mass = network_.masses[i];
    const std::string& name = mass_[i];
    switch (mass.kind) {
      case MassKind::mass:
      case MassKind::oscillator:
        return drives_itself(mass) ? driven_mass(i) : plain_mass(i);
      case MassKind::ground:
        return "x_" + name + " = " + faust_number(mass.position) + ";  v_" + name + " = 0.0;";
      case MassKind::position:
        return "x_" + name + " = " + channel_of(i) + ";  " + moved(i, mass.position);
      case MassKind::junction:
        return inverse_mass(i) +
               waveguides_.place(terms(), static_cast<std::uint32_t>(i), faust_sum(outside_[i]));
      case MassKind::point:
        break;
    }
    const Tap& tap = network_.taps[mass.tap];
    std::string line;
    if (!is_fixed(tap.u) || !is_fixed(tap.v)) {
      used_.insert({"along", "hat"});
    }
    if (!is_fixed(tap.u)) {
      line += "row_" + name + " = along(" + faust_number(tap.places > 0 ? tap.places : tap.length) +
              ", " + value(tap.u) + ");  ";
    }
    if (!is_fixed(tap.v)) {
      line +=
          "column_" + name + " = along(" + faust_number(tap.width) + ", " + value(tap.v) + ");  ";
    }
    return line + "x_" + name + " = " + interpolated(i, "x_") + ";  " +
           moved(i, network_.masses[tap.first].position);
  }

  bool is_fixed(ArgumentId coordinate) const { return faust_is_fixed(network_, coordinate); }

  std::string moved(std::size_t i, double start) const {
    const std::string x = "x_" + mass_[i];
    return "v_" + mass_[i] + " = " + x + " - was(" + faust_number(start) + ", " + x + ");";
  }

  std::string channel_of(std::size_t mass) const {
    for (const Input& input : network_.inputs) {
      if (!input.is_force && input.mass == mass) {
        return "in" + std::to_string(input.number);
      }
    }
    return faust_number(network_.masses[mass].position);
  }

  // Returns true if M, K or Z of the mass change with every sample. Such a mass feeds back its
  // force instead of its velocity, because the next values of M, K and Z apply to it.
  bool drives_itself(const Mass& mass) const { return model::drives_itself(network_, mass); }

  // Terms of the forces other than those of links: inputs and gravity.
  Words outside(std::size_t i) const {
    const Mass& mass = network_.masses[i];
    Words terms = outside_[i];
    if (mass.gravity != no_argument) {
      terms.push_back(
          "- push(" + value(mass.gravity) + ")" +
          (mass.gravity_per_rate ? "/" + faust_number(Network::reference_rate_hz) : ""));
    }
    return terms;
  }

  std::string plain_mass(std::size_t i) {
    const Mass& mass = network_.masses[i];
    const std::string& name = mass_[i];
    Words terms = divided(outside(i), mass);
    terms.insert(terms.begin(), "+ n_" + name);
    if (const std::string start = start_velocity(mass); start != "0.0") {
      terms.push_back("+ first(" + start + ")");
    }
    if (passive_.is_held(static_cast<std::uint32_t>(i))) {
      return held_mass(i, faust_sum(terms));
    }
    return "v_" + name + " = " + faust_sum(terms) + ";  x_" + name + " = travel(" +
           faust_number(mass.position) + ", v_" + name + ");";
  }

  // The line of a mass that a passive link moves; `speed` is its velocity without that link.
  std::string held_mass(std::size_t i, const std::string& speed) {
    const std::string& name = mass_[i];
    return inverse_mass(i) + "o_" + name + " = nx_" + name + " + first(" +
           faust_number(network_.masses[i].position) + ");  u_" + name + " = " + speed + ";  y_" +
           name + " = o_" + name + " + u_" + name + ";  v_" + name + " = u_" + name + " + h_" +
           name + "*g_" + name + ";  x_" + name + " = o_" + name + " + v_" + name + ";  tox_" +
           name + " = x_" + name + ";";
  }

  // The definition g_: the compliance of a mass that a passive link moves.
  std::string inverse_mass(std::size_t i) {
    const Mass& mass = network_.masses[i];
    return "g_" + mass_[i] + " = 1.0/" +
           (mass.is_mode ? of_mode(mass, "_, !, !")
            : mass.kind == MassKind::junction
                ? "((" + value(mass.mass) + ")*r)"
                : faust_formula(network_.arguments[mass.mass], parameter_, Tightness::atom)) +
           ";  ";
  }

  // The same sum with the weights of the sample before.
  std::string as_before(std::string sum, std::size_t point) const {
    for (const char* const side : {"row_", "column_"}) {
      const std::string place = side + mass_[point] + ")";
      const std::string last = side + mass_[point] + "')";
      for (std::size_t at = sum.find(place); at != sum.npos;
           at = sum.find(place, at + last.size())) {
        sum.replace(at, place.size(), last);
      }
    }
    return sum;
  }

  // The definitions y_, o_ and u_ of the ends of passive links that are not masses.
  std::string held_before(std::uint32_t i) const {
    const Mass& mass = network_.masses[i];
    if (!passive_.is_held(i) || moves(i) || mass.kind == MassKind::junction) {
      return "";
    }
    const std::string& name = mass_[i];
    if (mass.kind == MassKind::point) {
      return "  y_" + name + " = " + interpolated(i, "y_") + ";  o_" + name + " = " +
             as_before(interpolated(i, "o_"), i) + ";  u_" + name + " = y_" + name + " - o_" +
             name + ";";
    }
    return "  y_" + name + " = x_" + name + ";  o_" + name + " = x_" + name + " - v_" + name +
           ";  u_" + name + " = v_" + name + ";";
  }

  FaustTerms terms() const {
    return {.masses = mass_,
            .links = link_,
            .value = [this](ArgumentId argument) { return value(argument); },
            .scaled = [this](ArgumentId argument, Unit unit) { return scaled(argument, unit); },
            .shares = [this](std::uint32_t point) { return shares(point); },
            .inverse_mass = [this](std::uint32_t mass) { return "g_" + mass_[mass]; }};
  }

  std::string waves() {
    if (!network_.waveguides.empty()) {
      used_.insert({"guide", "nearest", "late", "filtered"});
    }
    used_.merge(passive_.definitions());
    return passive_.text(terms()) + waveguides_.waves(terms());
  }

  // The signal that a mass would have fed back before the first sample.
  std::string start_velocity(const Mass& mass) {
    Words terms;
    std::string speed = "0.0";
    if (const double v0 = initial_velocity(network_, mass); v0 != 0.0) {
      speed = faust_number(v0) + "*r";
      terms.push_back("+ " + speed);
    }
    if (mass.kind == MassKind::oscillator && (mass.position != 0.0 || speed != "0.0")) {
      const Words pull = divided({"- " + held(mass, faust_number(mass.position), speed)}, mass);
      terms.insert(terms.end(), pull.begin(), pull.end());
    }
    return faust_sum(terms);
  }

  std::string driven_mass(std::size_t i) {
    const Mass& mass = network_.masses[i];
    used_.insert({"swing", "spring"});
    Words force = outside(i);
    force.insert(force.begin(), "+ n_" + mass_[i]);
    if (passive_.is_held(static_cast<std::uint32_t>(i))) {
      const std::string& name = mass_[i];
      const std::string speed =
          "(nv_" + name + " + first(" + faust_number(initial_velocity(network_, mass)) + "*r))";
      return held_mass(i, speed + " + (" + faust_sum(force) + " - spring(" +
                              scaled(mass.stiffness, Unit::stiffness) + ", " +
                              scaled(mass.damping, Unit::damping) + ", o_" + name + ", " + speed +
                              "))*g_" + name) +
             "  tov_" + name + " = v_" + name + ";";
    }
    const std::string swing =
        "swing(" + value(mass.mass) + ", " + scaled(mass.stiffness, Unit::stiffness) + ", " +
        scaled(mass.damping, Unit::damping) + ", " + faust_number(mass.position) + ", " +
        faust_number(initial_velocity(network_, mass)) + "*r, " + faust_sum(force) + ")";
    return "x_" + mass_[i] + " = " + swing + " : _, !;  v_" + mass_[i] + " = " + swing + " : !, _;";
  }

  // The force of an oscillator's own spring and damper.
  std::string held(const Mass& mass, const std::string& x, const std::string& v) {
    if (mass.is_mode) {
      return "(" + of_mode(mass, "!, _, !") + "*" + x + " + " + of_mode(mass, "!, !, _") + "*" + v +
             ")";
    }
    used_.insert("spring");
    return "spring(" + scaled(mass.stiffness, Unit::stiffness) + ", " +
           scaled(mass.damping, Unit::damping) + ", " + x + ", " + v + ")";
  }

  // The signal that a mass feeds back.
  std::string leaving(std::size_t i) {
    const Mass& mass = network_.masses[i];
    const std::string& name = mass_[i];
    const std::string to = "  to_" + name + " = ";
    if (drives_itself(mass)) {
      return to + "F_" + name + ";";
    }
    Words force = {"+ F_" + name};
    if (mass.kind == MassKind::oscillator) {
      force.push_back("- " + held(mass, "x_" + name, "v_" + name));
    }
    Words terms = divided(std::move(force), mass);
    terms.insert(terms.begin(), "+ v_" + name);
    return to + faust_sum(terms) + ";";
  }

  std::string links() {
    std::string text;
    for (std::uint32_t i = 0; i < network_.links.size(); ++i) {
      if (passive_.holds(i)) {
        continue;
      }
      const Link& link = network_.links[i];
      const LawFacts& law = options_.laws[static_cast<std::size_t>(link.law)];
      used_.emplace(law.name);
      text += "  f_" + link_[i] + " = " + std::string(law.name) + "(";
      for (std::size_t k = 0; k < law.count; ++k) {
        text += scaled(link.arguments[k], law.arguments[k].unit) + ", ";
      }
      const std::string& a = mass_[link.a];
      const std::string& b = mass_[link.b];
      text += "x_" + a + " - x_" + b + ", v_" + a + " - v_" + b + ");\n";
    }
    return text;
  }

  // The share of an input force at one mass or place that acts at another: terms of a sum.
  std::string felt(std::uint32_t pushed, std::uint32_t at, const std::string& input) const {
    if (pushed == at && network_.masses[at].kind != MassKind::point) {
      return " + " + input;
    }
    const auto behind = [&](std::uint32_t mass) {
      return network_.masses[mass].kind == MassKind::point ? shares(mass)
                                                           : std::vector<FaustShare>{{mass, ""}};
    };
    std::string terms;
    for (const FaustShare& from : behind(pushed)) {
      for (const FaustShare& to : behind(at)) {
        terms += from.node == to.node ? " + " + from.factor + to.factor + input : "";
      }
    }
    return terms;
  }

  // The force of all links on a mass or a place, including that of passive links.
  std::string force_at(std::uint32_t i) const {
    const auto at = [&](std::uint32_t mass) {
      const std::string plain = "F_" + mass_[mass];
      return passive_.is_held(mass) ? "(" + plain + " + h_" + mass_[mass] + ")" : plain;
    };
    if (network_.masses[i].kind != MassKind::point) {
      return at(i);
    }
    Words terms;
    for (const FaustShare& share : shares(i)) {
      terms.push_back("+ " + share.factor + at(share.node));
    }
    return "(" + faust_sum(terms) + ")";
  }

  Words outputs() {
    Words words(static_cast<std::size_t>(output_count(network_)));
    for (const Output& output : network_.outputs) {
      const std::string& name = mass_[output.mass];
      const MassKind kind = network_.masses[output.mass].kind;
      std::string word =
          kind == MassKind::junction ? "(x_" + name + " - 0.5*v_" + name + ")" : "x_" + name;
      if (output.is_force) {
        word = force_at(output.mass) + "/push(1.0)";
        for (std::uint32_t pushed = 0; pushed < pushes_.size(); ++pushed) {
          for (const std::string& input : pushes_[pushed]) {
            word += felt(pushed, output.mass, input);
          }
        }
      }
      if (output.derivative > 0) {
        used_.insert("changed");
        const double start = network_.masses[output.mass].position;
        word = start == 0.0 ? word : "(" + word + " - " + faust_number(start) + ")";
        for (int i = 0; i < output.derivative; ++i) {
          word = "changed(" + word + ")";
        }
      }
      if (output.level != no_argument) {
        word = "(" + word + ")*" +
               faust_formula(network_.arguments[output.level], parameter_, Tightness::atom);
      }
      std::string& sum = words[static_cast<std::size_t>(output.number - 1)];
      sum += (sum.empty() ? "" : " + ") + word;
    }
    for (std::string& word : words) {
      word = word.empty() ? "0.0" : word;
    }
    return words;
  }

  // --- the rest ------------------------------------------------------------------------------

  int count_inputs() const {
    int count = input_count(network_);
    for (const Parameter& parameter : network_.parameters) {
      count = std::max(count, parameter.audio_input);
    }
    return count;
  }

  std::string parameters() const {
    std::string text;
    for (std::size_t i = 0; i < network_.parameters.size(); ++i) {
      const Parameter& parameter = network_.parameters[i];
      if (parameter.audio_input == 0) {
        text += parameter_[i] + " = " + faust_slider(options_.sliders[i]) + ";\n";
      }
    }
    return text.empty() ? text : "\n" + text;
  }

  const Network& written_;
  const Network network_;  // expanded
  const FaustOptions& options_;
  Words parameter_;                      // [parameter] name in FAUST
  Words mass_;                           // [mass] name, without the prefix x_, v_, F_, n_ or to_
  Words link_;                           // [link] name, without the prefix f_
  std::vector<std::uint32_t> macro_of_;  // [mass after the written ones]
  std::vector<Words> pushes_;            // [mass] channels of its force inputs
  std::vector<Words> outside_;           // [mass] terms of these, with points distributed to nodes
  std::vector<Words> forces_;            // [mass] terms of its links
  std::set<std::string> used_;           // names of the definitions in use
  const FaustPassive passive_;
  const FaustWaveguides waveguides_;
};

}  // namespace

Result<std::string> faust_text(const Network& network, const FaustOptions& options) {
  if (network.outputs.empty()) {
    return Error{"the model has no output; a FAUST program needs at least one", 1, 1};
  }
  Network expanded = join_springs(expand_macros(network), options.laws);
  if (auto refusal = faust_refusal(expanded, options.laws)) {
    return *refusal;
  }
  assert(options.sliders.size() >= expanded.parameters.size());
  return Writer(network, std::move(expanded), options).text();
}

std::size_t faust_elements(const Network& network) {
  const Network expanded = expand_macros(network);
  return expanded.masses.size() + expanded.links.size();
}

}  // namespace ressort::model
