// app/realtime: everything that the audio thread touches.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "app/realtime/controllers.h"
#include "app/realtime/dsp_load.h"
#include "app/realtime/flight_record.h"
#include "app/realtime/lockfree.h"
#include "app/realtime/midi.h"
#include "app/realtime/motion.h"
#include "app/realtime/song_clock.h"
#include "app/realtime/tick_clock.h"
#include "core/engine/dc_blocker.h"
#include "core/engine/engine.h"
#include "core/engine/limiter.h"

namespace ressort::realtime {

// An engine and the serial that its events carry. An engine with the serial of the current one,
// unless that is 0, continues the current one's state in the same sample.
struct PlayingEngine {
  std::unique_ptr<Engine> engine;
  std::uint32_t serial = 0;
  bool lets_ring = false;        // the previous engine gets no new notes and rings out
  bool has_new_numbers = false;  // state is continued by Engine::renumber_from()
  std::uint32_t number = 0;      // number of the engine in the flight
  std::uint32_t picture = 0;     // identifies the picture that the panel draws; 0: none
};

// An event on its way to the audio thread, with its time.
struct TimedEvent {
  enum class When : std::uint8_t {
    now,       // at the start of the next block
    at_frame,  // `when` is a frame of the process's own count
    at_time,   // `when` is a time of the monotonic clock in ns; the event acts one period later
  };
  Event event;
  When timing = When::now;
  std::int64_t when = 0;
};

// A MIDI packet of the current block, from a backend with exact frames.
struct MidiPacket {
  std::uint32_t frame = 0;
  std::span<const std::uint8_t> bytes;
};

// A message from the audio thread to the worker.
struct Report {
  enum class Kind : std::uint8_t { parameter, controller, reset, overload, program, action, heard };
  Kind kind = Kind::reset;
  std::uint32_t model = 0;  // serial of the model; of a controller that was heard, its channel
  // Parameter, controller, number of voices that there is time for (0: unlimited), or row of an
  // action.
  std::uint16_t index = 0;
  double value = 0.0;  // value of the parameter, or the load, or 128 * bank + program
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

// Recorded sound, played back unchanged.
struct SampleTape {
  std::size_t channels = 2;
  std::vector<float> samples;  // interleaved
  std::size_t frames() const { return samples.size() / channels; }
};

// The state of the audio thread after each block, and the counters of other threads. Resets, stolen
// voices and changed parameters are sums over all engines so far.
struct Meters : EngineMeters {
  std::uint64_t frames = 0;       // since the start
  double load = 0.0;              // mean load of about the last second; 1 is all of the time
  double cpu_peak = 0.0;          // highest load of one block since the last reading
  std::uint64_t overruns = 0;     // blocks that took longer than their duration
  std::uint64_t late = 0;         // events that came after their time
  double late_s = 0.0;            // delay of the last late event
  std::uint64_t malformed = 0;    // unreadable MIDI messages
  std::uint64_t swaps = 0;        // changes of the engine
  std::uint64_t record_lost = 0;  // chunks that the recording lost
  double peak = 0.0;              // peak of the output since the last reading, linear
  double limited = 1.0;           // lowest gain of the limiter since the last reading, linear
  std::uint64_t dropped = 0;      // events that found a queue full
  std::uint64_t strangers = 0;    // OSC packets from senders that are not allowed
  std::uint64_t xruns = 0;        // reported by the backend
  std::uint64_t notes = 0;        // note-ons so far, from any source
  std::array<PlayedNote, 4> last_notes{};  // the latest notes; note n is at n modulo 4
  double tempo = 0.0;  // beats per minute of a MIDI clock or of JACK; 0: no clock so far
  SongPlace song;      // of the clock or of JACK
};

struct Process {
  static constexpr std::size_t chunk_frames = 512;  // longest block that an engine gets
  static constexpr std::size_t max_channels = 64;   // limit for a model
  static constexpr std::size_t max_now = 4096;      // events of one source in one block
  static constexpr std::size_t max_endings = 1024;  // places kept free for events that end sound
  static constexpr std::size_t max_ahead = 4096;    // events that wait for their frame
  static constexpr double fade_s = 0.05;            // crossfade between two models
  static constexpr double longest_strobe_s = 0.1;   // longest wait for a frame of the stroboscope
  // the output is kept for this long after a motion frame
  static constexpr double looked_for_s = 1.0;
  // longest time that the model before a program change rings
  static constexpr double longest_ring_s = 60.0;

