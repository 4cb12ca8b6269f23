#include "core/analysis/modes/known_shapes.h"

#include <algorithm>
#include <utility>

#include "core/ranges.h"

namespace ressort::analysis {
namespace {

using Complex = std::complex<double>;

// Returns the eigenvalue of a shape of length 1; empty if it is no eigenvector, up to rounding.
std::optional<double> eigenvalue_of(const SparseMatrix& matrix, const Vector& shape) {
  Vector rest = product(matrix, shape);
  const double value = dot(shape, rest);
  rest -= value * shape;
  const double most =
      shared_tolerance(shape.size()) * largest(Vector(matrix.value.data(), matrix.value.size()));
  return dot(rest, rest) <= most * most ? std::optional(value) : std::nullopt;
}

}  // namespace

std::vector<HeardMode> heard_modes(const NetworkModes& modes, std::span<const std::size_t> pushed) {
  std::vector<HeardMode> heard;
  heard.reserve(modes.modes.size());
  for (const NetworkMode& mode : modes.modes) {
    HeardMode& one = heard.emplace_back(
        HeardMode{.mu = mode.mu, .tone = {mode.frequency_hz, mode.t60_s}, .residues = {}});
    for (const std::size_t input : pushed) {
      Complex sum;
      for (std::size_t output = 0; output < modes.outputs; ++output) {
        sum += mode.residues[input * modes.outputs + output];
      }
      one.residues.push_back(sum / static_cast<double>(modes.outputs));
    }
  }
  return heard;
}

KnownShapes::KnownShapes(NetworkModes modes, std::vector<std::size_t> pushed, ModeOptions options)
    : options_(std::move(options)),
      basis_(std::move(modes.basis)),
      masses_(std::move(modes.system.masses)),
      pushed_(std::move(pushed)) {}

// Returns the excited inputs, then the mean of all outputs.
std::vector<ModalPort> KnownShapes::ports_of(const LinearSystem& system) const {
  auto ports = mapped(pushed_, [&](std::size_t input) { return system.inputs[input]; });
  ModalPort& heard = ports.emplace_back();
  const auto add = [&](ModalPort::Shares& to, const ModalPort::Shares& from) {
    for (const auto& [row, share] : from) {
      to.emplace_back(row, share / static_cast<double>(system.outputs.size()));
    }
  };
  for (const ModalPort& output : system.outputs) {
    add(heard.direct, output.direct);
    add(heard.stiff, output.stiff);
    add(heard.damped, output.damped);
  }
  return ports;
}

std::optional<std::vector<HeardMode>> KnownShapes::modes_of(const LinearSystem& system) const {
  if (system.masses != masses_) {
    return std::nullopt;
  }
  const std::vector<ModalPort> ports = ports_of(system);
  const SparseMatrix stiffness = system.stiffness();
  const SparseMatrix damping = system.damping();
  std::vector<HeardMode> modes;
  for (std::size_t i = 0; i < basis_.columns(); ++i) {
    const Vector shape = basis_.column(i);
    const auto k = eigenvalue_of(stiffness, shape);
    const auto z = k ? eigenvalue_of(damping, shape) : std::nullopt;
    if (!z) {
      return std::nullopt;
    }
    if (const auto mu = swing_root(*k, *z, scheme_e(options_.scheme), rigid_below(stiffness))) {
      const auto moved = [&](const ModalPort& port) {
        return along(port, shape, speed_of(*mu, options_.scheme));
      };
      HeardMode mode{.mu = *mu, .tone = tone_of(*mu, options_), .residues = {}};
      for (std::size_t input = 0; input + 1 < ports.size(); ++input) {
        mode.residues.push_back(moved(ports[input]) * moved(ports.back()) / mu->imag());
      }
      modes.push_back(std::move(mode));
    }
  }
  std::ranges::sort(modes, [](const HeardMode& a, const HeardMode& b) {
    return a.tone.frequency_hz < b.tone.frequency_hz;
  });
  return modes;
}

}  // namespace ressort::analysis
