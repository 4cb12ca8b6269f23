// core/engine: what the voices of one kernel add to the channels, and what becomes of a voice that
// has left its bounds.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/engine/energy_watch.h"
#include "core/engine/mixing/bank.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// All functions: [audio] wait-free.
class Mixing {
 public:
  explicit Mixing(const Playing& playing);
  void go_on_from(const Mixing& from) { noise_ = from.noise_; }

  // A kernel has stepped: adds what its voices that step say to the outputs, and keeps their peaks
  // and their last sample. One that is beyond what no output reaches is heard as long as it is
  // sane; then it stands still, and from the next segment on it fades.
  template <class T>
  void add(Bank<T>& bank, const VoiceGroup& group, const Segment& segment, Voices& voices,
           EnergyWatch& watch) const;
  // The same of those that stand still.
  void add_still(const Program& program, const VoiceGroup& group, const Segment& segment,
                 const Voices& voices, const EnergyWatch& watch) const;
  // White noise, shaped by what is in the outputs.
  void make_noise(const Segment& segment);

 private:
  template <class Sample>
  std::size_t sane_frames(std::size_t frames, std::size_t outputs, Sample&& sample) const;
  template <class Sample>
  void add_one(const Program& program, const Voice& voice, const Segment& segment, std::size_t from,
               std::size_t to, Sample&& sample) const;
  template <class T>
  static void keep_last(Bank<T>& bank, const VoiceGroup& group, std::size_t frames,
                        bool is_any_lost, const Voices& voices, const EnergyWatch& watch);
  void add_held(const Program& program, const Voice& voice, const Segment& segment,
                std::size_t from, const double* held) const;

  double gain_;
  double loudest_;  // what no output reaches
  std::uint64_t noise_ = 0x9e3779b97f4a7c15u;
};

}  // namespace ressort::engine
