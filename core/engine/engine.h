// core/engine: one instrument that plays: voices, parameters, gestures, mixing and the energy
// watch.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/engine/event.h"
#include "core/engine/playing.h"
#include "core/engine/readings.h"
#include "core/kernels/isa.h"
#include "core/kernels/program.h"
#include "core/precision.h"
#include "core/progress.h"

namespace ressort::kernels {
class Executor;
}

namespace ressort::engine {

// A parameter of the body that follows a parameter of the voices.
struct SharedParameter {
  std::uint16_t index = 0;    // parameter of the voices
  std::uint16_t of_body = 0;  // parameter of the body
};

// The constructor allocates all memory and throws what a Progress throws. No other function
// allocates.
class Engine {
 public:
  // The executor helps to step voices and must outlive the engine; null: one thread plays all.
  Engine(Machine machine, Playing playing, Precision precision, Isa isa = best_isa(),
         const Progress& progress = {}, Executor* executor = nullptr);
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  // Makes the voices' outputs the audio inputs of another engine, whose outputs are heard instead.
  // Called once, before the engine plays. [any thread but audio]
  void set_body(std::unique_ptr<Engine> body, std::vector<SharedParameter> shared);

  // Plays `frames` samples. `events` are sorted by frame and lie within the block. `inputs`: audio
  // channels, null if absent. `outputs`: one for each of the model's channels, overwritten, always
  // finite. [audio] wait-free, O(frames * elements * awake voices)
  void process(std::span<const Event> events, std::span<const double* const> inputs,
               std::span<double* const> outputs, std::size_t frames) noexcept;

  // Returns false if a kernel of `from` cannot reconstruct the positions of all masses. [audio]
  // wait-free, O(awake voices * (nodes + modes * masses))
  bool can_continue_from(const Engine& from);

  // Takes over the state of another engine of the same Machine in other forms, without a gap: the
  // next sample is the one that `from` would have played. Returns false, and changes nothing,
  // unless can_continue_from(). [audio] wait-free, as above
  bool continue_from(const Engine& from);

  // Takes over the state of an engine for which can_renumber() is true. Voices keep sounding, and
  // the coefficients and the gain ramp to the new values. A parameter whose initial value differs
  // in this Machine goes there; the others keep their values. [audio] wait-free, as above
  bool renumber_from(const Engine& from);

  // Takes over controllers and tuning messages of an engine of another model. [audio] wait-free
  void adopt_channels(const Engine& from);
  void set_tempo(double beats_per_s);           // like EventKind::tempo. [audio] wait-free
  bool listens_to(std::uint8_t channel) const;  // [any thread]

  // Limits the number of sounding voices, from 1 to Playing::voices. Excess voices fade as stolen
  // ones do: released voices first, then the quietest, never a held voice that was played last.
  // [audio] wait-free, O(voices^2)
  void limit_voices(int most);
  int voice_count() const;  // Playing::voices

  // Returns the parameters that notes and controllers have changed since the last call, at most
  // max_changes of them. [audio] wait-free
  std::span<const std::uint16_t> take_changes();
  double parameter(std::uint16_t index) const;  // [audio]
  static constexpr std::size_t max_changes = max_parameter_changes;

  // Selects what read_positions() shows: [part]. Called before the engine plays. [any thread but
  // audio]
  using Watched = WatchedPart;
  static constexpr std::size_t waveguide_points = engine::waveguide_points;
  void watch(std::vector<Watched> parts);
  // Writes the positions of the watched nodes of the voice that was played last, and
  // waveguide_points of each watched waveguide, part by part, until `numbers` is full. Returns how
  // many numbers it wrote. [audio] wait-free, O(numbers + the waveguides' samples)
  std::size_t read_positions(std::span<double> numbers) const;

  // Requests the same as a stroboscope shows it. process() takes the view at the first block end at
  // which a motion of the voice's frequency has the phase that it would have with a period of
  // strobe_period_s. A new request replaces the last one; an empty `numbers` cancels it. Returns
  // false if no pitch is known. [audio] wait-free
  static constexpr double strobe_period_s = engine::strobe_period_s;
  bool request_slow_view(std::span<double> numbers);
  // Returns how many numbers the view has written, once; 0 before that. [audio] wait-free
  std::size_t take_slow_view();

  const Machine& machine() const;  // [any thread]
  int output_count() const;        // [any thread]
  // Returns whether the outputs may have a mean. Modulated noise has none. [any thread]
  bool may_have_dc() const;
  EngineMeters meters() const;  // [audio]

 private:
  struct Player;
  std::unique_ptr<Player> player_;
};

}  // namespace ressort::engine
