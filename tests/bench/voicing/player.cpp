#include "tests/bench/voicing/player.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <stdexcept>

#include "app/realtime/denormals.h"
#include "app/session/compile_scene.h"

namespace ressort::voicing {
namespace {

Scene scene_of(const std::string& name, bool with_lfos) {
  auto scene = load_scene(name, {});
  if (!scene) {
    throw std::runtime_error(scene.error().message);
  }
  for (LfoSetting& setting : scene->preset.lfos) {
    setting.lfo.depth = with_lfos ? setting.lfo.depth : 0.0;
  }
  return *std::move(scene);
}

Compiled compiled_of(const Scene& scene, double rate_hz, std::optional<Precision> precision) {
  std::vector<std::string> warnings;
  auto compiled = compile_scene(scene, {.rate_hz = rate_hz, .precision = precision}, warnings);
  if (!compiled) {
    throw std::runtime_error(compiled.error().message);
  }
  return *std::move(compiled);
}

}  // namespace

Event note_on(int key, int velocity) {
  return {.kind = EventKind::note_on,
          .index = static_cast<std::uint16_t>(key),
          .value = velocity / 127.0};
}
Event note_off(int key) {
  return {.kind = EventKind::note_off,
          .index = static_cast<std::uint16_t>(key),
          .value = usual_release_velocity};
}
Event turn(int controller, double amount) {
  return {.kind = EventKind::controller,
          .index = static_cast<std::uint16_t>(controller),
          .value = amount};
}
Event press(double amount) {
  return {.kind = EventKind::pressure, .value = amount};
}

std::vector<TimedEvent> chord(int voices, int lowest, int step) {
  constexpr int keys = 64;
  std::vector<TimedEvent> events;
  for (int voice = 0; voice < voices; ++voice) {
    events.push_back({0.0, note_on(lowest + step * (voice % keys), 100)});
    events.back().event.channel = static_cast<std::uint8_t>(voice / keys);
  }
  return events;
}
std::vector<TimedEvent> chord(int voices) {
  return voices <= 16 ? chord(voices, 48, 2) : chord(voices, 28, 1);
}

Player::Player(const std::string& name, double rate_hz, bool with_lfos,
               std::optional<Precision> precision)
    : scene_(scene_of(name, with_lfos)),
      compiled_(compiled_of(scene_, rate_hz, precision)),
      rate_hz_(rate_hz),
      blocker_(rate_hz) {}

void Player::reset() {
  std::vector<TimedEvent> events = {{0.0, {.kind = EventKind::bend, .value = 0.0}}};
  for (const int pedal : {64, 66, 67}) {
    events.push_back({0.0, turn(pedal, 0.0)});
  }
  for (const ControlSetting& control : scene_.preset.controls) {
    if (control.source == ControlSource::controller && control.gesture != Gesture::pluck &&
        control.gesture != Gesture::bow) {
      events.push_back({0.0, turn(control.number, 0.0)});
    }
  }
  for (std::size_t i = 0; i < compiled_.instrument.parameters.size(); ++i) {
    events.push_back({0.0,
                      {.kind = EventKind::parameter,
                       .index = static_cast<std::uint16_t>(i),
                       .value = compiled_.instrument.parameters[i].value}});
  }
  run(events, 0.2, nullptr);
  run({{0.0, {.kind = EventKind::panic}}}, 0.1, nullptr);
}

Stereo Player::continue_playing(double seconds) {
  Stereo sound{.channels = {}, .rate_hz = rate_hz_};
  run({}, seconds, &sound);
  return sound;
}

Stereo Player::play(const std::vector<TimedEvent>& events, double seconds) {
  reset();
  Stereo sound{.channels = {}, .rate_hz = rate_hz_};
  run(events, seconds, &sound);
  return sound;
}

void Player::run(const std::vector<TimedEvent>& events, double seconds, Stereo* sound) {
  const DenormalsFlushed flushed;
  const auto count = static_cast<std::size_t>(std::max(1, compiled_.engine->output_count()));
  std::vector<std::vector<double>> block(count, std::vector<double>(block_frames));
  std::vector<double*> outputs;
  for (std::vector<double>& channel : block) {
    outputs.push_back(channel.data());
  }
  std::vector<double> coming(block_frames);
  const std::vector<const double*> inputs(
      static_cast<std::size_t>(compiled_.instrument.audio_inputs), coming.data());
  const auto frames = static_cast<std::size_t>(seconds * rate_hz_);
  std::size_t next = 0;
  for (std::size_t at = 0; at < frames; at += block_frames) {
    std::vector<Event> now;
    for (; next < events.size(); ++next) {
      const auto frame = static_cast<std::size_t>(std::llround(events[next].time_s * rate_hz_));
      if (frame >= at + block_frames) {
        break;
      }
      now.push_back(events[next].event);
      now.back().frame = static_cast<std::uint32_t>(frame > at ? frame - at : 0);
    }
    compiled_.engine->process(now, inputs, outputs, block_frames);
    blocker_.process(outputs, block_frames, compiled_.engine->may_have_dc());
    if (sound != nullptr) {
      for (std::size_t c = 0; c < 2; ++c) {
        const std::vector<double>& from = block[std::min(c, count - 1)];
        sound->channels[c].insert(sound->channels[c].end(), from.begin(), from.end());
      }
    }
  }
}

double Player::predicted_share() const {
  double ns = 0.0;
  for (const Part& part : compiled_.plan.parts) {
    ns += part.ns();
  }
  return 1e-9 * ns * rate_hz_;
}

double Player::real_time_share(double seconds, int voices) {
  double least = 1e9;
  for (int turn = 0; turn < 3; ++turn) {
    least = std::min(least, processor_share(chord(voices), seconds));
  }
  return least;
}

double Player::processor_share(const std::vector<TimedEvent>& events, double seconds) {
  reset();
  const std::clock_t start = std::clock();
  run(events, seconds, nullptr);
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / seconds;
}

}  // namespace ressort::voicing
