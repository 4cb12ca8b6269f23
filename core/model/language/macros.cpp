// Reads the lines of macros: strings, meshes, bodies with their modes, and waveguides.
#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/model/language/expression.h"
#include "core/model/language/reader.h"
#include "core/model/topology.h"
#include "core/ranges.h"

namespace ressort::model {

void Reader::add_macro(const Line& line) {
  if (line.element == undeclared) {
    return;  // another element has this label; reported there
  }
  Macro& macro = out_.network.macros[line.element];
  macro.name = std::string(line.label.text);
  macro.kind = line.keyword->macro;
  macro.location = {line.number, line.label.column};
  if (macro.kind == MacroKind::body) {
    return add_body(line, macro);
  }
  if (is_waveguide(macro.kind)) {
    return add_waveguide(line, macro);
  }
  if (macro.kind == MacroKind::modal_string) {
    return add_modal_string(line, macro);
  }
  std::size_t at = 0;
  macro.length = size(line, at++, macro.kind == MacroKind::stiff_string ? 3 : 2);
  macro.width = is_mesh(macro.kind) ? size(line, at++, 2) : 1;
  nodes_ += node_count(macro);
  if (nodes_ > most_nodes_) {
    macro.length = macro.width = 2;
    error(line, line.rest[0],
          "the macros have more than " + std::to_string(most_nodes_) + " nodes in all");
  }
  macro.mass = argument(line, at);
  check_mass(line, at++, macro.mass);
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
    show(delayed_, line, "gives a macro no motion");
    resting_.push_back(line.element);
  } else {
    show(velocity_, line, "gives a macro a motion");
    double far_x = 0.0;  // drawing position of the other end
    double far_y = 0.0;
    is_placed |= position(line, at++, macro.third, far_x, far_y);
  }
  if (is_placed || !line.group.empty()) {
    out_.network.drawings.push_back({.group = std::string(line.group), .x = x, .y = y});
    macro.drawing = static_cast<std::uint32_t>(out_.network.drawings.size());
  }
}

void Reader::add_waveguide(const Line& line, Macro& guide) {
  guide.length = 0;  // no nodes
  guide.impedance = positive(line, 0, "a waveguide's impedance R");
  guide.frequency_hz = positive(line, 1, "a waveguide's frequency in Hz");
  guide.t60_s = positive(line, 2, "a waveguide's T60 in seconds");
  guide.brightness = argument(line, 3);
  if (guide.brightness != no_argument && is_constant(out_.network.arguments[guide.brightness])) {
    const double value = argument_value(out_.network, guide.brightness, {});
    if (!(value >= 0.0 && value <= 1.0)) {
      error(line, line.rest[3],
            "a waveguide's brightness goes from 0 to 1, found " + quoted(line.rest[3].text));
    }
  }
  double x = 0.0;
  double y = 0.0;
  const bool is_placed = position(line, 4, guide.position, x, y);
  if (is_placed || !line.group.empty()) {
    out_.network.drawings.push_back({.group = std::string(line.group), .x = x, .y = y});
    guide.drawing = static_cast<std::uint32_t>(out_.network.drawings.size());
  }
}

void Reader::add_modal_string(const Line& line, Macro& string) {
  string.length = size(line, 0, 1);
  string.mass = argument(line, 1);
  check_mass(line, 1, string.mass);
  string.frequency_hz = positive(line, 2, "a string's frequency in Hz");
  string.inharmonicity = not_negative(line, 3, "a string's inharmonicity B");
  for (std::size_t i = 0; i < string.losses.size(); ++i) {
    string.losses[i] = not_negative(line, 4 + i, "a loss in 1/s");
  }
  if (line.rest.size() > 7) {
    if (line.rest.size() < 10) {
      return error(line, line.rest.back(),
                   "STRINGS, CENTS and BRIDGE belong together: give all three or none");
    }
    string.width = size(line, 7, 1);
    if (string.width > most_unison_strings) {
      string.width = 1;
      error(line, line.rest[7],
            "a note has 1 to " + std::to_string(most_unison_strings) + " strings, found " +
                quoted(line.rest[7].text));
    }
    string.spread_cents = argument(line, 8);
    string.bridge_loss = not_negative(line, 9, "the bridge's loss in 1/s");
  }
  nodes_ += node_count(string);
  if (nodes_ > most_nodes_) {
    string.length = 1;
    error(line, line.rest[0],
          "the macros have more than " + std::to_string(most_nodes_) + " nodes in all");
  }
  if (!line.group.empty()) {
    out_.network.drawings.push_back({.group = std::string(line.group)});
    string.drawing = static_cast<std::uint32_t>(out_.network.drawings.size());
  }
}

// Reads the names of a body's places, before any line that refers to them.
void Reader::name_places(const Line& line, Macro& body) {
  body.kind = line.keyword->macro;
  if (body.kind != MacroKind::body) {
    return;
  }
  body.length = 0;  // add_mode counts the modes
  for (std::size_t i = 1; i < line.rest.size(); ++i) {
    const Token& place = line.rest[i];
    if (!is_identifier(place.text)) {
      error(line, place,
            quoted(place.text) +
                " is not a name for a place: use letters, digits and '_', and do not "
                "start with a digit");
    } else if (std::ranges::find(body.places, place.text) != body.places.end()) {
      error(line, place, "the body has two places called " + quoted(place.text));
    }
    body.places.emplace_back(place.text);
  }
}

