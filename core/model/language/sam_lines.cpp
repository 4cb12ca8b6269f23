#include "core/model/language/sam_lines.h"

#include <algorithm>
#include <cctype>

namespace ressort::model {
namespace {

constexpr std::string_view elements[] = {
    "mass",           "ground",    "port",          "resonators",        "link",
    "touch",          "pluck",     "waveguide",     "termination",       "junction",
    "pulseTouch",     "resonator", "detent",        "pulseTouchGeneral", "pulseTouchTable",
    "massCA",         "linkCA",    "BUT",           "display",           "softeninglink",
    "stiffeninglink", "audioout",  "controladjust", "rtadjust"};

bool is_space(char c) {
  return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}

bool is_of_a_name(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
}

// Returns the line without its comment, which starts with '#' or '//'.
std::string_view without_comment(std::string_view line) {
  bool is_quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    is_quoted = is_quoted != (line[i] == '"');
    if (!is_quoted && (line[i] == '#' || line.substr(i, 2) == "//")) {
      return line.substr(0, i);
    }
  }
  return line;
}

}  // namespace

Token behind(const Token& token, std::size_t count) {
  return {token.text.substr(count), token.column + static_cast<int>(count)};
}

std::size_t closing(std::string_view text) {
  int depth = 0;
  bool is_quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    is_quoted = is_quoted != (text[i] == '"');
    depth += is_quoted ? 0 : (text[i] == '(') - (text[i] == ')');
    if (depth == 0 && text[i] == ')') {
      return i;
    }
  }
  return std::string_view::npos;
}

std::size_t word_length(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::find_if_not(text, is_of_a_name) - text.begin());
}

std::size_t number_length(std::string_view text) {
  std::size_t end = 0;
  while (end < text.size() &&
         (std::isdigit(static_cast<unsigned char>(text[end])) != 0 || text[end] == '.')) {
    ++end;
  }
  if (end < text.size() && (text[end] == 'e' || text[end] == 'E')) {
    ++end;
    end += end < text.size() && (text[end] == '+' || text[end] == '-') ? 1 : 0;
    while (end < text.size() && std::isdigit(static_cast<unsigned char>(text[end])) != 0) {
      ++end;
    }
  }
  return end;
}

Token trimmed(Token token) {
  while (!token.text.empty() && is_space(token.text.front())) {
    token = behind(token, 1);
  }
  while (!token.text.empty() && is_space(token.text.back())) {
    token.text.remove_suffix(1);
  }
  return token;
}

std::vector<Token> divided(const Token& token, char mark) {
  std::vector<Token> parts;
  int depth = 0;
  bool is_quoted = false;
  std::size_t start = 0;
  for (std::size_t i = 0; i <= token.text.size(); ++i) {
    const char c = i < token.text.size() ? token.text[i] : mark;
    is_quoted = is_quoted != (c == '"');
    depth += is_quoted ? 0 : (c == '(') - (c == ')');
    if (i == token.text.size() || (c == mark && depth == 0 && !is_quoted)) {
      parts.push_back(
          trimmed({token.text.substr(start, i - start), token.column + static_cast<int>(start)}));
      start = i + 1;
    }
  }
  return parts;
}

bool is_synth_a_modeler(std::string_view text) {
  if (text.starts_with("\xef\xbb\xbf")) {
    text.remove_prefix(3);
  }
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of("\r\n"), text.size());
    const std::string_view line = trimmed({without_comment(text.substr(0, end)), 1}).text;
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.empty()) {
      continue;
    }
    const std::size_t length = word_length(line);
    const std::string_view word = line.substr(0, length);
    const char next = length < line.size() ? line[length] : ' ';
    return (word == "faustcode" && next == ':') ||
           ((word == "audioout" || word == "controladjust") && next == ',') ||
           (next == '(' && std::ranges::find(elements, word) != std::end(elements));
  }
  return false;
}

void SamLines::read(std::string_view text, const Progress& progress) {
  if (text.starts_with("\xef\xbb\xbf")) {
    text.remove_prefix(3);
  }
  int number = 0;
  while (!text.empty() && !is_full()) {
    const std::size_t end = std::min(text.find_first_of("\r\n"), text.size());
    read_line(text.substr(0, end), ++number);
    progress.spend(end / 4 + 1);
    const bool pair = text.substr(end, 2) == "\r\n";
    text.remove_prefix(std::min(text.size(), end + (pair ? 2 : 1)));
  }
  define_parameters();
}

