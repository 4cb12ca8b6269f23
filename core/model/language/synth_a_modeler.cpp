#include "core/model/language/synth_a_modeler.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "core/model/language/expression.h"
#include "core/model/language/sam_lines.h"

namespace ressort::model {

enum class SamKind {
  mass,
  ground,
  port,
  resonators,
  link,
  touch,
  pluck,
  waveguide,
  termination,
  junction,
  audioout
};

struct SamShape {
  std::string_view word;
  SamKind kind{};
  int least = 0;  // fewest and most arguments
  int most = 0;
  int names = 1;  // smallest number of names
  std::string_view form;
};

struct SamElement {
  const Statement* statement = nullptr;
  const SamShape* shape = nullptr;
  std::string end;                  // reference for the end of a link; empty if no link may attach
  std::string force;                // constant force towards -x; masses only
  int filters = 0;                  // between an element and this mass of a filter
  std::vector<std::size_t> guides;  // waveguides that end here; terminations and junctions only
};

namespace {

bool is_link(SamKind kind) {
  return kind == SamKind::link || kind == SamKind::touch || kind == SamKind::pluck;
}

// Translates one text.
class SamTranslator {
 public:
  Translation translate(std::string_view text, const Progress& progress);

 private:
  void declare();
  bool declare(const Statement& statement);
  std::string label_of(const SamElement& element) const;
  void name_ends();
  void join_guides();
  bool is_place(const SamElement& node);
  void join_row(std::size_t termination);
  void join_knot(std::size_t junction, const std::string& string, const std::string& impedance);
  std::optional<std::string> period_of(const SamElement& guide);
  // Loss of a wave at a termination: `flat` for all partials, plus pi^2/6 (frequency/fc)^2, the
  // loss of a moving average well below its first zero.
  struct Loss {
    std::string flat;  // -ln of the reflection
    std::string fc;    // empty: no moving average
    bool is_free = false;
  };
  std::optional<Loss> loss_of(const SamElement& termination);
  void add_forces();
  void write(const SamElement& element);
  void write_resonators(const SamElement& element);
  std::string like(std::string_view name) const;
  void write_link(const SamElement& element);
  void write_output(const SamElement& element);
  std::optional<SamSignal> heard(const SamElement& out, const Token& name);
  std::optional<SamSignal> force_of(const SamElement& link);
  const SamElement* follower(const SamElement& out, const SamElement& source,
                             const SamFilter& filter);
  std::string hand_at(const SamElement& pluck, std::size_t side);
  std::string unique(std::string label) const;

  // Returns an argument; 0 if it is missing.
  std::string number(const SamElement& element, std::size_t at) {
    return at >= element.statement->arguments.size()
               ? "0"
               : lines_.expression(element.statement->origin, element.statement->arguments[at]);
  }
  std::string scaled(const SamElement& element, std::size_t at, const std::string& factor) {
    return lines_.join(element.statement->origin, element.statement->word, factor, '*',
                       number(element, at));
  }
  // Reads a number without parameters.
  std::string fixed(const SamElement& element, std::size_t at) {
    std::string text = number(element, at);
    double value = 0.0;
    if (!parse_number(text, value)) {
      error(element, element.statement->arguments[at],
            "positions, speeds and heights at the start must be numbers, not sliders");
    }
    return text;
  }
  void error(const SamElement& element, const Token& token, std::string message) {
    lines_.error(element.statement->origin, token, std::move(message));
  }
  void emit(const Origin& origin, const std::string& line) {
    if (out_.text.size() <= max_model_bytes) {  // otherwise the reader reports it
      out_.text += line + "\n";
      out_.origins.push_back(origin);
    }
  }

