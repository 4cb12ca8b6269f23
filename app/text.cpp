#include "app/text.h"

#include <algorithm>
#include <charconv>

namespace ressort {

std::string fixed(double number, int digits) {
  char text[400];  // the longest double has 309 digits before its point
  const auto end =
      std::to_chars(text, text + sizeof text, number, std::chars_format::fixed, digits).ptr;
  return {text, end};
}

std::string counted(std::size_t count, std::string_view one, std::string_view many) {
  return std::to_string(count) + " " + std::string(count == 1 ? one : many);
}

namespace {

// Returns the number of characters of a UTF-8 text.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char byte) { return (static_cast<unsigned char>(byte) & 0xC0U) != 0x80U; }));
}

}  // namespace

std::string table(const std::vector<std::vector<std::string>>& rows, std::size_t indent) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t c = 0; c < row.size(); ++c) {
      widths[c] = std::max(widths[c], width_of(row[c]));
    }
  }
  std::string text;
  for (const auto& row : rows) {
    std::string line(indent, ' ');
    for (std::size_t c = 0; c < row.size(); ++c) {
      line += row[c] + std::string(widths[c] - width_of(row[c]) + 2, ' ');
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += (text.empty() ? "" : "\n") + line;
  }
  return text;
}

namespace {

char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

// Returns the optimal string alignment distance (Damerau-Levenshtein without repeated edits of one
// letter), ignoring case.
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      const bool is_same = lower(a[i - 1]) == lower(b[j - 1]);
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (is_same ? 0 : 1)});
      if (i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) &&
          lower(a[i - 2]) == lower(b[j - 1])) {
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
      }
    }
  }
  return d[a.size()][b.size()];
}

// Returns the start of a line's second column, or of its first word if it has one column.
std::size_t hanging_indent(std::string_view line) {
  const std::size_t first = std::min(line.find_first_not_of(' '), line.size());
  const std::size_t gap = line.find("  ", first);
  const std::size_t second = gap == line.npos ? line.npos : line.find_first_not_of(' ', gap);
  return second == line.npos ? first : second;
}

}  // namespace

bool same_but_case(std::string_view a, std::string_view b) {
  return std::ranges::equal(a, b, [](char x, char y) { return lower(x) == lower(y); });
}

std::optional<std::string> nearest_word(std::string_view word, std::span<const std::string> known) {
  constexpr std::size_t longest = 64;  // names are shorter
  std::optional<std::string> nearest;
  std::size_t least = word.size() > longest ? 0 : std::max<std::size_t>(1, word.size() / 3) + 1;
  for (const std::string& candidate : known) {
    if (candidate.size() > longest) {
      continue;
    }
    if (const std::size_t steps = distance(word, candidate); steps < least) {
      least = steps;
      nearest = candidate;
    }
  }
  return nearest;
}

std::string did_you_mean(std::string_view word, std::span<const std::string> known) {
  const auto meant = nearest_word(word, known);
  return meant ? "; did you mean '" + *meant + "'?" : "";
}

std::string wrapped(const std::string& text, std::size_t width) {
  std::string all;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    std::string line = text.substr(at, end - at);
    at = end + 1;
    const std::size_t indent = hanging_indent(line);
    while (width_of(line) > width && 2 * indent < width) {
      std::size_t cut = 0;  // last space that fits
      std::size_t columns = 0;
      for (std::size_t i = 0; i < line.size() && columns <= width; ++i) {
        if (line[i] == ' ' && i > indent) {
          cut = i;
        }
        columns += (static_cast<unsigned char>(line[i]) & 0xC0U) != 0x80U ? 1 : 0;
      }
      if (cut == 0) {
        break;
      }
      const std::size_t next = line.find_first_not_of(' ', cut);
      all += line.substr(0, line.find_last_not_of(' ', cut) + 1) + "\n";
      line = next == line.npos ? "" : std::string(indent, ' ') + line.substr(next);
    }
    all += line + (at <= text.size() ? "\n" : "");
  }
  return all;
}

}  // namespace ressort
