// tests: a preset for any model, with controls of every kind.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "core/model/network.h"
#include "tests/support/random.h"
#include "tests/support/rooms.h"

namespace ressort::support {

// Every source drives every input with a gesture of its own, and all suitable sources control every
// parameter. `turn` rotates the pairs of source and gesture and all other keys of the preset.
class PresetWriter {
 public:
  PresetWriter(const Network& network, std::string model, std::size_t turn)
      : network_(network), turn_(turn) {
    static constexpr std::string_view budgets[] = {"", "passive=always", "cents=5 t60=20",
                                                   "silence=-50"};
    text_ = "model = \"" + std::move(model) + "\"\nvoices = " + std::to_string(1 + 2 * (turn % 3)) +
            "\ngain = " + (turn % 2 == 0 ? "0.5" : "20.0") +
            "\ndamper_s = " + (turn % 3 == 0 ? "0.0" : "0.05") +
            "\nnoise = " + (turn % 7 == 6 ? "true" : "false") + "\ntuning = \"" +
            (turn % 5 == 4 ? "fixed" : "keyboard") +
            "\"\ntranspose = " + std::to_string(static_cast<int>(turn % 25) - 12) +
            "\nbudget = \"" + std::string(budgets[turn % std::size(budgets)]) + "\"\n";
  }

  std::string write() {
    text_ += "[parameters]\n";
    for (const Parameter& parameter : network_.parameters) {
      text_ += quoted(parameter.name) + " = { value = " + show(parameter.value) +
               ", range = " + range(reach_of(parameter)) + " }\n";
    }
    for (std::size_t i = 0; i < network_.inputs.size(); ++i) {
      drive(network_.inputs[i], i);
    }
    for (std::size_t i = 0; i < network_.parameters.size(); ++i) {
      turn(network_.parameters[i], i);
    }
    return text_;
  }

 private:
  struct Reach {
    double low;
    double high;
  };

  static std::string quoted(const std::string& name) { return "\"" + name + "\""; }
  static std::string range(const Reach& reach) {
    return "[" + show(reach.low) + ", " + show(reach.high) + "]";
  }
  static Reach reach_of(const Parameter& parameter) {
    const double value = parameter.value;
    return value > 0.0   ? Reach{0.25 * value, 2.0 * value}
           : value < 0.0 ? Reach{2.0 * value, 0.25 * value}
                         : Reach{0.0, 0.001};
  }

  void add(const std::string& from, const std::string& to, std::string_view how, const Reach& reach,
           const std::string& more) {
    text_ += "[[control]]\nfrom = \"" + from + "\"\nto = " + quoted(to) + "\nhow = \"" +
             std::string(how) + "\"\nrange = " + range(reach) + "\n" + more;
  }

  // Returns the sources in turn. `nth` gives each controller, address and channel to one control.
  static std::string source(std::size_t which, std::size_t nth) {
    switch (which) {
      case 0:
        return "note";
      case 1:
        return "cc" + std::to_string((2 + nth) % 120);
      case 2:
        return "/control" + std::to_string(nth);
      case 3:
        return "pressure";
      default:
        return "audio" + std::to_string(1 + nth % 64);
    }
  }

  void drive(const Input& input, std::size_t nth) {
    static constexpr std::string_view pushes[] = {"impulse", "hold", "position"};
    static constexpr std::string_view moves[] = {"pluck", "bow", "position", "hold", "impulse"};
    const std::span<const std::string_view> gestures =
        input.is_force ? std::span<const std::string_view>(pushes) : moves;
    const double middle = input.is_force ? 0.0 : network_.masses[input.mass].position;
    for (std::size_t s = 0; s < 5; ++s) {
      const std::string_view how = gestures[(s + nth + turn_) % gestures.size()];
      const bool is_speed = how == "pluck" || how == "bow";
      add(source(s, nth), "in" + std::to_string(input.number), how,
          is_speed ? Reach{0.0001, 0.01} : Reach{middle - 0.05, middle + 0.1},
          how == "pluck" ? "travel = 0.02\ncurve = \"exponential\"\n" : "keys = [24, 108]\n");
    }
  }

  void turn(const Parameter& parameter, std::size_t nth) {
    const Reach reach = reach_of(parameter);
    const bool is_exponential = reach.low > 0.0 && (nth + turn_) % 2 == 0;
    for (std::size_t s = 0; s < 4; ++s) {
      add(source(s, 40 + nth), parameter.name, "parameter", reach,
          is_exponential ? "curve = \"exponential\"\n" : "");
    }
  }

  const Network& network_;
  const std::size_t turn_;
  std::string text_;
};

}  // namespace ressort::support
