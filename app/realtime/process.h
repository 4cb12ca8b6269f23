// app/realtime: the audio thread, whole. Everything that it touches is in this struct.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "app/realtime/dsp_load.h"
#include "app/realtime/flight_record.h"
#include "app/realtime/lockfree.h"
#include "app/realtime/midi.h"
#include "app/realtime/motion.h"
#include "core/engine/engine.h"
#include "core/engine/mixing/dc_blocker.h"
#include "core/engine/mixing/limiter.h"

namespace ressort::realtime {

// An engine and the number that events for it carry. One of the same number, unless it is 0, goes
// on where the other is, in the same sample.
struct Sounding {
  std::unique_ptr<Engine> engine;
  std::uint32_t serial = 0;
  bool lets_ring = false;        // what sounded before it ends by itself, without new notes
  bool has_new_numbers = false;  // it goes on as Engine::renumber_from() says
  std::uint32_t number = 0;      // of this engine among all, for who keeps a flight
  std::uint32_t picture = 0;     // what is watched of it, to whoever draws it; 0: nothing
};

// An event on its way to the audio thread, and when it is to act.
struct TimedEvent {
  enum class When : std::uint8_t {
    now,       // at the start of the next block
    at_frame,  // `when` is a frame of the process's own count
    at_time,   // `when` is a time of the monotonic clock, ns; it acts one period later
  };
  Event event;
  When timing = When::now;
  std::int64_t when = 0;
};

// A MIDI packet of this block, from a backend that has exact frames.
struct MidiPacket {
  std::uint32_t frame = 0;
  std::span<const std::uint8_t> bytes;
};

// What the audio thread has to tell.
struct Report {
  enum class Kind : std::uint8_t { parameter, reset, overload, program };
  Kind kind = Kind::reset;
  std::uint32_t model = 0;  // serial
  std::uint16_t index = 0;  // parameter; the most voices there is time for, or 0
  double value = 0.0;       // of the parameter; the load; 128 * bank + program
};

// What a controller turns instead of what the preset says, while the model of this serial plays.
struct LearnedControl {
  EventKind kind = EventKind::parameter;  // or custom
  std::uint16_t index = 0;
  std::uint32_t model = 0;  // 0: nothing is learnt
  double low = 0.0;         // what 0 and 1 of the controller become
  double high = 1.0;
  bool exponential = false;  // equal turns are equal ratios
};

// On its way to the audio thread.
struct Lesson {
  std::uint8_t controller = 0;
  LearnedControl control;
};

struct PlayedNote {
  std::uint8_t key = 0;
  std::uint8_t velocity = 0;  // 1..127
};

// A piece of the output on its way to a recording.
struct RecordedChunk {
  static constexpr std::size_t max_samples = 128;
  std::uint16_t frames = 0;
  std::uint16_t channels = 0;
  std::array<float, max_samples> samples{};  // interleaved
};

// Sound that is played as it is.
struct SampleTape {
  std::size_t channels = 2;
  std::vector<float> samples;  // interleaved
  std::size_t frames() const { return samples.size() / channels; }
};

// What the audio thread tells of itself after every block, and what other threads count. Resets,
// shed voices and kept parameters are those of all engines that there were.
struct Meters : EngineMeters {
  std::uint64_t frames = 0;       // since the start
  double load = 0.0;              // share of the time that blocks take, over about a second
  double cpu_peak = 0.0;          // of one block since the last reading
  std::uint64_t overruns = 0;     // blocks that took longer than they sound
  std::uint64_t late = 0;         // events that came after their time
  double late_s = 0.0;            // the last of them, by so much
  std::uint64_t malformed = 0;    // MIDI that could not be read
  std::uint64_t swaps = 0;        // of models
  std::uint64_t record_lost = 0;  // chunks that the recording missed
  double peak = 0.0;              // of the output since the last reading
  double limited = 1.0;           // the limiter's deepest gain since the last reading
  std::uint64_t dropped = 0;      // events that found no room
  std::uint64_t strangers = 0;    // packets of who may not send OSC
  std::uint64_t xruns = 0;        // as the backend says
  std::uint64_t notes = 0;        // that began, from any side
  std::array<PlayedNote, 4> last_notes{};  // of them; the next takes the place `notes` modulo 4
  std::uint64_t turns = 0;                 // controllers that came
  std::uint8_t last_controller = 0;        // the last of them
};

struct Process {
  static constexpr std::size_t chunk_frames = 512;  // engines see no longer block
  static constexpr std::size_t max_channels = 64;   // of a model
  static constexpr std::size_t max_now = 4096;      // events of one source in one block...
  static constexpr std::size_t max_endings = 1024;  // ...and so many more that end sound
  static constexpr std::size_t max_ahead = 4096;    // events that wait for their frame
  static constexpr double fade_s = 0.05;            // between two models
  static constexpr double longest_strobe_s = 0.1;   // that a slow look waits
  static constexpr double looked_for_s = 1.0;       // the output is kept for a look, after a look
  static constexpr double longest_ring_s = 60.0;    // of what the next model lets ring

