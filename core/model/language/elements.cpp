// Reads the lines of masses, links, inputs and outputs.
#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>

#include "core/laws/law.h"
#include "core/model/language/expression.h"
#include "core/model/language/reader.h"
#include "core/model/topology.h"
#include "core/ranges.h"

namespace ressort::model {
namespace {

constexpr double least_mass = 1e-300;  // the inverse of a smaller mass is not finite

}  // namespace

void Reader::add_mass(const Line& line) {
  if (line.element == undeclared) {
    return;  // another element has this label; reported there
  }
  Mass& mass = out_.network.masses[line.element];
  mass.name = std::string(line.label.text);
  mass.location = {line.number, line.label.column};
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
    check_mass(line, 0, mass.mass);
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

// Reads a gravity. MIMS has a keyword for it, MIMS4Max an additional argument.
void Reader::read_gravity(const Line& line, Mass& mass, std::size_t& at) {
  const bool by_keyword = line.keyword->word == "massG";
  const auto most = static_cast<std::size_t>(line.keyword->most);
  if (by_keyword) {
    show(delayed_, line, "has 'massG'");
    mass.gravity = argument(line, at++);
  } else if (line.rest.size() == most) {
    show(velocity_, line, "gives a gravity without 'massG'");
    mass.gravity = argument(line, at++);
    mass.gravity_per_rate = true;
  }
}

// Reports a mass that is not above 0. If a parameter sets it, the compiler checks it.
void Reader::check_mass(const Line& line, std::size_t at, ArgumentId mass) {
  if (mass != no_argument && is_constant(out_.network.arguments[mass]) &&
      !(argument_value(out_.network, mass, {}) > least_mass)) {
    error(line, line.rest[at], "a mass must be above 0, found " + quoted(line.rest[at].text));
  }
}

void Reader::add_link(Line& line) {
  Link link;
  link.name = std::string(line.label.text);
  link.law = line.keyword->law;
  link.location = {line.number, line.label.column};
  const auto a = reference(line, 0);
  const auto b = reference(line, 1);
  for (std::size_t i = 2; i < line.rest.size(); ++i) {
    const std::size_t slot = static_cast<std::size_t>(line.keyword->link->first) + i - 2;
    link.arguments[slot] = argument(line, i);
  }
  if (line.keyword->word == "nlBow") {
    choose_profile(link);
  }
  show_dialect(line);
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

// Chooses the law of a bow whose profile is a constant.
void Reader::choose_profile(Link& link) const {
  ArgumentId& profile = link.arguments[2];
  if (profile == no_argument) {
    return;
  }
  const Formula& formula = out_.network.arguments[profile];
  if (!is_constant(formula)) {
    link.law = law_named("either_bow");
    return;
  }
  link.law = law_named(evaluate(formula, {}) > 0.0 ? "smooth_bow" : "bow");
  profile = no_argument;
}

// Notes a law, or a number of arguments, that only MIMS4Max has.
void Reader::show_dialect(const Line& line) {
  const LawWord& word = *line.keyword->link;
  const auto count = static_cast<int>(line.rest.size()) - line.keyword->references;
  if (word.velocity_count < 0 || (word.velocity_count > 0 && count == word.velocity_count)) {
    show(velocity_, line, word.velocity_says);
  }
}

void Reader::add_input(Line& line) {
  const auto number = channel(line, "in");
  const bool is_force = line.keyword->element == Element::force_input;
  const auto mass = is_force                     ? reference(line, 0)
                    : line.element == undeclared ? std::nullopt
                                                 : std::optional(line.element);
  if (number && mass) {
    out_.network.inputs.push_back({.number = *number,
                                   .is_force = is_force,
                                   .mass = *mass,
                                   .location = {line.number, line.label.column}});
  }
}

void Reader::add_output(Line& line) {
  const auto number = channel(line, "out");
  const bool has_level = line.rest.size() > 1;
  if (has_level && !line.coordinates.empty()) {
    return error(line, line.rest[1],
                 "an output with a level needs its place in brackets: [" +
                     std::string(line.rest[0].text) + " 0.3]");
  }
  const auto mass = reference(line, 0);
  const ArgumentId level = has_level ? argument(line, 1) : no_argument;
  if (level != no_argument) {
    for (const Step& step : out_.network.arguments[level]) {
      if (step.op == Op::parameter && out_.network.parameters[step.index].audio_input > 0) {
        return error(line, line.rest[1], "an output's level cannot follow an audio input");
      }
    }
  }
  const std::string_view word = line.keyword->word;
  const int derivative = word == "velOutput" ? 1 : word == "accOutput" ? 2 : 0;
  if (number && mass) {
    out_.network.outputs.push_back({.number = *number,
                                    .is_force = line.keyword->element == Element::force_output,
                                    .derivative = static_cast<std::uint8_t>(derivative),
                                    .mass = *mass,
                                    .level = level,
                                    .location = {line.number, line.label.column}});
  }
}

// Returns the N of the argument "@inN".
int Reader::audio_input(const Line& line) {
  Line asked = line;
  asked.label = line.rest[0];
  if (asked.label.text[0] == '@') {
    asked.label.text.remove_prefix(1);
  }
  return channel(asked, "in").value_or(0);
}

std::uint32_t Reader::drawing(const Line& line, std::size_t at) {
  if (line.rest.size() < at + 3) {
    return 0;
  }
  show(delayed_, line, "names a drawing after its arguments");
  Drawing drawing{
      .group = std::string(line.rest[at].text), .x = state(line, at + 1), .y = state(line, at + 2)};
  out_.network.drawings.push_back(std::move(drawing));
  return static_cast<std::uint32_t>(out_.network.drawings.size());
}

// Restores a '/' that one editor deletes: "sqrt(kScale3)" becomes "sqrt(kScale/3)" if kScale is a
// parameter and kScale3 is not. Returns "" if there is nothing to restore.
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
      if (is_followed && std::ranges::find(parameter_names_, word) == parameter_names_.end()) {
        const std::size_t cut = at + name.size();
        return std::string(text.substr(0, cut)) + "/" + std::string(text.substr(cut));
      }
    }
    at = std::max(end, at + 1);
  }
  return "";
}

