#include <string>
#include <vector>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"
#include "core/model/language/expression.h"

namespace ressort::command_line {
namespace {

const char* const modes_examples =
    "Levels are in dB below the loudest mode from that input at that output; with --json they are\n"
    "amplitudes at the time of an impulse, levels[input][output]: a force of 1 for one sample at\n"
    "44100 Hz, or a position of 1 for one sample. What bows, plucks or touches is open.\n"
    "Examples:\n"
    "  ressort modes BowedString --modes 12\n"
    "  ressort modes 20x30mesh --modes 24 -o shapes.svg\n"
    "  ressort modes PolyTriangle --json | jq '.modes[0].frequency_hz'\n"
    "  ressort modes my.mdl --tune 220,440,660 -o tuned.mdl\n"
    "  ressort modes my.mdl --decay 100:6,3000:0.8 -o wood.mdl\n";

// "HZ:S", both numbers.
DecayPoint decay_point(const std::string& text) {
  const std::size_t colon = text.find(':');
  DecayPoint point;
  if (colon == std::string::npos || !parse_number(text.substr(0, colon), point.frequency_hz) ||
      !parse_number(text.substr(colon + 1), point.t60_s)) {
    throw CLI::ValidationError("--decay", "expected HZ:SECONDS, found '" + text + "'");
  }
  return point;
}

}  // namespace

void add_modes(CLI::App& app, ModesOptions& options, int& code) {
  CLI::App* command = app.add_subcommand(
      "modes", "tells what a model can sound: frequency, decay, level and shape of its modes");
  command->footer(modes_examples);
  command->add_option("MODEL", options.name, "a preset's or a model's name, or a file")->required();
  command
      ->add_option("--modes", options.count,
                   "how many of the lowest; without it all of a small model")
      ->check(CLI::Range(1, 10000));
  command->add_option("--rate", options.rate_hz, "the sample rate that they are played at, in Hz")
      ->check(within(8000.0, 768000.0))
      ->capture_default_str();
  command->add_flag(
      "--exact", options.is_continuous,
      "of the continuous network, which presets with a budget are true to, instead of\n"
      "the published scheme");
  command->add_flag("--json", options.as_json, "for machines");
  command->add_option("-o,--output", options.output,
                      "an .svg of their shapes; with --tune or --decay the tuned .mdl");
  command
      ->add_option(
          "--tune", options.frequencies_hz,
          "frequencies in Hz for the lowest modes: springs are changed, each by itself and\n"
          "all together as little as will do")
      ->delimiter(',');
  command
      ->add_option_function<std::vector<std::string>>(
          "--decay",
          [&options](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) {
              options.decay.push_back(decay_point(text));
            }
          },
          "T60 at one or more frequencies, HZ:SECONDS: dampers are put on all that moves, so that\n"
          "modes decay by a + b f^2, whatever their shape")
      ->delimiter(',');
  add_overwrite(*command, options.force);
  add_motion(*command, options.third);
  command->callback([&options, &code] { code = modes_command(options); });
}

}  // namespace ressort::command_line
