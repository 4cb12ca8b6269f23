#include "core/model/mdl.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <optional>
#include <unordered_map>

#include "core/model/expression.h"
#include "core/model/topology.h"

namespace ressort {
namespace {

enum class Element {
  parameter,
  audio_parameter,
  ground,
  mass,
  oscillator,
  macro,
  position_input,
  force_input,
  position_output,
  force_output,
  link,
};

// Everything that tells one keyword from another. The reader, its messages and its suggestions
// have no other list.
struct Keyword {
  std::string_view word;
  Element element;
  LinkKind link;               // of Element::link
  int references;              // of masses, before the arguments
  int least;                   // arguments
  int most;                    // arguments, without a drawing
  int first;                   // links: which of Link::arguments the first argument is
  bool drawable;               // may be followed by GROUP X Y
  std::string_view arguments;  // as a person writes them
  MacroKind macro{};           // of Element::macro
};

using E = Element;
using L = LinkKind;
// clang-format off
constexpr Keyword keywords[] = {
    {"param",              E::parameter,       {},                  0, 1, 1, 0, false, "VALUE"},
    {"audioParam",         E::audio_parameter, {},                  0, 1, 1, 0, false, "@inN"},
    {"ground",             E::ground,          {},                  0, 1, 1, 0, true,  "POSITION"},
    {"mass",               E::mass,            {},                  0, 3, 4, 0, true,  "M [G] POSITION MOTION"},
    {"massG",              E::mass,            {},                  0, 4, 4, 0, true,  "M G POSITION MOTION"},
    {"osc",                E::oscillator,      {},                  0, 5, 6, 0, true,  "M K Z [G] POSITION MOTION"},
    {"cel",                E::oscillator,      {},                  0, 5, 6, 0, true,  "M K Z [G] POSITION MOTION"},
    {"string",             E::macro,           {},                  0, 5, 7, 0, false, "N M K Z [ZO] POSITION [MOTION]", MacroKind::string},
    {"chain",              E::macro,           {},                  0, 5, 7, 0, false, "N M K Z [ZO] POSITION [MOTION]", MacroKind::chain},
    {"stiffString",        E::macro,           {},                  0, 6, 8, 0, false, "N M K K2 Z [ZO] POSITION [MOTION]", MacroKind::stiff_string},
    {"mesh",               E::macro,           {},                  0, 6, 8, 0, false, "LENGTH WIDTH M K Z [ZO] POSITION [MOTION]", MacroKind::mesh},
    {"closedMesh",         E::macro,           {},                  0, 6, 8, 0, false, "LENGTH WIDTH M K Z [ZO] POSITION [MOTION]", MacroKind::closed_mesh},
    {"cornerMesh",         E::macro,           {},                  0, 6, 8, 0, false, "LENGTH WIDTH M K Z [ZO] POSITION [MOTION]", MacroKind::corner_mesh},
    {"posInput",           E::position_input,  {},                  0, 1, 1, 0, true,  "POSITION"},
    {"frcInput",           E::force_input,     {},                  1, 0, 0, 0, false, "@MASS"},
    {"forceInput",         E::force_input,     {},                  1, 0, 0, 0, false, "@MASS"},
    {"posOutput",          E::position_output, {},                  1, 0, 0, 0, false, "@MASS"},
    {"frcOutput",          E::force_output,    {},                  1, 0, 0, 0, false, "@MASS"},
    {"spring",             E::link,            L::spring,           2, 1, 2, 0, false, "@A @B K [Z]"},
    {"springDamper",       E::link,            L::spring,           2, 1, 2, 0, false, "@A @B K [Z]"},
    {"springDamperDamper", E::link,            L::spring,           2, 1, 2, 0, false, "@A @B K [Z]"},
    {"damper",             E::link,            L::spring,           2, 1, 1, 1, false, "@A @B Z"},
    {"nlSpring",           E::link,            L::quadratic_spring, 2, 3, 3, 0, false, "@A @B K Q Z"},
    {"nlSpring2",          E::link,            L::quadratic_spring, 2, 3, 3, 0, false, "@A @B K Q Z"},
    {"nlSpring3",          E::link,            L::cubic_spring,     2, 3, 3, 0, false, "@A @B K Q Z"},
    {"nlSpringDamper",     E::link,            L::clipped_spring,   2, 4, 4, 0, false, "@A @B S C K Z"},
    {"nlPluck",            E::link,            L::pluck,            2, 2, 3, 0, false, "@A @B K SCALE [Z]"},
    {"nlBow",              E::link,            L::bow,              2, 2, 3, 0, false, "@A @B Z SCALE [SMOOTH]"},
    {"contact",            E::link,            L::contact,          2, 2, 3, 0, false, "@A @B K Z [THRESHOLD]"},
    {"detent",             E::link,            L::contact,          2, 2, 3, 0, false, "@A @B K Z [THRESHOLD]"},
    {"nlContact",          E::link,            L::clipped_contact,  2, 4, 5, 0, false, "@A @B S C K Z [THRESHOLD]"},
};
// clang-format on

constexpr double least_mass = 1e-300;  // a smaller one has no finite inverse
constexpr std::size_t most_diagnostics = 100;
constexpr std::size_t most_suggestions = 2000;  // names looked at; no suggestion is worth a wait

struct Token {
  std::string_view text;
  int column = 0;
};

struct Line {
  int number = 0;
  const Keyword* keyword = nullptr;
  Token label;             // without its '@'
  Token word;              // the keyword as written
  std::string_view group;  // of the display block around it; empty if there is none
  std::vector<Token> rest;
  std::vector<Token> coordinates;  // of macros that are referred to without brackets, in MIMS
};

bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\f' || c == '\v';
}

bool is_identifier(std::string_view text) {
  return !text.empty() && std::isdigit(static_cast<unsigned char>(text[0])) == 0 &&
         std::all_of(text.begin(), text.end(), [](char c) {
           return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
         });
}

// Tokens are divided by blanks; [...] and '...' hold together; '#' starts a comment.
std::vector<Token> split(std::string_view line) {
  std::vector<Token> tokens;
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
      while (at < line.size() && !is_blank(line[at]) && line[at] != '#' && line[at] != '[') {
        ++at;
      }
    }
    tokens.push_back({line.substr(start, at - start), static_cast<int>(start) + 1});
  }
  return tokens;
}

