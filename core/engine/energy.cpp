#include "core/engine/energy.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/laws/laws.h"

namespace ressort::engine {
namespace {

template <class T>
LawNumbers numbers_of(const LinkRun& run, LaneValues<T> coefficients) {
  LawNumbers numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    numbers[i] = coefficients[run.coefficients[i]];
  }
  return numbers;
}

void add(Energy& energy, double value) {
  energy.value += value;
  energy.scale += std::fabs(value);
}

// A range of nodes or links.
struct Share {
  std::size_t first = 0;
  std::size_t end = 0;
};

template <class Run, class Use>
void each_of(const Run& run, Share share, Use&& use) {
  const std::size_t end = std::min<std::size_t>(run.first + run.count, share.end);
  for (std::size_t i = std::max<std::size_t>(run.first, share.first); i < end; ++i) {
    use(i);
  }
}

template <class T>
void add_masses(const MassRun& run, Share share, LaneValues<T> c, const double* x, const double* v,
                Energy& energy) {
  const double m = 1.0 / c[run.inverse_mass];
  const double k = run.is_oscillator ? c[run.stiffness] : 0.0;
  const double z = run.is_oscillator ? c[run.damping] : 0.0;
  const double g = run.has_gravity ? c[run.gravity] : 0.0;
  each_of(run, share, [&](std::size_t i) {
    add(energy, (0.5 * m - 0.25 * z) * v[i] * v[i]);
    if (run.is_oscillator) {
      add(energy, 0.5 * k * x[i] * (x[i] - v[i]));
    }
    if (run.has_gravity) {
      add(energy, g * (x[i] - 0.5 * v[i]));
    }
  });
}

// Adds the energy of a linear spring with elongation d, which was d - v one sample before.
void add_linear(double k, double z, double d, double v, Energy& energy) {
  add(energy, 0.5 * k * d * (d - v));
  add(energy, -0.25 * z * v * v);
}

template <class ForceLaw>
void add_discrete_gradient(const ForceLaw& law, double d, double v, Energy& energy) {
  const double before = d - v;
  if constexpr (ForceLaw::facts.contains_spring && ForceLaw::facts.is_curved) {
    add_linear(law.k, law.z, d, v, energy);
    add(energy, 0.5 * (law.curved(d) + law.curved(before)));
  } else {
    add(energy, 0.5 * (law.potential(d) + law.potential(before)));
  }
}

// Adds the energy of a nonlinear law in the plain scheme. k is the stiffness of its linear part,
// which does not contribute to the uncertainty.
template <class ForceLaw>
void add_nonlinear(const ForceLaw& law, double k, double d, double v, Energy& energy) {
  constexpr const LawFacts& facts = ForceLaw::facts;
  const double before = d - v;
  const double now = law.force(d, 0.0);
  const double change = now - law.force(before, 0.0);
  const double here = law.potential(d);
  const double there = law.potential(before);
  const double damped = 0.25 * (law.force(d, v) - now) * v;
  add(energy, 0.5 * (here + there) - 0.25 * change * v);
  add(energy, -damped);
  // At the corner of a piecewise linear law the energy jumps. With a curved law it varies by at
  // most a share of the energy in the curved part. A damper that acts only in contact adds its own
  // term.
  if constexpr (facts.is_curved) {
    energy.uncertainty += 0.5 * std::fabs(here - 0.5 * k * d * d) +
                          0.5 * std::fabs(there - 0.5 * k * before * before) +
                          0.25 * std::fabs((change - k * v) * v);
  } else {
    energy.uncertainty += std::fabs((now - 0.5 * change) * v - (here - there));
  }
  energy.uncertainty += facts.contains_spring ? 0.0 : std::fabs(damped);
}

template <class T>
void add_links(const Program& program, const LinkRun& run, Share share, LaneValues<T> coefficients,
               const double* x, const double* v, Energy& energy) {
  const LawNumbers c = numbers_of(run, coefficients);
  const auto each = [&](auto&& use) {
    each_of(run, share, [&](std::size_t i) {
      const auto [a, b] = program.ends[i];
      use(x[a] - x[b], v[a] - v[b]);
    });
  };
  if (is_linear(run.law)) {
    each([&](double d, double speed) { add_linear(c[0], c[1], d, speed, energy); });
    return;
  }
  with_law<double>(
      run.law, [&](std::size_t i) { return c[i]; },
      [&]<class ForceLaw>(const ForceLaw& law) {
        constexpr const LawFacts& facts = ForceLaw::facts;
        const double k = facts.is_spring() ? c[facts.slot(Role::stiffness)] : 0.0;
        each([&](double d, double speed) {
          if (run.scheme == Scheme::discrete_gradient) {
            add_discrete_gradient(law, d, speed, energy);
          } else {
            add_nonlinear(law, k, d, speed, energy);
          }
        });
      });
}

}  // namespace

