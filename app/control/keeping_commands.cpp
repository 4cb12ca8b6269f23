// Console commands that save, undo, assign controllers and wait.
#include <algorithm>
#include <filesystem>

#include "app/control/console_commands.h"
#include "app/text.h"
#include "core/model/language/expression.h"
#include "core/ranges.h"

namespace ressort::control {
namespace {

// Returns the named control, or else the parameter, that a word means in any case of letters.
std::string meant_target(const Instrument& instrument, const std::string& word) {
  const auto is_meant = [&](const KnobInfo& knob) { return same_but_case(knob.word, word); };
  const auto knob = std::ranges::find_if(instrument.knobs, is_meant);
  return knob != instrument.knobs.end() ? knob->word : meant_parameter(instrument, word);
}

}  // namespace

Result<Done> command::save(ConsoleContext& console, Words words) {
  const Existing existing = words.size() > 1 ? Existing::replace : Existing::refuse;
  const auto path = console.session.save(words[0], existing);
  if (!path) {
    return path.error();
  }
  console.print("saved to " + *path + "; 'load " +
                (words[0].find(' ') == std::string::npos ? words[0] : "\"" + words[0] + "\"") +
                "' brings it back");
  return Done{};
}

Result<Done> command::flight(ConsoleContext& console, Words words) {
  const std::string path = is_flight_name(words[0]) ? words[0] : words[0] + ".ressort";
  const auto written =
      console.session.write_flight(path, words.size() > 1 ? Existing::replace : Existing::refuse);
  if (!written) {
    return written.error();
  }
  console.print("kept in " + path + "; 'ressort play " + path + "' plays it back");
  return Done{};
}

Result<Done> command::learn(ConsoleContext& console, Words words) {
  const auto current = console.session.current();
  const std::string target = meant_target(current->instrument, words[0]);
  if (auto begun = console.session.learn(target); !begun) {
    return begun.error();
  }
  console.print("turn the knob that is to control " + target + " to the right and back");
  return Done{};
}

Result<Done> command::unlearn(ConsoleContext& console, Words words) {
  const auto current = console.session.current();
  const std::string target = words.empty() ? "" : meant_target(current->instrument, words[0]);
  const auto count = console.session.unlearn(target);
  if (!count) {
    return count.error();
  }
  if (*count == 0 && !target.empty()) {
    return Error{"no controller is assigned to '" + target + "'"};
  }
  console.print(counted(*count, "controller has", "controllers have") +
                " the function in the preset again");
  return Done{};
}

// Loads and sets like any other client, so that an undo can be undone.
Result<Done> command::undo(ConsoleContext& console, Words) {
  const auto change = console.session.take_last_change();
  if (!change) {
    return Error{"there is nothing to undo"};
  }
  if (change->scene) {
    if (auto back = console.session.load_and_wait(*change->scene); !back) {
      return back.error();
    }
    const std::string stem = std::filesystem::path(*change->scene).stem().string();
    console.print(stem + " is restored" + (change->values.empty() ? "" : " with its values"));
  }
  std::vector<std::string> lines;
  for (const auto& [name, value] : change->values) {
    if (console.session.parameter(name) == value) {
      continue;
    }
    if (auto set = play(console, {"/param/" + name, {value}}); !set) {
      return set.error();
    }
    lines.push_back(name + " = " + print_number(value));
  }
  if (!lines.empty()) {
    console.print(joined(lines, "\n"));
  }
  return Done{};
}

Result<Done> control_song(Session& session, const std::string& word,
                          std::span<const Argument> numbers) {
  const Argument clock = std::string("clock");
  if (word == "tempo" && numbers.size() == 1 && numbers[0] == clock) {
    return session.song().follow_clock();
  }
  std::vector<double> given;
  for (const Argument& number : numbers) {
    if (!std::holds_alternative<double>(number)) {
      return Error{"expected a number, found '" + std::get<std::string>(number) + "'"};
    }
    given.push_back(std::get<double>(number));
  }
  Song& song = session.song();
  if (word == "play" && given.size() <= 1) {
    return song.play(given.empty() ? std::nullopt : std::optional(given[0]));
  }
  if (word == "pause" && given.size() <= 1) {  // also a button's value
    return song.pause();
  }
  if (word == "tempo" && given.size() == 1) {
    return song.set_tempo(given[0] / 100.0);
  }
  if (word == "loop" && given.size() != 1 && given.size() <= 2) {
    return given.empty() ? song.loop(0.0, 0.0) : song.loop(given[0], given[1]);
  }
  return Error{"expected play [SECONDS], pause, tempo PERCENT, tempo clock, or loop [FROM TO]"};
}

Result<Done> command::song(ConsoleContext& console, Words words) {
  const auto numbers = mapped(words.subspan(1), to_argument);
  auto done = control_song(console.session, words[0], numbers);
  if (done) {
    console.print(console.session.song().description());
  }
  return done;
}

Result<Done> command::wait(ConsoleContext& console, Words words) {
  constexpr double longest_s = 3600.0;
  double time_s = 0.0;
  if (!parse_number(words[0], time_s) || !(time_s >= 0.0 && time_s <= longest_s)) {
    return Error{"expected seconds, 0 to 3600, found '" + words[0] + "'"};
  }
  console.session.wait(std::chrono::duration<double>(time_s));
  return Done{};
}

}  // namespace ressort::control
