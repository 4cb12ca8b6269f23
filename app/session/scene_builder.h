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
#include "app/session/wisdom.h"
#include "app/session/work_queue.h"
#include "core/compile/compile.h"
#include "core/model/preset/controllers.h"

namespace ressort::session {

struct SessionOptions {
  CompileOptions compile;                           // its rate is the backend's
  double gain = 1.0;                                // factor on every preset's gain
  std::optional<ThirdArgument> third;               // overrides every model's own meaning
  KeyOptions keys;                                  // overrides every preset's tuning
  std::vector<ControllerSetting> controllers = {};  // the user's mapping
  std::string controllers_path = {};                // its file, to which learned rows are written
  bool watch = false;          // reload the playing scene when its files change
  bool keeps_flights = false;  // records flights and saves them after problems
  // The clock that measures forms, and the file that keeps the results. Without a clock no form is
  // measured, and without a file no result is kept.
  decltype(Timings::time) time = {};
  std::string wisdom_path = {};
};

// A scene that was read and not yet compiled.
struct Draft {
  Scene scene;
  std::shared_ptr<const std::vector<SceneFile>> files;
  std::vector<Setting> kept;     // present parameter values, which override the texts'
  bool continues_state = false;  // sounding voices continue if the engines have the same structure
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

  // Compiles the playing scene again, if it may become cheaper: with more modes, for which the
  // first load limits the time, and with all forms measured that may be the cheapest. If the new
  // plan has other forms, the new engine continues the old one's state.
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
  Wisdom wisdom_{options_.wisdom_path};
  Timings recalled_{.time = {},  // results of earlier measurements
                    .recall = [this](const std::string& key) { return wisdom_.recall(key); },
                    .keep = {}};
  Timings timings_{.time = options_.time,  // results of earlier and new measurements
                   .recall = recalled_.recall,
                   .keep = [this](const std::string& key, double ns) { wisdom_.keep(key, ns); }};
};

}  // namespace ressort::session
