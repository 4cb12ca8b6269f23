#include "app/commands/timbre/sweep.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>

#include "app/commands/output.h"
#include "app/commands/progress_bar.h"
#include "app/exit_code.h"
#include "app/session/files.h"
#include "app/session/timbre/timbre_figures.h"
#include "app/text.h"
#include "core/curve.h"
#include "core/model/language/expression.h"
#include "core/ranges.h"

namespace ressort::commands {
namespace {

constexpr int most_steps = 10'000;
constexpr double same_mode = 0.03;  // tolerance of a frequency

std::vector<std::string> words_of(const std::string& text, char between) {
  std::vector<std::string> words(1);
  for (const char c : text) {
    if (c == between) {
      words.emplace_back();
    } else {
      words.back() += c;
    }
  }
  return words;
}

double value_at(const SweptParameter& swept, int step) {
  const double way = swept.steps > 1 ? static_cast<double>(step) / (swept.steps - 1) : 0.0;
  return swept.by_ratios ? swept.first * std::pow(swept.last / swept.first, way)
                         : swept.first + (swept.last - swept.first) * way;
}

std::vector<std::string> figure_names() {
  std::vector<std::string> names = {"f0_hz"};
  int same = 1;
  for (const TimbreFigure& figure : timbre_figures()) {
    const bool is_next = names.back() == figure.name ||
                         names.back() == std::string(figure.name) + std::to_string(same);
    same = is_next ? same + 1 : 1;
    if (is_next && same == 2) {
      names.back() += "1";
    }
    names.push_back(std::string(figure.name) + (is_next ? std::to_string(same) : ""));
  }
  for (const TemporalFigure& figure : temporal_figures()) {
    names.emplace_back(figure.name);
  }
  return names;
}

// Returns the T60 of the mode at the pitch, in closed form.
std::optional<double> t60_of_pitch(const Description& description) {
  for (const DescribedMode& mode : description.modes) {
    if (description.f0_hz && std::fabs(mode.frequency_hz / *description.f0_hz - 1.0) < same_mode) {
      return mode.t60_s;
    }
  }
  return std::nullopt;
}

std::vector<std::optional<double>> figures_of(const Description& description, bool is_one_frame) {
  std::vector<std::optional<double>> values = {description.f0_hz};
  const FigureValues of_frames =
      is_one_frame ? description.frames.front().values : statistics_of(description).median;
  values.insert(values.end(), of_frames.begin(), of_frames.end());
  for (const TemporalFigure& figure : temporal_figures()) {
    values.push_back(description.temporal ? figure.of(*description.temporal) : std::nullopt);
    if (const auto exact = t60_of_pitch(description); figure.name == "t60_s" && exact) {
      values.back() = exact;
    }
  }
  return values;
}

std::vector<std::vector<double>> all_values(const std::vector<SweptParameter>& swept) {
  std::vector<std::vector<double>> all(1);
  for (const SweptParameter& one : swept) {
    std::vector<std::vector<double>> more;
    for (const std::vector<double>& before : all) {
      for (int step = 0; step < one.steps; ++step) {
        more.push_back(before);
        more.back().push_back(value_at(one, step));
      }
    }
    all = std::move(more);
  }
  return all;
}

}  // namespace

Result<SweptParameter> parse_swept(const std::string& text) {
  const auto wrong = [&](const std::string& why) {
    return Error{why +
                 ": expected NAME=LOW:HIGH, NAME=LOW:HIGH:STEPS or NAME=LOW:HIGH:STEPS:log, "
                 "found '" +
                 text + "'"};
  };
  const std::size_t equals = text.find('=');
  if (equals == text.npos || equals == 0) {
    return wrong("the name of the parameter is missing");
  }
  SweptParameter swept{.name = text.substr(0, equals)};
  const std::vector<std::string> words = words_of(text.substr(equals + 1), ':');
  if (words.size() < 2 || !parse_number(words[0], swept.first) ||
      !parse_number(words[1], swept.last)) {
    return wrong("the range is missing");
  }
  swept.by_ratios = is_wide(std::min(swept.first, swept.last), std::max(swept.first, swept.last));
  for (std::size_t i = 2; i < words.size(); ++i) {
    double steps = 0.0;
    if (words[i] == "log" || words[i] == "linear") {
      swept.by_ratios = words[i] == "log";
    } else if (i == 2 && parse_number(words[i], steps) && steps == std::floor(steps) &&
               steps >= 2.0 && steps <= most_steps) {
      swept.steps = static_cast<int>(steps);
    } else {
      return wrong("'" + words[i] + "' is neither a number of steps from 2 to " +
                   std::to_string(most_steps) + " nor log or linear");
    }
  }
  if (swept.by_ratios && !(swept.first > 0.0 && swept.last > 0.0)) {
    return wrong("log needs numbers above 0");
  }
  return swept;
}

Result<FigureLaw> parse_law(const std::string& text) {
  const std::size_t equals = text.find('=');
  return equals != text.npos && equals > 0 && equals + 1 < text.size()
             ? Result<FigureLaw>(FigureLaw{text.substr(0, equals), text.substr(equals + 1)})
             : Error{"expected FIGURE=FORMULA, found '" + text + "'"};
}

std::string to_csv(const SweepTable& table, const std::vector<SweptParameter>& swept) {
  std::string text = joined(swept, ",", &SweptParameter::name);
  for (const std::string& name : table.names) {
    text += "," + name;
  }
  text += "\n";
  for (const SweepRow& row : table.rows) {
    text += joined(row.at, ",", print_number);
    for (const std::optional<double>& value : row.figures) {
      text += "," + (value && std::isfinite(*value) ? print_number(*value) : std::string());
    }
    text += "\n";
  }
  return text;
}

int sweep(const DescribeOptions& options, const std::function<bool()>& should_continue) {
  SweepTable table{.of = options.name, .names = figure_names()};
  const auto pictures = std::ranges::count_if(
      options.outputs, [](const auto& path) { return path.ends_with(".svg"); });
  if (options.as_json) {
    return reject("--json: not available with --sweep, which writes CSV");
  }
  // Checks the figure before the work starts.
  if (auto figure = sweep_figure(table, options); pictures > 0 && !figure) {
    return reject(figure.error().message);
  }
  std::size_t count = 1;
  for (const SweptParameter& one : options.swept) {
    count *= static_cast<std::size_t>(one.steps);
    if (count > most_steps) {
      return reject("--sweep: more than " + std::to_string(most_steps) + " sounds");
    }
  }
  std::set<std::string> printed;
  const auto warn_once = [&](const std::string& text) {
    if (printed.insert(text).second) {
      print_error(text);
    }
  };
  {
    ProgressBar bar(true);
    for (const std::vector<double>& at : all_values(options.swept)) {
      DescribeOptions one = options;
      std::string place;
      for (std::size_t i = 0; i < at.size(); ++i) {
        one.settings.push_back({options.swept[i].name, at[i]});
        place += " " + options.swept[i].name + " = " + print_number(at[i]);
      }
      const auto done = static_cast<double>(table.rows.size());
      const auto description = description_of(
          one,
          [&](double share) {
            bar.show((done + share) / static_cast<double>(count), options.name + place);
            return should_continue();
          },
          warn_once);
      if (!should_continue()) {
        break;
      }
      if (!description && table.rows.empty()) {
        return reject(description.error().message);
      }
      if (!description) {
        warn_once(place.substr(1) + ": " + description.error().message);
      }
      table.rows.push_back({at, description
                                    ? figures_of(*description, options.how.at.has_value())
                                    : std::vector<std::optional<double>>(table.names.size())});
    }
  }
  if (!should_continue()) {
    std::fprintf(stderr, "%s: interrupted\n", options.name.c_str());
    return exit_code::our_failure;
  }
  const std::string csv = to_csv(table, options.swept);
  for (const std::string& output : options.outputs) {
    if (const int code = output.ends_with(".csv")
                             ? write_output(output, csv, options.force)
                             : put_figure(output, *sweep_figure(table, options), options.force)) {
      return code;
    }
    std::printf("%s: %s, %s\n", output.c_str(), options.name.c_str(),
                counted(count, "sound", "sounds").c_str());
  }
  if (options.outputs.empty()) {
    std::fputs(csv.c_str(), stdout);
  }
  return exit_code::done;
}

}  // namespace ressort::commands
