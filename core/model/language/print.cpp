#include "core/model/language/print.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>

#include "core/model/language/expression.h"
#include "core/model/language/keywords.h"
#include "core/model/language/mdl.h"
#include "core/model/topology.h"

namespace ressort::model {
namespace {

// Chooses the first keyword of the law that fits the arguments of the link.
const LawWord& word_of(const Link& link) {
  const auto& words = facts_of(link.law).words;
  return *std::ranges::find_if(words, [&](const LawWord& word) {
    bool holds_all = word.printed > 0;
    for (int i = 0; i < static_cast<int>(most_law_arguments); ++i) {
      const bool is_there = link.arguments[static_cast<std::size_t>(i)] != no_argument;
      holds_all = holds_all && (!is_there || (i >= word.first && i < word.first + word.printed));
    }
    return holds_all;
  });
}

const Keyword& keyword_of(const Macro& macro) {
  return *std::find_if(keywords().begin(), keywords().end(), [&](const Keyword& keyword) {
    return keyword.element == Element::macro && keyword.macro == macro.kind;
  });
}

class Printer {
 public:
  explicit Printer(const Network& network) : network_(network) { name_elements(); }

  std::string run() {
    print_parameters();
    print_masses();
    print_macros();
    print_links();
    print_inputs();
    print_outputs();
    enter("");
    return std::move(text_);
  }

 private:
  // Chooses names for elements without one. Links may share a name with other links only.
  void name_elements() {
    for (const Parameter& parameter : network_.parameters) {
      parameters_.push_back(parameter.name);
      used_.insert(parameter.name);
    }
    for (const Mass& mass : network_.masses) {
      used_.insert(mass.name.text());
    }
    for (const Macro& macro : network_.macros) {
      used_.insert(macro.name);
    }
    for (const BodyMode& mode : network_.modes) {
      used_.insert(mode.name.text());
    }
    for (const Link& link : network_.links) {
      used_.insert(link.name.text());
    }
    for (std::size_t i = 0; i < network_.masses.size(); ++i) {
      const Mass& mass = network_.masses[i];
      const bool is_unnamed = mass.name.empty() && mass.kind != MassKind::point;
      masses_.push_back(is_unnamed ? unused("m" + std::to_string(i)) : mass.name.text());
    }
  }

  std::string unused(std::string name) {
    while (!used_.insert(name).second) {
      name += '_';
    }
    return name;
  }

  void heading(const char* words) {
    enter("");
    text_ += (text_.empty() ? "# " : "\n# ") + std::string(words) + "\n";
  }

  void line(const std::string& label, std::string_view keyword, const std::string& rest) {
    text_ += "@" + label + " " + std::string(keyword) + rest + "\n";
  }

  // Opens and closes blocks, so that the next element is in the group.
  void enter(std::string_view group) {
    if (group == group_) {
      return;
    }
    if (!group_.empty()) {
      text_ += "~end " + group_ + "\n";
    }
    if (!group.empty()) {
      text_ += "~begin " + std::string(group) + "\n";
    }
    group_ = group;
  }

  std::string argument(ArgumentId id) const {
    if (id == no_argument) {
      return " 0";
    }
    const std::string text = print_expression(network_.arguments[id], parameters_);
    return text.find('+') == std::string::npos ? " " + text : " [" + text + "]";
  }

  std::string arguments(std::initializer_list<ArgumentId> ids) const {
    std::string text;
    for (const ArgumentId id : ids) {
      text += argument(id);
    }
    return text;
  }

  // Starts the element's line, after entering its group.
  std::string position(double z, std::uint32_t drawing) {
    const std::string number = print_number(z);
    if (drawing == 0) {
      enter("");
      return " " + number;
    }
    const Drawing& drawn = network_.drawings[drawing - 1];
    enter(drawn.group);
    if (!drawn.group.empty() && drawn.x == 0.0 && drawn.y == 0.0) {
      return " " + number;
    }
    return " [" + print_number(drawn.x) + " " + print_number(drawn.y) + " " + number + "]";
  }

  void print_parameters() {
    if (!network_.parameters.empty()) {
      heading("Parameters");
    }
    for (const Parameter& parameter : network_.parameters) {
      if (parameter.audio_input > 0) {
        line(parameter.name, "audioParam", " @in" + std::to_string(parameter.audio_input));
      } else {
        line(parameter.name, "param", " " + print_number(parameter.value));
      }
    }
  }

