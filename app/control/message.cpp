#include "app/control/message.h"

#include <algorithm>

#include "core/model/language/expression.h"

namespace ressort::control {
namespace {

// Matches `c` with one element of a pattern other than '*'. Sets `length` to the length of that
// element, 0 if it matches no single character.
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

std::vector<std::string> split_words(std::string_view text, bool* is_open) {
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
  if (is_open != nullptr) {
    *is_open = at > text.size();
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
    bool is_open = false;
    const std::vector<std::string> words = split_words(line, &is_open);
    if (words.empty()) {
      continue;
    }
    if (is_open) {
      return Error{open_quote, number, static_cast<int>(line.rfind('"')) + 1};
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
    score.message.address = words[1];
    for (std::size_t i = 2; i < words.size(); ++i) {
      score.message.arguments.push_back(to_argument(words[i]));
    }
    lines.push_back(std::move(score));
  }
  return lines;
}

// Iterative matching that backtracks to the last '*': linear for patterns with one star, and at
// worst the product of both lengths. Alternatives {a,b} are tried one after the other and cannot
// nest.
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

}  // namespace ressort::control
