// tests: solids as text, made here independently of the project.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "core/solids/surface.h"
#include "tests/support/rooms.h"

namespace ressort::support {

// Returns an icosahedron subdivided `times` times and projected onto a sphere: 12, 42, 162, 642
// points; either with the sphere's volume or with its points on the sphere.
inline Surface icosphere(int times, double radius, bool has_true_volume) {
  const double t = std::numbers::phi;
  Surface surface;
  surface.points = {{-1, t, 0},  {1, t, 0},  {-1, -t, 0}, {1, -t, 0}, {0, -1, t},  {0, 1, t},
                    {0, -1, -t}, {0, 1, -t}, {t, 0, -1},  {t, 0, 1},  {-t, 0, -1}, {-t, 0, 1}};
  surface.triangles = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                       {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                       {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                       {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (int i = 0; i < times; ++i) {
    std::map<std::pair<int, int>, int> middles;
    const auto middle = [&](int a, int b) {
      const auto [place, is_new] =
          middles.try_emplace(std::minmax(a, b), static_cast<int>(surface.points.size()));
      if (is_new) {
        surface.points.push_back(0.5 * (surface.points[static_cast<std::size_t>(a)] +
                                        surface.points[static_cast<std::size_t>(b)]));
        Point3& point = surface.points.back();
        point = std::sqrt(1.0 + t * t) / length(point) * point;
      }
      return place->second;
    };
    std::vector<Triangle> finer;
    for (const auto& [a, b, c] : surface.triangles) {
      const int ab = middle(a, b);
      const int bc = middle(b, c);
      const int ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    surface.triangles = finer;
  }
  double six = 0.0;
  for (Point3& point : surface.points) {
    point = radius / length(point) * point;
  }
  for (const auto& [a, b, c] : surface.triangles) {
    six += inner(surface.points[static_cast<std::size_t>(a)],
                 cross(surface.points[static_cast<std::size_t>(b)],
                       surface.points[static_cast<std::size_t>(c)]));
  }
  const double factor =
      has_true_volume ? std::cbrt(8.0 * std::numbers::pi * radius * radius * radius / six) : 1.0;
  for (Point3& point : surface.points) {
    point = factor * point;
  }
  return surface;
}

// A box of twelve triangles.
inline Surface box_surface(const Point3& sides, const Point3& corner = {}) {
  Surface surface;
  for (int i = 0; i < 8; ++i) {
    surface.points.push_back(
        corner + Point3{(i & 1) * sides[0], (i >> 1 & 1) * sides[1], (i >> 2) * sides[2]});
  }
  for (const auto& [a, b, c, d] : std::vector<std::array<int, 4>>{
           {0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}) {
    surface.triangles.push_back({a, b, c});
    surface.triangles.push_back({a, c, d});
  }
  return surface;
}

// A solid of revolution around the z axis with the profile (r, z); r may be 0 at both ends.
inline Surface revolved(const std::vector<std::array<double, 2>>& profile, int steps) {
  Surface surface;
  std::vector<std::vector<int>> rings;
  for (const auto& [r, z] : profile) {
    std::vector<int> ring;
    for (int i = 0; i < steps; ++i) {
      if (i == 0 || r > 0.0) {
        const double angle = 2.0 * std::numbers::pi * i / steps;
        surface.points.push_back({r * std::cos(angle), r * std::sin(angle), z});
      }
      ring.push_back(static_cast<int>(surface.points.size()) - 1);
    }
    rings.push_back(ring);
  }
  for (std::size_t j = 0; j + 1 < rings.size(); ++j) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(steps); ++i) {
      const std::size_t next = (i + 1) % static_cast<std::size_t>(steps);
      const int a = rings[j][i];
      const int b = rings[j][next];
      const int c = rings[j + 1][next];
      const int d = rings[j + 1][i];
      if (a != b) {
        surface.triangles.push_back({a, b, c});
      }
      if (c != d) {
        surface.triangles.push_back({a, c, d});
      }
    }
  }
  return surface;
}

inline void append(Surface& surface, const Surface& other) {
  const int first = static_cast<int>(surface.points.size());
  surface.points.insert(surface.points.end(), other.points.begin(), other.points.end());
  for (const auto& [a, b, c] : other.triangles) {
    surface.triangles.push_back({a + first, b + first, c + first});
  }
}

inline std::string ascii_stl(const Surface& surface) {
  std::string text = "solid made here\n";
  for (const Triangle& triangle : surface.triangles) {
    text += "  facet normal 0 0 0\n    outer loop\n";
    for (const int point : triangle) {
      char line[120];
      const Point3& p = surface.points[static_cast<std::size_t>(point)];
      std::snprintf(line, sizeof line, "      vertex %.9e %.9e %.9e\n", p[0], p[1], p[2]);
      text += line;
    }
    text += "    endloop\n  endfacet\n";
  }
  return text + "endsolid made here\n";
}

inline std::string binary_stl(const Surface& surface) {
  std::string bytes = "solid, though binary";
  bytes.resize(80, ' ');
  const auto append_number = [&](auto number) {
    char raw[4];
    static_assert(sizeof number == sizeof raw);
    std::memcpy(raw, &number, sizeof raw);
    bytes.append(raw, sizeof raw);
  };
  append_number(static_cast<std::uint32_t>(surface.triangles.size()));
  for (const Triangle& triangle : surface.triangles) {
    for (int i = 0; i < 3; ++i) {
      append_number(0.0F);
    }
    for (const int point : triangle) {
      for (const double coordinate : surface.points[static_cast<std::size_t>(point)]) {
        append_number(static_cast<float>(coordinate));
      }
    }
    bytes.append(2, '\0');
  }
  return bytes;
}

inline std::string obj(const Surface& surface) {
  std::string text = "# made here\no thing\n";
  for (const Point3& p : surface.points) {
    char line[120];
    std::snprintf(line, sizeof line, "v %.9g %.9g %.9g\n", p[0], p[1], p[2]);
    text += line;
  }
  for (const auto& [a, b, c] : surface.triangles) {
    text += "f " + std::to_string(a + 1) + "/1/1 " + std::to_string(b + 1) + "//2 " +
            std::to_string(c + 1) + "\n";
  }
  return text;
}

}  // namespace ressort::support
