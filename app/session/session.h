// app/session: the control side. Owns what is loaded and the worker thread that loads, compiles,
// offers, and destroys what has sounded.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "app/realtime/peaks.h"
#include "app/realtime/process.h"
#include "app/realtime/rate_limit.h"
#include "app/session/flight/flight.h"
#include "app/session/loader.h"
#include "app/session/modes/known_modes.h"
#include "app/session/timbre/shape.h"
#include "app/session/timbre/timbre_watch.h"
#include "app/session/watch/file_watch.h"
#include "core/analysis/modes/tune.h"
#include "core/compile/compile.h"

namespace ressort::session {

struct SessionOptions {
  CompileOptions compile;              // its rate is the backend's
  double gain = 1.0;                   // on top of every preset's
  std::optional<ThirdArgument> third;  // of every model, whatever it shows
  KeyOptions keys;                     // instead of every preset's
  bool watch = false;                  // what sounds is read again when its files change
  bool keeps_flights = false;          // of what it plays; saved when something goes wrong
};

// What sounds now, as people see it. Never changes once published.
struct Loaded {
  std::uint32_t serial = 0;
  std::string name;
  std::string path;
  std::string model_path;
  std::string description;
  Preset preset;
  std::string preset_text;  // what it was read from; empty: it was made up
  Instrument instrument;
  Plan plan;
  double load_ms = 0.0;  // read, parse, compile
  std::vector<std::string> warnings;
};

// What sounds and what it costs, at one moment.
struct Status : Meters {
  std::string model;
  std::string backend;
  double rate_hz = 0.0;
  std::int64_t period_frames = 0;
  double load_ms = 0.0;
  int max_voices = 0;
  double cpu = 0.0;         // share of the time there is, over a second; -1: nothing runs
  double peak_db = 0.0;     // since the asker's last asking; -inf is silence
  double limited_db = 0.0;  // the limiter's deepest cut since the last asking
};

// A controller and what it was taught to turn: a parameter, or a control's OSC name.
struct LearnedRow {
  int controller = 0;
  std::string target;
};

// What came of the last reading of changed files.
struct Reload {
  std::uint64_t count = 0;  // of all of them; 0: there was none
  bool is_done = true;
  std::string news;  // what has changed; or what is wrong, with each line and a caret below it
};

// What can be taken back: parameters as they were before, and before that what was loaded.
struct LastChange {
  std::optional<std::string> scene;
  std::vector<std::pair<std::string, double>> values;
};

class Session {
 public:
  using Answer = std::function<void(const Result<std::shared_ptr<const Loaded>>&)>;
  using Tell = std::function<void(const std::string&)>;

  // `tell` gets what happens by itself, such as a voice that became unstable; on the worker's
  // thread. The process must outlive the session.
  Session(Process& process, const SessionOptions& options, Tell tell);
  ~Session();

  // Loads in the worker; `answer` is called there, with what sounds now or with the error's whole
  // text. On an error what sounded goes on. [any thread but audio]
  // What is not stable is such an error, unless it is forced; so is a load that a newer one
  // replaces, and one that comes after end(), which is answered at once.
  void load(std::string name, Answer answer, bool force = false, Reach reach = Reach::any_file);

  // The same, waiting for it.
  Result<std::shared_ptr<const Loaded>> load_and_wait(const std::string& name, bool force = false);

  // Brings a mode of what sounds to a frequency and a decay, and loads what came of it: a model of
  // its own in the user's cache, and the preset as it is now. Taken back as a load is; save() keeps
  // the model too. The same promises as load(). [any thread but audio]
  void tune(TuneTarget target, Answer answer);

  // Finds the lowest modes of what sounds, as it is now, in the worker, where `answer` is called;
  // gives way to a load. [any thread but audio]
  using ModesAnswer = std::function<void(const Result<KnownModes>&)>;
  void find_modes(std::size_t count, ModesAnswer answer);

  // Turns parameters of what sounds so that it has this timbre, or comes nearest, at the key that
  // was played last; in the worker, where `answer` is called. One change, that can be taken back.
  // Gives way to a load. [any thread but audio]
  using ShapeAnswer = std::function<void(const Result<Shaped>&)>;
  void shape(std::vector<TimbreTarget> targets, ShapeAnswer answer);

  // The backend runs at another rate: what sounds is compiled anew.
  void set_rate(double rate_hz);

