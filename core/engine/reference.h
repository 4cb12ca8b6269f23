// core/engine: the published scheme once more, slow and in the widest numbers that the machine has:
// what "identical" means where kernels are judged. And the energy of what they play.
#pragma once

#include <span>
#include <vector>

#include "core/kernels/program.h"
#include "core/kernels/taps.h"

namespace ressort::engine {

// Steps one Program, link by link, by the plain scheme of every law, with the coefficients as they
// are at the start. Without parameters that audio turns
// and without waveguides. [any thread but audio]
class ReferenceScheme {
 public:
  explicit ReferenceScheme(const Program& program);

  // One sample. [input] positions or forces, and what the positions changed by.
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
  std::vector<Real> force_;             // by the links, for the next sample
  std::vector<Real> pushed_;            // by the inputs, in this one
  std::vector<Corners<Real>> corners_;  // [tap]
};

struct StoredEnergy {
  double total = 0.0;
  double held = 0.0;  // that part of it which is in contacts and plucks
};

// What a Program's masses and links hold while they are at x, between two velocities, [node]:
//   1/2 sum of M v_before v_after, and every link's potential at x
// For springs without damping this does not change by as much as a bit of rounding. Bows and
// dampers hold nothing.
StoredEnergy energy_of(const Program& program, std::span<const double> x,
                       std::span<const double> v_before, std::span<const double> v_after);

}  // namespace ressort::engine
