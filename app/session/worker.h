// app/session: the worker thread: loads, reloads, analyses, and reads the audio thread's reports.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "app/session/current_scene.h"
#include "app/session/flight/flight_recorder.h"
#include "app/session/modes/known_modes.h"
#include "app/session/problem_reports.h"
#include "app/session/scene_builder.h"
#include "app/session/timbre/shape.h"
#include "app/session/watch/scene_watch.h"
#include "app/session/work_queue.h"

namespace ressort::session {

class Worker {
 public:
  // Starts the thread. It ends after queue.end(), and the destructor waits for it.
  Worker(Process& process, const SessionOptions& options, MessageHandler on_message,
         WorkQueue& queue, CurrentScene& current, FlightRecorder& flights, EngineSupply& engines,
         SceneWatch& watch);
  ~Worker();

  // Answers to inquiries. See Session. [worker]
  Result<KnownModes> find_modes(std::size_t count);
  Result<Shaped> shape(const std::vector<TimbreTarget>& targets);

 private:
  void run();
  void load(const LoadJob& job);
  void rebuild_at_new_rate();
  void read_reports();
  void change_program(int number);
  void load_preset(const std::string& name, const std::string& reason);
  void press(const std::string& action);

  // Reloads the playing scene after an edit.
  void reload();
  Result<std::string> apply_edit(Draft draft);
  // Loads the playing scene again with these parameter values, so that its keys are tuned for them.
  Result<Done> retune(std::vector<Setting> values, const Progress& progress);
  // Changes parameters as a player does.
  bool send(const std::vector<TimedEvent>& events);

  // Stops inquiries and reloads when a load is waiting.
  Progress interruptible() const;
  // Reads the playing scene from its files again.
  Result<Scene> read_current(const CurrentScene::Present& now, const Progress& progress) const;
  // Writes the tuned model and preset to the cache. Returns the request to load them.
  Result<LoadRequest> write_tuned(const TuneTarget& target);
  double model_rate_hz() const;

  Process& process_;
  const SessionOptions& options_;
  MessageHandler on_message_;
  WorkQueue& queue_;
  CurrentScene& current_;
  FlightRecorder& flights_;
  EngineSupply& engines_;
  SceneWatch& watch_;
  SceneBuilder builder_;
  ProblemReports problems_;
  std::optional<LoadRequest> loaded_;  // the last successful load
  std::set<int> unknown_programs_;     // already reported
  std::thread thread_;                 // last, so that all else exists when it starts
};

}  // namespace ressort::session
