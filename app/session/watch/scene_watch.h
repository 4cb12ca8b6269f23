// app/session: watches the files of the playing scene, and remembers the last reload.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "app/session/loader.h"
#include "app/session/watch/file_watch.h"
#include "core/compile/stability_check.h"

namespace ressort::session {

// The result of the last reload.
struct Reload {
  std::uint64_t count = 0;  // number of reloads so far
  bool is_done = true;
  std::string news;  // description of the change, or the errors with the source lines
};

// All functions: [worker], unless they say otherwise.
class SceneWatch {
 public:
  explicit SceneWatch(bool is_on);

  bool is_on() const { return watch_.has_value(); }
  // Watches these files. Detects changes between their reading and now.
  void follow(const std::vector<SceneFile>& files);
  // Returns true if a file has changed since the last call.
  bool has_changed();

  // The playing scene as it was read; only while watching.
  const std::optional<Scene>& as_read() const { return as_read_; }
  void set_as_read(std::optional<Scene> scene) { as_read_ = std::move(scene); }

  void publish(Reload reload);
  Reload last_reload() const;  // [any thread but audio]

 private:
  std::optional<FileWatch> watch_;
  bool was_edited_ = false;  // a change before the watch began
  std::optional<Scene> as_read_;
  mutable std::mutex mutex_;  // guards reload_
  Reload reload_;
};

// Returns the parameters' start values: the preset's, else the model's.
std::vector<Setting> start_settings(const Scene& scene);
bool has_same_parameters(const Network& a, const Network& b);
// Returns true if the presets differ at most in numbers that may change while a voice sounds.
bool differs_in_numbers_only(const Preset& a, const Preset& b);
// Returns true if the scenes differ at most in the start values of parameters.
bool differs_in_start_values_only(const Scene& a, const Scene& b);

}  // namespace ressort::session
