// core/engine: one instrument that sounds: voices, parameters, gestures, the mix, the energy watch.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/curve.h"
#include "core/engine/event.h"
#include "core/engine/midi/channels.h"
#include "core/engine/midi/key_tuning.h"
#include "core/engine/midi/note_share.h"
#include "core/engine/midi/velocity_curve.h"
#include "core/kernels/isa.h"
#include "core/kernels/program.h"
#include "core/progress.h"

namespace ressort::kernels {
class Executor;
}

namespace ressort::engine {

enum class Source : std::uint8_t { note, controller, pressure, custom, audio };

// One row of the control map: what drives which input or parameter, and how.
struct Control {
  Source source = Source::note;
  std::uint16_t number = 0;  // controller 0..127 or audio channel from 0
  std::uint8_t lowest_key = 0;
  std::uint8_t highest_key = 127;
  std::uint8_t turn = 0;   // of notes: whether it is its turn,
  std::uint8_t turns = 1;  //   among so many controls
  Gesture gesture = Gesture::position;
  std::uint16_t target = 0;  // index into Machine::inputs or Machine::parameters
  double low = 0.0;          // 0..1 becomes low..high: positions, forces, speeds per sample at
  double high = 1.0;         //   44 100 Hz, parameter values
  bool exponential = false;  // equal steps are equal ratios
  double travel = 0.0;       // pluck: how far from its middle the hand rests, on either side
  bool has_level = false;    // 0..1 is the voice's level too:
  double low_db = 0.0;
  double high_db = 0.0;
  double longest_s = 0.0;  // impulse: how long the softest pulse lasts; 0: one sample
  double shortest_s = 0.0;
};

enum class Tuning : std::uint8_t {
  fixed,     // every key sounds the model as it is written
  keyboard,  // a key's voice sounds at that key's frequency
};

// Where a parameter keeps the network stable.
struct Limits {
  double lowest = -std::numeric_limits<double>::infinity();
  double highest = std::numeric_limits<double>::infinity();
};

// What is known of a part's stillness. With an energy E, measured from where it rests, and nothing
// that stirs it, an output stays within sqrt(2 E c / s) for ever; c is its compliance where every
// stiffness is as small as the box of parameters lets it be, s the voice's stiffness factor.
struct RestBound {
  struct Reach {
    std::uint32_t link = 0;   // a contact or a pluck
    double compliance = 0.0;  // of the distance of its ends
  };
  std::vector<double> compliances;  // [output]
  std::vector<Reach> reaches;
  std::vector<Limits> box;  // [parameter]
};

// By which factor on every stiffness a voice sounds at a frequency: one for each semitone from the
// lowest on, on the grid of 440 Hz; a cubic of logarithms between them. [any thread]
struct Pitches {
  double factor_at(double frequency_hz) const;  // 1 where there are none
  double frequency_at(double factor) const;     // by halves, to rounding

  double lowest_hz = 440.0 / 4096.0;
  std::vector<double> factors;  // ascending; empty: no mode is known
};

// The same wherever one parameter is: at equal differences or ratios of it, so many in each of a
// few legs, between which it may bend; cubics of logarithms between those. [any thread]
struct PitchesAlong {
  static constexpr std::size_t least_steps = 4;

  double factor_at(double frequency_hz, double value) const;
  double value_at(std::size_t index) const;

  std::size_t parameter = 0;
  double lowest = 1.0;
  double highest = 2.0;
  bool by_ratios = false;
  std::size_t legs = 1;
  std::size_t steps = least_steps;  // in a leg
  std::vector<Pitches> at;          // empty: keys are tuned where all parameters start
};

// How a Machine is played. Plain data, made by the compile room.
struct Playing {
  int voices = 1;
  double gain = 1.0;                // output per position unit
  bool bare = false;                // the network alone: no ramps, no smoothing, no sleep
  double damper_s = 0.0;            // T60 of a voice whose key is up; 0: it rings out
  std::vector<CurvePoint> decay_s;  // T60 of any voice with a key, beside its own; empty: none
  std::vector<CurvePoint> keys_db;  // how much louder a voice with a key is; empty: 0
  bool noise = false;  // the outputs shape white noise instead of being heard themselves
  Tuning tuning = Tuning::fixed;
  double transpose = 0.0;  // semitones, that the keys' frequencies have already
  KeyFrequencies keys_hz = equal_temperament(440.0, 0.0);
  VelocityCurve velocity;
  ChannelMask channels = midi_channels;  // that it listens to
  bool mono = false;            // one voice a channel plays the last of the keys that are down
  bool legato = false;          // and is not struck again while one is
  double glide_s = 0.0;         // from the pitch before, in equal steps of cents
  NoteShare::Part share;        // of the notes, that this engine plays
  Pitches pitches;              // of the lowest mode
  PitchesAlong along;           // the same, instead, where a parameter is to leave keys in tune
  double highest_factor = 1.0;  // the stiffness factor up to which the model is proved stable
  std::vector<Limits> home;     // [parameter] while they are there; empty: wherever they are
  std::vector<double> away;     // the same factor at equal steps from there to their limits
  std::vector<Control> controls;
  std::vector<Limits> limits;  // [parameter] that no event and no audio leaves; empty: none
  std::vector<std::optional<RestBound>>
      rest_bounds;  // [part]; nothing, or no element: never at rest