  // Gives up what is being loaded, and all that waits: the program is ending. Returns at once.
  // [any thread but audio]
  void end();

  // Returns when so much time has passed: true; or, at once, when the program is ending.
  // [any thread but audio]
  bool wait(std::chrono::duration<double> time);

  // Never null; before the first load it has no name and no parameters.
  std::shared_ptr<const Loaded> current() const;

  // What sounds and all its parameters' values, at one moment.
  struct Present {
    std::shared_ptr<const Loaded> loaded;
    std::vector<double> values;  // [parameter]
  };
  Present present() const;

  // A parameter's present value; nothing where the model has none of that name.
  std::optional<double> parameter(const std::string& name) const;

  // What parameters these events set, once a queue has taken them. [any thread but audio]
  void remember(std::span<const TimedEvent> events);

  // The change of parameters, by whomever, or of the scene that was last made; it is forgotten
  // here. Turns of the same parameters within a second are one. [any thread but audio]
  std::optional<LastChange> take_last_change();

  // The next knob that moves, a controller but for pedals, banks and the like, turns the parameter,
  // or the control of that OSC name, from then on, whatever the preset says; `tell` hears which it
  // is. Lasts until another scene is loaded. [any thread but audio]
  Result<Done> learn(const std::string& target);
  // Forgets what has learnt to turn it; of all, where there is no target. How many that were.
  std::size_t unlearn(const std::string& target);
  std::vector<LearnedRow> learned() const;

  // Writes what sounds, as it is now, to a preset of the user's; its path. See path_to_save(). A
  // name that is there already, the program's own included, needs Existing::replace. [any thread
  // but audio]
  Result<std::string> save(const std::string& name, Existing existing);

  // The same to a folder, with copies of all texts that it is read from; the preset's name there.
  // Replaces what is there.
  Result<std::string> save_to(const std::string& folder);

  // The files that all keys were tuned by, whatever the preset says; none: they were not.
  std::vector<std::string> tuning() const;
  void set_tuning(std::vector<std::string> paths);

  Status status(Asker asker = Asker::console);

  // What it sounds like; it makes promises of its own.
  TimbreWatch& timbre() { return timbre_; }

  // What plays, or what is waited for; set by whoever starts a backend.
  void set_backend(std::string description, bool runs);

  Reload last_reload() const;  // [any thread but audio]

  // Writes what was played since the program began, to be played back bit by bit; its path. The
  // error says why it is not known, or what is in the way. [any thread but audio]
  Result<std::string> write_flight(const std::string& path, Existing existing);
  // The same to the user's own flights, by a name that is not there yet.
  Result<std::string> save_flight(const std::string& name);
  // Called in the worker before an engine is offered, with the network that it was made of: chooses
  // what is watched of it; its number comes back, Sounding::picture.
  using PictureOf = std::function<std::uint32_t(Engine& engine, const Network& network)>;
  void on_engine(PictureOf picture_of);

  // Called in the worker before an engine is offered, with the number of its audio inputs.
  void on_audio_inputs(std::function<void(int)> prepare);

 private:
  // A scene, and how far its name may lead.
  struct Wish {
    std::string name;
    bool force = false;
    Reach reach = Reach::any_file;
    bool lets_ring = false;            // what sounds until it ends by itself
    std::optional<TuneTarget> target;  // of what sounds, which is loaded anew with it
  };

  struct Job {
    Wish wish;
    Answer answer;
  };

  // About what sounds; a load goes before it.
  struct Inquiry {
    std::function<void()> work;  // answers
    std::function<void(const Error&)> refuse;
  };

  // What sounds, to be compiled once more with more patience.
  struct Source {
    Network network;
    Preset preset;
    CompileOptions options;
    FlightEngine made_of;
  };

  // What was read, before it is compiled.
  struct Draft {
    Scene scene;
    std::shared_ptr<const std::vector<SceneFile>> files;
    std::vector<Setting> kept;  // values that parameters have, in place of the texts'
    bool goes_on = false;       // as what sounds, if it is alike
    std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  };

