// What a player changes of what sounds: what can be taken back, learnt and kept.
#include <algorithm>
#include <filesystem>
#include <utility>

#include "app/session/changes/settings.h"
#include "app/session/files.h"
#include "app/session/modes/tuned_files.h"
#include "app/session/session.h"
#include "app/text.h"
#include "core/curve.h"
#include "core/model/preset/edit.h"

namespace ressort::session {
namespace {

// What a keyboard moves besides its knobs, and what MIDI has for its own ends: banks, parameters'
// numbers and data, pedals, and from 120 on channel modes.
bool is_knob(int controller) {
  constexpr int others[] = {0, 6, 32, 38, 64, 66, 67, 96, 97, 98, 99, 100, 101};
  return controller < 120 &&
         std::find(std::begin(others), std::end(others), controller) == std::end(others);
}

}  // namespace

// What the parameters are before they change; a sweep is one change.
void Session::begin_change(const std::vector<std::string>& names) {
  using namespace std::chrono_literals;
  if (names.empty()) {
    return;
  }
  const auto now = std::chrono::steady_clock::now();
  LastChange change;
  for (const std::string& name : names) {
    const auto& parameters = current_->instrument.parameters;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      if (parameters[i].name == name) {
        change.values.emplace_back(name, values_[i]);
      }
    }
  }
  const bool goes_on = last_change_ && !last_change_->scene &&
                       now - std::exchange(changed_, now) < 1s &&
                       std::equal(change.values.begin(), change.values.end(),
                                  last_change_->values.begin(), last_change_->values.end(),
                                  [](const auto& a, const auto& b) { return a.first == b.first; });
  changed_ = now;
  if (!goes_on) {
    last_change_ = std::move(change);
  }
}

std::optional<LastChange> Session::take_last_change() {
  const std::lock_guard lock(mutex_);
  return std::exchange(last_change_, std::nullopt);
}

// By its name among the parameters and the preset's OSC names; of no model where there is none.
LearnedControl Session::control_of(const std::string& target) const {
  const Instrument& instrument = current_->instrument;
  for (std::size_t i = 0; i < instrument.parameters.size(); ++i) {
    const ParameterInfo& info = instrument.parameters[i];
    if (info.name == target && info.audio_input == 0) {
      return {.kind = EventKind::parameter,
              .index = static_cast<std::uint16_t>(i),
              .model = current_->serial,
              .low = info.minimum,
              .high = info.maximum,
              .exponential = is_wide(info.minimum, info.maximum)};
    }
  }
  for (const CustomInfo& info : instrument.custom) {
    if (info.address == target) {
      return {.kind = EventKind::custom,
              .index = static_cast<std::uint16_t>(info.row),
              .model = current_->serial};
    }
  }
  return {};
}

void Session::teach(const LearnedRow& row, bool is_on) {
  process_.lessons.push({static_cast<std::uint8_t>(row.controller),
                         is_on ? control_of(row.target) : LearnedControl{}});
}

Result<Done> Session::learn(const std::string& target) {
  const std::uint64_t turns = process_.meters().turns;
  const std::lock_guard lock(mutex_);
  if (control_of(target).model == 0) {
    std::vector<std::string> known;
    for (const ParameterInfo& info : current_->instrument.parameters) {
      known.push_back(info.name);
    }
    for (const CustomInfo& info : current_->instrument.custom) {
      known.push_back(info.address);
    }
    return Error{"there is nothing called '" + target + "' to turn; there are " +
                 (known.empty() ? "none" : joined(known, ", ")) + did_you_mean(target, known)};
  }
  pupil_ = target;
  turns_ = turns;
  return Done{};
}

std::size_t Session::unlearn(const std::string& target) {
  const std::lock_guard lock(mutex_);
  pupil_.reset();
  const auto forgets = [&](const LearnedRow& row) {
    return target.empty() || row.target == target;
  };
  for (const LearnedRow& row : learned_) {
    if (forgets(row)) {
      teach(row, false);
    }
  }
  return std::erase_if(learned_, forgets);
}

std::vector<LearnedRow> Session::learned() const {
  const std::lock_guard lock(mutex_);
  return learned_;
}

