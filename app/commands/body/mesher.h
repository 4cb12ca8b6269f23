// app/commands: fills a surface with tetrahedra. Runs gmsh or tetgen, or meshes boxes and balls
// itself.
#pragma once

#include <string>

#include "app/rooms.h"
#include "core/progress.h"
#include "core/result.h"
#include "core/solids/solid_mesh.h"

namespace ressort::commands {

enum class Mesher {
  automatic,  // boxes and balls by ressort, then gmsh, tetgen and the grid, until one succeeds
  own,        // boxes, balls, and a grid for anything else
  gmsh,       // remeshes the surface
  tetgen,     // refines the surface of the file
};

struct MeshOrder {
  Mesher mesher = Mesher::automatic;
  double unknowns = 40000.0;  // approximate number; three per node
  double limit_s = 60.0;      // a program is stopped after this time
};

struct Meshed {
  TetrahedronMesh mesh;
  std::string by;        // "gmsh"
  std::string failures;  // messages of the programs before it, a line each
};

// Meshes the solid. Errors say what to install, or contain the last messages of the mesher.
// `should_continue` is called a few times a second with the present work; if it returns false, the
// mesher is ended and the error is `stopped`.
Result<Meshed> fill_with_tetrahedra(const ClosedSurface& closed, const MeshOrder& order,
                                    const Progress::Callback& should_continue);

}  // namespace ressort::commands
