// app/commands: converts a solid to a modal body.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "app/commands/body/mesher.h"
#include "core/solids/solid_modes.h"

namespace ressort::commands {

inline constexpr std::size_t max_solid_bytes = std::size_t{256} << 20;

// A place on the surface, in the unit of the file.
struct PickedPlace {
  std::string name;
  Point3 point{};
  std::optional<Point3> direction;  // empty: the surface normal
};

struct SolidBodyOptions {
  std::string input;
  std::string output;  // empty: stdout
  bool force = false;  // overwrites existing files
  bool is_quiet = false;
  std::string material;                           // "steel"
  std::optional<double> young;                    // Pa; overrides the material
  std::optional<double> poisson;                  // overrides the material
  std::optional<double> density;                  // kg/m^3
  double scale = 1.0;                             // metres per unit of the file
  double thickness_mm = 0.0;                      // above 0: the surface is a shell
  int modes = 40;                                 // number of modes
  std::vector<PickedPlace> places;                // empty: four places far from each other
  std::optional<double> loss;                     // loss factor; overrides the material
  std::optional<std::array<double, 2>> rayleigh;  // a in 1/s, b in s; overrides the loss factor
  std::vector<SolidClamp> clamps;                 // clamped regions, in the unit of the file
  MeshOrder mesh;
  std::string picture;  // .svg of the lowest mode shapes; empty: none
};

// Reads and meshes the solid, computes its modes and writes them as a model. Prints progress to
// stderr and a summary to stdout. Returns the exit code. [main]
int solid_body(const SolidBodyOptions& options);

// Parse "NAME=X,Y,Z" or "NAME=X,Y,Z,DX,DY,DZ", and "X,Y,Z,R".
Result<PickedPlace> parse_place(const std::string& text);
Result<SolidClamp> parse_clamp(const std::string& text);

// Returns all materials: a header row, then name, E, nu, rho and eta of each.
std::vector<std::vector<std::string>> material_table();

}  // namespace ressort::commands
