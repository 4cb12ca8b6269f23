// core/engine: the energy of every part in every voice. Inaudible parts are frozen, energy is
// metered, and unstable voices are stopped.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/engine/bank.h"
#include "core/engine/energy.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// A frozen part is not stepped, and its outputs keep their last values. A part is frozen when its
// energy is too small for anything audible (RestBound). All functions but the constructor: [audio]
// wait-free.
class EnergyWatch {
 public:
  // Playing must have rest_bounds for every part.
  EnergyWatch(const Machine& machine, const Playing& playing, std::size_t lanes);
  void continue_from(const EnergyWatch& from);

  bool has_frozen() const { return frozen_count_ > 0; }
  bool is_frozen(std::size_t lane, std::size_t p) const {
    return has_frozen() && parts_[lane * elements_.size() + p].is_frozen;
  }
  // Returns the outputs of a frozen part, [output].
  const double* frozen_outputs(std::size_t lane, std::size_t p) const {
    return frozen_outputs_.data() + lane * first_output_.back() + first_output_[p];
  }
  // Returns whether any voice of the group must be stepped.
  bool is_any_stepped(const VoiceGroup& group, const Voices& voices) const {
    for (std::size_t lane = group.first; lane < group.end; ++lane) {
      if (voices[lane].awake && !is_frozen(lane, group.part)) {
        return true;
      }
    }
    return false;
  }
  // Notes that a part is driven from outside, which unfreezes it.
  void mark_driven(const Voice& voice, std::size_t lane, std::size_t p) {
    Part& part = part_of(lane, p);
    part.is_driven = true;
    if (part.is_frozen && !voice.unstable) {
      part.is_frozen = false;
      --frozen_count_;
    }
  }
  // Forgets a part, or all parts of a voice, that starts anew or sleeps.
  void reset(std::size_t lane, std::size_t p);
  void reset(std::size_t lane);
  // Handles a part that has left its bounds: freezes it at `row`, [output][lane], and marks the
  // voice as unstable, which makes it fade.
  template <class T>
  void freeze_unstable(PartBank<T>& part, const T* row, std::size_t lane, std::size_t p,
                       Voices& voices);

  // Inspects the next parts in turn. Called once in max_block_frames. The rate is low enough that
  // the cost is a small share of stepping. A large part is spread over several calls.
  template <class T>
  void inspect_next(Bank<T>& bank, Voices& voices, std::span<const double> parameters);
  // Adds up the energies of all parts from time to time. Called after inspect_next(), and after
  // voices have gone to sleep.
  void update_reading(const Voices& voices);

  // Returns the last reading and the share of saved steps.
  EngineMeters meters(const Voices& voices) const;

 private:
  // One part in one voice.
  struct Part {
    bool is_frozen = false;
    bool is_driven = true;    // since the last inspection
    bool is_bounded = false;  // `most` is valid
    double most = 0.0;        // upper bound of the energy as long as nothing drives the part
    // Results of the last inspection.
    bool is_metered = false;
    double energy = 0.0;
    double loss = 0.0;            // per sample between the last two inspections; 0 if...
    bool was_driven = true;       // ...the part was driven between them
    std::uint64_t inspected = 0;  // value of updates_
  };
  static constexpr std::size_t none = static_cast<std::size_t>(-1);
  // An inspection in progress. The state is a snapshot; its energy is added up in slices.
  struct Inspection {
    std::size_t at = none;  // index into parts_
    std::size_t done = 0;   // elements added so far
    bool was_driven = false;
    std::uint64_t updates = 0;  // time of the snapshot
    Energy energy;
  };

  Part& part_of(std::size_t lane, std::size_t p) { return parts_[lane * elements_.size() + p]; }
  bool is_stepped(std::size_t at, const Voices& voices) const;
  template <class T>
  void freeze(const T* row, std::size_t width, std::size_t lane, std::size_t p);
  template <class T>
  std::size_t price_of(std::size_t p, const Bank<T>& bank) const;
  template <class T>
  void start_inspection(std::size_t at, Bank<T>& bank, Voices& voices,
                        std::span<const double> parameters);
  template <class T>
  void continue_inspection(Bank<T>& bank, Voices& voices, std::span<const double> parameters);
  template <class T>
  void evaluate(const Inspection& seen, Bank<T>& bank, Voices& voices,
                std::span<const double> parameters);
  template <class T>
  bool may_freeze(std::size_t p, LaneValues<T> values, const Bank<T>& bank, double energy,
                  const Voice& voice, std::span<const double> parameters) const;

  const Machine& machine_;
  const Playing& playing_;
  std::vector<std::size_t> elements_;      // [part] number of nodes and links
  std::vector<std::size_t> first_output_;  // [part] index among all outputs; then their number
  std::vector<Part> parts_;                // [lane][part]
  std::vector<double> frozen_outputs_;     // [lane][output of the machine]
  std::size_t frozen_count_ = 0;
  std::uint64_t updates_ = 0;  // calls of inspect_next()
  EngineMeters reading_;
  Inspection inspection_;      // owns the bank's x and v while it is in progress
  std::size_t turn_ = 0;       // index into parts_ of the next inspection
  std::size_t turn_part_ = 0;  // its part
  std::size_t credit_ = 0;     // budget of inspections: calls times parts_.size()
};

}  // namespace ressort::engine
