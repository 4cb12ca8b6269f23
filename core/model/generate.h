// core/model: strings, meshes and other regular shapes, made mass by mass.
#pragma once

#include <cstdint>
#include <string>

#include "core/model/network.h"
#include "core/result.h"

namespace ressort::model {

enum class ShapeKind : std::uint8_t {
  string,        // a row whose two ends are fixed
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
  FixedPoints fixed = FixedPoints::corners;  // of triangles and hexagons; the rest tell by kind
  std::string name = "s";                    // letters, digits and '_'; before every label
  double mass = 1.0;                         // numbers as in Network, per sample at 44 100 Hz
  double stiffness = 0.1;
  double second_stiffness = 0.05;  // K2, stiff strings only
  double damping = 0.001;
  double air_damping = 0.0;  // above 0, every point that moves is an osc with this damping
  double position = 0.0;     // of every point, which rests there
  bool as_macro = false;     // one line; not for triangles and hexagons
  bool with_io = true;  // @in1, a force, and @out1, a position; and a ground to hold what has none
};

inline constexpr std::uint32_t max_written_points = 100'000;  // one by one, not as a macro

// The shape as a canonical network of masses NAME_m0... (meshes, triangles and hexagons
// NAME_m{row}_{number}), grounds, links NAME_r0... and parameters NAME_M, NAME_K, NAME_Z, and
// NAME_K2 and NAME_Zo where there are such. Fails on sizes and numbers that make no model.
// [any thread but audio]
Result<Network> generate(const Shape& shape);

}  // namespace ressort::model
