#include "app/control/calls.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "core/model/language/expression.h"

namespace ressort {
namespace {

constexpr AddressRow rows[] = {
    {"/note/on", "KEY [VELOCITY]", "starts a note; key 0-127, velocity 1-127 (100)", true},
    {"/note/off", "KEY", "ends a note", true},
    {"/cc", "NUMBER VALUE", "a controller, as from a keyboard; value 0-127", true},
    {"/pressure", "VALUE", "channel pressure, 0-127", true},
    {"/bend", "VALUE", "pitch bend, -1 to 1 (two semitones)", true},
    {"/param/NAME", "[VALUE]", "a parameter: sets it, or answers its value", true},
    {"/param/NAME/range", "", "answers its minimum and maximum, and between what it is stable",
     false},
    {"/in/N/position", "POSITION", "moves the hand at input N, smoothed", true},
    {"/in/N/force", "FORCE [SECONDS]", "pushes input N: one sample, or as long as told", true},
    {"/in/N/pluck", "STRENGTH", "the finger at input N sweeps through the string; 0-1", true},
    {"/in/N/bow", "SPEED [PRESSURE]",
     "draws the bow at input N; speed -1 to 1, pressure 0-1; "
     "speed 0 stops",
     true},
    {"/panic", "", "silence at once", true},
    {"/model/load", "NAME [ID]", "loads a model or preset; answers /done or /fail", false},
    {"/preset/load", "NAME [ID]", "the same for a preset", false},
    {"/status", "", "answers voices, cpu load, xruns, resets, rate and more", false},
    {"/describe", "", "answers a row for everything that can be set or asked", false},
};

// Reads arguments one after the other and keeps the first problem.
class Arguments {
 public:
  explicit Arguments(const Call& call) : call_(call) {}

  double number(std::string_view what) {
    const Argument* argument = next();
    if (argument == nullptr) {
      fail(std::string(what) + " is missing");
      return 0.0;
    }
    const double* value = std::get_if<double>(argument);
    if (value == nullptr || !std::isfinite(*value)) {
      fail(std::string(what) + " must be a number" +
           (value == nullptr ? ", found '" + std::get<std::string>(*argument) + "'" : ""));
      return 0.0;
    }
    return *value;
  }

  double number_or(std::string_view what, double otherwise) {
    return at_ < call_.arguments.size() ? number(what) : otherwise;
  }

  double in_range(std::string_view what, double least, double most) {
    return checked(what, number(what), least, most);
  }
  double in_range_or(std::string_view what, double otherwise, double least, double most) {
    return checked(what, number_or(what, otherwise), least, most);
  }

  std::optional<Error> end() {
    if (!error_ && at_ < call_.arguments.size()) {
      fail("too many arguments: " + std::to_string(call_.arguments.size()) + ", expected " +
           std::to_string(at_));
    }
    return error_;
  }

 private:
  double checked(std::string_view what, double value, double least, double most) {
    if (!error_ && (value < least || value > most)) {
      fail(std::string(what) + " must lie between " + print_number(least) + " and " +
           print_number(most) + ", found " + print_number(value));
    }
    return value;
  }
  const Argument* next() {
    return at_ < call_.arguments.size() ? &call_.arguments[at_++] : nullptr;
  }
  void fail(std::string message) {
    if (!error_) {
      error_ = Error{call_.address + ": " + std::move(message)};
    }
  }

