// Waveguides in a row, joined.
#include <algorithm>
#include <cmath>

#include "core/model/language/sam_teller.h"

namespace ressort::model {

// The seconds that a wave takes to and fro in a guide.
std::optional<std::string> SamTeller::period_of(const SamElement& guide) {
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

std::optional<SamTeller::Loss> SamTeller::loss_of(const SamElement& termination) {
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
          "a reflection goes from -1 to 1 and is not 0, found " + print_number(r));
    return std::nullopt;
  }
  loss.is_free = r > 0.0;
  double constant = 0.0;
  if (parse_number(reflection, constant)) {
    loss.flat = print_number(-std::log(std::fabs(r)));
  } else {
    // -ln r by its series in (1-r)/(1+r), which a reflection near 1 makes small.
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

// Guides in a row between two terminations are one waveguide, its junctions places on it.
void SamTeller::join_guides() {
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
      error(node, name, "a termination ends one waveguide, this one " + std::to_string(count));
      is_right = false;
    } else if (node.shape->kind == SamKind::junction && count != 2) {
      error(node, name,
            "a junction joins two waveguides, this one " + std::to_string(count) +
                (count > 2 ? "; more are not read: link junctions of two by a stiff link" : ""));
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

void SamTeller::join_row(std::size_t termination) {
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
  std::string period = delay(*left);  // seconds, from the left end's own delay on
  std::vector<std::pair<std::size_t, std::string>> places;  // junctions, and where
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
      return error(here, here.statement->arguments[0],
                   "a row of waveguides has one impedance, here " + impedance +
                       " per sample: others are not read");
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
                   "the junctions of a row have one height, here " + height);
    }
    height = its_height;
    places.emplace_back(node, period);
    if (next.guides[0] == next.guides[1]) {
      return error(here, here.statement->word, "this waveguide has both ends at one junction");
    }
    guide = next.guides[0] == guide ? next.guides[1] : next.guides[0];
    if (joined_[guide]) {
      return;  // it has been told
    }
  }
  if (left->is_free != right->is_free) {
    return error(
        elements_[node], elements_[node].statement->arguments[0],
        "a row of waveguides has both ends held, reflections below 0, or both free, above");
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
  const std::string all = "max(" + flat + "+" + mean + ",1e-9)";  // per period, of ln
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

}  // namespace ressort::model
