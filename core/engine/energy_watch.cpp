#include "core/engine/energy_watch.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace ressort::engine {
namespace {

constexpr double silent_level = 1e-6;  // -120 dBFS: the greatest level of a frozen part

// Each part of each voice is inspected once in this many updates. An inspection costs as much as
// five to twenty steps.
constexpr std::size_t updates_per_inspection = 4096 / max_block_frames;

constexpr std::size_t updates_per_reading = 16;  // about 20 ms

// Elements added up in one update. A larger part takes several updates, and its energy bound is
// dropped if it was driven meanwhile.
constexpr std::size_t most_elements = 16384;

// Share of the sum of all terms' magnitudes by which rounding may raise the energy.
template <class T>
constexpr double rounding = sizeof(T) == sizeof(float) ? 1e-4 : 1e-6;

constexpr double least_energy = 1e-30;

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
  frozen_outputs_.resize(lanes * first_output_.back());
}

void EnergyWatch::continue_from(const EnergyWatch& from) {
  parts_ = from.parts_;
  for (Part& part : parts_) {
    part.is_bounded = false;
  }
  frozen_outputs_ = from.frozen_outputs_;
  frozen_count_ = from.frozen_count_;
  updates_ = from.updates_;
  reading_ = from.reading_;
  inspection_ = Inspection{};
}

// --- frozen parts -------------------------------------------------------------------------------

bool EnergyWatch::is_stepped(std::size_t at, const Voices& voices) const {
  return voices[at / elements_.size()].awake && !parts_[at].is_frozen;
}

void EnergyWatch::reset(std::size_t lane, std::size_t p) {
  Part& part = part_of(lane, p);
  frozen_count_ -= part.is_frozen ? 1 : 0;
  part = Part{};
}

void EnergyWatch::reset(std::size_t lane) {
  for (std::size_t p = 0; p < elements_.size(); ++p) {
    reset(lane, p);
  }
}

template <class T>
void EnergyWatch::freeze(const T* row, std::size_t width, std::size_t lane, std::size_t p) {
  Part& part = part_of(lane, p);
  frozen_count_ += part.is_frozen ? 0 : 1;
  part.is_frozen = true;
  double* const outputs = frozen_outputs_.data() + lane * first_output_.back() + first_output_[p];
  for (std::size_t output = 0; output < machine_.parts[p].outputs.size(); ++output) {
    outputs[output] = static_cast<double>(row[output * width + lane % width]);
  }
}

template <class T>
void EnergyWatch::freeze_unstable(PartBank<T>& part, const T* row, std::size_t lane, std::size_t p,
                                  Voices& voices) {
  voices.mark_unstable(voices[lane]);
  freeze(row, part.width, lane, p);
  part.restart_slopes(lane);
  part.of(lane).reset(lane % part.width);  // NaN and infinity would slow down the other lanes
}

// --- inspections --------------------------------------------------------------------------------

template <class T>
void EnergyWatch::inspect_next(Bank<T>& bank, Voices& voices, std::span<const double> parameters) {
  ++updates_;
  if (parts_.empty()) {
    return;
  }
  if (inspection_.at != none) {
    continue_inspection(bank, voices, parameters);
    return;
  }
  credit_ += parts_.size();
  for (std::size_t price = price_of(turn_part_, bank); credit_ >= price && inspection_.at == none;
       price = price_of(turn_part_, bank)) {
    credit_ -= price;
    if (is_stepped(turn_, voices)) {
      start_inspection(turn_, bank, voices, parameters);
    }
    turn_ = turn_ + 1 < parts_.size() ? turn_ + 1 : 0;
    turn_part_ = turn_part_ + 1 < elements_.size() ? turn_part_ + 1 : 0;
  }
}

// Returns the price of one inspection. A kernel that steps many voices together makes a step
// cheaper for each voice, but not an inspection.
template <class T>
std::size_t EnergyWatch::price_of(std::size_t p, const Bank<T>& bank) const {
  const std::size_t together = std::min(bank.parts[p].width, bank.voices);
  return updates_per_inspection * std::clamp<std::size_t>(together / 4, 1, 4);
}

template <class T>
void EnergyWatch::start_inspection(std::size_t at, Bank<T>& bank, Voices& voices,
                                   std::span<const double> parameters) {
  const std::size_t lane = at / elements_.size();
  const PartBank<T>& part = bank.parts[at % elements_.size()];
  const Kernel<T>& kernel = part.of(lane);
  if (!kernel.save(lane % part.width, bank.x.data(), bank.v.data())) {
    return;
  }
  inspection_ = {
      .at = at, .done = 0, .was_driven = parts_[at].is_driven, .updates = updates_, .energy = {}};
  parts_[at].is_driven =
      kernel.coefficients.ramp_frames > 0 || !part.program.audio_coefficients.empty();
  continue_inspection(bank, voices, parameters);
}

