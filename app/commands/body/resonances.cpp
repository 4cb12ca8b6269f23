#include "app/commands/body/resonances.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>

#include "app/commands/body/recording.h"
#include "app/commands/output.h"
#include "app/exit_code.h"
#include "app/session/files.h"
#include "app/text.h"
#include "core/identification/shapes.h"
#include "core/model/language/expression.h"

namespace ressort::commands {
namespace {

// Returns the numbers of a line, or nothing if it has a word that is none.
std::optional<std::vector<double>> numbers_of_line(std::string_view line) {
  line = line.substr(0, line.find_first_of(";#"));
  std::vector<double> numbers;
  constexpr std::string_view blanks = " \t\r,";
  while (true) {
    line.remove_prefix(std::min(line.find_first_not_of(blanks), line.size()));
    if (line.empty()) {
      return numbers;
    }
    const std::size_t length = std::min(line.find_first_of(blanks), line.size());
    double number = 0.0;
    if (!parse_number(line.substr(0, length), number)) {
      return std::nullopt;
    }
    numbers.push_back(number);
    line.remove_prefix(length);
  }
}

}  // namespace

std::optional<std::vector<Resonance>> parse_resonances(std::string_view text) {
  std::vector<Resonance> resonances;
  double index = 0.0;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const auto numbers = numbers_of_line(text.substr(0, end));
    text.remove_prefix(std::min(text.size(), end + 1));
    if (!numbers) {
      return std::nullopt;
    }
    if (numbers->empty()) {
      continue;
    }
    const std::size_t at = numbers->size() == 4 ? 1 : 0;
    const bool is_next = at == 0 || resonances.empty() || (*numbers)[0] == index + 1.0;
    if (numbers->size() - at != 3 || !is_next) {
      return std::nullopt;
    }
    index = (*numbers)[0];
    const Resonance mode{(*numbers)[at], (*numbers)[at + 1], (*numbers)[at + 2]};
    if (!(mode.frequency_hz > 0.0) || !(mode.bandwidth_hz > 0.0) || mode.amplitude == 0.0) {
      return std::nullopt;
    }
    resonances.push_back(mode);
  }
  std::ranges::stable_sort(resonances, {}, &Resonance::frequency_hz);
  return resonances.empty() ? std::nullopt : std::optional(resonances);
}

int resonance_body(const std::vector<Resonance>& resonances, const BodyOptions& options,
                   double mass) {
  const std::string read[] = {options.input};
  if (auto spared = check_not_input(options.output, read); !spared) {
    return reject(spared.error().message);
  }
  identification::Identification found;
  for (const Resonance& mode : resonances) {
    // The amplitude falls by exp(-pi bandwidth t).
    const double t60_s = std::log(1000.0) / (std::numbers::pi * mode.bandwidth_hz);
    found.modes.push_back({.frequency_hz = {mode.frequency_hz},
                           .t60_s = {t60_s},
                           .amplitude = {{std::fabs(mode.amplitude)}},
                           .phase_rad = {{-0.5 * std::numbers::pi}}});  // a sine
  }
  found.sound.resize(1);
  const auto shapes = identification::body_shapes(found.modes, mass);
  const std::string label = label_of_file(options.output.empty() ? options.input : options.output);
  std::string text = "# " + counted(resonances.size(), "resonance", "resonances") + " of " +
                     options.input.substr(options.input.rfind('/') + 1) +
                     ". A force of 1 at hit, for one sample, makes its amplitudes at mic.\n@" +
                     label + " body " + print_number(mass) + " hit mic\n";
  for (std::size_t k = 0; k < shapes.size(); ++k) {
    text += "@" + label + "_" + std::to_string(k + 1) + " mode @" + label + " " +
            print_number(found.modes[k].frequency_hz.value) + " " +
            print_number(found.modes[k].t60_s.value) + " " + print_number(shapes[k].hit) + " " +
            print_number(shapes[k].heard[0]) + "\n";
  }
  text += "@in1 frcInput [@" + label + " hit]\n@out1 posOutput [@" + label + " mic]\n";
  if (options.output.empty()) {
    std::fputs(text.c_str(), stdout);
    return exit_code::done;
  }
  if (const int code = write_output(options.output, text, options.force)) {
    return code;
  }
  std::printf("%s: %s from %s to %s Hz\n", options.output.c_str(),
              counted(resonances.size(), "mode", "modes").c_str(),
              fixed(resonances.front().frequency_hz, 1).c_str(),
              fixed(resonances.back().frequency_hz, 1).c_str());
  return exit_code::done;
}

}  // namespace ressort::commands