ArgumentId Reader::argument(const Line& line, std::size_t at) {
  const Token token = unwrapped(line.rest[at]);
  if (token.text.size() != line.rest[at].text.size()) {
    show(velocity_, line, "writes an argument in brackets");
  }
  return expression(line, token);
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
        warning(line, token,
                "a '/' is missing (MIMS4Max drops the first one of a file); read as " +
                    quoted(repaired));
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
    error(line, token, quoted(token.text) + " is not a finite number");
    return no_argument;
  }
  const ArgumentId id = out_.network.add(std::move(formula));
  arguments_.emplace(token.text, id);
  return id;
}

// Reads a scalar, or [x y z], where z is the position and x and y are for drawing. Returns true if
// the text has x and y.
bool Reader::position(const Line& line, std::size_t at, double& z, double& x, double& y) {
  const Token& token = line.rest[at];
  if (token.text[0] != '[') {
    z = state(line, at);
    return false;
  }
  show(velocity_, line, "writes a position as [x y z]");
  const Token inner = unwrapped(token);
  split(inner.text, parts_);
  double* const targets[] = {&x, &y, &z};
  if (parts_.size() != 3) {
    error(line, token,
          "a position is one number or three, [x y z]; found " + std::to_string(parts_.size()));
    return false;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    if (!parse_number(parts_[i].text, *targets[i])) {
      error(line, {parts_[i].text, inner.column + parts_[i].column - 1},
            "found " + quoted(parts_[i].text) + " where a number was expected");
    }
  }
  return true;
}

double Reader::state(const Line& line, std::size_t at) {
  double number = 0.0;
  if (!parse_number(line.rest[at].text, number)) {
    error(line, line.rest[at],
          "found " + quoted(line.rest[at].text) + " where a number was expected" +
              (is_identifier(line.rest[at].text) ? " (a state at the start cannot be a parameter)"
               : line.keyword->element == Element::position_input && line.rest[at].text[0] == '@'
                   ? "; use 'frcInput' for a force"
                   : ""));
  }
  return number;
}

