#include "app/panel/state.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "app/control/registry.h"
#include "app/control/status.h"
#include "app/session/files.h"
#include "core/gesture.h"

namespace ressort::panel {
namespace {

using nlohmann::json;

json number(double value) {
  return std::isfinite(value) ? json(value) : json();
}

std::string dumped(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

json parameter_json(const ParameterInfo& info, double value) {
  return {{"name", info.name},
          {"value", number(value)},
          {"minimum", number(info.minimum)},
          {"maximum", number(info.maximum)},
          {"lowest", number(info.safe.lowest)},
          {"highest", number(info.safe.highest)},
          {"audio_input", info.audio_input}};
}

// Returns the largest force or displacement that the preset applies to an input; 1 if it has none.
double blow_of(const InputInfo& info, const Preset& preset) {
  double blow = 0.0;
  for (const ControlSetting& control : preset.controls) {
    if (control.target == "in" + std::to_string(info.number) && control.gesture != Gesture::bow &&
        control.gesture != Gesture::noise) {
      blow = std::max({blow, std::fabs(control.low), std::fabs(control.high), control.travel});
    }
  }
  return blow > 0.0 ? blow : 1.0;
}

json input_json(const InputInfo& info, const Preset& preset) {
  json known = json::array();
  for (const Gesture gesture : info.gestures) {
    known.push_back(row_of(gesture).name);
  }
  return {{"number", info.number},
          {"is_force", info.is_force},
          {"attached_to", info.attached_to},
          {"blow", blow_of(info, preset)},
          {"gestures", known}};
}

// Returns the controllers that act on the playing scene, and the target that waits for one.
std::string mapping_json(const Session& session) {
  json rows = json::array();
  for (const MappedRow& row : session.mapping()) {
    if (row.exists) {
      rows.push_back({{"from", name_of(row.setting.input)},
                      {"to", row.setting.target},
                      {"learned", row.is_learned},
                      {"relative", row.setting.input.mode != ControllerMode::absolute}});
    }
  }
  return dumped({{"waiting", session.waiting_target().value_or("")}, {"rows", rows}});
}

}  // namespace

std::string describe_json(const Session& session) {
  const Session::Present now = session.present();
  const Loaded& loaded = *now.loaded;
  const Instrument& instrument = loaded.instrument;
  json rows = json::array();
  for (const Row* const row : addresses()) {
    rows.push_back(
        {{"address", row->address}, {"arguments", row->arguments_text()}, {"does", row->does}});
  }
  json parameters = json::array();
  for (std::size_t i = 0; i < instrument.parameters.size(); ++i) {
    parameters.push_back(parameter_json(instrument.parameters[i], now.values[i]));
  }
  json knobs = json::array();
  for (std::size_t i = 0; i < instrument.knobs.size(); ++i) {
    const KnobInfo& knob = instrument.knobs[i];
    knobs.push_back({{"name", knob.name},
                     {"address", knob.address()},
                     {"help", knob.help},
                     {"controller", knob.controller},
                     {"value", now.knobs[i]}});
  }
  std::set<std::string> controls;
  for (const CustomInfo& custom : instrument.custom) {
    controls.insert(custom.address);
  }
  json inputs = json::array();
  for (const InputInfo& info : instrument.inputs) {
    inputs.push_back(input_json(info, loaded.preset));
  }
  json plan = json::array();
  for (const Part& part : loaded.plan.parts) {
    plan.push_back({{"method", method_name(part.method)},
                    {"masses", part.masses},
                    {"links", part.links},
                    {"reason", (part.body.empty() ? "" : part.body + ": ") + part.reason}});
  }
  json presets = json::array();
  for (const std::string& name : known_presets()) {
    presets.push_back({name, preset_description(name)});
  }
  return dumped({{"name", loaded.name},
                 {"serial", loaded.serial},
                 {"description", loaded.description},
                 {"warnings", loaded.warnings},
                 {"masses", instrument.masses},
                 {"link_count", instrument.links},
                 {"voices", instrument.voices},
                 {"outputs", instrument.outputs},
                 {"tuned_hz", instrument.mode ? json(instrument.mode->frequency_hz) : json()},
                 {"stiffness_margin", number(instrument.stiffness_margin)},
                 {"plan", plan},
                 {"addresses", rows},
                 {"parameters", parameters},
                 {"knobs", knobs},
                 {"controls", controls},
                 {"through", loaded.preset.through},
                 {"inputs", inputs},
                 {"models", known_models()},
                 {"presets", presets}});
}

std::string status_json(const Status& status, const std::optional<SpectralShape>& shape) {
  json out = json::object();
  for (const StatusRow& row : status_rows()) {
    std::visit(
        [&](auto figure) {
          const auto& value = status.*figure;
          if constexpr (std::is_same_v<std::decay_t<decltype(value)>, double>) {
            out[std::string(row.name)] = number(value);
          } else {
            out[std::string(row.name)] = value;
          }
        },
        row.figure);
  }
  out["centroid_hz"] = shape ? number(shape->centroid_hz) : json();
  out["spread_hz"] = shape ? number(shape->spread_hz) : json();
  out["flatness"] = shape ? number(shape->flatness) : json();
  return dumped(out);
}

std::string server_event(std::string_view name, const std::string& data) {
  return "event: " + std::string(name) + "\ndata: " + data + "\n\n";
}

std::string quoted(const std::string& text) {
  return dumped(json(text));
}

std::string Changes::since_last(const Session& session) {
  const Session::Present now = session.present();
  std::string events;
  const bool is_other = told_.loaded == nullptr || told_.loaded->serial != now.loaded->serial;
  if (is_other) {
    events += server_event("loaded",
                           dumped({{"name", now.loaded->name}, {"serial", now.loaded->serial}}));
  }
  json values = json::object();
  for (std::size_t i = 0; i < now.values.size(); ++i) {
    if (is_other || told_.values[i] != now.values[i]) {
      values[now.loaded->instrument.parameters[i].name] = number(now.values[i]);
    }
  }
  for (std::size_t i = 0; i < now.knobs.size(); ++i) {
    if (is_other || told_.knobs[i] != now.knobs[i]) {
      values[now.loaded->instrument.knobs[i].address()] = now.knobs[i];
    }
  }
  if (!values.empty()) {
    events += server_event("values", dumped(values));
  }
  told_ = now;
  if (std::string mapping = mapping_json(session); mapping != told_mapping_) {
    events += server_event("mapping", mapping);
    told_mapping_ = std::move(mapping);
  }
  return events;
}

}  // namespace ressort::panel
