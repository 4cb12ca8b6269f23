// tests: the reference simulator of a Network. Macros are expanded here from their published
// description, independently of the model room.
#pragma once

#include <span>
#include <vector>

#include "core/model/network.h"
#include "tests/support/networks/reference.h"
#include "tests/support/rooms.h"

namespace ressort::reference {

// A Network's simulator and the numbers that its parameters change.
struct Simulation {
  Simulator simulator;
  std::vector<Real*> arguments;  // [ArgumentId]

  void set_parameters(const Network& network, std::span<const double> values);
};

Simulation make_simulation(const Network& network, std::span<const double> parameters);

}  // namespace ressort::reference
