#include "core/solids/surface.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numbers>
#include <unordered_map>
#include <utility>

namespace ressort::solids {
namespace {

constexpr double weld_share = 1e-6;      // Welding distance, relative to the solid's size.
constexpr std::size_t shown_edges = 12;  // Most open edges named in an error.

// Maps each point to the first point within `distance`, by a grid of cells of that width.
std::vector<int> weld(const std::vector<Point3>& points, double distance) {
  const auto cell_of = [&](const Point3& point, std::size_t axis) {
    return static_cast<std::int64_t>(std::floor(point[axis] / distance));
  };
  const auto key_of = [](std::int64_t x, std::int64_t y, std::int64_t z) {
    return static_cast<std::uint64_t>(x) * 0x9e3779b97f4a7c15U ^
           static_cast<std::uint64_t>(y) * 0xbf58476d1ce4e5b9U ^
           static_cast<std::uint64_t>(z) * 0x94d049bb133111ebU;
  };
  std::unordered_map<std::uint64_t, std::vector<int>> cells;
  std::vector<int> same(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point3& point = points[i];
    same[i] = static_cast<int>(i);
    const std::int64_t x = cell_of(point, 0);
    const std::int64_t y = cell_of(point, 1);
    const std::int64_t z = cell_of(point, 2);
    for (std::int64_t neighbour = 0; neighbour < 27 && same[i] == static_cast<int>(i);
         ++neighbour) {
      const auto cell = cells.find(
          key_of(x + neighbour % 3 - 1, y + neighbour / 3 % 3 - 1, z + neighbour / 9 - 1));
      if (cell == cells.end()) {
        continue;
      }
      for (const int other : cell->second) {
        if (length(points[at(other)] - point) <= distance) {
          same[i] = other;
          break;
        }
      }
    }
    if (same[i] == static_cast<int>(i)) {
      cells[key_of(x, y, z)].push_back(same[i]);
    }
  }
  return same;
}

struct EdgeUse {
  int low = 0;
  int high = 0;
  int triangle = 0;
  bool is_forward = true;  // From the lower to the higher index.

  bool is_of(const EdgeUse& other) const { return low == other.low && high == other.high; }
};

std::vector<EdgeUse> edges_of(const std::vector<Triangle>& triangles) {
  std::vector<EdgeUse> edges;
  edges.reserve(3 * triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t i = 0; i < 3; ++i) {
      const int from = triangles[t][i];
      const int to = triangles[t][(i + 1) % 3];
      edges.push_back({std::min(from, to), std::max(from, to), static_cast<int>(t), from < to});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const EdgeUse& a, const EdgeUse& b) {
    return std::pair(std::pair(a.low, a.high), a.triangle) <
           std::pair(std::pair(b.low, b.high), b.triangle);
  });
  return edges;
}

// Returns a description of the open edges; empty if every edge belongs to two triangles.
std::string open_edges(const Surface& surface, const std::vector<EdgeUse>& edges) {
  std::string open;
  std::string crowded;
  std::size_t open_count = 0;
  std::size_t crowded_count = 0;
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i;
    while (end < edges.size() && edges[end].is_of(edges[i])) {
      ++end;
    }
    const std::size_t uses = end - i;
    if (uses != 2) {
      std::size_t& count = uses < 2 ? open_count : crowded_count;
      if (++count <= shown_edges) {
        (uses < 2 ? open : crowded) += "\n  " + to_string(surface.points[at(edges[i].low)]) +
                                       " to " + to_string(surface.points[at(edges[i].high)]) +
                                       (uses < 2 ? "" : ": " + std::to_string(uses) + " triangles");
      }
    }
    i = end;
  }
  const auto describe = [](std::size_t count, const char* what, const std::string& list) {
    return count == 0 ? std::string()
                      : std::to_string(count) + (count == 1 ? " edge" : " edges") + what + list +
                            (count > shown_edges
                                 ? "\n  and " + std::to_string(count - shown_edges) + " more"
                                 : "");
  };
  const std::string first =
      describe(open_count, " with a triangle on one side only, in metres:", open);
  const std::string second =
      describe(crowded_count, " with more than two triangles, in metres:", crowded);
  return first + (first.empty() || second.empty() ? "" : "\n") + second;
}

