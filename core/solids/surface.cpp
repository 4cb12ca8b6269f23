#include "core/solids/surface.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numbers>
#include <set>
#include <unordered_map>
#include <utility>

#include "core/ranges.h"

namespace ressort::solids {
namespace {

constexpr double weld_share = 1e-6;      // Welding distance, relative to the solid's size.
constexpr double hole_share = 1.0;       // Longest hole that is closed, likewise.
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

// The edges of a surface, by the number of their triangles.
struct Seams {
  std::vector<std::array<EdgeUse, 2>> pairs;  // Uses that continue each other.
  std::vector<EdgeUse> open;                  // One triangle.
  std::vector<EdgeUse> crowded;               // Three triangles, five and so on.
};

// A sheet continues across every edge with several triangles. In a solid, each forward use
// continues a backward one.
Seams find_seams(const Surface& surface, bool is_sheet) {
  std::vector<EdgeUse> edges;
  edges.reserve(3 * surface.triangles.size());
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    for (std::size_t i = 0; i < 3; ++i) {
      const int from = surface.triangles[t][i];
      const int to = surface.triangles[t][(i + 1) % 3];
      edges.push_back({std::min(from, to), std::max(from, to), static_cast<int>(t), from < to});
    }
  }
  std::ranges::sort(edges, [](const EdgeUse& a, const EdgeUse& b) {
    return std::pair(std::pair(a.low, a.high), a.triangle) <
           std::pair(std::pair(b.low, b.high), b.triangle);
  });
  Seams seams;
  for (std::size_t i = 0, end = 0; i < edges.size(); i = end) {
    while (end < edges.size() && edges[end].is_of(edges[i])) {
      ++end;
    }
    const std::size_t uses = end - i;
    if (uses == 1) {
      seams.open.push_back(edges[i]);
    } else if (uses > 2) {
      for (std::size_t k = i; k + 1 < end; k += 2) {
        const auto other =
            std::find_if(edges.begin() + static_cast<std::ptrdiff_t>(k) + 1,
                         edges.begin() + static_cast<std::ptrdiff_t>(end),
                         [&](const EdgeUse& use) { return use.is_forward != edges[k].is_forward; });
        if (other != edges.begin() + static_cast<std::ptrdiff_t>(end)) {
          std::swap(edges[k + 1], *other);
        }
      }
      if (uses % 2 == 1) {
        seams.crowded.push_back(edges[end - 1]);
      }
    }
    for (std::size_t k = i; k + 1 < end; k += is_sheet ? 1 : 2) {
      seams.pairs.push_back({edges[k], edges[k + 1]});
    }
  }
  return seams;
}

// Returns a description of the edges that do not continue; empty if every edge does.
std::string open_edges(const Surface& surface, const Seams& seams) {
  std::string text;
  for (const auto& [edges, what] :
       {std::pair(&seams.open, " with a triangle on one side only, in metres:"),
        std::pair(&seams.crowded, " with an odd number of triangles, in metres:")}) {
    if (edges->empty()) {
      continue;
    }
    text += (text.empty() ? "" : "\n") + std::to_string(edges->size()) +
            (edges->size() == 1 ? " edge" : " edges") + what;
    for (std::size_t i = 0; i < std::min(edges->size(), shown_edges); ++i) {
      text += "\n  " + to_string(surface.points[at((*edges)[i].low)]) + " to " +
              to_string(surface.points[at((*edges)[i].high)]);
    }
    text += edges->size() > shown_edges
                ? "\n  and " + std::to_string(edges->size() - shown_edges) + " more"
                : "";
  }
  return text;
}

// One edge of a loop around a hole.
struct Rim {
  int from = 0;  // the point before it
  int side = 0;  // 3 triangle + the corner where the triangle's edge begins
};

// Returns the loops of open edges. At each point, a loop leaves by the other end of the fan of
// triangles at whose end it arrived, so loops that touch at a point stay apart. O(n)
std::vector<std::vector<Rim>> find_holes(const Surface& surface, const Seams& seams) {
  const auto side_of = [&](const EdgeUse& use) {
    const Triangle& corners = surface.triangles[at(use.triangle)];
    const auto* const start = std::ranges::find(corners, use.is_forward ? use.low : use.high);
    return 3 * use.triangle + static_cast<int>(start - corners.begin());
  };
  const auto corner = [&](int side, int step) {
    return surface.triangles[at(side / 3)][at((side + step) % 3)];
  };
  std::vector<int> beyond(3 * surface.triangles.size(), -1);  // [side] the side that continues it
  for (const auto& [one, other] : seams.pairs) {
    beyond[at(side_of(one))] = side_of(other);
    beyond[at(side_of(other))] = side_of(one);
  }
  std::vector<std::vector<Rim>> holes;
  std::vector<int> place(surface.points.size(), -1);  // of a point in the path
  std::vector<char> is_done(beyond.size(), 0);
  for (int start = 0; at(start) < beyond.size(); ++start) {
    std::vector<Rim> path;
    int point = corner(start, 0);
    for (int side = start; beyond[at(side)] < 0 && is_done[at(side)] == 0;) {
      is_done[at(side)] = 1;
      place[at(point)] = static_cast<int>(path.size());
      path.push_back({point, side});
      point = corner(side, corner(side, 0) == point ? 1 : 0);
      if (place[at(point)] >= 0) {
        const auto first = path.begin() + place[at(point)];
        holes.emplace_back(first, path.end());
        for (const Rim& rim : holes.back()) {
          place[at(rim.from)] = -1;
        }
        path.erase(first, path.end());
      }
      do {  // Turns to the other side of the triangle at this point, and to the next triangle.
        side = beyond[at(side)] < 0 ? side : beyond[at(side)];
        side = side / 3 * 3 + (side + (corner(side, 0) == point ? 2 : 1)) % 3;
      } while (beyond[at(side)] >= 0);
    }
  }
  return holes;
}

// Closes each hole with a short edge, relative to the surface, by a fan of triangles around its
// middle.
void close_holes(Surface& surface, Repairs& repairs) {
  const double size = box_around(surface.points).diagonal();
  for (const std::vector<Rim>& hole : find_holes(surface, find_seams(surface, false))) {
    double around = 0.0;
    Point3 middle{};
    for (std::size_t i = 0; i < hole.size(); ++i) {
      const Point3& point = surface.points[at(hole[i].from)];
      around += length(surface.points[at(hole[(i + 1) % hole.size()].from)] - point);
      middle = middle + 1.0 / static_cast<double>(hole.size()) * point;
    }
    if (around > hole_share * size) {
      continue;
    }
    ++repairs.holes;
    repairs.longest_hole = std::max(repairs.longest_hole, around / size);
    for (const Rim& rim : hole) {
      const Triangle& beside = surface.triangles[at(rim.side / 3)];
      surface.triangles.push_back({beside[at((rim.side + 1) % 3)], beside[at(rim.side % 3)],
                                   static_cast<int>(surface.points.size())});
    }
    surface.points.push_back(middle);
  }
}

// A surface with a number for each triangle: the part that it belongs to.
struct Parts {
  std::vector<int> part;
  int count = 0;
};

// Numbers the parts and orients the triangles of each consistently. Returns false for a surface
// that cannot be oriented.
bool turn_alike(std::vector<Triangle>& triangles, const Seams& seams, Parts& parts) {
  struct Neighbour {
    int triangle;
    bool is_alike;
  };
  std::vector<std::vector<Neighbour>> beside(triangles.size());
  for (const auto& [one, other] : seams.pairs) {
    const bool is_alike = one.is_forward != other.is_forward;
    beside[at(one.triangle)].push_back({other.triangle, is_alike});
    beside[at(other.triangle)].push_back({one.triangle, is_alike});
  }
  parts.part.assign(triangles.size(), -1);
  bool has_two_sides = true;
  std::vector<char> is_turned(triangles.size(), 0);
  std::vector<int> waiting;
  for (std::size_t seed = 0; seed < triangles.size(); ++seed) {
    if (parts.part[seed] >= 0) {
      continue;
    }
    parts.part[seed] = parts.count;
    waiting.assign(1, static_cast<int>(seed));
    while (!waiting.empty()) {
      const int triangle = waiting.back();
      waiting.pop_back();
      for (const Neighbour& next : beside[at(triangle)]) {
        const char wanted = static_cast<char>(is_turned[at(triangle)] ^ (next.is_alike ? 0 : 1));
        if (parts.part[at(next.triangle)] < 0) {
          parts.part[at(next.triangle)] = parts.count;
          is_turned[at(next.triangle)] = wanted;
          waiting.push_back(next.triangle);
        } else {
          has_two_sides = has_two_sides && is_turned[at(next.triangle)] == wanted;
        }
      }
    }
    ++parts.count;
  }
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (is_turned[t] != 0) {
      std::swap(triangles[t][1], triangles[t][2]);
    }
  }
  return has_two_sides;
}

