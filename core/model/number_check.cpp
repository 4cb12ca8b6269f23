#include "core/model/number_check.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/language/expression.h"
#include "core/ranges.h"

namespace ressort::model {
namespace {

// Checks the arguments of all elements, for find_invalid_number().
class NumberCheck {
 public:
  NumberCheck(const Network& network, std::span<const double> parameters, double rate_ratio)
      : network_(network), parameters_(parameters), grown_(std::max(1.0, rate_ratio * rate_ratio)) {
    for (const Formula& formula : network.arguments) {
      const double value = evaluate(formula, parameters);
      const bool is_live = std::ranges::any_of(formula, [&](const Step& step) {
        return step.op == Op::parameter && network.parameters[step.index].audio_input > 0;
      });
      is_wrong_.push_back(!is_live && !std::isfinite(grown_ * value));
      is_nothing_.push_back(!is_live && !std::isfinite(1.0 / value));
    }
  }

  std::optional<Error> run() {
    for (const Mass& mass : network_.masses) {
      check(mass, {{"mass", mass.mass},
                   {"stiffness", mass.stiffness},
                   {"damping", mass.damping},
                   {"gravity", mass.gravity}});
      if (mass.kind == MassKind::point) {
        const Tap& tap = network_.taps[mass.tap];
        check(mass, {{"place", tap.u}, {"place", tap.v}});
      }
    }
    for (const Macro& macro : network_.macros) {
      check(macro, {{"mass", macro.mass},
                    {"stiffness", macro.stiffness},
                    {"stiffness", macro.second_stiffness},
                    {"damping", macro.damping},
                    {"damping", macro.air_damping},
                    {"impedance", macro.impedance},
                    {"frequency", macro.frequency_hz},
                    {"T60", macro.t60_s},
                    {"brightness", macro.brightness},
                    {"inharmonicity", macro.inharmonicity},
                    {"loss", macro.losses[0]},
                    {"loss", macro.losses[1]},
                    {"loss", macro.losses[2]},
                    {"detuning", macro.spread_cents},
                    {"loss", macro.bridge_loss}});
      if (macro.kind == MacroKind::modal_string) {
        check_string(macro);
      }
    }
    for (const BodyMode& mode : network_.modes) {
      check(mode, {{"frequency", mode.frequency_hz}, {"T60", mode.t60_s}});
      check_above_zero(mode);
      check_in_range(mode);
    }
    for (const Link& link : network_.links) {
      for (const ArgumentId argument : link.arguments) {
        check(link, {{"argument", argument}});
      }
    }
    for (const Output& output : network_.outputs) {
      check(Outlet{"out" + std::to_string(output.number), output.location},
            {{"level", output.level}});
    }
    return std::move(error_);
  }

 private:
  struct Outlet {
    std::string name;
    SourceLocation location;
  };
  struct Asked {
    std::string_view quantity;
    ArgumentId argument;
  };

  template <class Element>
  void check(const Element& element, std::initializer_list<Asked> all) {
    for (const Asked& asked : all) {
      if (error_ || asked.argument == no_argument) {
        continue;
      }
      const bool is_wrong = is_wrong_[asked.argument];
      const bool divides = asked.quantity == "mass" || asked.quantity == "impedance";
      if (is_wrong || (divides && is_nothing_[asked.argument])) {
        error_ = {message(asked, std::string(element.name),
                          is_wrong ? " is not finite" : " is not above 0"),
                  element.location.line, element.location.column};
      }
    }
  }

  // Checks that the frequency and T60 of a mode are above 0.
  void check_above_zero(const BodyMode& mode) {
    for (const Asked& asked : {Asked{"frequency", mode.frequency_hz}, Asked{"T60", mode.t60_s}}) {
      if (!error_ && !(argument_value(network_, asked.argument, parameters_) > 0.0)) {
        error_ = {message(asked, std::string(mode.name), " is not above 0"), mode.location.line,
                  mode.location.column};
      }
    }
  }

  // Checks the signs of a modal string's numbers, and that its highest stiffness is finite.
  void check_string(const Macro& string) {
    const auto check_sign = [&](const Asked& asked, bool may_be_zero) {
      const double value = argument_value(network_, asked.argument, parameters_);
      if (!error_ && !(value > 0.0 || (may_be_zero && value == 0.0))) {
        error_ = {message(asked, string.name, may_be_zero ? " is below 0" : " is not above 0"),
                  string.location.line, string.location.column};
      }
    };
    check_sign({"frequency", string.frequency_hz}, false);
    check_sign({"inharmonicity", string.inharmonicity}, true);
    for (const ArgumentId loss :
         {string.losses[0], string.losses[1], string.losses[2], string.bridge_loss}) {
      check_sign({"loss", loss}, true);
    }
    const double n = string.length;
    const double hz = argument_value(network_, string.frequency_hz, parameters_) * n * n;
    const double mass = argument_value(network_, string.mass, parameters_);
    if (!error_ && !std::isfinite(grown_ * mass * hz * hz)) {
      error_ = {message({"frequency", string.frequency_hz}, string.name, " is too high"),
                string.location.line, string.location.column};
    }
  }

  // Checks that the stiffness of a mode is finite.
  void check_in_range(const BodyMode& mode) {
    const double hz = argument_value(network_, mode.frequency_hz, parameters_);
    const double t60_s = argument_value(network_, mode.t60_s, parameters_);
    const double mass = argument_value(network_, network_.macros[mode.macro].mass, parameters_);
    const auto check_size = [&](const Asked& asked, double root, std::string_view what) {
      if (!error_ && !std::isfinite(grown_ * mass * root * root)) {
        error_ = {message(asked, std::string(mode.name), what), mode.location.line,
                  mode.location.column};
      }
    };
    check_size({"frequency", mode.frequency_hz}, hz, " is too high");
    check_size({"T60", mode.t60_s}, 1.0 / t60_s, " is too short");
  }

  // "the argument 1/P of 'r' is not finite when P = 0"
  std::string message(const Asked& asked, const std::string& name, std::string_view what) const {
    const Formula& formula = network_.arguments[asked.argument];
    const auto names = mapped(network_.parameters, &Parameter::name);
    std::string values;
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (std::ranges::any_of(formula, [&](const Step& step) {
            return step.op == Op::parameter && step.index == i;
          })) {
        values +=
            (values.empty() ? " when " : " and ") + names[i] + " = " + print_number(parameters_[i]);
      }
    }
    return "the " + std::string(asked.quantity) + " " + print_expression(formula, names) +
           (name.empty() ? "" : " of '" + name + "'") + std::string(what) + values;
  }

  const Network& network_;
  const std::span<const double> parameters_;
  const double grown_;            // factor of a stiffness at the sample rate
  std::vector<bool> is_wrong_;    // [argument]
  std::vector<bool> is_nothing_;  // [argument] has no finite inverse
  std::optional<Error> error_;
};

}  // namespace

std::optional<Error> find_invalid_number(const Network& network, std::span<const double> parameters,
                                         double rate_ratio) {
  return NumberCheck(network, parameters, rate_ratio).run();
}

}  // namespace ressort::model
