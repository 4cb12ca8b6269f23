// core/model: the pieces of a line of text, and how they are shown to a person.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/rooms.h"

namespace ressort::model {

struct Token {
  std::string_view text;
  int column = 0;
};

// Tokens are divided by blanks; [...] and '...' hold together; '#' starts a comment.
void split(std::string_view line, std::vector<Token>& tokens);
std::vector<Token> split(std::string_view line);

// The characters of a text before a blank, a comment or a '['.
std::string_view first_word(std::string_view text);

// What stands between [ ] or ' ', or the token itself.
Token unwrapped(Token token);

// Letters, digits and '_', no digit first.
bool is_identifier(std::string_view text);

// The first letter of a text, of one byte or several; a '?' in its place where it cannot be printed
// or is no UTF-8, and `length` is how much of the text it takes.
std::string_view first_letter(std::string_view text, std::size_t& length);

// 'text', without what cannot be printed, and not too long.
std::string quoted(std::string_view text);

// How many letters have to change to get from one word to the other (Levenshtein).
std::size_t distance(std::string_view from, std::string_view to);

inline constexpr std::size_t most_suggestions = 2000;  // names looked at; none is worth a wait

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
  return best.empty() ? ""
                      : "; did you mean " + model::quoted(std::string(prefix).append(best)) + "?";
}

}  // namespace ressort::model