void Reader::add_body(const Line& line, Macro& body) {
  body.mass = argument(line, 0);
  check_mass(line, 0, body.mass);
  if (!line.group.empty()) {
    out_.network.drawings.push_back({.group = std::string(line.group)});
    body.drawing = static_cast<std::uint32_t>(out_.network.drawings.size());
  }
}

void Reader::add_mode(const Line& line) {
  const Token& label = line.rest[0];
  const std::string_view name = label.text.substr(label.text[0] == '@' ? 1 : 0);
  const auto index = macro_of(name);
  if (label.text[0] != '@' || !index || macro_keywords_.at(*index)->macro != MacroKind::body) {
    std::vector<std::string_view> names;
    for (const Entry& other : entries_) {
      if (keywords()[other.keyword].macro == MacroKind::body &&
          keywords()[other.keyword].element == Element::macro) {
        names.push_back(label_of(other));
      }
    }
    return error(line, label,
                 "found " + quoted(label.text) +
                     " where '@' and the label of a body were expected" +
                     suggestion(name, names, "@"));
  }
  Macro& body = out_.network.macros[*index];
  const std::size_t given = line.rest.size() - 3;
  if (given != body.places.size()) {
    return error(line, line.rest[std::min(line.rest.size() - 1, 3 + body.places.size())],
                 "the body " + quoted(label.text) + " has " + std::to_string(body.places.size()) +
                     (body.places.size() == 1 ? " place (" : " places (") +
                     joined(body.places, " ") + "), so a mode needs as many displacements; found " +
                     std::to_string(given));
  }
  if (++nodes_ > most_nodes_) {
    return error(line, line.label,
                 "the macros have more than " + std::to_string(most_nodes_) + " nodes in all");
  }
  BodyMode mode{.name = std::string(line.label.text), .macro = *index};
  mode.location = {line.number, line.label.column};
  mode.frequency_hz = positive(line, 1, "a mode's frequency in Hz");
  mode.t60_s = positive(line, 2, "a mode's T60 in seconds");
  for (std::size_t i = 3; i < line.rest.size(); ++i) {
    mode.shape.push_back(displacement(line, i));
  }
  ++body.length;
  out_.network.modes.push_back(std::move(mode));
}

// Reads an argument and reports a constant that is not above 0. If a parameter sets it, the
// compiler checks it.
ArgumentId Reader::positive(const Line& line, std::size_t at, const std::string& what) {
  const ArgumentId id = argument(line, at);
  if (id != no_argument && is_constant(out_.network.arguments[id]) &&
      !(argument_value(out_.network, id, {}) > 0.0)) {
    error(line, line.rest[at], what + " must be above 0, found " + quoted(line.rest[at].text));
  }
  return id;
}

// Reads an argument and reports a constant below 0. If a parameter sets it, the compiler checks it.
ArgumentId Reader::not_negative(const Line& line, std::size_t at, const std::string& what) {
  const ArgumentId id = argument(line, at);
  if (id != no_argument && is_constant(out_.network.arguments[id]) &&
      argument_value(out_.network, id, {}) < 0.0) {
    error(line, line.rest[at], what + " must not be below 0, found " + quoted(line.rest[at].text));
  }
  return id;
}

// Reads a number or an expression without parameters.
double Reader::displacement(const Line& line, std::size_t at) {
  const Token token = unwrapped(line.rest[at]);
  double number = 0.0;
  if (parse_number(token.text, number)) {
    return number;
  }
  const auto parsed = parse_expression(token.text, {});
  if (parsed && std::isfinite(evaluate(*parsed, {}))) {
    return evaluate(*parsed, {});
  }
  error(line, line.rest[at],
        "found " + quoted(token.text) +
            " where a displacement, a number without parameters, was expected");
  return 0.0;
}

// Returns the coordinate of a named place.
std::optional<double> Reader::place_called(const Macro& body, const Token& token) const {
  const auto place = std::ranges::find(body.places, token.text);
  if (place == body.places.end()) {
    return std::nullopt;
  }
  const double last = static_cast<double>(std::max<std::size_t>(body.places.size(), 2) - 1);
  return static_cast<double>(place - body.places.begin()) / last;
}

// Reads a constant number of nodes.
std::uint32_t Reader::size(const Line& line, std::size_t at, std::uint32_t least) {
  const std::string_view text = line.rest[at].text;
  std::uint64_t number = 0;
  const char* const end = text.data() + text.size();
  const auto [last, failure] = std::from_chars(text.data(), end, number);
  if (failure != std::errc{} || last != end || number < least || number > most_nodes_) {
    error(line, line.rest[at],
          "found " + quoted(text) + " where a number of nodes from " + std::to_string(least) +
              " to " + std::to_string(most_nodes_) + " was expected");
    return least;
  }
  return static_cast<std::uint32_t>(number);
}

}  // namespace ressort::model
