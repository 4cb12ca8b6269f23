// core/model: generates strings, meshes and other regular shapes.
#pragma once

#include <cstdint>
#include <string>

#include "core/model/network.h"
#include "core/result.h"

namespace ressort::model {

enum class ShapeKind : std::uint8_t {
  string,        // a row with fixed ends
  stiff_string,  // the same, with K2 between every second point, clamped at both ends
  chain,         // a row without fixed ends
  mesh,          // a rectangle, neighbours linked along both sides
  closed_mesh,   // with its border fixed
  corner_mesh,   // with its corners fixed
  triangle,      // rows of n, n - 1 ... 1 points: n(n+1)/2 points, 3n(n-1)/2 links
  hexagon,       // a centre and n rings of 6j points: 1 + 3n(n+1) points, 9n^2 + 3n links
};

enum class FixedPoints : std::uint8_t { none, corners, border };

struct Shape {
  ShapeKind kind = ShapeKind::string;
  std::uint32_t length = 0;  // points, fixed ones included; of a side, or a hexagon's rings
  std::uint32_t width = 0;   // points, meshes only
  FixedPoints fixed = FixedPoints::corners;  // triangles and hexagons only
  std::string name = "s";                    // letters, digits and '_'; prefix of every label
  double mass = 1.0;                         // numbers as in Network, per sample at 44 100 Hz
  double stiffness = 0.1;
  double second_stiffness = 0.05;  // K2, stiff strings only
  double damping = 0.001;
  double air_damping = 0.0;  // if above 0, every moving point is an osc with this damping
  double position = 0.0;     // position of every point, at rest
  bool as_macro = false;     // write one line; not for triangles and hexagons
  bool with_io = true;       // add @in1 (force), @out1 (position), and a ground if there is none
};

inline constexpr std::uint32_t max_written_points = 100'000;  // without a macro

// Returns the shape as a canonical network: masses NAME_m0... (NAME_m{row}_{number} in meshes,
// triangles and hexagons), grounds, links NAME_r0..., and the parameters NAME_M, NAME_K, NAME_Z,
// and, if needed, NAME_K2 and NAME_Zo. Fails for invalid sizes and numbers. [any thread but audio]
Result<Network> generate(const Shape& shape);

}  // namespace ressort::model