// What stands between [ ] or ' ', or the token itself.
Token unwrapped(Token token) {
  const std::string_view text = token.text;
  if (text.size() >= 2 && ((text.front() == '[' && text.back() == ']') ||
                           (text.front() == '\'' && text.back() == '\''))) {
    return {text.substr(1, text.size() - 2), token.column + 1};
  }
  return token;
}

// How many letters have to change to get from one word to the other (Levenshtein).
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

// The nearest of `names`, as "; did you mean 'x'?", or nothing when none is near.
template <class Names>
std::string suggestion(std::string_view word, const Names& names, std::string_view prefix = "") {
  std::string_view best;
  std::size_t least = word.size() / 3 + 2;
  if (word.size() > 64) {
    return "";
  }
  std::size_t looked_at = 0;
  for (std::string_view name : names) {
    if (++looked_at > most_suggestions) {
      break;
    }
    const std::size_t far = distance(word, name);
    if (far < least) {
      least = far;
      best = name;
    }
  }
  return best.empty() ? "" : "; did you mean '" + std::string(prefix) + std::string(best) + "'?";
}

std::string quoted(std::string_view text) {
  std::string shown = "'";
  for (const char c : text.substr(0, 40)) {
    shown += std::isprint(static_cast<unsigned char>(c)) != 0 ? c : '?';
  }
  return shown + (text.size() > 40 ? "...'" : "'");
}

class Reader {
 public:
  ParsedNetwork read(std::string_view text);

 private:
  void read_line(std::string_view line, int number);
  void declare(const Line& line);
  void build(Line& line);
  void take_coordinates(Line& line);

  void add_mass(const Line& line);
  void add_macro(const Line& line);
  std::uint32_t size(const Line& line, std::size_t at, std::uint32_t least);
  void add_link(Line& line);
  void add_input(Line& line);
  void add_output(Line& line);

  bool check_count(const Line& line);
  std::uint32_t drawing(const Line& line, std::size_t at);
  ArgumentId argument(const Line& line, std::size_t at);
  void read_gravity(const Line& line, Mass& mass, std::size_t& at);
  bool position(const Line& line, std::size_t at, double& z, double& x, double& y);
  double state(const Line& line, std::size_t at);
  int audio_input(const Line& line);
  void read_block(const std::vector<Token>& tokens, int number);
  std::string with_slash(std::string_view text) const;
  std::optional<std::uint32_t> reference(Line& line, std::size_t at);
  std::optional<std::uint32_t> tap(const Line& line, const Token& token, const Token& label,
                                   std::vector<Token> coordinates);
  ArgumentId expression(const Line& line, const Token& token);
  std::optional<int> channel(const Line& line, std::string_view prefix);
  void decide_third_argument();
  void look_over();

  void say(Severity severity, int line, const Token& token, std::string message) {
    if (out_.diagnostics.size() > most_diagnostics) {
      return;
    }
    if (out_.diagnostics.size() == most_diagnostics) {
      out_.diagnostics.push_back({Severity::error, line, token.column, 1,
                                  "too many problems; those after this are not told"});
      return;
    }
    out_.diagnostics.push_back({severity, line, token.column,
                                std::max(1, static_cast<int>(token.text.size())),
                                std::move(message)});
  }
  void error(const Line& line, const Token& token, std::string message) {
    say(Severity::error, line.number, token, std::move(message));
  }
  void warning(const Line& line, const Token& token, std::string message) {
    say(Severity::warning, line.number, token, std::move(message));
  }

  // Channels are numbered by hand; one that is left out is silent.
  template <class Channels>
  void tell_gaps(const Channels& channels, std::string_view name) {
    int last = 0;
    std::vector<int> numbers;
    for (const auto& channel : channels) {
      numbers.push_back(channel.number);
      last = std::max(last, channel.number);
    }
    for (int number = 1; number < last; ++number) {
      if (std::find(numbers.begin(), numbers.end(), number) == numbers.end()) {
        say(Severity::warning, channels.front().place.line, {name, channels.front().place.column},
            "there is @" + std::string(name) + std::to_string(last) + ", but no @" +
                std::string(name) + std::to_string(number));
      }
    }
  }

