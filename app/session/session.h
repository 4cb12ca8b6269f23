// app/session: the control side of the program: loads and saves scenes, and answers what plays.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "app/realtime/peaks.h"
#include "app/realtime/process.h"
#include "app/session/current_scene.h"
#include "app/session/engine_supply.h"
#include "app/session/flight/flight_recorder.h"
#include "app/session/scene_builder.h"
#include "app/session/song.h"
#include "app/session/timbre/timbre_watch.h"
#include "app/session/watch/scene_watch.h"
#include "app/session/work_queue.h"
#include "app/session/worker.h"

namespace ressort::session {

// The state of the program and its cost, at one moment.
struct Status : Meters {
  std::string model;
  std::string backend;
  double rate_hz = 0.0;
  std::int64_t period_frames = 0;
  double load_ms = 0.0;
  int max_voices = 0;
  double cpu = 0.0;         // mean load of the last second; -1: no backend runs
  double peak_db = 0.0;     // since the reader's last reading; -inf is silence
  double limited_db = 0.0;  // lowest gain of the limiter since then
};

// All functions: [any thread but audio].
class Session {
 public:
  using Answer = std::function<void(const Result<std::shared_ptr<const Loaded>>&)>;
  using Present = CurrentScene::Present;
  using PictureOf = EngineSupply::PictureOf;

  // `on_message` receives messages about unrequested events, such as an unstable voice, on the
  // worker's thread. The process must outlive the session.
  Session(Process& process, const SessionOptions& options, MessageHandler on_message);
  ~Session();

  // Loads a scene in the worker and calls `answer` there, with the loaded scene or with the whole
  // text of the error. After an error, the playing scene continues. It is an error if the scene is
  // unstable and not forced, or if a newer load replaces this one. After end(), `answer` is called
  // at once with an error.
  void load(std::string name, Answer answer, bool force = false, Reach reach = Reach::any_file);
  Result<std::shared_ptr<const Loaded>> load_and_wait(const std::string& name, bool force = false);

  // Tunes a mode of the playing scene to a frequency and a decay, and loads the result: a new model
  // in the user's cache, and the preset with its present values. It can be undone like a load.
  // save() keeps the model. Answers like load().
  void tune(TuneTarget target, Answer answer);

  // Finds the lowest modes of the playing scene with its present values, and calls `answer` in the
  // worker. A load interrupts it.
  using ModesAnswer = std::function<void(const Result<KnownModes>&)>;
  void find_modes(std::size_t count, ModesAnswer answer);

  // Adjusts parameters of the playing scene to a target timbre, or the nearest one, at the key
  // played last, and calls `answer` in the worker. It is one change, which can be undone. A load
  // interrupts it.
  using ShapeAnswer = std::function<void(const Result<Shaped>&)>;
  void shape(std::vector<TimbreTarget> targets, ShapeAnswer answer);

  // The preset after the one that was asked for last, with a step of 1, or before it, with -1.
  std::string preset_beside(int step) const;

  // Compiles the playing scene again for the backend's new rate.
  void set_rate(double rate_hz) { queue_.set_rate(rate_hz); }

  // Cancels all loads and inquiries, because the program is ending. Returns at once.
  void end() { queue_.end(); }
  // Returns true after this time, or false as soon as the program ends.
  bool wait(std::chrono::duration<double> time) { return queue_.wait(time); }

  // The playing scene; never null. Before the first load, it has no name and no parameters.
  std::shared_ptr<const Loaded> current() const { return current_.loaded(); }
  Present present() const { return current_.present(); }
  // The present value of a parameter, if the model has it.
  std::optional<double> parameter(const std::string& name) const {
    return current_.parameter(name);
  }
  // Records parameter events that a queue has accepted.
  void remember(std::span<const TimedEvent> events) { current_.remember(events); }
  // Returns the last change of parameters or of the scene, and forgets it. Changes of the same
  // parameters within a second are one.
  std::optional<LastChange> take_last_change() { return current_.take_last_change(); }

  // MIDI learn: the next knob that is turned controls the preset's knob of this name, this
  // parameter, or the control with this OSC name, instead of its other function. Its kind is
  // recognised. Pedals, bank select and the like do not count. The row is reported to `on_message`
  // and written to the mapping.
  Result<Done> learn(const std::string& target) { return current_.learn(target); }
  // Forgets the controllers of this target, or all learned ones if it is empty. Returns how many.
  Result<std::size_t> unlearn(const std::string& target) { return current_.unlearn(target); }
  std::optional<std::string> waiting_target() const { return current_.waiting_target(); }
  std::vector<MappedRow> mapping() const { return current_.mapping(); }

  // Saves the playing scene with its present values as a preset of the user, and returns its path.
  // See path_to_save(). A name that exists, even as a preset of the program, needs
  // Existing::replace.
  Result<std::string> save(const std::string& name, Existing existing);
  // Saves it to a folder with copies of all its files, and returns the preset's name there.
  // Overwrites existing files.
  Result<std::string> save_to(const std::string& folder);

  // The tuning files that override the preset's tuning; empty if there are none.
  std::vector<std::string> tuning() const;
  void set_tuning(std::vector<std::string> paths);

  Status status(MeterReader asker = MeterReader::console);
  // Sets the description of the backend, or of what the program waits for.
  void set_backend(std::string description, bool runs);

  TimbreWatch& timbre() { return timbre_; }
  Song& song() { return song_; }

  Reload last_reload() const { return watch_.last_reload(); }

  // Writes everything played since the start, to be reproduced bit by bit. Returns the path.
  Result<std::string> write_flight(const std::string& path, Existing existing) {
    return flights_.write(path, existing);
  }
  // Saves it in the user's folder under a new name.
  Result<std::string> save_flight(const std::string& name) { return flights_.save(name); }

  // Sets functions that the worker calls before it offers an engine: one chooses what the panel
  // draws of it, the other gets the number of its audio inputs.
  void on_engine(PictureOf picture_of) { engines_.on_engine(std::move(picture_of)); }
  void on_audio_inputs(std::function<void(int)> prepare) {
    engines_.on_audio_inputs(std::move(prepare));
  }

 private:
  Process& process_;
  const SessionOptions options_;
  WorkQueue queue_;
  CurrentScene current_;
  FlightRecorder flights_;
  EngineSupply engines_;
  SceneWatch watch_;
  TimbreWatch timbre_;
  Song song_;

  mutable std::mutex mutex_;  // guards the four below
  Peaks peaks_;
  std::string backend_;
  bool backend_runs_ = false;
  std::vector<std::string> tuning_;

  Worker worker_;  // last, so that it ends first
};

}  // namespace ressort::session
