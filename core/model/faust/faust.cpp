// The loop of the network in FAUST. Every mass that moves feeds back one signal: the velocity that
// its links have left it with. So the forces need no loop of their own, and FAUST, whose time
// grows with the square of what is fed back, compiles this form fastest.
#include "core/model/faust/faust.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/model/faust/faust_header.h"
#include "core/model/faust/faust_joint.h"
#include "core/model/faust/faust_places.h"
#include "core/model/faust/faust_waveguides.h"
#include "core/model/faust/faust_words.h"
#include "core/model/topology.h"

namespace ressort::model {
namespace {

using Words = std::vector<std::string>;
using Share = FaustShare;

class Writer {
 public:
  Writer(const Network& written, Network expanded, const FaustOptions& options)
      : written_(written),
        network_(std::move(expanded)),
        options_(options),
        joint_(network_),
        waveguides_(network_, joint_) {
    name_parameters();
    name_masses();
    name_links();
    gather_inputs();
    gather_forces();
  }

  std::string text() {
    const std::string body = masses() + links() + waves();  // which tells the laws that are needed
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
           faust_laws(used_) + parameters() + waveguides_.guides(terms()) +
           "\n// n_: what to_ was at the tick before; x_, v_, F_: position, velocity and the force "
           "of\n// the links; f_: a link's force, which pulls its first end down.\nmodel" +
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
  // Terms of a force as terms of what it does to the mass's velocity.
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

  // One of M, K and Z of a body's mode: those of the continuous network, sampled.
  std::string of_mode(const Mass& mass, const std::string& which) {
    used_.insert("sampled");
    return "(sampled(" + value(mass.mass) + ", " + value(mass.stiffness) + ", " +
           value(mass.damping) + ") : " + which + ")";
  }

  // --- what acts on a mass -------------------------------------------------------------------

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
        for (const Share& share : shares(i)) {
          outside_[share.node].push_back("+ " + share.factor + "push(" + input + ")");
        }
      }
    }
  }

  void gather_forces() {
    forces_.resize(network_.masses.size());
    for (std::uint32_t i = 0; i < network_.links.size(); ++i) {
      if (joint_.holds(i)) {
        continue;
      }
      forces_[network_.links[i].a].push_back("- f_" + link_[i]);
      forces_[network_.links[i].b].push_back("+ f_" + link_[i]);
    }
    for (std::size_t i = 0; i < network_.masses.size(); ++i) {
      if (network_.masses[i].kind == MassKind::point && !forces_[i].empty()) {
        for (const Share& share : shares(i)) {
          forces_[share.node].push_back("+ " + share.factor + "F_" + mass_[i]);
        }
      }
    }
  }

  std::vector<Share> shares(std::size_t point) const {
    return faust_shares(network_, static_cast<std::uint32_t>(point), mass_[point]);
  }

  // The same of something that every node has, "x_" or "F_", as one sum.
  std::string interpolated(std::size_t point, const std::string& prefix) const {
    Words terms;
    for (const Share& share : shares(point)) {
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
        continue;  // of a waveguide, as another already is
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

  // Its own M, K or Z are another number at the next tick, when its force acts: so it feeds back
  // the force, not what becomes of it.
  bool drives_itself(const Mass& mass) const { return model::drives_itself(network_, mass); }

  // Terms of what acts on it besides its links, at once.
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
    if (joint_.is_held(static_cast<std::uint32_t>(i))) {
      return held_mass(i, faust_sum(terms));
    }
    return "v_" + name + " = " + faust_sum(terms) + ";  x_" + name + " = travel(" +
           faust_number(mass.position) + ", v_" + name + ");";
  }

  // One that what holds waveguides moves after all else has: so fast if that did not.
  std::string held_mass(std::size_t i, const std::string& speed) {
    const std::string& name = mass_[i];
    return inverse_mass(i) + "o_" + name + " = nx_" + name + " + first(" +
           faust_number(network_.masses[i].position) + ");  u_" + name + " = " + speed + ";  y_" +
           name + " = o_" + name + " + u_" + name + ";  v_" + name + " = u_" + name + " + h_" +
           name + "*g_" + name + ";  x_" + name + " = o_" + name + " + v_" + name + ";  tox_" +
           name + " = x_" + name + ";";
  }

  // How far a force of 1 moves what is held by springs that are solved.
  std::string inverse_mass(std::size_t i) {
    const Mass& mass = network_.masses[i];
    return "g_" + mass_[i] + " = 1.0/" +
           (mass.is_mode ? of_mode(mass, "_, !, !")
            : mass.kind == MassKind::junction
                ? "((" + value(mass.mass) + ")*r)"
                : faust_formula(network_.arguments[mass.mass], parameter_, Tightness::atom)) +
           ";  ";
  }

  // A point's sum with the weights of the sample before.
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

  // Where the other ends of such links are and were.
  std::string held_before(std::uint32_t i) const {
    const Mass& mass = network_.masses[i];
    if (!joint_.is_held(i) || moves(i) || mass.kind == MassKind::junction) {
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
            .shares = [this](std::uint32_t point) { return shares(point); },
            .inverse_mass = [this](std::uint32_t mass) { return "g_" + mass_[mass]; }};
  }

  std::string waves() {
    if (!network_.waveguides.empty()) {
      used_.insert({"guide", "nearest", "late", "filtered"});
    }
    used_.merge(joint_.definitions());
    return joint_.text(terms()) + waveguides_.waves(terms());
  }

  // What a mass would have fed back at the tick before the first.
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
    if (joint_.is_held(static_cast<std::uint32_t>(i))) {
      const std::string& name = mass_[i];
      const std::string speed =
          "(nv_" + name + " + first(" + faust_number(initial_velocity(network_, mass)) + "*r))";
      return held_mass(i, speed + " + (" + faust_sum(force) + " - spring(" + value(mass.stiffness) +
                              ", " + value(mass.damping) + ", o_" + name + ", " + speed + "))*g_" +
                              name) +
             "  tov_" + name + " = v_" + name + ";";
    }
    const std::string swing = "swing(" + value(mass.mass) + ", " + value(mass.stiffness) + ", " +
                              value(mass.damping) + ", " + faust_number(mass.position) + ", " +
                              faust_number(initial_velocity(network_, mass)) + "*r, " +
                              faust_sum(force) + ")";
    return "x_" + mass_[i] + " = " + swing + " : _, !;  v_" + mass_[i] + " = " + swing + " : !, _;";
  }

