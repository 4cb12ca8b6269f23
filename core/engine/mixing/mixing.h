// core/engine: what the voices of one kernel add to the channels, and what becomes of a voice that
// has left its bounds.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/engine/energy_watch.h"
#include "core/engine/mixing/bank.h"
#include "core/engine/mixing/segment.h"
#include "core/engine/voices.h"

namespace ressort {

// All functions: [audio] wait-free.
class Mixing {
 public:
  explicit Mixing(const Playing& playing);
  void go_on_from(const Mixing& from) { noise_ = from.noise_; }

  // The kernel that begins with voice `first` has stepped part `p`: adds what its voices that step
  // say to the outputs, and keeps their peaks and their last sample. One that is beyond what no
  // output reaches is heard as long as it is sane; then it stands still, and from the next segment
  // on it fades.
  template <class T>
  void add(Bank<T>& bank, std::size_t p, std::size_t first, const Segment& segment, Voices& voices,
           EnergyWatch& watch) const;
  // The same of those that stand still.
  void add_still(const Program& program, std::size_t p, std::size_t first, std::size_t width,
                 const Segment& segment, const Voices& voices, const EnergyWatch& watch) const;
  // White noise through what is in the outputs.
  void make_noise(const Segment& segment);

 private:
  template <class T>
  void add_fading(const Bank<T>& bank, const PartBank<T>& part, std::size_t lane,
                  const Segment& segment, std::size_t frames, const Voice& voice) const;
  void add_held(const Program& program, const double* held, const Segment& segment,
                std::size_t from, const Voice& voice) const;
  template <class T>
  void lose(Bank<T>& bank, std::size_t p, std::size_t lane, const Segment& segment, Voices& voices,
            EnergyWatch& watch) const;
  double white();

  double gain_;
  double loudest_;  // what no output reaches
  std::uint64_t noise_ = 0x9e3779b97f4a7c15u;
};

}  // namespace ressort
