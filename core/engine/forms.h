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
// A stiffness or damping in the eigenvectors: what one coefficient gives to each mode, for masses
// of 1. Links exert what they computed one tick before, with the coefficient of then; oscillators
// pull with the coefficient of now.
struct ModalShare {
  std::uint32_t coefficient = 0;
  bool is_late = false;
  std::vector<double> factor;  // [mode]
// A mass that is heard or touched: its position is rest + sum of shape * q.
struct ModalPlace {
  double rest = 0.0;
  std::vector<double> shape;  // [mode]
// Nonlinear links of one law. Their ends are places, numbered first, or Modes::ends.
struct ModalHold {
  std::uint32_t run = 0;  // of Program::link_runs: the law and its coefficients
  std::vector<std::uint32_t> a;
  std::vector<std::uint32_t> b;  // [link] ends
// An end that is no mass: it follows a position input, or stays.
struct ModalEnd {
  bool follows = false;
  std::uint32_t input = 0;
  double position = 0.0;
struct ModalOutput {
  std::uint32_t end = 0;  // as in ModalHold, if it is no mass
  bool is_place = false;  // else:
  ModalPlace place;
// A force that does not depend on the masses, spread by `shape` over the modes.
struct ModalPush {
  enum class By : std::uint8_t {
    force,     // an input's value
    hand,      // an input's position on springs: K (x - start) + Z v, of the tick before
    constant,  // a coefficient, of now
    late,      // a coefficient, of the tick before
  };
  By by = By::force;
  std::uint32_t input = 0;
  std::uint32_t stiffness = 0;  // coefficients; the constant's is the first
  double start = 0.0;
  std::vector<double> shape;  // [mode]
// The linear links and the masses in their common eigenvectors, everything else holds on to places
// of them; one voice. Exact, not truncated. With masses of 1/w times the relative mass of each,
//   d += w (push - sum of coefficient * factor * q - the same of damping * d);  q += d
struct Modes {
  static constexpr std::uint32_t own_mass = 0xffffffffu;
  std::uint32_t modes = 0;
  std::uint32_t inverse_mass = own_mass;  // the coefficient w, or 1
  double reach = 1.0;                     // no mass moves farther than reach * |q|
  std::vector<double> q;                  // [mode] at the start
  std::vector<double> d;
  std::vector<ModalShare> stiffness;
  std::vector<ModalShare> damping;
  std::vector<ModalPush> pushes;
  std::vector<ModalPlace> places;  // what nonlinear links hold
  std::vector<ModalEnd> ends;      // numbered on from the places
  std::vector<ModalHold> holds;
  std::vector<ModalOutput> outputs;  // [output]
using Form = std::variant<Direct, Modes>;

}  // namespace ressort