  // An oscillator's own spring and damper.
  std::string held(const Mass& mass, const std::string& x, const std::string& v) {
    if (mass.is_mode) {
      return "(" + of_mode(mass, "!, _, !") + "*" + x + " + " + of_mode(mass, "!, !, _") + "*" + v +
             ")";
    }
    used_.insert("spring");
    return "spring(" + value(mass.stiffness) + ", " + value(mass.damping) + ", " + x + ", " + v +
           ")";
  }

  // What a mass feeds back.
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
      if (joint_.holds(i)) {
        continue;
      }
      const Link& link = network_.links[i];
      const LawFacts& law = facts_of(link.law);
      used_.emplace(law.name);
      text += "  f_" + link_[i] + " = " + std::string(law.name) + "(";
      for (std::size_t k = 0; k < law.count; ++k) {
        text += value(link.arguments[k]) + ", ";
      }
      const std::string& a = mass_[link.a];
      const std::string& b = mass_[link.b];
      text += "x_" + a + " - x_" + b + ", v_" + a + " - v_" + b + ");\n";
    }
    return text;
  }

  // What of a push at one mass or place is felt at another: terms of a sum.
  std::string felt(std::uint32_t pushed, std::uint32_t at, const std::string& input) const {
    if (pushed == at && network_.masses[at].kind != MassKind::point) {
      return " + " + input;
    }
    const auto behind = [&](std::uint32_t mass) {
      return network_.masses[mass].kind == MassKind::point ? shares(mass)
                                                           : std::vector<Share>{{mass, ""}};
    };
    std::string terms;
    for (const Share& from : behind(pushed)) {
      for (const Share& to : behind(at)) {
        terms += from.node == to.node ? " + " + from.factor + to.factor + input : "";
      }
    }
    return terms;
  }

  // All that pulls at a mass or a place: also what was solved for this tick.
  std::string force_at(std::uint32_t i) const {
    const auto at = [&](std::uint32_t mass) {
      const std::string plain = "F_" + mass_[mass];
      return joint_.is_held(mass) ? "(" + plain + " + h_" + mass_[mass] + ")" : plain;
    };
    if (network_.masses[i].kind != MassKind::point) {
      return at(i);
    }
    Words terms;
    for (const Share& share : shares(i)) {
      terms.push_back("+ " + share.factor + at(share.node));
    }
    return "(" + faust_sum(terms) + ")";
  }

  Words outputs() const {
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
  const Network network_;  // without macros
  const FaustOptions& options_;
  Words parameter_;                      // [parameter] its name in FAUST
  Words mass_;                           // [mass] the same, after x_, v_, F_, n_, to_
  Words link_;                           // [link] the same, after f_
  std::vector<std::uint32_t> macro_of_;  // [mass after the written ones]
  std::vector<Words> pushes_;            // [mass] channels of the force inputs on it
  std::vector<Words> outside_;           // [mass] terms that they give it, points spread out
  std::vector<Words> forces_;            // [mass] terms of its links
  std::set<std::string> used_;           // of faust_definitions()
  const FaustJoint joint_;
  const FaustWaveguides waveguides_;
};

}  // namespace

Result<std::string> faust_text(const Network& network, const FaustOptions& options) {
  if (network.outputs.empty()) {
    return Error{"the model has no output; FAUST takes no program without one", 1, 1};
  }
  Network expanded = expand_macros(network);
  if (auto refusal = faust_refusal(expanded)) {
    return *refusal;
  }
  return Writer(network, std::move(expanded), options).text();
}

std::size_t faust_elements(const Network& network) {
  const Network expanded = expand_macros(network);
  return expanded.masses.size() + expanded.links.size();
}

}  // namespace ressort::model
