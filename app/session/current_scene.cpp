#include "app/session/current_scene.h"

#include <algorithm>
#include <filesystem>

#include "app/session/files.h"
#include "app/text.h"
#include "core/curve.h"
#include "core/model/preset/edit.h"

namespace ressort::session {
CurrentScene::CurrentScene(Process& process, const std::vector<ControllerSetting>& controllers,
                           std::string controllers_path)
    : process_(process), controllers_path_(std::move(controllers_path)) {
  for (const ControllerSetting& setting : controllers) {
    mapping_.push_back({.setting = setting});
  }
}

CurrentScene::Present CurrentScene::present() const {
  const std::lock_guard lock(mutex_);
  Present now{loaded_, values_, turned_};
  for (std::size_t i = 0; i < turned_.size(); ++i) {
    const KnobInfo& knob = loaded_->instrument.knobs[i];
    now.knobs[i] = knob.parameter ? knob.range.position_of(values_[*knob.parameter]) : turned_[i];
  }
  return now;
}

std::shared_ptr<const Loaded> CurrentScene::loaded() const {
  const std::lock_guard lock(mutex_);
  return loaded_;
}

std::shared_ptr<const std::vector<SceneFile>> CurrentScene::files() const {
  const std::lock_guard lock(mutex_);
  return files_;
}

std::optional<double> CurrentScene::parameter(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto& parameters = loaded_->instrument.parameters;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].name == name) {
      return values_[i];
    }
  }
  return std::nullopt;
}

void CurrentScene::replace(std::shared_ptr<const Loaded> loaded, std::vector<double> values,
                           std::shared_ptr<const std::vector<SceneFile>> files) {
  const std::lock_guard lock(mutex_);
  loaded_ = std::move(loaded);
  values_ = std::move(values);
  files_ = std::move(files);
  turned_.clear();
  for (const KnobInfo& knob : loaded_->instrument.knobs) {
    turned_.push_back(knob.rest);
  }
  stop_learning();
  send_mapping();
}

void CurrentScene::set_plan(Plan plan) {
  const std::lock_guard lock(mutex_);
  auto loaded = std::make_shared<Loaded>(*loaded_);
  loaded->plan = std::move(plan);
  loaded_ = std::move(loaded);
}

void CurrentScene::remember(std::span<const TimedEvent> events) {
  const std::lock_guard lock(mutex_);
  std::vector<std::pair<std::size_t, double>> changes;  // parameter and value
  for (const TimedEvent& timed : events) {
    const Event& event = timed.event;
    if (event.model != loaded_->serial) {
      continue;
    }
    if (event.kind == EventKind::parameter) {
      changes.emplace_back(event.index, event.value);
    }
    for (std::size_t i = 0; event.kind == EventKind::controller && i < turned_.size(); ++i) {
      const KnobInfo& knob = loaded_->instrument.knobs[i];
      if (knob.controller == event.index) {
        turned_[i] = event.value;
        if (knob.parameter) {
          changes.emplace_back(*knob.parameter, knob.range.value_at(event.value));
        }
      }
    }
  }
  std::vector<std::string> names;
  for (const auto& [parameter, value] : changes) {
    names.push_back(loaded_->instrument.parameters[parameter].name);
  }
  begin_change(names);
  for (const auto& [parameter, value] : changes) {
    values_[parameter] = value;
  }
}

void CurrentScene::remember_turn(int controller, double position) {
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < turned_.size(); ++i) {
    if (loaded_->instrument.knobs[i].controller == controller) {
      turned_[i] = position;
    }
  }
}

