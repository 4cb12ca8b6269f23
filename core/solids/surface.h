// core/solids: reads the surface of a solid from a file and checks that it is closed. Pure.
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

// Converts a point index, which is an int in files, to an index of a vector.
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

using Triangle = std::array<int, 3>;  // Point indices, counter-clockwise seen from outside.

struct Surface {
  std::vector<Point3> points;  // m
  std::vector<Triangle> triangles;
  std::size_t ignored_bytes = 0;  // behind the triangles of a binary STL
};

inline constexpr std::size_t max_triangles = 2'000'000;  // Files with more triangles are rejected.
inline constexpr double largest_coordinate = 1e9;        // Unit of the file.

// Returns the format of a file by its content.
enum class SurfaceFormat { unknown, stl, obj, ply, off };
SurfaceFormat surface_format(std::string_view bytes);

// Reads the triangles of a file. STL and PLY may be text or binary. Of OBJ files `v` and `f` are
// read, and faces with more than three corners are triangulated. Ignores a byte-order mark. Errors
// give the line of a text, or the byte, and what was expected there. O(bytes)
Result<Surface> read_surface(std::string_view bytes);

// The changes that made a surface usable.
struct Repairs {
  std::size_t welded = 0;     // Points merged with another one.
  std::size_t left_out = 0;   // Triangles without area, and repeated ones.
  std::size_t turned = 0;     // Triangles that faced inwards and were flipped.
  std::size_t holes = 0;      // Loops of open edges that were closed.
  double longest_hole = 0.0;  // Length of the longest of these loops, relative to the size.
  std::size_t parts = 0;      // Separate parts that were left out.
  double parts_area = 0.0;    // Their share of the area.
};

// A surface whose shells are all closed.
struct ClosedSurface {
  Surface surface;
  // [triangle] Shell number; 0 is the outer shell, the others are cavities.
  std::vector<int> shell;
  int shells = 1;
  Repairs repairs;
  double volume = 0.0;  // m^3
};

// Welds points within 1e-6 of the solid's size, closes holes whose edge is at most as long as the
// solid, orients the triangles outwards, and keeps the largest part with its cavities. Returns an
// error for edges that are still open (named by their ends in metres), and for a surface that
// cannot be oriented or that is flat. O(n log n)
Result<ClosedSurface> close_surface(const Surface& given, const Progress& progress);

// The middle surface of a shell: one part, open or closed. Edges may have any number of triangles.
struct Sheet {
  Surface surface;
  Repairs repairs;
};

// Welds points likewise, and keeps the largest part. O(n log n)
Result<Sheet> repaired_sheet(const Surface& given, const Progress& progress);

Surface scaled(Surface surface, double metres_per_unit);

// Returns six times the enclosed volume; negative if the triangles face inwards.
double six_volumes(const Surface& surface);

// Returns the winding number of a surface around a point, its solid angle over 4 pi: 1 inside, 0
// outside (van Oosterom and Strackee 1983).
double windings(const Surface& surface, const Point3& point);

// The axis-aligned bounding box.
struct Box3 {
  Point3 low{};
  Point3 high{};

  double diagonal() const { return length(high - low); }
};
Box3 box_around(const std::vector<Point3>& points);

// Formats a point as "(0.1, 0, -2)" with four digits.
std::string to_string(const Point3& point);

}  // namespace ressort::solids