  const Call& call_;
  std::size_t at_ = 0;
  std::optional<Error> error_;
};

std::string parameter_names(const Instrument& instrument) {
  std::string text;
  for (const ParameterInfo& info : instrument.parameters) {
    text += (text.empty() ? "" : ", ") + info.name;
  }
  return text.empty() ? "none" : text;
}

// The parameters that a pattern names; an error if it names none.
Result<std::vector<Event>> parameter_events(const Call& call, const Instrument& instrument,
                                            std::uint32_t serial) {
  const std::string_view pattern = std::string_view(call.address).substr(7);
  Arguments arguments(call);
  const double value = arguments.number("the value");
  if (const auto error = arguments.end()) {
    return *error;
  }
  std::vector<Event> events;
  for (std::size_t i = 0; i < instrument.parameters.size(); ++i) {
    const ParameterInfo& info = instrument.parameters[i];
    if (info.audio_input > 0 && pattern == info.name) {
      return Error{call.address + ": input " + std::to_string(info.audio_input) +
                   " gives it, sample by sample; it cannot be set"};
    }
    if (info.audio_input == 0 && fits(pattern, info.name)) {
      events.push_back({.kind = EventKind::parameter,
                        .index = static_cast<std::uint16_t>(i),
                        .model = serial,
                        .value = std::clamp(value, info.minimum, info.maximum)});
    }
  }
  if (events.empty()) {
    return Error{call.address + ": the model has no such parameter; it has " +
                 parameter_names(instrument)};
  }
  return events;
}

// "/in/N/verb"
Result<std::vector<Event>> input_events(const Call& call, const Instrument& instrument,
                                        std::uint32_t serial) {
  const std::string_view rest = std::string_view(call.address).substr(4);
  int number = 0;
  const auto [end, failure] = std::from_chars(rest.data(), rest.data() + rest.size(), number);
  const std::string_view verb(end, static_cast<std::size_t>(rest.data() + rest.size() - end));
  const auto found = std::find_if(instrument.inputs.begin(), instrument.inputs.end(),
                                  [&](const InputInfo& info) { return info.number == number; });
  if (failure != std::errc{} || found == instrument.inputs.end()) {
    return Error{call.address + ": the model has " +
                 (instrument.inputs.empty()
                      ? "no inputs"
                      : "the inputs 1 to " + std::to_string(instrument.inputs.back().number))};
  }
  Event event{.index = static_cast<std::uint16_t>(number), .model = serial};
  Arguments arguments(call);
  const char* unfit = nullptr;
  if (verb == "/position") {
    event.kind = EventKind::position;
    event.value = arguments.number("the position");
    unfit = found->is_force ? "takes a force, no position: use /in/N/force" : nullptr;
  } else if (verb == "/force") {
    event.kind = EventKind::force;
    event.value = arguments.number("the force");
    event.value2 = arguments.in_range_or("the time in seconds", 0.0, 0.0, 3600.0);
    unfit = found->is_force ? nullptr : "takes a position, no force: use /in/N/position";
  } else if (verb == "/pluck") {
    event.kind = EventKind::pluck;
    event.value = arguments.in_range("the strength", 0.0, 1.0);
    unfit = found->can_pluck ? nullptr : "has no pluck in this preset";
  } else if (verb == "/bow") {
    event.kind = EventKind::bow;
    event.value = arguments.in_range("the speed", -1.0, 1.0);
    const bool has_pressure = call.arguments.size() > 1;
    event.value2 = has_pressure ? arguments.in_range("the pressure", 0.0, 1.0) : -1.0;
    unfit = found->can_bow ? nullptr : "has no bow in this preset";
  } else {
    return Error{call.address + ": an input knows /position, /force, /pluck and /bow"};
  }
  if (const auto error = arguments.end()) {
    return *error;
  }
  if (unfit != nullptr) {
    return Error{call.address + ": input " + std::to_string(number) + " " + unfit};
  }
  return std::vector{event};
}

Result<std::vector<Event>> simple_event(const Call& call) {
  Event event;
  Arguments arguments(call);
  if (call.address == "/note/on" || call.address == "/note/off") {
    const double key = arguments.in_range("the key", 0.0, 127.0);
    const double velocity = arguments.in_range_or("the velocity", 100.0, 0.0, 127.0);
    event.index = static_cast<std::uint16_t>(std::lround(key));
    event.value = velocity / 127.0;
    event.kind =
        call.address == "/note/on" && velocity > 0.0 ? EventKind::note_on : EventKind::note_off;
  } else if (call.address == "/cc") {
    event.kind = EventKind::controller;
    event.index =
        static_cast<std::uint16_t>(std::lround(arguments.in_range("the number", 0.0, 127.0)));
    event.value = arguments.in_range("the value", 0.0, 127.0) / 127.0;
  } else if (call.address == "/pressure") {
    event.kind = EventKind::pressure;
    event.value = arguments.in_range("the pressure", 0.0, 127.0) / 127.0;
  } else if (call.address == "/bend") {
    event.kind = EventKind::bend;
    event.value = arguments.in_range("the bend", -1.0, 1.0);
  } else {
    event.kind = EventKind::panic;
  }
  if (const auto error = arguments.end()) {
    return *error;
  }
  return std::vector{event};
}

bool is_simple(std::string_view address) {
  return address == "/note/on" || address == "/note/off" || address == "/cc" ||
         address == "/pressure" || address == "/bend" || address == "/panic";
}

bool is_custom(const Instrument& instrument, std::string_view address) {
  return std::any_of(instrument.custom.begin(), instrument.custom.end(),
                     [&](const CustomInfo& info) { return info.address == address; });
}

// One address may drive several inputs and parameters.
Result<std::vector<Event>> custom_events(const Call& call, const Instrument& instrument,
                                         std::uint32_t serial) {
  Arguments arguments(call);
  const double value = arguments.in_range("the value", 0.0, 1.0);
  if (const auto error = arguments.end()) {
    return *error;
  }
  std::vector<Event> events;
  for (const CustomInfo& info : instrument.custom) {
    if (info.address == call.address) {
      events.push_back({.kind = EventKind::custom,
                        .index = static_cast<std::uint16_t>(info.row),
                        .model = serial,
                        .value = value});
    }
  }
  return events;
}

// One element of a pattern that is not '*': does it fit `c`? `length` is how much of the pattern
// it takes, 0 if it fits no single character.
bool fits_one(std::string_view pattern, char c, std::size_t& length) {
  length = 1;
  if (pattern[0] == '?') {
    return c != '/';
  }
  const std::size_t end = pattern.find(']');
  if (pattern[0] != '[' || end == std::string_view::npos) {
    return pattern[0] == c;
  }
  length = end + 1;
  std::string_view set = pattern.substr(1, end - 1);
  const bool negated = !set.empty() && set[0] == '!';
  set.remove_prefix(negated ? 1 : 0);
  bool inside = false;
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (i + 2 < set.size() && set[i + 1] == '-') {
      inside |= set[i] <= c && c <= set[i + 2];
      i += 2;
    } else {
      inside |= set[i] == c;
    }
  }
  return inside != negated;
}

}  // namespace

