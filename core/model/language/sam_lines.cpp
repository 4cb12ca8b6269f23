#include "core/model/language/sam_lines.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "core/model/language/expression.h"

namespace ressort::model {
namespace {

constexpr std::string_view faust_functions[] = {"sqrt", "abs", "sin", "cos",
                                                "exp",  "pow", "min", "max"};
constexpr std::string_view elements[] = {
    "mass",           "ground",    "port",         "resonators",        "link",
    "touch",          "pluck",     "waveguide",    "termination",       "junction",
    "pulseTouch",     "resonator", "detent",       "pulseTouchGeneral", "pulseTouchTable",
    "massCA",         "linkCA",    "BUT",          "display",           "softeninglink",
    "stiffeninglink", "audioout",  "controladjust"};

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

Token behind(const Token& token, std::size_t count) {
  return {token.text.substr(count), token.column + static_cast<int>(count)};
}

// Returns the offset of the ')' that closes the '(' at the start, or npos.
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

}  // namespace

std::size_t word_length(std::string_view text) {
  return static_cast<std::size_t>(std::find_if_not(text.begin(), text.end(), is_of_a_name) -
                                  text.begin());
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
           (next == '(' &&
            std::find(std::begin(elements), std::end(elements), word) != std::end(elements));
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
  for (auto& [name, line] : lines_) {
    if (!line.is_parameter && !line.is_read) {
      named(line.origin, {name, line.origin.column},
            0);  // report errors in unused definitions, too
    }
  }
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
    rest = behind(rest, 1);
    return read_end(origin, rest) ? read_definition(origin, rest) : void();
  }
  if (std::find(std::begin(elements), std::end(elements), word) == std::end(elements)) {
    return error(origin, word.empty() ? line : statement.word,
                 "expected an element of Synth-A-Modeler, found " +
                     quoted(word.empty() ? line.text : word) + suggestion(word, elements));
  }
  const bool has_arguments = word != "audioout" && word != "controladjust";
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

// Reads hslider("label", start, least, most, step), vslider or nentry.
bool SamLines::read_slider(const Origin& origin, const Token& token, double& start) {
  const std::string_view word = token.text.substr(0, word_length(token.text));
  const Token rest = trimmed(behind(token, word.size()));
  if ((word != "hslider" && word != "vslider" && word != "nentry") || !rest.text.starts_with('(')) {
    return false;
  }
  const std::size_t last = closing(rest.text);
  if (last == std::string_view::npos) {
    error(origin, {rest.text.substr(0, 1), rest.column}, "this ( is never closed");
    return true;
  }
  const std::vector<Token> parts = divided({rest.text.substr(1, last - 1), rest.column + 1}, ',');
  if (parts.size() != 5 || !parse_number(parts[1].text, start)) {
    error(origin, parts[std::min<std::size_t>(1, parts.size() - 1)],
          "expected " + std::string(word) +
              "(\"label\", start, least, most, step), the start a number");
  } else if (last + 1 != rest.text.size()) {
    error(origin, trimmed(behind(rest, last + 1)),
          "FAUST code after a slider is not supported: remove it");
  }
  return true;
}

void SamLines::read_definition(const Origin& origin, const Token& rest) {
  const std::size_t equals = rest.text.find('=');
  const Token name =
      trimmed({rest.text.substr(0, std::min(equals, rest.text.size())), rest.column});
  if (equals == std::string_view::npos || !is_identifier(name.text)) {
    return error(origin, name,
                 "FAUST code is not supported, except sliders and arithmetic: expected "
                 "name=hslider(\"label\",start,least,most,step); or name=number;");
  }
  if (name.text == "fs" || name.text == "PI" || name.text == "clamp" ||
      std::find(std::begin(faust_functions), std::end(faust_functions), name.text) !=
          std::end(faust_functions)) {
    return error(origin, name, quoted(name.text) + " is a reserved name");
  }
  const auto [found, is_new] = lines_.try_emplace(std::string(name.text));
  if (!is_new) {
    return error(origin, name,
                 quoted(name.text) + " is already defined in line " +
                     std::to_string(found->second.origin.line));
  }
  SamDefinition& line = found->second;
  line.origin = origin;
  if (lines_.size() > most_parameters) {
    line.is_read = true;
    line.text = "0";
    return error(origin, name,
                 "a model has at most " + std::to_string(most_parameters) + " definitions");
  }
  line.expression = trimmed(behind(rest, equals + 1));
  double start = 0.0;
  line.is_parameter =
      read_slider(origin, line.expression, start) || parse_number(line.expression.text, start);
  if (line.is_parameter) {
    line.text = found->first;
    parameters.push_back(found->first);
    values.push_back(start);
    parameter_lines.push_back(origin);
  }
}

std::string SamLines::named(const Origin& line, const Token& name, int depth) {
  SamDefinition& found = lines_.find(std::string(name.text))->second;
  if (found.is_parameter || found.is_read) {
    return found.text;
  }
  if (found.is_open || depth >= deepest_expression) {
    error(line, name,
          quoted(name.text) + (found.is_open ? " is defined in terms of itself"
                                             : " depends on more than 50 definitions in a row"));
    return "0";
  }
  found.is_open = true;
  found.text = expression(found.origin, found.expression, depth + 1);
  found.is_open = false;
  found.is_read = true;
  return found.text;
}

std::string SamLines::expression(const Origin& line, const Token& token, int depth) {
  std::string text;
  std::vector<bool> delays;  // [open parenthesis] belongs to a simpleStringTermDelay
  for (Token rest = token; !rest.text.empty();) {
    const char c = rest.text[0];
    std::size_t length = 1;
    if (std::isdigit(static_cast<unsigned char>(c)) != 0 || c == '.') {
      length = number_length(rest.text);
      text += rest.text.substr(0, length);
    } else if (is_of_a_name(c)) {
      length = word_length(rest.text);
      const Token word{rest.text.substr(0, length), rest.column};
      const Token next = trimmed(behind(rest, length));
      if (word.text == "simpleStringTermDelay" && next.text.starts_with('(')) {
        text += "(0.5/(";
        delays.push_back(true);
        length = static_cast<std::size_t>(next.column - rest.column) + 1;
      } else if (word.text == "fs") {
        text += "44100";
      } else if (word.text == "PI") {
        text += "3.141592653589793";
      } else if (std::find(std::begin(faust_functions), std::end(faust_functions), word.text) !=
                 std::end(faust_functions)) {
        text += word.text;
      } else if (lines_.contains(std::string(word.text))) {
        text += "(" + named(line, word, depth) + ")";
      } else {
        error(line, word,
              "found " + quoted(word.text) +
                  " where a number, a slider or a constant was expected; other FAUST code is "
                  "not supported" +
                  suggestion(word.text, parameters));
        return "0";
      }
    } else if (c == '(') {
      text += c;
      delays.push_back(false);
    } else if (c == ')') {
      text += !delays.empty() && delays.back() ? "))" : ")";
      if (!delays.empty()) {
        delays.pop_back();
      }
    } else if (c == ':' && trimmed(behind(rest, 1)).text.starts_with("float")) {
      length = static_cast<std::size_t>(trimmed(behind(rest, 1)).column - rest.column) + 5;
    } else if (is_space(c) || std::string_view("+-*/,").find(c) != std::string_view::npos) {
      text += c;
    } else {
      error(line, {rest.text.substr(0, 1), rest.column},
            "found " + quoted(rest.text.substr(0, 1)) +
                " in a number; FAUST code is not supported, except arithmetic");
      return "0";
    }
    rest = behind(rest, length);
    if (text.size() > longest_expression) {
      break;  // tidy() reports it
    }
  }
  return tidy(line, token, text);
}

std::string SamLines::tidy(const Origin& line, const Token& token, const std::string& text) {
  spent_ += text.size();
  if (text.size() > longest_expression || spent_ > max_model_bytes) {
    error(line, token, "with all definitions inserted, this expression is too long");
    return "0";
  }
  const auto formula = parse_expression(text, parameters);
  if (!formula) {
    error(line, token, formula.error().message);
    return "0";
  }
  if (!is_constant(*formula)) {
    return print_expression(*formula, parameters);
  }
  const double number = evaluate(*formula, {});
  if (!std::isfinite(number)) {
    error(line, token, quoted(token.text) + " is not a finite number");
    return "0";
  }
  return print_number(number);
}

double SamLines::value(const std::string& text) const {
  const auto formula = parse_expression(text, parameters);
  return formula ? evaluate(*formula, values) : 0.0;
}

}  // namespace ressort::model
