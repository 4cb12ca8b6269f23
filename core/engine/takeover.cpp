// One engine goes on where another of the same model is: with other kernels, in the same sample.
#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "core/engine/energy.h"
#include "core/engine/voices.h"

namespace ressort {

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

}  // namespace

// A sample before where b.x and b.v are: from there, with nothing that pulls but the mass's own
// spring, it gets there, and then its links have pulled.
template <class T>
void Engine::Voices::place_before(Bank<T>& b, PartBank<T>& part, std::size_t lane) const {
  const Program& program = part.program;
  Kernel<T>& kernel = part.of(lane);
  const auto coefficient = [&](std::uint32_t c) {
    return static_cast<double>(kernel.coefficients.value[c * part.width + lane % part.width]);
  };
  for (std::size_t node = 0; node < program.position.size(); ++node) {
    b.x[node] -= b.v[node];
  }
  for (const MassRun& run : program.mass_runs) {
    const double w = coefficient(run.inverse_mass);
    const double k = run.is_oscillator ? coefficient(run.stiffness) : 0.0;
    const double z = run.is_oscillator ? coefficient(run.damping) : 0.0;
    const double g = run.has_gravity ? coefficient(run.gravity) : 0.0;
    for (std::uint32_t node = run.first; node < run.first + run.count; ++node) {
      b.v[node] = (b.v[node] + w * (k * b.x[node] + g)) / (1.0 - w * z);
    }
  }
  kernel.set_state(lane % part.width, b.x.data(), b.v.data());
}

// The voices of one kernel.
template <class T>
void Engine::Voices::go_on(Bank<T>& b, PartBank<T>& part, const PartBank<T>& from,
                           std::size_t first) {
  const Program& program = part.program;
  Kernel<T>& kernel = part.of(first);
  Coefficients<T>& coefficients = kernel.coefficients;
  for (std::size_t lane = first; lane < std::min(voices.size(), first + part.width); ++lane) {
    if (!voices[lane].awake) {
      continue;
    }
    from.of(lane).save(lane % from.width, b.x.data(), b.v.data());
    coefficients.go_on(lane % part.width, from.of(lane).coefficients, lane % from.width);
    for (std::size_t i = 0; i < program.inputs.size(); ++i) {
      const InputSlot& input = program.inputs[i];
      const std::size_t at = i * part.width + lane - first;
      b.value[at] = input.is_force ? T(0) : static_cast<T>(b.x[input.node]);
      b.velocity[at] = input.is_force ? T(0) : static_cast<T>(b.v[input.node]);
    }
    place_before(b, part, lane);
  }
  T* audio = b.audio.data();
  for (const std::uint32_t c : program.audio_coefficients) {
    audio = std::copy_n(coefficients.value.begin() + static_cast<std::ptrdiff_t>(c * part.width),
                        part.width, audio);
  }
  const std::size_t ramp_frames = std::exchange(coefficients.ramp_frames, 0);
  kernel.step({.frames = 1,
               .value = b.value.data(),
               .velocity = b.velocity.data(),
               .audio = b.audio.data(),
               .outputs = b.outputs.data()});
  std::copy_n(b.outputs.data(), part.row(), part.last_of(first));
  coefficients.ramp_frames = ramp_frames;
}

template <class T>
void Engine::Voices::go_on(Bank<T>& b, const Bank<T>& from) {
  b.filled_part = nullptr;
  b.still = 0;
  for (std::size_t p = 0; p < b.parts.size(); ++p) {
    PartBank<T>& part = b.parts[p];
    for (std::size_t first = 0; first < voices.size(); first += part.width) {
      const auto begin = voices.begin() + static_cast<std::ptrdiff_t>(first);
      const auto end =
          voices.begin() + static_cast<std::ptrdiff_t>(std::min(voices.size(), first + part.width));
      if (std::any_of(begin, end, [](const Voice& voice) { return voice.awake; })) {
        go_on(b, part, from.parts[p], first);
      }
    }
  }
}

template <class T>
bool Engine::Voices::can_be_left(Bank<T>& scratch, const PartBank<T>& part) const {
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    const LaneValues<T> value{part.of(lane).coefficients.value.data(), part.width,
                              lane % part.width};
    if (voices[lane].awake && !tells_its_velocity(part.program, value)) {
      return false;
    }
  }
  return part.of(0).save(0, scratch.x.data(), scratch.v.data());
}

bool Engine::Voices::go_on_from(const Voices& from) {
  return std::visit(
      [&](auto& b) {
        using Same = std::remove_reference_t<decltype(b)>;
        const auto* const other = std::get_if<Same>(&from.bank);
        if (other == nullptr ||
            !std::all_of(other->parts.begin(), other->parts.end(),
                         [&](const auto& part) { return from.can_be_left(b, part); })) {
          return false;
        }
        static_cast<Playback&>(*this) = from;
        is_idle = false;
        looking = Look{};
        for (Watch& here : watches) {
          here.is_judged = false;
        }
        go_on(b, *other);
        return true;
      },
      bank);
}

bool Engine::go_on_from(const Engine& from) {
  return voices_->go_on_from(*from.voices_);
}

}  // namespace ressort
