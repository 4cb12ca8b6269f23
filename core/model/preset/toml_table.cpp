#include "core/model/preset/toml_table.h"

#include <algorithm>
#include <optional>

namespace ressort::model {
namespace {

constexpr int deepest_toml = 8;  // nested brackets, or dots in a key

// Returns the offset after the string that starts at `at`. A string that is never closed ends with
// its line, or with the text if it is a multi-line string.
std::size_t end_of_string(std::string_view text, std::size_t at) {
  const char quote = text[at];
  const std::string_view triple = quote == '"' ? "\"\"\"" : "'''";
  const bool is_long = text.substr(at).starts_with(triple);
  at += is_long ? 3 : 1;
  while (at < text.size()) {
    if (text[at] == '\\' && quote == '"') {
      at += 2;
    } else if (!is_long && (text[at] == quote || text[at] == '\n')) {
      return text[at] == quote ? at + 1 : at;
    } else if (is_long && text.substr(at).starts_with(triple)) {
      at += 3;
      // Up to two more quotes belong to the string.
      for (int more = 0; more < 2 && at < text.size() && text[at] == quote; ++more) {
        ++at;
      }
      return at;
    } else {
      ++at;
    }
  }
  return text.size();
}

// Returns an error if arrays, inline tables, headers or dotted keys are nested too deeply: toml++
// is recursive and does not limit dotted keys, so such a text could overflow the stack. O(n).
std::optional<Error> too_deep(std::string_view toml) {
  int open = 0;
  int dots = 0;
  for (std::size_t at = 0; at < toml.size(); ++at) {
    switch (toml[at]) {
      case '"':
      case '\'':
        at = end_of_string(toml, at) - 1;
        continue;
      case '#':
        at = std::min(toml.find('\n', at), toml.size()) - 1;
        continue;
      case '[':
      case '{':
        ++open;
        dots = 0;
        break;
      case ']':
      case '}':
        open = std::max(0, open - 1);
        dots = 0;
        break;
      case '\n':
      case '=':
      case ',':
        dots = 0;
        break;
      case '.':
        ++dots;
        break;
      default:
        break;
    }
    if (open > deepest_toml || dots > deepest_toml) {
      const std::string_view before = toml.substr(0, at);
      const std::size_t line_start = before.rfind('\n') + 1;  // 0 on the first line
      return Error{
          "this is nested more than " + std::to_string(deepest_toml) + " levels deep; 3 are enough",
          static_cast<int>(std::ranges::count(before, '\n')) + 1,
          static_cast<int>(at - line_start) + 1};
    }
  }
  return std::nullopt;
}

}  // namespace

Result<toml::table> parse_toml(std::string_view text) {
  if (text.size() > max_preset_bytes) {
    return Error{"the file is longer than 64 KiB", 1, 1};
  }
  if (auto error = too_deep(text)) {
    return *std::move(error);
  }
  toml::parse_result parsed = toml::parse(text);
  if (!parsed) {
    const auto& begin = parsed.error().source().begin;
    return Error{std::string(parsed.error().description()), static_cast<int>(begin.line),
                 static_cast<int>(begin.column)};
  }
  return std::move(parsed).table();
}

}  // namespace ressort::model
