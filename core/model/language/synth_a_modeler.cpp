#include "core/model/language/synth_a_modeler.h"

#include <algorithm>

#include "core/model/language/sam_teller.h"

namespace ressort::model {
namespace {

// 0.9 K/10 is the most that nlPluck pushes with per scale, where a pluck of theirs has k.
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
    {"audioout", SamKind::audioout, 1, 1, 1, "audioout,id,what is heard;"},
};

// As our inputs and outputs are called.
bool is_channel(std::string_view name) {
  const std::size_t start = name.starts_with("in") ? 2 : name.starts_with("out") ? 3 : name.size();
  return start < name.size() && name.find_first_not_of("0123456789", start) == name.npos;
}

}  // namespace

ToldText SamTeller::tell(std::string_view text, const Progress& progress) {
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

void SamTeller::declare() {
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
                   quoted(name.text) + " is a number already, by its faustcode");
    } else if (const auto [at, is_new] = by_name_.try_emplace(name.text, elements_.size() - 1);
               !is_new) {
      lines_.error(statement.origin, name,
                   quoted(name.text) + " is already declared in line " +
                       std::to_string(elements_[at->second].statement->origin.line));
    }
  }
}

// True if it is an element that can be told.
bool SamTeller::declare(const Statement& statement) {
  const std::string_view word = statement.word.text;
  if (word == "controladjust" || word == "display") {
    lines_.warning(statement.origin, statement.word,
                   "ignored: " + quoted(word) + " has no meaning here; a slider changes a number");
    return false;
  }
  const auto* const shape = std::find_if(std::begin(shapes), std::end(shapes),
                                         [&](const SamShape& known) { return known.word == word; });
  if (shape == std::end(shapes)) {
    lines_.error(statement.origin, statement.word,
                 quoted(word) + " is not read: " +
                     (word.starts_with("pulseTouch")
                          ? "write a touch, and strike by a force input of a model of ours"
                      : word.ends_with("link") || word == "detent"
                          ? "write a link or a touch"
                          : "Synth-A-Modeler itself has no such element"));
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

std::string SamTeller::label_of(const SamElement& element) const {
  const std::string_view name = element.statement->names[0].text;
  std::string label = "@" + std::string(name);
  while (is_channel(name) && by_name_.contains(std::string_view(label).substr(1))) {
    label += "_";
  }
  return label;
}

void SamTeller::name_ends() {
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
        break;  // a junction's comes with its row
    }
  }
}

// A link with an offset pushes its ends apart by k o also where they are.
void SamTeller::add_forces() {
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
        continue;  // write_link tells
      }
      SamElement& end = elements_[found->second];
      if (end.shape->kind == SamKind::mass) {
        end.force += (side == 1 ? "-(" : "+(") + number(link, 0) + ")*(" + offset + ")";
        if (end.force.size() > longest_expression) {
          error(link, name, "too many links with an offset hold " + quoted(name.text));
          end.force.clear();
        }
      } else if (end.shape->kind != SamKind::ground && end.shape->kind != SamKind::port) {
        error(link, link.statement->arguments[2],
              "an offset is read between masses, grounds and ports; here it must be 0");
      }
    }
  }
}

void SamTeller::write(const SamElement& element) {
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
      return;  // join_row has written it
  }
}

// A mode of mass m_i gives way as one of m_1 whose place moves sqrt(m_1/m_i) as far.
void SamTeller::write_resonators(const SamElement& element) {
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
        return error(element, own,
                     "how the masses of one element's resonators compare must be a number");
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

// The nearest name of what a link may hold.
std::string SamTeller::like(std::string_view name) const {
  std::vector<std::string_view> names;
  for (const SamElement& other : elements_) {
    if (!other.end.empty() && names.size() < most_suggestions) {
      names.push_back(other.statement->names[0].text);
    }
  }
  return suggestion(name, names);
}

void SamTeller::write_link(const SamElement& element) {
  const Statement& statement = *element.statement;
  std::string ends;
  for (std::size_t side = 1; side <= 2; ++side) {
    const Token& name = statement.names[side];
    const auto found = by_name_.find(name.text);
    if (found == by_name_.end()) {
      return error(element, name, "nothing is called " + quoted(name.text) + like(name.text));
    }
    const SamElement& end = elements_[found->second];
    if (end.shape->kind == SamKind::junction && end.end.empty()) {
      return;  // its row has been told
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
    case SamKind::touch:  // acts while x_a - x_b is above o; ours, above -t
      return emit(statement.origin, label + " contact" + ends + " " + number(element, 0) + " " +
                                        damping + " " + scaled(element, 2, "-1"));
    default:
      break;
  }
  if (number(element, 3) != "0") {
    return error(element, statement.arguments[3], "a pluck's offset is not read: it must be 0");
  }
  lines_.warning(statement.origin, statement.word,
                 "read as an nlPluck of the same reach and the same greatest force: it pushes from "
                 "halfWidth before the ends meet, not up to halfWidth behind");
  emit(statement.origin, label + " nlPluck" + ends + " " +
                             scaled(element, 0, print_number(1.0 / pluck_peak)) + " " +
                             number(element, 2) + " " + damping);
}

ToldText tell_synth_a_modeler(std::string_view text, const Progress& progress) {
  return SamTeller().tell(text, progress);
}

}  // namespace ressort::model
