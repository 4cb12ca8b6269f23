// core/engine: what is known of the energy of every part in every voice, and what follows: what can
// no longer be heard stands still, who makes energy of nothing is told, and a voice that has lost
// its stability is stopped.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/engine/energy.h"
#include "core/engine/mixing/bank.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// All functions but the constructor: [audio] wait-free.
class EnergyWatch {
 public:
  // With rest bounds of every part.
  EnergyWatch(const Machine& machine, const Playing& playing, std::size_t lanes);
  void go_on_from(const EnergyWatch& from);

  // A part that stands still is not stepped; its outputs are what they were.
  bool has_still() const { return still_count_ > 0; }
  bool is_still(std::size_t lane, std::size_t p) const {
    return has_still() && parts_[lane * elements_.size() + p].is_still;
  }
  const double* held(std::size_t lane, std::size_t p) const {  // [output]
    return held_.data() + lane * first_output_.back() + first_output_[p];
  }
  // Whether there is somebody to step.
  bool steps(const VoiceGroup& group, const Voices& voices) const {
    for (std::size_t lane = group.first; lane < group.end; ++lane) {
      if (voices[lane].awake && !is_still(lane, group.part)) {
        return true;
      }
    }
    return false;
  }
  // Something comes to a part from outside.
  void stir(const Voice& voice, std::size_t lane, std::size_t p) {
    Part& here = part_of(lane, p);
    here.is_stirred = true;
    if (here.is_still && !voice.lost) {
      here.is_still = false;
      --still_count_;
    }
  }
  // It is put to its start, or sleeps.
  void forget(std::size_t lane, std::size_t p);
  void forget(std::size_t lane);
  // It has left its bounds: it stands still where `row`, [output][lane], has it, and its voice
  // fades.
  template <class T>
  void lose(PartBank<T>& part, const T* row, std::size_t lane, std::size_t p, Voices& voices);

  // Once in max_block_frames: looks at one part after the other, seldom enough for its cost to be
  // a small share of what stepping takes; at a large one for several times on end.
  template <class T>
  void look_around(Bank<T>& bank, Voices& voices, std::span<const double> parameters);
  // After it, and after voices have gone to sleep: now and then adds up what was seen.
  void read_energy(const Voices& voices);

  // The energy, as it was read, and the share of the steps that nobody has to take.
  EngineMeters meters(const Voices& voices) const;

 private:
  // One part in one voice.
  struct Part {
    bool is_still = false;
    bool is_stirred = true;  // something came from outside since the last look
    bool is_judged = false;  // `most` is known
    double most = 0.0;       // energy that it may have, as long as nothing stirs it
    // At the last look, and the one before:
    bool is_metered = false;
    double energy = 0.0;
    double loss = 0.0;         // of it in a sample between them, unless...
    bool is_driven = true;     // ...something came from outside then
    std::uint64_t looked = 0;  // updates_
  };
  static constexpr std::size_t none = static_cast<std::size_t>(-1);
  // A look at one of them: as it was at one time, its energy added up a slice at a time.
  struct Look {
    std::size_t at = none;
    std::size_t done = 0;  // of its elements
    bool was_stirred = false;
    std::uint64_t updates = 0;  // when it was
    Energy energy;
  };

  Part& part_of(std::size_t lane, std::size_t p) { return parts_[lane * elements_.size() + p]; }
  bool steps(std::size_t at, const Voices& voices) const;
  template <class T>
  void lay_still(const T* row, std::size_t width, std::size_t lane, std::size_t p);
  template <class T>
  std::size_t price_of(std::size_t p, const Bank<T>& bank) const;
  template <class T>
  void look(std::size_t at, Bank<T>& bank, Voices& voices, std::span<const double> parameters);
  template <class T>
  void go_on_looking(Bank<T>& bank, Voices& voices, std::span<const double> parameters);
  template <class T>
  void judge(const Look& seen, Bank<T>& bank, Voices& voices, std::span<const double> parameters);
  template <class T>
  bool may_rest(std::size_t p, LaneValues<T> values, const Bank<T>& bank, double energy,
                const Voice& voice, std::span<const double> parameters) const;

  const Machine& machine_;
  const Playing& playing_;
  std::vector<std::size_t> elements_;      // [part] nodes and links
  std::vector<std::size_t> first_output_;  // [part] among all parts' outputs; then their number
  std::vector<Part> parts_;                // [lane][part]
  std::vector<double> held_;               // [lane][output of the machine] of what stands still
  std::size_t still_count_ = 0;
  std::uint64_t updates_ = 0;  // times that it has looked around
  EngineMeters read_;
  Look looking_;               // the bank's x and v are its own until it is done
  std::size_t turn_ = 0;       // of the parts_: the next to be looked at,
  std::size_t turn_part_ = 0;  // and which part that is
  std::size_t looks_due_ = 0;  // updates, times parts_: what looks are paid with
};

}  // namespace ressort::engine