  ParsedNetwork out_;
  std::vector<Line> lines_;
  std::vector<std::string> parameter_names_;
  std::unordered_map<std::string_view, std::uint32_t> masses_;  // label -> index
  std::unordered_map<std::string_view, std::uint32_t> macros_;  // label -> index
  std::vector<const Keyword*> macro_keywords_;                  // [macro]
  std::vector<std::uint32_t> resting_;                          // macros without a velocity
  std::uint64_t nodes_ = 0;                                     // of all macros
  std::unordered_map<std::string_view, int> labels_;            // every label -> its line
  std::unordered_map<std::string_view, ArgumentId> arguments_;  // text -> index
  std::vector<std::string_view> groups_;  // of the display blocks that are open
  bool shows_velocity_ = false;           // the file uses a form that only MIMS4Max has
  bool shows_delayed_ = false;            // the file uses a form that only MIMS has
};

ParsedNetwork Reader::read(std::string_view text) {
  if (text.size() > max_model_bytes) {
    say(Severity::error, 1, {"", 1},
        "the model is " + std::to_string(text.size() >> 20) + " MiB long; at most " +
            std::to_string(max_model_bytes >> 20) + " MiB are read");
    return std::move(out_);
  }
  if (text.starts_with("\xef\xbb\xbf")) {
    text.remove_prefix(3);  // the mark that some editors put before UTF-8
  }
  const std::size_t zero = text.find('\0');
  if (zero != std::string_view::npos) {
    const auto before = text.substr(0, zero);
    const auto line = std::count(before.begin(), before.end(), '\n') + 1;
    const std::size_t start = before.rfind('\n');
    say(Severity::error, static_cast<int>(line),
        {"", static_cast<int>(start == std::string_view::npos ? zero + 1 : zero - start)},
        "found a zero byte: this is no text, so it is no model");
    return std::move(out_);
  }
  int number = 0;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of("\r\n"), text.size());
    read_line(text.substr(0, end), ++number);
    const bool pair = end + 1 < text.size() && text[end] == '\r' && text[end + 1] == '\n';
    text.remove_prefix(std::min(text.size(), end + (pair ? 2 : 1)));
  }
  // Declarations first: a line may refer to one that comes after it.
  for (const Line& line : lines_) {
    declare(line);
  }
  for (Line& line : lines_) {
    if (out_.diagnostics.size() > most_diagnostics) {
      break;
    }
    build(line);
  }
  if (lines_.empty() && out_.ok()) {
    say(Severity::error, 1, {"", 1},
        "the model is empty: expected elements such as '@m mass 1. 0. 0.'");
  }
  decide_third_argument();
  look_over();
  const auto by_number = [](const auto& a, const auto& b) { return a.number < b.number; };
  std::stable_sort(out_.network.inputs.begin(), out_.network.inputs.end(), by_number);
  std::stable_sort(out_.network.outputs.begin(), out_.network.outputs.end(), by_number);
  std::stable_sort(out_.diagnostics.begin(), out_.diagnostics.end(),
                   [](const Diagnostic& a, const Diagnostic& b) { return a.line < b.line; });
  return std::move(out_);
}

void Reader::read_line(std::string_view text, int number) {
  std::vector<Token> tokens = split(text);
  if (tokens.empty()) {
    return;
  }
  if (tokens[0].text[0] == '~') {
    return read_block(tokens, number);
  }
  Line line{.number = number, .keyword = nullptr, .label = tokens[0], .word = {}, .rest = {}};
  if (line.label.text[0] != '@') {
    return warning(line, line.label,
                   "ignored: an element starts with '@', a comment with '#', found " +
                       quoted(line.label.text));
  }
  line.label.text.remove_prefix(1);
  if (line.label.text.empty()) {
    return error(line, line.label, "expected a label right after '@'");
  }
  if (tokens.size() < 2) {
    return error(line, {"", line.label.column + static_cast<int>(line.label.text.size()) + 1},
                 "the line ends where a keyword was expected, such as 'mass' or 'springDamper'");
  }
  line.word = tokens[1];
  const auto* found = std::find_if(std::begin(keywords), std::end(keywords),
                                   [&](const Keyword& k) { return k.word == line.word.text; });
  if (found == std::end(keywords)) {
    std::vector<std::string_view> words;
    for (const Keyword& keyword : keywords) {
      words.push_back(keyword.word);
    }
    return error(line, line.word,
                 "unknown keyword " + quoted(line.word.text) + suggestion(line.word.text, words));
  }
  line.keyword = found;
  line.group = groups_.empty() ? std::string_view() : groups_.back();
  line.rest.assign(tokens.begin() + 2, tokens.end());
  lines_.push_back(std::move(line));
}