  // A monotonic clock, in ns, that makes no system call.
  using Clock = std::int64_t (*)();

  // Without a clock nothing is measured, and no voice gives way: offline there is always time.
  explicit Process(double rate_hz, bool limit = true, Clock clock_ns = nullptr);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  // One callback of any backend: `frames` of any number. `inputs` may hold null channels.
  // `time_ns`: the monotonic clock at the first frame. [audio] wait-free
  void block(std::span<const float* const> inputs, std::span<float* const> outputs,
             std::size_t frames, std::span<const MidiPacket> midi, std::int64_t time_ns) noexcept;

  // The same for buffers in double precision, as the offline renderer has them. [audio]
  void block(std::span<const double* const> inputs, std::span<double* const> outputs,
             std::size_t frames, std::span<const MidiPacket> midi, std::int64_t time_ns) noexcept;

  // Schedules an event for a frame of the process's own count; false if there is no room. Only
  // where no other thread runs block(): offline. [audio]
  bool schedule(std::int64_t frame, const Event& event);

  // Hands over what is to act in the next block, all of it or nothing; it acts in one block. What
  // ends sound finds room where other events do not. What is refused is counted. [the ring's one
  // writer] wait-free
  bool send(Ring<TimedEvent>& ring, std::span<const TimedEvent> events);

  // The same for events at frames, which wait in a room of their own until the panic that comes
  // before their time. [OSC's thread] wait-free
  bool send_ahead(std::span<const TimedEvent> events);

  // What a flight says of the next block, before it; then block() plays what was played then. Only
  // offline, and of one whole flight, chunk by chunk. [audio]
  void repeat(const FlightRecord& record);

  // Between two runs of a backend, when no audio thread is alive. [control]
  void set_rate(double rate_hz);

  Meters meters() const;  // [any thread but audio]

  // --- shared with other threads --------------------------------------------------------------
  Slot<Sounding> slot;  // offered by the session's worker
  // Written through send() and send_ahead().
  Ring<TimedEvent> from_osc{max_now + max_endings + max_ahead};
  Ring<TimedEvent> from_console{max_now + max_endings};
  Ring<TimedEvent> from_midi{max_now + max_endings};     // RtMidi's thread
  Ring<TimedEvent> from_session{max_now + max_endings};  // its worker
  Ring<Lesson> lessons{256};                             // from the session, under its lock
  Ring<Report> reports{4096};                            // to the session's worker
  Ring<RecordedChunk> recording{8192};
  Flag is_recording;
  Ring<RecordedChunk> listening{1024};  // to whoever describes what sounds
  Flag is_listening;
  Published<const SampleTape> tape;  // in place of all that engines play
  Flag is_tape_over;
  Ring<FlightRecord> flight{1 << 14};  // to the session's worker, once it wants it
  Flag keeps_flight;
  Flag wants_motion;       // raised for each look: one frame is written after the next block
  Flag wants_slow_motion;  // the same, at the next moment of the stroboscope
  TripleBuffer<MotionFrame> motion{MotionFrame{}};
  Board<ClockReading> clock;
  Board<Meters> board;    // read by meters()
  Flag meters_were_read;  // raised by a reader: what is since the last reading starts anew
  Flag has_time;          // nobody waits for the sound: no voice gives way, no event its frame
  Counter dropped;        // as Meters says, counted by whoever sees it
  Counter strangers;
  Counter xruns;

