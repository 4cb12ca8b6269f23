#include "core/engine/takeover.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/engine/energy.h"

namespace ressort::engine {

namespace {

// Returns whether the last velocity of every mass can be reconstructed. If a mass's own damper
// takes all of its velocity in one sample, or nearly all, that information is lost.
template <class T>
bool is_reversible(const Program& program, LaneValues<T> value) {
  constexpr double least_share = 1e-3;
  return std::all_of(program.mass_runs.begin(), program.mass_runs.end(), [&](const MassRun& run) {
    return !run.is_oscillator ||
           std::fabs(1.0 - value[run.inverse_mass] * value[run.damping]) > least_share;
  });
}

template <class T>
bool can_be_saved(const PartBank<T>& part, const Voices& voices, Bank<T>& scratch) {
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    const LaneValues<T> value{part.of(lane).coefficients.value.data(), part.width,
                              lane % part.width};
    if (voices[lane].awake && !is_reversible(part.program, value)) {
      return false;
    }
  }
  return part.of(0).save(0, scratch.x.data(), scratch.v.data());
}

// Sets a voice one sample before the state in bank.x and bank.v, by a backward step of the scheme.
// The next step, in which only the masses' own springs act, arrives at that state and then computes
// the forces of the links.
template <class T>
void set_one_sample_before(Bank<T>& bank, PartBank<T>& part, std::size_t lane) {
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
  kernel.disable_links(lane % part.width);
}

// Takes over the voices of one kernel.
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
    coefficients.copy_lane(lane % part.width, from.of(lane).coefficients, lane % from.width);
    for (std::size_t i = 0; i < program.inputs.size(); ++i) {
      const InputSlot& input = program.inputs[i];
      const std::size_t at = i * part.width + lane - group.first;
      bank.block->value[at] = input.is_force ? T(0) : static_cast<T>(bank.x[input.node]);
      bank.block->velocity[at] = input.is_force ? T(0) : static_cast<T>(bank.v[input.node]);
    }
    set_one_sample_before(bank, part, lane);
  }
  if (!any) {
    return;
  }
  T* audio = bank.block->audio.data();
  for (const std::uint32_t c : program.audio_coefficients) {
    audio = std::copy_n(coefficients.value.begin() + static_cast<std::ptrdiff_t>(c * part.width),
                        part.width, audio);
  }
  const std::size_t ramp_frames = std::exchange(coefficients.ramp_frames, 0);
  kernel.step({.frames = 1,
               .value = bank.block->value.data(),
               .velocity = bank.block->velocity.data(),
               .audio = bank.block->audio.data(),
               .outputs = bank.block->outputs.data()});
  std::copy_n(bank.block->outputs.data(), part.row(), part.last_of(group.first));
  const std::size_t first = group.first / part.width * part.row();
  std::copy_n(bank.block->outputs.data(), part.row(), part.before.data() + first);
  for (std::size_t lane = group.first; lane < group.end; ++lane) {
    for (std::size_t output = 0; output < program.outputs.size(); ++output) {
      part.slope[first + output * part.width + lane - group.first] =
          from.slope[lane / from.width * from.row() + output * from.width + lane % from.width];
    }
  }
  coefficients.ramp_frames = ramp_frames;
}

// Returns whether coefficients have the same meaning in both banks. The coefficients of body modes
// differ between continuous and sampled forms.
template <class T>
bool have_same_units(const Bank<T>& bank, const Bank<T>& from) {
  for (std::size_t i = 0; i < bank.parts.size(); ++i) {
    const Program& to = bank.parts[i].program;
    if (!to.modes.empty() &&
        to.form.is_continuous() != from.parts[i].program.form.is_continuous()) {
      return false;
    }
  }
  return true;
}

}  // namespace

template <class T>
bool can_take_over(Bank<T>& bank, const Bank<T>& from, const Voices& voices) {
  return have_same_units(bank, from) &&
         std::all_of(from.parts.begin(), from.parts.end(),
                     [&](const PartBank<T>& part) { return can_be_saved(part, voices, bank); });
}

template <class T>
void take_over(Bank<T>& bank, const Bank<T>& from, const Voices& voices) {
  bank.held->filled_part = nullptr;
  bank.held->zero_velocities = 0;
  bank.each_group([&](PartBank<T>& part, const VoiceGroup& group) {
    take_over(bank, part, from.parts[group.part], group, voices);
  });
}

template bool can_take_over(Bank<float>&, const Bank<float>&, const Voices&);
template bool can_take_over(Bank<double>&, const Bank<double>&, const Voices&);
template void take_over(Bank<float>&, const Bank<float>&, const Voices&);
template void take_over(Bank<double>&, const Bank<double>&, const Voices&);

}  // namespace ressort::engine