  // A monotonic clock in ns that makes no system call.
  using Clock = std::int64_t (*)();

  // Without a clock, the load is not measured and no voice is stolen, as in offline rendering.
  explicit Process(double rate_hz, bool limit = true, Clock clock_ns = nullptr);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  // Plays one block of any number of frames. `inputs` may contain null channels. `time_ns` is the
  // monotonic clock at the first frame. [audio] wait-free
  void block(std::span<const float* const> inputs, std::span<float* const> outputs,
             std::size_t frames, std::span<const MidiPacket> midi, std::int64_t time_ns) noexcept;

  // The same for buffers in double precision, which the offline renderer uses. [audio]
  void block(std::span<const double* const> inputs, std::span<double* const> outputs,
             std::size_t frames, std::span<const MidiPacket> midi, std::int64_t time_ns) noexcept;

  // Returns the messages to controllers after a block, valid until the next one. [audio] wait-free
  std::span<const MidiBytes> midi_out() const { return midi_out_; }

  // Schedules an event for a frame of the process's own count; false if the queue is full. Offline
  // only, when no other thread calls block(). [audio]
  bool schedule(std::int64_t frame, const Event& event);

  // Sends events that act together in the next block, all or none. Events that end sound find room
  // when the queue is full for others. Rejected events are counted. [the ring's one writer]
  // wait-free
  bool send(Ring<TimedEvent>& ring, std::span<const TimedEvent> events);

  // Sends events for given frames. They wait in a queue of their own; a panic before their time
  // discards them. [OSC's thread] wait-free
  bool send_ahead(std::span<const TimedEvent> events);

  // Sets JACK's transport for the next block. The transport and a MIDI clock replace each other's
  // tempo when theirs changes. [audio] wait-free
  void set_transport(const Transport& now) { transport_ = now; }

  // Applies a record of a flight before the block that it belongs to; block() then reproduces the
  // original samples. Offline only, for one whole flight, chunk by chunk. [audio]
  void repeat(const FlightRecord& record);

  // Call it when no audio thread runs. [control]
  void set_rate(double rate_hz);

  Meters meters() const;  // [any thread but audio]

  // --- shared with other threads --------------------------------------------------------------
  Slot<PlayingEngine> slot;  // offered by the session's worker
  // Written by send() and send_ahead().
  Ring<TimedEvent> from_osc{max_now + max_endings + max_ahead};
  Ring<TimedEvent> from_console{max_now + max_endings};
  Ring<TimedEvent> from_midi{max_now + max_endings};     // written by RtMidi's thread
  Ring<TimedEvent> from_session{max_now + max_endings};  // written by the session's worker
  TripleBuffer<ControllerMap> controllers{
      ControllerMap{}};                  // written by the session, under its lock
  Ring<Report> reports{4096};            // read by the session's worker
  Flag hears_controllers;                // reports every controller message, before the mapping
  Ring<MidiBytes> to_controllers{1024};  // messages to controllers, for RtMidi
  Flag has_midi_out;                     // somebody reads them
  Ring<RecordedChunk> recording{8192};
  Flag is_recording;
  Ring<RecordedChunk> listening{1024};  // read by the timbre analysis
  Flag is_listening;
  Published<const SampleTape*> tape;  // replaces the output of the engines
  Flag is_tape_over;
  Ring<FlightRecord> flight{1 << 14};  // read by the session's worker
  Flag keeps_flight;
  Flag wants_motion;       // requests one motion frame after the next block
  Flag wants_slow_motion;  // the same, at the next phase of the stroboscope
  TripleBuffer<MotionFrame> motion{MotionFrame{}};
  SeqLock<ClockReading> clock;
  SeqLock<Meters> board;  // read by meters()
  Flag meters_were_read;  // raised by a reader; the peaks start again at the next block
  Flag has_time;          // offline or freewheel: no voice is stolen, every event acts at its frame
  Counter dropped;        // counters of Meters, increased by any thread
  Counter strangers;
  Counter xruns;

 private:
  struct Pending {
    std::int64_t frame = 0;
    std::uint64_t order = 0;  // order of arrival, for events of the same frame
    Event event;
  };

