#include "app/session/watch/scene_watch.h"

#include <algorithm>
#include <utility>

#include "app/session/files.h"
#include "core/ranges.h"

namespace ressort::session {

SceneWatch::SceneWatch(bool is_on) {
  if (is_on) {
    watch_.emplace();
  }
}

void SceneWatch::follow(const std::vector<SceneFile>& files) {
  if (!watch_) {
    return;
  }
  if (!watch_->follow(mapped(files, &SceneFile::path))) {
    return;
  }
  was_edited_ = std::ranges::any_of(files, [](const SceneFile& file) {
    const auto now = read_text(file.path, max_model_bytes);
    return file.is_there ? now && *now != file.text : static_cast<bool>(now);
  });
}

bool SceneWatch::has_changed() {
  return watch_ && (std::exchange(was_edited_, false) || watch_->has_changed());
}

void SceneWatch::publish(Reload reload) {
  const std::lock_guard lock(mutex_);
  reload.count = reload_.count + 1;
  reload_ = std::move(reload);
}

Reload SceneWatch::last_reload() const {
  const std::lock_guard lock(mutex_);
  return reload_;
}

std::vector<Setting> start_settings(const Scene& scene) {
  std::vector<Setting> starts;
  for (const Parameter& parameter : scene.network.parameters) {
    double value = parameter.value;
    for (const ParameterSetting& setting : scene.preset.parameters) {
      value = setting.name == parameter.name ? setting.value : value;
    }
    starts.push_back({parameter.name, value});
  }
  return starts;
}

bool has_same_parameters(const Network& a, const Network& b) {
  return std::ranges::equal(a.parameters, b.parameters, [](const Parameter& x, const Parameter& y) {
    return x.name == y.name && x.audio_input == y.audio_input;
  });
}

bool differs_in_numbers_only(const Preset& a, const Preset& b) {
  const auto without_numbers = [](Preset preset) {
    preset.description.clear();
    preset.parameters.clear();
    preset.budget = {};
    preset.gain = preset.damper_s = preset.glide_s = preset.velocity = 0.0;
    preset.velocity_points.clear();
    preset.damper_keys.clear();
    preset.keys_db.clear();
    for (ControlSetting& control : preset.controls) {
      control = {.source = control.source,
                 .number = control.number,
                 .address = control.address,
                 .target = control.target,
                 .gesture = control.gesture,
                 .lowest_key = control.lowest_key,
                 .highest_key = control.highest_key,
                 .turn = control.turn,
                 .turns = control.turns};
    }
    return preset;
  };
  return without_numbers(a) == without_numbers(b);
}

bool differs_in_start_values_only(const Scene& a, const Scene& b) {
  if (!has_same_parameters(a.network, b.network) || a.third != b.third) {
    return false;
  }
  Network network = b.network;
  Preset preset = b.preset;
  network.parameters = a.network.parameters;
  preset.description = a.preset.description;
  if (preset.parameters.size() == a.preset.parameters.size()) {
    for (std::size_t i = 0; i < preset.parameters.size(); ++i) {
      // A curve without `keys_at` holds at the start value, so a new value moves it.
      if (preset.parameters[i].keys.empty() || preset.parameters[i].keys_at) {
        preset.parameters[i].value = a.preset.parameters[i].value;
      }
    }
  }
  // Values of bodies are compared by the parameters of the scene, which include theirs.
  for (std::size_t i = 0; i < std::min(preset.bodies.size(), a.preset.bodies.size()); ++i) {
    const Network& before = a.preset.bodies[i].network;
    if (has_same_parameters(before, preset.bodies[i].network)) {
      preset.bodies[i].network.parameters = before.parameters;
    }
  }
  return network == a.network && preset == a.preset;
}

}  // namespace ressort::session