// ~begin NAME and ~end NAME: what is declared between them is drawn in the group NAME.
void Reader::read_block(const std::vector<Token>& tokens, int number) {
  const Line line{.number = number, .label = tokens[0]};
  const bool begins = tokens[0].text == "~begin";
  if ((!begins && tokens[0].text != "~end") || tokens.size() != 2) {
    return error(line, tokens[0], "expected '~begin NAME' or '~end NAME'");
  }
  if (begins) {
    shows_velocity_ = true;
    return groups_.push_back(tokens[1].text);
  }
  const auto found = std::find(groups_.rbegin(), groups_.rend(), tokens[1].text);
  if (found == groups_.rend()) {
    return error(line, tokens[1], "no block " + quoted(tokens[1].text) + " is open here");
  }
  groups_.erase(std::next(found).base());
}

// Enters a line's label, and the value of a parameter.
void Reader::declare(const Line& line) {
  const auto [entry, is_new] = labels_.try_emplace(line.label.text, line.number);
  if (!is_new) {
    const std::string where = "'@" + std::string(line.label.text) +
                              "' is already declared in line " + std::to_string(entry->second);
    if (line.keyword->element != Element::link) {
      return error(line, line.label, where);
    }
    warning(line, line.label, where + "; both links are kept");
  }
  Network& network = out_.network;
  switch (line.keyword->element) {
    case Element::parameter:
    case Element::audio_parameter: {
      if (!is_identifier(line.label.text)) {
        error(line, line.label, "a parameter's name has letters, digits and '_' only");
      }
      Parameter parameter{.name = std::string(line.label.text),
                          .value = 0.0,
                          .place = {line.number, line.label.column}};
      if (!check_count(line)) {
        // It has been told.
      } else if (line.keyword->element == Element::audio_parameter) {
        parameter.audio_input = audio_input(line);
      } else if (!parse_number(line.rest[0].text, parameter.value)) {
        error(line, line.rest[0],
              "found " + quoted(line.rest[0].text) +
                  " where the parameter's value, a number, was expected");
      }
      parameter_names_.push_back(parameter.name);
      network.parameters.push_back(std::move(parameter));
      break;
    }
    case Element::ground:
    case Element::mass:
    case Element::oscillator:
    case Element::position_input:
      masses_.emplace(line.label.text, static_cast<std::uint32_t>(network.masses.size()));
      network.masses.emplace_back();
      break;
    case Element::macro:
      macros_.emplace(line.label.text, static_cast<std::uint32_t>(network.macros.size()));
      macro_keywords_.push_back(line.keyword);
      network.macros.emplace_back();
      break;
    default:
      break;
  }
}

// MIMS writes the place on a macro behind all other arguments: u, or u:v for a mesh.
void Reader::take_coordinates(Line& line) {
  std::size_t count = 0;
  for (std::size_t i = 0;
       i < line.rest.size() && i < static_cast<std::size_t>(line.keyword->references); ++i) {
    const std::string_view text = line.rest[i].text;
    count += text[0] == '@' && macros_.contains(text.substr(1)) ? 1 : 0;
  }
  count = std::min(
      count, line.rest.size() -
                 std::min(line.rest.size(), static_cast<std::size_t>(line.keyword->references)));
  line.coordinates.assign(line.rest.end() - static_cast<std::ptrdiff_t>(count), line.rest.end());
  line.rest.resize(line.rest.size() - count);
  shows_delayed_ |= count > 0;
}

void Reader::build(Line& line) {
  take_coordinates(line);
  const bool is_parameter = line.keyword->element == Element::parameter ||
                            line.keyword->element == Element::audio_parameter;
  if (is_parameter || !check_count(line)) {
    return;
  }
  switch (line.keyword->element) {
    case Element::link:
      return add_link(line);
    case Element::macro:
      return add_macro(line);
    case Element::position_output:
    case Element::force_output:
      return add_output(line);
    case Element::force_input:
      return add_input(line);
    case Element::position_input:
      add_input(line);
      return add_mass(line);
    default:
      return add_mass(line);
  }
}

void Reader::add_mass(const Line& line) {
  const auto found = masses_.find(line.label.text);
  Mass& mass = out_.network.masses[found->second];
  if (!mass.name.empty()) {
    return;  // a second declaration; it has been told
  }
  mass.name = std::string(line.label.text);
  mass.place = {line.number, line.label.column};
  std::size_t at = 0;
  switch (line.keyword->element) {
    case Element::ground:
      mass.kind = MassKind::ground;
      break;
    case Element::position_input:
      mass.kind = MassKind::position;
      break;
    case Element::oscillator:
      mass.kind = MassKind::oscillator;
      break;
    default:
      mass.kind = MassKind::mass;
      break;
  }
  const bool has_inertia = line.keyword->most > 1;
  if (has_inertia) {
    mass.mass = argument(line, at++);
    if (mass.kind == MassKind::oscillator) {
      mass.stiffness = argument(line, at++);
      mass.damping = argument(line, at++);
    }
    if (mass.mass != no_argument && is_constant(out_.network.arguments[mass.mass]) &&
        !(argument_value(out_.network, mass.mass, {}) > least_mass)) {
      error(line, line.rest[0], "a mass must be above 0, found " + quoted(line.rest[0].text));
    }
    read_gravity(line, mass, at);
  }
  double x = 0.0;
  double y = 0.0;
  const bool is_placed = position(line, at++, mass.position, x, y);
  if (has_inertia) {
    double unused = 0.0;
    position(line, at++, mass.third, unused, unused);
  }
  mass.drawing = drawing(line, at);
  if (mass.drawing == 0 && (is_placed || !line.group.empty())) {
    out_.network.drawings.push_back({.group = std::string(line.group), .x = x, .y = y});
    mass.drawing = static_cast<std::uint32_t>(out_.network.drawings.size());
  }
}