// Removes the final ';' and reports text after it.
bool SamLines::read_end(const Origin& origin, Token& rest) {
  const std::vector<Token> parts = divided(rest, ';');
  if (parts.size() == 1) {
    error(origin, {"", rest.column + static_cast<int>(rest.text.size())},
          "the line ends where a ';' was expected");
    return false;
  }
  if (parts.size() > 2 || !parts[1].text.empty()) {
    error(origin, parts[1], "expected nothing after ';': write one statement per line");
    return false;
  }
  rest = parts[0];
  return true;
}

void SamLines::read_line(std::string_view text, int number) {
  const Token line = trimmed({without_comment(text), 1});
  if (line.text.empty()) {
    return;
  }
  Statement statement{.origin = {number, line.column, static_cast<int>(line.text.size())},
                      .word = {line.text.substr(0, word_length(line.text)), line.column}};
  const Origin& origin = statement.origin;
  const std::string_view word = statement.word.text;
  Token rest = trimmed(behind(line, word.size()));
  if (word == "faustcode" && rest.text.starts_with(':')) {
    rest = trimmed(behind(rest, 1));
    if (rest.text.empty()) {
      return;  // a comment
    }
    return read_end(origin, rest) ? read_definition(origin, rest) : void();
  }
  if (std::ranges::find(elements, word) == std::end(elements)) {
    return error(origin, word.empty() ? line : statement.word,
                 "expected an element of Synth-A-Modeler, found " +
                     quoted(word.empty() ? line.text : word) + suggestion(word, elements));
  }
  const bool has_arguments = word != "audioout" && !word.ends_with("adjust");
  if (has_arguments) {
    const std::size_t last = rest.text.starts_with('(') ? closing(rest.text) : 0;
    if (last == 0 || last == std::string_view::npos) {
      return error(origin, {rest.text.substr(0, 1), rest.column},
                   last == 0 ? "expected '(' after " + quoted(word) : "this ( is never closed");
    }
    Token inner = trimmed({rest.text.substr(1, last - 1), rest.column + 1});
    // (f,T60,m, ...) may have a second pair of parentheses.
    if (inner.text.starts_with('(') && closing(inner.text) == inner.text.size() - 1) {
      inner = trimmed({inner.text.substr(1, inner.text.size() - 2), inner.column + 1});
    }
    if (!inner.text.empty()) {
      statement.arguments = divided(inner, ',');
    }
    rest = trimmed(behind(rest, last + 1));
  }
  if (!read_end(origin, rest)) {
    return;
  }
  if (!rest.text.starts_with(',')) {
    return error(origin, {rest.text.substr(0, 1), rest.column}, "expected ',' and a name");
  }
  statement.names = divided(behind(rest, 1), ',');
  if (word == "audioout") {  // the rest is the expression
    if (statement.names.size() < 2) {
      return error(origin, rest, "expected audioout,name,signal;");
    }
    const Token& first = statement.names[1];
    const auto skipped = static_cast<std::size_t>(first.column - rest.column);
    statement.arguments = {trimmed(behind(rest, skipped))};
    statement.names.resize(1);
  }
  statements.push_back(std::move(statement));
}

void SamLines::read_definition(const Origin& origin, const Token& rest) {
  const std::size_t equals = rest.text.find('=');
  const Token head =
      trimmed({rest.text.substr(0, std::min(equals, rest.text.size())), rest.column});
  const std::size_t length = word_length(head.text);
  const Token name{head.text.substr(0, length), head.column};
  Token arguments = trimmed(behind(head, length));
  const bool has_arguments = arguments.text.starts_with('(') && arguments.text.ends_with(')');
  if (equals == std::string_view::npos || !is_identifier(name.text) ||
      (!arguments.text.empty() && !has_arguments)) {
    return error(origin, head, "expected name=expression;");
  }
  if (is_reserved(name.text)) {
    return error(origin, name, quoted(name.text) + " is a reserved name");
  }
  const auto [found, is_new] = lines_.try_emplace(std::string(name.text));
  if (!is_new) {
    return error(origin, name,
                 quoted(name.text) + " is already defined in line " +
                     std::to_string(found->second.origin.line));
  }
  if (lines_.size() > most_parameters) {
    return error(origin, name,
                 "a model has at most " + std::to_string(most_parameters) + " definitions");
  }
  SamDefinition& line = found->second;
  line.origin = origin;
  line.expression = trimmed(behind(rest, equals + 1));
  if (has_arguments) {
    line.arguments =
        divided({arguments.text.substr(1, arguments.text.size() - 2), arguments.column + 1}, ',');
  }
  order_.push_back(found->first);
}

}  // namespace ressort::model
