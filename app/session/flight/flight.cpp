#include <algorithm>
#include <utility>

#include "app/session/flight/flight.h"

namespace ressort::session {

bool is_flight_name(std::string_view name) {
  return name.ends_with(".ressort");
}

std::vector<Setting> keep_values(Scene& scene, std::span<const Setting> kept) {
  std::vector<Setting> written;
  for (const Setting& setting : kept) {
    // The preset's value overrides the model's.
    std::optional<double> before;
    for (Parameter& parameter : scene.network.parameters) {
      if (parameter.name == setting.parameter) {
        before = std::exchange(parameter.value, setting.value);
      }
    }
    for (ParameterSetting& parameter : scene.preset.parameters) {
      if (parameter.name == setting.parameter) {
        const double value = std::clamp(setting.value, parameter.minimum, parameter.maximum);
        if (!parameter.keys.empty() && !parameter.keys_at) {
          parameter.keys_at = parameter.value;  // the curve stays where it was
        }
        before = std::exchange(parameter.value, value);
      }
    }
    if (before) {
      written.push_back({setting.parameter, *before});
    }
  }
  return written;
}

Result<std::unique_ptr<Engine>> make_flight_engine(const Flight& flight,
                                                   const FlightEngine& engine) {
  const FlightSetup& setup = flight.setup;
  auto scene = load_scene(engine.path,
                          {.third = setup.third, .keys = setup.keys, .files = engine.files.get()});
  if (!scene) {
    return scene.error();
  }
  keep_values(*scene, engine.kept);
  scene->preset.gain = engine.gain;
  auto compiled = compile_network(scene->network, scene->preset,
                                  {.rate_hz = engine.rate_hz,
                                   .rescale = setup.rescale,
                                   .voices = setup.voices,
                                   .share = setup.share,
                                   .precision = setup.precision,
                                   .method = setup.method,
                                   .budget = setup.budget,
                                   .most_modes = engine.most_modes,
                                   .forms = engine.forms,
                                   .find_gain = engine.find_gain,
                                   .force = engine.force});
  if (!compiled) {
    return compiled.error();
  }
  return std::move(compiled->engine);
}

}  // namespace ressort::session
