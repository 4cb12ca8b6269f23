// app/session: the playing scene with a player's changes: parameters, undo, mapped controllers.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "app/realtime/process.h"
#include "app/session/knob_learner.h"
#include "app/session/loader.h"
#include "core/compile/compile.h"
#include "core/model/preset/controllers.h"

namespace ressort::session {

// A loaded scene as people see it. Immutable once published.
struct Loaded {
  std::uint32_t serial = 0;
  std::string name;
  std::string path;
  std::string model_path;
  std::string description;
  Preset preset;
  std::string preset_text;  // empty if the preset was generated
  Instrument instrument;
  Plan plan;
  double load_ms = 0.0;  // time to read, parse and compile it
  std::vector<std::string> warnings;
};

// A controller of the mapping, and what it does in the playing scene.
struct MappedRow {
  ControllerSetting setting;
  bool is_learned = false;  // since the start
  bool exists = false;      // false: the scene has no such parameter or control
};

// A change that can be undone: the previous values of parameters, after loading `scene` if there is
// one.
struct LastChange {
  std::optional<std::string> scene;
  std::vector<std::pair<std::string, double>> values;
};

// A controller that was learned, and the reason why it could not be written to the mapping.
struct Learned {
  ControllerSetting setting;
  std::optional<Error> failure;
};

// All functions: [any thread but audio], unless they say otherwise.
class CurrentScene {
 public:
  // `controllers`: the user's mapping, and its file; empty: learned rows are not written.
  CurrentScene(Process& process, const std::vector<ControllerSetting>& controllers,
               std::string controllers_path);

  // The scene, the values of its parameters and the positions of its knobs at one moment.
  struct Present {
    std::shared_ptr<const Loaded> loaded;
    std::vector<double> values;  // [parameter]
    std::vector<double> knobs;   // [knob] positions, 0 to 1
  };
  Present present() const;
  // Never null. Before the first load, it has no name and no parameters.
  std::shared_ptr<const Loaded> loaded() const;
  std::shared_ptr<const std::vector<SceneFile>> files() const;  // null before the first load
  std::optional<double> parameter(const std::string& name) const;

  // Replaces the scene. Mapped controllers move the targets of the same names, if it has them.
  // [worker]
  void replace(std::shared_ptr<const Loaded> loaded, std::vector<double> values,
               std::shared_ptr<const std::vector<SceneFile>> files);
  // Replaces the plan of the scene. [worker]
  void set_plan(Plan plan);

  // Records events of parameters and named controls that a queue has accepted, as a change that can
  // be undone.
  void remember(std::span<const TimedEvent> events);

  // Records the position of a controller that has moved. [worker]
  void remember_turn(int controller, double position);

  // Returns everything that a load of another scene changes.
  LastChange all_values() const;
  void set_last_change(LastChange change);
  // Returns the last change and forgets it. Changes of the same parameters within a second are one.
  std::optional<LastChange> take_last_change();

  // The next knob that is turned gets this target. See Session::learn().
  Result<Done> learn(const std::string& target);
  // Forgets the controllers of this target, or all learned ones if it is empty. Returns how many.
  Result<std::size_t> unlearn(const std::string& target);
  // Returns the target that waits for a knob, or nothing.
  std::optional<std::string> waiting_target() const;
  // Returns all controllers of the mapping, learned ones first.
  std::vector<MappedRow> mapping() const;
  // Returns the action of a row of the mapping; empty if it has another target.
  std::string action(std::size_t row) const;
  // Follows a controller message while a knob is learned. [worker]
  void hear(int channel, int controller, int value);
  // Once the knob is at rest, gives it the waiting target, and writes the mapping. [worker]
  std::optional<Learned> assign_turned_knob();

  // Returns the preset with the present values, with this model and,
  // if given, with these models of `through`. `extra_gain` is the factor that the session applies
  // to all presets.
  Result<std::string> preset_text(const std::string& model, double extra_gain,
                                  std::vector<std::string> through = {}) const;

 private:
  // All of these: with the lock held.
  void begin_change(const std::vector<std::string>& names);
  MappedTarget target_of(const std::string& name) const;
  MappedTarget controller_target(int number) const;
  void show_parameter(ControlSource source, int number, const std::string& address,
                      MappedTarget& target) const;
  void send_mapping();
  void stop_learning();
  Result<Done> write_mapping(const std::function<bool(const ControllerSetting&)>& is_dropped,
                             const std::optional<ControllerSetting>& added) const;

  Process& process_;
  const std::string controllers_path_;
  mutable std::mutex mutex_;  // guards all below, and the writing side of process_.controllers
  std::shared_ptr<const Loaded> loaded_ = std::make_shared<Loaded>();
  std::vector<double> values_;  // [parameter]
  std::vector<double> turned_;  // [knob] position at which its controller was last
  std::shared_ptr<const std::vector<SceneFile>> files_;
  std::optional<LastChange> last_change_;
  std::chrono::steady_clock::time_point change_time_;
  std::vector<MappedRow> mapping_;
  std::optional<std::string> waiting_target_;         // gets the next knob that is turned
  KnobLearner learner_;                               // hears its messages
  std::chrono::steady_clock::time_point heard_time_;  // of the last one
};

// Returns the parameters to save in a preset, with their ranges: those that the preset has and
// those that differ from their start values. `values`: [parameter].
std::vector<ParameterSetting> changed_settings(const std::vector<ParameterInfo>& parameters,
                                               const Preset& preset,
                                               std::span<const double> values);

// Returns the name by which a preset in another folder refers to a model: its file name if that
// finds it, else its absolute path. Blocks on the disk.
std::string model_name_elsewhere(const std::string& model_path);

}  // namespace ressort::session
