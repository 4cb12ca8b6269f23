#include "core/model/preset/budget.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/model/language/expression.h"

namespace ressort::model {
namespace {

constexpr std::array<std::pair<Passivity, std::string_view>, 3> passivities{{
    {Passivity::always, "auto"},
    {Passivity::always, "always"},
    {Passivity::never, "never"},
}};

struct Figure {
  std::string_view word;
  double Budget::*value;
  double least;
  double most;
  std::string_view range;
};
constexpr std::array<Figure, 3> figures{{
    {"cents", &Budget::cents, 1e-6, 1200.0, "above 0, up to 1200"},
    {"t60", &Budget::t60_percent, 1e-6, 100.0, "above 0, up to 100 (%)"},
    {"silence", &Budget::silence_db, -200.0, -20.0, "-200 to -20 (dB)"},
}};

// Reads one "word=value". Returns an error message or "".
std::string take(Budget& budget, std::string_view item) {
  const std::size_t equals = item.find('=');
  const std::string_view word = item.substr(0, equals);
  const std::string value(equals == item.npos ? "" : item.substr(equals + 1));
  if (word == "passive") {
    for (const auto& [passivity, name] : passivities) {
      if (name == value) {
        budget.passive = passivity;
        return "";
      }
    }
    return "'passive' must be auto, always or never, found '" + value + "'";
  }
  for (const Figure& figure : figures) {
    if (figure.word == word) {
      double number = 0.0;
      if (!parse_number(value, number) || !(number >= figure.least) || number > figure.most) {
        return "'" + std::string(word) + "' must be " + std::string(figure.range) + ", found '" +
               value + "'";
      }
      budget.*figure.value = number;
      return "";
    }
  }
  return "expected cents=, t60=, silence= or passive=, found '" + std::string(item) + "'";
}

}  // namespace

Result<Budget> parse_budget(std::string_view text) {
  Budget budget;
  std::string seen;
  for (std::size_t at = text.find_first_not_of(' '); at < text.size();) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    const std::string_view item = text.substr(at, end - at);
    const std::string word = " " + std::string(item.substr(0, item.find('='))) + "=";
    std::string wrong = seen.find(word) == seen.npos ? take(budget, item)
                                                     : "'" + word.substr(1) + "' is given twice";
    if (!wrong.empty()) {
      return Error{std::move(wrong), 1, static_cast<int>(at) + 1};
    }
    seen += word;
    at = text.find_first_not_of(' ', end);
  }
  return budget;
}

std::string print_budget(const Budget& budget) {
  std::string text;
  const auto add = [&](std::string_view word, std::string_view value) {
    text += (text.empty() ? "" : " ") + std::string(word) + "=" + std::string(value);
  };
  for (const Figure& figure : figures) {
    if (budget.*figure.value != Budget{}.*figure.value) {
      add(figure.word, print_number(budget.*figure.value));
    }
  }
  if (budget.passive == Passivity::never) {
    add("passive", "never");
  }
  return text;
}

}  // namespace ressort::model
