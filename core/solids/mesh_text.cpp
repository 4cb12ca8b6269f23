#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <numbers>
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

  // Moves behind the next line that equals `line`.
  bool find(std::string_view line) {
    for (std::size_t from = at_; from < text_.size();) {
      const std::size_t found = text_.find(line, from);
      if (found == std::string_view::npos) {
        return false;
      }
      if (found == 0 || text_[found - 1] == '\n') {
        at_ = found + line.size();
        return true;
      }
      from = found + 1;
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

// Maps the point numbers of a file to indices.
struct Numbering {
  std::vector<int> place;

  bool add(std::size_t number, int point) {
    if (number >= place.size()) {
      place.resize(std::max<std::size_t>(number + 1, 2 * place.size()), -1);
    }
    return place[number] < 0 && (place[number] = point, true);
  }
  std::optional<int> find(std::size_t number) const {
    return number < place.size() && place[number] >= 0 ? std::optional(place[number])
                                                       : std::nullopt;
  }
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

Result<TetrahedronMesh> read_gmsh(std::string_view text) {
  Numbers numbers(text);
  TetrahedronMesh mesh;
  Numbering numbering;
  if (!numbers.find("$Nodes")) {
    return numbers.error("a line $Nodes");
  }
  const auto points = numbers.count(most_rows);
  if (!points) {
    return numbers.error("the number of points");
  }
  for (std::size_t i = 0; i < *points; ++i) {
    const auto number = numbers.count(most_rows);
    const auto x = numbers.next();
    const auto y = numbers.next();
    const auto z = numbers.next();
    if (!number || !x || !y || !z || !numbering.add(*number, static_cast<int>(i))) {
      return numbers.error("the number of a point and its three coordinates");
    }
    mesh.points.push_back({*x, *y, *z});
  }
  if (!numbers.find("$Elements")) {
    return numbers.error("a line $Elements");
  }
  const auto elements = numbers.count(most_rows);
  if (!elements) {
    return numbers.error("the number of elements");
  }
  for (std::size_t i = 0; i < *elements; ++i) {
    // A row has the element's number, its type, the number of tags, the tags, and the points.
    // Types: 15 point, 1 line, 2 triangle, 4 tetrahedron.
    const auto number = numbers.count(most_rows);
    const auto kind = numbers.count(100);
    const auto tags = numbers.count(100);
    const std::size_t corners = !kind         ? 0
                                : *kind == 15 ? 1
                                : *kind == 1  ? 2
                                : *kind == 2  ? 3
                                : *kind == 4  ? 4
                                              : 0;
    if (!number || !tags || corners == 0) {
      return numbers.error("an element: its number, its kind 15, 1, 2 or 4, its tags");
    }
    for (std::size_t tag = 0; tag < *tags; ++tag) {
      if (!numbers.next()) {
        return numbers.error("a tag");
      }
    }
    Tetrahedron tetrahedron{};
    for (std::size_t k = 0; k < corners; ++k) {
      const auto corner = numbers.count(most_rows);
      const auto place = corner ? numbering.find(*corner) : std::nullopt;
      if (!place) {
        return numbers.error("the number of an existing point");
      }
      tetrahedron[k] = *place;
    }
    if (corners == 4) {
      mesh.tetrahedra.push_back(tetrahedron);
    }
  }
  return mesh;
}

Result<TetrahedronMesh> read_tetgen(std::string_view nodes, std::string_view elements) {
  TetrahedronMesh mesh;
  Numbering numbering;
  Numbers numbers(nodes);
  const auto points = numbers.count(most_rows);
  const auto dimension = numbers.count(3);
  const auto attributes = numbers.count(100);
  const auto marks = numbers.count(1);
  if (!points || !dimension || *dimension != 3 || !attributes || !marks) {
    return numbers.error("the number of points, 3, and the number of attributes");
  }
  for (std::size_t i = 0; i < *points; ++i) {
    const auto number = numbers.count(most_rows);
    const auto x = numbers.next();
    const auto y = numbers.next();
    const auto z = numbers.next();
    bool has_rest = true;
    for (std::size_t k = 0; k < *attributes + *marks; ++k) {
      has_rest = numbers.next() && has_rest;
    }
    if (!number || !x || !y || !z || !has_rest || !numbering.add(*number, static_cast<int>(i))) {
      return numbers.error("the number of a point and its three coordinates");
    }
    mesh.points.push_back({*x, *y, *z});
  }
  Numbers rows(elements);
  const auto count = rows.count(most_rows);
  const auto corners = rows.count(10);
  const auto regions = rows.count(100);
  if (!count || !corners || *corners != 4 || !regions) {
    return rows.error("the number of tetrahedra, 4, and the number of attributes");
  }
  for (std::size_t i = 0; i < *count; ++i) {
    const auto number = rows.count(most_rows);
    Tetrahedron tetrahedron{};
    for (int& corner : tetrahedron) {
      const auto found = rows.count(most_rows);
      const auto place = found ? numbering.find(*found) : std::nullopt;
      if (!number || !place) {
        return rows.error("the number of a tetrahedron and its four points");
      }
      corner = *place;
    }
    for (std::size_t k = 0; k < *regions; ++k) {
      if (!rows.next()) {
        return rows.error("the number of a region");
      }
    }
    mesh.tetrahedra.push_back(tetrahedron);
  }
  return mesh;
}

}  // namespace ressort::solids
