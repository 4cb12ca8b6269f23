#include "app/commands/body/shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "app/commands/svg.h"
#include "app/text.h"

namespace ressort::commands {
namespace {

constexpr std::size_t most_modes = 12;
constexpr std::size_t most_triangles = 60'000;  // of the whole picture
constexpr std::size_t columns = 4;
constexpr double cell = 240.0;    // of one mode, in pixels
constexpr double caption = 26.0;  // below it
constexpr double bend = 0.09;     // of the solid's size: the farthest that it is drawn bent
constexpr double filled = 0.86;   // of the cell

// From light yellow, which stays, through orange to violet (after "magma", reversed).
std::string colour(double share) {
  constexpr std::array<std::array<double, 3>, 6> stops = {{{252, 246, 206},
                                                           {254, 206, 145},
                                                           {248, 137, 97},
                                                           {211, 67, 110},
                                                           {130, 37, 129},
                                                           {55, 15, 92}}};
  const double place = std::clamp(share, 0.0, 1.0) * (stops.size() - 1);
  const auto low = std::min(static_cast<std::size_t>(place), stops.size() - 2);
  const double part = place - static_cast<double>(low);
  char text[8];
  std::array<int, 3> rgb{};
  for (std::size_t i = 0; i < 3; ++i) {
    rgb[i] = static_cast<int>(std::lround((1.0 - part) * stops[low][i] + part * stops[low + 1][i]));
  }
  std::snprintf(text, sizeof text, "#%02x%02x%02x", rgb[0], rgb[1], rgb[2]);
  return text;
}

// Looked at from above and the side: x to the right and down, y to the right and up, z up.
struct View {
  Point3 right{0.819, 0.574, 0.0};
  Point3 up{-0.287, 0.410, 0.866};
  Point3 towards{0.497, -0.709, 0.5};  // the eye
};

struct Patch {
  double depth;
  std::array<double, 6> corners;  // x, y in pixels
  double share;
};

}  // namespace

std::string shapes_picture(const SolidMesh& mesh, const SolidModes& modes,
                           const std::vector<SolidPlace>& places, const std::string& title) {
  const View view;
  const std::size_t room = std::max<std::size_t>(1, most_triangles / mesh.surface.size());
  const std::size_t count = std::min({most_modes, room, modes.frequency_hz.size()});
  const double size = box_around(mesh.points).diagonal();
  const Box3 box = box_around(mesh.points);
  const Point3 middle = 0.5 * (box.low + box.high);
  // One scale for all: the largest reach from the middle of what is seen, bent.
  double reach = 0.0;
  double rise = 0.0;
  for (const Point3& point : mesh.points) {
    reach = std::max(reach, std::abs(inner(view.right, point - middle)));
    rise = std::max(rise, std::abs(inner(view.up, point - middle)));
  }
  reach += 0.7 * bend * size;
  rise += 0.7 * bend * size;
  const double scale = 0.5 * filled * cell / std::max(reach, rise);
  const double cell_height = 2.0 * scale * rise;
  const std::size_t rows = (count + columns - 1) / columns;
  const double width = cell * static_cast<double>(std::min(count, columns));
  const double height = 34.0 + static_cast<double>(rows) * (cell_height + caption);
  std::string svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + fixed(width, 0) +
                    " " + fixed(height, 0) + "\" font-family=\"sans-serif\" font-size=\"13\">\n" +
                    "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n" +
                    "<text x=\"8\" y=\"20\" font-size=\"14\">" + escaped(title) + "</text>\n";
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<Point3> moved(mesh.points.size());
    std::vector<double> share(mesh.points.size());
    double most = 0.0;
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        moved[i][axis] = modes.shapes(3 * i + axis, k);
      }
      share[i] = length(moved[i]);
      most = std::max(most, share[i]);
    }
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
      share[i] /= most;
      moved[i] = mesh.points[i] - middle + bend * size / most * moved[i];
    }
    const double x0 = cell * (static_cast<double>(k % columns) + 0.5);
    const auto row = k / columns;
    const double y0 = 34.0 + static_cast<double>(row) * (cell_height + caption) + 0.5 * cell_height;
    const auto on_paper = [&](const Point3& point) {
      return std::array<double, 2>{x0 + scale * inner(view.right, point),
                                   y0 - scale * inner(view.up, point)};
    };
    std::vector<Patch> patches;
    for (const Triangle& triangle : mesh.surface) {
      const Point3& a = moved[at(triangle[0])];
      const Point3& b = moved[at(triangle[1])];
      const Point3& c = moved[at(triangle[2])];
      if (inner(cross(b - a, c - a), view.towards) <= 0.0) {
        continue;  // its back
      }
      Patch patch{inner(a + b + c, view.towards), {}, 0.0};
      for (std::size_t i = 0; i < 3; ++i) {
        const auto xy = on_paper(moved[at(triangle[i])]);
        patch.corners[2 * i] = xy[0];
        patch.corners[2 * i + 1] = xy[1];
        patch.share += share[at(triangle[i])] / 3.0;
      }
      patches.push_back(patch);
    }
    std::sort(patches.begin(), patches.end(),
              [](const Patch& a, const Patch& b) { return a.depth < b.depth; });
    svg += "<g stroke-width=\"0.5\" stroke-linejoin=\"round\">\n";
    for (const Patch& patch : patches) {
      const std::string fill = colour(patch.share);
      svg += "<path fill=\"" + fill + "\" stroke=\"" + fill + "\" d=\"M";
      for (const double number : patch.corners) {
        svg += fixed(number, 1) + " ";
      }
      svg += "Z\"/>\n";
    }
    svg += "</g>\n";
    for (const SolidPlace& place : places) {
      const auto xy = on_paper(moved[at(place.node)]);
      svg += "<circle cx=\"" + fixed(xy[0], 1) + "\" cy=\"" + fixed(xy[1], 1) +
             "\" r=\"2.5\" fill=\"none\" stroke=\"#1f6f8b\"/>\n";
      if (k == 0) {
        svg += "<text x=\"" + fixed(xy[0] + 4.0, 1) + "\" y=\"" + fixed(xy[1] - 3.0, 1) +
               "\" font-size=\"10\" fill=\"#1f6f8b\">" + escaped(place.name) + "</text>\n";
      }
    }
    const double hz = modes.frequency_hz[k];
    svg += "<text text-anchor=\"middle\" x=\"" + fixed(x0, 0) + "\" y=\"" +
           fixed(y0 + 0.5 * cell_height + 14.0, 0) + "\">" + std::to_string(k + 1) + ": " +
           fixed(hz, hz < 1000.0 ? 1 : 0) + " Hz</text>\n";
  }
  return svg + "</svg>\n";
}

}  // namespace ressort::commands
