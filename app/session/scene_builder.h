// app/session: reads and compiles scenes in the worker, and plays them.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/session/current_scene.h"
#include "app/session/engine_supply.h"
#include "app/session/load_progress.h"
#include "app/session/watch/scene_watch.h"
#include "app/session/work_queue.h"
#include "core/compile/compile.h"

namespace ressort::session {

struct SessionOptions {
  CompileOptions compile;              // its rate is the backend's
  double gain = 1.0;                   // factor on every preset's gain
  std::optional<ThirdArgument> third;  // overrides every model's own meaning
  KeyOptions keys;                     // overrides every preset's tuning
  bool watch = false;                  // reload the playing scene when its files change
  bool keeps_flights = false;          // record flights and save them after problems
};

// A scene that was read and not yet compiled.
struct Draft {
  Scene scene;
  std::shared_ptr<const std::vector<SceneFile>> files;
  std::vector<Setting> kept;     // present parameter values, which override the texts'
  bool continues_state = false;  // sounding voices continue if the engines are alike
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
};

// All functions: [worker].
class SceneBuilder {
 public:
  SceneBuilder(const SessionOptions& options, MessageHandler on_message, WorkQueue& queue,
               CurrentScene& current, EngineSupply& engines, SceneWatch& watch);

  // Reads, compiles and plays a scene. On an error the playing scene continues.
  Result<std::shared_ptr<const Loaded>> load(const LoadRequest& request);
  // Reads the files of a scene.
  Result<Draft> read(const LoadRequest& request, const Progress& progress) const;
  // Compiles and plays a draft.
  Result<std::shared_ptr<const Loaded>> play(const LoadRequest& request, Draft draft,
                                             const Progress& progress);
  SceneOptions scene_options(const LoadRequest& request, const Progress& progress) const;

  // Compiles the playing scene again with more modes, if it may become cheaper: the first load
  // limits the time that it takes to find modes. The new engine continues the old one's state.
  bool can_improve() const { return improvable_.has_value(); }
  void improve();

  // Measures the cost of the playing scene's parts, which `status` and `explain` show.
  void measure_parts();

 private:
  struct Prepared;
  // Inputs of another compilation of the playing scene.
  struct Improvable {
    Network network;
    Preset preset;
    CompileOptions options;
    FlightEngine made_of;
  };
  Prepared prepare(const LoadRequest& request, Draft draft, const Progress& progress) const;

  const SessionOptions& options_;
  MessageHandler on_message_;
  WorkQueue& queue_;
  CurrentScene& current_;
  EngineSupply& engines_;
  SceneWatch& watch_;
  std::optional<Improvable> improvable_;
};

}  // namespace ressort::session