std::optional<std::uint32_t> Reader::reference(Line& line, std::size_t at) {
  const Token token = line.rest[at];
  if (token.text[0] == '[') {
    show(velocity_, line, "writes a place on a macro in brackets");
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
  if (token.text[0] == '@' && macro_of(token.text.substr(1))) {
    std::vector<Token> coordinates;
    if (!line.coordinates.empty()) {
      const Token both = line.coordinates.front();
      line.coordinates = line.coordinates.subspan(1);
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
  if (const auto mass = mass_of(name)) {
    return mass;
  }
  std::vector<std::string_view> names;
  for (const Entry& other : entries_) {
    if (names.size() < most_suggestions && is_mass(keywords()[other.keyword].element)) {
      names.push_back(label_of(other));
    }
  }
  error(line, token,
        entry_of(name) != IndexTable::none
            ? quoted(token.text) + " is not a mass, so nothing can be attached to it"
            : "no mass is called " + quoted(token.text) + suggestion(name, names, "@"));
  return std::nullopt;
}

// Reads a place on a macro: one coordinate on a string, which may contain blanks, or two on a mesh.
std::optional<std::uint32_t> Reader::tap(const Line& line, const Token& token, const Token& label,
                                         std::vector<Token> coordinates) {
  const auto macro = macro_of(label.text.substr(1));
  if (!macro) {
    std::vector<std::string_view> names;
    for (const Entry& other : entries_) {
      if (keywords()[other.keyword].element == Element::macro) {
        names.push_back(label_of(other));
      }
    }
    error(line, label,
          mass_of(label.text.substr(1))
              ? quoted(label.text) + " is a single mass, not a macro: write it without '['"
              : "no macro is called " + quoted(label.text) +
                    suggestion(label.text.substr(1), names, "@"));
    return std::nullopt;
  }
  const Keyword& keyword = *macro_keywords_.at(*macro);
  const bool is_plane = is_mesh(keyword.macro);
  const bool is_body = keyword.macro == MacroKind::body;
  const std::vector<std::string>& places = out_.network.macros[*macro].places;
  const std::size_t wanted = is_plane ? 2 : 1;
  if (!is_plane && coordinates.size() > 1 && token.text[0] == '[') {
    const char* const start = coordinates.front().text.data();
    const std::string_view last = coordinates.back().text;
    const auto length = static_cast<std::size_t>(last.data() + last.size() - start);
    coordinates = {{std::string_view(start, length), coordinates.front().column}};
  }
  if (coordinates.size() != wanted) {
    error(line, token,
          quoted(label.text) + " is a " + std::string(keyword.word) + ": a place on it needs " +
              (is_plane  ? "two coordinates, [@m u v], each from 0 to 1"
               : is_body ? "its name, [" + std::string(label.text) + " " +
                               (places.empty() ? "place" : places.front()) + "]"
               : keyword.macro == MacroKind::modal_string
                   ? "one coordinate, [@s u], from 0 to 1, or its bridge, [@s bridge]"
                   : "one coordinate, [@s u], from 0 to 1"));
    return std::nullopt;
  }
  if (is_body && is_identifier(coordinates[0].text)) {
    return named_place(line, token, *macro, coordinates[0]);
  }
  if (keyword.macro == MacroKind::modal_string && coordinates[0].text == bridge_name) {
    return add_point(line, token, {.macro = *macro});
  }
  for (const Token& coordinate : coordinates) {
    double number = 0.0;
    if (parse_number(coordinate.text, number) && (number < 0.0 || number > 1.0)) {
      warning(line, coordinate,
              "a place on a macro goes from 0 to 1; " + quoted(coordinate.text) + " is read as " +
                  (number < 0.0 ? "0" : "1"));
    }
  }
  return add_point(line, token,
                   {.macro = *macro,
                    .u = expression(line, coordinates[0]),
                    .v = is_plane ? expression(line, coordinates[1]) : no_argument});
}

// Reads a place on a body by its name, or by a parameter that moves along the places.
std::optional<std::uint32_t> Reader::named_place(const Line& line, const Token& token,
                                                 std::uint32_t macro, const Token& name) {
  Network& network = out_.network;
  const Macro& body = network.macros[macro];
  const auto place = place_called(body, name);
  if (!place && std::ranges::find(parameter_names_, name.text) == parameter_names_.end()) {
    const std::vector<std::string_view> names(body.places.begin(), body.places.end());
    error(line, name,
          "the body '@" + body.name + "' has no place called " + quoted(name.text) + " (it has " +
              joined(body.places, ", ") + ")" + suggestion(name.text, names));
    return std::nullopt;
  }
  const ArgumentId u = place ? network.add(*place) : expression(line, name);
  return add_point(line, token, {.macro = macro, .u = u});
}

std::uint32_t Reader::add_point(const Line& line, const Token& token, Tap tap) {
  Network& network = out_.network;
  Mass point{.kind = MassKind::point, .tap = static_cast<std::uint32_t>(network.taps.size())};
  point.location = {line.number, token.column};
  network.taps.push_back(tap);
  network.masses.push_back(std::move(point));
  return static_cast<std::uint32_t>(network.masses.size() - 1);
}

std::optional<int> Reader::channel(const Line& line, std::string_view prefix) {
  const std::string_view label = line.label.text;
  int number = 0;
  if (label.starts_with(prefix)) {
    const char* end = label.data() + label.size();
    const auto [last, failure] = std::from_chars(label.data() + prefix.size(), end, number);
    if (failure == std::errc{} && last == end && number >= 1 && number <= max_channels &&
        label.substr(prefix.size()) == std::to_string(number)) {  // rejects "in01"
      return number;
    }
  }
  error(line, line.label,
        "'" + std::string(line.keyword->word) + "' needs the label '@" + std::string(prefix) +
            "N' with N from 1 to " + std::to_string(max_channels) + ", found " +
            quoted("@" + std::string(label)));
  return std::nullopt;
}

}  // namespace ressort::model
