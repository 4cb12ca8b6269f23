#include "app/commands/body/numbers.h"

#include <algorithm>

#include "core/model/language/expression.h"

namespace ressort::commands {

std::optional<std::vector<double>> numbers_of(const std::string& text, char separator) {
  std::vector<double> numbers;
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t end = std::min(text.find(separator, from), text.size());
    double number = 0.0;
    if (!parse_number(text.substr(from, end - from), number)) {
      return std::nullopt;
    }
    numbers.push_back(number);
    from = end + 1;
  }
  return numbers;
}

}  // namespace ressort::commands
