// core/engine: the forms in which a Program may be computed, each the tables of one kernel beside
// the Program's own. Pure data, made by the compile room, shared by all voices.
#pragma once

#include <cstdint>
#include <variant>
#include <vector>

namespace ressort {

// As it is written, mass by mass and link by link; one voice in each lane. Every Program.
struct Direct {};

// Equal masses in a row, each tied to the next by the same spring.
struct Chain {
  static constexpr std::uint32_t free = 0xffffffffu;

  std::uint32_t first = 0;  // of its masses in Chains::nodes, from one end to the other
  std::uint32_t count = 0;
  std::uint32_t mass_run = 0;   // of the Program, that all of them are in
  std::uint32_t stiffness = 0;  // coefficients of the springs
  std::uint32_t damping = 0;
  std::uint32_t left = free;   // the ground or position input that holds the first mass by the
  std::uint32_t right = free;  // same spring, and the last; or free
};

// Chains folded into the lanes of packs, one voice; everything else number by number.
struct Chains {
  std::vector<Chain> chains;
  std::vector<std::uint32_t> nodes;  // chain by chain
  std::vector<std::uint32_t> loose;  // nodes that move and are in no chain, ascending
  std::vector<std::uint32_t> links;  // those that are no chain's springs, ascending
};

using Form = std::variant<Direct, Chains>;
// A small body for one voice: between contacts a whole block of samples is one product of a dense
// matrix with the state. The matrices depend on a voice's coefficients: they are the kernel's own.
struct DenseSpring {
  std::uint32_t a = 0;  // nodes
  std::uint32_t b = 0;
  std::uint32_t stiffness = 0;  // coefficients
struct DensePort {
  std::uint32_t run = 0;   // of Program::link_runs
  std::uint32_t link = 0;  // of Program::ends
struct Dense {
  std::vector<DenseSpring> springs;  // every linear link that moves a mass
  std::vector<DensePort> ports;      // every other link that moves a mass
  bool has_constant = false;         // gravity, or a spring to what stands elsewhere than at 0
using Form = std::variant<Direct, Dense>;

}  // namespace ressort