// Saves the values of these parameters before they change. A sweep is one change.
void CurrentScene::begin_change(const std::vector<std::string>& names) {
  using namespace std::chrono_literals;
  if (names.empty()) {
    return;
  }
  const auto now = std::chrono::steady_clock::now();
  LastChange change;
  for (const std::string& name : names) {
    const auto& parameters = loaded_->instrument.parameters;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      if (parameters[i].name == name) {
        change.values.emplace_back(name, values_[i]);
      }
    }
  }
  const bool continues_last =
      last_change_ && !last_change_->scene && now - change_time_ < 1s &&
      std::ranges::equal(change.values, last_change_->values,
                         [](const auto& a, const auto& b) { return a.first == b.first; });
  change_time_ = now;
  if (!continues_last) {
    last_change_ = std::move(change);
  }
}

LastChange CurrentScene::all_values() const {
  const std::lock_guard lock(mutex_);
  LastChange change{.scene = loaded_->path};
  for (std::size_t i = 0; i < values_.size(); ++i) {
    change.values.emplace_back(loaded_->instrument.parameters[i].name, values_[i]);
  }
  return change;
}

void CurrentScene::set_last_change(LastChange change) {
  const std::lock_guard lock(mutex_);
  last_change_ = change.scene->empty() ? std::nullopt : std::optional(std::move(change));
}

std::optional<LastChange> CurrentScene::take_last_change() {
  const std::lock_guard lock(mutex_);
  return std::exchange(last_change_, std::nullopt);
}

// Returns the target of this name; one that does not exist if the scene has none. An action has no
// index yet.
MappedTarget CurrentScene::target_of(const std::string& name) const {
  const Instrument& instrument = loaded_->instrument;
  if (is_action(name)) {
    return {.kind = name == "panic" ? EventKind::panic : EventKind::program, .exists = true};
  }
  if (const int number = controller_number(name); number >= 0) {
    return controller_target(number);
  }
  for (const KnobInfo& knob : instrument.knobs) {
    if (knob.controller >= 0 && knob.word == word_of(name)) {
      return controller_target(knob.controller);
    }
  }
  for (std::size_t i = 0; i < instrument.parameters.size(); ++i) {
    const ParameterInfo& info = instrument.parameters[i];
    if (info.name == name && info.audio_input == 0) {
      const auto index = static_cast<std::uint16_t>(i);
      return {.kind = EventKind::parameter,
              .exists = true,
              .has_parameter = true,
              .index = index,
              .parameter = index,
              .model = loaded_->serial,
              .range = {info.minimum, info.maximum, is_wide(info.minimum, info.maximum)}};
    }
  }
  for (const CustomInfo& info : instrument.custom) {
    if (info.address == name) {
      MappedTarget target{.kind = EventKind::custom,
                          .exists = true,
                          .index = static_cast<std::uint16_t>(info.row),
                          .model = loaded_->serial};
      show_parameter(ControlSource::osc, 0, name, target);
      return target;
    }
  }
  return {};
}

// Returns a controller with its present position.
MappedTarget CurrentScene::controller_target(int number) const {
  constexpr std::pair<int, double> usual[] = {{7, 100.0 / 127.0}, {10, 0.5}, {11, 1.0}};
  MappedTarget target{.exists = true, .index = static_cast<std::uint16_t>(number)};
  for (const auto& [controller, position] : usual) {  // volume, pan and expression
    target.start = controller == number ? position : target.start;
  }
  for (std::size_t i = 0; i < turned_.size(); ++i) {
    if (loaded_->instrument.knobs[i].controller == number) {
      target.start = turned_[i];
    }
  }
  show_parameter(ControlSource::controller, number, "", target);
  return target;
}

// Finds the parameter that a control of the preset moves. Its value is the position of the knob.
void CurrentScene::show_parameter(ControlSource source, int number, const std::string& address,
                                  MappedTarget& target) const {
  const auto& parameters = loaded_->instrument.parameters;
  for (const ControlSetting& control : loaded_->preset.controls) {
    const auto found = std::ranges::find(parameters, control.target, &ParameterInfo::name);
    if (control.source == source && control.number == number && control.address == address &&
        control.gesture == Gesture::parameter && found != parameters.end()) {
      target.has_parameter = true;
      target.parameter = static_cast<std::uint16_t>(found - parameters.begin());
      target.model = loaded_->serial;
      target.range = {control.low, control.high, control.exponential};
      return;
    }
  }
}

