// core/model: the statements of a Synth-A-Modeler text, and the arithmetic in their arguments.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/language/synth_a_modeler.h"
#include "core/model/language/tokens.h"

namespace ressort::model {

// `word(arguments),names;`, or `audioout,name,expression;`, whose one argument is the expression.
struct Statement {
  Origin origin;
  Token word;
  std::vector<Token> arguments;
  std::vector<Token> names;
};

// `faustcode: name = expression;`
struct FaustLine {
  Origin origin;
  Token expression;
  bool is_parameter = false;
  bool is_open = false;  // it is being read: what it is made of must not need it
  bool is_read = false;
  std::string text;  // in our language, once it is read
};

inline constexpr std::size_t longest_expression = 10000;  // bytes, all definitions put in
inline constexpr int deepest_expression = 50;

// How long the word, or the number, at the start of the text is.
std::size_t word_length(std::string_view text);
std::size_t number_length(std::string_view text);

// Divided at `mark`, as far as it stands in no parentheses and no quotes.
std::vector<Token> divided(const Token& token, char mark);
Token trimmed(Token token);

// Reads lines, and keeps what all of them define.
class FaustLines {
 public:
  void read(std::string_view text, const Progress& progress);

  // An expression of parameters and numbers, in our language; "0" where it is none, which is told.
  std::string expression(const Origin& line, const Token& token) {
    return expression(line, token, 0);
  }
  // The same of a text in our language, as short as it gets.
  std::string tidy(const Origin& line, const Token& token, const std::string& text);
  // Its value with the parameters as they start.
  double value(const std::string& text) const;
  bool is_number_name(const std::string& name) const { return lines_.contains(name); }

  bool is_full() const;  // more errors are not told
  void say(Severity severity, const Origin& line, const Token& token, std::string message);
  void error(const Origin& line, const Token& token, std::string message) {
    say(Severity::error, line, token, std::move(message));
  }
  void warning(const Origin& line, const Token& token, std::string message) {
    say(Severity::warning, line, token, std::move(message));
  }

  std::vector<Statement> statements;
  std::vector<std::string> parameters;  // names, in the order of the lines
  std::vector<double> values;           // of the parameters
  std::vector<Origin> parameter_lines;
  std::vector<Diagnostic> diagnostics;

 private:
  std::string expression(const Origin& line, const Token& token, int depth);
  std::string named(const Origin& line, const Token& name, int depth);
  void read_line(std::string_view line, int number);
  void read_definition(const Origin& origin, const Token& rest);
  bool read_end(const Origin& origin, Token& rest);
  bool read_slider(const Origin& origin, const Token& token, double& start);

  std::map<std::string, FaustLine> lines_;  // by the name that they define
  std::size_t spent_ = 0;                   // bytes of expressions
  int errors_ = 0;
  int warnings_ = 0;
};

}  // namespace ressort::model