  void print_masses() {
    const auto stands_here = [](const Mass& mass) {
      return mass.kind != MassKind::position && mass.kind != MassKind::point;
    };
    if (std::ranges::any_of(network_.masses, stands_here)) {
      heading("Masses");
    }
    for (std::size_t i = 0; i < network_.masses.size(); ++i) {
      const Mass& mass = network_.masses[i];
      if (!stands_here(mass)) {
        continue;
      }
      const std::string start = position(mass.position, mass.drawing);
      if (mass.kind == MassKind::ground) {
        line(masses_[i], "ground", start);
        continue;
      }
      const bool is_oscillator = mass.kind == MassKind::oscillator;
      const bool has_gravity = mass.gravity != no_argument;
      line(masses_[i],
           is_oscillator                           ? "osc"
           : has_gravity && !mass.gravity_per_rate ? "massG"
                                                   : "mass",
           argument(mass.mass) +
               (is_oscillator ? arguments({mass.stiffness, mass.damping}) : std::string()) +
               (has_gravity ? argument(mass.gravity) : std::string()) + start + " " +
               print_number(mass.third));
    }
  }

  void print_macros() {
    if (!network_.macros.empty()) {
      heading("Macros");
    }
    for (const Macro& macro : network_.macros) {
      const std::string start = position(macro.position, macro.drawing);
      if (macro.kind == MacroKind::body) {
        print_body(macro);
        continue;
      }
      if (macro.kind == MacroKind::modal_string) {
        print_modal_string(macro);
        continue;
      }
      if (is_waveguide(macro.kind)) {
        line(macro.name, keyword_of(macro).word,
             arguments({macro.impedance, macro.frequency_hz, macro.t60_s, macro.brightness}) +
                 start);
        continue;
      }
      std::string rest = " " + std::to_string(macro.length);
      if (is_mesh(macro.kind)) {
        rest += " " + std::to_string(macro.width);
      }
      rest += arguments({macro.mass, macro.stiffness});
      if (macro.kind == MacroKind::stiff_string) {
        rest += argument(macro.second_stiffness);
      }
      rest += argument(macro.damping);
      if (macro.air_damping != no_argument) {
        rest += argument(macro.air_damping);
      }
      line(macro.name, keyword_of(macro).word, rest + start + " " + print_number(macro.third));
    }
  }

  void print_body(const Macro& body) {
    std::string rest = argument(body.mass);
    for (const std::string& place : body.places) {
      rest += " " + place;
    }
    line(body.name, keyword_of(body).word, rest);
    const auto index = static_cast<std::uint32_t>(&body - network_.macros.data());
    const auto modes = std::equal_range(network_.modes.begin(), network_.modes.end(),
                                        BodyMode{.macro = index}, by_body);
    for (auto mode = modes.first; mode != modes.second; ++mode) {
      rest = " @" + body.name + arguments({mode->frequency_hz, mode->t60_s});
      for (const double displacement : mode->shape) {
        rest += " " + print_number(displacement);
      }
      line(mode->name.empty() ? unused(body.name + "_" + std::to_string(mode - modes.first + 1))
                              : mode->name.text(),
           "mode", rest);
    }
  }

  void print_modal_string(const Macro& string) {
    const bool has_bridge = string.bridge_loss != no_argument;
    line(string.name, keyword_of(string).word,
         " " + std::to_string(string.length) +
             arguments({string.mass, string.frequency_hz, string.inharmonicity, string.losses[0],
                        string.losses[1], string.losses[2]}) +
             (has_bridge ? " " + std::to_string(string.width) +
                               arguments({string.spread_cents, string.bridge_loss})
                         : std::string()));
  }

  void print_links() {
    if (!network_.links.empty()) {
      heading("Links");
    }
    for (std::size_t i = 0; i < network_.links.size(); ++i) {
      const Link& link = network_.links[i];
      const std::string ends = " " + reference(link.a) + " " + reference(link.b);
      const LawWord& word = word_of(link);
      line(link.name.empty() ? unused("r" + std::to_string(i)) : link.name.text(), word.word,
           ends + link_arguments(link, word));
    }
  }

  // Prints all arguments that are set or required.
  std::string link_arguments(const Link& link, const LawWord& word) const {
    std::string text;
    const auto first = static_cast<std::size_t>(word.first);
    for (std::size_t i = first; i < most_law_arguments; ++i) {
      const bool is_needed = i < first + static_cast<std::size_t>(word.least);
      if (is_needed || link.arguments[i] != no_argument) {
        text += argument(link.arguments[i]);
      }
    }
    return text.append(word.tail);
  }

