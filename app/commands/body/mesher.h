// app/commands: fills a surface with tetrahedra by a program that does that for a living, started
// as a process of its own, or by ourselves where the solid is a box or a ball.
#pragma once

#include <functional>
#include <string>

#include "app/rooms.h"
#include "core/result.h"
#include "core/solids/solid_mesh.h"

namespace ressort::commands {

enum class Mesher {
  automatic,  // what fits of the others, the first first
  own,        // boxes and balls alone
  gmsh,       // makes the surface anew, as fine as it is to be
  tetgen,     // keeps the surface and makes it finer where needed
};

struct MeshOrder {
  Mesher mesher = Mesher::automatic;
  double unknowns = 40000.0;  // about so many; three a node
  double limit_s = 300.0;     // a program that takes longer is ended
};

struct Meshed {
  TetrahedronMesh mesh;
  std::string by;  // "gmsh"
};

// The error says what to install, or what the program said. Ends the program and fails with
// `stopped` where `goes_on`, which is asked some times a second, says no.
Result<Meshed> fill_with_tetrahedra(const ClosedSurface& closed, const MeshOrder& order,
                                    const std::function<bool()>& goes_on);

}  // namespace ressort::commands
