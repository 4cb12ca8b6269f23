#include "core/model/faust/faust_waveguides.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/laws/laws.h"
#include "core/model/faust/faust_words.h"

namespace ressort {
namespace {

constexpr double highest_rate_hz = 192000.0;  // that delays have room for
constexpr double lowest_hz = 15.0;
constexpr std::size_t most_springs = 32;

using Lines = std::vector<std::string>;

bool is_junction(const Network& network, std::uint32_t mass) {
  return network.masses[mass].kind == MassKind::junction;
}

bool holds_waveguide(const Network& network, const Link& link) {
  return is_junction(network, link.a) || is_junction(network, link.b);
}

const Macro& guide_of(const Network& network, std::uint32_t junction) {
  return network.waveguides[network.taps[network.masses[junction].tap].macro];
}

bool is_turned(const Network& network, ArgumentId argument) {
  return argument != no_argument && !is_constant(network.arguments[argument]);
}

Error refused(const std::string& why, SourceLocation at) {
  return {why, at.line, at.column};
}

// The masses that a link's end moves.
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

struct Start {
  double position = 0.0;
  bool is_still = true;
};

Start start_of(const Network& network, std::uint32_t end) {
  Start start{.position = network.masses[end].position};
  each_behind(network, end, [&](std::uint32_t mass) {
    start.position = network.masses[mass].position;
    start.is_still = start.is_still && initial_velocity(network, network.masses[mass]) == 0.0;
  });
  return start;
}

std::optional<Error> refusal_of(const Network& network, const Link& link) {
  const std::string who = "'" + std::string(link.name) + "' holds a waveguide and ";
  if (link.law != Law::spring) {
    return refused(who + "is not written in FAUST: of what holds one, only springs and dampers are",
                   link.location);
  }
  const Start a = start_of(network, link.a);
  const Start b = start_of(network, link.b);
  if (a.position != b.position || !a.is_still || !b.is_still) {
    return refused(who + "is stretched or moves at the start, which is not written in FAUST",
                   link.location);
  }
  for (const std::uint32_t end : {link.a, link.b}) {
    const Mass& mass = network.masses[end];
    const bool wanders =
        mass.kind == MassKind::point && (is_turned(network, network.taps[mass.tap].u) ||
                                         is_turned(network, network.taps[mass.tap].v));
    bool is_moved = false;
    each_behind(network, end, [&](std::uint32_t i) {
      const Mass& behind = network.masses[i];
      is_moved = is_moved || is_driven(network, behind.mass) ||
                 is_driven(network, behind.stiffness) || is_driven(network, behind.damping);
    });
    if (wanders || is_moved) {
      return refused(who +
                         "something that a parameter moves or an input drives, which is not "
                         "written in FAUST",
                     link.location);
    }
  }
  return {};
}

// 1 - sum of products, as a matrix is eliminated: symbols, "" for 0.
class Elimination {
 public:
  explicit Elimination(std::size_t count) : count_(count), a_(count * count) {}

  std::string& at(std::size_t i, std::size_t j) { return a_[i * count_ + j]; }

  // Lines that end with f1, f2, ..., as b1, b2, ... are.
  std::string lines() {
    for (std::size_t i = 0; i < count_; ++i) {
      b_.push_back("b" + std::to_string(i + 1));
    }
    for (std::size_t k = 0; k < count_; ++k) {
      for (std::size_t i = k + 1; i < count_; ++i) {
        eliminate(k, i);
      }
    }
    for (std::size_t k = count_; k-- > 0;) {
      std::string sum = b_[k];
      for (std::size_t j = k + 1; j < count_; ++j) {
        sum += at(k, j).empty() ? "" : " - " + at(k, j) + "*f" + std::to_string(j + 1);
      }
      text_ += "    f" + std::to_string(k + 1) + " = (" + sum + ")/" + at(k, k) + ";\n";
    }
    return text_;
  }

