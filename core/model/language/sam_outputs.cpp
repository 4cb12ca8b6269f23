// What an audioout hears.
#include <algorithm>
#include <utility>

#include "core/model/language/sam_teller.h"

namespace ressort::model {
namespace {

constexpr int deepest_sum = 50;  // parentheses and signs in what is heard
constexpr std::size_t longest_levels = 10 * longest_expression;

std::size_t length_of(const SamHeard& heard) {
  std::size_t length = heard.number.size();
  for (const SamHeard::Part& part : heard.parts) {
    length += part.level.size();
  }
  return length;
}

}  // namespace

std::optional<SamHeard> SamTeller::factor(const SamElement& out, Token& rest, int depth) {
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
      return refuse("the signs are too many");
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
    heard.number = "(" + lines_.expression(out.statement->origin, word) + ")";  // or told
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

std::optional<SamHeard> SamTeller::product(const SamElement& out, Token& rest, int depth) {
  auto first = factor(out, rest, depth);
  if (!first) {
    return std::nullopt;
  }
  SamHeard heard = std::move(*first);
  while (rest.text.starts_with('*') || rest.text.starts_with('/')) {
    const Token sign{rest.text.substr(0, 1), rest.column};
    rest = trimmed({rest.text.substr(1), rest.column + 1});
    auto next = factor(out, rest, depth);
    if (!next) {
      return std::nullopt;
    }
    if (!next->is_number() && (!heard.is_number() || sign.text == "/")) {
      error(out, sign, "what is heard may be multiplied by numbers, not by what else is heard");
      return std::nullopt;
    }
    if (next->is_number()) {
      heard.wrap("(", ")" + std::string(sign.text) + next->number);
    } else {
      next->wrap(heard.number + "*(", ")");
      heard = std::move(*next);
    }
    if (length_of(heard) > longest_levels) {
      error(out, sign, "what is heard is multiplied too often to be read");
      return std::nullopt;
    }
  }
  return heard;
}

std::optional<SamHeard> SamTeller::sum(const SamElement& out, Token& rest, int depth) {
  std::optional<SamHeard> all;
  bool is_taken_away = false;
  for (;;) {
    const Token place = rest;
    auto heard = product(out, rest, depth);
    if (!heard) {
      return std::nullopt;
    }
    if (heard->is_number() && (depth == 0 || (all && !all->is_number()))) {
      error(out, place, "expected what is heard, found a number alone");
      return std::nullopt;
    }
    if (all && all->is_number() && !heard->is_number()) {
      error(out, place, "expected a number, as before; a number added to what is heard is silent");
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

void SamTeller::write_output(const SamElement& element) {
  const Statement& statement = *element.statement;
  Token rest = statement.arguments[0];
  if (rest.text.size() > longest_expression) {
    return error(element, rest, "what is heard is too long to be read");
  }
  const auto heard = sum(element, rest, 0);
  if (!heard) {
    return;
  }
  if (!rest.text.empty()) {
    return error(element, rest,
                 "found " + quoted(rest.text) +
                     " where the ';' was expected: FAUST code behind what is heard is not read");
  }
  const std::string name = quoted(statement.names[0].text);
  const std::string output = "@out" + std::to_string(outputs_ + 1) + " posOutput ";
  bool is_heard = false;
  bool has_termination = false;
  for (const SamHeard::Part& part : heard->parts) {
    const SamElement& source = elements_[part.element];
    has_termination = has_termination || source.shape->kind == SamKind::termination;
    if (!source.end.empty()) {  // else its row has been told
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
                       " is heard one sample from the termination, where the string's position "
                       "is in proportion to the wave that comes in");
  }
}

}  // namespace ressort::model