// Numbers the shells and orients the triangles of each consistently. Returns false for a surface
// that cannot be oriented.
bool turn_alike(std::vector<Triangle>& triangles, const std::vector<EdgeUse>& edges,
                ClosedSurface& closed) {
  struct Neighbour {
    int triangle;
    bool is_alike;
  };
  std::vector<std::vector<Neighbour>> beside(triangles.size());
  for (std::size_t i = 0; i + 1 < edges.size(); i += 2) {
    const bool is_alike = edges[i].is_forward != edges[i + 1].is_forward;
    beside[at(edges[i].triangle)].push_back({edges[i + 1].triangle, is_alike});
    beside[at(edges[i + 1].triangle)].push_back({edges[i].triangle, is_alike});
  }
  closed.shell.assign(triangles.size(), -1);
  closed.shells = 0;
  std::vector<char> is_turned(triangles.size(), 0);
  std::vector<int> waiting;
  for (std::size_t seed = 0; seed < triangles.size(); ++seed) {
    if (closed.shell[seed] >= 0) {
      continue;
    }
    closed.shell[seed] = closed.shells;
    waiting.assign(1, static_cast<int>(seed));
    while (!waiting.empty()) {
      const int triangle = waiting.back();
      waiting.pop_back();
      for (const Neighbour& next : beside[at(triangle)]) {
        const char wanted = static_cast<char>(is_turned[at(triangle)] ^ (next.is_alike ? 0 : 1));
        if (closed.shell[at(next.triangle)] < 0) {
          closed.shell[at(next.triangle)] = closed.shells;
          is_turned[at(next.triangle)] = wanted;
          waiting.push_back(next.triangle);
        } else if (is_turned[at(next.triangle)] != wanted) {
          return false;
        }
      }
    }
    ++closed.shells;
  }
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (is_turned[t] != 0) {
      std::swap(triangles[t][1], triangles[t][2]);
    }
  }
  return true;
}

// Returns the winding number of a shell around a point: its solid angle over 4 pi (van Oosterom and
// Strackee 1983).
double windings(const ClosedSurface& closed, int shell, const Point3& point) {
  double sum = 0.0;
  for (std::size_t t = 0; t < closed.surface.triangles.size(); ++t) {
    if (closed.shell[t] != shell) {
      continue;
    }
    const Triangle& triangle = closed.surface.triangles[t];
    const Point3 a = closed.surface.points[at(triangle[0])] - point;
    const Point3 b = closed.surface.points[at(triangle[1])] - point;
    const Point3 c = closed.surface.points[at(triangle[2])] - point;
    const double la = length(a);
    const double lb = length(b);
    const double lc = length(c);
    sum += std::atan2(inner(a, cross(b, c)),
                      la * lb * lc + inner(a, b) * lc + inner(b, c) * la + inner(c, a) * lb);
  }
  return sum / (2.0 * std::numbers::pi);
}

void turn_shell(ClosedSurface& closed, int shell) {
  for (std::size_t t = 0; t < closed.surface.triangles.size(); ++t) {
    if (closed.shell[t] == shell) {
      std::swap(closed.surface.triangles[t][1], closed.surface.triangles[t][2]);
    }
  }
}

// Puts the outer shell first, facing outwards, and cavities after it, facing inwards. Returns an
// error if there are several bodies.
Result<Done> sort_shells(ClosedSurface& closed, const Progress& progress) {
  constexpr int most_shells = 64;
  if (closed.shells > most_shells) {
    return Error{"its surface has " + std::to_string(closed.shells) +
                 " separate parts; a body must be one part"};
  }
  std::vector<double> volume(at(closed.shells), 0.0);
  std::vector<Point3> corner(at(closed.shells));
  for (std::size_t t = 0; t < closed.surface.triangles.size(); ++t) {
    const Triangle& triangle = closed.surface.triangles[t];
    const Point3& a = closed.surface.points[at(triangle[0])];
    const std::size_t shell = at(closed.shell[t]);
    volume[shell] += inner(
        a, cross(closed.surface.points[at(triangle[1])], closed.surface.points[at(triangle[2])]));
    corner[shell] = a;
  }
  for (int shell = 0; shell < closed.shells; ++shell) {
    if (volume[at(shell)] < 0.0) {
      turn_shell(closed, shell);
    }
  }
  const auto largest =
      std::max_element(volume.begin(), volume.end(),
                       [](double a, double b) { return std::abs(a) < std::abs(b); }) -
      volume.begin();
  const int outer = static_cast<int>(largest);
  for (int shell = 0; shell < closed.shells; ++shell) {
    if (shell == outer) {
      continue;
    }
    progress.spend(16 * closed.surface.triangles.size());
    int around = 0;
    for (int other = 0; other < closed.shells; ++other) {
      if (other != shell) {
        around += windings(closed, other, corner[at(shell)]) > 0.5 ? 1 : 0;
      }
    }
    if (around != 1) {
      return Error{"it has more than one part: the part with a corner at " +
                   to_string(corner[at(shell)]) +
                   " m is not connected to the rest; a body must be one part"};
    }
  }
  for (int shell = 0; shell < closed.shells; ++shell) {
    if (shell != outer) {
      turn_shell(closed, shell);
    }
  }
  for (int& shell : closed.shell) {
    shell = shell == outer ? 0 : shell == 0 ? outer : shell;
  }
  return Done{};
}

}  // namespace

