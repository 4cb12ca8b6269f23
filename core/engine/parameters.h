// core/engine: the parameters: where each is, which have been turned, how high they leave keys to
// be tuned, and what they make of the kernels' coefficients.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/engine/energy_watch.h"
#include "core/engine/mixing/bank.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// All functions but the constructor: [audio] wait-free.
class Parameters {
 public:
  // With limits and home of every parameter.
  Parameters(const Machine& machine, const Playing& playing);
  void go_on_from(const Parameters& from);

  std::span<const double> values() const { return values_; }
  // To the nearest value that it may have; nothing where there is no such parameter.
  void set(std::size_t index, double wanted);
  // The stiffness factor that they, as they are, leave to keys and bend. O(parameters)
  double highest_factor() const;

  // Since the last apply():
  bool has_changed() const { return !turned_.empty(); }
  bool has_changed_highest_factor() const;

  // Brings the kernels to what the events before a segment want, once, however many they were:
  // voices that are new to the start, and all that depends on what has changed.
  template <class T>
  void apply(Bank<T>& bank, const Voices& voices, EnergyWatch& watch);
  // What depends on a parameter that audio gives, for every sample.
  template <class T>
  void fill_audio(Bank<T>& bank, const VoiceGroup& group, const Segment& segment,
                  const Voices& voices);

  // As Engine::take_changes says.
  std::span<const std::uint16_t> take_changes();
  std::uint64_t beyond() const { return beyond_; }

 private:
  double within_limits(std::size_t index, double value) const;

  const Playing& playing_;
  std::size_t turn_frames_;  // that a turned parameter takes
  std::vector<double> values_;
  std::vector<std::uint16_t> turned_;   // since the last apply()
  std::vector<bool> is_turned_;         // [parameter]
  double highest_before_ = 1.0;         // highest_factor() before the first of them
  std::vector<std::uint16_t> changes_;  // since the last take_changes()
  std::vector<std::uint16_t> taken_;    // by it
  std::uint64_t beyond_ = 0;
};

}  // namespace ressort::engine
