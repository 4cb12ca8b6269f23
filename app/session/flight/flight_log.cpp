#include <algorithm>
#include <cmath>
#include <utility>

#include "app/session/flight/flight.h"
#include "app/version.h"

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
                                   .find_gain = engine.find_gain,
                                   .force = engine.force});
  if (!compiled) {
    return compiled.error();
  }
  return std::move(compiled->engine);
}

void FlightLog::add(FlightEngine engine, bool has_audio_inputs) {
  // Repeated loads of a scene share one text.
  const auto known = std::find_if(texts_.begin(), texts_.end(), [&](const auto& files) {
    return std::equal(files->begin(), files->end(), engine.files->begin(), engine.files->end(),
                      [](const SceneFile& a, const SceneFile& b) {
                        return a.path == b.path && a.text == b.text && a.is_there == b.is_there;
                      });
  });
  if (known != texts_.end()) {
    engine.files = *known;
  } else {
    texts_.push_back(engine.files);
    for (const SceneFile& file : *engine.files) {
      text_bytes_ += file.text.size();
    }
  }
  flight_.has_audio_inputs = flight_.has_audio_inputs || has_audio_inputs;
  if (text_bytes_ > most_text_bytes) {
    lost_ = "the texts of the loaded models are too long for a flight";
  } else if (flight_.engines.size() >= most_engines) {
    lost_ = "models have been loaded more than " + std::to_string(most_engines) + " times";
  }
  if (lost_.empty()) {
    flight_.engines.push_back(std::move(engine));
  } else {
    forget();
  }
}

void FlightLog::drain(Process& process) {
  const auto end = static_cast<std::int64_t>(process.board.read().frames);
  FlightRecord record;
  for (std::size_t left = process.flight.size(); left > 0 && process.flight.pop(record); --left) {
    if (record.kind == FlightRecord::Kind::gap) {
      lost_ = "events were lost during a long load";
    } else if (records_.size() >= most_records) {
      lost_ = "more than " + std::to_string(most_records) + " events have been played";
    }
    // Engines ignore NaN and infinity.
    const bool is_number = std::isfinite(record.event.value) && std::isfinite(record.event.value2);
    if (lost_.empty() && is_number) {
      records_.push_back(record);
    } else if (!lost_.empty()) {
      forget();
    }
  }
  flight_.end_frame = end;
}

void FlightLog::forget() {
  records_ = {};
  flight_.engines = {};
  texts_ = {};
}

bool FlightLog::has_begun() const {
  return !lost_.empty() ||
         std::any_of(records_.begin(), records_.end(), [](const FlightRecord& record) {
           return record.kind == FlightRecord::Kind::take;
         });
}

Result<Flight> FlightLog::flight() const {
  if (!lost_.empty()) {
    return Error{lost_ + "; restart ressort to begin a new flight"};
  }
  if (!has_begun()) {
    return Error{"nothing has been played yet"};
  }
  Flight now = flight_;
  now.made_by = std::string(version) + " " + commit;
  now.isa = isa_name(best_isa());
  // Later records belong to the next block.
  std::copy_if(records_.begin(), records_.end(), std::back_inserter(now.records),
               [&](const FlightRecord& record) { return record.frame < now.end_frame; });
  return now;
}

}  // namespace ressort::session