double area_of(const Surface& surface, const Triangle& triangle) {
  const Point3& a = surface.points[at(triangle[0])];
  return 0.5 *
         length(cross(surface.points[at(triangle[1])] - a, surface.points[at(triangle[2])] - a));
}

std::size_t largest_part(const Surface& surface, const Parts& parts) {
  std::vector<double> area(at(parts.count), 0.0);
  for (std::size_t t = 0; t < parts.part.size(); ++t) {
    area[at(parts.part[t])] += area_of(surface, surface.triangles[t]);
  }
  return static_cast<std::size_t>(std::ranges::max_element(area) - area.begin());
}

// Welds points within 1e-6 of the size, and drops repeated triangles, those without area and unused
// points.
Result<Surface> tidied(const Surface& given, Repairs& repairs, const Progress& progress) {
  const double size = box_around(given.points).diagonal();
  if (!(size > 0.0)) {
    return Error{"all of its points coincide"};
  }
  const std::vector<int> same = weld(given.points, weld_share * size);
  progress.spend(64 * given.points.size());
  Surface tidy;
  std::vector<int> renumbered(given.points.size(), -1);
  std::set<Triangle> seen;
  for (const Triangle& triangle : given.triangles) {
    Triangle corners{same[at(triangle[0])], same[at(triangle[1])], same[at(triangle[2])]};
    Triangle sorted = corners;
    std::ranges::sort(sorted);
    if (sorted[0] == sorted[1] || sorted[1] == sorted[2] || !seen.insert(sorted).second) {
      ++repairs.left_out;
      continue;
    }
    for (int& corner : corners) {
      int& number = renumbered[at(corner)];
      if (number < 0) {
        number = static_cast<int>(tidy.points.size());
        tidy.points.push_back(given.points[at(corner)]);
      }
      corner = number;
    }
    tidy.triangles.push_back(corners);
  }
  for (std::size_t i = 0; i < same.size(); ++i) {
    repairs.welded += same[i] != static_cast<int>(i) ? 1 : 0;
  }
  if (tidy.triangles.empty()) {
    return Error{"its triangles have no area"};
  }
  return tidy;
}