  template <class Sample>
  void run(std::span<const Sample* const> inputs, std::span<Sample* const> outputs,
           std::size_t frames, std::span<const MidiPacket> midi, std::int64_t time_ns);
  void collect_events(std::size_t frames, std::span<const MidiPacket> midi, std::int64_t time_ns);
  void read_ring(Ring<TimedEvent>& ring, std::size_t frames, std::int64_t time_ns);
  void add_now(std::int64_t frame, const Event& event);
  void add_pending(std::int64_t frame, const Event& event);
  void discard_after(std::int64_t frame);
  void collect_due(std::size_t frames);
  void count_event(const Event& event);
  bool follow_tempo(Event& event, std::int64_t frame);
  bool map_controller(Event& event, std::int64_t frame);
  void follow_present_values();
  void play_models(std::size_t input_count, std::size_t output_count, std::size_t frames);
  void play(PlayingEngine& sounding, std::size_t input_count, std::vector<double>& samples,
            std::size_t frames);
  void swap_models();
  bool is_ringing() const;
  void follow_banks(const Event& event);
  bool continues_current(const PlayingEngine& next) const;
  void publish_meters();
  void limit_load(double took_s, std::size_t frames);
  void record(std::size_t channels, std::size_t frames, bool records, bool listens);
  void log_record(const FlightRecord& record);
  void log_period(std::size_t frames, std::size_t channels);
  void end_fade_early();
  void play(const SampleTape& tape, std::size_t output_count, std::size_t frames);
  PlayingEngine* take_next_engine();
  void keep_output(std::size_t channels, std::size_t frames);
  void write_motion();
  void publish_motion();

  double rate_hz_;
  bool limit_;
  Clock clock_ns_;
  DspLoad load_;
  std::int64_t frame_ = 0;  // frame of the next sample
  std::uint64_t order_ = 0;
  MidiReader midi_;
  TickClock tick_clock_;
  SongClock song_clock_;
  double tempo_ = 0.0;                  // beats per second; 0: no clock so far
  Transport transport_;                 // of JACK
  double known_transport_tempo_ = 0.0;  // the last one that became an event
  PlayingEngine* current_ = nullptr;
  PlayingEngine* fading_ = nullptr;
  PlayingEngine* waiting_ = nullptr;  // follows when the ringing engine has faded out
  std::size_t fade_left_ = 0;
  bool rings_ = false;            // `fading_` rings on and does not fade yet
  std::int64_t rings_until_ = 0;  // frame
  bool is_alone_ = false;         // the current engine started at full level
  std::size_t fade_frames_ = 0;
  Meters meters_;
  std::array<int, 16> banks_{};          // [MIDI channel] 14 bits
  EngineMeters ended_;                   // counters of the engines before the current one
  std::int64_t next_overload_news_ = 0;  // frame
  DcBlocker dc_blocker_;
  Limiter limiter_;
  // No vector below ever grows.
  std::vector<Pending> now_;      // events of this block, sorted
  std::size_t next_now_ = 0;      // first of them that has not acted yet
  std::vector<Pending> pending_;  // events for later frames: a heap, the earliest on top
  std::int64_t latest_ = 0;       // no pending frame is later
  Permits ahead_{max_ahead};  // free places in `pending_`, counting the events on their way to it
  bool keeps_every_frame_ = false;
  bool is_repeating_ = false;
  std::size_t tape_at_ = 0;  // frame
  // State of the flight log: the values that were recorded last.
  bool has_gap_ = false;
  double kept_rate_hz_ = 0.0;
  std::size_t kept_frames_ = 0;
  std::size_t kept_channels_ = 0;
  ControllerMapper mapper_;
  std::span<const MidiBytes> midi_out_;
  std::vector<Event> due_;       // events of this chunk, sorted
  std::vector<Event> matching_;  // the ones that concern one engine
  std::array<const double*, max_channels> input_pointers_{};
  std::vector<double> input_;       // [channel][chunk_frames]
  std::vector<double> sound_;       // [channel][chunk_frames] output of the current engine
  std::vector<double> fade_sound_;  // [channel][chunk_frames] output of the fading engine
  std::vector<double> mixed_;       // [output][chunk_frames]
  // Ring of the latest output, filled while somebody watches the motion.
  std::array<float, MotionFrame::heard_samples> heard_{};
  std::size_t heard_at_ = 0;          // position of the next sample
  std::int64_t looked_until_ = 0;     // frame
  PlayingEngine* strobed_ = nullptr;  // engine from which a stroboscope frame was requested
  std::int64_t strobed_until_ = 0;    // frame
};

}  // namespace ressort::realtime
