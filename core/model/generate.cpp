#include "core/model/generate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/model/language/tokens.h"
#include "core/model/topology.h"

namespace ressort::model {
namespace {

struct Point {
  std::string label;  // without the prefix NAME_
  double x = 0.0;
  double y = 0.0;
  bool is_fixed = false;
};

struct Bond {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  bool is_second = false;  // K2 instead of K and Z
};

struct Layout {
  std::vector<Point> points;
  std::vector<Bond> bonds;
};

std::string at(const char* prefix, std::uint32_t i) {
  return prefix + std::to_string(i);
}

std::string in_row(std::uint32_t j, std::uint32_t i) {
  return at("m", j) + "_" + std::to_string(i);
}

// Returns the macro of the same shape, if there is one.
std::optional<MacroKind> macro_of(ShapeKind kind) {
  switch (kind) {
    case ShapeKind::string:
      return MacroKind::string;
    case ShapeKind::stiff_string:
      return MacroKind::stiff_string;
    case ShapeKind::chain:
      return MacroKind::chain;
    case ShapeKind::mesh:
      return MacroKind::mesh;
    case ShapeKind::closed_mesh:
      return MacroKind::closed_mesh;
    case ShapeKind::corner_mesh:
      return MacroKind::corner_mesh;
    default:
      return std::nullopt;
  }
}

// The nodes and links of a macro, with labels.
Layout of_macro(const Shape& shape, MacroKind kind) {
  Network network;
  network.macros.push_back({.kind = kind,
                            .length = shape.length,
                            .width = is_mesh(kind) ? shape.width : 1,
                            .stiffness = 0,
                            .second_stiffness = 1});
  const Macro& macro = network.macros[0];
  Layout made;
  std::uint32_t moving = 0;
  for (std::uint32_t k = 0; k < node_count(macro); ++k) {
    const std::uint32_t row = k / macro.width;
    const std::uint32_t column = k % macro.width;
    const bool held = is_fixed(macro, k);
    const std::string label = is_mesh(kind) ? in_row(row, column)
                              : held        ? at("s", k == 0 ? 0 : 1)
                                            : at("m", moving++);
    made.points.push_back({label, row / 10.0, column / 10.0, held});
  }
  for (const Link& link : expand_macros(network).links) {
    made.bonds.push_back({link.a, link.b, link.arguments[0] == macro.second_stiffness});
  }
  return made;
}

bool is_held(FixedPoints fixed, bool on_border, bool on_corner) {
  return (fixed == FixedPoints::border && on_border) ||
         (fixed == FixedPoints::corners && on_corner);
}

Layout triangle(const Shape& shape) {
  Layout made;
  const std::uint32_t n = shape.length;
  std::vector<std::uint32_t> first;  // point of each row
  for (std::uint32_t j = 0; j < n; ++j) {
    first.push_back(static_cast<std::uint32_t>(made.points.size()));
    for (std::uint32_t i = 0; i < n - j; ++i) {
      const int sides = (j == 0 ? 1 : 0) + (i == 0 ? 1 : 0) + (i + j + 1 == n ? 1 : 0);
      made.points.push_back(
          {in_row(j, i), j / 10.0, (2 * i + j) / 20.0, is_held(shape.fixed, sides > 0, sides > 1)});
    }
  }
  for (std::uint32_t j = 0; j < n; ++j) {
    for (std::uint32_t i = 0; i + 1 < n - j; ++i) {
      made.bonds.push_back({first[j] + i, first[j] + i + 1});
    }
  }
  for (const std::uint32_t side : {0u, 1u}) {
    for (std::uint32_t j = 0; j + 1 < n; ++j) {
      for (std::uint32_t i = 0; i + 1 < n - j; ++i) {
        made.bonds.push_back({first[j] + i + side, first[j + 1] + i});
      }
    }
  }
  return made;
}

// A hexagon: ring j has six sides of j points, and each side starts at a corner.
Layout hexagon(const Shape& shape) {
  struct Direction {
    int q, r;
  };
  static constexpr Direction corners[] = {{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};
  Layout made;
  const std::uint32_t n = shape.length;
  made.points.push_back({in_row(0, 0)});
  for (std::uint32_t j = 1; j <= n; ++j) {
    for (std::uint32_t k = 0; k < 6 * j; ++k) {
      const int steps = static_cast<int>(k % j);
      const Direction from = corners[k / j];
      const Direction along = corners[(k / j + 2) % 6];
      const int q = from.q * static_cast<int>(j) + along.q * steps;
      const int r = from.r * static_cast<int>(j) + along.r * steps;
      made.points.push_back({in_row(j, k), r / 10.0, (2 * q + r) / 20.0,
                             is_held(shape.fixed, j == n, j == n && steps == 0)});
    }
  }
  const auto ring = [](std::uint32_t j) { return j == 0 ? 0 : 1 + 3 * j * (j - 1); };
  for (std::uint32_t j = 1; j <= n; ++j) {
    for (std::uint32_t k = 0; k < 6 * j; ++k) {
      made.bonds.push_back({ring(j) + k, ring(j) + (k + 1) % (6 * j)});
    }
  }
  for (std::uint32_t k = 0; k < 6; ++k) {
    made.bonds.push_back({0, 1 + k});
  }
  for (std::uint32_t j = 2; j <= n; ++j) {
    for (std::uint32_t k = 0; k < 6 * (j - 1); ++k) {
      const std::uint32_t inner = ring(j - 1) + k;
      const std::uint32_t outer = k + k / (j - 1);  // each ring has one more point on a side
      if (k % (j - 1) == 0) {
        made.bonds.push_back({inner, ring(j) + (outer + 6 * j - 1) % (6 * j)});
      }
      made.bonds.push_back({inner, ring(j) + outer});
      made.bonds.push_back({inner, ring(j) + outer + 1});
    }
  }
  return made;
}

Layout layout_of(const Shape& shape) {
  const auto macro = macro_of(shape.kind);
  return macro                               ? of_macro(shape, *macro)
         : shape.kind == ShapeKind::triangle ? triangle(shape)
                                             : hexagon(shape);
}

bool has_width(ShapeKind kind) {
  const auto macro = macro_of(kind);
  return macro && is_mesh(*macro);
}

bool is_plane(ShapeKind kind) {
  return has_width(kind) || kind == ShapeKind::triangle || kind == ShapeKind::hexagon;
}

// Coordinates of the input and the output, 0 to 1. They avoid all axes of symmetry.
struct Spot {
  double u, v;
};
constexpr Spot input_spot = {0.3, 0.4};
constexpr Spot output_spot = {0.8, 0.7};

class Builder {
 public:
  explicit Builder(const Shape& shape) : shape_(shape) {
    network_.third = ThirdArgument::velocity_per_second;
    mass_ = parameter("M", shape.mass);
    stiffness_ = parameter("K", shape.stiffness);
    damping_ = parameter("Z", shape.damping);
    if (shape.kind == ShapeKind::stiff_string) {
      second_ = parameter("K2", shape.second_stiffness);
    }
    if (shape.air_damping > 0.0) {
      air_ = parameter("Zo", shape.air_damping);
    }
  }

  Network macro(MacroKind kind) {
    network_.macros.push_back({.name = shape_.name,
                               .kind = kind,
                               .length = shape_.length,
                               .width = is_mesh(kind) ? shape_.width : 1,
                               .mass = mass_,
                               .stiffness = stiffness_,
                               .second_stiffness = second_,
                               .damping = damping_,
                               .air_damping = air_,
                               .position = shape_.position});
    if (shape_.with_io) {
      if (kind == MacroKind::chain || kind == MacroKind::mesh) {
        hold(place({0.0, 0.0}));
      }
      connect(place(input_spot), place(output_spot));
    }
    return canonical(std::move(network_));
  }

  Network points(const Layout& layout) {
    for (const Point& point : layout.points) {
      add(point);
    }
    std::uint32_t first = 0;
    std::uint32_t second = 0;
    for (const Bond& bond : layout.bonds) {
      bond.is_second ? link(at("rs", second++), bond.a, bond.b, second_, no_argument)
                     : link(at("r", first++), bond.a, bond.b, stiffness_, damping_);
    }
    if (shape_.with_io) {
      const std::uint32_t in = nearest(layout, input_spot, no_point);
      const std::uint32_t out = nearest(layout, output_spot, in);
      if (std::ranges::none_of(layout.points, &Point::is_fixed)) {
        hold(0);
      }
      connect(in, out == no_point ? in : out);
    }
    return canonical(std::move(network_));
  }

 private:
  static constexpr std::uint32_t no_point = std::numeric_limits<std::uint32_t>::max();

  std::string label(const std::string& rest) const { return shape_.name + "_" + rest; }

  ArgumentId parameter(const std::string& name, double value) {
    const auto index = static_cast<std::uint32_t>(network_.parameters.size());
    network_.parameters.push_back({.name = label(name), .value = value});
    return network_.add(Formula{Step{Op::parameter, index, 0.0}});
  }

  void add(const Point& point) {
    Mass mass{.name = label(point.label), .kind = MassKind::ground, .position = shape_.position};
    if (!point.is_fixed) {
      mass.kind = MassKind::mass;
      mass.mass = mass_;
      if (air_ != no_argument) {
        mass.kind = MassKind::oscillator;
        mass.stiffness = none_ == no_argument ? none_ = network_.add(Formula{Step{}}) : none_;
        mass.damping = air_;
      }
    }
    if (is_plane(shape_.kind)) {
      network_.drawings.push_back({shape_.name, point.x, point.y});
      mass.drawing = static_cast<std::uint32_t>(network_.drawings.size());
    }
    network_.masses.push_back(std::move(mass));
  }

  void link(const std::string& name, std::uint32_t a, std::uint32_t b, ArgumentId stiffness,
            ArgumentId damping) {
    Link link{.name = label(name), .a = a, .b = b};
    link.arguments[0] = stiffness;
    link.arguments[1] = damping;
    network_.links.push_back(std::move(link));
  }

  // Adds a ground: without one, the first push would move the whole shape away.
  void hold(std::uint32_t mass) {
    network_.masses.push_back(
        {.name = label("s0"), .kind = MassKind::ground, .position = shape_.position});
    link("h", static_cast<std::uint32_t>(network_.masses.size() - 1), mass, stiffness_, damping_);
  }

  void connect(std::uint32_t in, std::uint32_t out) {
    network_.inputs.push_back({.number = 1, .is_force = true, .mass = in});
    network_.outputs.push_back({.number = 1, .mass = out});
  }

  std::uint32_t place(Spot spot) {
    const ArgumentId u = network_.add(Formula{Step{Op::number, 0, spot.u}});
    const ArgumentId v =
        has_width(shape_.kind) ? network_.add(Formula{Step{Op::number, 0, spot.v}}) : no_argument;
    network_.masses.push_back(
        {.kind = MassKind::point, .tap = static_cast<std::uint32_t>(network_.taps.size())});
    network_.taps.push_back({.macro = 0, .u = u, .v = v});
    return static_cast<std::uint32_t>(network_.masses.size() - 1);
  }

  // Returns the moving point nearest to the spot, except `other`.
  static std::uint32_t nearest(const Layout& layout, Spot spot, std::uint32_t other) {
    double x[2] = {0.0, 0.0};
    double y[2] = {0.0, 0.0};
    for (const Point& point : layout.points) {
      x[0] = std::min(x[0], point.x);
      x[1] = std::max(x[1], point.x);
      y[0] = std::min(y[0], point.y);
      y[1] = std::max(y[1], point.y);
    }
    std::uint32_t best = no_point;
    double least = std::numeric_limits<double>::infinity();
    for (std::uint32_t i = 0; i < layout.points.size(); ++i) {
      const Point& point = layout.points[i];
      const double far = std::hypot(point.x - (x[0] + spot.u * (x[1] - x[0])),
                                    point.y - (y[0] + spot.v * (y[1] - y[0])));
      if (!point.is_fixed && i != other && far < least - 1e-9) {
        least = far;
        best = i;
      }
    }
    return best;
  }

  const Shape& shape_;
  Network network_;
  ArgumentId mass_ = no_argument;
  ArgumentId stiffness_ = no_argument;
  ArgumentId second_ = no_argument;
  ArgumentId damping_ = no_argument;
  ArgumentId air_ = no_argument;
  ArgumentId none_ = no_argument;  // K of an oscillator with air damping only
};

std::uint64_t point_count(const Shape& shape) {
  const std::uint64_t n = shape.length;
  switch (shape.kind) {
    case ShapeKind::triangle:
      return n * (n + 1) / 2;
    case ShapeKind::hexagon:
      return 1 + 3 * n * (n + 1);
    default:
      return has_width(shape.kind) ? n * shape.width : n;
  }
}

std::uint32_t least_size(ShapeKind kind) {
  switch (kind) {
    case ShapeKind::hexagon:
      return 1;
    case ShapeKind::string:
    case ShapeKind::stiff_string:
    case ShapeKind::closed_mesh:
      return 3;
    default:
      return 2;
  }
}

// Returns an error message for the shape's size, or "".
std::string size_problem(const Shape& shape) {
  const bool is_mesh = has_width(shape.kind);
  const std::uint32_t least = least_size(shape.kind);
  if (shape.length < least || (is_mesh && shape.width < least)) {
    return "needs a size of at least " + std::to_string(least) +
           (is_mesh ? " by " + std::to_string(least) : "");
  }
  if (!is_mesh && shape.width != 0) {
    return "has one size, not two";
  }
  const std::uint64_t most = shape.as_macro ? max_macro_nodes : max_written_points;
  if (shape.length > most || shape.width > most || point_count(shape) > most) {
    return "may have at most " + std::to_string(most) + " points" +
           (shape.as_macro || !macro_of(shape.kind)
                ? ""
                : ", or " + std::to_string(max_macro_nodes) + " as a macro");
  }
  if (shape.kind == ShapeKind::corner_mesh && point_count(shape) == 4) {
    return "has only corners, which are fixed";
  }
  return "";
}

std::string number_problem(const Shape& shape) {
  if (!is_identifier(shape.name) || shape.name.size() > 32) {
    return "a name has at most 32 letters, digits and '_', and does not start with a digit";
  }
  if (!(shape.mass >= 1e-300) || !std::isfinite(shape.mass)) {
    return "a mass must be above 0";
  }
  for (const double number :
       {shape.stiffness, shape.second_stiffness, shape.damping, shape.air_damping}) {
    if (!(number >= 0.0) || !std::isfinite(number)) {
      return "a stiffness or damping must not be below 0";
    }
  }
  return std::isfinite(shape.position) ? "" : "a position must be a number";
}

}  // namespace

Result<Network> generate(const Shape& shape) {
  if (const std::string problem = number_problem(shape); !problem.empty()) {
    return Error{problem};
  }
  if (const std::string problem = size_problem(shape); !problem.empty()) {
    return Error{"this shape " + problem};
  }
  const auto macro = macro_of(shape.kind);
  if (shape.as_macro) {
    if (!macro) {
      return Error{"there is no macro for triangles and hexagons"};
    }
    if (shape.name == "in1" || shape.name == "out1") {
      return Error{"the name '" + shape.name + "' is reserved for a channel"};
    }
    return Builder(shape).macro(*macro);
  }
  const Layout layout = layout_of(shape);
  if (std::ranges::all_of(layout.points, &Point::is_fixed)) {
    return Error{"all points of this shape are fixed: choose a larger size"};
  }
  return Builder(shape).points(layout);
}

}  // namespace ressort::model