  double gain_of_loudest_key() const {
    double most_db = 0.0;
    for (const CurvePoint& point : keys_db) {
      most_db = std::max(most_db, point[1]);
    }
    return gain * std::pow(10.0, most_db / 20.0);
  }
};

enum class Precision : std::uint8_t { float32, float64 };

struct EngineMeters {
  int voices = 0;            // that sound
  int stepped = 0;           // that take time, too quiet ones among them, but for what fades
  std::uint64_t resets = 0;  // voices that went out of bounds and were faded out
  std::uint64_t stolen = 0;  // voices that had to give way to a new note
  std::uint64_t shed = 0;    // voices that had to give way to limit_voices()
  std::uint64_t beyond = 0;  // times that a parameter was kept within its limits; by audio, blocks
  double saved = 0.0;        // the share of the steps that nobody has to take, 0..1
  std::uint64_t modes = 0;   // of all voices that are awake
  std::uint64_t modes_awake = 0;
  // Of all that steps, when it was last looked at, in mass * (position per sample at 44 100 Hz)^2.
  double energy = 0.0;
  double loss = 0.0;       // of it in a second
  bool is_driven = false;  // something came in meanwhile: the loss is that of the rest
  bool is_whole = true;    // if not, there is more: in modes, or not yet looked at
};

// A voice that is louder than this, or no number, has lost its stability: 60 dB over full scale; in
// the bare network, where outputs are positions, a number that no position reaches.
inline constexpr double runaway_level = 1e3;
inline constexpr double runaway = 1e9;

// Whether an Engine of one Machine can be renumbered to the other: they differ in the numbers of
// their coefficients, their velocities at the start and their forms only, and what is between their
// numbers is stable where both are. [any thread]
bool can_renumber(const Machine& from, const Machine& to);

// The heap is used by the constructor and never again; it throws what a Progress does.
class Engine {
 public:
  // The executor helps with the voices, and outlives the engine; null: one thread plays them all.
  Engine(Machine machine, Playing playing, Precision precision, Isa isa = best_isa(),
         const Progress& progress = {}, Executor* executor = nullptr);
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  // Plays `frames` samples. `events` are sorted by frame and lie within the block. `inputs`:
  // audio channels, null where there is none; `outputs`: one for each of the model's channels,
  // overwritten, always finite. [audio] wait-free, O(frames * elements * awake voices)
  void process(std::span<const Event> events, std::span<const double* const> inputs,
               std::span<double* const> outputs, std::size_t frames) noexcept;

  // Becomes what `from` is, another engine of the same Machine in other forms: its next sample is
  // what that of `from` would be. False, and nothing is changed, if a kernel there does not
  // know where all of its masses are. [audio] wait-free, O(awake voices * (nodes + modes * masses))
  bool go_on_from(const Engine& from);

  // The same from one that can_renumber(): its voices sound on, and the new numbers come as
  // parameters do that are turned, the gain as a channel's level. A parameter that this Machine
  // starts elsewhere with goes there; the others stay where they are. [audio] wait-free, as above
  bool renumber_from(const Engine& from);

  // Hears from now on what controllers and tuning messages have said to `from`, an engine of
  // another model that sounded until now. [audio] wait-free
  void adopt_channels(const Engine& from);
  bool listens_to(std::uint8_t channel) const;  // [any thread], as long as the engine lives

  // So many voices sound at once from now on, at least one and at most what Playing says. Those
  // that are too many fade as stolen ones do: first whose key is up, then who is quietest, and
  // never a held one that was played last. [audio] wait-free, O(voices^2)
  void limit_voices(int most);
  int voice_count() const;  // as Playing says

  // The parameters that notes and controllers have changed since the last call, at most
  // `max_changes`; then it starts anew. [audio] wait-free
  std::span<const std::uint16_t> take_changes();
  double parameter(std::uint16_t index) const;  // [audio]
  static constexpr std::size_t max_changes = 64;

  // What look() shows of a part: some of its nodes, and the first so many of its waveguides.
  struct Watched {
    std::vector<std::uint32_t> nodes;
    std::size_t waveguides = 0;
  };
  static constexpr std::size_t waveguide_points = 33;
  // [part] before it plays. [any thread but audio]
  void watch(std::vector<Watched> parts);
  // Where these are in the voice that was played last, part by part, as Kernel::look() says, and of
  // each waveguide so many points, as look_along() does; what there is no room for ends it. How
  // many numbers that are. [audio] wait-free, O(numbers + the waveguides' samples)
  std::size_t look(std::span<double> numbers) const;

  // The same as a stroboscope sees it: process() looks at the first moment, of one in
  // max_block_frames, at which a motion of the voice's frequency is where it would be if it took
  // strobe_period_s for a period. What has been asked for before is forgotten, as it is without
  // room for numbers. False where nothing has a pitch: nothing is looked at. [audio] wait-free
  static constexpr double strobe_period_s = 2.0;
  bool look_slowly(std::span<double> numbers);
  // How many numbers that were, once; 0: the moment has not come. [audio] wait-free
  std::size_t take_slow_look();

  const Machine& machine() const;  // [any thread], as long as the engine lives
  int output_count() const;        // [any thread], as long as the engine lives
  EngineMeters meters() const;     // [audio]

 private:
  struct Player;
  std::unique_ptr<Player> player_;
};

}  // namespace ressort::engine
