#include "core/model/language/synth_a_modeler.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "core/model/language/expression.h"
#include "core/model/language/sam_lines.h"

namespace ressort::model {
namespace {

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

bool is_link(SamKind kind) {
  return kind == SamKind::link || kind == SamKind::touch || kind == SamKind::pluck;
}

struct SamElement {
  const Statement* statement = nullptr;
  const SamShape* shape = nullptr;
  std::string end;                  // reference for the end of a link; empty if no link may attach
  std::string force;                // constant force towards -x; masses only
  std::vector<std::size_t> guides;  // waveguides that end here; terminations and junctions only
};

// The signal of an audioout: a sum of elements, each times an expression ("": 1), or an expression
// without elements.
struct SamSignal {
  struct Part {
    std::size_t element = 0;
    std::string level;
  };
  std::vector<Part> parts;
  std::string number;

  bool is_number() const { return parts.empty(); }
  // Surrounds each of its expressions with these.
  void wrap(const std::string& before, const std::string& behind) {
    for (Part& part : parts) {
      part.level = before + (part.level.empty() ? "1" : part.level) + behind;
    }
    number = before + number + behind;
  }
};

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
  void join_row(std::size_t termination);
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
  std::optional<SamSignal> sum(const SamElement& out, Token& rest, int depth);
  std::optional<SamSignal> product(const SamElement& out, Token& rest, int depth);
  std::optional<SamSignal> factor(const SamElement& out, Token& rest, int depth);

