
#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"
#include "app/commands/commands.h"
#include "app/commands/timbre/sweep.h"

namespace ressort::command_line {
namespace {

const char* const describe_examples =
    "Sound files are analysed as the mean of their channels. Of a preset, one rendered note is "
    "analysed.\n"
    "Linear models without a preset are analysed in closed form, from their modes. Figures are "
    "defined as\n"
    "in the Timbre Toolbox (Peeters et al., 2011), in Hz, with periodic windows and without "
    "padding. In\n"
    "JSON, figures that a sound does not have are null.\n"
    "Examples:\n"
    "  ressort describe bell.wav\n"
    "  ressort describe PolyTriangle -o triangle.svg\n"
    "  ressort describe bell.wav --json --at 24000 --window hann | jq .centroid_hz\n"
    "  ressort describe SixStructures --sweep timbre=1:6:51 -o mixes.csv -o mixes.svg\n"
    "  ressort describe bell.wav --json --f0 220 | jq '.frames[].inharmonicity'\n";

}  // namespace

void add_describe(CLI::App& app, int& code) {
  CLI::App* command =
      app.add_subcommand("describe", "measures a sound: brightness, hollowness, noise, length");
  command->footer(describe_examples);
  DescribeOptions& options = run_with<DescribeOptions>(*command, code, describe_command);
  command->add_option("FILE", options.name, "sound file, preset or model, by name or file")
      ->type_name("NAME")
      ->required();
  command->add_flag("--json", options.as_json, "print JSON with every frame");
  command
      ->add_option("-o,--output", options.outputs,
                   ".svg of the spectrum and its course; of a sweep also a .csv")
      ->type_name("FILE")
      ->take_all()
      ->allow_extra_args(false);
  add_overwrite(*command, options.force);
  command->add_option("--frame", options.how.frame, "frame length in samples")
      ->check(whole(4.0, 65536.0))
      ->capture_default_str();
  command->add_option("--hop", options.how.hop, "hop size in samples")
      ->check(whole(1.0, 1048576.0))
      ->capture_default_str();
  add_choice<Window>(*command, "--window", options.how.window,
                     {{"hann", Window::hann},
                      {"hamming", Window::hamming},
                      {"blackman", Window::blackman},
                      {"none", Window::none}},
                     "window");
  add_choice<SpectrumKind>(*command, "--spectrum", options.how.kind,
                           {{"magnitude", SpectrumKind::magnitude}, {"power", SpectrumKind::power}},
                           "spectrum");
  command->add_option("--at", options.how.at, "analyse one frame only, from this sample on")
      ->check(whole(0.0, 9e15));
  command
      ->add_option("--f0", options.how.f0_hz,
                   "fundamental (default: estimated, or the lowest mode)")
      ->type_name("HZ")
      ->check(within(1.0, 384000.0));
  command
      ->add_option("--modes", options.modes,
                   "print the T60 of the N strongest modes of a sound file")
      ->type_name("N")
      ->check(whole(1.0, 400.0));
  add_rate(*command, "-r,--rate", options.rate_hz, 8000.0, 768000.0);
  command->add_option("--note", options.key, "key that a preset plays")
      ->check(whole(0.0, 127.0))
      ->capture_default_str();
  command->add_option("-s,--seconds", options.seconds, "length of a preset's note in s")
      ->check(within(0.1, 3600.0))
      ->capture_default_str();
  add_settings(*command, options.settings);
  CLI::Option* const sweep = add_parsed(*command, "--sweep", options.swept, parse_swept,
                                        "parameter to sweep: NAME=LOW:HIGH[:STEPS][:log|:linear]");
  command->add_option("--figures", options.figures, "figures in the .svg of a sweep")
      ->needs(sweep)
      ->type_name("NAME,...")
      ->delimiter(',')
      ->allow_extra_args(false);
  add_parsed(*command, "--law", options.laws, parse_law,
             "formula to plot beside a figure: FIGURE=FORMULA")
      ->needs(sweep);
  add_motion(*command, options.third);
}

}  // namespace ressort::command_line
