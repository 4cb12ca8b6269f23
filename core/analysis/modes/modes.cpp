#include "core/analysis/modes/modes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "core/analysis/modes/lowest_swings.h"
#include "core/analysis/modes/quadratic.h"
#include "core/model/topology.h"

namespace ressort::analysis {
namespace {

using Complex = std::complex<double>;

// Rounding error, relative to the largest stiffness, and of a pole's angle relative to its decay.
constexpr double rounding = 1e-13;

// Returns how strongly a mode is excited and heard.
NetworkMode mode_of(Swing swing, const LinearSystem& system, const ModeOptions& options) {
  const ModeTone tone = tone_of(swing.mu, options);
  const Complex speed = speed_of(swing.mu, options.scheme);
  NetworkMode mode{.frequency_hz = tone.frequency_hz, .t60_s = tone.t60_s};
  std::vector<Complex> heard;
  for (const ModalPort& port : system.outputs) {
    heard.push_back(along(port, swing.shape, speed));
  }
  for (const ModalPort& port : system.inputs) {
    const Complex pushed = along(port, swing.shape, speed);
    for (const Complex& out : heard) {
      mode.residues.push_back(pushed * out / swing.mu.imag());
      mode.levels.push_back(std::abs(mode.residues.back()));
    }
  }
  mode.mu = swing.mu;
  mode.shape = std::move(swing.shape);
  return mode;
}

}  // namespace

double scheme_e(ModeScheme scheme) {
  return scheme == ModeScheme::published ? 1.0 : 0.0;
}

double scheme_step(const ModeOptions& options) {
  return options.scheme == ModeScheme::published ? Network::reference_rate_hz / options.rate_hz
                                                 : 1.0;
}

Complex pole_of(Complex mu, ModeScheme scheme) {
  return scheme == ModeScheme::continuous
             ? mu
             : Complex(0.5 * std::log1p(2.0 * mu.real() + std::norm(mu)),
                       std::atan2(mu.imag(), 1.0 + mu.real()));
}

ModeTone tone_of(Complex mu, const ModeOptions& options) {
  const Complex at = pole_of(mu, options.scheme);
  const double rate_hz = Network::reference_rate_hz / scheme_step(options);
  return {.frequency_hz = at.imag() * rate_hz / (2.0 * std::numbers::pi),
          .t60_s = std::fabs(at.real()) <= rounding * std::fabs(at.imag())
                       ? std::numeric_limits<double>::infinity()
                       : -3.0 * std::numbers::ln10 / (at.real() * rate_hz)};
}

Complex speed_of(Complex mu, ModeScheme scheme) {
  return mu / (1.0 + scheme_e(scheme) * mu);
}

double rigid_below(const SparseMatrix& stiffness) {
  double most = 0.0;
  for (const double value : stiffness.value) {
    most = std::max(most, rounding * std::fabs(value));
  }
  return most;
}

namespace {

Result<FoundSwings> find(const LinearSystem& system, const ModeOptions& options,
                         std::span<const double> stiffness_factors,
                         std::span<const double> damping_factors) {
  const double e = scheme_e(options.scheme);
  FoundSwings found{.swings = Swings(),
                    .stiffness = system.stiffness(stiffness_factors),
                    .damping = system.damping(damping_factors)};
  const double least = rigid_below(found.stiffness);
  const std::size_t size = system.size();
  if (size == 0 || least == 0.0) {
    return found;
  }
  std::size_t count = options.count;
  std::optional<Swings> swings;
  const bool is_small = size <= most_crossing_modes;
  if (is_small || (count == 0 && size <= most_listed_modes)) {
    options.progress.stage("finding the modes");
    swings = swings_of(dense(found.stiffness), dense(found.damping), e, least, is_small);
    if (!swings && is_small) {
      return Error{"the modes were not found: the iteration does not converge"};
    }
  }
  if (!swings) {
    count = std::min(count == 0 ? default_modes : count, size - 1);
    auto lowest = lowest_swings(found.stiffness, found.damping, e, least, count, options.progress);
    if (!lowest) {
      return lowest.error();
    }
    swings = *std::move(lowest);
    found.is_all = false;
  }
  const auto angle = [&](const Swing& swing) { return pole_of(swing.mu, options.scheme).imag(); };
  std::ranges::sort(swings->all, {}, angle);
  if (count > 0 && swings->all.size() > count) {
    swings->all.resize(count);
    found.is_all = false;
  }
  found.swings = *std::move(swings);
  return found;
}

}  // namespace

Result<FoundSwings> find_swings(const LinearSystem& system, const ModeOptions& options,
                                std::span<const double> stiffness_factors,
                                std::span<const double> damping_factors) {
  try {
    return find(system, options, stiffness_factors, damping_factors);
  } catch (const Stopped&) {
    return Error{stopped};
  }
}

Result<NetworkModes> find_modes(const Network& network, std::span<const double> parameters,
                                const ModeOptions& options) {
  NetworkModes made;
  made.network = evaluated(expand_macros(network), parameters);
  made.system = make_linear_system(made.network, scheme_step(options),
                                   options.scheme == ModeScheme::published, options.key_factor);
  made.key_factor = options.key_factor;
  made.inputs = network.inputs.size();
  made.outputs = made.system.outputs.size();
  made.scheme = options.scheme;
  made.rate_hz = options.rate_hz;
  if (!made.system.is_sound) {
    return Error{"a mass is not above 0, or a stiffness or damping is not finite"};
  }
  auto found = find_swings(made.system, options);
  if (!found) {
    return found.error();
  }
  made.is_all = found->is_all;
  made.is_proportional = found->swings.is_proportional;
  made.basis = std::move(found->swings.basis);
  for (Swing& swing : found->swings.all) {
    made.residual = std::max(
        made.residual, residual(found->stiffness, found->damping, scheme_e(options.scheme), swing));
    made.modes.push_back(mode_of(std::move(swing), made.system, options));
  }
  return made;
}

}  // namespace ressort::analysis