  std::string number(const SamElement& element, std::size_t at) {
    return lines_.expression(element.statement->origin, element.statement->arguments[at]);
  }
  std::string scaled(const SamElement& element, std::size_t at, const std::string& factor) {
    return lines_.tidy(element.statement->origin, element.statement->arguments[at],
                       factor + "*(" + number(element, at) + ")");
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
  std::vector<bool> joined_;  // [element] a waveguide that is part of a row
  int ports_ = 0;
  int outputs_ = 0;
  Translation out_;
};

// Maximum force of nlPluck per SCALE and K, 0.9/10; a pluck of Synth-A-Modeler has k.
constexpr double pluck_peak = 0.09;

constexpr std::size_t longest_name = 900;  // bytes

constexpr SamShape shapes[] = {
    {"mass", SamKind::mass, 3, 3, 1, "mass(m,x0,v0),id;"},
    {"ground", SamKind::ground, 1, 1, 1, "ground(x),id;"},
    {"port", SamKind::port, 0, 0, 1, "port(),id;"},
    {"resonators", SamKind::resonators, 3, 3000, 1, "resonators(f,tau,m, f,tau,m, ...),id;"},
    {"resonator", SamKind::resonators, 3, 3, 1, "resonator(f,tau,m),id;"},
    {"link", SamKind::link, 3, 3, 3, "link(k,R,o),id,a,b;"},
    {"touch", SamKind::touch, 3, 3, 3, "touch(k,R,o),id,a,b;"},
    {"pluck", SamKind::pluck, 4, 4, 3, "pluck(k,R,halfWidth,o),id,a,b;"},
    {"waveguide", SamKind::waveguide, 2, 2, 3, "waveguide(Z0,simpleString(maxT,T)),id,left,right;"},
    {"termination", SamKind::termination, 1, 1, 1, "termination(simpleStringTerm(r,fc)),id;"},
    {"junction", SamKind::junction, 1, 1, 1, "junction(height),id;"},
    {"audioout", SamKind::audioout, 1, 1, 1, "audioout,id,signal;"},
};

// Returns true for names that are reserved for inputs and outputs.
bool is_channel(std::string_view name) {
  const std::size_t start = name.starts_with("in") ? 2 : name.starts_with("out") ? 3 : name.size();
  return start < name.size() && name.find_first_not_of("0123456789", start) == name.npos;
}

constexpr int deepest_sum = 50;  // nested parentheses and signs
constexpr std::size_t longest_levels = 10 * longest_expression;

std::size_t length_of(const SamSignal& heard) {
  std::size_t length = heard.number.size();
  for (const SamSignal::Part& part : heard.parts) {
    length += part.level.size();
  }
  return length;
}

Translation SamTranslator::translate(std::string_view text, const Progress& progress) {
  progress.stage("reading it");
  lines_.read(text, progress);
  declare();
  name_ends();
  join_guides();
  add_forces();
  for (std::size_t i = 0; i < lines_.parameters.size(); ++i) {
    emit(lines_.parameter_lines[i],
         "@" + lines_.parameters[i] + " param " + print_number(lines_.values[i]));
  }
  for (const SamElement& element : elements_) {
    if (lines_.is_full()) {
      break;
    }
    write(element);
    progress.spend(20);
  }
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
  if (word == "controladjust" || word == "display") {
    lines_.warning(statement.origin, statement.word,
                   "ignored: " + quoted(word) + " is not supported; sliders become parameters");
    return false;
  }
  const auto* const shape = std::find_if(std::begin(shapes), std::end(shapes),
                                         [&](const SamShape& known) { return known.word == word; });
  if (shape == std::end(shapes)) {
    lines_.error(statement.origin, statement.word,
                 quoted(word) + " is not supported: " +
                     (word.starts_with("pulseTouch")
                          ? "write a touch, or convert the model and strike it by a force input"
                      : word.ends_with("link") || word == "detent"
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
    std::string shape = "1";
    if (at > 0 && number(element, at + 2) != first) {
      shape = lines_.tidy(origin, own, "sqrt((" + first + ")/(" + number(element, at + 2) + "))");
      double constant = 0.0;
      if (!parse_number(shape, constant)) {
        return error(element, own, "the ratio of the masses of these resonators must be a number");
      }
    }
    std::string mode = label + "_" + std::to_string(at / 3 + 1);
    while (by_name_.contains(mode.substr(1))) {
      mode += "_";
    }
    emit(origin, mode + " mode " + label + " " + number(element, at) + " " +
                     scaled(element, at + 1, "6.907755278982137") + " " + shape);
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
    ends += " " + end.end;
  }
  const std::string label = label_of(element);
  const std::string damping = scaled(element, 1, "44100");
  switch (element.shape->kind) {
    case SamKind::link:
      return emit(statement.origin,
                  label + " spring" + ends + " " + number(element, 0) + " " + damping);
    case SamKind::touch:  // acts for x_a - x_b > o; a contact, for d > -t
      return emit(statement.origin, label + " contact" + ends + " " + number(element, 0) + " " +
                                        damping + " " + scaled(element, 2, "-1"));
    default:
      break;
  }
  if (number(element, 3) != "0") {
    return error(element, statement.arguments[3],
                 "a pluck's offset is not supported: it must be 0");
  }
  lines_.warning(statement.origin, statement.word,
                 "converted to an nlPluck with the same reach and maximum force: it acts within "
                 "halfWidth before the ends meet, not up to halfWidth after");
  emit(statement.origin, label + " nlPluck" + ends + " " +
                             scaled(element, 0, print_number(1.0 / pluck_peak)) + " " +
                             number(element, 2) + " " + damping);
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
    // The series of -ln r in (1-r)/(1+r), which is small for a reflection near 1.
    const std::string size = "min(abs(" + reflection + "),1)";
    const std::string ratio = "((1-" + size + ")/(1+" + size + "))";
    loss.flat = "2*" + ratio + "+2/3*pow(" + ratio + ",3)";
  }
  if (is_simple) {
    loss.fc = lines_.expression(origin, parts[1]);
    if (!(lines_.value(loss.fc) > 0.0)) {
      error(termination, parts[1], "fc must be above 0 Hz");
      return std::nullopt;
    }
  }
  return loss;
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
    } else if (node.shape->kind == SamKind::junction && count != 2) {
      error(node, name,
            "a junction joins two waveguides, but this one joins " + std::to_string(count) +
                (count > 2 ? "; connect junctions of two by a stiff link instead" : ""));
      is_right = false;
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
            "this waveguide is in a ring: a row of them needs a termination at each end");
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
    period = lines_.tidy(origin, word, period + "+" + *more);
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
  if (left->is_free != right->is_free) {
    return error(elements_[node], elements_[node].statement->arguments[0],
                 "both ends of a row of waveguides must be fixed (reflection below 0) or both free "
                 "(above 0)");
  }
  period = lines_.tidy(origin, word, period + "+" + delay(*right));
  if (!(lines_.value(period) > 0.0)) {
    return error(named, word, "the T of this row must be above 0 s");
  }
  const std::string flat = left->flat + "+" + right->flat;
  std::string mean = "0";
  for (const Loss* loss : {static_cast<const Loss*>(&*left), static_cast<const Loss*>(&*right)}) {
    mean +=
        loss->fc.empty() ? "" : "+1.6449340668482264/pow((" + loss->fc + ")*(" + period + "),2)";
  }
  const std::string all = "max(" + flat + "+" + mean + ",1e-9)";  // ln of the loss per period
  emit(origin, label + (left->is_free ? " openWaveguide " : " waveguide ") + impedance + " " +
                   lines_.tidy(origin, word, "1/(" + period + ")") + " " +
                   lines_.tidy(origin, word, "6.907755278982137*(" + period + ")/" + all) + " " +
                   lines_.tidy(origin, word, "min(max((" + flat + ")/" + all + ",0),1)") + " " +
                   height);
  for (const auto& [junction, to] : places) {
    elements_[junction].end =
        "[" + label + " " + lines_.tidy(origin, word, "(" + to + ")/(" + period + ")") + "]";
  }
  elements_[termination].end = "[" + label + " 0]";
  elements_[node].end = "[" + label + " 1]";
}

// --- outputs -------------------------------------------------------------------------------------

std::optional<SamSignal> SamTranslator::factor(const SamElement& out, Token& rest, int depth) {
  const auto refuse = [&](const std::string& message) {
    error(out, {rest.text.substr(0, 1), rest.column}, message);
    return std::nullopt;
  };
  const auto skip = [&](std::size_t count) {
    rest = trimmed({rest.text.substr(count), rest.column + static_cast<int>(count)});
  };
  if (rest.text.starts_with('-') || rest.text.starts_with('+')) {
    const bool is_negative = rest.text.starts_with('-');
    if (depth >= deepest_sum) {
      return refuse("too many signs in a row");
    }
    skip(1);
    auto heard = factor(out, rest, depth + 1);
    if (heard && is_negative) {
      heard->wrap("-(", ")");
    }
    return heard;
  }
  if (rest.text.starts_with('(')) {
    if (depth >= deepest_sum) {
      return refuse("the parentheses are nested too deeply");
    }
    skip(1);
    auto inner = sum(out, rest, depth + 1);
    if (inner && !rest.text.starts_with(')')) {
      return refuse(
          "expected ')': an output is a sum of signals times numbers; other FAUST code is not "
          "supported");
    }
    if (inner) {
      skip(1);
    }
    return inner;
  }
  const std::size_t length =
      is_identifier(rest.text.substr(0, 1)) ? word_length(rest.text) : number_length(rest.text);
  const Token word{rest.text.substr(0, length), rest.column};
  if (length == 0) {
    return refuse("expected the name of an element or a number");
  }
  const auto found = by_name_.find(word.text);
  SamSignal heard;
  if (found == by_name_.end()) {
    heard.number = "(" + lines_.expression(out.statement->origin, word) + ")";  // or an error
  } else if (is_link(elements_[found->second].shape->kind) ||
             elements_[found->second].shape->kind == SamKind::waveguide ||
             elements_[found->second].shape->kind == SamKind::audioout) {
    error(out, word,
          quoted(word.text) +
              " has no position: expected a mass, resonators, a junction, a termination or a port");
    return std::nullopt;
  } else {
    heard.parts.push_back({found->second, ""});
  }
  skip(length);
  return heard;
}

std::optional<SamSignal> SamTranslator::product(const SamElement& out, Token& rest, int depth) {
  auto first = factor(out, rest, depth);
  if (!first) {
    return std::nullopt;
  }
  SamSignal heard = std::move(*first);
  while (rest.text.starts_with('*') || rest.text.starts_with('/')) {
    const Token sign{rest.text.substr(0, 1), rest.column};
    rest = trimmed({rest.text.substr(1), rest.column + 1});
    auto next = factor(out, rest, depth);
    if (!next) {
      return std::nullopt;
    }
    if (!next->is_number() && (!heard.is_number() || sign.text == "/")) {
      error(out, sign, "a signal may be multiplied by numbers, not by another signal");
      return std::nullopt;
    }
    if (next->is_number()) {
      heard.wrap("(", ")" + std::string(sign.text) + next->number);
    } else {
      next->wrap(heard.number + "*(", ")");
      heard = std::move(*next);
    }
    if (length_of(heard) > longest_levels) {
      error(out, sign, "too many factors in this output");
      return std::nullopt;
    }
  }
  return heard;
}

std::optional<SamSignal> SamTranslator::sum(const SamElement& out, Token& rest, int depth) {
  std::optional<SamSignal> all;
  bool is_taken_away = false;
  for (;;) {
    const Token place = rest;
    auto heard = product(out, rest, depth);
    if (!heard) {
      return std::nullopt;
    }
    if (heard->is_number() && (depth == 0 || (all && !all->is_number()))) {
      error(out, place, "expected a signal, found only a number");
      return std::nullopt;
    }
    if (all && all->is_number() && !heard->is_number()) {
      error(out, place, "expected a number: a signal cannot be added to numbers in parentheses");
      return std::nullopt;
    }
    if (is_taken_away) {
      heard->wrap("-(", ")");
    }
    if (all) {
      all->parts.insert(all->parts.end(), heard->parts.begin(), heard->parts.end());
      all->number += "+" + heard->number;
    } else {
      all = std::move(heard);
    }
    if (!rest.text.starts_with('+') && !rest.text.starts_with('-')) {
      if (all->is_number()) {
        all->number = "(" + all->number + ")";
      }
      return all;
    }
    is_taken_away = rest.text.starts_with('-');
    rest = trimmed({rest.text.substr(1), rest.column + 1});
  }
}

void SamTranslator::write_output(const SamElement& element) {
  const Statement& statement = *element.statement;
  Token rest = statement.arguments[0];
  if (rest.text.size() > longest_expression) {
    return error(element, rest, "this output is too long");
  }
  const auto heard = sum(element, rest, 0);
  if (!heard) {
    return;
  }
  if (!rest.text.empty()) {
    return error(element, rest,
                 "found " + quoted(rest.text) +
                     " where ';' was expected: other FAUST code is not supported");
  }
  const std::string name = quoted(statement.names[0].text);
  const std::string output = "@out" + std::to_string(outputs_ + 1) + " posOutput ";
  bool is_heard = false;
  bool has_termination = false;
  for (const SamSignal::Part& part : heard->parts) {
    const SamElement& source = elements_[part.element];
    has_termination = has_termination || source.shape->kind == SamKind::termination;
    if (!source.end.empty()) {  // otherwise join_row has reported it
      const std::string level =
          part.level.empty()
              ? ""
              : " " + lines_.tidy(statement.origin, statement.arguments[0], part.level);
      emit(statement.origin, output + source.end + level);
      is_heard = true;
    }
  }
  outputs_ += is_heard ? 1 : 0;
  if (has_termination) {
    lines_.warning(statement.origin, statement.word,
                   name +
                       " is taken one sample from the termination, where the position of the "
                       "string is proportional to the incoming wave");
  }
}

}  // namespace

Translation translate_synth_a_modeler(std::string_view text, const Progress& progress) {
  return SamTranslator().translate(text, progress);
}

}  // namespace ressort::model
