// core/model: the implementation of parse_network, shared by mdl.cpp, elements.cpp, macros.cpp and
// motion.cpp.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "core/model/index_table.h"
#include "core/model/language/keywords.h"
#include "core/model/language/mdl.h"
#include "core/model/language/synth_a_modeler.h"
#include "core/model/language/tokens.h"

namespace ressort::model {

inline constexpr int most_diagnostics = 100;  // errors, and as many warnings
inline constexpr std::size_t longest_label = 1000;
inline constexpr std::size_t most_parameters = 1024;   // every expression searches all of them
inline constexpr std::size_t most_open_blocks = 1024;  // ~begin without its ~end

// Index of a line that declares no mass or macro, or repeats the label of another.
inline constexpr std::uint32_t undeclared = 0xffffffffu;

// A line of the text. To save memory, its tokens are split again whenever they are needed.
struct Entry {
  std::uint32_t at = 0;  // offset in the text, and length
  std::uint32_t length = 0;
  int number = 0;
  std::uint32_t group = 0;  // index into Reader::group_names_
  std::uint32_t element = undeclared;
  std::uint8_t keyword = 0;  // index into keywords
};

// The line that the reader works on.
struct Line {
  int number = 0;
  const Keyword* keyword = nullptr;
  Token label;             // without its '@'
  Token word;              // the keyword as written
  std::string_view group;  // name of the display block around it; empty if there is none
  std::span<const Token> rest;
  std::span<const Token> coordinates;  // coordinates of places written without brackets, as in MIMS
  std::uint32_t element = undeclared;  // the mass or macro
};

// The first line that reveals a dialect, and how: "opens a block".
struct Evidence {
  int line = 0;  // 0: none
  std::string_view what;
};

// Adds diagnostics to a list, up to most_diagnostics of either severity.
class DiagnosticCount {
 public:
  void report(std::vector<Diagnostic>& list, Severity severity, int line, const Token& token,
              std::string message) {
    int& count = severity == Severity::error ? errors_ : warnings_;
    if (++count > most_diagnostics + 1) {
      return;
    }
    if (count == most_diagnostics + 1) {
      message = severity == Severity::error ? "too many errors; stopping here"
                                            : "too many warnings; the rest are not shown";
    }
    list.push_back({severity, line, token.column, std::max(1, static_cast<int>(token.text.size())),
                    std::move(message)});
  }
  bool is_full() const { return errors_ > most_diagnostics; }

 private:
  int errors_ = 0;
  int warnings_ = 0;
};

class Reader {
 public:
  // `origins`: the source lines, if the text was translated from another language.
  explicit Reader(std::span<const Origin> origins = {}) : origins_(origins) {}

  ParsedNetwork read(std::string_view text, const ReadOptions& options);

 private:
  void read_line(std::string_view line, int number);
  Line open(const Entry& entry);
  std::string_view label_of(const Entry& entry) const;
  std::uint32_t& entry_of(std::string_view label);
  std::optional<std::uint32_t> mass_of(std::string_view label);
  std::optional<std::uint32_t> macro_of(std::string_view label);
  void declare_all();
  bool enter_label(std::uint32_t index);
  void declare(Entry& entry);
  void declare_parameter(const Line& line);
  void build(Line& line);
  void take_coordinates(Line& line);

  void add_mass(const Line& line);
  void add_macro(const Line& line);
  void name_places(const Line& line, Macro& body);
  void add_body(const Line& line, Macro& body);
  void add_mode(const Line& line);
  double displacement(const Line& line, std::size_t at);
  std::optional<double> place_called(const Macro& body, const Token& token) const;
  void add_waveguide(const Line& line, Macro& guide);
  void add_modal_string(const Line& line, Macro& string);
  ArgumentId not_negative(const Line& line, std::size_t at, const std::string& what);
  std::uint32_t size(const Line& line, std::size_t at, std::uint32_t least);
  void add_link(Line& line);
  void choose_profile(Link& link) const;
  void show_dialect(const Line& line);
  void add_input(Line& line);
  void add_output(Line& line);