// MIMS writes gravity by a keyword of its own, MIMS4Max by one argument more.
void Reader::read_gravity(const Line& line, Mass& mass, std::size_t& at) {
  const bool by_keyword = line.keyword->word == "massG";
  const auto most = static_cast<std::size_t>(line.keyword->most);
  if (by_keyword) {
    shows_delayed_ = true;
    mass.gravity = argument(line, at++);
  } else if (line.rest.size() == most) {
    shows_velocity_ = true;
    mass.gravity = argument(line, at++);
    mass.gravity_per_rate = true;
  }
}

void Reader::add_macro(const Line& line) {
  Macro& macro = out_.network.macros[macros_.at(line.label.text)];
  if (!macro.name.empty()) {
    return;  // a second declaration; it has been told
  }
  macro.name = std::string(line.label.text);
  macro.kind = line.keyword->macro;
  macro.place = {line.number, line.label.column};
  const bool is_mesh = macro.kind != MacroKind::string && macro.kind != MacroKind::chain &&
                       macro.kind != MacroKind::stiff_string;
  std::size_t at = 0;
  macro.length = size(line, at++, macro.kind == MacroKind::stiff_string ? 3 : 2);
  macro.width = is_mesh ? size(line, at++, 2) : 1;
  nodes_ += node_count(macro);
  if (nodes_ > max_macro_nodes) {
    macro.length = macro.width = 2;
    error(line, line.rest[0],
          "the macros have more than " + std::to_string(max_macro_nodes) + " nodes together");
  }
  macro.mass = argument(line, at++);
  macro.stiffness = argument(line, at++);
  if (macro.kind == MacroKind::stiff_string) {
    macro.second_stiffness = argument(line, at++);
  }
  macro.damping = argument(line, at++);
  if (line.rest.size() == static_cast<std::size_t>(line.keyword->most)) {
    macro.air_damping = argument(line, at++);
  }
  double x = 0.0;
  double y = 0.0;
  bool is_placed = position(line, at++, macro.position, x, y);
  if (line.rest.size() == static_cast<std::size_t>(line.keyword->least)) {
    shows_delayed_ = true;
    resting_.push_back(macros_.at(line.label.text));
  } else {
    shows_velocity_ = true;
    double far_x = 0.0;  // the drawn line's other end
    double far_y = 0.0;
    is_placed |= position(line, at++, macro.third, far_x, far_y);
  }
  if (is_placed || !line.group.empty()) {
    out_.network.drawings.push_back({.group = std::string(line.group), .x = x, .y = y});
    macro.drawing = static_cast<std::uint32_t>(out_.network.drawings.size());
  }
}

// A count of nodes: no parameter, and no more than there may be in all.
std::uint32_t Reader::size(const Line& line, std::size_t at, std::uint32_t least) {
  const std::string_view text = line.rest[at].text;
  std::uint64_t number = 0;
  const char* const end = text.data() + text.size();
  const auto [last, failure] = std::from_chars(text.data(), end, number);
  if (failure != std::errc{} || last != end || number < least || number > max_macro_nodes) {
    error(line, line.rest[at],
          "found " + quoted(text) + " where a number of nodes from " + std::to_string(least) +
              " to " + std::to_string(max_macro_nodes) + " was expected");
    return least;
  }
  return static_cast<std::uint32_t>(number);
}

void Reader::add_link(Line& line) {
  Link link;
  link.name = std::string(line.label.text);
  link.kind = line.keyword->link;
  link.place = {line.number, line.label.column};
  const auto a = reference(line, 0);
  const auto b = reference(line, 1);
  for (std::size_t i = 2; i < line.rest.size(); ++i) {
    const std::size_t slot = static_cast<std::size_t>(line.keyword->first) + i - 2;
    if (link.kind == LinkKind::bow && slot == 2) {
      // The profile is a choice, not a quantity that could be turned while playing.
      double smooth = 0.0;
      if (!parse_number(unwrapped(line.rest[i]).text, smooth)) {
        error(line, line.rest[i], "expected 0 (piecewise) or 1 (smooth) for the bow's profile");
      }
      link.kind = smooth > 0.0 ? LinkKind::smooth_bow : LinkKind::bow;
    } else {
      link.arguments[slot] = argument(line, i);
    }
  }
  shows_velocity_ |=
      link.kind == LinkKind::clipped_contact || link.kind == LinkKind::clipped_spring ||
      (link.kind == LinkKind::contact && line.rest.size() == 4) ||
      (link.kind == LinkKind::pluck && line.rest.size() == 5) ||
      (link.kind == LinkKind::smooth_bow) || (link.kind == LinkKind::bow && line.rest.size() == 5);
  if (!a || !b) {
    return;
  }
  if (*a == *b) {
    warning(line, line.rest[1], "the link's two ends are the same mass: it has no effect");
  }
  link.a = *a;
  link.b = *b;
  out_.network.links.push_back(std::move(link));
}

