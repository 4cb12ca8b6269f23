#include <algorithm>
#include <limits>
#include <string>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"
#include "app/session/timbre/shape.h"
#include "core/model/language/expression.h"

namespace ressort::command_line {
namespace {

const char* const shape_examples =
    "Parameters move within their ranges; the pitch stays where keys have it. Figures are those "
    "of\n"
    "'describe', in the first 2048 samples of a blow, the preset's own at velocity 100 if it has "
    "one,\nof the mean of all outputs; T60 is that of the pitch, the attack that of the whole "
    "sound.\n"
    "How far each is off is told in just noticeable differences (JND), and where it cannot be\n"
    "reached, what holds it.\n"
    "Examples:\n"
    "  ressort shape PolyTriangle --centroid 400 --t60 3 -o darker.toml\n"
    "  ressort shape my.mdl --f0 220 --inharmonicity 0.02 -o stiff.toml\n"
    "  ressort shape PolyTriangle --like bell.wav -o like_a_bell.toml\n";

const char* help_of(AskedFigure figure) {
  switch (figure) {
    case AskedFigure::f0:
      return "the lowest mode that is heard, in Hz, where no key sets the pitch";
    case AskedFigure::t60:
      return "short or long: the T60 of the pitch in s";
    case AskedFigure::centroid:
      return "dark or bright: the centroid of the spectrum in Hz";
    case AskedFigure::spread:
      return "narrow or wide: the spread of the spectrum in Hz";
    case AskedFigure::inharmonicity:
      return "harmonic or bell-like: the inharmonicity";
    case AskedFigure::odd_to_even:
      return "full or hollow: the energy of odd partials over that of even ones";
    case AskedFigure::rolloff:
      return "below what frequency 95 % of the energy is, in Hz";
    case AskedFigure::skewness:
      return "how much the spectrum leans upwards";
    case AskedFigure::kurtosis:
      return "flat or peaked: the kurtosis of the spectrum, 3 of a bell curve";
    case AskedFigure::slope:
      return "of the line through the spectrum, in 1/Hz";
    case AskedFigure::attack:
      return "sudden or slow: the attack in ms, 10 to the log attack time";
  }
  return "";
}

}  // namespace

void add_shape(CLI::App& app, ShapeOptions& options, int& code) {
  CLI::App* command = app.add_subcommand(
      "shape", "turns a linear model to a timbre that is asked for: darker, hollower, longer");
  command->footer(shape_examples);
  command->add_option("MODEL", options.name, "a preset's or a model's name or file")->required();
  command->add_option("-o,--output", options.output, "the preset that comes of it, a .toml");
  add_overwrite(*command, options.force);
  command->add_flag("--json", options.as_json, "for machines");
  for (const AskedFigureRow& row : asked_figure_rows()) {
    std::string name = "--" + short_name(row.figure);
    std::replace(name.begin(), name.end(), '_', '-');
    command
        ->add_option_function<std::string>(
            name,
            [&options, name, figure = row.figure](const std::string& text) {
              double value = 0.0;
              const double asked =
                  parse_number(text, value) ? value : std::numeric_limits<double>::quiet_NaN();
              if (const auto wrong = wrong_with(figure, asked); !wrong.empty()) {
                throw CLI::ValidationError(name, std::string(wrong) + ", found " + text);
              }
              options.targets.push_back({figure, value});
            },
            help_of(row.figure))
        ->type_name("NUMBER");
  }
  command->add_option("--like", options.like,
                      "all of these as a sound file has them in its loudest frame");
  command->add_option("--note", options.key, "the key of a preset (57, or the sound file's)")
      ->check(within(0.0, 127.0));
  command
      ->add_option("-r,--rate", options.rate_hz,
                   "the sample rate in Hz (44100, or the sound file's)")
      ->check(within(8000.0, 768000.0));
  add_motion(*command, options.third);
  command->allow_extras();
  command->callback([command, &options, &code] {
    for (std::string word : command->remaining()) {
      if (word.starts_with("--")) {
        std::replace(word.begin() + 2, word.end(), '-', '_');
        throw CLI::ValidationError("shape", asked_figure(word.substr(2)).error().message);
      }
    }
    if (!command->remaining().empty()) {
      throw CLI::ValidationError("shape", "one model alone can be shaped, found '" +
                                              command->remaining().front() + "' as well");
    }
    code = shape_command(options);
  });
}

}  // namespace ressort::command_line