template <class T>
void EnergyWatch::continue_inspection(Bank<T>& bank, Voices& voices,
                                      std::span<const double> parameters) {
  const std::size_t lane = inspection_.at / elements_.size();
  const std::size_t p = inspection_.at % elements_.size();
  const PartBank<T>& part = bank.parts[p];
  const std::size_t end = std::min(elements_[p], inspection_.done + most_elements);
  add_energy(part.program, values_of(part, lane), bank.x.data(), bank.v.data(), inspection_.done,
             end, inspection_.energy);
  inspection_.done = end;
  if (end == elements_[p]) {
    evaluate(std::exchange(inspection_, Inspection{}), bank, voices, parameters);
  }
}

void EnergyWatch::update_reading(const Voices& voices) {
  if (!voices.is_idle() && updates_ % updates_per_reading != 0) {
    return;
  }
  const double unit = machine_.rate_ratio * machine_.rate_ratio;
  reading_ = EngineMeters{};
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    if (is_stepped(i, voices)) {
      const Part& part = parts_[i];
      reading_.energy += part.energy / unit;
      reading_.loss += part.loss / unit * machine_.rate_hz;
      reading_.is_driven |= part.was_driven;
      reading_.is_whole &= part.is_metered;
    }
  }
}

EngineMeters EnergyWatch::meters(const Voices& voices) const {
  EngineMeters meters = reading_;
  const auto wanted = static_cast<double>(std::max(1, playing_.voices));
  double all = 0.0;
  double taken = 0.0;
  for (std::size_t p = 0; p < elements_.size(); ++p) {
    const auto each = static_cast<double>(elements_[p]);
    all += wanted * each;
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      taken += is_stepped(lane * elements_.size() + p, voices) ? each : 0.0;
    }
  }
  meters.saved = all > 0.0 ? std::max(0.0, 1.0 - taken / all) : 0.0;
  return meters;
}

template <class T>
void EnergyWatch::evaluate(const Inspection& seen, Bank<T>& bank, Voices& voices,
                           std::span<const double> parameters) {
  const std::size_t lane = seen.at / elements_.size();
  const std::size_t p = seen.at % elements_.size();
  PartBank<T>& part = bank.parts[p];
  const LaneValues<T> values = values_of(part, lane);
  Part& state = parts_[seen.at];
  const Energy& energy = seen.energy;
  if (elements_[p] > most_elements && state.is_driven) {
    state.is_bounded = false;  // driven since the snapshot
    return;
  }
  if (!std::isfinite(energy.value)) {
    freeze_unstable<T>(part, part.last_of(lane), lane, p, voices);
    return;
  }
  const double slack = rounding<T> * energy.scale + least_energy;
  const bool is_free = state.is_bounded && !seen.was_driven;
  const auto frames = static_cast<double>((seen.updates - state.inspected) * max_block_frames);
  state.was_driven = seen.was_driven || !state.is_metered;
  state.loss = state.was_driven ? 0.0 : (state.energy - energy.value) / frames;
  state.is_metered = true;
  state.energy = energy.value;
  state.inspected = seen.updates;
  // A free part never gains energy. If it seems to, its bound does not hold and it is not frozen.
  if (is_free && energy.value - energy.uncertainty > state.most + slack) {
    state.is_bounded = false;
  } else if (is_free &&
             may_freeze(p, values, bank, std::max(0.0, energy.value) + energy.uncertainty,
                        voices[lane], parameters)) {
    freeze(part.last_of(lane), part.width, lane, p);
  }
  const double most = energy.value + energy.uncertainty;
  state.most = is_free && state.is_bounded ? std::min(state.most, most) : most;
  state.is_bounded = !seen.was_driven;
}

// Returns whether no motion with this energy is audible or closes the gap of a contact or pluck.
// The bound |y| <= sqrt(2 E c) holds for each output or distance y with compliance c.
template <class T>
bool EnergyWatch::may_freeze(std::size_t p, LaneValues<T> values, const Bank<T>& bank,
                             double energy, const Voice& voice,
                             std::span<const double> parameters) const {
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
                       return gap_at_rest(program, values, bank.x.data(), reach.link) >
                              std::sqrt(most * reach.compliance);
                     });
}

template void EnergyWatch::freeze_unstable(PartBank<float>&, const float*, std::size_t, std::size_t,
                                           Voices&);
template void EnergyWatch::freeze_unstable(PartBank<double>&, const double*, std::size_t,
                                           std::size_t, Voices&);
template void EnergyWatch::inspect_next(Bank<float>&, Voices&, std::span<const double>);
template void EnergyWatch::inspect_next(Bank<double>&, Voices&, std::span<const double>);

}  // namespace ressort::engine
