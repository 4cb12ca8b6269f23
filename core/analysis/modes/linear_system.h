// core/analysis/modes: a network linearised at rest as matrices, for unit masses.
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/linear_algebra/matrix.h"
#include "core/model/network.h"

namespace ressort::analysis {

// The weights of an input or output on the rows. `stiff` weights apply to positions, `damped`
// weights to their change per step.
struct ModalPort {
  using Shares = std::vector<std::pair<std::uint32_t, double>>;  // Pairs of row and weight.
  Shares direct;
  Shares stiff;
  Shares damped;
};

// Returns the motion of a port in a shape, where `speed` is the ratio of the shape's change per
// step to the shape.
template <class Shape>
std::complex<double> along(const ModalPort& port, const Shape& shape, std::complex<double> speed) {
  const auto sum = [&](const ModalPort::Shares& shares) {
    std::complex<double> total;
    for (const auto& [row, share] : shares) {
      total += share * shape[row];
    }
    return total;
  };
  return sum(port.direct) + sum(port.stiff) + speed * sum(port.damped);
}

// A spring and damper between rows: its force is k d + z d', where d is the sum of share * row.
struct ModalSpring {
  std::uint32_t first = 0;  // First of LinearSystem::shares.
  std::uint32_t count = 0;
  std::uint32_t element = 0;  // Index into Network::links or Network::masses.
  bool is_link = true;
  double stiffness = 0.0;
  double damping = 0.0;
};

// Row i is a moving mass times the square root of its M. K and Z are per step.
struct LinearSystem {
  std::size_t size() const { return masses.size(); }
  std::span<const std::pair<std::uint32_t, double>> of(const ModalSpring& spring) const {
    return std::span(shares).subspan(spring.first, spring.count);
  }
  // Return K and Z with each of `springs` multiplied by its factor: [spring], empty for 1.
  SparseMatrix stiffness(std::span<const double> factors = {}) const;
  SparseMatrix damping(std::span<const double> factors = {}) const;

  std::vector<std::uint32_t> masses;  // [row] Index into Network::masses.
  std::vector<double> root;           // [row] Square root of M.
  std::vector<ModalSpring> springs;
  std::vector<std::pair<std::uint32_t, double>> shares;
  std::vector<ModalPort> inputs;   // [input of the network]
  std::vector<ModalPort> outputs;  // [output number] Outputs of equal number add up.
  // If false, bows, plucks and contacts were left open and springs linearised at rest.
  bool is_linear = true;
  bool is_sound = true;  // Every mass is above 0 and every number is finite.
};

// Returns the network with every argument evaluated for these parameters. Places stay.
Network evaluated(const Network& network, std::span<const double> parameters);

// Makes the system of a network without macros whose arguments are numbers, for steps of `step`
// samples at 44,100 Hz. Modes of bodies are those of the published scheme if `is_sampled`, else
// those of the continuous network. A key's factor scales every stiffness that is not fixed.
// O(masses + links). [any thread but audio]
LinearSystem make_linear_system(const Network& network, double step, bool is_sampled,
                                double key_factor = 1.0);

// Compute y = A x.
Vector product(const SparseMatrix& lower, const Vector& x);
void multiply(const SparseMatrix& lower, const double* x, double* y);

}  // namespace ressort::analysis