void Reader::add_input(Line& line) {
  const auto number = channel(line, "in");
  const bool is_force = line.keyword->element == Element::force_input;
  const auto found = masses_.find(line.label.text);
  const auto mass = is_force                 ? reference(line, 0)
                    : found == masses_.end() ? std::nullopt
                                             : std::optional(found->second);
  if (number && mass) {
    out_.network.inputs.push_back({.number = *number,
                                   .is_force = is_force,
                                   .mass = *mass,
                                   .place = {line.number, line.label.column}});
  }
}

void Reader::add_output(Line& line) {
  const auto number = channel(line, "out");
  const auto mass = reference(line, 0);
  if (number && mass) {
    out_.network.outputs.push_back({.number = *number,
                                    .is_force = line.keyword->element == Element::force_output,
                                    .mass = *mass,
                                    .place = {line.number, line.label.column}});
  }
}

// The N of the argument "@inN".
int Reader::audio_input(const Line& line) {
  Line asked = line;
  asked.label = line.rest[0];
  if (asked.label.text[0] == '@') {
    asked.label.text.remove_prefix(1);
  }
  return channel(asked, "in").value_or(0);
}

bool Reader::check_count(const Line& line) {
  const Keyword& keyword = *line.keyword;
  const int found = static_cast<int>(line.rest.size());
  const int least = keyword.references + keyword.least;
  const int most = keyword.references + keyword.most;
  const bool drawn = keyword.drawable && found == least + 3;
  if ((found >= least && found <= most) || drawn) {
    return true;
  }
  Token place;
  if (found > most) {
    place = line.rest[static_cast<std::size_t>(most)];
  } else {
    const Token& last = found == 0 ? line.word : line.rest.back();
    place = {"", last.column + static_cast<int>(last.text.size())};
  }
  error(line, place,
        "'" + std::string(keyword.word) + "' takes " + std::to_string(least) +
            (most > least ? " to " + std::to_string(most) : "") +
            (most == 1 ? " argument (" : " arguments (") + std::string(keyword.arguments) +
            "), found " + std::to_string(found));
  return false;
}

std::uint32_t Reader::drawing(const Line& line, std::size_t at) {
  if (line.rest.size() < at + 3) {
    return 0;
  }
  shows_delayed_ = true;
  Drawing drawing{
      .group = std::string(line.rest[at].text), .x = state(line, at + 1), .y = state(line, at + 2)};
  out_.network.drawings.push_back(std::move(drawing));
  return static_cast<std::uint32_t>(out_.network.drawings.size());
}

// The text with the '/' that one editor deletes put back: "sqrt(kScale3)" is "sqrt(kScale/3)" where
// kScale is a parameter and kScale3 is none. Empty where there is nothing to put back.
std::string Reader::with_slash(std::string_view text) const {
  std::size_t at = 0;
  while (at < text.size()) {
    std::size_t end = at;
    while (end < text.size() &&
           (std::isalnum(static_cast<unsigned char>(text[end])) != 0 || text[end] == '_')) {
      ++end;
    }
    const std::string_view word = text.substr(at, end - at);
    for (const std::string& name : parameter_names_) {
      const bool is_followed = word.size() > name.size() && word.starts_with(name) &&
                               std::all_of(word.begin() + static_cast<std::ptrdiff_t>(name.size()),
                                           word.end(), [](char c) { return c >= '0' && c <= '9'; });
      if (is_followed && std::find(parameter_names_.begin(), parameter_names_.end(), word) ==
                             parameter_names_.end()) {
        const std::size_t cut = at + name.size();
        return std::string(text.substr(0, cut)) + "/" + std::string(text.substr(cut));
      }
    }
    at = std::max(end, at + 1);
  }
  return "";
}

ArgumentId Reader::argument(const Line& line, std::size_t at) {
  return expression(line, unwrapped(line.rest[at]));
}

ArgumentId Reader::expression(const Line& line, const Token& token) {
  const auto known = arguments_.find(token.text);
  if (known != arguments_.end()) {
    return known->second;
  }
  Formula formula;
  double number = 0.0;
  if (parse_number(token.text, number)) {
    formula.push_back({Op::number, 0, number});
  } else {
    auto parsed = parse_expression(token.text, parameter_names_);
    if (!parsed) {
      const std::string repaired = with_slash(token.text);
      parsed = repaired.empty() ? std::move(parsed) : parse_expression(repaired, parameter_names_);
      if (parsed) {
        warning(
            line, token,
            "a '/' is missing, as MIMS4Max loses the first of a file; read as " + quoted(repaired));
      }
    }
    if (!parsed) {
      const Token place{token.text, token.column + parsed.error().column - 1};
      std::string hint;
      if (is_identifier(token.text)) {
        hint = suggestion(token.text, parameter_names_);
      }
      error(line, place, parsed.error().message + hint);
      return no_argument;
    }
    formula = *std::move(parsed);
  }
  if (is_constant(formula) && !std::isfinite(evaluate(formula, {}))) {
    error(line, token, quoted(token.text) + " is no finite number");
  }
  const auto id = static_cast<ArgumentId>(out_.network.arguments.size());
  out_.network.arguments.push_back(std::move(formula));
  arguments_.emplace(token.text, id);
  return id;
}

