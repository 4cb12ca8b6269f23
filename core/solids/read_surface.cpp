#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>

#include "core/solids/surface.h"

namespace ressort::solids {
namespace {

constexpr std::size_t stl_header_bytes = 84;
constexpr std::size_t stl_triangle_bytes = 50;

bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\f' || c == '\v';
}

// Returns the text without a byte-order mark.
std::string_view without_mark(std::string_view text) {
  return text.starts_with("\xef\xbb\xbf") ? text.substr(3) : text;
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
    for (;;) {
      while (!rest_.empty() && is_blank(rest_.front())) {
        rest_.remove_prefix(1);
      }
      const bool is_continued =
          rest_.starts_with('\\') && rest_.find_first_not_of(" \t\r", 1) == rest_.npos;
      if (!is_continued || at_ >= text_.size()) {
        break;
      }
      ++line_;
      const std::size_t next = std::min(text_.find('\n', at_), text_.size());
      rest_ = text_.substr(at_, next - at_);
      at_ = next + 1;
    }
    rest_ = rest_.starts_with('#') ? std::string_view() : rest_;  // a comment
    std::size_t end = 0;
    while (end < rest_.size() && !is_blank(rest_[end])) {
      ++end;
    }
    return rest_.substr(0, end);
  }

  // Returns the first word of the text.
  std::string_view first() { return next_line() ? peek() : std::string_view(); }

  // Returns the next word of this line or the lines after it; empty at the end of the text.
  std::string_view next() {
    while (peek().empty() && next_line()) {
    }
    return word();
  }

  // Returns the next word, or an empty one at the end of the line.
  std::string_view word() {
    const std::string_view found = peek();
    rest_.remove_prefix(found.size());
    return found;
  }