double length(const Point3& a) {
  return std::sqrt(inner(a, a));
}

double six_volumes(const Surface& surface) {
  double sum = 0.0;
  for (const Triangle& triangle : surface.triangles) {
    sum += inner(surface.points[at(triangle[0])],
                 cross(surface.points[at(triangle[1])], surface.points[at(triangle[2])]));
  }
  return sum;
}

Box3 box_around(const std::vector<Point3>& points) {
  if (points.empty()) {
    return {};
  }
  Box3 box{points.front(), points.front()};
  for (const Point3& point : points) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.low[axis] = std::min(box.low[axis], point[axis]);
      box.high[axis] = std::max(box.high[axis], point[axis]);
    }
  }
  return box;
}

std::string to_string(const Point3& point) {
  char text[100];
  std::snprintf(text, sizeof text, "(%.4g, %.4g, %.4g)", point[0], point[1], point[2]);
  return text;
}

Surface scaled(Surface surface, double metres_per_unit) {
  for (Point3& point : surface.points) {
    point = metres_per_unit * point;
  }
  return surface;
}

Result<ClosedSurface> close_surface(const Surface& surface, const Progress& progress) {
  const double size = box_around(surface.points).diagonal();
  if (!(size > 0.0)) {
    return Error{"all of its points coincide"};
  }
  const std::vector<int> same = weld(surface.points, weld_share * size);
  progress.spend(64 * surface.points.size());
  ClosedSurface closed;
  std::vector<int> renumbered(surface.points.size(), -1);
  for (const Triangle& triangle : surface.triangles) {
    const Triangle corners{same[at(triangle[0])], same[at(triangle[1])], same[at(triangle[2])]};
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) {
      ++closed.left_out;
      continue;
    }
    Triangle kept{};
    for (std::size_t i = 0; i < 3; ++i) {
      int& number = renumbered[at(corners[i])];
      if (number < 0) {
        number = static_cast<int>(closed.surface.points.size());
        closed.surface.points.push_back(surface.points[at(corners[i])]);
      }
      kept[i] = number;
    }
    closed.surface.triangles.push_back(kept);
  }
  for (std::size_t i = 0; i < same.size(); ++i) {
    closed.welded += same[i] != static_cast<int>(i) ? 1 : 0;
  }
  const std::vector<EdgeUse> edges = edges_of(closed.surface.triangles);
  progress.spend(64 * edges.size());
  if (const std::string open = open_edges(closed.surface, edges); !open.empty()) {
    return Error{"the surface is not closed: " + open};
  }
  const std::vector<Triangle> given = closed.surface.triangles;
  if (!turn_alike(closed.surface.triangles, edges, closed)) {
    return Error{"the surface is one-sided (like a Möbius strip), so it encloses no volume"};
  }
  if (auto sorted = sort_shells(closed, progress); !sorted) {
    return sorted.error();
  }
  for (std::size_t t = 0; t < given.size(); ++t) {
    closed.turned += given[t] != closed.surface.triangles[t] ? 1 : 0;
  }
  closed.volume = six_volumes(closed.surface) / 6.0;
  const Point3 sides =
      box_around(closed.surface.points).high - box_around(closed.surface.points).low;
  if (!(closed.volume > 1e-9 * size * size * size) ||
      *std::min_element(sides.begin(), sides.end()) <= 0.0) {
    return Error{"the surface encloses no volume: its volume is " + std::to_string(closed.volume) +
                 " m^3"};
  }
  return closed;
}

}  // namespace ressort::solids
