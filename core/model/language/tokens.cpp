#include "core/model/language/tokens.h"

#include <algorithm>
#include <cctype>

namespace ressort::model {
namespace {

bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\f' || c == '\v';
}

}  // namespace

bool is_identifier(std::string_view text) {
  return !text.empty() && std::isdigit(static_cast<unsigned char>(text[0])) == 0 &&
         std::ranges::all_of(text, [](char c) {
           return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
         });
}

std::string_view first_word(std::string_view text) {
  const auto ends = [](char c) { return is_blank(c) || c == '#' || c == '['; };
  return {text.begin(), std::ranges::find_if(text, ends)};
}

void split(std::string_view line, std::vector<Token>& tokens) {
  tokens.clear();
  std::size_t at = 0;
  while (at < line.size()) {
    if (is_blank(line[at])) {
      ++at;
      continue;
    }
    if (line[at] == '#') {
      break;
    }
    const std::size_t start = at;
    if (line[at] == '[' || line[at] == '\'') {
      const std::size_t end = line.find(line[at] == '[' ? ']' : '\'', at + 1);
      at = end == std::string_view::npos ? line.size() : end + 1;
    } else {
      at += first_word(line.substr(at)).size();
    }
    tokens.push_back({line.substr(start, at - start), static_cast<int>(start) + 1});
  }
}

std::vector<Token> split(std::string_view line) {
  std::vector<Token> tokens;
  split(line, tokens);
  return tokens;
}

Token unwrapped(Token token) {
  const std::string_view text = token.text;
  if (text.size() >= 2 && ((text.front() == '[' && text.back() == ']') ||
                           (text.front() == '\'' && text.back() == '\''))) {
    return {text.substr(1, text.size() - 2), token.column + 1};
  }
  return token;
}

std::size_t distance(std::string_view from, std::string_view to) {
  std::vector<std::size_t> row(to.size() + 1);
  for (std::size_t j = 0; j <= to.size(); ++j) {
    row[j] = j;
  }
  for (std::size_t i = 1; i <= from.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= to.size(); ++j) {
      const std::size_t substituted = diagonal + (from[i - 1] == to[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row[to.size()];
}

std::string_view first_letter(std::string_view text, std::size_t& length) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(0);
  const std::size_t wanted = first < 0xc2 ? 1 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : 4;
  bool is_letter = wanted == 1 ? std::isprint(first) != 0 : wanted <= text.size() && first < 0xf5;
  for (std::size_t i = 1; is_letter && i < wanted; ++i) {
    is_letter = (byte(i) & 0xc0) == 0x80;
  }
  is_letter &=
      !(first == 0xc2 && wanted <= text.size() && byte(1) < 0xa0);  // C1 control characters
  length = is_letter ? wanted : 1;
  return is_letter ? text.substr(0, wanted) : "?";
}

std::string quoted(std::string_view text) {
  constexpr int most_letters = 40;
  std::string shown = "'";
  for (int letters = 0; letters < most_letters && !text.empty(); ++letters) {
    std::size_t length = 0;
    shown += first_letter(text, length);
    text.remove_prefix(length);
  }
  return shown + (text.empty() ? "'" : "...'");
}

}  // namespace ressort::model
