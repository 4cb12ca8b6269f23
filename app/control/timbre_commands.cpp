// Console commands that describe and change the timbre.
#include <future>

#include "app/control/console_commands.h"
#include "app/text.h"
#include "core/model/language/expression.h"
#include "core/ranges.h"

namespace ressort::control {

Result<Done> command::timbre(ConsoleContext& console, Words) {
  constexpr std::chrono::milliseconds patience{20};
  constexpr int rounds = 60;  // A little over a second; the analysis needs 0.2 s.
  TimbreWatch& watch = console.session.timbre();
  // Keeps listening for a while, because users ask repeatedly.
  watch.listen(std::chrono::seconds(10));
  auto moment = watch.now();
  for (int round = 0; !moment && round < rounds && console.session.wait(patience); ++round) {
    moment = watch.now();
  }
  if (!moment) {
    return Error{"no audio is running, so there is no sound"};
  }
  if (!moment->figures[figure_number("centroid_hz")]) {
    return Error{"the output is silent; play a note and repeat the command while it sounds"};
  }
  console.print(joined(timbre_words(moment->figures, {}, console.timbre), "\n") +
                (moment->f0_hz ? "\nf0: " + with_commas(*moment->f0_hz, 2) + " Hz" : ""));
  console.timbre = std::move(moment->figures);
  return Done{};
}

Result<std::vector<TimbreTarget>> timbre_targets(std::span<const Argument> arguments) {
  if (arguments.empty() || arguments.size() % 2 != 0) {
    return Error{"expected FIGURE VALUE, one or more: centroid 1800 t60 3"};
  }
  std::vector<TimbreTarget> targets;
  for (std::size_t i = 0; i < arguments.size(); i += 2) {
    const std::string* const word = std::get_if<std::string>(&arguments[i]);
    const double* const value = std::get_if<double>(&arguments[i + 1]);
    if (word == nullptr || value == nullptr) {
      return Error{"expected a figure's name and then a number: centroid 1800 t60 3"};
    }
    const auto figure = parse_target_figure(*word);
    if (!figure) {
      return figure.error();
    }
    targets.push_back({*figure, *value});
  }
  return targets;
}

Result<Done> command::shape(ConsoleContext& console, Words words) {
  const auto arguments = mapped(words, to_argument);
  const auto targets = timbre_targets(arguments);
  if (!targets) {
    return targets.error();
  }
  const Session::Present before = console.session.present();
  std::promise<Result<Shaped>> promise;
  console.session.shape(*targets, [&](const auto& result) { promise.set_value(result); });
  const auto shaped = promise.get_future().get();
  if (!shaped) {
    return shaped.error();
  }
  std::string text = to_text(*shaped);
  for (const ShapedParameter& one : changed(*shaped, before.values)) {
    text += "\n" + one.name + " = " + print_number(one.value);
  }
  console.print(text + "\n'undo' reverts it, 'save NAME' saves it");
  return Done{};
}

}  // namespace ressort::control
