// What an engine knows of its voices' energy, and what it does about it: who makes energy of
// nothing is told, who has lost stability fades.
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/engine/voices.h"

namespace ressort {
namespace {

// So many updates are there for one look at each part of each voice. A look costs as much as some
// five to twenty steps.
constexpr std::size_t updates_per_look = 4096 / max_block_frames;

// What is added up in one update. Looking at a larger part takes several, and who makes energy
// there is not sought.
constexpr std::size_t most_elements = 16384;

// What energy may rise by and be rounding: a share of all its terms.
template <class T>
constexpr double rounding = sizeof(T) == sizeof(float) ? 1e-4 : 1e-6;

constexpr std::size_t most_looks = 1500;  // at a suspect, one in max_block_frames: two seconds

constexpr double least_energy = 1e-30;  // below this there is nothing to be told of

}  // namespace

void Engine::Voices::stir(std::size_t lane, std::size_t p) {
  Watch& here = watch(lane, p);
  here.is_stirred = true;
  if (here.is_still && !voices[lane].lost) {
    here.is_still = false;
    --still;
  }
}

void Engine::Voices::forget(Watch& here) {
  still -= here.is_still ? 1 : 0;
  here = Watch{};
}

template <class T>
void Engine::Voices::lay_still(const T* row, std::size_t width, std::size_t lane, std::size_t p) {
  Watch& here = watch(lane, p);
  still += here.is_still ? 0 : 1;
  here.is_still = true;
  double* const kept = held_of(lane, p);
  for (std::size_t output = 0; output < machine.parts[p].outputs.size(); ++output) {
    kept[output] = static_cast<double>(row[output * width + lane % width]);
  }
}

template void Engine::Voices::lay_still(const float*, std::size_t, std::size_t, std::size_t);
template void Engine::Voices::lay_still(const double*, std::size_t, std::size_t, std::size_t);

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
    const auto each = static_cast<double>(elements[p]);
    all += static_cast<double>(wanted) * each;
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      taken += steps(lane * elements.size() + p) ? each : 0.0;
    }
  }
  return all > 0.0 ? std::max(0.0, 1.0 - taken / all) : 0.0;
}

// --- energy -------------------------------------------------------------------------------------

bool Engine::Voices::steps(std::size_t at) const {
  return voices[at / elements.size()].awake && !watches[at].is_still;
}

void Engine::Voices::look_around() {
  if (watches.empty()) {
    return;
  }
  if (looking.at != none) {
    std::visit([&](auto& b) { go_on_looking(b); }, bank);
    return;
  }
  if (suspect != none && steps(suspect)) {
    look(suspect);
    looks_left -= looks_left > 0 ? 1 : 0;
  }
  suspect = looks_left > 0 ? suspect : none;
  looks_due += watches.size();
  for (std::size_t price = price_of(turn); looks_due >= price && looking.at == none;
       price = price_of(turn)) {
    looks_due -= price;
    if (steps(turn)) {
      look(turn);
    }
    turn = turn + 1 < watches.size() ? turn + 1 : 0;
  }
}

// Where one kernel steps many voices a step costs each of them less; a look does not.
std::size_t Engine::Voices::price_of(std::size_t at) const {
  const std::size_t p = at % elements.size();
  const std::size_t width = std::visit([&](const auto& b) { return b.parts[p].width; }, bank);
  return updates_per_look * std::clamp<std::size_t>(std::min(width, voices.size()) / 4, 1, 4);
}

void Engine::Voices::look(std::size_t at) {
  std::visit([&](auto& b) { begin_look(b, at); }, bank);
}

template <class T>
void Engine::Voices::begin_look(Bank<T>& b, std::size_t at) {
  const std::size_t lane = at / elements.size();
  const PartBank<T>& part = b.parts[at % elements.size()];
  const Kernel<T>& kernel = part.of(lane);
  if (!kernel.save(lane % part.width, b.x.data(), b.v.data())) {
    return;
  }
  looking = {
      .at = at, .done = 0, .was_stirred = watches[at].is_stirred, .updates = updates, .energy = {}};
  watches[at].is_stirred =
      kernel.coefficients.ramp_frames > 0 || !part.program.audio_coefficients.empty();
  go_on_looking(b);
}

