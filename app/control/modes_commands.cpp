// Console commands about the modes of the current model.
#include <future>

#include "app/control/console_commands.h"
#include "app/session/modes/known_modes.h"
#include "core/model/language/expression.h"
#include "core/ranges.h"

namespace ressort::control {

Result<Done> command::modes(ConsoleContext& console, Words words) {
  const auto count = mode_count(words.empty() ? Argument(32.0) : to_argument(words[0]));
  if (!count) {
    return count.error();
  }
  std::promise<Result<KnownModes>> promise;
  console.session.find_modes(*count, [&](const auto& modes) { promise.set_value(modes); });
  const auto modes = promise.get_future().get();
  if (!modes) {
    return modes.error();
  }
  console.print(to_table(*modes));
  return Done{};
}

Result<Done> command::tune(ConsoleContext& console, Words words) {
  const auto arguments = mapped(words, to_argument);
  const auto target = tune_target(arguments);
  if (!target) {
    return target.error();
  }
  std::promise<Result<std::shared_ptr<const Loaded>>> promise;
  console.session.tune(*target, [&](const auto& result) { promise.set_value(result); });
  const auto tuned = promise.get_future().get();
  if (!tuned) {
    return tuned.error();
  }
  console.print("mode " + std::to_string(target->mode + 1) + " is at " +
                print_number(target->frequency_hz) + " Hz, " + note_name(target->frequency_hz) +
                "; 'undo' reverts it, 'save NAME' saves it");
  return Done{};
}

Result<std::size_t> mode_count(const Argument& argument) {
  constexpr double most = 10000.0;
  const double* const number = std::get_if<double>(&argument);
  if (number == nullptr || !(*number >= 1.0 && *number <= most)) {
    return Error{"expected the number of modes, 1 to 10000"};
  }
  return static_cast<std::size_t>(*number);
}

Result<TuneTarget> tune_target(std::span<const Argument> arguments) {
  const Error expected{"expected MODE NOTE|HZ [T60] [PART]: 1 A4, or 2 330 1.5 string"};
  if (arguments.size() < 2 || arguments.size() > 4) {
    return expected;
  }
  const double* const mode = std::get_if<double>(arguments.data());
  if (mode == nullptr || !(*mode >= 1.0 && *mode <= 10000.0)) {
    return Error{"expected the number of a mode (1 is the lowest); 'modes' lists them"};
  }
  TuneTarget target{.mode = static_cast<std::size_t>(*mode) - 1};
  const double* const hertz = std::get_if<double>(&arguments[1]);
  const auto frequency = hertz == nullptr ? frequency_of(std::get<std::string>(arguments[1]))
                         : *hertz > 0.0   ? std::optional(*hertz)
                                          : std::nullopt;
  if (!frequency) {
    return Error{"expected a note such as A4 or Bb2, or a frequency above 0 in Hz"};
  }
  target.frequency_hz = *frequency;
  for (const Argument& argument : arguments.subspan(2)) {
    if (const std::string* const part = std::get_if<std::string>(&argument)) {
      target.part = part->starts_with('@') ? part->substr(1) : *part;
    } else if (target.t60_s || !(std::get<double>(argument) > 0.0)) {
      return Error{"expected one T60 above 0 in seconds"};
    } else {
      target.t60_s = std::get<double>(argument);
    }
  }
  return target;
}

}  // namespace ressort::control