std::vector<MappedRow> CurrentScene::mapping() const {
  const std::lock_guard lock(mutex_);
  return mapping_;
}

std::string CurrentScene::action(std::size_t row) const {
  const std::lock_guard lock(mutex_);
  return row < mapping_.size() && is_action(mapping_[row].setting.target)
             ? mapping_[row].setting.target
             : "";
}

// Sends the whole mapping. Of two rows for a message the first acts.
void CurrentScene::send_mapping() {
  ControllerMap& map = process_.controllers.writing();
  map.count = 0;
  for (MappedRow& row : mapping_) {
    MappedController& mapped = map.rows[map.count];
    mapped = {row.setting.input, target_of(row.setting.target)};
    row.exists = mapped.target.exists;
    if (mapped.target.kind == EventKind::program) {
      mapped.target.index = static_cast<std::uint16_t>(map.count);
    }
    ++map.count;
  }
  process_.controllers.publish();
}

Result<Done> CurrentScene::learn(const std::string& target) {
  const std::lock_guard lock(mutex_);
  const MappedTarget found = target_of(target);
  if (!found.exists || is_action(target) || controller_number(target) >= 0) {
    std::vector<std::string> known;
    for (const KnobInfo& knob : loaded_->instrument.knobs) {
      if (knob.controller >= 0) {
        known.push_back(knob.word);
      }
    }
    for (const ParameterInfo& info : loaded_->instrument.parameters) {
      known.push_back(info.name);
    }
    for (const CustomInfo& info : loaded_->instrument.custom) {
      known.push_back(info.address);
    }
    return Error{"there is no parameter or control '" + target + "'; there are " +
                 (known.empty() ? "none" : joined(known, ", ")) + did_you_mean(target, known)};
  }
  if (mapping_.size() >= most_controllers) {
    return Error{"the mapping has " + std::to_string(most_controllers) +
                 " rows, the most that there can be; 'unlearn NAME' removes one"};
  }
  waiting_target_ = target;
  learner_ = KnobLearner();
  process_.hears_controllers.raise();
  return Done{};
}

void CurrentScene::stop_learning() {
  waiting_target_.reset();
  process_.hears_controllers.lower();
}

Result<std::size_t> CurrentScene::unlearn(const std::string& target) {
  const std::lock_guard lock(mutex_);
  stop_learning();
  std::vector<ControllerSetting> dropped;
  std::erase_if(mapping_, [&](const MappedRow& row) {
    const bool goes =
        target.empty() ? row.is_learned : word_of(row.setting.target) == word_of(target);
    if (goes) {
      dropped.push_back(row.setting);
    }
    return goes;
  });
  send_mapping();
  if (dropped.empty()) {
    return std::size_t{0};
  }
  const auto written = write_mapping(
      [&](const ControllerSetting& row) {
        return std::ranges::find(dropped, row) != dropped.end();
      },
      std::nullopt);
  return written ? Result<std::size_t>(dropped.size()) : written.error();
}

void CurrentScene::hear(int channel, int controller, int value) {
  const std::lock_guard lock(mutex_);
  learner_.add(channel, controller, value);
  heard_time_ = std::chrono::steady_clock::now();
}

std::optional<std::string> CurrentScene::waiting_target() const {
  const std::lock_guard lock(mutex_);
  return waiting_target_;
}

