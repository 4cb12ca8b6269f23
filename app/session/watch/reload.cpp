// What sounds is read again when its files change: numbers go to the voices that sound, all else
// comes as a load does, and what is wrong is told.
#include <algorithm>
#include <utility>

#include "app/session/files.h"
#include "app/session/load_news.h"
#include "app/session/session.h"
#include "app/text.h"
#include "core/model/language/expression.h"

namespace ressort::session {
namespace {

// The value that a parameter starts with: as the preset says, else as the model does.
double start_of(const Scene& scene, const Parameter& parameter) {
  for (const ParameterSetting& setting : scene.preset.parameters) {
    if (setting.name == parameter.name) {
      return setting.value;
    }
  }
  return parameter.value;
}

std::vector<Setting> starts_of(const Scene& scene) {
  std::vector<Setting> starts;
  for (const Parameter& parameter : scene.network.parameters) {
    starts.push_back({parameter.name, start_of(scene, parameter)});
  }
  return starts;
}

bool has_same_parameters(const Network& a, const Network& b) {
  return std::equal(a.parameters.begin(), a.parameters.end(), b.parameters.begin(),
                    b.parameters.end(), [](const Parameter& x, const Parameter& y) {
                      return x.name == y.name && x.audio_input == y.audio_input;
                    });
}

// A preset without the numbers that may change under a voice that sounds.
Preset without_numbers(Preset preset) {
  preset.description.clear();
  preset.parameters.clear();
  preset.budget = {};
  preset.gain = preset.damper_s = preset.glide_s = preset.velocity = 0.0;
  preset.velocity_points.clear();
  preset.decay_s.clear();
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
}

// Whether nothing differs but what parameters start with.
bool differs_in_starts_only(const Scene& a, const Scene& b) {
  if (!has_same_parameters(a.network, b.network) || a.third != b.third) {
    return false;
  }
  Network network = b.network;
  Preset preset = b.preset;
  network.parameters = a.network.parameters;
  preset.description = a.preset.description;
  if (preset.parameters.size() == a.preset.parameters.size()) {
    for (std::size_t i = 0; i < preset.parameters.size(); ++i) {
      preset.parameters[i].value = a.preset.parameters[i].value;
    }
  }
  return network == a.network && preset == a.preset;
}

std::string listed(const std::vector<Setting>& settings) {
  std::vector<std::string> words;
  for (const Setting& setting : settings) {
    words.push_back(setting.parameter + " = " + print_number(setting.value));
  }
  return joined(words, ", ");
}

}  // namespace

Reload Session::last_reload() const {
  const std::lock_guard lock(mutex_);
  return reload_;
}

// What is read from now on; what has changed before the watch began is found by looking.
void Session::follow(const std::vector<SceneFile>& files) {
  if (!watch_) {
    return;
  }
  std::vector<std::string> paths;
  for (const SceneFile& file : files) {
    paths.push_back(file.path);
  }
  if (!watch_->follow(paths)) {
    return;
  }
  is_edited_ = std::any_of(files.begin(), files.end(), [](const SceneFile& file) {
    const auto now = read_text(file.path, max_model_bytes);
    return file.is_there ? now && *now != file.text : static_cast<bool>(now);
  });
}

void Session::do_reload() {
  if (!scene_) {
    return;  // nothing sounds that could be read again
  }
  const Progress progress([this](std::string_view) { return !is_outdated(true); });
  Reload news;
  const auto start = std::chrono::steady_clock::now();
  try {
    Reading reading = read_scene(scene_->name, scene_options(*scene_, progress));
    follow(reading.files);
    if (reading.scene) {
      auto done =
          reload({.scene = *std::move(reading.scene),
                  .files = std::make_shared<const std::vector<SceneFile>>(std::move(reading.files)),
                  .start = start});
      news.is_done = static_cast<bool>(done);
      news.news = done ? *done : done.error().message;
    } else {
      news.is_done = false;
      for (const Finding& finding : reading.findings) {
        news.news += (news.news.empty() ? "" : "\n") + with_source(finding);
      }
    }
  } catch (const std::exception& error) {
    news.is_done = false;
    news.news = error.what();
  }
  if (is_outdated(true)) {
    return;  // a load is waiting, and is told of itself
  }
  if (!news.is_done) {
    news.news += "\nwhat sounds goes on as it was";
  }
  {
    const std::lock_guard lock(mutex_);
    news.count = reload_.count + 1;
    reload_ = news;
  }
  if (tell_) {
    tell_(news.news);
  }
}

// What has come of it, for a person; or why it does not sound.
Result<std::string> Session::reload(Draft draft) {
  const std::string name = draft.scene.name;
  const Present now = present();
  std::vector<Setting> changed;
  if (read_) {
    const std::vector<Setting> before = starts_of(*read_);
    for (const Setting& start : starts_of(draft.scene)) {
      const auto was = std::find_if(before.begin(), before.end(), [&](const Setting& setting) {
        return setting.parameter == start.parameter;
      });
      if (was != before.end() && was->value != start.value) {
        changed.push_back(start);
      } else if (was != before.end()) {  // what a player has turned stays turned
        const auto& known = now.loaded->instrument.parameters;
        for (std::size_t i = 0; i < known.size(); ++i) {
          if (known[i].name == start.parameter && now.values[i] != known[i].value) {
            draft.kept.push_back({start.parameter, now.values[i]});
          }
        }
      }
    }
    if (differs_in_starts_only(*read_, draft.scene)) {
      if (changed.empty()) {
        return name + ": read again; it sounds as before";
      }
      const auto fits = [&](const Setting& setting) {
        return std::any_of(now.loaded->instrument.parameters.begin(),
                           now.loaded->instrument.parameters.end(), [&](const ParameterInfo& info) {
                             return info.name == setting.parameter && info.audio_input == 0 &&
                                    info.minimum <= setting.value && setting.value <= info.maximum;
                           });
      };
      if (std::all_of(changed.begin(), changed.end(), fits)) {
        turn(changed);
        read_ = std::move(draft.scene);
        return name + ": " + listed(changed);
      }
    }
    draft.goes_on = has_same_parameters(read_->network, draft.scene.network) &&
                    without_numbers(read_->preset) == without_numbers(draft.scene.preset) &&
                    read_->third == draft.scene.third &&
                    read_->has_preset == draft.scene.has_preset;
  }
  LoadNews news(name, tell_);
  const Progress progress([&](std::string_view stage) {
    news.at(stage);
    return !is_outdated(true);
  });
  const std::uint32_t serial = serial_;
  Wish wish = *scene_;
  wish.lets_ring = false;
  const auto result = sound(wish, std::move(draft), progress);
  if (!result) {
    return result.error();
  }
  time_parts();
  std::string text = name + (serial == serial_ ? ": new numbers" : ": loaded again") + " in " +
                     fixed((*result)->load_ms, 1) + " ms" +
                     (changed.empty() ? "" : "; " + listed(changed));
  for (const std::string& warning : (*result)->warnings) {
    text += "\n" + warning;
  }
  return text;
}

Result<Done> Session::retune(std::vector<Setting> values, const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  const Present now = present();
  Reading reading = read_scene(scene_->name, scene_options(*scene_, progress));
  auto files = std::make_shared<const std::vector<SceneFile>>(std::move(reading.files));
  auto scene = scene_of(std::move(reading));
  if (!scene) {
    return scene.error();
  }
  LastChange change{.scene = now.loaded->path};
  for (std::size_t i = 0; i < now.values.size(); ++i) {
    change.values.emplace_back(now.loaded->instrument.parameters[i].name, now.values[i]);
  }
  const bool goes_on = without_numbers(now.loaded->preset) == without_numbers(scene->preset);
  Wish wish = *scene_;
  wish.lets_ring = false;
  const auto result = sound(wish,
                            {.scene = *std::move(scene),
                             .files = std::move(files),
                             .kept = std::move(values),
                             .goes_on = goes_on,
                             .start = start},
                            progress);
  if (!result) {
    return result.error();
  }
  {
    const std::lock_guard lock(mutex_);
    last_change_ = std::move(change);
  }
  time_parts();
  return Done{};
}

// As if a player had.
void Session::turn(const std::vector<Setting>& settings) {
  const auto now = current();
  std::vector<TimedEvent> events;
  for (std::size_t i = 0; i < now->instrument.parameters.size(); ++i) {
    for (const Setting& setting : settings) {
      if (now->instrument.parameters[i].name == setting.parameter) {
        events.push_back({.event = {.kind = EventKind::parameter,
                                    .index = static_cast<std::uint16_t>(i),
                                    .model = now->serial,
                                    .value = setting.value}});
      }
    }
  }
  if (process_.send(process_.from_session, events)) {
    remember(events);
  }
}

}  // namespace ressort::session
