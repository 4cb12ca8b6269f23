#include "core/engine/takeover.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "core/engine/energy.h"
#include "core/engine/engine.h"

namespace ressort::engine {

namespace {

// A mass whose own damper takes all of its velocity in one sample does not tell what it was: from
// there nobody gets a sample back, and not with any figures from close by.
template <class T>
bool tells_its_velocity(const Program& program, LaneValues<T> value) {
  constexpr double least_share = 1e-3;
  return std::all_of(program.mass_runs.begin(), program.mass_runs.end(), [&](const MassRun& run) {
    return !run.is_oscillator ||
           std::fabs(1.0 - value[run.inverse_mass] * value[run.damping]) > least_share;
  });
}

template <class T>
bool can_be_left(const PartBank<T>& part, const Voices& voices, Bank<T>& scratch) {
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    const LaneValues<T> value{part.of(lane).coefficients.value.data(), part.width,
                              lane % part.width};
    if (voices[lane].awake && !tells_its_velocity(part.program, value)) {
      return false;
    }
  }
  return part.of(0).save(0, scratch.x.data(), scratch.v.data());
}

// A sample before where bank.x and bank.v are: from there, with nothing that pulls but the mass's
// own spring, it gets there, and then its links have pulled.
template <class T>
void place_before(Bank<T>& bank, PartBank<T>& part, std::size_t lane) {
  const Program& program = part.program;
  Kernel<T>& kernel = part.of(lane);
  const auto coefficient = [&](std::uint32_t c) {
    return static_cast<double>(kernel.coefficients.value[c * part.width + lane % part.width]);
  };
  for (std::size_t node = 0; node < program.position.size(); ++node) {
    bank.x[node] -= bank.v[node];
  }
  for (const MassRun& run : program.mass_runs) {
    const double w = coefficient(run.inverse_mass);
    const double k = run.is_oscillator ? coefficient(run.stiffness) : 0.0;
    const double z = run.is_oscillator ? coefficient(run.damping) : 0.0;
    const double g = run.has_gravity ? coefficient(run.gravity) : 0.0;
    for (std::uint32_t node = run.first; node < run.first + run.count; ++node) {
      bank.v[node] = (bank.v[node] + w * (k * bank.x[node] + g)) / (1.0 - w * z);
    }
  }
  kernel.set_state(lane % part.width, bank.x.data(), bank.v.data());
  kernel.let_go(lane % part.width);
}

// The voices of one kernel.
template <class T>
void take_over(Bank<T>& bank, PartBank<T>& part, const PartBank<T>& from, const VoiceGroup& group,
               const Voices& voices) {
  const Program& program = part.program;
  Kernel<T>& kernel = part.of(group.first);
  Coefficients<T>& coefficients = kernel.coefficients;
  bool any = false;
  for (std::size_t lane = group.first; lane < group.end; ++lane) {
    if (!voices[lane].awake) {
      continue;
    }
    any = true;
    from.of(lane).save(lane % from.width, bank.x.data(), bank.v.data());
    coefficients.go_on(lane % part.width, from.of(lane).coefficients, lane % from.width);
    for (std::size_t i = 0; i < program.inputs.size(); ++i) {
      const InputSlot& input = program.inputs[i];
      const std::size_t at = i * part.width + lane - group.first;
      bank.value[at] = input.is_force ? T(0) : static_cast<T>(bank.x[input.node]);
      bank.velocity[at] = input.is_force ? T(0) : static_cast<T>(bank.v[input.node]);
    }
    place_before(bank, part, lane);
  }
  if (!any) {
    return;
  }
  T* audio = bank.audio.data();
  for (const std::uint32_t c : program.audio_coefficients) {
    audio = std::copy_n(coefficients.value.begin() + static_cast<std::ptrdiff_t>(c * part.width),
                        part.width, audio);
  }
  const std::size_t ramp_frames = std::exchange(coefficients.ramp_frames, 0);
  kernel.step({.frames = 1,
               .value = bank.value.data(),
               .velocity = bank.velocity.data(),
               .audio = bank.audio.data(),
               .outputs = bank.outputs.data()});
  std::copy_n(bank.outputs.data(), part.row(), part.last_of(group.first));
  coefficients.ramp_frames = ramp_frames;
}

// Coefficients mean the same to both: those of bodies' modes are other numbers where one form is
// true to the continuous network and one is not.
template <class T>
bool share_numbers(const Bank<T>& bank, const Bank<T>& from) {
  for (std::size_t i = 0; i < bank.parts.size(); ++i) {
    const Program& to = bank.parts[i].program;
    if (!to.modes.empty() &&
        to.form.is_continuous() != from.parts[i].program.form.is_continuous()) {
      return false;
    }
  }
  return true;
}

// Whether both lists are as long, and each pair in them is the same by what `of` takes of it.
template <class List, class Of>
bool same(const List& a, const List& b, Of&& of) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [&](const auto& x, const auto& y) { return of(x) == of(y); });
}

