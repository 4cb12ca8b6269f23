// core/engine: the values of the model's parameters, and the kernels' coefficients that depend on
// them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/engine/bank.h"
#include "core/engine/energy_watch.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// All functions but the constructor: [audio] wait-free.
class Parameters {
 public:
  // Playing must have `limits` and `home` for every parameter.
  Parameters(const Machine& machine, const Playing& playing, std::size_t lanes);
  void continue_from(const Parameters& from);

  std::span<const double> values() const { return values_; }
  // Sets a parameter, clamped to its limits. Ignores an unknown index.
  void set(std::size_t index, double wanted);
  // Returns the greatest stable stiffness factor at the current values. O(parameters)
  double highest_factor() const;

  // Changes since the last apply().
  bool has_changed() const { return !turned_.empty(); }
  bool has_changed_highest_factor() const;

  // Applies all events before a segment to the kernels at once: resets new voices, and sets the
  // coefficients that depend on changed parameters and retuned voices.
  template <class T>
  void apply(Bank<T>& bank, const Voices& voices, EnergyWatch& watch);
  // Advances the parameters that glide by one block. Their changes wait for the next apply().
  void advance();
  // Computes the coefficients that depend on audio parameters, for every sample.
  template <class T>
  void fill_audio(Bank<T>& bank, const VoiceGroup& group, const Segment& segment,
                  const Voices& voices);

  // See Engine::take_changes().
  std::span<const std::uint16_t> take_changes();
  std::uint64_t beyond() const { return beyond_; }

 private:
  double within_limits(std::size_t index, double value) const;
  // A parameter on its way to its value.
  struct Glide {
    std::uint16_t parameter = 0;
    double target = 0.0;
    std::size_t frames = 0;  // left
  };

  // Returns the values in one voice. They differ from the shared ones if the preset has curves.
  std::span<const double> values_in(std::size_t lane) const {
    return voice_values_.empty()
               ? std::span(played_)
               : std::span(voice_values_).subspan(lane * values_.size(), values_.size());
  }
  void note_turn(std::uint16_t parameter);
  void start_glides(bool is_any_audible);
  void update_voice_values(const Voices& voices);

  const Playing& playing_;
  std::size_t turn_frames_;  // ramp of a changed parameter
  bool glides_;              // LFOs retune voices in every block
  std::vector<double> values_;
  std::vector<double> played_;  // values_, or on the way to them
  std::vector<Glide> gliding_;
  std::vector<double> voice_values_;    // [lane][parameter]; empty: all voices have played_
  std::vector<std::uint16_t> turned_;   // since the last apply()
  std::vector<bool> is_turned_;         // [parameter]
  std::vector<std::uint16_t> swung_;    // by LFOs, in any voice, since the last apply()
  double highest_before_ = 1.0;         // highest_factor() before the first of these changes
  std::vector<std::uint16_t> changes_;  // since the last take_changes()
  std::vector<std::uint16_t> taken_;    // result of the last take_changes()
  std::uint64_t beyond_ = 0;
};

}  // namespace ressort::engine