template <class T>
Energy energy_of(const Program& program, LaneValues<T> coefficients, const double* x,
                 const double* v) {
  Energy energy;
  add_energy(program, coefficients, x, v, 0, program.position.size() + program.ends.size(), energy);
  return energy;
}

template <class T>
void add_energy(const Program& program, LaneValues<T> coefficients, const double* x,
                const double* v, std::size_t first, std::size_t end, Energy& energy) {
  const std::size_t nodes = program.position.size();
  const Share masses{first, std::min(end, nodes)};
  const Share links{std::max(first, nodes) - nodes, std::max(end, nodes) - nodes};
  for (const MassRun& run : program.mass_runs) {
    add_masses(run, masses, coefficients, x, v, energy);
  }
  for (const LinkRun& run : program.link_runs) {
    add_links(program, run, links, coefficients, x, v, energy);
  }
}

template <class T>
bool rests_at_zero(const Program& program, LaneValues<T> coefficients, const double* x) {
  for (const MassRun& run : program.mass_runs) {
    if (run.has_gravity && coefficients[run.gravity] != 0.0) {
      return false;
    }
  }
  const std::uint32_t points = program.taps.empty()
                                   ? static_cast<std::uint32_t>(program.position.size())
                                   : program.taps[0].node;
  const auto is_off = [&](std::uint32_t node) {
    return node >= program.moving && node < points && x[node] != 0.0;
  };
  for (const LinkRun& run : program.link_runs) {
    const auto first = program.ends.begin() + run.first;
    if (facts_of(run.law).is_spring() &&
        std::any_of(first, first + run.count,
                    [&](const Ends& ends) { return is_off(ends.a) || is_off(ends.b); })) {
      return false;
    }
  }
  return true;
}

template <class T>
double gap_at_rest(const Program& program, LaneValues<T> coefficients, const double* x,
                   std::uint32_t link) {
  const auto run = std::find_if(
      program.link_runs.begin(), program.link_runs.end(),
      [&](const LinkRun& candidate) { return link - candidate.first < candidate.count; });
  const std::uint32_t points = program.taps.empty()
                                   ? static_cast<std::uint32_t>(program.position.size())
                                   : program.taps[0].node;
  const auto rest = [&](std::uint32_t node) {
    return node >= program.moving && node < points ? x[node] : 0.0;
  };
  const auto [a, b] = program.ends[link];
  return facts_of(run->law).gap(numbers_of(*run, coefficients), rest(a) - rest(b));
}

template Energy energy_of(const Program&, LaneValues<float>, const double*, const double*);
template Energy energy_of(const Program&, LaneValues<double>, const double*, const double*);
template void add_energy(const Program&, LaneValues<float>, const double*, const double*,
                         std::size_t, std::size_t, Energy&);
template void add_energy(const Program&, LaneValues<double>, const double*, const double*,
                         std::size_t, std::size_t, Energy&);
template bool rests_at_zero(const Program&, LaneValues<float>, const double*);
template bool rests_at_zero(const Program&, LaneValues<double>, const double*);
template double gap_at_rest(const Program&, LaneValues<float>, const double*, std::uint32_t);
template double gap_at_rest(const Program&, LaneValues<double>, const double*, std::uint32_t);
}  // namespace ressort::engine