std::span<const AddressRow> addresses() {
  return rows;
}

bool plays(const Call& call, const Instrument& instrument) {
  if (call.address.starts_with("/param/")) {
    return !call.arguments.empty() && !call.address.ends_with("/range");
  }
  return is_simple(call.address) || call.address.starts_with("/in/") ||
         is_custom(instrument, call.address);
}

Result<std::vector<Event>> to_events(const Call& call, const Instrument& instrument,
                                     std::uint32_t serial) {
  if (is_simple(call.address)) {
    return simple_event(call);
  }
  if (call.address.starts_with("/param/")) {
    return parameter_events(call, instrument, serial);
  }
  if (call.address.starts_with("/in/")) {
    return input_events(call, instrument, serial);
  }
  if (is_custom(instrument, call.address)) {
    return custom_events(call, instrument, serial);
  }
  return Error{"unknown address '" + call.address + "'; /describe lists what there is"};
}

std::string told_limit(const Call& call, const Event& event, const Instrument& instrument) {
  if (event.kind != EventKind::parameter || call.arguments.empty()) {
    return "";
  }
  const double* const wanted = std::get_if<double>(call.arguments.data());
  const ParameterInfo& info = instrument.parameters[event.index];
  const bool is_beyond = wanted != nullptr && ((event.value < *wanted && info.is_lowered) ||
                                               (event.value > *wanted && info.is_raised));
  return is_beyond ? info.name + ": " + print_number(*wanted) +
                         " is beyond what is stable, set to " + print_number(event.value)
                   : "";
}

