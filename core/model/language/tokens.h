// core/model: splits lines into tokens, and quotes text in messages.
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

// Splits a line at blanks. [...] and '...' are one token each; '#' starts a comment.
void split(std::string_view line, std::vector<Token>& tokens);
std::vector<Token> split(std::string_view line);

// Returns the text up to a blank, a comment or a '['.
std::string_view first_word(std::string_view text);

// Removes [ ] or ' ' around a token.
Token unwrapped(Token token);

// Returns true for letters, digits and '_' that do not start with a digit.
bool is_identifier(std::string_view text);

// Returns the first UTF-8 character of a text, or '?' if it is invalid or not printable. Sets
// `length` to its length in bytes.
std::string_view first_letter(std::string_view text, std::size_t& length);

// Returns the text in quotes, shortened, with '?' for characters that are not printable.
std::string quoted(std::string_view text);

// Returns the Levenshtein distance between two words.
std::size_t distance(std::string_view from, std::string_view to);

inline constexpr std::size_t most_suggestions = 2000;  // names compared, to limit the time

// Returns "; did you mean 'x'?" for the most similar of `names`, or "" if none is similar.
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
