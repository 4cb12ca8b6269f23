#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <optional>

#include "core/solids/solid_mesh.h"

namespace ressort::solids {
namespace {

constexpr std::size_t most_rows = 20'000'000;

// Reads numbers one after another across lines; '#' begins a comment.
class Numbers {
 public:
  explicit Numbers(std::string_view text) : text_(text) {}

  std::optional<double> next() {
    skip();
    double number = 0.0;
    const char* const begin = text_.data() + at_;
    const auto [end, failure] = std::from_chars(begin, text_.data() + text_.size(), number);
    if (end == begin || !std::isfinite(number)) {
      return std::nullopt;
    }
    at_ += static_cast<std::size_t>(end - begin);
    return number;
  }

  std::optional<std::size_t> count(std::size_t most) {
    const auto number = next();
    if (!number || *number < 0.0 || *number > static_cast<double>(most)) {
      return std::nullopt;
    }
    return static_cast<std::size_t>(*number);
  }

  // Moves behind the next line that begins with this word.
  bool find(std::string_view word) {
    for (std::size_t found = text_.find(word, at_); found != text_.npos;
         found = text_.find(word, found + 1)) {
      const std::size_t before = text_.substr(0, found).find_last_not_of(" \t");
      if (before == text_.npos || text_[before] == '\n') {
        at_ = found + word.size();
        return true;
      }
    }
    return false;
  }

  Error error(const char* expected) const {
    const auto line =
        1 + std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(at_), '\n');
    return {std::string("expected ") + expected, static_cast<int>(line)};
  }

 private:
  void skip() {
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '#') {
        at_ = std::min(text_.find('\n', at_), text_.size());
      } else if (c == ' ' || c == '\t' || c == '\r' || c == '\n') {
        ++at_;
      } else {
        return;
      }
    }
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

void append_point(std::string& text, const Point3& point) {
  char line[120];
  std::snprintf(line, sizeof line, "%.17g %.17g %.17g\n", point[0], point[1], point[2]);
  text += line;
}

// Returns a point inside the shell, slightly behind the centre of its largest triangle.
Point3 within(const ClosedSurface& closed, int shell) {
  Point3 found{};
  double most = 0.0;
  for (std::size_t t = 0; t < closed.surface.triangles.size(); ++t) {
    const Triangle& triangle = closed.surface.triangles[t];
    const Point3& a = closed.surface.points[at(triangle[0])];
    const Point3& b = closed.surface.points[at(triangle[1])];
    const Point3& c = closed.surface.points[at(triangle[2])];
    const Point3 normal = cross(b - a, c - a);
    if (closed.shell[t] == shell && length(normal) > most) {
      most = length(normal);
      // Cavities face inwards, so the point along the normal lies within them.
      found = 1.0 / 3.0 * (a + b + c) + 1e-4 / std::sqrt(most) * normal;
    }
  }
  return found;
}

}  // namespace

std::string as_stl(const ClosedSurface& closed) {
  std::string text;
  for (int shell = 0; shell < closed.shells; ++shell) {
    text += "solid " + std::to_string(shell) + "\n";
    for (std::size_t t = 0; t < closed.surface.triangles.size(); ++t) {
      if (closed.shell[t] == shell) {
        text += "facet normal 0 0 0\nouter loop\n";
        for (const int point : closed.surface.triangles[t]) {
          text += "vertex ";
          append_point(text, closed.surface.points[at(point)]);
        }
        text += "endloop\nendfacet\n";
      }
    }
    text += "endsolid " + std::to_string(shell) + "\n";
  }
  return text;
}

std::string as_smesh(const ClosedSurface& closed) {
  std::string text = std::to_string(closed.surface.points.size()) + " 3 0 0\n";
  for (std::size_t i = 0; i < closed.surface.points.size(); ++i) {
    text += std::to_string(i + 1) + " ";
    append_point(text, closed.surface.points[i]);
  }
  text += std::to_string(closed.surface.triangles.size()) + " 0\n";
  for (const Triangle& triangle : closed.surface.triangles) {
    text += "3 " + std::to_string(triangle[0] + 1) + " " + std::to_string(triangle[1] + 1) + " " +
            std::to_string(triangle[2] + 1) + "\n";
  }
  text += std::to_string(closed.shells - 1) + "\n";
  for (int shell = 1; shell < closed.shells; ++shell) {
    text += std::to_string(shell) + " ";
    append_point(text, within(closed, shell));
  }
  return text + "0\n";
}

Result<TetrahedronMesh> read_medit(std::string_view text) {
  Numbers numbers(text);
  TetrahedronMesh mesh;
  const auto points = numbers.find("Vertices") ? numbers.count(most_rows) : std::nullopt;
  if (!points) {
    return numbers.error("a line 'Vertices' and their number");
  }
  for (std::size_t i = 0; i < *points; ++i) {
    const auto x = numbers.next();
    const auto y = numbers.next();
    const auto z = numbers.next();
    if (!x || !y || !z || !numbers.next()) {
      return numbers.error("three coordinates of a point and its reference");
    }
    mesh.points.push_back({*x, *y, *z});
  }
  const auto elements = numbers.find("Tetrahedra") ? numbers.count(most_rows) : std::nullopt;
  if (!elements) {
    return numbers.error("a line 'Tetrahedra' and their number");
  }
  for (std::size_t i = 0; i < *elements; ++i) {
    Tetrahedron tetrahedron{};
    for (int& corner : tetrahedron) {
      const auto number = numbers.count(*points);  // Counted from 1.
      if (!number || *number == 0) {
        return numbers.error("the number of an existing point");
      }
      corner = static_cast<int>(*number) - 1;
    }
    if (!numbers.next()) {
      return numbers.error("the reference of a tetrahedron");
    }
    mesh.tetrahedra.push_back(tetrahedron);
  }
  drop_flat(mesh);
  return mesh;
}

}  // namespace ressort::solids