// A scalar, or [x y z] of which z swings and x and y are for drawing; true if there was an x and y.
bool Reader::position(const Line& line, std::size_t at, double& z, double& x, double& y) {
  const Token& token = line.rest[at];
  if (token.text[0] != '[') {
    z = state(line, at);
    return false;
  }
  shows_velocity_ = true;
  const Token inner = unwrapped(token);
  const std::vector<Token> parts = split(inner.text);
  double* const targets[] = {&x, &y, &z};
  if (parts.size() != 3) {
    error(line, token,
          "a place is one number or three, [x y z]; found " + std::to_string(parts.size()));
    return false;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    if (!parse_number(parts[i].text, *targets[i])) {
      error(line, {parts[i].text, inner.column + parts[i].column - 1},
            "found " + quoted(parts[i].text) + " where a number was expected");
    }
  }
  return true;
}

double Reader::state(const Line& line, std::size_t at) {
  double number = 0.0;
  if (!parse_number(line.rest[at].text, number)) {
    error(line, line.rest[at],
          "found " + quoted(line.rest[at].text) + " where a number was expected" +
              (is_identifier(line.rest[at].text) ? " (a starting state is no parameter)" : ""));
  }
  return number;
}

std::optional<std::uint32_t> Reader::reference(Line& line, std::size_t at) {
  const Token token = line.rest[at];
  if (token.text[0] == '[') {
    shows_velocity_ = true;
    const Token inner = unwrapped(token);
    std::vector<Token> parts = split(inner.text);
    for (Token& part : parts) {
      part.column += inner.column - 1;
    }
    if (!parts.empty() && parts[0].text[0] == '@') {
      const Token label = parts[0];
      parts.erase(parts.begin());
      return tap(line, token, label, std::move(parts));
    }
  }
  if (token.text[0] == '@' && macros_.contains(token.text.substr(1))) {
    std::vector<Token> coordinates;
    if (!line.coordinates.empty()) {
      const Token both = line.coordinates.front();
      line.coordinates.erase(line.coordinates.begin());
      const std::size_t colon = both.text.find(':');
      coordinates.push_back({both.text.substr(0, colon), both.column});
      if (colon != std::string_view::npos) {
        coordinates.push_back(
            {both.text.substr(colon + 1), both.column + static_cast<int>(colon) + 1});
      }
    }
    return tap(line, token, token, std::move(coordinates));
  }
  if (token.text[0] != '@') {
    error(line, token,
          "found " + quoted(token.text) + " where '@' and the label of a mass were expected");
    return std::nullopt;
  }
  const std::string_view name = token.text.substr(1);
  const auto found = masses_.find(name);
  if (found != masses_.end()) {
    return found->second;
  }
  std::vector<std::string_view> names;
  for (const Line& other : lines_) {
    if (names.size() < most_suggestions && masses_.contains(other.label.text)) {
      names.push_back(other.label.text);
    }
  }
  error(line, token,
        labels_.contains(name)
            ? quoted(token.text) + " is no mass, so nothing can be attached to it"
            : "no mass is called " + quoted(token.text) + suggestion(name, names, "@"));
  return std::nullopt;
}

// A place on a macro: one coordinate on a string, which may be written with blanks in it, two on a
// mesh.
std::optional<std::uint32_t> Reader::tap(const Line& line, const Token& token, const Token& label,
                                         std::vector<Token> coordinates) {
  const auto found = macros_.find(label.text.substr(1));
  if (found == macros_.end()) {
    std::vector<std::string_view> names;
    for (const auto& [name, index] : macros_) {
      names.push_back(name);
    }
    error(line, label,
          masses_.contains(label.text.substr(1))
              ? quoted(label.text) + " is one mass, so it has no places on it: write it without '['"
              : "no macro is called " + quoted(label.text) +
                    suggestion(label.text.substr(1), names, "@"));
    return std::nullopt;
  }
  const Keyword& keyword = *macro_keywords_.at(found->second);
  const bool is_mesh = keyword.arguments.starts_with("LENGTH");
  const std::size_t wanted = is_mesh ? 2 : 1;
  if (!is_mesh && coordinates.size() > 1) {
    const char* const start = coordinates.front().text.data();
    const std::string_view last = coordinates.back().text;
    const auto length = static_cast<std::size_t>(last.data() + last.size() - start);
    coordinates = {{std::string_view(start, length), coordinates.front().column}};
  }
  if (coordinates.size() != wanted) {
    error(line, token,
          quoted(label.text) + " is a " + std::string(keyword.word) + ": a place on it needs " +
              (is_mesh ? "two coordinates, [@m u v]" : "one coordinate, [@s u]") +
              ", each from 0 to 1");
    return std::nullopt;
  }
  Network& network = out_.network;
  Mass point{.kind = MassKind::point, .tap = static_cast<std::uint32_t>(network.taps.size())};
  point.place = {line.number, token.column};
  network.taps.push_back({.macro = found->second,
                          .u = expression(line, coordinates[0]),
                          .v = is_mesh ? expression(line, coordinates[1]) : no_argument});
  network.masses.push_back(std::move(point));
  return static_cast<std::uint32_t>(network.masses.size() - 1);
}

