// app: numbers and tables as people read them. Pure.
#pragma once

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

}  // namespace ressort