  void print_inputs() {
    if (!network_.inputs.empty()) {
      heading("Inputs");
    }
    for (const Input& input : network_.inputs) {
      if (input.is_force) {
        const std::string end = " " + reference(input.mass);
        line("in" + std::to_string(input.number), "frcInput", end);
        continue;
      }
      const Mass& mass = network_.masses[input.mass];
      const std::string start = position(mass.position, mass.drawing);
      line(masses_[input.mass], "posInput", start);
    }
  }

  void print_outputs() {
    if (!network_.outputs.empty()) {
      heading("Outputs");
    }
    for (const Output& output : network_.outputs) {
      const std::string end =
          " " + reference(output.mass) +
          (output.level == no_argument ? std::string() : argument(output.level));
      const char* const words[] = {"posOutput", "velOutput", "accOutput"};
      line("out" + std::to_string(output.number),
           output.is_force ? "frcOutput" : words[output.derivative], end);
    }
  }

  std::string reference(std::uint32_t index) {
    const Mass& mass = network_.masses[index];
    if (mass.kind != MassKind::point) {
      return "@" + masses_[index];
    }
    const Tap& tap = network_.taps[mass.tap];
    if (tap.length > 0) {
      return "@" + masses_[nearest_node(tap)];
    }
    if (const Macro& macro = network_.macros[tap.macro]; macro.kind == MacroKind::body) {
      return "[@" + macro.name + " " + place_on(macro, tap.u) + "]";
    }
    if (is_bridge(network_, tap)) {
      return "[@" + network_.macros[tap.macro].name + " " + std::string(bridge_name) + "]";
    }
    return "[@" + network_.macros[tap.macro].name + coordinate(tap.u) +
           (tap.v == no_argument ? "" : coordinate(tap.v)) + "]";
  }

  // Prints the name of the place if the coordinate is exactly there.
  std::string place_on(const Macro& body, ArgumentId u) const {
    const Formula& formula = network_.arguments[u];
    if (is_constant(formula)) {
      const double last = static_cast<double>(std::max<std::size_t>(body.places.size(), 2) - 1);
      for (std::size_t place = 0; place < body.places.size(); ++place) {
        if (evaluate(formula, {}) == static_cast<double>(place) / last) {
          return body.places[place];
        }
      }
    }
    return print_expression(formula, parameters_);
  }

  std::string coordinate(ArgumentId id) const {
    return " " + print_expression(network_.arguments[id], parameters_);
  }

  // Returns the node of an expanded macro at the place, or the nearest one, after a comment.
  std::uint32_t nearest_node(const Tap& tap) {
    const std::vector<double> parameters = parameter_values(network_);
    bool is_exact = true;
    const auto nearest = [&](ArgumentId id, std::uint32_t count) {
      const double u = std::clamp(argument_value(network_, id, parameters), 0.0, 1.0);
      const double place = u * (count - 1);
      const double node = std::round(place);
      is_exact &= std::fabs(place - node) < 1e-9 &&
                  (id == no_argument || is_constant(network_.arguments[id]));
      return static_cast<std::uint32_t>(node);
    };
    const std::uint32_t row = nearest(tap.u, tap.length);
    const std::uint32_t column = nearest(tap.v, tap.width);
    if (!is_exact) {
      text_ += "# at" + coordinate(tap.u) + (tap.v == no_argument ? "" : coordinate(tap.v)) +
               " of what was a macro; its nearest mass stands for that place\n";
    }
    return tap.first + row * tap.width + column;
  }

  const Network& network_;
  std::string text_;
  std::string group_;                     // the open block
  std::vector<std::string> parameters_;   // names
  std::vector<std::string> masses_;       // names
  std::unordered_set<std::string> used_;  // labels
};

// The states at the start, which do not depend on the notation of places.
std::vector<std::pair<double, double>> states(const Network& network) {
  std::vector<std::pair<double, double>> found;
  for (const Mass& mass : network.masses) {
    if (mass.kind != MassKind::point) {
      found.emplace_back(mass.position, mass.third);
    }
  }
  for (const Macro& macro : network.macros) {
    found.emplace_back(macro.position, macro.third);
  }
  return found;
}

}  // namespace

std::string print_network(const Network& network) {
  const Network plain = canonical(network);
  std::string text = Printer(plain).run();
  const Network read = parse_network(text).network;
  if (read.third == plain.third && states(read) == states(plain)) {
    return text;
  }
  const bool is_velocity = plain.third == ThirdArgument::velocity_per_second;
  return std::string("~motion ") + (is_velocity ? "velocity" : "delayed") + "\n\n" + text;
}

}  // namespace ressort::model