std::optional<int> Reader::channel(const Line& line, std::string_view prefix) {
  const std::string_view label = line.label.text;
  int number = 0;
  if (label.starts_with(prefix)) {
    const char* end = label.data() + label.size();
    const auto [last, failure] = std::from_chars(label.data() + prefix.size(), end, number);
    if (failure == std::errc{} && last == end && number >= 1 && number <= max_channels) {
      return number;
    }
  }
  error(line, line.label,
        "'" + std::string(line.keyword->word) + "' needs the label '@" + std::string(prefix) +
            "N' with N from 1 to " + std::to_string(max_channels) + ", found " +
            quoted("@" + std::string(label)));
  return std::nullopt;
}

// The dialects agree when the file shows which one it is in; else the state itself tells: at
// rest away from 0 is written (x, x) in one meaning and (x, 0) in the other.
void Reader::decide_third_argument() {
  Network& network = out_.network;
  const bool starts_at_zero_speed =
      std::any_of(network.masses.begin(), network.masses.end(), [](const Mass& mass) {
        return (mass.kind == MassKind::mass || mass.kind == MassKind::oscillator) &&
               mass.position != 0.0 && mass.third == 0.0;
      });
  const bool velocity = shows_velocity_ || (!shows_delayed_ && starts_at_zero_speed);
  network.third = velocity ? ThirdArgument::velocity_per_second : ThirdArgument::delayed_position;
  for (const std::uint32_t macro : resting_) {
    network.macros[macro].third = velocity ? 0.0 : network.macros[macro].position;
  }
}

// What is legal and yet hardly meant.
void Reader::look_over() {
  const Network& network = out_.network;
  if (!out_.ok()) {
    return;
  }
  if (network.masses.empty() && network.macros.empty()) {
    return say(Severity::error, 1, {"", 1}, "the model has no masses: nothing can sound");
  }
  std::vector<bool> attached(network.masses.size(), false);
  for (const Link& link : network.links) {
    attached[link.a] = attached[link.b] = true;
  }
  for (const Input& input : network.inputs) {
    attached[input.mass] = attached[input.mass] || input.is_force;
  }
  for (std::size_t i = 0; i < network.masses.size(); ++i) {
    const Mass& mass = network.masses[i];
    if (!attached[i] && mass.kind != MassKind::oscillator && mass.kind != MassKind::point) {
      say(Severity::warning, mass.place.line, {mass.name, mass.place.column},
          "nothing is attached to '@" + mass.name + "'");
    }
  }
  for (const Link& link : network.links) {
    const bool is_contact =
        link.kind == LinkKind::contact || link.kind == LinkKind::clipped_contact;
    if (is_contact && network.masses[link.a].kind == MassKind::position &&
        network.masses[link.b].kind != MassKind::position) {
      say(Severity::warning, link.place.line, {link.name, link.place.column},
          "the contact's ends look swapped: it acts while the second is below the first, here '@" +
              network.masses[link.b].name + "' below '@" + network.masses[link.a].name + "'");
    }
  }
  tell_gaps(network.inputs, "in");
  tell_gaps(network.outputs, "out");
  std::vector<bool> used(network.parameters.size(), false);
  for (const Formula& formula : network.arguments) {
    for (const Step& step : formula) {
      if (step.op == Op::parameter) {
        used[step.index] = true;
      }
    }
  }
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (!used[i]) {
      const Parameter& parameter = network.parameters[i];
      say(Severity::warning, parameter.place.line, {parameter.name, parameter.place.column},
          "the parameter '" + parameter.name + "' is used nowhere");
    }
  }
  if (network.outputs.empty()) {
    say(Severity::warning, 1, {"", 1}, "the model has no output, so it will be silent");
  }
}

}  // namespace

bool ParsedNetwork::ok() const {
  return std::none_of(diagnostics.begin(), diagnostics.end(),
                      [](const Diagnostic& d) { return d.severity == Severity::error; });
}

ParsedNetwork parse_network(std::string_view text) {
  return Reader().read(text);
}

std::string to_string(const Diagnostic& diagnostic, std::string_view file) {
  return std::string(file) + ":" + std::to_string(diagnostic.line) + ":" +
         std::to_string(diagnostic.column) +
         (diagnostic.severity == Severity::error ? ": error: " : ": warning: ") +
         diagnostic.message;
}

}  // namespace ressort
