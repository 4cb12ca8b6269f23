#include "core/engine/energy_watch.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace ressort::engine {
namespace {

constexpr double silent_level = 1e-6;  // -120 dBFS: nothing that stands still was louder

// So many updates are there for one look at each part of each voice. A look costs as much as some
// five to twenty steps.
constexpr std::size_t updates_per_look = 4096 / max_block_frames;

constexpr std::size_t updates_per_reading = 16;  // of the energy: 20 ms or so

// What is added up in one update. Looking at a larger part takes several, and who makes energy
// there is not sought.
constexpr std::size_t most_elements = 16384;

// What energy may rise by and be rounding: a share of all its terms.
template <class T>
constexpr double rounding = sizeof(T) == sizeof(float) ? 1e-4 : 1e-6;

constexpr double least_energy = 1e-30;  // below this there is nothing to be told of

template <class T>
LaneValues<T> values_of(const PartBank<T>& part, std::size_t lane) {
  return {part.of(lane).coefficients.value.data(), part.width, lane % part.width};
}

}  // namespace

EnergyWatch::EnergyWatch(const Machine& machine, const Playing& playing, std::size_t lanes)
    : machine_(machine), playing_(playing), first_output_(1), parts_(lanes * machine.parts.size()) {
  for (const Program& program : machine.parts) {
    elements_.push_back(program.position.size() + program.ends.size());
    first_output_.push_back(first_output_.back() + program.outputs.size());
  }
  held_.resize(lanes * first_output_.back());
}

void EnergyWatch::go_on_from(const EnergyWatch& from) {
  parts_ = from.parts_;
  for (Part& here : parts_) {
    here.is_judged = false;
  }
  held_ = from.held_;
  still_count_ = from.still_count_;
  updates_ = from.updates_;
  read_ = from.read_;
  looking_ = Look{};
}

// --- what stands still --------------------------------------------------------------------------

bool EnergyWatch::steps(std::size_t at, const Voices& voices) const {
  return voices[at / elements_.size()].awake && !parts_[at].is_still;
}

void EnergyWatch::forget(std::size_t lane, std::size_t p) {
  Part& here = part_of(lane, p);
  still_count_ -= here.is_still ? 1 : 0;
  here = Part{};
}

void EnergyWatch::forget(std::size_t lane) {
  for (std::size_t p = 0; p < elements_.size(); ++p) {
    forget(lane, p);
  }
}

template <class T>
void EnergyWatch::lay_still(const T* row, std::size_t width, std::size_t lane, std::size_t p) {
  Part& here = part_of(lane, p);
  still_count_ += here.is_still ? 0 : 1;
  here.is_still = true;
  double* const held = held_.data() + lane * first_output_.back() + first_output_[p];
  for (std::size_t output = 0; output < machine_.parts[p].outputs.size(); ++output) {
    held[output] = static_cast<double>(row[output * width + lane % width]);
  }
}

template <class T>
void EnergyWatch::lose(PartBank<T>& part, const T* row, std::size_t lane, std::size_t p,
                       Voices& voices) {
  voices.lose(voices[lane]);
  lay_still(row, part.width, lane, p);
  part.of(lane).reset(lane % part.width);  // nothing is to be slow for numbers that are none
}

// --- energy -------------------------------------------------------------------------------------

template <class T>
void EnergyWatch::look_around(Bank<T>& bank, Voices& voices, std::span<const double> parameters) {
  ++updates_;
  if (parts_.empty()) {
    return;
  }
  if (looking_.at != none) {
    go_on_looking(bank, voices, parameters);
    return;
  }
  looks_due_ += parts_.size();
  for (std::size_t price = price_of(turn_part_, bank); looks_due_ >= price && looking_.at == none;
       price = price_of(turn_part_, bank)) {
    looks_due_ -= price;
    if (steps(turn_, voices)) {
      look(turn_, bank, voices, parameters);
    }
    turn_ = turn_ + 1 < parts_.size() ? turn_ + 1 : 0;
    turn_part_ = turn_part_ + 1 < elements_.size() ? turn_part_ + 1 : 0;
  }
}

// Where one kernel steps many voices a step costs each of them less; a look does not.
template <class T>
std::size_t EnergyWatch::price_of(std::size_t p, const Bank<T>& bank) const {
  const std::size_t together = std::min(bank.parts[p].width, bank.voices);
  return updates_per_look * std::clamp<std::size_t>(together / 4, 1, 4);
}

template <class T>
void EnergyWatch::look(std::size_t at, Bank<T>& bank, Voices& voices,
                       std::span<const double> parameters) {
  const std::size_t lane = at / elements_.size();
  const PartBank<T>& part = bank.parts[at % elements_.size()];
  const Kernel<T>& kernel = part.of(lane);
  if (!kernel.save(lane % part.width, bank.x.data(), bank.v.data())) {
    return;
  }
  looking_ = {
      .at = at, .done = 0, .was_stirred = parts_[at].is_stirred, .updates = updates_, .energy = {}};
  parts_[at].is_stirred =
      kernel.coefficients.ramp_frames > 0 || !part.program.audio_coefficients.empty();
  go_on_looking(bank, voices, parameters);
}

