#include "tests/bench/mi_lib.h"

#include <algorithm>
#include <vector>

#include "core/laws/laws.h"
#include "core/model/faust/faust_words.h"

namespace ressort::bench {
namespace {

using Words = std::vector<std::string>;

// Returns the library's name of a law; "" if it has none.
const char* word_of(Law law) {
  switch (law) {
    case Law::spring:
      return "springDamper";
    case Law::quadratic_spring:
      return "nlSpringDamper2";
    case Law::cubic_spring:
      return "nlSpringDamper3";
    case Law::clipped_spring:
      return "nlSpringDamperClipped";
    case Law::pluck:
      return "nlPluck";
    case Law::bow:
    case Law::smooth_bow:
    case Law::either_bow:
      return "nlBow";
    case Law::contact:
      return "collision";
    case Law::clipped_contact:
      return "nlCollisionClipped";
    default:
      return "";
  }
}

class MiLibWriter {
 public:
  explicit MiLibWriter(const Network& network) : network_(network), forces_(network.masses.size()) {
    for (const Parameter& parameter : network.parameters) {
      parameters_.push_back(parameter.audio_input > 0 ? channel(parameter.audio_input)
                                                      : "p_" + parameter.name);
    }
  }

  std::optional<std::string> text() {
    const bool is_plain =
        network_.macros.empty() &&
        std::ranges::all_of(
            network_.masses,
            [](const Mass& mass) { return mass.kind != MassKind::point && !mass.is_mode; }) &&
        std::ranges::all_of(network_.links,
                            [](const Link& link) { return *word_of(link.law) != 0; }) &&
        std::ranges::none_of(network_.outputs, &Output::is_force);
    if (!is_plain) {
      return std::nullopt;
    }
    int inputs = input_count(network_);
    for (const Parameter& parameter : network_.parameters) {
      inputs = std::max(inputs, parameter.audio_input);
    }
    Words channels;
    for (int n = 1; n <= inputs; ++n) {
      channels.push_back(channel(n));
    }
    const Words moved = masses();
    const Words positions = named("x", network_.masses.size());
    const Words pulled = links();
    const Words heard = outputs();
    const std::string through = "par(i, " + std::to_string(heard.size()) + ", _)";
    const std::string all = "par(i, " + std::to_string(moved.size()) + ", ";
    std::string text = "import(\"stdfaust.lib\");\n";
    for (std::size_t i = 0; i < network_.parameters.size(); ++i) {
      const Parameter& parameter = network_.parameters[i];
      if (parameter.audio_input == 0) {
        text += parameters_[i] + " = " +
                faust_slider({parameter.name, parameter.value, 0.0, 4.0 * parameter.value, {}}) +
                ";\n";
      }
    }
    Words routed = ends_;
    routed.insert(routed.end(), heard.begin(), heard.end());
    Words from = named("f", ends_.size());
    const Words passed = named("y", heard.size());
    from.insert(from.end(), passed.begin(), passed.end());
    Words sums;
    for (const Words& forces : forces_) {
      sums.push_back(faust_sum(forces));
    }
    sums.insert(sums.end(), passed.begin(), passed.end());
    text += "to_links(" + flow(positions, ", ", 2) + ") =\n  " + flow(routed, ", ", 2) + ";\n";
    text += "process" + (channels.empty() ? "" : "(" + flow(channels, ", ", 2) + ")") +
            " = ((\n  " + flow(moved, ", ", 2) + ") : to_links : (\n  " + flow(pulled, ", ", 2) +
            (pulled.empty() ? "" : ",\n  ") + through + ") : to_masses) ~ " + all + "_) : " + all +
            "!), " + through + "\nwith {\n  to_masses(" + flow(from, ", ", 4) + ") =\n    " +
            flow(sums, ", ", 4) + ";\n};\n";
    return text;
  }

 private:
  static std::string channel(int n) { return "in" + std::to_string(n); }
  static Words named(const std::string& letter, std::size_t count) {
    Words words;
    for (std::size_t i = 0; i < count; ++i) {
      words.push_back(letter + std::to_string(i));
    }
    return words;
  }

  std::string value(ArgumentId argument) const {
    return argument == no_argument ? "0.0"
                                   : faust_formula(network_.arguments[argument], parameters_);
  }

  // Returns the position one sample before the first.
  std::string before(const Mass& mass) const {
    return faust_number(mass.position - (moves(mass) ? initial_velocity(network_, mass) : 0.0));
  }

  // Each mass takes a force and returns a position.
  Words masses() {
    Words words;
    for (const Mass& mass : network_.masses) {
      const std::string at = faust_number(mass.position);
      switch (mass.kind) {
        case MassKind::mass:
          words.push_back("mi.mass(" + value(mass.mass) + ", " + value(mass.gravity) + ", " + at +
                          ", " + before(mass) + ")");
          break;
        case MassKind::oscillator:
          words.push_back("mi.oscil(" + value(mass.mass) + ", " + value(mass.stiffness) + ", " +
                          value(mass.damping) + ", " + value(mass.gravity) + ", " + at + ", " +
                          before(mass) + ")");
          break;
        case MassKind::position:
          words.push_back("(_, " + hand_of(words.size()) + " : mi.posInput(" + at + "))");
          break;
        default:
          words.push_back("mi.ground(" + at + ")");
      }
    }
    for (const Input& input : network_.inputs) {
      if (input.is_force) {
        forces_[input.mass].push_back("+ " + channel(input.number));
      }
    }
    return words;
  }

  std::string hand_of(std::size_t mass) const {
    const auto input = std::ranges::find_if(
        network_.inputs, [&](const Input& one) { return !one.is_force && one.mass == mass; });
    return input == network_.inputs.end() ? "0.0" : channel(input->number);
  }

  // Each link takes the positions of both ends and returns the forces on them.
  Words links() {
    Words words;
    for (const Link& link : network_.links) {
      Words arguments;
      for (std::size_t i = 0; i < facts_of(link.law).count; ++i) {
        arguments.push_back(value(link.arguments[i]));
      }
      if (link.law == Law::bow || link.law == Law::smooth_bow) {
        arguments.push_back(link.law == Law::bow ? "0" : "1");  // mi.lib's `type`
      }
      for (const std::uint32_t end : {link.a, link.b}) {
        const Mass& mass = network_.masses[end];
        arguments.push_back(before(mass));
        forces_[end].push_back("+ f" + std::to_string(ends_.size()));
        ends_.push_back("x" + std::to_string(end));
      }
      words.push_back(std::string("mi.") + word_of(link.law) + "(" + flow(arguments, ", ", 4) +
                      ")");
    }
    return words;
  }

  Words outputs() const {
    Words words(static_cast<std::size_t>(output_count(network_)), "0.0");
    for (const Output& output : network_.outputs) {
      std::string& word = words[static_cast<std::size_t>(output.number) - 1];
      word = (word == "0.0" ? "" : word + " + ") + "x" + std::to_string(output.mass) +
             (output.level == no_argument ? "" : "*(" + value(output.level) + ")");
    }
    return words;
  }

  const Network& network_;
  Words parameters_;           // their names in formulas
  std::vector<Words> forces_;  // [mass]
  Words ends_;                 // positions that are inputs of links, in their order
};

}  // namespace

std::optional<std::string> mi_lib_text(const Network& network) {
  return MiLibWriter(network).text();
}

}  // namespace ressort::bench