template <class T>
void Engine::Voices::go_on_looking(Bank<T>& b) {
  const std::size_t lane = looking.at / elements.size();
  const std::size_t p = looking.at % elements.size();
  const PartBank<T>& part = b.parts[p];
  const LaneValues<T> values{part.of(lane).coefficients.value.data(), part.width,
                             lane % part.width};
  const std::size_t end = std::min(elements[p], looking.done + most_elements);
  add_energy(part.program, values, b.x.data(), b.v.data(), looking.done, end, looking.energy);
  looking.done = end;
  if (end == elements[p]) {
    judge(b, std::exchange(looking, Look{}));
  }
}

void Engine::Voices::enter(Watch& here, const Look& seen) {
  here.is_driven = seen.was_stirred || !here.is_metered;
  const auto frames = static_cast<double>((seen.updates - here.looked) * max_block_frames);
  here.loss = here.is_driven ? 0.0 : (here.energy - seen.energy.value) / frames;
  here.is_metered = true;
  here.energy = seen.energy.value;
  here.looked = seen.updates;
}

void Engine::Voices::read_energy() {
  const double unit = machine.rate_ratio * machine.rate_ratio;
  metered = EngineMeters{};
  for (std::size_t i = 0; i < watches.size(); ++i) {
    if (steps(i)) {
      const Watch& here = watches[i];
      metered.energy += here.energy / unit;
      metered.loss += here.loss / unit * machine.rate_hz;
      metered.is_driven |= here.is_driven;
      metered.is_whole &= here.is_metered;
    }
  }
}

template <class T>
void Engine::Voices::judge(Bank<T>& b, const Look& seen) {
  const std::size_t lane = seen.at / elements.size();
  const std::size_t p = seen.at % elements.size();
  PartBank<T>& part = b.parts[p];
  const LaneValues<T> values{part.of(lane).coefficients.value.data(), part.width,
                             lane % part.width};
  Watch& here = watches[seen.at];
  const Energy& energy = seen.energy;
  if (elements[p] > most_elements && here.is_stirred) {
    here.is_judged = false;  // since it was seen
    return;
  }
  if (!std::isfinite(energy.value)) {
    resets += voices[lane].lost ? 0 : 1;
    voices[lane].lost = has_lost = true;
    lay_still(part.last_of(lane), part.width, lane, p);
    part.of(lane).reset(lane % part.width);
    return;
  }
  const double slack = rounding<T> * energy.scale + least_energy;
  const bool is_free = here.is_judged && !seen.was_stirred;
  enter(here, seen);
  if (is_free && energy.value - energy.doubt > here.most + slack) {
    accuse(part.program, values, b, seen.at);
    here.is_judged = false;
  } else if (is_free && may_rest(b, lane, p, std::max(0.0, energy.value) + energy.doubt)) {
    lay_still(part.last_of(lane), part.width, lane, p);
  }
  const double most = energy.value + energy.doubt;
  here.most = is_free && here.is_judged ? std::min(here.most, most) : most;
  here.is_judged = !seen.was_stirred;
}

// Who it was is seen from near by: the first time the part is only looked at more often.
template <class T>
void Engine::Voices::accuse(const Program& program, LaneValues<T> values, const Bank<T>& b,
                            std::size_t at) {
  if (suspect != at) {
    if (suspect == none && creators.size() < max_creators && may_create(program) &&
        elements[at % elements.size()] <= most_elements) {
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
  if (playing.bare || !playing.rest_bounds[p] || voices[lane].fading) {
    return false;
  }
  const RestBound& bound = *playing.rest_bounds[p];
  const PartBank<T>& part = b.parts[p];
  const double most = 2.0 * energy / voices[lane].factor;
  for (const double compliance : bound.compliances) {
    if (!(playing.gain * std::sqrt(most * compliance) < silent_level)) {
      return false;
    }
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (!part.program.depending[i].empty() &&
        !(parameters[i] >= bound.box[i].lowest && parameters[i] <= bound.box[i].highest)) {
      return false;
    }
  }
  const LaneValues<T> values{part.of(lane).coefficients.value.data(), part.width,
                             lane % part.width};
  return rests_at_zero(part.program, values, b.x.data()) &&
         std::all_of(bound.reaches.begin(), bound.reaches.end(),
                     [&](const RestBound::Reach& reach) {
                       return distance_at_rest(part.program, values, b.x.data(), reach.link) >
                              std::sqrt(most * reach.compliance);
                     });
}

}  // namespace ressort