template <class T>
void EnergyWatch::go_on_looking(Bank<T>& bank, Voices& voices, std::span<const double> parameters) {
  const std::size_t lane = looking_.at / elements_.size();
  const std::size_t p = looking_.at % elements_.size();
  const PartBank<T>& part = bank.parts[p];
  const std::size_t end = std::min(elements_[p], looking_.done + most_elements);
  add_energy(part.program, values_of(part, lane), bank.x.data(), bank.v.data(), looking_.done, end,
             looking_.energy);
  looking_.done = end;
  if (end == elements_[p]) {
    judge(std::exchange(looking_, Look{}), bank, voices, parameters);
  }
}

void EnergyWatch::read_energy(const Voices& voices) {
  if (!voices.is_idle() && updates_ % updates_per_reading != 0) {
    return;
  }
  const double unit = machine_.rate_ratio * machine_.rate_ratio;
  read_ = EngineMeters{};
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    if (steps(i, voices)) {
      const Part& here = parts_[i];
      read_.energy += here.energy / unit;
      read_.loss += here.loss / unit * machine_.rate_hz;
      read_.is_driven |= here.is_driven;
      read_.is_whole &= here.is_metered;
    }
  }
}

EngineMeters EnergyWatch::meters(const Voices& voices) const {
  EngineMeters meters = read_;
  const auto wanted = static_cast<double>(std::max(1, playing_.voices));
  double all = 0.0;
  double taken = 0.0;
  for (std::size_t p = 0; p < elements_.size(); ++p) {
    const auto each = static_cast<double>(elements_[p]);
    all += wanted * each;
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      taken += steps(lane * elements_.size() + p, voices) ? each : 0.0;
    }
  }
  meters.saved = all > 0.0 ? std::max(0.0, 1.0 - taken / all) : 0.0;
  return meters;
}

template <class T>
void EnergyWatch::judge(const Look& seen, Bank<T>& bank, Voices& voices,
                        std::span<const double> parameters) {
  const std::size_t lane = seen.at / elements_.size();
  const std::size_t p = seen.at % elements_.size();
  PartBank<T>& part = bank.parts[p];
  const LaneValues<T> values = values_of(part, lane);
  Part& here = parts_[seen.at];
  const Energy& energy = seen.energy;
  if (elements_[p] > most_elements && here.is_stirred) {
    here.is_judged = false;  // since it was seen
    return;
  }
  if (!std::isfinite(energy.value)) {
    lose<T>(part, part.last_of(lane), lane, p, voices);
    return;
  }
  const double slack = rounding<T> * energy.scale + least_energy;
  const bool is_free = here.is_judged && !seen.was_stirred;
  const auto frames = static_cast<double>((seen.updates - here.looked) * max_block_frames);
  here.is_driven = seen.was_stirred || !here.is_metered;
  here.loss = here.is_driven ? 0.0 : (here.energy - energy.value) / frames;
  here.is_metered = true;
  here.energy = energy.value;
  here.looked = seen.updates;
  if (is_free && energy.value - energy.doubt > here.most + slack) {
    here.is_judged = false;
  } else if (is_free && may_rest(p, values, bank, std::max(0.0, energy.value) + energy.doubt,
                                 voices[lane], parameters)) {
    lay_still(part.last_of(lane), part.width, lane, p);
  }
  const double most = energy.value + energy.doubt;
  here.most = is_free && here.is_judged ? std::min(here.most, most) : most;
  here.is_judged = !seen.was_stirred;
}

// Nothing that this energy can do is heard, nor does it bring anything within reach.
template <class T>
bool EnergyWatch::may_rest(std::size_t p, LaneValues<T> values, const Bank<T>& bank, double energy,
                           const Voice& voice, std::span<const double> parameters) const {
  if (playing_.bare || !playing_.rest_bounds[p] || voice.fading) {
    return false;
  }
  const RestBound& bound = *playing_.rest_bounds[p];
  const Program& program = machine_.parts[p];
  const double most = 2.0 * energy / voice.factor;
  const double gain = playing_.gain_of_loudest_key();
  for (const double compliance : bound.compliances) {
    if (!(gain * std::sqrt(most * compliance) < silent_level)) {
      return false;
    }
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (!program.depending[i].empty() &&
        !(parameters[i] >= bound.box[i].lowest && parameters[i] <= bound.box[i].highest)) {
      return false;
    }
  }
  return rests_at_zero(program, values, bank.x.data()) &&
         std::all_of(bound.reaches.begin(), bound.reaches.end(),
                     [&](const RestBound::Reach& reach) {
                       return distance_at_rest(program, values, bank.x.data(), reach.link) >
                              std::sqrt(most * reach.compliance);
                     });
}

template void EnergyWatch::lose(PartBank<float>&, const float*, std::size_t, std::size_t, Voices&);
template void EnergyWatch::lose(PartBank<double>&, const double*, std::size_t, std::size_t,
                                Voices&);
template void EnergyWatch::look_around(Bank<float>&, Voices&, std::span<const double>);
template void EnergyWatch::look_around(Bank<double>&, Voices&, std::span<const double>);

}  // namespace ressort::engine
