#include "app/control/registry.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "app/control/rows.h"
#include "app/text.h"
#include "core/engine/midi/channels.h"
#include "core/model/language/expression.h"

namespace ressort::control {
namespace {

// The text before and after N or NAME in an address; `hole` is empty if there is none.
struct Pattern {
  std::string_view before;
  std::string_view hole;
  std::string_view after;
};

Pattern pattern_of(const Row& row) {
  const std::string_view address = row.address;
  for (const std::string_view hole : {"/NAME", "/N"}) {
    if (const std::size_t at = address.find(hole); at != address.npos) {
      return {address.substr(0, at + 1), hole.substr(1), address.substr(at + hole.size())};
    }
  }
  return {address, "", ""};
}

// Returns the input of an address that starts like those of inputs, or the reason why there is
// none.
Result<const InputInfo*> find_input(const Message& message, const Instrument& instrument,
                                    std::string_view number_text) {
  int number = 0;
  const auto failure =
      std::from_chars(number_text.data(), number_text.data() + number_text.size(), number).ec;
  for (const InputInfo& input : instrument.inputs) {
    if (failure == std::errc{} && input.number == number) {
      return &input;
    }
  }
  return Error{message.address + ": the model has " +
               (instrument.inputs.empty()
                    ? "no inputs"
                    : "the inputs 1 to " + std::to_string(instrument.inputs.back().number))};
}

Error unknown(const Message& message, const Instrument& instrument) {
  for (const Row& row : rows()) {
    const Pattern pattern = pattern_of(row);
    if (pattern.hole != "N" || !message.address.starts_with(pattern.before)) {
      continue;
    }
    const auto input = find_input(message, instrument,
                                  std::string_view(message.address).substr(pattern.before.size()));
    if (!input) {
      return input.error();
    }
    std::vector<std::string> known;
    for (const Row& other : rows()) {
      if (pattern_of(other).hole == "N") {
        known.emplace_back(pattern_of(other).after);
      }
    }
    const std::string last = known.back();
    known.pop_back();
    return Error{message.address + ": an input accepts " + joined(known, ", ") + " and " + last};
  }
  return Error{"unknown address '" + message.address + "'; /describe lists all addresses"};
}

// One address may drive several inputs and parameters.
Events custom_events(const PlayCall& call) {
  std::vector<Event> events;
  for (const CustomInfo& info : call.instrument.custom) {
    if (info.address == call.message.address) {
      events.push_back({.kind = EventKind::custom,
                        .index = static_cast<std::uint16_t>(info.row),
                        .model = call.serial,
                        .value = call.arguments[0]});
    }
  }
  return events;
}

// The row of the addresses that a preset gives to its controls.
const Row custom_row{.arguments = {{"VALUE", "the value", 0, 1}}, .play = custom_events};

// Reads the arguments of a message. Returns an error text, or nothing if they match the row.
std::optional<std::string> read_arguments(const Row& row, const Message& message,
                                          std::array<double, most_arguments>& values) {
  std::size_t count = 0;
  for (const CallArgument& wanted : row.arguments) {
    if (wanted.word.empty()) {
      break;
    }
    const std::string meaning(wanted.meaning);
    if (count >= message.arguments.size()) {
      if (!wanted.otherwise) {
        return meaning + " is missing";
      }
      values[count++] = *wanted.otherwise;
      continue;
    }
    const double* const value = std::get_if<double>(&message.arguments[count]);
    if (value == nullptr || !std::isfinite(*value)) {
      return meaning + " must be a number" +
             (value == nullptr ? ", found '" + std::get<std::string>(message.arguments[count]) + "'"
                               : "");
    }
    if (*value < wanted.least || *value > wanted.most) {
      return meaning + " must lie between " + print_number(wanted.least) + " and " +
             print_number(wanted.most) + ", found " + print_number(*value);
    }
    // Numbers computed in single precision have rounding errors.
    if (wanted.is_whole && std::abs(*value - std::round(*value)) > 1e-3) {
      return meaning + " must be a whole number, found " + print_number(*value);
    }
    values[count++] = *value;
  }
  const std::size_t found = message.arguments.size();
  return count >= found || row.ignores_more
             ? std::nullopt
             : std::optional("too many arguments: " + std::to_string(found) + ", expected " +
                             std::to_string(count));
}

}  // namespace

std::uint16_t PlayCall::whole(std::size_t argument) const {
  return static_cast<std::uint16_t>(std::lround(arguments[argument]));
}

bool Row::may_omit(const CallArgument& argument) const {
  return argument.otherwise || (play != nullptr && answer != nullptr);
}

std::string Row::arguments_text() const {
  std::vector<std::string> texts;
  for (const CallArgument& argument : arguments) {
    if (!argument.word.empty()) {
      const std::string word(argument.word);
      texts.push_back(may_omit(argument) ? "[" + word + "]" : word);
    }
  }
  return joined(texts, " ");
}

const std::vector<Row>& rows() {
  static const std::vector<Row> made = make_rows();
  return made;
}

std::vector<const Row*> addresses() {
  std::vector<const Row*> found;
  for (const Row& row : rows()) {
    if (!row.address.empty()) {
      found.push_back(&row);
    }
  }
  return found;
}

std::vector<const Row*> command_rows() {
  std::vector<const Row*> found;
  for (const Row& row : rows()) {
    if (!row.command.empty()) {
      found.push_back(&row);
    }
  }
  std::ranges::stable_sort(found, {}, &Row::group);
  return found;
}

std::string_view heading(CommandGroup group) {
  constexpr std::string_view headings[] = {"Models", "Playing", "Parameters", "Information",
                                           "Other"};
  return headings[static_cast<std::size_t>(group)];
}

FoundRow find_row(std::string_view address) {
  FoundRow found;
  // Length of the text after NAME; of two matching rows the longer text wins.
  std::size_t longest = 0;
  for (const Row& row : rows()) {
    const auto [before, hole, after] = pattern_of(row);
    if (row.address.empty() || (hole.empty() && address != before)) {
      continue;
    }
    if (hole.empty()) {
      return {&row, ""};
    }
    if (address.size() >= before.size() + after.size() && address.starts_with(before) &&
        address.ends_with(after) && (found.row == nullptr || after.size() > longest)) {
      longest = after.size();
      found = {&row, address.substr(before.size(), address.size() - before.size() - after.size())};
    }
  }
  return found;
}

std::vector<std::string> addresses_meant(const std::string& pattern, const Instrument& instrument) {
  if (pattern.find_first_of("*?[{") == pattern.npos) {
    return {pattern};
  }
  std::set<std::string> found;
  const auto try_address = [&](const std::string& address) {
    if (fits(pattern, address)) {
      found.insert(address);
    }
  };
  // A name may itself be a pattern: the rest of the address must match.
  const auto try_name = [&](std::string_view before, std::string_view after) {
    std::size_t at = 0;  // where the name begins in the pattern
    for (auto slashes = std::ranges::count(before, '/'); slashes > 0; --slashes) {
      at = std::min(pattern.find('/', at), pattern.size() - 1) + 1;
    }
    const std::size_t size = std::min(pattern.find('/', at), pattern.size()) - at;
    const auto with = [&](std::string_view name, std::string_view start, std::string_view end) {
      return std::string(start) + std::string(name) + std::string(end);
    };
    const std::string_view all = pattern;
    if (size > 0 &&
        fits(with("x", all.substr(0, at), all.substr(at + size)), with("x", before, after))) {
      found.insert(with(all.substr(at, size), before, after));
    }
  };
  for (const Row& row : rows()) {
    const auto [before, hole, after] = pattern_of(row);
    if (hole == "N") {
      for (const InputInfo& input : instrument.inputs) {
        try_address(std::string(before) + std::to_string(input.number) + std::string(after));
      }
    } else if (hole == "NAME") {
      try_name(before, after);
    } else if (!before.empty()) {
      try_address(row.address);
    }
  }
  for (const CustomInfo& info : instrument.custom) {
    try_address(info.address);
  }
  return found.empty() ? std::vector{pattern} : std::vector(found.begin(), found.end());
}

bool is_answer(std::string_view address) {
  const auto all = answers();
  return std::ranges::find(all, address) != all.end();
}

bool is_reserved(std::string_view address) {
  return is_answer(address) || std::ranges::any_of(rows(), [&](const Row& row) {
           const Pattern pattern = pattern_of(row);
           return pattern.hole.empty() ? address == row.address
                                       : address.starts_with(pattern.before);
         });
}

Events to_events(const Message& message, const Instrument& instrument, std::uint32_t serial) {
  auto [row, name] = find_row(message.address);
  if (row == nullptr && std::ranges::any_of(instrument.custom, [&](const CustomInfo& info) {
        return info.address == message.address;
      })) {
    row = &custom_row;
  }
  if (row == nullptr || row->play == nullptr) {
    return unknown(message, instrument);
  }
  PlayCall call{.message = message,
                .instrument = instrument,
                .serial = serial,
                .name = name,
                .gesture = row->gesture};
  if (pattern_of(*row).hole == "N") {
    if (!std::ranges::all_of(name, [](char c) { return c >= '0' && c <= '9'; })) {
      return unknown(message, instrument);
    }
    const auto input = find_input(message, instrument, name);
    if (!input) {
      return input.error();
    }
    call.input = *input;
  }
  const auto wrong = read_arguments(*row, message, call.arguments);
  return wrong ? Events(Error{message.address + ": " + *wrong}) : row->play(call);
}

std::string describe_limit(const Message& message, const Event& event,
                           const Instrument& instrument) {
  if (event.kind != EventKind::parameter || message.arguments.empty()) {
    return "";
  }
  const double* const wanted = std::get_if<double>(message.arguments.data());
  const ParameterInfo& info = instrument.parameters[event.index];
  const bool is_changed = wanted != nullptr && event.value != *wanted;
  return is_changed && (event.value < *wanted ? info.is_lowered : info.is_raised)
             ? info.name + ": " + print_number(*wanted) + " is beyond the stable range, set to " +
                   print_number(event.value)
             : "";
}

}  // namespace ressort::control
