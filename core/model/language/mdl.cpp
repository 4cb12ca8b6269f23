#include "core/model/language/mdl.h"

#include <algorithm>

#include "core/model/language/expression.h"
#include "core/model/language/reader.h"
#include "core/model/language/synth_a_modeler.h"
#include "core/ranges.h"

namespace ressort::model {

ParsedNetwork Reader::read(std::string_view text, const ReadOptions& options) {
  if (text.size() > max_model_bytes) {
    report(
        Severity::error, 1, {"", 1},
        "the model is longer than the limit of " + std::to_string(max_model_bytes >> 20) + " MiB");
    return std::move(out_);
  }
  if (text.starts_with("\xef\xbb\xbf")) {
    text.remove_prefix(3);  // the byte order mark
  }
  const std::size_t zero = text.find('\0');
  if (zero != std::string_view::npos) {
    int line = 1;
    std::size_t start = 0;
    for (std::size_t i = 0; i < zero; ++i) {
      if (text[i] == '\n' || (text[i] == '\r' && text[i + 1] != '\n')) {
        ++line;
        start = i + 1;
      }
    }
    report(Severity::error, line, {"", static_cast<int>(zero - start) + 1},
           "found a zero byte: this is a binary file, not a model");
    return std::move(out_);
  }
  const Progress& progress = options.progress;
  most_nodes_ = options.most_nodes;
  progress.stage("reading it");
  text_ = text;
  int number = 0;
  while (!text.empty() && !count_.is_full()) {
    const auto* const last =
        std::ranges::find_if(text, [](char c) { return c == '\n' || c == '\r'; });
    const auto end = static_cast<std::size_t>(last - text.begin());
    ++number;
    read_line(text.substr(0, end),
              origins_.empty() ? number : origins_[static_cast<std::size_t>(number) - 1].line);
    progress.spend(end / 8 + 1);
    const bool pair = end + 1 < text.size() && text[end] == '\r' && text[end + 1] == '\n';
    text.remove_prefix(std::min(text.size(), end + (pair ? 2 : 1)));
  }
  // Declarations come first because a line may refer to a later one.
  declare_all();
  progress.spend(entries_.size());
  for (const Entry& entry : entries_) {
    if (count_.is_full()) {
      break;
    }
    Line line = open(entry);
    build(line);
    progress.spend(20);
  }
  if (entries_.empty() && out_.ok()) {
    report(Severity::error, 1, {"", 1},
           "the model is empty: expected elements such as '@m mass 1. 0. 0.'");
  }
  progress.spend(8 * entries_.size());
  decide_motion(options);
  progress.spend(8 * entries_.size());
  warn_of_mistakes();
  progress.spend(8 * entries_.size());
  std::ranges::stable_sort(out_.diagnostics, {}, &Diagnostic::line);
  entries_ = {};
  labels_ = IndexTable();
  if (out_.ok()) {
    out_.network = canonical(std::move(out_.network));
  }
  return std::move(out_);
}

void Reader::read_line(std::string_view text, int number) {
  split(text, tokens_);
  if (tokens_.empty()) {
    return;
  }
  if (tokens_[0].text[0] == '~') {
    return read_block(tokens_, number);
  }
  Line line{.number = number, .label = tokens_[0]};
  if (line.label.text[0] != '@') {
    return warning(line, line.label,
                   "ignored: an element starts with '@', a comment with '#', found " +
                       quoted(line.label.text));
  }
  line.label.text.remove_prefix(1);
  if (line.label.text.empty()) {
    return error(line, line.label, "expected a label right after '@'");
  }
  if (line.label.text.size() > longest_label || std::ranges::any_of(line.label.text, [](char c) {
        return std::iscntrl(static_cast<unsigned char>(c)) != 0;
      })) {
    return error(line, line.label,
                 quoted(line.label.text) + " is not a label: it is longer than " +
                     std::to_string(longest_label) +
                     " bytes or has characters that cannot be printed");
  }
  if (tokens_.size() < 2) {
    return error(line, {"", line.label.column + static_cast<int>(line.label.text.size()) + 1},
                 "the line ends where a keyword was expected, such as 'mass' or 'springDamper'");
  }
  const Token& word = tokens_[1];
  const auto found = std::find_if(keywords().begin(), keywords().end(),
                                  [&](const Keyword& k) { return k.word == word.text; });
  if (found == keywords().end()) {
    const auto words = mapped(keywords(), &Keyword::word);
    return error(line, word, "unknown keyword " + quoted(word.text) + suggestion(word.text, words));
  }
  entries_.push_back({.at = static_cast<std::uint32_t>(text.data() - text_.data()),
                      .length = static_cast<std::uint32_t>(text.size()),
                      .number = number,
                      .group = groups_.empty() ? 0 : groups_.back(),
                      .keyword = static_cast<std::uint8_t>(found - keywords().begin())});
}

// Splits a line again. The result is valid until the next call.
Line Reader::open(const Entry& entry) {
  split(text_.substr(entry.at, entry.length), tokens_);
  Line line{.number = entry.number,
            .keyword = &keywords()[entry.keyword],
            .label = tokens_[0],
            .word = tokens_[1],
            .group = group_names_[entry.group],
            .rest = std::span(tokens_).subspan(2),
            .element = entry.element};
  line.label.text.remove_prefix(1);
  return line;
}

std::string_view Reader::label_of(const Entry& entry) const {
  const std::string_view text = text_.substr(entry.at, entry.length);
  return first_word(text.substr(text.find('@') + 1));
}

// Returns the label's slot in the table.
std::uint32_t& Reader::entry_of(std::string_view label) {
  return labels_.find(std::hash<std::string_view>()(label),
                      [&](std::uint32_t entry) { return label_of(entries_[entry]) == label; });
}

std::optional<std::uint32_t> Reader::mass_of(std::string_view label) {
  const std::uint32_t entry = entry_of(label);
  return entry != IndexTable::none && is_mass(keywords()[entries_[entry].keyword].element)
             ? std::optional(entries_[entry].element)
             : std::nullopt;
}

std::optional<std::uint32_t> Reader::macro_of(std::string_view label) {
  const std::uint32_t entry = entry_of(label);
  return entry != IndexTable::none && keywords()[entries_[entry].keyword].element == Element::macro
             ? std::optional(entries_[entry].element)
             : std::nullopt;
}

// Reads `~motion MEANING`, or `~begin NAME` and `~end NAME`. Elements declared between these two
// are drawn in the group NAME.
void Reader::read_block(const std::vector<Token>& tokens, int number) {
  const Line line{.number = number, .label = tokens[0]};
  if (tokens[0].text == "~motion") {
    return read_motion(line, tokens);
  }
  const bool begins = tokens[0].text == "~begin";
  if ((!begins && tokens[0].text != "~end") || tokens.size() != 2) {
    return error(line, tokens[0], "expected '~begin NAME' or '~end NAME'");
  }
  if (begins) {
    show(velocity_, line, "opens a block");
    if (groups_.size() == most_open_blocks) {
      return error(line, tokens[0],
                   "more than " + std::to_string(most_open_blocks) + " blocks are open here");
    }
    groups_.push_back(static_cast<std::uint32_t>(group_names_.size()));
    return group_names_.push_back(tokens[1].text);
  }
  const auto found = std::find_if(groups_.rbegin(), groups_.rend(), [&](std::uint32_t group) {
    return group_names_[group] == tokens[1].text;
  });
  if (found == groups_.rend()) {
    return error(line, tokens[1], "no block " + quoted(tokens[1].text) + " is open here");
  }
  groups_.erase(std::next(found).base());
}

void Reader::declare_all() {
  entries_.shrink_to_fit();
  labels_ = IndexTable(entries_.size());
  const auto count_of = [&](auto is_wanted) {
    return static_cast<std::size_t>(std::ranges::count_if(entries_, [&](const Entry& entry) {
      return is_wanted(keywords()[entry.keyword].element);
    }));
  };
  out_.network.masses.reserve(count_of(is_mass));
  out_.network.drawings.reserve(out_.network.masses.capacity());
  out_.network.links.reserve(count_of([](Element element) { return element == Element::link; }));
  for (std::uint32_t i = 0; i < entries_.size(); ++i) {
    if (enter_label(i)) {
      declare(entries_[i]);
    }
  }
}

// Returns false if the label is already taken. This is an error unless both elements are links, or
// both are outputs, which are added.
bool Reader::enter_label(std::uint32_t index) {
  const Entry& entry = entries_[index];
  std::uint32_t& place = entry_of(label_of(entry));
  if (place == IndexTable::none) {
    place = index;
    return true;
  }
  const Line line = open(entry);
  const Entry& first = entries_[place];
  const auto is_output = [](Element element) {
    return element == Element::position_output || element == Element::force_output;
  };
  if (is_output(line.keyword->element) && is_output(keywords()[first.keyword].element)) {
    return true;
  }
  const std::string where = quoted("@" + std::string(line.label.text)) +
                            " is already declared in line " + std::to_string(first.number);
  if (line.keyword->element != Element::link ||
      keywords()[first.keyword].element != Element::link) {
    error(line, line.label, where);
    return false;
  }
  warning(line, line.label, where + "; both links are kept");
  return true;
}

void Reader::declare(Entry& entry) {
  Network& network = out_.network;
  const Keyword& keyword = keywords()[entry.keyword];
  if (is_mass(keyword.element)) {
    entry.element = static_cast<std::uint32_t>(network.masses.size());
    network.masses.emplace_back();
  } else if (keyword.element == Element::macro) {
    const Line line = open(entry);
    if (line.label.text.find(']') != std::string_view::npos) {
      error(line, line.label, "a macro's label must not contain ']'");
    }
    entry.element = static_cast<std::uint32_t>(network.macros.size());
    macro_keywords_.push_back(&keyword);
    name_places(line, network.macros.emplace_back());
  } else if (is_parameter(keyword.element)) {
    declare_parameter(open(entry));
  }
}

void Reader::declare_parameter(const Line& line) {
  if (parameter_names_.size() == most_parameters) {
    return error(line, line.label,
                 "a model has at most " + std::to_string(most_parameters) + " parameters");
  }
  if (!is_identifier(line.label.text)) {
    error(line, line.label, "a parameter's name may have only letters, digits and '_'");
  }
  Parameter parameter{.name = std::string(line.label.text),
                      .value = 0.0,
                      .location = {line.number, line.label.column}};
  if (!check_count(line)) {
    // check_count has reported it.
  } else if (line.keyword->element == Element::audio_parameter) {
    parameter.audio_input = audio_input(line);
  } else if (!parse_number(line.rest[0].text, parameter.value)) {
    error(line, line.rest[0],
          "found " + quoted(line.rest[0].text) +
              " where the parameter's value, a number, was expected");
  }
  parameter_names_.push_back(parameter.name);
  out_.network.parameters.push_back(std::move(parameter));
}

// Separates the coordinates of places. MIMS writes them after all arguments: u, or u:v on a mesh.
void Reader::take_coordinates(Line& line) {
  std::size_t count = 0;
  for (std::size_t i = 0;
       i < line.rest.size() && i < static_cast<std::size_t>(line.keyword->references); ++i) {
    const std::string_view text = line.rest[i].text;
    count += text[0] == '@' && macro_of(text.substr(1)) ? 1 : 0;
  }
  count = std::min(
      count, line.rest.size() -
                 std::min(line.rest.size(), static_cast<std::size_t>(line.keyword->references)));
  line.coordinates = line.rest.last(count);
  line.rest = line.rest.first(line.rest.size() - count);
  if (count > 0) {
    show(delayed_, line, "writes a place on a macro without brackets");
  }
}

void Reader::build(Line& line) {
  take_coordinates(line);
  if (is_parameter(line.keyword->element) || !check_count(line)) {
    return;
  }
  switch (line.keyword->element) {
    case Element::link:
      return add_link(line);
    case Element::macro:
      return add_macro(line);
    case Element::body_mode:
      return add_mode(line);
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

bool Reader::check_count(const Line& line) {
  for (const Token& token : line.rest) {
    const char opened = token.text[0];
    if ((opened == '[' && token.text.back() != ']') ||
        (opened == '\'' && (token.text.size() == 1 || token.text.back() != '\''))) {
      error(line, token, "this " + std::string(1, opened) + " is never closed");
      return false;
    }
  }
  const Keyword& keyword = *line.keyword;
  const int found = static_cast<int>(line.rest.size());
  const int least = keyword.references + keyword.least;
  const int most = keyword.references + keyword.most;
  // A drawing is GROUP X Y. The group's name is neither a number nor a place.
  double number = 0.0;
  const bool is_like_drawing = keyword.drawable && found == least + 3;
  const std::string_view group =
      is_like_drawing ? line.rest[static_cast<std::size_t>(least)].text : "";
  const bool is_drawn = is_like_drawing && group[0] != '[' && !parse_number(group, number);
  if ((found >= least && found <= most) || is_drawn) {
    return true;
  }
  Token place;
  if (found > most) {
    place = line.rest[static_cast<std::size_t>(most)];
  } else {
    const Token& last = found == 0 ? line.word : line.rest.back();
    place = {"", last.column + static_cast<int>(last.text.size())};
  }
  const bool has_blanks =
      found > most && std::ranges::any_of(line.rest, [](const Token& token) {
        return token.text.size() == 1 &&
               std::string_view("+-*/").find(token.text[0]) != std::string_view::npos;
      });
  error(line, place,
        "'" + std::string(keyword.word) + "' takes " + std::to_string(least) +
            (most > least ? " to " + std::to_string(most) : "") +
            (most == 1 ? " argument (" : " arguments (") + std::string(keyword.arguments) +
            "), found " + std::to_string(found) +
            (line.coordinates.empty() ? "" : " before the place on the macro") +
            (is_like_drawing
                 ? "; a drawing is GROUP X Y, but " + quoted(group) + " is not a group's name"
                 : "") +
            (has_blanks ? "; an expression with blanks needs brackets, [K * 2]" : ""));
  return false;
}

// Warns of elements that are legal but probably a mistake.
void Reader::warn_of_mistakes() {
  const Network& network = out_.network;
  if (!out_.ok()) {
    return;
  }
  const auto called = [](const Mass& mass) {
    return mass.kind == MassKind::point ? "the place" : quoted("@" + mass.name.text());
  };
  if (network.masses.empty() && network.macros.empty()) {
    return report(Severity::error, 1, {"", 1}, "the model has no masses, so it makes no sound");
  }
  std::vector<bool> attached(network.masses.size(), false);
  for (const Link& link : network.links) {
    attached[link.a] = attached[link.b] = true;
  }
  for (const Input& input : network.inputs) {
    attached[input.mass] = attached[input.mass] || input.is_force;
  }
  for (const Output& output : network.outputs) {  // a ground may be a constant output
    attached[output.mass] =
        attached[output.mass] || network.masses[output.mass].kind == MassKind::ground;
  }
  for (std::size_t i = 0; i < network.masses.size(); ++i) {
    const Mass& mass = network.masses[i];
    if (!attached[i] && mass.kind != MassKind::oscillator && mass.kind != MassKind::point) {
      report(Severity::warning, mass.location.line, {mass.name, mass.location.column},
             "nothing is attached to " + quoted("@" + mass.name.text()));
    }
  }
  for (const Link& link : network.links) {
    const bool is_contact = facts_of(link.law).is_one_sided();
    if (is_contact && origins_.empty() && network.masses[link.a].kind == MassKind::position &&
        network.masses[link.b].kind != MassKind::position) {
      report(Severity::warning, link.location.line, {link.name, link.location.column},
             "the contact's ends look swapped: it acts while the second is below the first, here " +
                 called(network.masses[link.b]) + " below " + called(network.masses[link.a]));
    }
  }
  for (const Input& input : network.inputs) {
    const Mass& pushed = network.masses[input.mass];
    if (input.is_force && (pushed.kind == MassKind::ground || pushed.kind == MassKind::position)) {
      const std::string label = "in" + std::to_string(input.number);
      report(Severity::warning, input.location.line, {label, input.location.column},
             "'@" + label + "' pushes " + quoted("@" + pushed.name.text()) + ", which " +
                 (pushed.kind == MassKind::ground ? "never moves" : "only follows its input") +
                 ": it has no effect");
    }
  }
  for (const Macro& macro : network.macros) {
    if (macro.kind == MacroKind::body && macro.length == 0) {
      report(Severity::error, macro.location.line, {macro.name, macro.location.column},
             "the body " + quoted("@" + macro.name) + " has no modes: each is a line like '@" +
                 macro.name + "_1 mode @" + macro.name + " 440. 2. 1.'");
    }
  }
  std::vector<Input> heard = network.inputs;
  for (const Parameter& parameter : network.parameters) {
    if (parameter.audio_input > 0) {
      heard.push_back({.number = parameter.audio_input, .location = parameter.location});
    }
  }
  warn_of_gaps(heard, "in");
  warn_of_gaps(network.outputs, "out");
  const std::vector<bool> used = used_parameters(network);
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (!used[i]) {
      const Parameter& parameter = network.parameters[i];
      report(Severity::warning, parameter.location.line,
             {parameter.name, parameter.location.column},
             "the parameter " + quoted(parameter.name) + " is never used");
    }
  }
  if (network.outputs.empty()) {
    report(Severity::warning, 1, {"", 1}, "the model has no output, so it will be silent");
  }
}

bool ParsedNetwork::ok() const {
  return std::ranges::none_of(diagnostics,
                              [](const Diagnostic& d) { return d.severity == Severity::error; });
}

// Messages about a translated line point to the whole line that it came from.
static ParsedNetwork read_synth_a_modeler(std::string_view text, ReadOptions options) {
  Translation translation = translate_synth_a_modeler(text, options.progress);
  ParsedNetwork parsed{
      .network = {}, .diagnostics = std::move(translation.diagnostics), .motion = {}};
  if (parsed.ok()) {
    if (!options.third) {
      options.third = ThirdArgument::velocity_per_second;
      options.third_by = "Synth-A-Modeler has it";
    }
    ParsedNetwork read = Reader(translation.origins).read(translation.text, options);
    std::unordered_map<int, const Origin*> origins;
    for (const Origin& origin : translation.origins) {
      origins.emplace(origin.line, &origin);
    }
    for (Diagnostic& diagnostic : read.diagnostics) {
      if (const auto found = origins.find(diagnostic.line); found != origins.end()) {
        diagnostic.column = found->second->column;
        diagnostic.length = found->second->length;
      }
    }
    read.diagnostics.insert(read.diagnostics.begin(), parsed.diagnostics.begin(),
                            parsed.diagnostics.end());
    parsed = std::move(read);
  }
  std::ranges::stable_sort(parsed.diagnostics, {}, &Diagnostic::line);
  return parsed;
}

ParsedNetwork parse_network(std::string_view text, const ReadOptions& options) {
  try {
    if (text.size() <= max_model_bytes && text.find('\0') == std::string_view::npos &&
        is_synth_a_modeler(text)) {
      return read_synth_a_modeler(text, options);
    }
    return Reader().read(text, options);
  } catch (const Stopped&) {
    return {.network = {}, .diagnostics = {{.message = stopped}}, .motion = {}};
  }
}

std::string to_string(const Diagnostic& diagnostic, std::string_view file) {
  return std::string(file) + ":" + std::to_string(diagnostic.line) + ":" +
         std::to_string(diagnostic.column) +
         (diagnostic.severity == Severity::error ? ": error: " : ": warning: ") +
         diagnostic.message;
}

}  // namespace ressort::model
