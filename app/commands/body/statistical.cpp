#include "app/commands/body/statistical.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "app/commands/body/numbers.h"
#include "app/commands/body/recording.h"
#include "app/commands/output.h"
#include "app/exit_code.h"
#include "app/session/files.h"
#include "app/text.h"
#include "core/model/language/expression.h"
#include "core/ranges.h"

namespace ressort::commands {
namespace {

constexpr double least_curve_hz = 1.0;
constexpr double most_curve_hz = 20000.0;

std::string curve_text(const std::vector<CurvePoint>& curve) {
  return joined(curve, ",", [&](const CurvePoint& point) {
    return (curve.size() == 1 ? "" : print_number(point[0]) + ":") + print_number(point[1]);
  });
}

// Returns the command that writes the same modes, as lines of comment.
std::string command_text(const StatisticalBodyOptions& options) {
  const BodyStatistics& body = options.statistics;
  std::vector<std::string> words = {"--statistical " + curve_text(body.density),
                                    "--loss " + curve_text(body.loss),
                                    "--mass " + print_number(body.mass)};
  for (const GivenMode& mode : body.given) {
    std::vector<double> numbers = {mode.frequency_hz, mode.q, mode.bridge, mode.left, mode.right};
    if (mode.right == mode.left) {
      numbers.pop_back();
    }
    while (numbers.size() > 2 && numbers.size() < 5 && numbers.back() == 1.0) {
      numbers.pop_back();
    }
    words.push_back("--mode " + joined(numbers, ",", print_number));
  }
  if (!body.radiation.empty()) {
    words.push_back("--radiation " + curve_text(body.radiation));
  }
  words.push_back("--seed " + std::to_string(body.seed));
  if (options.most_modes != StatisticalBodyOptions().most_modes) {
    words.push_back("--modes " + std::to_string(options.most_modes));
  }
  if (!options.output.empty()) {
    words.push_back("-o " + options.output.substr(options.output.rfind('/') + 1));
  }
  constexpr std::size_t widest = 96;
  std::string text;
  std::string line = "# ressort body";
  for (const std::string& word : words) {
    if (line.size() + 1 + word.size() > widest) {
      text += line + " \\\n";
      line = "#  ";
    }
    line += " " + word;
  }
  return text + line + "\n";
}

}  // namespace

std::string statistical_model(const StatisticalBodyOptions& options) {
  PlacedModes modes = statistical_modes(options.statistics);
  modes.name = label_of_file(options.output);
  const std::size_t given = options.statistics.given.size();
  return "# A body with " + counted(given, "given mode", "given modes") + " and " +
         counted(modes.modes.size() - given, "mode", "modes") +
         " drawn from statistics. The displacements at\n"
         "# left and right include a factor of f/1 kHz, so that the outputs follow the velocity, "
         "as "
         "sound\n# pressure does.\n" +
         command_text(options) + body_text(modes) + "@in1 frcInput [@" + modes.name +
         " bridge]\n@out1 posOutput [@" + modes.name + " left]\n@out2 posOutput [@" + modes.name +
         " right]\n";
}

int statistical_body(const StatisticalBodyOptions& options) {
  const BodyStatistics& body = options.statistics;
  if (body.density.size() < 2) {
    return reject(
        "--statistical: expected at least two points HZ:DENSITY, because the first and the last "
        "frequency are the range of the modes");
  }
  if (body.loss.empty()) {
    return reject("--statistical needs --loss, for example --loss 0.02 for wood");
  }
  const double count = mean_mode_count(body.density);
  if (count > options.most_modes) {
    return reject("--statistical: this density gives " + fixed(count, 0) +
                  " modes, more than the limit of " + std::to_string(options.most_modes) +
                  "; lower the density or its highest frequency, or raise the limit with --modes");
  }
  const std::string model = statistical_model(options);
  if (options.output.empty()) {
    std::fputs(model.c_str(), stdout);
    return std::fflush(stdout) == 0 ? exit_code::done : exit_code::our_failure;
  }
  if (const int code = write_output(options.output, model, options.force)) {
    return code;
  }
  std::printf("%s: %s, mean conductance n/(4 M) at the bridge from %.3g to %.3g s per unit of M\n",
              options.output.c_str(),
              counted(statistical_modes(body).modes.size(), "mode", "modes").c_str(),
              0.25 * body.density.front()[1] / body.mass,
              0.25 * body.density.back()[1] / body.mass);
  return exit_code::done;
}

Result<std::vector<CurvePoint>> parse_curve(const std::string& text, double least, double most) {
  const auto fits = [&](double value) { return value >= least && value <= most; };
  if (double value = 0.0; parse_number(text, value) && fits(value)) {
    return std::vector<CurvePoint>{{least_curve_hz, value}};
  }
  std::vector<CurvePoint> curve;
  double before_hz = 0.0;
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t end = std::min(text.find(',', from), text.size());
    const std::string word = text.substr(from, end - from);
    const auto point = numbers_of(word, ':');
    if (!point || point->size() != 2 || (*point)[0] < least_curve_hz ||
        (*point)[0] > most_curve_hz || (*point)[0] <= before_hz || !fits((*point)[1])) {
      return Error{"expected a value or HZ:VALUE,HZ:VALUE,... with ascending frequencies of " +
                   print_number(least_curve_hz) + " to " + print_number(most_curve_hz) +
                   " and values of " + print_number(least) + " to " + print_number(most) +
                   ", found '" + word + "'"};
    }
    before_hz = (*point)[0];
    curve.push_back({(*point)[0], (*point)[1]});
    from = end + 1;
  }
  return curve;
}

Result<GivenMode> parse_mode(const std::string& text) {
  constexpr double lowest_q = 0.5;
  constexpr double highest_q = 1e6;
  const auto n = numbers_of(text);
  if (!n || n->size() < 2 || n->size() > 5 || (*n)[0] < least_curve_hz || (*n)[0] > most_curve_hz ||
      (*n)[1] < lowest_q || (*n)[1] > highest_q) {
    return Error{"expected HZ,Q, HZ,Q,BRIDGE, HZ,Q,BRIDGE,LEFT or HZ,Q,BRIDGE,LEFT,RIGHT with " +
                 print_number(least_curve_hz) + " to " + print_number(most_curve_hz) +
                 " Hz and a Q of " + print_number(lowest_q) + " to " + print_number(highest_q) +
                 ", found '" + text + "'"};
  }
  const double left = n->size() > 3 ? (*n)[3] : 1.0;
  return GivenMode{.frequency_hz = (*n)[0],
                   .q = (*n)[1],
                   .bridge = n->size() > 2 ? (*n)[2] : 1.0,
                   .left = left,
                   .right = n->size() > 4 ? (*n)[4] : left};
}

}  // namespace ressort::commands