// Drops the triangles of some parts.
void keep_parts(Surface& surface, Parts& parts, const std::vector<char>& is_kept,
                Repairs& repairs) {
  const auto dropped = std::ranges::count(is_kept, 0);
  if (dropped == 0) {
    return;
  }
  repairs.parts += static_cast<std::size_t>(dropped);
  double whole = 0.0;
  double kept_area = 0.0;
  Surface kept{surface.points, {}};
  std::vector<int> part;
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    const double area = area_of(surface, surface.triangles[t]);
    whole += area;
    if (is_kept[at(parts.part[t])] != 0) {
      kept_area += area;
      kept.triangles.push_back(surface.triangles[t]);
      part.push_back(parts.part[t]);
    }
  }
  repairs.parts_area = 1.0 - (1.0 - repairs.parts_area) * kept_area / whole;
  Repairs nothing;
  surface = *tidied(kept, nothing, Progress());
  parts.part = part;
}

// Drops the parts that are open, if the largest one is closed.
void drop_open_parts(Surface& surface, Seams& seams, Repairs& repairs) {
  Parts parts;
  std::vector<Triangle> turned = surface.triangles;
  turn_alike(turned, find_seams(surface, true), parts);
  std::vector<char> is_kept(at(parts.count), 1);
  for (const auto* edges : {&seams.open, &seams.crowded}) {
    for (const EdgeUse& edge : *edges) {
      is_kept[at(parts.part[at(edge.triangle)])] = 0;
    }
  }
  if (is_kept[largest_part(surface, parts)] != 0) {
    keep_parts(surface, parts, is_kept, repairs);
    seams = find_seams(surface, false);
  }
}

