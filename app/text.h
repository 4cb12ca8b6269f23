// app: numbers and tables as people read them. Pure.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace ressort {

std::string fixed(double number, int digits);

// "1 voice", "2 voices".
std::string counted(std::size_t count, std::string_view one, std::string_view many);

std::string joined(const std::vector<std::string>& words, std::string_view between);

// Rows in aligned columns, without a line end after the last.
std::string table(const std::vector<std::vector<std::string>>& rows, std::size_t indent = 0);

// Whether two words differ in the case of their ASCII letters at most.
bool same_but_case(std::string_view a, std::string_view b);

// The one of `known` that a person who typed `word` may have meant: it differs by the case of its
// letters, or by at most a third of them put in, left out, changed or swapped with the next.
std::optional<std::string> nearest_word(std::string_view word, std::span<const std::string> known);

// "; did you mean 'X'?", or nothing.
std::string did_you_mean(std::string_view word, std::span<const std::string> known);

// Lines no longer than `width` characters, broken at blanks; what follows a break is indented as
// the line's first word after two blanks is, or as the line.
std::string wrapped(const std::string& text, std::size_t width);

}  // namespace ressort
