// tests: an engine from compile_network(), played and recorded.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/compile/compile.h"
#include "core/engine/engine.h"
#include "tests/support/harness.h"
#include "tests/support/heap.h"

namespace ressort::support {

inline Event note_on(std::uint32_t frame, int key, double velocity = 1.0) {
  return {.frame = frame,
          .kind = EventKind::note_on,
          .index = static_cast<std::uint16_t>(key),
          .value = velocity};
}
inline Event note_off(std::uint32_t frame, int key, double velocity = usual_release_velocity) {
  return {.frame = frame,
          .kind = EventKind::note_off,
          .index = static_cast<std::uint16_t>(key),
          .value = velocity};
}
inline Event controller(std::uint32_t frame, int number, double value) {
  return {.frame = frame,
          .kind = EventKind::controller,
          .index = static_cast<std::uint16_t>(number),
          .value = value};
}
inline Event parameter(std::uint32_t frame, int index, double value) {
  return {.frame = frame,
          .kind = EventKind::parameter,
          .index = static_cast<std::uint16_t>(index),
          .value = value};
}

// Every note strikes input 1 with a force proportional to velocity.
inline Preset struck(int voices) {
  Preset preset;
  preset.voices = voices;
  preset.controls.push_back(
      {.target = "in1", .gesture = Gesture::impulse, .low = 0.0, .high = 0.1});
  return preset;
}

// A string that rings for seconds.
inline std::string ringing_string() {
  return scenes::string("s", 10, "0.1", "0.0005") + "@in1 frcInput @s_m2\n" +
         scenes::output(1, "s_m6");
}

// An engine and its recorded output.
class Player {
 public:
  explicit Player(Compiled made)
      : compiled(std::move(made)), out(static_cast<std::size_t>(compiled.instrument.outputs)) {}
  Player(const std::string& text, const Preset& preset, const CompileOptions& options = {}) {
    auto made = compile_network(network_of(text), preset, options);
    REQUIRE(made);
    compiled = *std::move(made);
    out.resize(static_cast<std::size_t>(compiled.instrument.outputs));
  }

  // `events` are sorted and count frames from the start of this run; block lengths repeat
  // cyclically.
  void run(std::size_t frames, const std::vector<Event>& events = {},
           const std::vector<std::size_t>& blocks = {256},
           std::span<const double* const> inputs = {}) {
    std::size_t next = 0;
    std::size_t turn = 0;
    for (std::size_t at = 0; at < frames;) {
      const std::size_t n = std::min(blocks[turn++ % blocks.size()], frames - at);
      std::vector<Event> due;
      for (; next < events.size() && events[next].frame < at + n; ++next) {
        due.push_back(events[next]);
        due.back().frame -= static_cast<std::uint32_t>(at);
      }
      std::vector<double*> outputs;
      for (auto& channel : out) {
        channel.resize(channel.size() + n, 1e300);  // Overwritten by process().
        outputs.push_back(channel.data() + channel.size() - n);
      }
      std::vector<const double*> here;
      for (const double* const input : inputs) {
        here.push_back(input == nullptr ? nullptr : input + at);
      }
      const HeapWatch watch;
      compiled.engine->process(due, here, outputs, n);
      heap_calls += watch.calls();
      at += n;
    }
  }

  Engine& engine() { return *compiled.engine; }
  const std::vector<double>& y() const { return out[0]; }

  Compiled compiled;
  std::vector<std::vector<double>> out;  // [channel]
  std::size_t heap_calls = 0;            // During process().
};

inline double peak(std::span<const double> y) {
  double most = 0.0;
  for (const double sample : y) {
    most = std::max(most, std::fabs(sample));
  }
  return most;
}

inline double largest_step(std::span<const double> y) {
  double most = 0.0;
  for (std::size_t n = 1; n < y.size(); ++n) {
    most = std::max(most, std::fabs(y[n] - y[n - 1]));
  }
  return most;
}

}  // namespace ressort::support