  int line() const { return line_; }
  std::size_t offset() const { return std::min(at_, text_.size()); }  // of the next line

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

// Returns a number with a decimal point or comma.
std::optional<double> number_of(std::string_view word) {
  if (!word.empty() && word.front() == '+') {
    word.remove_prefix(1);
  }
  std::string with_point;
  if (const std::size_t comma = word.find(','); comma != word.npos) {
    with_point = word;
    with_point[comma] = '.';
    word = with_point;
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
    const bool is_end =
        is_word(word, "endsolid") || (is_word(word, "end") && is_word(words.peek(), "solid"));
    if (is_word(word, "solid") || is_end) {
      is_inside = !is_end;
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
    for (const std::string_view what : {"loop", "facet"}) {  // "endloop" or "end loop"
      const bool is_parted = words.next_line() && is_word(words.peek(), "end");
      const std::string_view found = is_parted ? (words.word(), words.word()) : words.word();
      if (!is_word(found, (is_parted ? "" : "end") + std::string(what))) {
        return words.error("'end" + std::string(what) + "'", found);
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

bool is_text_of(std::string_view bytes) {
  return bytes.substr(0, 4096).find('\0') == std::string_view::npos;
}

// Adds a face with any number of corners as a fan of triangles.
template <class Next>
std::optional<Error> add_face(Surface& surface, const Words& words, std::size_t corners,
                              Next&& next) {
  Triangle fan{-1, -1, -1};
  for (std::size_t i = 0; i < corners; ++i) {
    const long long point = next();
    if (point < 0 || point >= static_cast<long long>(surface.points.size())) {
      return words.error(
          "the number of a point from 0 to " + std::to_string(surface.points.size() - 1),
          std::to_string(point));
    }
    fan = {fan[0] < 0 ? static_cast<int>(point) : fan[0], fan[2], static_cast<int>(point)};
    if (i >= 2) {
      if (surface.triangles.size() == max_triangles) {
        return too_many();
      }
      surface.triangles.push_back(fan);
    }
  }
  return std::nullopt;
}

std::optional<Error> check_counts(const Words& words, std::optional<double> points,
                                  std::optional<double> faces) {
  constexpr double most = 3.0 * max_triangles;
  if (!points || !faces || !(*points >= 3.0) || !(*faces >= 1.0)) {
    return words.error("the numbers of points and faces", "");
  }
  return *points > most || *faces > most ? std::optional(too_many()) : std::nullopt;
}

// Returns the number of bytes that the triangles of a binary STL need, or 0 if this cannot be one.
std::size_t binary_stl_bytes(std::string_view bytes) {
  const std::size_t count = bytes.size() >= stl_header_bytes ? little_endian(bytes.substr(80)) : 0;
  const std::size_t size = stl_header_bytes + stl_triangle_bytes * count;
  return count > 0 && count <= max_triangles && bytes.size() >= size ? size : 0;
}

Result<Surface> read_stl(std::string_view bytes) {
  // A binary file may begin with "solid", and some have bytes behind the triangles.
  const std::size_t size = binary_stl_bytes(bytes);
  if (size == 0 || (bytes.size() > size && is_text_of(bytes))) {
    return read_ascii_stl(bytes);
  }
  auto surface = read_binary_stl(bytes);
  if (surface) {
    surface->ignored_bytes = bytes.size() - size;
  }
  return surface;
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
      std::vector<long long> corners;
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
        corners.push_back(number > 0 ? number - 1 : count + number);
      }
      std::size_t next = 0;
      if (const auto wrong =
              add_face(surface, words, corners.size(), [&] { return corners[next++]; })) {
        return *wrong;
      }
      if (corners.size() < 3) {
        return words.error("three corners or more", "");
      }
    }
  }
  if (surface.triangles.empty()) {
    return Error{"it has no face (a line with 'f' and the numbers of its points)", words.line()};
  }
  return surface;
}

Result<Surface> read_off(std::string_view text) {
  Words words(text);
  words.next();  // "OFF", or with more coordinates "COFF" and the like
  const auto points = number_of(words.next());
  const auto faces = number_of(words.next());
  words.next();  // number of edges, often 0
  if (const auto wrong = check_counts(words, points, faces)) {
    return *wrong;
  }
  Surface surface;
  for (double i = 0.0; i < *points; ++i) {
    words.next_line();
    const auto point = point_of(words);  // colours may follow
    if (!point) {
      return point.error();
    }
    surface.points.push_back(*point);
  }
  for (double i = 0.0; i < *faces; ++i) {
    words.next_line();
    const auto corners = number_of(words.word());
    if (!corners || !(*corners >= 3.0 && *corners <= 1e6)) {
      return words.error("a face: the number of its corners and their points", "");
    }
    if (const auto wrong = add_face(surface, words, static_cast<std::size_t>(*corners), [&] {
          return static_cast<long long>(number_of(words.word()).value_or(-1.0));
        })) {
      return *wrong;
    }
  }
  return surface;
}

// A property of a PLY element: a number, or a list with its length before it.
struct PlyProperty {
  std::string_view name;
  std::string_view type;
  std::string_view count_type;  // empty: a number
};
struct PlyElement {
  std::string_view name;
  double count = 0.0;
  std::vector<PlyProperty> properties;
};

// Reads the numbers of a PLY body, as text or as bytes.
class PlyNumbers {
 public:
  PlyNumbers(std::string_view body, Words& words, bool is_text, bool is_big)
      : body_(body), words_(words), is_text_(is_text), is_big_(is_big) {}

  std::optional<double> next(std::string_view type) {
    if (is_text_) {
      return number_of(words_.next());
    }
    const std::size_t size = size_of(type);
    if (size == 0 || size > body_.size()) {
      return std::nullopt;
    }
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < size; ++i) {
      bits = bits << 8 | static_cast<unsigned char>(body_[is_big_ ? i : size - 1 - i]);
    }
    body_.remove_prefix(size);
    if (type == "float" || type == "float32") {
      return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
    }
    if (type == "double" || type == "float64") {
      return std::bit_cast<double>(bits);
    }
    const bool is_negative = type.front() != 'u' && (bits >> (8 * size - 1)) != 0;
    return static_cast<double>(bits) -
           (is_negative ? std::exp2(8.0 * static_cast<double>(size)) : 0.0);
  }

 private:
  static std::size_t size_of(std::string_view type) {
    return type == "char" || type == "uchar" || type == "int8" || type == "uint8"       ? 1
           : type == "short" || type == "ushort" || type == "int16" || type == "uint16" ? 2
           : type == "double" || type == "float64"                                      ? 8
           : type == "int" || type == "uint" || type == "int32" || type == "uint32" ||
                   type == "float" || type == "float32"
               ? 4
               : 0;
  }

  std::string_view body_;
  Words& words_;
  bool is_text_;
  bool is_big_;
};

Result<Surface> read_ply(std::string_view bytes) {
  Words words(bytes);
  words.next_line();  // "ply"
  std::vector<PlyElement> elements;
  std::string_view format;
  for (;;) {
    if (!words.next_line()) {
      return words.error("'end_header'", "");
    }
    const std::string_view word = words.word();
    if (word == "end_header") {
      break;
    }
    if (word == "format") {
      format = words.word();
    } else if (word == "element") {
      const std::string_view name = words.word();
      elements.push_back({name, number_of(words.word()).value_or(0.0), {}});
    } else if (word == "property" && !elements.empty()) {
      PlyProperty property;
      const bool is_list = words.peek() == "list";
      property.count_type = is_list ? (words.word(), words.word()) : "";
      property.type = words.word();
      property.name = words.word();
      elements.back().properties.push_back(property);
    }
  }
  PlyNumbers numbers(bytes.substr(words.offset()), words, format == "ascii",
                     format == "binary_big_endian");
  Surface surface;
  for (const PlyElement& element : elements) {
    if (element.count > 3.0 * max_triangles) {
      return too_many();
    }
    for (double i = 0.0; i < element.count; ++i) {
      Point3 point{};
      for (const PlyProperty& property : element.properties) {
        const auto count = property.count_type.empty() ? 1.0 : numbers.next(property.count_type);
        if (!count || !(*count >= 0.0 && *count <= 1e6)) {
          return words.error("the length of the list '" + std::string(property.name) + "'", "");
        }
        const bool is_face = element.name == "face" && property.name.starts_with("vertex_ind");
        std::optional<double> number;
        const auto next = [&] {
          number = numbers.next(property.type);
          return static_cast<long long>(number.value_or(-1.0));
        };
        if (is_face) {
          if (const auto wrong = add_face(surface, words, static_cast<std::size_t>(*count), next)) {
            return *wrong;
          }
          continue;
        }
        for (double k = 0.0; k < *count; ++k) {
          next();
          if (!number || !(std::abs(*number) <= largest_coordinate)) {
            return words.error("the property '" + std::string(property.name) + "' of each '" +
                                   std::string(element.name) + "'",
                               "");
          }
        }
        const std::size_t axis = std::string_view("xyz").find(property.name);
        if (property.name.size() == 1 && axis != std::string_view::npos) {
          point[axis] = number.value_or(0.0);
        }
      }
      if (element.name == "vertex") {
        surface.points.push_back(point);
      }
    }
  }
  if (surface.triangles.empty()) {
    return Error{"it has no 'face' with 'vertex_indices'", words.line()};
  }
  return surface;
}

}  // namespace

SurfaceFormat surface_format(std::string_view bytes) {
  Words words(without_mark(bytes));
  const std::string_view first = words.first();
  if (is_text_of(bytes) || first == "ply") {
    constexpr std::size_t longest_off = 6;  // "STNOFF"
    if (first == "ply") {
      return SurfaceFormat::ply;
    }
    if (first.ends_with("OFF") && first.size() <= longest_off) {
      return SurfaceFormat::off;
    }
    if (is_word(first, "solid")) {
      return SurfaceFormat::stl;
    }
    Words lines(without_mark(bytes.substr(0, 65536)));
    for (int i = 0; i < 1000 && lines.next_line(); ++i) {
      const std::string_view word = lines.word();
      if (word == "v" && number_of(lines.word())) {
        return SurfaceFormat::obj;
      }
    }
    return SurfaceFormat::unknown;
  }
  return binary_stl_bytes(bytes) > 0 ? SurfaceFormat::stl : SurfaceFormat::unknown;
}

Result<Surface> read_surface(std::string_view bytes) {
  const std::string_view content = without_mark(bytes);
  switch (surface_format(bytes)) {
    case SurfaceFormat::stl:
      return read_stl(content);
    case SurfaceFormat::obj:
      return read_obj(content);
    case SurfaceFormat::ply:
      return read_ply(content);
    case SurfaceFormat::off:
      return read_off(content);
    case SurfaceFormat::unknown:
      break;
  }
  return Error{"expected a solid in STL, OBJ, PLY or OFF"};
}

}  // namespace ressort::solids
