// tests: the complete audio thread, driven by a test.
#pragma once

#include "app/realtime/process.h"
#include "tests/support/player.h"

namespace ressort::support {

inline constexpr double rate = 44100.0;
inline constexpr std::size_t fade_frames = 2205;  // 50 ms

inline PlayingEngine* sounding(const std::string& text, const Preset& preset,
                               std::uint32_t serial) {
  // The direct form rounds the same for any division into blocks.
  auto compiled = compile_network(network_of(text), preset, {.method = Method::direct});
  REQUIRE(compiled);
  return new PlayingEngine{std::move(compiled->engine), serial};
}

// A model with a constant output.
inline PlayingEngine* constant(const std::string& height, std::uint32_t serial = 1) {
  return sounding("@g ground " + height + "\n@out1 posOutput @g\n", Preset{}, serial);
}

// Output 1 is the position input, which a note holds at 1 and a release returns to 0.
inline const std::string hand_text =
    "@in1 posInput 0.\n@m mass 1. 0. 0.\n@g ground 0.\n@k param 0.01\n"
    "@l springDamper @in1 @m k 0.01\n@r springDamper @m @g 0.01 0.01\n@out1 posOutput @in1\n";

inline Preset holding() {
  Preset preset;
  preset.keyboard = false;
  preset.controls.push_back({.target = "in1", .gesture = Gesture::hold});
  return preset;
}

// A free mass that a unit impulse moves by 1 per sample: its position is the elapsed time.
inline const std::string clock_text = "@m mass 1. 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n";

inline Event push(double force = 1.0) {
  return {.kind = EventKind::gesture, .gesture = Gesture::force, .index = 1, .value = force};
}

// A process and its recorded output.
struct Harness {
  explicit Harness(bool limit = false, std::size_t channels = 1)
      : process(rate, limit), out(channels) {}

  void run(std::size_t frames, std::size_t block = 256, const std::vector<MidiPacket>& midi = {}) {
    for (std::size_t at = 0; at < frames; at += block) {
      const std::size_t n = std::min(block, frames - at);
      std::vector<double*> outputs;
      for (auto& channel : out) {
        channel.resize(channel.size() + n, 1e300);
        outputs.push_back(channel.data() + channel.size() - n);
      }
      const auto now_ns = static_cast<std::int64_t>(static_cast<double>(played) / rate * 1e9);
      const HeapWatch watch;
      process.block(std::span<const double* const>(), outputs, n,
                    std::span(midi.data(), at == 0 ? midi.size() : 0), now_ns);
      heap_calls += watch.calls();
      played += n;
    }
  }
  const std::vector<double>& y() const { return out[0]; }

  // Sends events with a time tag, as OSC does.
  bool at(std::int64_t frame, const Event& event, std::size_t times = 1) {
    return process.send_ahead(std::vector<TimedEvent>(
        times, {.event = event, .timing = TimedEvent::When::at_frame, .when = frame}));
  }
  bool now(const Event& event, std::size_t times = 1) {
    return process.send(process.from_osc, std::vector<TimedEvent>(times, {.event = event}));
  }

  Process process;
  std::vector<std::vector<double>> out;
  std::size_t played = 0;
  std::size_t heap_calls = 0;
};

// The frame at which a clock model was pushed, from its output.
inline std::size_t pushed_at(const std::vector<double>& y) {
  std::size_t n = 0;
  while (n < y.size() && y[n] == 0.0) {
    ++n;
  }
  return n;
}

}  // namespace ressort::support
