#include "app/commands/body/shapes.h"

#include <algorithm>

#include "app/rooms.h"
#include "app/text.h"

namespace ressort::commands {
namespace {

constexpr std::size_t most_modes = 12;
constexpr std::size_t most_triangles = 60'000;  // limit for the whole figure
constexpr double bend = 0.09;  // largest displacement, as a fraction of the diagonal

plot::Panel shape_panel(const SolidMesh& mesh, const SolidModes& modes, std::size_t k,
                        const std::vector<SolidPlace>& places) {
  const Box3 box = box_around(mesh.points);
  const Point3 middle = 0.5 * (box.low + box.high);
  std::vector<Point3> moved(mesh.points.size());
  std::vector<double> share(mesh.points.size());
  double most = 0.0;
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      moved[i][axis] = modes.shapes(3 * i + axis, k);
    }
    share[i] = length(moved[i]);
  }
  for (const Triangle& triangle : mesh.surface) {
    for (const int corner : triangle) {
      most = std::max(most, share[at(corner)]);
    }
  }
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    share[i] /= most;
    moved[i] = mesh.points[i] - middle + bend * box.diagonal() / most * moved[i];
  }
  const auto corner = [&](std::size_t i) {
    return plot::row({moved[i][0], moved[i][1], moved[i][2], share[i]});
  };
  // The style "pm3d" draws quadrangles. A triangle repeats its last corner.
  plot::Series surface{.style = "pm3d", .data = {}, .title = {}, .columns = "1:2:3:4"};
  for (const Triangle& triangle : mesh.surface) {
    surface.data += corner(at(triangle[0])) + corner(at(triangle[1])) + "\n" +
                    corner(at(triangle[2])) + corner(at(triangle[2])) + "\n\n";
  }
  plot::Series marks{.style = "points pt 6 ps 0.6 lc rgb '#1f6f8b'", .columns = "1:2:3"};
  plot::Series names{
      .style = "labels left offset 0.5,0.4 font 'sans,9' noenhanced tc rgb '#1f6f8b'",
      .columns = "1:2:3:4"};
  for (const SolidPlace& place : places) {
    const Point3& x = moved[at(place.node)];
    marks.data += plot::row({x[0], x[1], x[2]});
    names.data += plot::row({x[0], x[1], x[2]}, place.name);
  }
  const double hz = modes.frequency_hz[k];
  plot::Panel panel{.title = std::to_string(k + 1) + ": " + fixed(hz, hz < 1000.0 ? 1 : 0) + " Hz",
                    .series = {surface, marks},
                    .has_axes = false,
                    .is_solid = true,
                    .colours = plot::ColourMap::heat};
  if (k == 0) {
    panel.series.push_back(names);
  }
  double reach = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    reach = std::max(reach, 0.5 * (box.high[axis] - box.low[axis]) + bend * box.diagonal());
  }
  panel.x = panel.y = {.from = -reach, .to = reach};
  return panel;
}

}  // namespace

plot::Figure shapes_figure(const SolidMesh& mesh, const SolidModes& modes,
                           const std::vector<SolidPlace>& places, const std::string& title) {
  const std::size_t room = std::max<std::size_t>(1, most_triangles / mesh.surface.size());
  const std::size_t count = std::min({most_modes, room, modes.frequency_hz.size()});
  plot::Figure figure{.title = title,
                      .panel_width = 240.0,
                      .panel_height = 220.0,
                      .columns = std::min<std::size_t>(4, count)};
  for (std::size_t k = 0; k < count; ++k) {
    figure.panels.push_back(shape_panel(mesh, modes, k, places));
  }
  return figure;
}

}  // namespace ressort::commands
