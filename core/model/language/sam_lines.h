// core/model: parses the statements of a Synth-A-Modeler text, and the arithmetic in their
// arguments.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/language/reader.h"
#include "core/model/language/synth_a_modeler.h"

namespace ressort::model {

// `word(arguments),names;`, or `audioout,name,expression;` with the expression as its only
// argument.
struct Statement {
  Origin origin;
  Token word;
  std::vector<Token> arguments;
  std::vector<Token> names;
};

// `faustcode: name = expression;`
struct SamDefinition {
  Origin origin;
  Token expression;
  bool is_parameter = false;
  bool is_open = false;  // being resolved; detects cycles
  bool is_read = false;
  std::string text;  // text in the .mdl language, once resolved
};

inline constexpr std::size_t longest_expression = 10000;  // bytes, with all definitions inserted
inline constexpr int deepest_expression = 50;

// Return the length of the word, or the number, at the start of the text.
std::size_t word_length(std::string_view text);
std::size_t number_length(std::string_view text);

// Splits a token at `mark`, except within parentheses and quotes.
std::vector<Token> divided(const Token& token, char mark);
Token trimmed(Token token);

// Parses the lines of a text and stores their definitions.
class SamLines {
 public:
  void read(std::string_view text, const Progress& progress);

  // Translates an expression of parameters and numbers. Returns "0" after reporting an error.
  std::string expression(const Origin& line, const Token& token) {
    return expression(line, token, 0);
  }
  // Simplifies an expression in the .mdl language.
  std::string tidy(const Origin& line, const Token& token, const std::string& text);
  // Evaluates an expression with the initial values of the parameters.
  double value(const std::string& text) const;
  bool is_number_name(const std::string& name) const { return lines_.contains(name); }

  bool is_full() const { return count_.is_full(); }
  void error(const Origin& line, const Token& token, std::string message) {
    count_.report(diagnostics, Severity::error, line.line, token, std::move(message));
  }
  void warning(const Origin& line, const Token& token, std::string message) {
    count_.report(diagnostics, Severity::warning, line.line, token, std::move(message));
  }

  std::vector<Statement> statements;
  std::vector<std::string> parameters;  // names, in order of their lines
  std::vector<double> values;           // [parameter] initial value
  std::vector<Origin> parameter_lines;
  std::vector<Diagnostic> diagnostics;

 private:
  std::string expression(const Origin& line, const Token& token, int depth);
  std::string named(const Origin& line, const Token& name, int depth);
  void read_line(std::string_view line, int number);
  void read_definition(const Origin& origin, const Token& rest);
  bool read_end(const Origin& origin, Token& rest);
  bool read_slider(const Origin& origin, const Token& token, double& start);

  std::map<std::string, SamDefinition> lines_;  // definitions by name
  std::size_t spent_ = 0;                       // total bytes of expressions
  DiagnosticCount count_;
};

}  // namespace ressort::model