  void work();
  void do_load(const Job& job);
  void do_again();
  void inquire(Inquiry inquiry);
  void answer(const Inquiry& inquiry);
  // What sounds as its files have it, and its numbers as they are.
  Result<Scene> scene_now(const Present& now, const Progress& progress) const;
  Result<KnownModes> modes_now(std::size_t count);
  Result<Shaped> shape_now(const std::vector<TimbreTarget>& targets);
  Result<Wish> write_tuned(const TuneTarget& target);
  // The preset of what sounds as it is now, with its model by another name.
  Result<std::string> preset_text(const std::string& model) const;
  Result<std::shared_ptr<const Loaded>> build(const Wish& wish);
  Result<std::shared_ptr<const Loaded>> build_now(const Wish& wish, const Progress& progress);
  SceneOptions scene_options(const Wish& wish, const Progress& progress) const;
  Result<std::shared_ptr<const Loaded>> sound(const Wish& wish, Draft draft,
                                              const Progress& progress);
  void follow(const std::vector<SceneFile>& files);
  void do_reload();
  Result<std::string> reload(Draft draft);
  // What sounds, read again, with these numbers instead of its own and its keys tuned to them: a
  // change that can be taken back.
  Result<Done> retune(std::vector<Setting> values, const Progress& progress);
  void turn(const std::vector<Setting>& settings);
  void look_out(const Meters& now);
  void improve();
  // Whether somebody wants something else of the worker; a load gives way to a newer one only.
  bool is_outdated(bool is_load) const;
  bool has_new_rate() const;  // under the lock
  // Hands the engine over; its parts are timed when nobody waits any more.
  void offer(std::unique_ptr<Engine> engine, const Network& network, FlightEngine made_of);
  void time_parts();
  void listen();
  void change_program(int number);
  void hear_turns(const Meters& now);
  // All of these under the lock.
  void teach(const LearnedRow& row, bool is_on);
  void begin_change(const std::vector<std::string>& names);
  LearnedControl control_of(const std::string& target) const;
  std::string describe_overload(const Report& report) const;
  Process& process_;
  SessionOptions options_;
  Tell tell_;

  mutable std::mutex mutex_;  // everything below; never near the audio thread
  Peaks peaks_;
  std::condition_variable wake_;
  std::deque<Job> jobs_;
  std::deque<Inquiry> inquiries_;
  bool stop_ = false;
  double rate_hz_;
  double built_rate_hz_;  // what sounds was made for, or was tried to be
  std::shared_ptr<const Loaded> current_;
  std::vector<double> values_;  // of the current parameters
  std::vector<LearnedRow> learned_;
  std::optional<std::string> pupil_;  // waits for a controller to move
  std::uint64_t turns_ = 0;           // of controllers, that there were before
  std::optional<LastChange> last_change_;
  std::chrono::steady_clock::time_point changed_;
  std::string backend_;
  bool runs_ = false;  // the backend
  std::function<void(int)> prepare_inputs_;
  Reload reload_;
  FlightLog flight_;
  std::vector<std::string> tuning_;
  std::shared_ptr<const std::vector<SceneFile>> files_;  // of what sounds
  PictureOf picture_of_;

  std::uint32_t serial_ = 0;         // [worker]
  std::optional<Wish> scene_;        // [worker] what was loaded last
  const Engine* offered_ = nullptr;  // [worker] until the next is offered
  std::optional<Source> source_;     // [worker] of what may be improved
  std::set<int> unknown_programs_;   // [worker] that were told
  std::optional<FileWatch> watch_;   // [worker]
  bool is_edited_ = false;           // [worker] whatever the watch says
  std::optional<Scene> read_;        // [worker] what sounds, as it was read; where it is watched
  std::uint32_t engines_ = 0;        // [worker] so many were offered
  std::uint64_t resets_seen_ = 0;    // [worker]
  std::uint64_t xruns_seen_ = 0;     // [worker] a second ago
  int saved_flights_ = 0;            // [worker] by itself
  std::chrono::steady_clock::time_point last_look_;    // [worker] at the xruns
  std::chrono::steady_clock::time_point last_flight_;  // [worker] that was saved by itself
  RateLimit resets_;                                   // [worker] all of these
  RateLimit overloads_{std::chrono::seconds(10)};
  RateLimit lates_;
  RateLimit drops_;
  std::uint64_t late_reported_ = 0;
  std::uint64_t dropped_reported_ = 0;
  TimbreWatch timbre_{process_};
  std::thread worker_;  // last, so that it ends first
};

}  // namespace ressort::session
