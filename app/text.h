// app: text functions: numbers, tables, line breaks. Pure.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/ranges.h"

namespace ressort {

std::string fixed(double number, int digits);

// "1 voice", "2 voices".
std::string counted(std::size_t count, std::string_view one, std::string_view many);

// Returns the rows in aligned columns, without a final newline.
std::string table(const std::vector<std::vector<std::string>>& rows, std::size_t indent = 0);

// Returns true if the words differ at most in the case of ASCII letters.
bool same_but_case(std::string_view a, std::string_view b);

// Returns the word of `known` that a person probably meant: it differs only in case, or by
// inserted, deleted, replaced or swapped letters, at most a third of them.
std::optional<std::string> nearest_word(std::string_view word, std::span<const std::string> known);

// Returns "; did you mean 'X'?" or an empty string.
std::string did_you_mean(std::string_view word, std::span<const std::string> known);

// Breaks lines at spaces to at most `width` characters. Continuation lines are indented like the
// line's second column, if it has one, or like the line.
std::string wrapped(const std::string& text, std::size_t width);

}  // namespace ressort