// Turns the largest part outwards and the cavities in it inwards, and drops all other parts. The
// largest part is the first one afterwards. `read` are the triangles as they were read.
void keep_one_body(Surface& surface, Parts& parts, const std::vector<Triangle>& read,
                   Repairs& repairs, const Progress& progress) {
  const std::size_t count = at(parts.count);
  std::vector<Surface> alone(count, Surface{surface.points, {}});
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    alone[at(parts.part[t])].triangles.push_back(surface.triangles[t]);
  }
  const auto volume = mapped(alone, [](const Surface& part) { return six_volumes(part); });
  const auto outer = static_cast<std::size_t>(
      std::ranges::max_element(volume,
                               [](double a, double b) { return std::abs(a) < std::abs(b); }) -
      volume.begin());
  // A part inside another one has all its corners there; a few of them tell.
  const auto is_within = [&](std::size_t part, std::size_t other) {
    const auto& triangles = alone[part].triangles;
    for (std::size_t i = 0; i < triangles.size(); i += 1 + triangles.size() / 8) {
      progress.spend(16 * alone[other].triangles.size());
      if (std::abs(windings(alone[other], surface.points[at(triangles[i][0])])) < 0.5) {
        return false;
      }
    }
    return true;
  };
  std::vector<char> is_inside(count, 0);
  for (std::size_t part = 0; part < count; ++part) {
    is_inside[part] = part == outer || is_within(part, outer) ? 1 : 0;
  }
  std::vector<char> is_kept = is_inside;
  for (std::size_t part = 0; part < count; ++part) {
    for (std::size_t other = 0; other < count && part != outer && is_kept[part] != 0; ++other) {
      const bool is_wall = other != part && other != outer && is_inside[other] != 0;
      is_kept[part] = is_wall && is_within(part, other) ? 0 : 1;
    }
  }
  std::vector<int> number(count, 0);
  parts.count = 1;
  for (std::size_t part = 0; part < count; ++part) {
    number[part] = part != outer && is_kept[part] != 0 ? parts.count++ : 0;
  }
  for (std::size_t t = 0; t < read.size(); ++t) {
    const std::size_t part = at(parts.part[t]);
    if ((volume[part] < 0.0) == (part == outer)) {
      std::swap(surface.triangles[t][1], surface.triangles[t][2]);
    }
    repairs.turned += is_kept[part] != 0 && read[t] != surface.triangles[t] ? 1 : 0;
  }
  keep_parts(surface, parts, is_kept, repairs);
  for (int& part : parts.part) {
    part = number[at(part)];
  }
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

double windings(const Surface& surface, const Point3& point) {
  double sum = 0.0;
  for (const Triangle& triangle : surface.triangles) {
    const Point3 a = surface.points[at(triangle[0])] - point;
    const Point3 b = surface.points[at(triangle[1])] - point;
    const Point3 c = surface.points[at(triangle[2])] - point;
    const double la = length(a);
    const double lb = length(b);
    const double lc = length(c);
    sum += std::atan2(inner(a, cross(b, c)),
                      la * lb * lc + inner(a, b) * lc + inner(b, c) * la + inner(c, a) * lb);
  }
  return sum / (2.0 * std::numbers::pi);
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

Result<ClosedSurface> close_surface(const Surface& given, const Progress& progress) {
  ClosedSurface closed;
  Surface& surface = closed.surface;
  Repairs& repairs = closed.repairs;
  auto tidy = tidied(given, repairs, progress);
  if (!tidy) {
    return tidy.error();
  }
  surface = *std::move(tidy);
  close_holes(surface, repairs);
  Seams seams = find_seams(surface, false);
  drop_open_parts(surface, seams, repairs);
  progress.spend(400 * surface.triangles.size());
  if (const std::string open = open_edges(surface, seams); !open.empty()) {
    return Error{"the surface is not closed: " + open};
  }
  const std::vector<Triangle> read = surface.triangles;
  Parts parts;
  if (!turn_alike(surface.triangles, seams, parts)) {
    return Error{"the surface is one-sided (like a Möbius strip), so it encloses no volume"};
  }
  keep_one_body(surface, parts, read, repairs, progress);
  closed.shell = parts.part;
  closed.shells = parts.count;
  closed.volume = six_volumes(surface) / 6.0;
  const Box3 box = box_around(surface.points);
  const Point3 sides = box.high - box.low;
  const double size = box.diagonal();
  if (!(closed.volume > 1e-9 * size * size * size) || *std::ranges::min_element(sides) <= 0.0) {
    return Error{"the surface encloses no volume: its volume is " + std::to_string(closed.volume) +
                 " m^3"};
  }
  return closed;
}

Result<Sheet> repaired_sheet(const Surface& given, const Progress& progress) {
  Sheet sheet;
  auto tidy = tidied(given, sheet.repairs, progress);
  if (!tidy) {
    return tidy.error();
  }
  sheet.surface = *std::move(tidy);
  Parts parts;
  turn_alike(sheet.surface.triangles, find_seams(sheet.surface, true), parts);
  progress.spend(400 * sheet.surface.triangles.size());
  std::vector<char> is_kept(at(parts.count), 0);
  is_kept[largest_part(sheet.surface, parts)] = 1;
  keep_parts(sheet.surface, parts, is_kept, sheet.repairs);
  return sheet;
}

}  // namespace ressort::solids
