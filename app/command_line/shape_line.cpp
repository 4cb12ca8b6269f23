#include <algorithm>
#include <limits>
#include <string>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"
#include "app/commands/commands.h"
#include "app/session/timbre/shape.h"
#include "core/model/language/expression.h"

namespace ressort::command_line {
namespace {

const char* const shape_examples =
    "Changes the parameters within their ranges. The pitch of presets stays. Figures are those of\n"
    "'describe', in the first 2048 samples of a strike (the preset's own at velocity 100, if it "
    "has one),\n"
    "of the mean of all outputs. T60 is that of the pitch; the attack is that of the whole sound. "
    "Prints\n"
    "the remaining deviations in just noticeable differences (JND), and what prevents an exact "
    "match.\n"
    "Examples:\n"
    "  ressort shape PolyTriangle --centroid 400 --t60 3 -o darker.toml\n"
    "  ressort shape my.mdl --f0 220 --inharmonicity 0.02 -o stiff.toml\n"
    "  ressort shape PolyTriangle --like bell.wav -o like_a_bell.toml\n";

const char* const help_of[target_figure_count] = {
    // [TargetFigure]
    "lowest audible mode in Hz, of models without keys",
    "T60 of the pitch in s: short or long",
    "spectral centroid in Hz: dark or bright",
    "spectral spread in Hz: narrow or wide",
    "inharmonicity: harmonic or bell-like",
    "energy ratio of odd to even partials: full or hollow",
    "frequency below which 95 % of the energy is, in Hz",
    "spectral skewness",
    "spectral kurtosis: flat or peaked; 3 for a normal curve",
    "slope of the regression line of the spectrum, in 1/Hz",
    "attack time in ms: sudden or slow",
};

}  // namespace

void add_shape(CLI::App& app, int& code) {
  CLI::App* command =
      app.add_subcommand("shape", "adjusts a linear model's parameters to reach a target timbre");
  command->footer(shape_examples);
  ShapeOptions& options = run_with<ShapeOptions>(*command, code, [command](const auto& chosen) {
    for (std::string word : command->remaining()) {
      if (word.starts_with("--")) {
        std::replace(word.begin() + 2, word.end(), '-', '_');
        throw CLI::ValidationError("shape", parse_target_figure(word.substr(2)).error().message);
      }
    }
    if (!command->remaining().empty()) {
      throw CLI::ValidationError(
          "shape", "expected one model, found '" + command->remaining().front() + "' as well");
    }
    return shape_command(chosen);
  });
  add_model(*command, options.name, "preset or model, by name or file")->required();
  add_output(*command, options.output, "preset to write, a .toml file");
  add_overwrite(*command, options.force);
  command->add_flag("--json", options.as_json, "print JSON");
  for (const TargetFigureRow& row : target_figure_rows()) {
    std::string name = "--" + short_name(row.figure);
    std::replace(name.begin(), name.end(), '_', '-');
    command
        ->add_option_function<std::string>(
            name,
            [&options, name, figure = row.figure](const std::string& text) {
              double value = 0.0;
              const double asked =
                  parse_number(text, value) ? value : std::numeric_limits<double>::quiet_NaN();
              if (const auto wrong = target_error(figure, asked); !wrong.empty()) {
                throw CLI::ValidationError(name, std::string(wrong) + ", found " + text);
              }
              options.targets.push_back({figure, value});
            },
            help_of[static_cast<std::size_t>(row.figure)])
        ->type_name("NUMBER");
  }
  command->add_option("--like", options.like, "sound file whose loudest frame gives all targets")
      ->type_name("FILE");
  command->add_option("--note", options.key, "key of a preset (default: 57, or the sound file's)")
      ->check(within(0.0, 127.0));
  command
      ->add_option("-r,--rate", options.rate_hz,
                   "sample rate (default: 44100, or the sound file's)")
      ->type_name("HZ")
      ->check(within(8000.0, 768000.0));
  add_motion(*command, options.third);
  command->allow_extras();
}

}  // namespace ressort::command_line