  bool check_count(const Line& line);
  std::uint32_t drawing(const Line& line, std::size_t at);
  ArgumentId argument(const Line& line, std::size_t at);
  void check_mass(const Line& line, std::size_t at, ArgumentId mass);
  void read_gravity(const Line& line, Mass& mass, std::size_t& at);
  bool position(const Line& line, std::size_t at, double& z, double& x, double& y);
  double state(const Line& line, std::size_t at);
  int audio_input(const Line& line);
  void read_block(const std::vector<Token>& tokens, int number);
  std::string with_slash(std::string_view text) const;
  std::optional<std::uint32_t> reference(Line& line, std::size_t at);
  std::optional<std::uint32_t> tap(const Line& line, const Token& token, const Token& label,
                                   std::vector<Token> coordinates);
  std::optional<std::uint32_t> named_place(const Line& line, const Token& token,
                                           std::uint32_t macro, const Token& name);
  std::uint32_t add_point(const Line& line, const Token& token, Tap tap);
  ArgumentId positive(const Line& line, std::size_t at, const std::string& what);
  ArgumentId expression(const Line& line, const Token& token);
  std::optional<int> channel(const Line& line, std::string_view prefix);
  void read_motion(const Line& line, const std::vector<Token>& tokens);
  void decide_motion(const ReadOptions& options);
  void decide_by_dialect();
  void decide_by_states();
  void choose_motion(ThirdArgument third, const std::string& why);
  void warn_of_mistakes();

  void report(Severity severity, int line, const Token& token, std::string message) {
    count_.report(out_.diagnostics, severity, line, token, std::move(message));
  }
  void error(const Line& line, const Token& token, std::string message) {
    report(Severity::error, line.number, token, std::move(message));
  }
  void warning(const Line& line, const Token& token, std::string message) {
    report(Severity::warning, line.number, token, std::move(message));
  }

  static void show(Evidence& evidence, const Line& line, std::string_view what) {
    if (evidence.line == 0) {
      evidence = {line.number, what};
    }
  }

  // Warns of missing channel numbers, which are silent.
  template <class Channels>
  void warn_of_gaps(const Channels& channels, std::string_view name) {
    int last = 0;
    SourceLocation location;
    std::vector<int> numbers;
    for (const auto& channel : channels) {
      numbers.push_back(channel.number);
      if (channel.number > last) {
        last = channel.number;
        location = channel.location;
      }
    }
    const std::string label = "@" + std::string(name);
    std::ranges::sort(numbers);
    int next = 1;  // first unused number
    for (const int number : numbers) {
      if (number > next) {
        const std::string first = label + std::to_string(next);
        report(Severity::warning, location.line, {name, location.column},
               "there is " + label + std::to_string(last) + ", but " +
                   (number == next + 1
                        ? "no " + first
                        : "none of " + first + " to " + label + std::to_string(number - 1)));
      }
      next = number + 1;
    }
  }

  std::span<const Origin> origins_;  // [line - 1]
  ParsedNetwork out_;
  DiagnosticCount count_;
  std::string_view text_;
  std::vector<Entry> entries_;
  IndexTable labels_;          // table of entries
  std::vector<Token> tokens_;  // tokens of the current line
  std::vector<Token> parts_;   // tokens of a place in it
  std::vector<std::string> parameter_names_;
  std::vector<const Keyword*> macro_keywords_;                  // [macro]
  std::vector<std::uint32_t> resting_;                          // macros without a velocity
  std::uint64_t most_nodes_ = max_macro_nodes;                  // limit for all macros
  std::uint64_t nodes_ = 0;                                     // nodes of all macros
  std::unordered_map<std::string_view, ArgumentId> arguments_;  // text -> index
  std::vector<std::string_view> group_names_ = {""};            // names of all display blocks
  std::vector<std::uint32_t> groups_;                           // the open ones
  Evidence velocity_;                                           // evidence of MIMS4Max
  Evidence delayed_;                                            // evidence of MIMS
  std::optional<ThirdArgument> said_;                           // set by ~motion
  int said_line_ = 0;
};

}  // namespace ressort::model
