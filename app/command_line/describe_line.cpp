#include <string>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"
#include "app/commands/timbre/sweep.h"
#include "core/model/language/expression.h"

namespace ressort::command_line {
namespace {

const char* const describe_examples =
    "A sound file is described as it is, the mean of its channels. A preset is rendered, one "
    "note.\n"
    "A model without one is told from its modes, in closed form, if it is linear. Definitions are\n"
    "those of the Timbre Toolbox (2011), in Hz; windows are periodic, and nothing is padded. What "
    "a\n"
    "sound does not have is null.\n"
    "Examples:\n"
    "  ressort describe bell.wav\n"
    "  ressort describe PolyTriangle -o triangle.svg\n"
    "  ressort describe bell.wav --json --at 24000 --window hann | jq .centroid_hz\n"
    "  ressort describe SixStructures --sweep timbre=1:6:51 -o mixes.csv -o mixes.svg\n"
    "  ressort describe bell.wav --json --f0 220 | jq '.frames[].inharmonicity'\n";

// A whole number within a range, and nothing else.
CLI::Validator whole(double least, double most) {
  const std::string range = print_number(least) + " to " + print_number(most);
  return {[=](std::string& text) {
            double number = 0.0;
            return parse_number(text, number) &&
                           number == static_cast<double>(static_cast<long long>(number)) &&
                           number >= least && number <= most
                       ? std::string()
                       : "must be a whole number, " + range + ", found " + text;
          },
          range};
}

}  // namespace

void add_describe(CLI::App& app, DescribeOptions& options, int& code) {
  CLI::App* command = app.add_subcommand(
      "describe", "tells what a sound is like: bright or dark, hollow, noisy, long, in figures");
  command->footer(describe_examples);
  command->add_option("FILE", options.name, "a sound file, or a preset's or a model's name or file")
      ->required();
  command->add_flag("--json", options.as_json, "for machines, every frame");
  command
      ->add_option("-o,--output", options.outputs,
                   "an .svg of the spectrum and of how it goes on; of a sweep one of figures over "
                   "the\nparameter, and a .csv of all of them (else to stdout)")
      ->take_all()
      ->allow_extra_args(false);
  add_overwrite(*command, options.force);
  command->add_option("--frame", options.how.frame, "samples of a frame")
      ->check(whole(4.0, 65536.0))
      ->capture_default_str();
  command->add_option("--hop", options.how.hop, "samples from frame to frame")
      ->check(whole(1.0, 1048576.0))
      ->capture_default_str();
  add_choice<Window>(*command, "--window", options.how.window,
                     {{"hann", Window::hann},
                      {"hamming", Window::hamming},
                      {"blackman", Window::blackman},
                      {"none", Window::none}},
                     "of each frame");
  add_choice<SpectrumKind>(*command, "--spectrum", options.how.kind,
                           {{"magnitude", SpectrumKind::magnitude}, {"power", SpectrumKind::power}},
                           "what is described");
  command->add_option("--at", options.how.at, "one frame alone, its first sample, from 0")
      ->check(whole(0.0, 9e15));
  command
      ->add_option("--f0", options.how.f0_hz,
                   "the fundamental in Hz; without it, that of the loudest stretch, or of the\n"
                   "lowest mode")
      ->check(within(1.0, 384000.0));
  command
      ->add_option("--modes", options.modes,
                   "tell the T60 of so many modes of a sound, as 'body' finds them")
      ->check(whole(1.0, 400.0));
  command->add_option("-r,--rate", options.rate_hz, "the sample rate of a model or a preset, in Hz")
      ->check(within(8000.0, 768000.0))
      ->capture_default_str();
  command->add_option("--note", options.key, "the key that a preset plays")
      ->check(whole(0.0, 127.0))
      ->capture_default_str();
  command->add_option("-s,--seconds", options.seconds, "how long a preset is rendered")
      ->check(within(0.1, 3600.0))
      ->capture_default_str();
  add_settings(*command, options.settings);
  add_parsed(*command, "--sweep", options.swept, parse_swept,
             "NAME=LOW:HIGH[:STEPS][:log|:linear], a parameter that goes through a range; of "
             "several,\nall values with each other");
  command->add_option("--figures", options.figures, "those that the picture of a sweep shows")
      ->delimiter(',')
      ->allow_extra_args(false);
  add_parsed(*command, "--law", options.laws, parse_law,
             "FIGURE=FORMULA of what is swept, drawn beside what is found");
  add_motion(*command, options.third);
  command->callback([&options, &code] { code = describe_command(options); });
}

}  // namespace ressort::command_line