// Whether the knob has moved that somebody waits for.
void Session::hear_turns(const Meters& now) {
  std::string news;
  {
    const std::lock_guard lock(mutex_);
    if (!pupil_ || now.turns == turns_ || !is_knob(now.last_controller)) {
      return;
    }
    const LearnedRow row{now.last_controller, *std::exchange(pupil_, std::nullopt)};
    for (const LearnedRow& before : learned_) {
      if (before.target == row.target) {
        teach(before, false);
      }
    }
    std::erase_if(learned_, [&](const LearnedRow& before) {
      return before.target == row.target || before.controller == row.controller;
    });
    learned_.push_back(row);
    teach(row, true);
    news = "controller " + std::to_string(row.controller) + " turns " + row.target +
           " from now on; 'unlearn " + row.target + "' ends that, 'save NAME' keeps it";
  }
  if (tell_) {
    tell_(news);
  }
}

Result<std::string> Session::preset_text(const std::string& model) const {
  PresetChanges changes;
  std::shared_ptr<const Loaded> now;
  {
    const std::lock_guard lock(mutex_);
    now = current_;
    if (now->serial == 0) {
      return Error{"nothing is loaded that could be saved"};
    }
    changes.parameters = changed_settings(now->instrument.parameters, now->preset, values_);
    for (const LearnedRow& row : learned_) {
      const LearnedControl control = control_of(row.target);
      for (const ControlSetting& setting : now->preset.controls) {
        if (setting.source == ControlSource::osc && setting.address == row.target) {
          ControlSetting same = setting;
          same.source = ControlSource::controller;
          same.number = row.controller;
          changes.learned.push_back(std::move(same));
        }
      }
      if (control.kind == EventKind::parameter) {
        changes.learned.push_back({.source = ControlSource::controller,
                                   .number = row.controller,
                                   .target = row.target,
                                   .gesture = Gesture::parameter,
                                   .low = control.low,
                                   .high = control.high,
                                   .exponential = control.exponential});
      }
    }
  }
  changes.model = model;
  changes.gain = now->instrument.gain / options_.gain;
  Preset made_up = now->preset;
  made_up.model = changes.model;
  return edit_preset(now->preset_text.empty() ? print_preset(made_up) : now->preset_text, changes);
}

Result<std::string> Session::save(const std::string& name, Existing existing) {
  const auto path = path_to_save(name);
  if (!path) {
    return path.error();
  }
  if (const std::string there = preset_path(name); existing == Existing::refuse && !there.empty()) {
    const std::string forced = "; 'save " + name + " --force' at the console ";
    return Error{there == *path ? "'" + name + "' is there already" + forced + "writes over it"
                                : "'" + name + "' is a preset that came with the program" + forced +
                                      "saves one of yours that is loaded instead"};
  }
  const std::shared_ptr<const Loaded> now = current();
  std::string model = now->model_path;
  if (is_tuned(model)) {  // it would be lost with the cache
    const auto kept = keep_tuned(model, name, existing);
    if (!kept) {
      return kept.error();
    }
    model = *kept;
  }
  const auto text = preset_text(model_name_elsewhere(model));
  if (!text) {
    return text.error();
  }
  const auto written = write_text(*path, *text, existing);
  return written ? Result<std::string>(*path) : written.error();
}

Result<std::string> Session::save_to(const std::string& folder) {
  namespace fs = std::filesystem;
  const auto now = current();
  std::shared_ptr<const std::vector<SceneFile>> files;
  {
    const std::lock_guard lock(mutex_);
    files = files_;
  }
  if (files == nullptr) {
    return Error{"nothing is loaded that could be saved"};
  }
  const std::string name = now->name + ".toml";
  const auto text = preset_text(fs::path(now->model_path).filename().string());
  if (!text) {
    return text.error();
  }
  const fs::path from = fs::path(now->path).parent_path();
  for (const SceneFile& file : *files) {
    const bool is_preset = file.path == now->path && file.path.ends_with(".toml");
    if (!file.is_there || is_preset) {
      continue;
    }
    // What is below the preset's own folder keeps its place there; all else is beside it.
    fs::path place = fs::path(file.path).lexically_relative(from);
    if (place.empty() || *place.begin() == ".." || file.path == now->model_path) {
      place = fs::path(file.path).filename();
    }
    std::error_code error;
    fs::create_directories((folder / place).parent_path(), error);
    if (auto written = write_text((folder / place).string(), file.text, Existing::replace);
        !written) {
      return written.error();
    }
  }
  const auto written = write_text((fs::path(folder) / name).string(), *text, Existing::replace);
  return written ? Result<std::string>(name) : written.error();
}

std::vector<std::string> Session::tuning() const {
  const std::lock_guard lock(mutex_);
  return tuning_;
}

void Session::set_tuning(std::vector<std::string> paths) {
  const std::lock_guard lock(mutex_);
  tuning_ = std::move(paths);
}

}  // namespace ressort::session