bool is_alike(const Program& a, const Program& b) {
  return a.moving == b.moving && a.position == b.position && a.tap_nodes == b.tap_nodes &&
         a.shapes == b.shapes && a.audio_coefficients == b.audio_coefficients &&
         same(a.mass_runs, b.mass_runs,
              [](const MassRun& run) {
                return std::tuple(run.first, run.count, run.inverse_mass, run.stiffness,
                                  run.damping, run.gravity, run.is_oscillator, run.has_gravity,
                                  run.is_junction);
              }) &&
         same(a.link_runs, b.link_runs,
              [](const LinkRun& run) {
                return std::tuple(run.law, run.scheme, run.first, run.count, run.coefficients);
              }) &&
         same(a.ends, b.ends, [](const Ends& ends) { return std::tuple(ends.a, ends.b); }) &&
         same(a.inputs, b.inputs,
              [](const InputSlot& input) {
                return std::tuple(input.input, input.is_force, input.node);
              }) &&
         same(a.taps, b.taps,
              [](const TapSlot& tap) {
                return std::tuple(tap.node, tap.first, tap.length, tap.width, tap.u, tap.v,
                                  tap.places, tap.shape);
              }) &&
         same(a.modes, b.modes,
              [](const SampledCoefficients& mode) {
                return std::tuple(mode.inverse_mass, mode.stiffness, mode.damping);
              }) &&
         same(a.waveguides, b.waveguides,
              [](const WaveguideSlot& guide) {
                return std::tuple(guide.is_open, guide.inverse_impedance, guide.frequency,
                                  guide.t60, guide.brightness, guide.first, guide.count);
              }) &&
         same(a.junctions, b.junctions,
              [](const JunctionSlot& place) { return std::tuple(place.node, place.u); }) &&
         same(a.outputs, b.outputs,
              [](const OutputSlot& output) {
                return std::tuple(output.channel, output.node, output.is_force);
              }) &&
         same(a.audio_parameters, b.audio_parameters,
              [](const AudioParameter& audio) {
                return std::tuple(audio.parameter, audio.channel);
              }) &&
         same(a.coefficients, b.coefficients,
              [](const Coefficient& c) { return std::tuple(c.unit, c.is_fixed, c.mode); });
}

// Which way a number has gone: 1 to where a network is less stable (stiffer, more damped, lighter),
// -1 from there, 0 where neither.
int way(const Program& a, const Program& b, std::uint32_t c) {
  switch (a.coefficients[c].unit) {
    case Unit::stiffness:
    case Unit::damping:
    case Unit::friction:
    case Unit::inverse_mass:
    case Unit::inverse_impedance: {
      const double before = coefficient_value(a, a.coefficients[c], a.parameters, 1.0);
      const double after = coefficient_value(b, b.coefficients[c], b.parameters, 1.0);
      return before < after ? 1 : before > after ? -1 : 0;
    }
    case Unit::plain:
    case Unit::speed:
    case Unit::frequency:
    case Unit::gravity:
    case Unit::gravity_per_rate:
      return 0;
  }
  return 0;
}

// Whether all numbers go one way, so that what is between is no less stable than one of the ends;
// places on macros, of which nobody knows that, stay.
bool go_one_way(const Machine& a, const Machine& b) {
  bool any_up = false;
  bool any_down = false;
  for (std::size_t p = 0; p < a.parts.size(); ++p) {
    const Program& from = a.parts[p];
    const Program& to = b.parts[p];
    for (std::uint32_t c = 0; c < from.coefficients.size(); ++c) {
      const int here = way(from, to, c);
      any_up = any_up || here > 0;
      any_down = any_down || here < 0;
    }
    const auto moves = [&](std::uint32_t c) {
      return coefficient_value(from, from.coefficients[c], from.parameters, 1.0) !=
             coefficient_value(to, to.coefficients[c], to.parameters, 1.0);
    };
    if (std::any_of(from.taps.begin(), from.taps.end(),
                    [&](const TapSlot& tap) { return moves(tap.u) || moves(tap.v); }) ||
        std::any_of(from.junctions.begin(), from.junctions.end(),
                    [&](const JunctionSlot& place) { return moves(place.u); })) {
      return false;
    }
  }
  return !(any_up && any_down);
}

bool is_alike(const Machine& a, const Machine& b) {
  return a.rate_hz == b.rate_hz && a.rate_ratio == b.rate_ratio && a.channels == b.channels &&
         a.parameters.size() == b.parameters.size() &&
         same(a.inputs, b.inputs,
              [](const ModelInput& input) {
                return std::tuple(input.number, input.is_force, input.position);
              }) &&
         std::equal(a.parts.begin(), a.parts.end(), b.parts.begin(), b.parts.end(),
                    [](const Program& x, const Program& y) { return is_alike(x, y); });
}

}  // namespace

bool can_renumber(const Machine& from, const Machine& to) {
  return is_alike(from, to) && go_one_way(from, to);
}

template <class T>
bool take_over(Bank<T>& bank, const Bank<T>& from, const Voices& voices) {
  if (!share_numbers(bank, from) ||
      !std::all_of(from.parts.begin(), from.parts.end(),
                   [&](const PartBank<T>& part) { return can_be_left(part, voices, bank); })) {
    return false;
  }
  bank.filled_part = nullptr;
  bank.still = 0;
  bank.each_group([&](PartBank<T>& part, const VoiceGroup& group) {
    take_over(bank, part, from.parts[group.part], group, voices);
  });
  return true;
}

template bool take_over(Bank<float>&, const Bank<float>&, const Voices&);
template bool take_over(Bank<double>&, const Bank<double>&, const Voices&);

}  // namespace ressort::engine