 private:
  void eliminate(std::size_t k, std::size_t i) {
    if (at(i, k).empty()) {
      return;
    }
    const std::string share = define("m" + std::to_string(i + 1) + "_" + std::to_string(k + 1),
                                     at(i, k) + "/" + at(k, k));
    for (std::size_t j = k + 1; j < count_; ++j) {
      if (!at(k, j).empty()) {
        const std::string old = at(i, j).empty() ? "0.0" : at(i, j);
        at(i, j) = define(
            "a" + std::to_string(i + 1) + "_" + std::to_string(j + 1) + "_" + std::to_string(k + 1),
            old + " - " + share + "*" + at(k, j));
      }
    }
    b_[i] = define("b" + std::to_string(i + 1) + "_" + std::to_string(k + 1),
                   b_[i] + " - " + share + "*" + b_[k]);
  }
  std::string define(const std::string& name, const std::string& what) {
    text_ += "    " + name + " = " + what + ";\n";
    return name;
  }

  std::size_t count_;
  Lines a_;
  Lines b_;
  std::string text_;
};

std::string numbered(const char* what, std::size_t i) {
  return what + std::to_string(i + 1);
}

std::string list(std::size_t count, const char* what, const std::string& after = "") {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) {
    text += (i == 0 ? "" : ", ") + numbered(what, i) + after;
  }
  return text;
}

// ": !, _, !" which takes one of several signals.
std::string taken(std::size_t which, std::size_t count) {
  std::string text = " : ";
  for (std::size_t i = 0; i < count; ++i) {
    text += std::string(i == 0 ? "" : ", ") + (i == which ? "_" : "!");
  }
  return text;
}

}  // namespace

bool is_driven(const Network& network, ArgumentId argument) {
  return argument != no_argument &&
         std::any_of(network.arguments[argument].begin(), network.arguments[argument].end(),
                     [&](const Step& step) {
                       return step.op == Op::parameter &&
                              network.parameters[step.index].audio_input > 0;
                     });
}

std::optional<Error> faust_refusal(const Network& network) {
  for (const Macro& guide : network.waveguides) {
    for (const ArgumentId argument :
         {guide.impedance, guide.frequency_hz, guide.t60_s, guide.brightness}) {
      if (is_driven(network, argument)) {
        return refused("the waveguide '" + guide.name +
                           "' follows an audio input, which is not written in FAUST",
                       guide.location);
      }
    }
  }
  for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
    const Mass& mass = network.masses[i];
    if (is_junction(network, i) && is_turned(network, network.taps[mass.tap].u)) {
      const Macro& guide = guide_of(network, i);
      return refused("a place on the waveguide '" + guide.name +
                         "' moves with a parameter, which is not written in FAUST",
                     guide.location);
    }
  }
  std::size_t springs = 0;
  for (const Link& link : network.links) {
    if (!holds_waveguide(network, link)) {
      continue;
    }
    if (auto refusal = refusal_of(network, link)) {
      return refusal;
    }
    if (++springs > most_springs) {
      return refused("more than " + std::to_string(most_springs) +
                         " springs hold waveguides, which is too much to write in FAUST",
                     link.location);
    }
  }
  return {};
}

