// core/engine: strikes on masses and places that have no input.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/kernels/program.h"
#include "core/kernels/taps.h"

namespace ressort::engine {

class StruckNodes {
 public:
  static constexpr std::uint32_t nowhere = 0xffffffffu;

  // The position of a mass in the machine. `nowhere` if the mass is fixed or was culled.
  struct At {
    std::uint32_t part = nowhere;
    std::uint32_t node = 0;
  };

  // The machine must outlive this object. [any thread but audio]
  explicit StruckNodes(const Machine& machine) : machine_(machine) {
    std::size_t most = 1;
    for (std::uint32_t p = 0; p < machine.parts.size(); ++p) {
      const Program& program = machine.parts[p];
      std::vector<std::uint32_t>& inverse_mass = inverse_masses_.emplace_back(program.moving);
      for (const MassRun& run : program.mass_runs) {
        for (std::uint32_t node = run.first; node < run.first + run.count; ++node) {
          inverse_mass[node] = run.inverse_mass;
          note(program.masses[node], {p, node});
        }
      }
      for (const TapSlot& tap : program.taps) {
        note(program.masses[tap.node], {p, tap.node});
        most = std::max<std::size_t>({most, tap_corners, tap.is_on_body() ? tap.length : 0});
      }
    }
    nodes_.reserve(most);
    changes_.reserve(most);
  }

  // `mass`: index into the network with expanded macros.
  At find(double mass) const {
    return mass >= 0.0 && mass < static_cast<double>(at_.size())
               ? at_[static_cast<std::size_t>(mass)]
               : At{};
  }

  // Returns the changes of velocity that a force causes: of a mass, or of the nodes or body modes
  // that carry a place. coefficient(c) returns the voice's values. The result is valid until the
  // next call. [audio]
  struct Change {
    std::span<const std::uint32_t> nodes;
    std::span<const double> speeds;
  };
  template <class Coefficient>
  Change change(const At& at, double force, Coefficient&& coefficient) {
    const Program& program = machine_.parts[at.part];
    nodes_.clear();
    changes_.clear();
    const auto push = [&](std::uint32_t node, double weight) {
      if (node < program.moving) {
        nodes_.push_back(node);
        changes_.push_back(weight * force * coefficient(inverse_masses_[at.part][node]));
      }
    };
    if (at.node < program.moving) {
      push(at.node, 1.0);
    } else {
      const TapSlot& tap = program.taps[at.node - program.taps[0].node];
      each_behind(program, tap, corners_at(tap, coefficient(tap.u), coefficient(tap.v)), push);
    }
    return {nodes_, changes_};
  }

 private:
  void note(std::size_t mass, At at) {
    at_.resize(std::max(at_.size(), mass + 1));
    at_[mass] = at;
  }

  const Machine& machine_;
  std::vector<At> at_;                                      // [mass]
  std::vector<std::vector<std::uint32_t>> inverse_masses_;  // [part][node] coefficients
  std::vector<std::uint32_t> nodes_;
  std::vector<double> changes_;
};

}  // namespace ressort::engine
