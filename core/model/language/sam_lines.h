// core/model: parses the statements of a Synth-A-Modeler text, and the arithmetic in their
// arguments.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
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

struct SamElement;

// A FAUST signal without delays: a sum of elements, each times an expression in the .mdl language,
// and a constant.
struct SamSignal {
  struct Part {
    const SamElement* element = nullptr;
    int derivative = 0;     // of the position: 1 is the velocity, 2 the acceleration, per sample
    bool is_force = false;  // the force on the element
    std::string level;
  };
  std::vector<Part> parts;
  std::string number = "0";

  bool is_number() const { return parts.empty(); }
};
using SamSignals = std::vector<SamSignal>;  // parallel signals

// A filter of order 1 or 2 as a mass that follows a position s: with mass 1, it has a spring to s
// and a damper to the ground. With its position y and velocity v per sample, the output is direct s
// + (gain - direct) y - lead v.
struct SamFilter {
  std::string stiffness;
  std::string damping = "1";
  std::string direct;
  std::string gain = "1";  // at 0 Hz
  std::string lead = "0";
};

// Elements that an output refers to.
struct SamSources {
  // Returns the signal of an element, or nothing after reporting an error.
  std::function<std::optional<SamSignal>(const Token& name)> heard;
  // Returns the mass that follows an element, or null if none can.
  std::function<const SamElement*(const SamElement& source, const SamFilter& filter)> follower;
};

// `faustcode: name(arguments) = expression;`
struct SamDefinition {
  Origin origin;
  Token expression;
  std::vector<Token> arguments;
  bool is_open = false;             // being evaluated; detects cycles
  std::optional<SamSignals> value;  // without an input, once evaluated
};

inline constexpr std::size_t longest_expression = 10000;  // bytes, with all definitions inserted
inline constexpr int deepest_expression = 50;

// Return the length of the word, or the number, at the start of the text.
std::size_t word_length(std::string_view text);
std::size_t number_length(std::string_view text);

Token behind(const Token& token, std::size_t count);
// Returns the offset of the ')' that closes the '(' at the start, or npos.
std::size_t closing(std::string_view text);

// Splits a token at `mark`, except within parentheses and quotes.
std::vector<Token> divided(const Token& token, char mark);
Token trimmed(Token token);

// Parses the lines of a text, stores their definitions and evaluates FAUST expressions.
class SamLines {
 public:
  void read(std::string_view text, const Progress& progress);

  // Translates an expression of parameters and numbers. Returns "0" after reporting an error.
  std::string expression(const Origin& line, const Token& token);
  // Evaluates the signal of an output named `name`.
  std::optional<SamSignal> signal(const Origin& line, const Token& token, std::string_view name,
                                  const SamSources& sources);
  // Joins two expressions by + - * / or ^. Returns a number if the result is too long.
  std::string join(const Origin& line, const Token& token, const std::string& a, char op,
                   const std::string& b);
  // Simplifies an expression in the .mdl language. Returns "0" after reporting an error.
  std::string tidy(const Origin& line, const Token& token, const std::string& text);
  // Evaluates an expression with the initial values of the parameters, times a factor.
  double value(const std::string& text, double factor = 1.0) const;
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
  struct Cursor;
  using Value = std::optional<SamSignals>;

  void define_parameters();
  Value chain(Cursor& at, bool in_list = true);
  Value list(Cursor& at);
  Value joined(Cursor& at, const char* one, const char* other, Value (SamLines::*operand)(Cursor&));
  Value sum(Cursor& at);
  Value product(Cursor& at);
  Value power(Cursor& at);
  Value primary(Cursor& at);
  Value word(Cursor& at);
  Value call(Cursor& at, const Token& name, std::vector<SamSignals> arguments);
  std::optional<std::vector<SamSignals>> arguments_of(Cursor& at);
  std::vector<SamFilter> filters(const Cursor& at, const Token& name,
                                 const std::vector<SamSignals>& arguments);
  std::optional<SamSignal> filtered(const Cursor& at, const Token& name, const SamSignal& input,
                                    const SamFilter& filter);
  Value slider(Cursor& at, const Token& word);
  Value defined(Cursor& at, const Token& name, std::vector<SamSignals> arguments);
  Value table(Cursor& at, const Token& name);
  std::string entry(const Origin& line, const Token& token, const SamSignals& list,
                    const std::string& index);
  std::string fixed(const Origin& line, const Token& token, double value);
  Value combined(const Cursor& at, const Token& sign, const Value& left, const Value& right);
  static bool is_reserved(std::string_view name);
  std::nullopt_t refuse(const Cursor& at, std::string message);
  void read_line(std::string_view line, int number);
  void read_definition(const Origin& origin, const Token& rest);
  bool read_end(const Origin& origin, Token& rest);

  std::map<std::string, SamDefinition, std::less<>> lines_;  // definitions by name
  std::vector<std::string> order_;                           // names, in order of their lines
  std::map<std::pair<int, int>, std::string> sliders_;       // parameters by line and column
  const SamSources* sources_ = nullptr;
  std::set<std::string, std::less<>> left_out_;  // functions that have caused a warning
  std::size_t spent_ = 0;                        // total bytes of expressions
  DiagnosticCount count_;
};

}  // namespace ressort::model
