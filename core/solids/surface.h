// core/solids: a solid as its surface, read from STL and OBJ, and whether it is one. Pure.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "core/progress.h"
#include "core/result.h"
#include "core/rooms.h"

namespace ressort::solids {

// Indices of points are ints, as files have them.
inline std::size_t at(int index) {
  return static_cast<std::size_t>(index);
}

using Point3 = std::array<double, 3>;

inline Point3 operator+(const Point3& a, const Point3& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
inline Point3 operator-(const Point3& a, const Point3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline Point3 operator*(double factor, const Point3& a) {
  return {factor * a[0], factor * a[1], factor * a[2]};
}
inline double inner(const Point3& a, const Point3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Point3 cross(const Point3& a, const Point3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double length(const Point3& a);

using Triangle = std::array<int, 3>;  // of points, counter-clockwise from outside

struct Surface {
  std::vector<Point3> points;  // m
  std::vector<Triangle> triangles;
};

inline constexpr std::size_t max_triangles = 2'000'000;  // of a file; what has more is refused
inline constexpr double largest_coordinate = 1e9;        // in the file's own unit

// The triangles as they stand in the file. STL in ASCII or binary; OBJ, of which `v` and `f` are
// read and faces with more corners are cut into triangles. Errors say the line of a text, or the
// byte, and what was expected there. O(bytes)
Result<Surface> read_stl(std::string_view bytes);
Result<Surface> read_obj(std::string_view text);

// What holds a body in: its shells, each closed.
struct ClosedSurface {
  Surface surface;
  std::vector<int> shell;  // [triangle] from 0; 0 is the outer one, the others are hollows
  int shells = 1;
  std::size_t welded = 0;    // points that were one with another
  std::size_t turned = 0;    // triangles that looked inwards
  std::size_t left_out = 0;  // triangles without an area
  double volume = 0.0;       // m^3
};

// Welds points that lie within 1e-6 of the solid's size, and turns triangles outwards. The error
// names the edges that do not belong to two triangles, by their ends in metres; or says that the
// surface cannot be turned one way, is flat, or has several bodies. O(n log n)
Result<ClosedSurface> close_surface(const Surface& surface, const Progress& progress);

Surface scaled(Surface surface, double metres_per_unit);

// 6 times the volume that triangles hold in, negative where they look inwards.
double six_volumes(const Surface& surface);

// The corners of the smallest box along the axes.
struct Box3 {
  Point3 low{};
  Point3 high{};

  double diagonal() const { return length(high - low); }
};
Box3 box_around(const std::vector<Point3>& points);

// "(0.1, 0, -2)", in four digits.
std::string to_string(const Point3& point);

}  // namespace ressort::solids