  SamLines lines_;
  std::vector<SamElement> elements_;
  std::map<std::string_view, std::size_t> by_name_;
  // Masses of filters, by the end that they follow, stiffness and damping.
  std::map<std::array<std::string, 3>, SamElement> followers_;
  std::vector<bool> joined_;  // [element] a waveguide that is part of a row
  int ports_ = 0;
  int outputs_ = 0;
  bool has_one_ = false;    // the ground at 1, for constant outputs
  bool has_pluck_ = false;  // a warning has been given
  Translation out_;
};

// Maximum force of nlPluck per SCALE and K, 0.9/10; a pluck of Synth-A-Modeler has k.
constexpr double pluck_peak = 0.09;

constexpr std::size_t longest_name = 900;  // bytes

// The running mean of a termination has at most 256 samples.
constexpr double lowest_fc = 44100.0 / 256.0;

// Filters in a row. In single precision, forces on lighter masses would vanish.
constexpr int most_filters = 3;

// Stiffness of the links that tie waveguides to one junction, in impedances per sample.
constexpr std::string_view tie_stiffness = "1000";

constexpr SamShape shapes[] = {
    {"mass", SamKind::mass, 1, 3, 1, "mass(m,x0,v0),id;"},
    {"ground", SamKind::ground, 0, 1, 1, "ground(x),id;"},
    {"port", SamKind::port, 0, 0, 1, "port(),id;"},
    {"resonators", SamKind::resonators, 3, 3000, 1, "resonators(f,tau,m, f,tau,m, ...),id;"},
    {"resonator", SamKind::resonators, 3, 3, 1, "resonator(f,tau,m),id;"},
    {"link", SamKind::link, 2, 3, 3, "link(k,R,o),id,a,b;"},
    {"touch", SamKind::touch, 2, 3, 3, "touch(k,R,o),id,a,b;"},
    {"pulseTouch", SamKind::touch, 3, 6, 3, "pulseTouch(k,R,o,multiplier,tau,length),id,a,b;"},
    {"pulseTouchTable", SamKind::touch, 3, 8, 3, "pulseTouchTable(k,R,o,...),id,a,b;"},
    {"pulseTouchGeneral", SamKind::touch, 3, 8, 3, "pulseTouchGeneral(k,R,o,...),id,a,b;"},
    {"pluck", SamKind::pluck, 3, 4, 3, "pluck(k,R,halfWidth,o),id,a,b;"},
    {"waveguide", SamKind::waveguide, 2, 2, 3, "waveguide(Z0,simpleString(maxT,T)),id,left,right;"},
    {"termination", SamKind::termination, 1, 1, 1, "termination(simpleStringTerm(r,fc)),id;"},
    {"junction", SamKind::junction, 0, 1, 1, "junction(height),id;"},
    {"audioout", SamKind::audioout, 1, 1, 1, "audioout,id,signal;"},
};

// Returns true for names that are reserved for inputs and outputs.
bool is_channel(std::string_view name) {
  const std::size_t start = name.starts_with("in") ? 2 : name.starts_with("out") ? 3 : name.size();
  return start < name.size() && name.find_first_not_of("0123456789", start) == name.npos;
}

Translation SamTranslator::translate(std::string_view text, const Progress& progress) {
  progress.stage("reading it");
  lines_.read(text, progress);
  declare();
  name_ends();
  join_guides();
  add_forces();
  for (const SamElement& element : elements_) {
    if (lines_.is_full()) {
      break;
    }
    write(element);
    progress.spend(20);
  }
  const Translation elements = std::exchange(out_, {});
  for (std::size_t i = 0; i < lines_.parameters.size(); ++i) {
    emit(lines_.parameter_lines[i],
         "@" + lines_.parameters[i] + " param " + print_number(lines_.values[i]));
  }
  out_.text += elements.text;
  out_.origins.insert(out_.origins.end(), elements.origins.begin(), elements.origins.end());
  out_.diagnostics = std::move(lines_.diagnostics);
  return std::move(out_);
}

void SamTranslator::declare() {
  for (const Statement& statement : lines_.statements) {
    if (!declare(statement)) {
      continue;
    }
    const Token& name = statement.names[0];
    if (!is_identifier(name.text) || name.text.size() > longest_name) {
      lines_.error(statement.origin, name,
                   "expected a name of letters, digits and '_', found " + quoted(name.text));
    } else if (lines_.is_number_name(std::string(name.text))) {
      lines_.error(statement.origin, name,
                   quoted(name.text) + " is already defined as a number by a faustcode line");
    } else if (const auto [at, is_new] = by_name_.try_emplace(name.text, elements_.size() - 1);
               !is_new) {
      lines_.error(statement.origin, name,
                   quoted(name.text) + " is already declared in line " +
                       std::to_string(elements_[at->second].statement->origin.line));
    }
  }
}

// Declares an element. Returns false after reporting an error.
bool SamTranslator::declare(const Statement& statement) {
  const std::string_view word = statement.word.text;
  if (word.ends_with("adjust") || word == "display") {
    lines_.warning(statement.origin, statement.word,
                   "ignored: " + quoted(word) + " is not supported; sliders become parameters");
    return false;
  }
  const auto* const shape = std::ranges::find(shapes, word, &SamShape::word);
  if (shape == std::end(shapes)) {
    lines_.error(statement.origin, statement.word,
                 quoted(word) + " is not supported: " +
                     (word.ends_with("link") || word == "detent"
                          ? "write a link or a touch"
                          : "Synth-A-Modeler has no such element either"));
    return false;
  }
  const int given = static_cast<int>(statement.arguments.size());
  if (given < shape->least || given > shape->most ||
      (shape->kind == SamKind::resonators && given % 3 != 0)) {
    lines_.error(statement.origin, statement.word,
                 "expected " + std::string(shape->form) + ", found " + std::to_string(given) +
                     (given == 1 ? " argument" : " arguments"));
    return false;
  }
  if (static_cast<int>(statement.names.size()) < shape->names) {
    lines_.error(statement.origin, statement.names.back(),
                 "expected " + std::string(shape->form) + ", found too few names");
    return false;
  }
  elements_.push_back({.statement = &statement, .shape = shape});
  return true;
}

std::string SamTranslator::label_of(const SamElement& element) const {
  const std::string_view name = element.statement->names[0].text;
  std::string label = "@" + std::string(name);
  while (is_channel(name) && by_name_.contains(std::string_view(label).substr(1))) {
    label += "_";
  }
  return label;
}

// Returns a label that no element has.
std::string SamTranslator::unique(std::string label) const {
  while (by_name_.contains(std::string_view(label).substr(1))) {
    label += "_";
  }
  return label;
}

void SamTranslator::name_ends() {
  for (SamElement& element : elements_) {
    switch (element.shape->kind) {
      case SamKind::mass:
      case SamKind::ground:
        element.end = label_of(element);
        break;
      case SamKind::resonators:
        element.end = "[" + label_of(element) + " p]";
        break;
      case SamKind::port:
        element.end = "@in" + std::to_string(++ports_);
        break;
      case SamKind::link:
      case SamKind::touch:
      case SamKind::pluck:
      case SamKind::waveguide:
      case SamKind::termination:
      case SamKind::junction:
      case SamKind::audioout:
        break;  // join_row sets those of junctions
    }
  }
}

// Adds the constant force k o of links with an offset o.
void SamTranslator::add_forces() {
  for (const SamElement& link : elements_) {
    if (link.shape->kind != SamKind::link) {
      continue;
    }
    const std::string offset = number(link, 2);
    double constant = 0.0;
    if (parse_number(offset, constant) && constant == 0.0) {
      continue;
    }
    for (std::size_t side = 1; side <= 2; ++side) {
      const Token& name = link.statement->names[side];
      const auto found = by_name_.find(name.text);
      if (found == by_name_.end()) {
        continue;  // write_link reports it
      }
      SamElement& end = elements_[found->second];
      if (end.shape->kind == SamKind::mass) {
        end.force += (side == 1 ? "-(" : "+(") + number(link, 0) + ")*(" + offset + ")";
        if (end.force.size() > longest_expression) {
          error(link, name, "too many links with an offset at " + quoted(name.text));
          end.force.clear();
        }
      } else if (end.shape->kind != SamKind::ground && end.shape->kind != SamKind::port) {
        error(link, link.statement->arguments[2],
              "an offset is supported only between masses, grounds and ports; here it must be 0");
      }
    }
  }
}

void SamTranslator::write(const SamElement& element) {
  const Origin& origin = element.statement->origin;
  switch (element.shape->kind) {
    case SamKind::mass: {
      const std::string inertia = scaled(element, 0, "1944810000");  // m fs^2
      const std::string state = fixed(element, 1) + " " + fixed(element, 2);
      return emit(
          origin,
          element.end + (element.force.empty() ? " mass " : " massG ") + inertia + " " +
              (element.force.empty()
                   ? ""
                   : lines_.tidy(origin, element.statement->word, "0" + element.force) + " ") +
              state);
    }
    case SamKind::ground:
      return emit(origin, element.end + " ground " + fixed(element, 0));
    case SamKind::port:
      return emit(origin, element.end + " posInput 0");
    case SamKind::resonators:
      return write_resonators(element);
    case SamKind::link:
    case SamKind::touch:
    case SamKind::pluck:
      return write_link(element);
    case SamKind::audioout:
      return write_output(element);
    case SamKind::waveguide:
    case SamKind::termination:
    case SamKind::junction:
      return;  // written by join_row
  }
}

// Writes resonators as one body. A mode of mass m_i equals one of mass m_1 with the displacement
// sqrt(m_1/m_i).
void SamTranslator::write_resonators(const SamElement& element) {
  const Origin& origin = element.statement->origin;
  const std::string label = label_of(element);
  emit(origin, label + " body " + scaled(element, 2, "1944810000") + " p");
  const std::string first = number(element, 2);
  for (std::size_t at = 0; at + 2 < element.statement->arguments.size(); at += 3) {
    const Token& own = element.statement->arguments[at + 2];
    const std::string ratio =
        lines_.tidy(origin, own, "sqrt((" + first + ")/(" + number(element, at + 2) + "))");
    const double start = lines_.value(ratio);
    constexpr double tiny = 1e-9;
    if (!(std::fabs(lines_.value(ratio, 1.5) - start) < tiny * start)) {
      lines_.warning(origin, own,
                     "the ratio of the masses of these resonators stays as it is at the start");
    }
    const std::string shape = print_number(start);
    emit(origin, unique(label + "_" + std::to_string(at / 3 + 1)) + " mode " + label + " " +
                     number(element, at) + " " + scaled(element, at + 1, "6.907755278982137") +
                     " " + shape);
  }
}

// Suggests a similar name of an element that a link may attach to.
std::string SamTranslator::like(std::string_view name) const {
  std::vector<std::string_view> names;
  for (const SamElement& other : elements_) {
    if (!other.end.empty() && names.size() < most_suggestions) {
      names.push_back(other.statement->names[0].text);
    }
  }
  return suggestion(name, names);
}

void SamTranslator::write_link(const SamElement& element) {
  const Statement& statement = *element.statement;
  std::string ends;
  for (std::size_t side = 1; side <= 2; ++side) {
    const Token& name = statement.names[side];
    const auto found = by_name_.find(name.text);
    if (found == by_name_.end()) {
      return error(element, name,
                   "there is no element called " + quoted(name.text) + like(name.text));
    }
    const SamElement& end = elements_[found->second];
    if (end.shape->kind == SamKind::junction && end.end.empty()) {
      return;  // join_row has reported it
    }
    if (end.shape->kind == SamKind::termination || end.end.empty()) {
      return error(element, name,
                   "expected a mass, a ground, a port, resonators or a junction, found " +
                       quoted(name.text));
    }
    ends += " " + (element.shape->kind == SamKind::pluck ? hand_at(element, side) : end.end);
  }
  const std::string label = label_of(element);
  const std::string damping = scaled(element, 1, "44100");
  switch (element.shape->kind) {
    case SamKind::link:
      return emit(statement.origin,
                  label + " spring" + ends + " " + number(element, 0) + " " + damping);
    case SamKind::touch:  // acts for x_a - x_b > o; a contact, for d > -t
      if (statement.word.text != "touch") {
        lines_.warning(statement.origin, statement.word,
                       "converted to a touch: the pulse at its start is left out");
      }
      return emit(statement.origin, label + " contact" + ends + " " + number(element, 0) + " " +
                                        damping + " " + scaled(element, 2, "-1"));
    default:
      break;
  }
  if (!has_pluck_) {
    lines_.warning(statement.origin, statement.word,
                   "plucks become nlPlucks with the same reach and maximum force: they act within "
                   "halfWidth before the ends meet, not up to halfWidth after");
  }
  has_pluck_ = true;
  emit(statement.origin, label + " nlPluck" + ends + " " +
                             scaled(element, 0, print_number(1.0 / pluck_peak)) + " " +
                             number(element, 2) + " " + damping);
}

// Returns the end of a pluck. With an offset, its port or ground is replaced by a mass that follows
// it at this distance: too heavy for a string to move, on a spring that is damped critically.
std::string SamTranslator::hand_at(const SamElement& pluck, std::size_t side) {
  const Statement& statement = *pluck.statement;
  const std::string offset = number(pluck, 3);
  const auto kind = [&](std::size_t end) {
    return elements_[by_name_.find(statement.names[end].text)->second].shape->kind;
  };
  const auto is_hand = [&](std::size_t end) {
    return by_name_.contains(statement.names[end].text) &&
           (kind(end) == SamKind::port || kind(end) == SamKind::ground);
  };
  const std::string& end = elements_[by_name_.find(statement.names[side].text)->second].end;
  if (offset == "0" || (side == 1 ? !is_hand(1) : is_hand(1) || !is_hand(2))) {
    if (offset != "0" && side == 2 && !is_hand(1)) {
      lines_.warning(statement.origin, statement.arguments[3],
                     "left out: an offset between two ends that move");
    }
    return end;
  }
  const std::string shift = lines_.tidy(statement.origin, statement.arguments[3],
                                        (side == 1 ? "-(" : "(") + offset + ")");
  const std::string hand = unique(label_of(pluck) + "_hand");
  emit(statement.origin,
       hand + " osc 1e11 0 1.9e10 " +
           lines_.tidy(statement.origin, statement.word, "-4.41e13*(" + shift + ")") + " " +
           print_number(lines_.value(shift)) + " 0");
  emit(statement.origin, unique(label_of(pluck) + "_arm") + " spring " + hand + " " + end + " 1e9");
  return hand;
}

// --- waveguides in a row -------------------------------------------------------------------------

// Returns the round-trip time of a wave in a waveguide, in seconds.
std::optional<std::string> SamTranslator::period_of(const SamElement& guide) {
  const Token& string = guide.statement->arguments[1];
  const std::size_t open = string.text.find('(');
  if (!string.text.starts_with("simpleString(") || string.text.back() != ')') {
    error(guide, string, "expected simpleString(maxT,T), T in seconds");
    return std::nullopt;
  }
  const std::vector<Token> parts =
      divided({string.text.substr(open + 1, string.text.size() - open - 2),
               string.column + static_cast<int>(open) + 1},
              ',');
  if (parts.size() != 2) {
    error(guide, string, "expected simpleString(maxT,T), T in seconds");
    return std::nullopt;
  }
  return lines_.expression(guide.statement->origin, parts[1]);
}

std::optional<SamTranslator::Loss> SamTranslator::loss_of(const SamElement& termination) {
  const Token& given = termination.statement->arguments[0];
  const std::size_t open = given.text.find('(');
  const std::string_view word = given.text.substr(0, open);
  std::vector<Token> parts;
  if (open != std::string_view::npos && given.text.back() == ')') {
    parts = divided({given.text.substr(open + 1, given.text.size() - open - 2),
                     given.column + static_cast<int>(open) + 1},
                    ',');
  }
  const bool is_simple = word == "simpleStringTerm" && parts.size() == 2;
  if (!is_simple && (word != "memorylessStringTerm" || parts.size() != 1)) {
    error(termination, given, "expected simpleStringTerm(r,fc) or memorylessStringTerm(r)");
    return std::nullopt;
  }
  const Origin& origin = termination.statement->origin;
  Loss loss;
  const std::string reflection = lines_.expression(origin, parts[0]);
  const double r = lines_.value(reflection);
  if (!(r != 0.0 && std::fabs(r) <= 1.0)) {
    error(termination, parts[0],
          "a reflection lies between -1 and 1 and is not 0, found " + print_number(r));
    return std::nullopt;
  }
  loss.is_free = r > 0.0;
  double constant = 0.0;
  if (parse_number(reflection, constant)) {
    loss.flat = print_number(-std::log(std::fabs(r)));
  } else {
    // -ln r = n asinh((r^(-1/n) - r^(1/n))/2), which is that half for a large n.
    const std::string size = "min(abs(" + reflection + "),1)";
    loss.flat =
        lines_.tidy(origin, parts[0], "512*(pow(" + size + ",-1/1024)-pow(" + size + ",1/1024))");
  }
  if (is_simple) {
    loss.fc = lines_.expression(origin, parts[1]);
    if (lines_.value(loss.fc) > 0.0 && lines_.value(loss.fc) < lowest_fc) {
      loss.fc =
          lines_.tidy(origin, parts[1], "max(" + loss.fc + "," + print_number(lowest_fc) + ")");
    }
    if (!(lines_.value(loss.fc) > 0.0)) {
      error(termination, parts[1], "fc must be above 0 Hz");
      return std::nullopt;
    }
  }
  return loss;
}

// Returns whether a junction only marks a place on a string of two waveguides. Any other junction
// is a knot, where strings end.
bool SamTranslator::is_place(const SamElement& node) {
  return node.guides.size() == 2 && scaled(elements_[node.guides[0]], 0, "44100") ==
                                        scaled(elements_[node.guides[1]], 0, "44100");
}

// Joins the waveguides between two terminations to one, with the junctions as places on it.
void SamTranslator::join_guides() {
  joined_.assign(elements_.size(), false);
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    const SamElement& guide = elements_[i];
    if (guide.shape->kind != SamKind::waveguide) {
      continue;
    }
    for (std::size_t side = 1; side <= 2; ++side) {
      const Token& name = guide.statement->names[side];
      const auto found = by_name_.find(name.text);
      const SamKind kind =
          found == by_name_.end() ? SamKind::audioout : elements_[found->second].shape->kind;
      if (kind != SamKind::termination && kind != SamKind::junction) {
        error(guide, name, "expected a termination or a junction, found " + quoted(name.text));
        joined_[i] = true;
      } else {
        elements_[found->second].guides.push_back(i);
      }
    }
  }
  bool is_right = true;
  for (const SamElement& node : elements_) {
    const std::size_t count = node.guides.size();
    const Token& name = node.statement->names[0];
    if (node.shape->kind == SamKind::termination && count != 1) {
      error(node, name,
            "a termination ends one waveguide, but this one ends " + std::to_string(count));
      is_right = false;
    } else if (node.shape->kind == SamKind::junction && count == 0) {
      lines_.warning(node.statement->origin, name,
                     "left out: " + quoted(name.text) + " joins no waveguide");
    }
  }
  for (std::size_t i = 0; is_right && i < elements_.size(); ++i) {
    if (elements_[i].shape->kind == SamKind::termination && !joined_[elements_[i].guides[0]]) {
      join_row(i);
    }
  }
  for (std::size_t i = 0; is_right && i < elements_.size(); ++i) {
    if (elements_[i].shape->kind == SamKind::waveguide && !joined_[i]) {
      error(elements_[i], elements_[i].statement->word,
            "this waveguide reaches no termination: it is in a ring, or between two junctions that "
            "do not join two waveguides of one impedance");
      return;
    }
  }
}

void SamTranslator::join_row(std::size_t termination) {
  const std::size_t first = elements_[termination].guides[0];
  const SamElement& named = elements_[first];
  const std::string label = label_of(named);
  const Origin& origin = named.statement->origin;
  const Token& word = named.statement->word;
  const std::string impedance = scaled(named, 0, "44100");
  const auto left = loss_of(elements_[termination]);
  if (!left) {
    joined_[first] = true;
    return;
  }
  const auto delay = [](const Loss& loss) {
    return loss.fc.empty() ? std::string("0") : "0.5/(" + loss.fc + ")";
  };
  std::string period = delay(*left);  // seconds, starting with the delay of the left end
  std::vector<std::pair<std::size_t, std::string>> places;  // junctions and their positions
  std::optional<Loss> right;
  std::string height = "0";
  std::size_t guide = first;
  std::size_t node = termination;
  while (!right) {
    joined_[guide] = true;
    const SamElement& here = elements_[guide];
    const auto more = period_of(here);
    if (!more) {
      return;
    }
    if (scaled(here, 0, "44100") != impedance) {
      return error(
          here, here.statement->arguments[0],
          "a row of waveguides must have one impedance, here " + impedance + " per sample");
    }
    period = lines_.join(origin, word, period, '+', *more);
    const auto by_name = [&](std::size_t side) {
      return by_name_.find(here.statement->names[side].text)->second;
    };
    node = by_name(1) == node ? by_name(2) : by_name(1);
    SamElement& next = elements_[node];
    if (next.shape->kind == SamKind::termination) {
      right = loss_of(next);
      if (!right) {
        return;
      }
      break;
    }
    const std::string its_height = fixed(next, 0);
    if (!is_place(next)) {
      if (!places.empty()) {
        return error(next, next.statement->names[0],
                     "a junction of two waveguides of one impedance cannot be between " +
                         quoted(next.statement->names[0].text) + " and a termination");
      }
      height = its_height;
      break;
    }
    if (!places.empty() && its_height != height) {
      return error(next, next.statement->arguments[0],
                   "the junctions of a row must have one height, here " + height);
    }
    height = its_height;
    places.emplace_back(node, period);
    if (next.guides[0] == next.guides[1]) {
      return error(here, here.statement->word, "this waveguide has both ends at one junction");
    }
    guide = next.guides[0] == guide ? next.guides[1] : next.guides[0];
    if (joined_[guide]) {
      return;  // already reported
    }
  }
  // A string that ends in a knot is half of a string of half the impedance. The knot is in its
  // middle, and both halves move alike.
  const bool is_half = !right;
  if (is_half) {
    right = left;
    period = lines_.join(origin, word, "2", '*', period);
  }
  if (left->is_free != right->is_free) {
    return error(elements_[node], elements_[node].statement->arguments[0],
                 "both ends of a row of waveguides must be fixed (reflection below 0) or both free "
                 "(above 0)");
  }
  period = lines_.join(origin, word, period, '+', is_half ? "0" : delay(*right));
  if (!(lines_.value(period) > 0.0)) {
    return error(named, word, "the T of this row must be above 0 s");
  }
  const auto join = [&](const std::string& a, char op, const std::string& b) {
    return lines_.join(origin, word, a, op, b);
  };
  // The loss per period is flat + mean/period^2.
  const std::string flat = join(left->flat, '+', right->flat);
  std::string mean = "0";
  for (const Loss* loss : {static_cast<const Loss*>(&*left), static_cast<const Loss*>(&*right)}) {
    if (!loss->fc.empty()) {
      mean = join(mean, '+', join("1.6449340668482264", '/', join(loss->fc, '^', "2")));
    }
  }
  const std::string blur = join(mean, '/', join(period, '^', "2"));
  const std::string all = join("max(" + flat + ",1e-9)", '+', blur);
  const std::string r = is_half ? lines_.tidy(origin, word, "0.5*(" + impedance + ")") : impedance;
  emit(origin, label + (left->is_free ? " openWaveguide " : " waveguide ") + r + " " +
                   join("1", '/', period) + " " +
                   join(join("6.907755278982137", '*', period), '/', all) + " " +
                   join("1", '/', join("1", '+', join(blur, '/', "max(" + flat + ",1e-9)"))) + " " +
                   height);
  for (const auto& [junction, to] : places) {
    elements_[junction].end = "[" + label + " " + join(to, '/', period) + "]";
  }
  elements_[termination].end = "[" + label + " 0]";
  if (is_half) {
    return join_knot(node, label, impedance);
  }
  elements_[node].end = "[" + label + " 1]";
}

// Ties the middle of a string to the others of its junction.
void SamTranslator::join_knot(std::size_t junction, const std::string& string,
                              const std::string& impedance) {
  SamElement& knot = elements_[junction];
  const Statement& statement = *knot.statement;
  const std::string middle = "[" + string + " 0.5]";
  if (knot.end.empty()) {
    knot.end = middle;
    return;
  }
  emit(statement.origin, unique(string + "_tie") + " spring " + middle + " " + knot.end + " " +
                             lines_.tidy(statement.origin, statement.word,
                                         std::string(tie_stiffness) + "*(" + impedance + ")"));
}

// --- outputs -------------------------------------------------------------------------------------

// Returns the signal of an element: its position, or the force of a link.
std::optional<SamSignal> SamTranslator::heard(const SamElement& out, const Token& name) {
  const auto found = by_name_.find(name.text);
  if (found == by_name_.end() || elements_[found->second].shape->kind == SamKind::waveguide ||
      elements_[found->second].shape->kind == SamKind::audioout) {
    error(out, name,
          found == by_name_.end()
              ? "there is no element or number called " + quoted(name.text) + like(name.text)
              : quoted(name.text) + " has no position");
    return std::nullopt;
  }
  const SamElement& element = elements_[found->second];
  if (is_link(element.shape->kind)) {
    return force_of(element);
  }
  return SamSignal{.parts = {{.element = &element, .level = "1"}}};
}

// Returns the force of a link. Synth-A-Modeler computes it from the positions one sample before,
// which are x - v, with velocities v - a. The force of a touch or a pluck is the whole force on one
// of its ends, if nothing else acts there.
std::optional<SamSignal> SamTranslator::force_of(const SamElement& link) {
  SamSignal force;
  std::size_t ends[2];
  for (std::size_t side = 0; side < 2; ++side) {
    const auto found = by_name_.find(link.statement->names[side + 1].text);
    if (found == by_name_.end()) {
      return std::nullopt;  // write_link reports it
    }
    ends[side] = found->second;
  }
  if (link.shape->kind == SamKind::link) {
    const std::string k = number(link, 0);
    const std::string offset = number(link, 2);
    const std::string r = scaled(link, 1, "44100");
    const std::string levels[] = {k, r + "-(" + k + ")", "-(" + r + ")"};
    for (std::size_t side = 0; side < 2; ++side) {
      for (int derivative = 0; derivative < 3; ++derivative) {
        const std::string level =
            (side == 0 ? "" : "-(") + levels[derivative] + (side == 0 ? "" : ")");
        force.parts.push_back(
            {.element = &elements_[ends[side]],
             .derivative = derivative,
             .level = lines_.tidy(link.statement->origin, link.statement->word, level)});
      }
    }
    if (offset != "0") {
      force.number = lines_.tidy(link.statement->origin, link.statement->word,
                                 "-(" + k + ")*(" + offset + ")");
    }
    return force;
  }
  for (const std::size_t side : {std::size_t{1}, std::size_t{0}}) {
    const std::string_view end = link.statement->names[side + 1].text;
    const auto links = std::ranges::count_if(elements_, [&](const SamElement& other) {
      return is_link(other.shape->kind) &&
             (other.statement->names[1].text == end || other.statement->names[2].text == end);
    });
    if (links == 1 && elements_[ends[side]].guides.empty()) {
      force.parts.push_back(
          {.element = &elements_[ends[side]], .is_force = true, .level = side == 1 ? "1" : "-1"});
      return force;
    }
  }
  lines_.warning(link.statement->origin, link.statement->names[0],
                 "left out of the outputs: the force of " + quoted(link.statement->names[0].text) +
                     ", as other links act on both of its ends");
  return SamSignal{};
}

// Returns the mass of a filter, or null behind a termination, which does not move. It is so light
// that it does not load its source: an inertia of 1e-7, and 1e-11 of that of the filter before it.
const SamElement* SamTranslator::follower(const SamElement& out, const SamElement& source,
                                          const SamFilter& filter) {
  if (source.shape->kind == SamKind::termination || source.filters == most_filters) {
    return nullptr;
  }
  const auto [at, is_new] = followers_.try_emplace({source.end, filter.stiffness, filter.damping});
  SamElement& mass = at->second;
  if (is_new) {
    const Origin& origin = out.statement->origin;
    mass = {.statement = out.statement, .shape = source.shape, .filters = source.filters + 1};
    if (source.end.empty()) {
      return &mass;  // join_row reports it
    }
    mass.end = unique("@filter" + std::to_string(followers_.size()));
    const std::string inertia = print_number(std::pow(10.0, 4 - 11 * mass.filters));
    const auto scaled_by_inertia = [&](const std::string& factor) {
      return lines_.join(origin, out.statement->word, inertia, '*', factor);
    };
    emit(origin, mass.end + " osc " + inertia + " 0 " + scaled_by_inertia(filter.damping) + " 0 0");
    emit(origin, unique(mass.end + "_link") + " spring " + mass.end + " " + source.end + " " +
                     scaled_by_inertia(filter.stiffness));
  }
  return &mass;
}

void SamTranslator::write_output(const SamElement& element) {
  const Statement& statement = *element.statement;
  const Token& text = statement.arguments[0];
  const auto signal = lines_.signal(
      statement.origin, text, statement.names[0].text,
      {.heard = [&](const Token& name) { return heard(element, name); },
       .follower = [&](const SamElement& source,
                       const SamFilter& filter) { return follower(element, source, filter); }});
  if (!signal) {
    return;
  }
  const std::string channel = "@out" + std::to_string(++outputs_);
  bool has_termination = false;
  for (const SamSignal::Part& part : signal->parts) {
    const SamElement& source = *part.element;
    has_termination = has_termination || source.shape->kind == SamKind::termination;
    if (!source.end.empty() && part.level != "0") {  // otherwise join_row has reported it
      constexpr const char* words[] = {" posOutput ", " velOutput ", " accOutput "};
      emit(statement.origin, channel + (part.is_force ? " frcOutput " : words[part.derivative]) +
                                 source.end + (part.level == "1" ? "" : " " + part.level));
    }
  }
  if (signal->is_number() || signal->number != "0") {
    const std::string one = unique("@one");
    if (!has_one_) {
      emit(statement.origin, one + " ground 1");
    }
    has_one_ = true;
    emit(statement.origin, channel + " posOutput " + one + " " + signal->number);
  }
  if (has_termination) {
    lines_.warning(statement.origin, statement.word,
                   quoted(statement.names[0].text) +
                       " is taken one sample from the termination, where the position of the "
                       "string is proportional to the incoming wave");
  }
}

}  // namespace

Translation translate_synth_a_modeler(std::string_view text, const Progress& progress) {
  return SamTranslator().translate(text, progress);
}

}  // namespace ressort::model
