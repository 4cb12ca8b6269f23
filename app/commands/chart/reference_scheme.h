// app/commands/chart: the published scheme in long double, link by link. It is the reference that
// kernels are compared with. Also the energy stored in masses and links.
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

  std::vector<double> outputs() const;    // [output slot]
  std::vector<double> positions() const;  // [node]
  std::vector<double> velocities() const;

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

struct StoredEnergy {
  double total = 0.0;
  double held = 0.0;  // the part in contacts and plucks
};

// Returns the energy of a Program's masses and links at x, between two velocities, all [node]:
//   1/2 sum(M v_before v_after) + sum of every link's potential at x
// This product of successive velocities is the invariant of the Störmer-Verlet scheme for undamped
// springs. Bows and dampers store nothing.
StoredEnergy stored_energy(const Program& program, std::span<const double> x,
                           std::span<const double> v_before, std::span<const double> v_after);

}  // namespace ressort::commands