std::vector<std::string> split_words(std::string_view text) {
  std::vector<std::string> words;
  std::size_t at = 0;
  while (at < text.size()) {
    const char c = text[at];
    if (c == ' ' || c == '\t' || c == '\r') {
      ++at;
      continue;
    }
    const bool is_quoted = c == '"';
    const std::size_t start = at + (is_quoted ? 1 : 0);
    const std::size_t end =
        std::min(text.find_first_of(is_quoted ? "\"" : " \t\r", start), text.size());
    words.emplace_back(text.substr(start, end - start));
    at = end + (is_quoted ? 1 : 0);
  }
  return words;
}

Argument to_argument(const std::string& word) {
  double number = 0.0;
  if (parse_number(word, number)) {
    return number;
  }
  return word;
}

Result<std::vector<ScoreLine>> parse_score(std::string_view text) {
  std::vector<ScoreLine> lines;
  int number = 0;
  while (!text.empty()) {
    ++number;
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(text.size(), end + 1));
    line = line.substr(0, line.find('#'));
    const std::vector<std::string> words = split_words(line);
    if (words.empty()) {
      continue;
    }
    const std::size_t first = line.find_first_not_of(" \t\r");
    const std::size_t second =
        std::min(line.find_first_not_of(" \t\r", first + words[0].size()), line.size() + 1);
    ScoreLine score{.line = number, .column = static_cast<int>(second) + 1};
    constexpr double latest_s = 24.0 * 3600.0;
    if (!parse_number(words[0], score.time_s) || score.time_s < 0.0 || score.time_s > latest_s) {
      return Error{"found '" + words[0] + "' where a time in seconds was expected, at most a day",
                   number, static_cast<int>(first) + 1};
    }
    if (words.size() < 2 || words[1][0] != '/') {
      return Error{"expected an address such as /note/on after the time", number, score.column};
    }
    score.call.address = words[1];
    for (std::size_t i = 2; i < words.size(); ++i) {
      score.call.arguments.push_back(to_argument(words[i]));
    }
    lines.push_back(std::move(score));
  }
  return lines;
}

// Iterative, with one point to go back to for '*': linear for patterns with one star, and never
// worse than their product in length. {a,b} is tried alternative by alternative, not nested.
bool fits(std::string_view pattern, std::string_view address) {
  const std::size_t open = pattern.find('{');
  const std::size_t close = pattern.find('}', open == std::string_view::npos ? 0 : open);
  if (open != std::string_view::npos && close != std::string_view::npos &&
      pattern.find('{', close) == std::string_view::npos) {
    std::string_view choices = pattern.substr(open + 1, close - open - 1);
    while (true) {
      const std::size_t comma = std::min(choices.find(','), choices.size());
      const std::string tried = std::string(pattern.substr(0, open)) +
                                std::string(choices.substr(0, comma)) +
                                std::string(pattern.substr(close + 1));
      if (fits(tried, address)) {
        return true;
      }
      if (comma == choices.size()) {
        return false;
      }
      choices.remove_prefix(comma + 1);
    }
  }
  std::size_t p = 0;
  std::size_t a = 0;
  std::size_t star = std::string_view::npos;
  std::size_t star_a = 0;
  while (a < address.size()) {
    std::size_t length = 0;
    if (p < pattern.size() && pattern[p] == '*') {
      star = p++;
      star_a = a;
    } else if (p < pattern.size() && fits_one(pattern.substr(p), address[a], length)) {
      p += length;
      ++a;
    } else if (star != std::string_view::npos && address[star_a] != '/') {
      p = star + 1;
      a = ++star_a;
    } else {
      return false;
    }
  }
  while (p < pattern.size() && pattern[p] == '*') {
    ++p;
  }
  return p == pattern.size();
}

}  // namespace ressort