 private:
  struct Pending {
    std::int64_t frame = 0;
    std::uint64_t order = 0;  // what came first acts first
    Event event;
  };

  template <class Sample>
  void run(std::span<const Sample* const> inputs, std::span<Sample* const> outputs,
           std::size_t frames, std::span<const MidiPacket> midi, std::int64_t time_ns);
  void gather(std::size_t frames, std::span<const MidiPacket> midi, std::int64_t time_ns);
  void drain(Ring<TimedEvent>& ring, std::size_t frames, std::int64_t time_ns);
  void enter(std::int64_t frame, const Event& event);
  void wait(std::int64_t frame, const Event& event);
  void forget_after(std::int64_t frame);
  void collect_due(std::size_t frames);
  void note(const Event& event);
  void learn();
  void translate(Event& event);
  void play_models(std::size_t input_count, std::size_t output_count, std::size_t frames);
  void play(Sounding& sounding, std::size_t input_count, std::vector<double>& samples,
            std::size_t frames);
  void swap_models();
  bool rings_on() const;
  void follow_program(const Event& event);
  bool goes_on(const Sounding& next) const;
  void tell();
  void weigh(double took_s, std::size_t frames);
  void record(std::size_t channels, std::size_t frames, bool records, bool listens);
  void keep(const FlightRecord& record);
  void keep_period(std::size_t frames, std::size_t channels);
  void hurry();
  void play(const SampleTape& tape, std::size_t output_count, std::size_t frames);
  Sounding* take();
  void hear(std::size_t channels, std::size_t frames);
  void look();
  void show();

  double rate_hz_;
  bool limit_;
  Clock clock_ns_;
  DspLoad load_;
  std::int64_t frame_ = 0;  // of the next sample
  std::uint64_t order_ = 0;
  MidiReader midi_;
  Sounding* current_ = nullptr;
  Sounding* fading_ = nullptr;
  Sounding* waiting_ = nullptr;  // until what rings has faded
  std::size_t fade_left_ = 0;
  bool rings_ = false;            // the fading one does not fade yet
  std::int64_t rings_until_ = 0;  // frame
  bool is_alone_ = false;         // the current one came in at its full level
  std::size_t fade_frames_ = 0;
  Meters meters_;
  std::array<int, 16> banks_{};          // [MIDI channel] as 14 bits
  EngineMeters ended_;                   // what engines before the current one counted
  std::int64_t next_overload_news_ = 0;  // frame
  DcBlocker dc_blocker_;
  Limiter limiter_;
  // None of these grows.
  std::vector<Pending> now_;      // of this block, sorted
  std::size_t next_now_ = 0;      // the first of them that has not acted
  std::vector<Pending> pending_;  // what waits for its frame: a heap, the earliest on top
  std::int64_t latest_ = 0;       // no frame there is later
  Permits ahead_{max_ahead};      // of it, and of what is on its way there
  bool keeps_every_frame_ = false;
  bool is_repeating_ = false;
  std::size_t tape_at_ = 0;  // frame
  // What the flight was told last.
  bool has_gap_ = false;
  double kept_rate_hz_ = 0.0;
  std::size_t kept_frames_ = 0;
  std::size_t kept_channels_ = 0;
  std::array<LearnedControl, 128> learned_{};  // [controller]
  std::vector<Event> due_;                     // of this chunk, sorted
  std::vector<Event> matching_;                // those of one engine
  std::array<const double*, max_channels> input_pointers_{};
  std::vector<double> input_;       // [channel][chunk_frames]
  std::vector<double> sound_;       // [channel][chunk_frames] of the current engine
  std::vector<double> fade_sound_;  // [channel][chunk_frames] of the fading one
  std::vector<double> mixed_;       // [output][chunk_frames]
  // The output of late, a ring, kept while somebody looks.
  std::array<float, MotionFrame::heard_samples> heard_{};
  std::size_t heard_at_ = 0;        // where the next sample goes
  std::int64_t looked_until_ = 0;   // frame
  Sounding* strobed_ = nullptr;     // is asked for a slow look,
  std::int64_t strobed_until_ = 0;  // until this frame
};

}  // namespace ressort::realtime
