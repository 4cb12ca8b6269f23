#include "core/model/faust/faust_joint.h"

#include <algorithm>
#include <map>

#include "core/groups.h"
#include "core/laws/laws.h"
#include "core/model/faust/faust_solution.h"
#include "core/model/faust/faust_words.h"

namespace ressort::model {
namespace {

constexpr std::size_t most_together = 32;
constexpr std::size_t most_curved_together = 6;  // links that are no springs

using Lines = std::vector<std::string>;

// ": !, _, !" which takes one of several signals.
std::string taken(std::size_t which, std::size_t count) {
  std::string text = " : ";
  for (std::size_t i = 0; i < count; ++i) {
    text += std::string(i == 0 ? "" : ", ") + (i == which ? "_" : "!");
  }
  return text;
}

// A law's number at the sample rate in use, at the pitch that is written.
std::string scaled(const std::string& value, Unit unit) {
  switch (unit) {
    case Unit::stiffness:
      return "(" + value + ")*r*r";
    case Unit::damping:
    case Unit::friction:
    case Unit::speed:
      return "(" + value + ")*r";
    default:
      return value;
  }
}

Lines arguments_of(const FaustTerms& terms, const Link& link) {
  const LawFacts& law = facts_of(link.law);
  Lines words;
  for (std::size_t i = 0; i < law.count; ++i) {
    words.push_back(link.arguments[i] == no_argument
                        ? "0.0"
                        : scaled(terms.value(link.arguments[i]), law.arguments[i].unit));
  }
  return words;
}

bool holds_waveguide(const Network& network, const Link& link) {
  return is_junction(network, link.a) || is_junction(network, link.b);
}

// How an end starts, at the reference rate.
struct Start {
  double position = 0.0;
  double speed = 0.0;
};

Start start_of(const Network& network, std::uint32_t end) {
  Start start{.position = network.masses[end].position};
  each_behind(network, end, [&](std::uint32_t mass) {
    start = {network.masses[mass].position, initial_velocity(network, network.masses[mass])};
  });
  return start;
}

Start start_of(const Network& network, const Link& link) {
  const Start a = start_of(network, link.a);
  const Start b = start_of(network, link.b);
  return {a.position - b.position, a.speed - b.speed};
}

// Whether its potential rises from where it starts, or from where it was a sample before that.
bool exerts_at_start(const Network& network, const Link& link) {
  const LawFacts& law = facts_of(link.law);
  if (law.family == Family::bow) {
    return false;
  }
  const Start start = start_of(network, link);
  if (!law.lets_go()) {
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

}  // namespace

bool is_junction(const Network& network, std::uint32_t mass) {
  return network.masses[mass].kind == MassKind::junction;
}

FaustJoint::FaustJoint(const Network& network)
    : network_(network), is_held_(network.masses.size()), holds_(network.links.size()) {
  const auto gives = [&](std::uint32_t mass) {
    return moves(network.masses[mass]) || is_junction(network, mass);
  };
  for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
    is_held_[i] = is_junction(network, i);
  }
  const auto masses = static_cast<std::uint32_t>(network.masses.size());
  Groups groups(network.masses.size() + network.links.size());
  std::vector<std::uint32_t> held;
  for (std::uint32_t i = 0; i < network.links.size(); ++i) {
    const Link& link = network.links[i];
    if (!holds_waveguide(network, link)) {
      continue;
    }
    held.push_back(i);
    holds_[i] = true;
    for (const std::uint32_t end : {link.a, link.b}) {
      is_held_[end] = true;
      each_behind(network, end, [&](std::uint32_t mass) {
        is_held_[mass] = true;  // fixed ends of macros too
        if (gives(mass)) {
          groups.join(masses + i, mass);
        }
      });
    }
  }
  std::map<std::uint32_t, std::size_t> numbers;
  for (const bool springs : {true, false}) {
    for (const std::uint32_t i : held) {
      if ((network.links[i].law == Law::spring) != springs) {
        continue;
      }
      const auto [number, is_new] = numbers.try_emplace(groups.find(masses + i), clusters_.size());
      if (is_new) {
        clusters_.emplace_back();
      }
      Cluster& cluster = clusters_[number->second];
      cluster.links.push_back(i);
      cluster.springs += springs ? 1 : 0;
    }
  }
  for (Cluster& cluster : clusters_) {
    cluster.sets_out = std::any_of(
        cluster.links.begin(), cluster.links.end(),
        [&](std::uint32_t link) { return exerts_at_start(network, network.links[link]); });
  }
}

std::optional<Error> FaustJoint::refusal() const {
  const auto refused = [&](std::uint32_t link, const std::string& why) {
    const Link& at = network_.links[link];
    return Error{"'" + std::string(at.name) + "' holds a waveguide " + why, at.location.line,
                 at.location.column};
  };
  for (const Cluster& cluster : clusters_) {
    for (const std::uint32_t link : cluster.links) {
      if (cluster.links.size() > 1 && exerts_at_start(network_, network_.links[link]) &&
          start_of(network_, network_.links[link]).speed != 0.0) {
        return refused(link,
                       "together with others and is moved at the start while it pulls, which is "
                       "not written in FAUST: let it start at rest, or where it is slack");
      }
    }
    if (cluster.links.size() > most_together) {
      return refused(cluster.links[most_together],
                     "together with more than " + std::to_string(most_together - 1) +
                         " others, which is too much to write in FAUST: leave some of them out");
    }
    if (cluster.links.size() - cluster.springs > most_curved_together) {
      return refused(cluster.links[cluster.springs + most_curved_together],
                     "together with more than " + std::to_string(most_curved_together - 1) +
                         " others that are no springs, which is too much to write in FAUST: let "
                         "some of them hold other places");
    }
  }
  return {};
}

std::set<std::string> FaustJoint::definitions() const {
  std::set<std::string> names;
  for (const Cluster& cluster : clusters_) {
    for (const std::uint32_t link : cluster.links) {
      const std::string name(facts_of(network_.links[link].law).name);
      if (network_.links[link].law != Law::spring) {
        names.insert({"steady_" + name, "alone_" + name});
      }
      if (cluster.sets_out || cluster.links.size() > cluster.springs + 1) {
        names.insert("gradient_" + name);
      }
      if (cluster.sets_out_alone()) {
        names.insert("first_alone");
      }
    }
  }
  return names;
}

// How far one end of a link is moved by a force of 1 at another.
std::string FaustJoint::give(const FaustTerms& terms, std::uint32_t from, std::uint32_t at) const {
  const auto behind = [&](std::uint32_t end) {
    return network_.masses[end].kind == MassKind::point ? terms.shares(end)
                                                        : std::vector<FaustShare>{{end, ""}};
  };
  Lines sum;
  for (const FaustShare& pushed : behind(from)) {
    for (const FaustShare& felt : behind(at)) {
      const bool gives = moves(network_.masses[felt.node]) || is_junction(network_, felt.node);
      if (pushed.node == felt.node && gives) {
        sum.push_back("+ " + pushed.factor + felt.factor + terms.inverse_mass(felt.node));
      }
    }
  }
  return sum.empty() ? "" : faust_sum(sum);
}

// What is known of a link before it is solved: s_ is how far it would go in two samples, c_ where
// it was before them. No damper acts in the very first sample, where 1' is 0.
std::string FaustJoint::known(const FaustTerms& terms, std::uint32_t index) const {
  const Link& link = network_.links[index];
  const LawFacts& law = facts_of(link.law);
  const std::string& name = terms.links[index];
  const std::string& a = terms.masses[link.a];
  const std::string& b = terms.masses[link.b];
  const std::string now = "o_" + a + " - o_" + b;
  const std::string free = "y_" + a + " - y_" + b;
  std::string text = "  e_" + name + " = " + speed_before(terms, link.a) + " - " +
                     speed_before(terms, link.b) + ";  c_" + name + " = " + now + " - e_" + name +
                     ";  s_" + name + " = " +
                     (law.family == Family::bow ? "e_" + name + " + u_" + a + " - u_" + b
                                                : free + " - c_" + name) +
                     ";\n";
  if (link.law != Law::spring) {
    text += "  rest_" + name + " = " + flow(arguments_of(terms, link), ", ", 6) + ", " + now +
            ", e_" + name + ", " + free + " - c_" + name + " : steady_" + std::string(law.name) +
            " : *(1'), *(1');\n";
  }
  return text;
}

// How fast an end was in the sample before.
std::string FaustJoint::speed_before(const FaustTerms& terms, std::uint32_t end) const {
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

std::string FaustJoint::text(const FaustTerms& terms) const {
  std::string text;
  // How far one end is moved by a force at another.
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::string> gives;
  std::size_t count = 0;
  const auto give_between = [&](std::uint32_t a, std::uint32_t b) -> const std::string& {
    const auto [entry, is_new] = gives.try_emplace(std::minmax(a, b));
    if (const std::string sum = is_new ? give(terms, a, b) : ""; !sum.empty()) {
      entry->second = "give" + std::to_string(++count);
      text += "  " + entry->second + " = " + sum + ";\n";
    }
    return entry->second;
  };
  std::vector<Lines> forces(network_.masses.size());
  const auto end = [&](std::uint32_t link, int side) {
    return side == 0 ? network_.links[link].a : network_.links[link].b;
  };
  for (const Cluster& cluster : clusters_) {
    Lines couplings;  // by the four pairs of two links' ends
    for (const std::uint32_t one : cluster.links) {
      for (const std::uint32_t other : cluster.links) {
        Lines sum;
        for (const int from : {0, 1}) {
          for (const int at : {0, 1}) {
            const std::string& by = give_between(end(one, from), end(other, at));
            if (!by.empty()) {
              sum.push_back((from == at ? "+ " : "- ") + by);
            }
          }
        }
        couplings.push_back(sum.empty() ? "" : "(" + faust_sum(sum) + ")");
      }
    }
    std::vector<FaustLink> links;
    for (const std::uint32_t link : cluster.links) {
      text += known(terms, link);
      links.push_back({.law = network_.links[link].law,
                       .name = terms.links[link],
                       .arguments = arguments_of(terms, network_.links[link]),
                       .sets_out = exerts_at_start(network_, network_.links[link])});
    }
    text += faust_solution({.links = links, .springs = cluster.springs, .couplings = couplings});
    for (std::size_t i = 0; i < cluster.links.size(); ++i) {
      const std::uint32_t link = cluster.links[i];
      const std::string force = "f_" + terms.links[link];
      text += "  " + force + " = joint_" + terms.links[cluster.links[0]] +
              taken(i, cluster.links.size()) + ";\n";
      for (const int side : {0, 1}) {
        const std::string sign = side == 0 ? "- " : "+ ";
        if (network_.masses[end(link, side)].kind != MassKind::point) {
          forces[end(link, side)].push_back(sign + force);
          continue;
        }
        for (const FaustShare& share : terms.shares(end(link, side))) {
          forces[share.node].push_back(sign + share.factor + force);
        }
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

}  // namespace ressort::model