FaustWaveguides::FaustWaveguides(const Network& network)
    : network_(network), is_held_(network.masses.size()), holds_(network.links.size()) {
  std::vector<std::vector<double>> held(network.waveguides.size());
  for (std::uint32_t i = 0; i < network.links.size(); ++i) {
    const Link& link = network.links[i];
    if (!holds_waveguide(network, link)) {
      continue;
    }
    springs_.push_back(i);
    holds_[i] = true;
    damps_ = damps_ || link.arguments[1] != no_argument;
    for (const std::uint32_t end : {link.a, link.b}) {
      is_held_[end] = true;
      each_behind(network, end, [&](std::uint32_t mass) {
        is_held_[mass] = is_held_[mass] || moves(network.masses[mass]);
      });
      if (is_junction(network, end)) {
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
      is_held_[i] = true;
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
    std::stable_sort(guide.passes.begin(), guide.passes.end(),
                     [&](const Pass& a, const Pass& b) { return rank(a) < rank(b); });
  }
}

double FaustWaveguides::coordinate(std::uint32_t mass) const {
  const ArgumentId u = network_.taps[network_.masses[mass].tap].u;
  return u == no_argument ? 0.0 : evaluate(network_.arguments[u], {});
}

std::vector<std::string> FaustWaveguides::later(const FaustTerms& terms,
                                                const std::string& prefix) const {
  Lines words;
  for (std::uint32_t i = 0; i < is_held_.size(); ++i) {
    if (is_junction(network_, i)) {
      words.push_back(prefix + "_" + terms.masses[i]);
    }
    if (is_held_[i] && (moves(network_.masses[i]) || is_junction(network_, i))) {
      words.push_back(prefix + "x_" + terms.masses[i]);
    }
  }
  for (const Guide& guide : guides_) {
    for (std::size_t k = 0; k <= guide.passes.size(); ++k) {
      words.push_back(prefix + "b_" + guide.name + "_" + std::to_string(k));
    }
  }
  return words;
}

std::vector<std::string> FaustWaveguides::numbers() const {
  Lines words;
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

std::string FaustWaveguides::feed(int inputs) const {
  std::string text;
  for (const Guide& guide : guides_) {
    text += (text.empty() ? "guide_" : ", guide_") + guide.name;
  }
  if (!text.empty() && inputs > 0) {
    text += ", par(i, " + std::to_string(inputs) + ", _)";
  }
  return text.empty() ? "" : text + " : ";
}

std::string FaustWaveguides::guides(const FaustTerms& terms) const {
  std::string text;
  for (const Guide& guide : guides_) {
    const std::string& name = guide.name;
    const std::size_t count = guide.passes.size();
    Lines places;
    for (std::size_t k = 0; k < count; ++k) {
      places.push_back("d" + std::to_string(k + 1));
    }
    places.insert(places.begin(), {"samples", "allpass", "pole", "gain"});
    text += "\nguide_" + name + " = guide(" + faust_number(static_cast<double>(count + 2)) + ", " +
            terms.value(guide.macro->frequency_hz) + ", " + terms.value(guide.macro->t60_s) + ", " +
            terms.value(guide.macro->brightness) + ") : places\nwith {\n" +
            "  places(samples, period, allpass, pole, gain) =\n    " + flow(places, ", ", 4) +
            "\n  with {\n";
    // Every place is at the nearest sample that is its own: from the first on, then from the last.
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

std::string FaustWaveguides::place(const FaustTerms& terms, std::uint32_t mass,
                                   const std::string& outside) const {
  const std::string& name = terms.masses[mass];
  const Guide& guide = *std::find_if(guides_.begin(), guides_.end(), [&](const Guide& any) {
    return any.macro == &guide_of(network_, mass);
  });
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
         " = o_" + name + " + u_" + name + ";  v_" + name + " = u_" + name + " + h_" + name + "*" +
         give + ";  x_" + name + " = o_" + name + " + v_" + name + ";  w_" + name + " = 0.5*(v_" +
         name + " + n_" + name + ") - " + right + (sign == " + " ? " - " : " + ") + left +
         ";  to_" + name + " = v_" + name + ";  tox_" + name + " = x_" + name + ";";
}

std::string FaustWaveguides::waves(const FaustTerms& terms) const {
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

// How far one end of a spring is moved by a force of 1 at another.
std::string FaustWaveguides::give(const FaustTerms& terms, std::uint32_t from,
                                  std::uint32_t at) const {
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

// A function from the distances that springs would have, and had two samples before that, to their
// forces. `z` is 0 in the first sample, in which no damper acts, then 1.
std::string FaustWaveguides::solution(std::span<const std::string> couplings) const {
  const std::size_t count = springs_.size();
  std::string text = "  held(z, " + list(count, "d") + ", " + list(count, "c") +
                     ") = " + list(count, "f") + "\n  with {\n";
  Elimination elimination(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::string n = std::to_string(i + 1);
    text += "    s" + n + " = 0.5*(k_" + n + " + z*z_" + n + ");  b" + n + " = s" + n + "*d" + n +
            " + (k_" + n + " - s" + n + ")*c" + n + ";\n";
    for (std::size_t j = 0; j < count; ++j) {
      const std::string& coupling = couplings[i * count + j];
      if (i == j || !coupling.empty()) {
        const std::string name = "a" + n + "_" + std::to_string(j + 1);
        text += "    " + name + " = " + (i == j ? "1.0" : "") +
                (coupling.empty() ? "" : (i == j ? " + s" : "s") + n + "*" + coupling) + ";\n";
        elimination.at(i, j) = name;
      }
    }
  }
  return text + elimination.lines() + "  };\n";
}

std::string FaustWaveguides::springs(const FaustTerms& terms) const {
  std::string text;
  const std::size_t count = springs_.size();
  const auto end = [&](std::size_t i, int side) {
    const Link& link = network_.links[springs_[i]];
    return side == 0 ? link.a : link.b;
  };
  // How far one spring's force of 1 shortens another, by the four pairs of their ends.
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::string> gives;
  const auto give_between = [&](std::uint32_t a, std::uint32_t b) -> const std::string& {
    const auto [entry, is_new] = gives.try_emplace(std::minmax(a, b));
    if (const std::string sum = is_new ? give(terms, a, b) : ""; !sum.empty()) {
      entry->second = "give" + std::to_string(gives.size());
      text += "  " + entry->second + " = " + sum + ";\n";
    }
    return entry->second;
  };
  Lines couplings;
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < count; ++j) {
      Lines sum;
      for (const int from : {0, 1}) {
        for (const int at : {0, 1}) {
          const std::string& by = give_between(end(i, from), end(j, at));
          if (!by.empty()) {
            sum.push_back((from == at ? "+ " : "- ") + by);
          }
        }
      }
      couplings.push_back(sum.empty() ? "" : "(" + faust_sum(sum) + ")");
    }
  }
  std::string known;
  for (std::size_t i = 0; i < count; ++i) {
    const Link& link = network_.links[springs_[i]];
    const std::string n = std::to_string(i + 1);
    const std::string& a = terms.masses[link.a];
    const std::string& b = terms.masses[link.b];
    text += "  k_" + n + " = " + terms.value(link.arguments[0]) + "*r*r;  z_" + n + " = " +
            terms.value(link.arguments[1]) + "*r;  s_" + n + " = y_" + a + " - y_" + b + ";  c_" +
            n + " = (o_" + a + " - o_" + b + ")';\n";
    known += ", s_" + n;
  }
  for (std::size_t i = 0; i < count; ++i) {
    known += ", c_" + std::to_string(i + 1);
  }
  text += count == 0 ? "" : solution(couplings);
  Lines pulls(network_.masses.size());
  std::vector<Lines> forces(network_.masses.size());
  for (std::size_t i = 0; i < count; ++i) {
    const std::string force = "f_" + terms.links[springs_[i]];
    const std::string one = taken(i, count) + ")";
    text += "  " + force + " = " +
            (damps_ ? "select2(1', (0.0" + known + " : held" + one + ", (1.0" + known + " : held" +
                          one + ");\n"
                    : "(0.0" + known + " : held" + one + ";\n");
    for (const int side : {0, 1}) {
      const std::string sign = side == 0 ? "- " : "+ ";
      if (network_.masses[end(i, side)].kind != MassKind::point) {
        forces[end(i, side)].push_back(sign + force);
        continue;
      }
      for (const FaustShare& share : terms.shares(end(i, side))) {
        forces[share.node].push_back(sign + share.factor + force);
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

}  // namespace ressort
