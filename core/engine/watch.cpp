// What an engine knows of its voices' energy, and what it does about it: who makes energy of
// nothing is told, who has lost stability fades.
#include <algorithm>
#include <cmath>

#include "core/engine/voices.h"

namespace ressort {
namespace {

// So many samples are stepped for one look. A look costs as much as some five to twenty steps.
constexpr double samples_per_look = 4096.0;

// What energy may rise by and be rounding: a share of all its terms.
template <class T>
constexpr double rounding = sizeof(T) == sizeof(float) ? 1e-4 : 1e-6;

constexpr std::size_t most_looks = 1500;  // at a suspect, one in max_block_frames: two seconds

constexpr double least_energy = 1e-30;  // below this there is nothing to be told of

}  // namespace

void Engine::Voices::stir(std::size_t lane, std::size_t p) {
  Watch& here = watch(lane, p);
  here.is_stirred = true;
  here.is_still = here.is_still && voices[lane].lost;
}

// --- what stands still --------------------------------------------------------------------------

void Engine::Voices::mix_held(std::size_t p, std::size_t lane, std::span<double* const> outputs,
                              std::size_t at, std::size_t from, std::size_t frames) {
  const auto& slots = machine.parts[p].outputs;
  const double* const kept = held_of(lane, p);
  double faded = voices[lane].gain;
  for (std::size_t n = 0; n < frames; ++n) {
    faded = voices[lane].next_gain(faded);
    for (std::size_t output = 0; n >= from && output < slots.size(); ++output) {
      outputs[slots[output].channel][at + n] += playing.gain * faded * kept[output];
    }
  }
}

void Engine::Voices::mix_still(std::size_t p, std::size_t first, std::size_t width,
                               std::span<double* const> outputs, std::size_t at,
                               std::size_t frames) {
  for (std::size_t lane = first; lane < std::min(voices.size(), first + width); ++lane) {
    const double* const kept = held_of(lane, p);
    if (voices[lane].awake && watch(lane, p).is_still &&
        std::any_of(kept, kept + machine.parts[p].outputs.size(),
                    [](double y) { return y != 0.0; })) {
      mix_held(p, lane, outputs, at, 0, frames);
    }
  }
}

void Engine::Voices::fade_lost() {
  has_lost = false;
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    if (voices[lane].lost && !voices[lane].fading) {
      fade(lane, steal_fade_s);
    }
  }
}

double Engine::Voices::saved() const {
  const auto wanted = static_cast<std::size_t>(std::max(1, playing.voices));
  double all = 0.0;
  double taken = 0.0;
  for (std::size_t p = 0; p < elements.size(); ++p) {
    all += static_cast<double>(wanted) * elements[p];
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      const bool steps = voices[lane].awake && !watches[lane * elements.size() + p].is_still;
      taken += steps ? elements[p] : 0.0;
    }
  }
  return all > 0.0 ? std::max(0.0, 1.0 - taken / all) : 0.0;
}

// --- energy -------------------------------------------------------------------------------------

void Engine::Voices::look_around() {
  double now = 0.0;
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    for (std::size_t p = 0; voices[lane].awake && p < elements.size(); ++p) {
      now += watch(lane, p).is_still ? 0.0 : elements[p] * max_block_frames;
    }
  }
  if (now == 0.0) {
    return;
  }
  stepped += now;
  const auto steps = [&](std::size_t i) {
    return voices[i / elements.size()].awake && !watches[i].is_still;
  };
  if (suspect != none && steps(suspect)) {
    std::visit([&](auto& b) { look(b, suspect); }, bank);
    looks_left -= looks_left > 0 ? 1 : 0;
  }
  suspect = looks_left > 0 ? suspect : none;
  for (std::size_t i = 0; i < watches.size(); ++i) {
    if (steps(turn)) {
      const double price = elements[turn % elements.size()] * samples_per_look;
      if (stepped < price) {
        return;
      }
      stepped -= price;
      std::visit([&](auto& b) { look(b, turn); }, bank);
    }
    turn = turn + 1 < watches.size() ? turn + 1 : 0;
  }
  stepped = 0.0;  // all were looked at
}

template <class T>
void Engine::Voices::look(Bank<T>& b, std::size_t at) {
  const std::size_t lane = at / elements.size();
  const std::size_t p = at % elements.size();
  PartBank<T>& part = b.parts[p];
  const Kernel<T>& kernel = part.of(lane);
  Watch& here = watches[at];
  if (!kernel.save(lane % part.width, b.x.data(), b.v.data())) {
    return;
  }
  const LaneValues<T> values{kernel.coefficients.value.data() + lane % part.width, part.width};
  const Energy energy = energy_of(part.program, values, b.x.data(), b.v.data());
  if (!std::isfinite(energy.value)) {
    resets += voices[lane].lost ? 0 : 1;
    voices[lane].lost = here.is_still = has_lost = true;
    part.of(lane).reset(lane % part.width);
    return;
  }
  const double slack = rounding<T> * energy.scale + least_energy;
  here.energy = energy.value;
  if (here.is_judged && !here.is_stirred && energy.value - energy.doubt > here.most + slack) {
    accuse(part.program, values, b, at);
    here.is_judged = false;
  }
  if (here.is_judged && !here.is_stirred &&
      may_rest(b, lane, p, std::max(0.0, energy.value) + energy.doubt)) {
    here.is_still = true;
  }
  const double most = energy.value + energy.doubt;
  here.most = here.is_judged && !here.is_stirred ? std::min(here.most, most) : most;
  here.is_judged = !here.is_stirred;
  here.is_stirred = false;
}

// Who it was is seen from near by: the first time the part is only looked at more often.
template <class T>
void Engine::Voices::accuse(const Program& program, LaneValues<T> values, const Bank<T>& b,
                            std::size_t at) {
  if (suspect != at) {
    if (suspect == none && creators.size() < max_creators && may_create(program)) {
      suspect = at;
      looks_left = most_looks;
    }
    return;
  }
  suspect = none;
  const std::uint32_t link =
      likely_creator(program, values, b.x.data(), b.v.data(), 2.0 * max_block_frames);
  if (link != no_link &&
      std::find(creators.begin(), creators.end(), program.origins[link]) == creators.end()) {
    creators.push_back(program.origins[link]);
  }
}

// Nothing that this energy can do is heard, nor does it bring anything within reach.
template <class T>
bool Engine::Voices::may_rest(const Bank<T>& b, std::size_t lane, std::size_t p,
                              double energy) const {
  if (playing.bare || p >= playing.repose.size() || voices[lane].fading) {
    return false;
  }
  const Repose& repose = playing.repose[p];
  const PartBank<T>& part = b.parts[p];
  const double most = 2.0 * energy / voices[lane].factor;
  for (const double compliance : repose.compliances) {
    if (!(playing.gain * std::sqrt(most * compliance) < silent_level)) {
      return false;
    }
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (!part.program.depending[i].empty() &&
        !(parameters[i] >= repose.lowest[i] && parameters[i] <= repose.highest[i])) {
      return false;
    }
  }
  const LaneValues<T> values{part.of(lane).coefficients.value.data() + lane % part.width,
                             part.width};
  return !repose.compliances.empty() && rests_at_zero(part.program, values, b.x.data()) &&
         std::all_of(repose.reaches.begin(), repose.reaches.end(), [&](const Repose::Reach& reach) {
           return distance_at_rest(part.program, values, b.x.data(), reach.link) >
                  std::sqrt(most * reach.compliance);
         });
}

}  // namespace ressort
