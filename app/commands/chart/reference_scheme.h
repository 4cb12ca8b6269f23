// app/commands/chart: the published scheme in long double, link by link. It is the reference that
// kernels are compared with.
#pragma once

#include <span>
#include <vector>

#include "app/rooms.h"
#include "core/kernels/program.h"
#include "core/kernels/taps.h"

namespace ressort::commands {

// Steps one Program by symplectic Euler with the plain scheme of every law. The coefficients keep
// their values from the start. Audio parameters and waveguides are not supported.
// [any thread but audio]
class ReferenceScheme {
 public:
  explicit ReferenceScheme(const Program& program);

  // Computes one sample. `value`: [input] positions or forces; `velocity`: [input] change of the
  // positions since the last sample.
  void step(std::span<const double> value, std::span<const double> velocity);

  std::vector<double> outputs() const;  // [output slot]

 private:
  using Real = long double;
  template <class Use>
  void behind(std::uint32_t node, Use&& use) const;
  void push(std::uint32_t node, Real force);
  void move_masses();
  void move_places();
  void pull();

  const Program& program_;
  std::vector<Real> coefficient_;
  std::vector<Real> x_;  // [node]
  std::vector<Real> v_;
  std::vector<Real> force_;             // [node] of the links, for the next sample
  std::vector<Real> pushed_;            // [node] of the inputs, in this sample
  std::vector<Corners<Real>> corners_;  // [tap]
};

}  // namespace ressort::commands
