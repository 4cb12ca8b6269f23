#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>

#include "core/solids/surface.h"

namespace ressort::solids {
namespace {

constexpr std::size_t stl_header_bytes = 84;
constexpr std::size_t stl_triangle_bytes = 50;

bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\f' || c == '\v';
}

// The words of a text, line by line.
class Words {
 public:
  explicit Words(std::string_view text) : text_(text) {}

  // Moves to the next line that has words. Returns false at the end.
  bool next_line() {
    rest_ = {};
    while (at_ < text_.size()) {
      ++line_;
      const std::size_t end = std::min(text_.find('\n', at_), text_.size());
      rest_ = text_.substr(at_, end - at_);
      at_ = end + 1;
      if (peek().empty() || peek().front() == '#') {
        continue;
      }
      return true;
    }
    return false;
  }

  std::string_view peek() {
    while (!rest_.empty() && is_blank(rest_.front())) {
      rest_.remove_prefix(1);
    }
    std::size_t end = 0;
    while (end < rest_.size() && !is_blank(rest_[end])) {
      ++end;
    }
    return rest_.substr(0, end);
  }

  // Returns the next word, or an empty one at the end of the line.
  std::string_view word() {
    const std::string_view found = peek();
    rest_.remove_prefix(found.size());
    return found;
  }

  int line() const { return line_; }

  Error error(const std::string& expected, std::string_view found) const {
    constexpr std::size_t shown = 40;
    const std::string cut =
        std::string(found.substr(0, shown)) + (found.size() > shown ? "..." : "");
    std::string clean;
    for (const char c : cut) {
      clean += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
    }
    return {"expected " + expected + ", found " +
                (clean.empty() ? std::string("the end of the line") : "'" + clean + "'"),
            line_};
  }

 private:
  std::string_view text_;
  std::string_view rest_;
  std::size_t at_ = 0;
  int line_ = 0;
};

bool is_word(std::string_view word, std::string_view lower) {
  return word.size() == lower.size() &&
         std::equal(word.begin(), word.end(), lower.begin(), [](char a, char b) {
           return (a >= 'A' && a <= 'Z' ? static_cast<char>(a + ('a' - 'A')) : a) == b;
         });
}

std::optional<double> number_of(std::string_view word) {
  if (!word.empty() && word.front() == '+') {
    word.remove_prefix(1);
  }
  double number = 0.0;
  const auto [end, failure] = std::from_chars(word.data(), word.data() + word.size(), number);
  const bool is_tiny = failure == std::errc::result_out_of_range && std::abs(number) < 1.0;
  if (end != word.data() + word.size() || word.empty() || (failure != std::errc() && !is_tiny) ||
      !(std::abs(number) <= largest_coordinate)) {
    return std::nullopt;
  }
  return number;
}

Result<Point3> point_of(Words& words) {
  Point3 point{};
  for (double& coordinate : point) {
    const std::string_view word = words.word();
    const auto number = number_of(word);
    if (!number) {
      return words.error("three coordinates of at most 1e9", word);
    }
    coordinate = *number;
  }
  return point;
}

Error too_many() {
  return {"more than " + std::to_string(max_triangles) +
          " triangles; make the surface coarser first"};
}

void push(Surface& surface, const std::array<Point3, 3>& corners) {
  const int first = static_cast<int>(surface.points.size());
  surface.points.insert(surface.points.end(), corners.begin(), corners.end());
  surface.triangles.push_back({first, first + 1, first + 2});
}

Result<Surface> read_ascii_stl(std::string_view text) {
  Surface surface;
  Words words(text);
  bool is_inside = false;
  while (words.next_line()) {
    const std::string_view word = words.word();
    if (is_word(word, "solid") || is_word(word, "endsolid")) {
      is_inside = is_word(word, "solid");
      continue;
    }
    if (!is_inside || !is_word(word, "facet")) {
      return words.error(is_inside ? "'facet' or 'endsolid'" : "'solid'", word);
    }
    if (surface.triangles.size() == max_triangles) {
      return too_many();
    }
    // Normals in files are often wrong, so they are computed from the corners.
    const auto wants = [&](std::string_view first,
                           std::string_view second) -> std::optional<Error> {
      if (!words.next_line()) {
        return Error{"expected '" + std::string(first) + "', found the end of the file",
                     words.line()};
      }
      for (const std::string_view wanted : {first, second}) {
        const std::string_view found = wanted.empty() ? std::string_view() : words.word();
        if (!wanted.empty() && !is_word(found, wanted)) {
          return words.error("'" + std::string(wanted) + "'", found);
        }
      }
      return std::nullopt;
    };
    if (const auto wrong = wants("outer", "loop")) {
      return *wrong;
    }
    std::array<Point3, 3> corners;
    for (Point3& corner : corners) {
      if (const auto wrong = wants("vertex", "")) {
        return *wrong;
      }
      const auto point = point_of(words);
      if (!point) {
        return point.error();
      }
      corner = *point;
    }
    for (const char* end : {"endloop", "endfacet"}) {
      if (const auto wrong = wants(end, "")) {
        return *wrong;
      }
    }
    push(surface, corners);
  }
  if (surface.triangles.empty()) {
    return Error{"it has no 'facet'", words.line()};
  }
  return surface;
}

std::uint32_t little_endian(std::string_view bytes) {
  std::uint32_t number = 0;
  for (std::size_t i = 4; i-- > 0;) {
    number = number << 8 | static_cast<unsigned char>(bytes[i]);
  }
  return number;
}

Result<Surface> read_binary_stl(std::string_view bytes) {
  const std::size_t count = little_endian(bytes.substr(80));
  if (count > max_triangles) {
    return too_many();
  }
  Surface surface;
  surface.points.reserve(3 * count);
  surface.triangles.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t start = stl_header_bytes + i * stl_triangle_bytes;
    std::array<Point3, 3> corners;
    for (std::size_t k = 0; k < 9; ++k) {
      const std::size_t place = start + 12 + 4 * k;
      const double number = std::bit_cast<float>(little_endian(bytes.substr(place)));
      if (!(std::abs(number) <= largest_coordinate)) {
        return Error{"triangle " + std::to_string(i + 1) + ", at byte " + std::to_string(place) +
                     ": expected a coordinate of at most 1e9"};
      }
      corners[k / 3][k % 3] = number;
    }
    push(surface, corners);
  }
  return surface;
}

}  // namespace

