// app/commands: from a solid to a body that can be struck.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "app/commands/body/mesher.h"
#include "core/solids/solid_modes.h"

namespace ressort::commands {

// A place as a person picks it, in the file's own unit.
struct PickedPlace {
  std::string name;
  Point3 point{};
  std::optional<Point3> direction;  // without one, the surface's normal
};

struct SolidBodyOptions {
  std::string input;
  std::string output;  // a file; empty for stdout
  bool force = false;  // write over files that are there
  bool is_quiet = false;
  std::string material;                           // "steel"
  std::optional<double> young;                    // Pa, instead of the material's
  std::optional<double> poisson;                  // the same
  std::optional<double> density;                  // kg/m^3
  double scale = 1.0;                             // metres per unit of the file
  int modes = 40;                                 // how many
  std::vector<PickedPlace> places;                // without any, four that lie far from each other
  std::optional<double> loss;                     // loss factor, instead of the material's
  std::optional<std::array<double, 2>> rayleigh;  // a in 1/s, b in s; instead of any loss factor
  std::vector<SolidClamp> clamps;                 // in the file's own unit
  MeshOrder mesh;
  std::string picture;  // an SVG of the lowest shapes; empty: none
};

// Whether a file is one of solids, by its ending.
bool names_solid(const std::string& file);

// Reads the solid, fills it, finds its modes and writes them as a model; says on stderr how far it
// is, and on stdout what came out. The exit code. [main]
int solid_body(const SolidBodyOptions& options);

// "NAME=X,Y,Z" or "NAME=X,Y,Z,DX,DY,DZ"; "X,Y,Z,R". The error says what was expected.
Result<PickedPlace> parse_place(const std::string& text);
Result<SolidClamp> parse_clamp(const std::string& text);

// Which materials there are, a row each under a head: name, E, nu, rho, eta.
std::vector<std::vector<std::string>> material_table();

}  // namespace ressort::commands
