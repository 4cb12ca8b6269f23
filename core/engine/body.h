// core/engine: the body that the sum of all voices passes through, such as a soundboard.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/engine/engine.h"
#include "core/engine/mix.h"

namespace ressort::engine {

// An engine whose audio inputs are the outputs of the voices. It is computed once for all voices,
// in the same samples. Its own outputs are heard. All functions but the constructor: [audio]
// wait-free.
class Body {
 public:
  // `channels`: number of the voices' outputs.
  Body(std::unique_ptr<Engine> engine, std::vector<SharedParameter> shared, std::size_t channels);

  // Returns the first frames of a segment, at most max_block_frames, with buffers for the voices'
  // outputs, which are silent.
  Segment start(const Segment& segment);
  // Plays the first `frames` of the segment: the body moves by the buffers' content. `parameters`:
  // those of the voices.
  void play(const Segment& segment, std::size_t frames, std::span<const double> parameters);
  // Fades the body out like a stolen voice, from the next sample on.
  void mute() { is_muted_ = true; }

  bool can_continue_from(const Body& from) { return engine_->can_continue_from(*from.engine_); }
  void continue_from(const Body& from);
  void renumber_from(const Body& from);

  void add_to(EngineMeters& meters) const;
  int output_count() const { return engine_->output_count(); }

 private:
  static constexpr std::size_t most_channels = 64;

  std::unique_ptr<Engine> engine_;
  std::vector<SharedParameter> shared_;
  std::vector<double> sent_;                  // [shared parameter] last value that the body got
  std::vector<Event> events_;                 // events of the next segment
  std::vector<double> sound_;                 // [channel][max_block_frames] outputs of the voices
  std::vector<double*> voices_;               // [channel] in `sound_`
  std::vector<const double*> heard_by_body_;  // the same
  std::array<const double*, most_channels> inputs_{};  // of the voices, from the segment's start
  std::array<double*, most_channels> outputs_{};       // of the body, from the segment's start
  bool is_muted_ = false;
};

}  // namespace ressort::engine