Result<Surface> read_stl(std::string_view bytes) {
  const bool may_be_binary = bytes.size() >= stl_header_bytes;
  const std::size_t count = may_be_binary ? little_endian(bytes.substr(80)) : 0;
  const bool has_binary_size =
      may_be_binary && bytes.size() == stl_header_bytes + stl_triangle_bytes * count;
  if (has_binary_size && count > 0) {  // A binary file, even if its header begins with "solid".
    return read_binary_stl(bytes);
  }
  Words words(bytes.substr(0, 4096));
  if (words.next_line() && is_word(words.peek(), "solid") &&
      bytes.substr(0, 4096).find('\0') == std::string_view::npos) {
    return read_ascii_stl(bytes);
  }
  if (may_be_binary && count > 0) {
    return Error{"expected 'solid' at the beginning, or " +
                 std::to_string(stl_header_bytes + stl_triangle_bytes * count) + " bytes for " +
                 std::to_string(count) + " triangles of a binary STL, found " +
                 std::to_string(bytes.size()) + " bytes"};
  }
  return Error{has_binary_size
                   ? "it has no triangles"
                   : "expected an STL: 'solid' at the beginning, or 84 bytes and 50 for "
                     "each triangle"};
}

Result<Surface> read_obj(std::string_view text) {
  Surface surface;
  Words words(text);
  while (words.next_line()) {
    const std::string_view keyword = words.word();
    if (keyword == "v") {
      const auto point = point_of(words);
      if (!point) {
        return point.error();
      }
      if (surface.points.size() == 3 * max_triangles) {
        return too_many();
      }
      surface.points.push_back(*point);
    } else if (keyword == "f") {
      Triangle fan{-1, -1, -1};
      std::size_t corners = 0;
      for (std::string_view word = words.word(); !word.empty(); word = words.word()) {
        // A corner is "POINT/TEXTURE/NORMAL"; only the first number is used. Points count from 1,
        // or backwards from -1.
        const std::string_view index = word.substr(0, word.find('/'));
        long long number = 0;
        const auto [end, failure] =
            std::from_chars(index.data(), index.data() + index.size(), number);
        const auto count = static_cast<long long>(surface.points.size());
        const bool is_whole = failure == std::errc() && end == index.data() + index.size();
        if (!is_whole || number == 0 || number > count || number < -count) {
          return words.error("the number of a point from 1 to " + std::to_string(count), word);
        }
        const int point = static_cast<int>(number > 0 ? number - 1 : count + number);
        fan = {fan[0] < 0 ? point : fan[0], fan[2], point};
        if (++corners >= 3) {
          if (surface.triangles.size() == max_triangles) {
            return too_many();
          }
          surface.triangles.push_back(fan);
        }
      }
      if (corners < 3) {
        return words.error("three corners or more", "");
      }
    }
  }
  if (surface.triangles.empty()) {
    return Error{"it has no face (a line with 'f' and the numbers of its points)", words.line()};
  }
  return surface;
}

}  // namespace ressort::solids