std::optional<Learned> CurrentScene::assign_turned_knob() {
  using namespace std::chrono_literals;
  constexpr auto rest = 700ms;  // longer than the pause of a hand that turns back
  const std::lock_guard lock(mutex_);
  const auto input = learner_.found();
  if (!waiting_target_ || !input || std::chrono::steady_clock::now() - heard_time_ < rest) {
    return std::nullopt;
  }
  ControllerSetting setting{*input, *waiting_target_};
  stop_learning();
  // The channel counts only if the mapping has this controller for another channel too.
  const auto is_alike = [&](const MappedRow& row) {
    return row.setting.input.source == input->source && row.setting.input.number == input->number &&
           row.setting.input.channel != ControllerInput::any_channel;
  };
  if (std::ranges::none_of(mapping_, is_alike)) {
    setting.input.channel = ControllerInput::any_channel;
  }
  for (const MappedRow& row : mapping_) {
    if (row.setting.input.is_same_source(setting.input)) {
      setting.input.picks_up |= row.setting.input.picks_up;
      setting.input.sends |= row.setting.input.sends;
    }
  }
  const auto is_replaced = [&](const ControllerSetting& row) { return setting.replaces(row); };
  std::erase_if(mapping_, [&](const MappedRow& row) { return is_replaced(row.setting); });
  mapping_.insert(mapping_.begin(), {.setting = setting, .is_learned = true});
  send_mapping();
  const auto written = write_mapping(is_replaced, setting);
  return Learned{setting, written ? std::nullopt : std::optional(written.error())};
}

// Reads the file again, because the user may have edited it.
Result<Done> CurrentScene::write_mapping(
    const std::function<bool(const ControllerSetting&)>& is_dropped,
    const std::optional<ControllerSetting>& added) const {
  std::error_code error;
  if (controllers_path_.empty()) {
    return Done{};
  }
  std::filesystem::create_directories(std::filesystem::path(controllers_path_).parent_path(),
                                      error);
  const auto before = std::filesystem::exists(controllers_path_, error)
                          ? read_text(controllers_path_, max_preset_bytes)
                          : Result<std::string>("");
  if (!before) {
    return before.error();
  }
  const auto after = edit_controllers(*before, is_dropped, added);
  if (!after) {
    return Error{controllers_path_ + ": " + after.error().message};
  }
  return *after == *before ? Done{} : write_text(controllers_path_, *after, Existing::replace);
}

Result<std::string> CurrentScene::preset_text(const std::string& model, double extra_gain,
                                              std::vector<std::string> through) const {
  const std::lock_guard lock(mutex_);
  if (loaded_->serial == 0) {
    return Error{"nothing is loaded that could be saved"};
  }
  PresetChanges changes;
  changes.parameters = changed_settings(loaded_->instrument.parameters, loaded_->preset, values_);
  changes.model = model;
  changes.through = std::move(through);
  changes.gain = loaded_->instrument.gain / extra_gain;
  Preset generated = loaded_->preset;
  generated.model = changes.model;
  return edit_preset(loaded_->preset_text.empty() ? print_preset(generated) : loaded_->preset_text,
                     changes);
}

std::vector<ParameterSetting> changed_settings(const std::vector<ParameterInfo>& parameters,
                                               const Preset& preset,
                                               std::span<const double> values) {
  constexpr double most = 1e12;  // largest number in a preset
  std::vector<ParameterSetting> changed;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const ParameterInfo& info = parameters[i];
    const bool is_in_preset = std::ranges::any_of(
        preset.parameters,
        [&](const ParameterSetting& setting) { return setting.name == info.name; });
    if (info.audio_input == 0 && (is_in_preset || values[i] != info.value)) {
      changed.push_back(
          {info.name, values[i], std::max(info.minimum, -most), std::min(info.maximum, most)});
    }
  }
  return changed;
}

std::string model_name_elsewhere(const std::string& model_path) {
  const std::filesystem::path path(model_path);
  std::error_code error;
  const std::string known = session::model_path(path.stem().string());
  const bool is_known = !known.empty() && std::filesystem::equivalent(known, path, error);
  return is_known ? path.filename().string()
                  : std::filesystem::absolute(path, error).lexically_normal().string();
}

}  // namespace ressort::session
