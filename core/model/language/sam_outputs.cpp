// What an audioout hears.
#include <algorithm>
#include <set>

#include "core/model/language/sam_teller.h"

namespace ressort {
namespace {

constexpr int deepest_sum = 50;  // parentheses in what is heard

}  // namespace

std::optional<SamHeard> SamTeller::factor(const SamElement& out, Token& rest, int depth) {
  const auto refuse = [&](const std::string& message) {
    error(out, {rest.text.substr(0, 1), rest.column}, message);
    return std::nullopt;
  };
  const auto skip = [&](std::size_t count) {
    rest = trimmed({rest.text.substr(count), rest.column + static_cast<int>(count)});
  };
  while (rest.text.starts_with('-') || rest.text.starts_with('+')) {
    skip(1);
  }
  if (rest.text.starts_with('(')) {
    if (depth >= deepest_sum) {
      return refuse("the parentheses are nested too deeply");
    }
    skip(1);
    auto inner = sum(out, rest, depth + 1);
    if (inner && !rest.text.starts_with(')')) {
      return refuse("expected ')', or what is heard plus and times what; FAUST code is not read");
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
    return refuse("expected what is heard, by its name, or a number");
  }
  const auto found = by_name_.find(word.text);
  SamHeard heard;
  if (found == by_name_.end()) {
    lines_.expression(out.statement->origin, word);  // a number, or told
    heard.has_gain = true;
  } else if (is_link(elements_[found->second].shape->kind) ||
             elements_[found->second].shape->kind == SamKind::waveguide ||
             elements_[found->second].shape->kind == SamKind::audioout) {
    error(out, word,
          quoted(word.text) +
              " has no position: expected a mass, resonators, a junction, a termination or a port");
    return std::nullopt;
  } else {
    heard.elements.push_back(found->second);
  }
  skip(length);
  return heard;
}

std::optional<SamHeard> SamTeller::product(const SamElement& out, Token& rest, int depth) {
  auto heard = factor(out, rest, depth);
  while (heard && (rest.text.starts_with('*') || rest.text.starts_with('/'))) {
    const Token sign{rest.text.substr(0, 1), rest.column};
    rest = trimmed({rest.text.substr(1), rest.column + 1});
    auto next = factor(out, rest, depth);
    if (!next) {
      return std::nullopt;
    }
    if (!next->elements.empty() && (!heard->elements.empty() || sign.text == "/")) {
      error(out, sign, "what is heard may be multiplied by numbers, not by what else is heard");
      return std::nullopt;
    }
    heard->elements.insert(heard->elements.end(), next->elements.begin(), next->elements.end());
    heard->has_gain = true;
  }
  return heard;
}

std::optional<SamHeard> SamTeller::sum(const SamElement& out, Token& rest, int depth) {
  SamHeard all;
  for (;;) {
    all.has_gain = all.has_gain || rest.text.starts_with('-');
    const auto heard = product(out, rest, depth);
    if (!heard) {
      return std::nullopt;
    }
    if (heard->elements.empty() && depth == 0) {
      error(out, rest, "expected what is heard, found a number alone");
      return std::nullopt;
    }
    all.elements.insert(all.elements.end(), heard->elements.begin(), heard->elements.end());
    all.has_gain = all.has_gain || heard->has_gain;
    if (!rest.text.starts_with('+') && !rest.text.starts_with('-')) {
      return all;
    }
    all.has_gain = all.has_gain || rest.text.starts_with('-');
    rest = trimmed({rest.text.substr(1), rest.column + 1});
  }
}

void SamTeller::write_output(const SamElement& element) {
  const Statement& statement = *element.statement;
  Token rest = statement.arguments[0];
  const auto heard = sum(element, rest, 0);
  if (!heard) {
    return;
  }
  if (!rest.text.empty()) {
    return error(element, rest,
                 "found " + quoted(rest.text) +
                     " where the ';' was expected: FAUST code behind what is heard is not read");
  }
  const int first = outputs_ + 1;
  std::set<std::size_t> told;
  bool has_termination = false;
  for (const std::size_t index : heard->elements) {
    if (!told.insert(index).second) {
      continue;
    }
    const SamElement& source = elements_[index];
    has_termination = has_termination || source.shape->kind == SamKind::termination;
    if (!source.end.empty()) {  // else its row has been told
      emit(statement.origin, "@out" + std::to_string(++outputs_) + " posOutput " + source.end);
    }
  }
  const std::string name = quoted(statement.names[0].text);
  if (told.size() > 1) {
    lines_.warning(statement.origin, statement.word,
                   name + " is a sum: what it adds are outputs " + std::to_string(first) + " to " +
                       std::to_string(outputs_));
  }
  if (heard->has_gain) {
    lines_.warning(statement.origin, statement.word,
                   name + " loses its gains: outputs are positions; a preset says how loud");
  }
  if (has_termination) {
    lines_.warning(statement.origin, statement.word,
                   name +
                       " is heard one sample from the termination, where the string's position "
                       "is in proportion to the wave that comes in");
  }
}

}  // namespace ressort
