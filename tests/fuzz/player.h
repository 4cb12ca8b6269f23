// fuzz: plays a model and checks its output.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "app/realtime/process.h"
#include "core/compile/compile.h"
#include "core/model/language/mdl.h"
#include "tests/support/rooms.h"

namespace ressort::fuzz {

inline void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

// A model with a struck string, a bowed mass, a plucked mass, a mass whose stiffness is an audio
// input, a body and a waveguide that are linked, and parameters for all of them.
inline const char* const model =
    "@K param 0.1\n@Z param 0.001\n@M param 1.\n@u param 0.5\n@a audioParam @in4\n"
    "@g ground 0.\n@s string 8 M K Z 0. 0.\n@m mass M 0. 0.\n@n osc 1. 0.05 0.001 0. 0.\n"
    "@l springDamper [@s 0.3] @m [a + K] Z\n@h springDamper @n @g K Z\n"
    "@B body 40. p q\n@B1 mode @B 300*K 2. 1. -0.5\n@B2 mode @B 700. 1. 0.4 0.6\n"
    "@w waveguide 1. 220. 3. 0.4 0.\n@e spring [@B p] [@w u] K Z\n@f contact [@w 0.9] @m 0.1 Z\n"
    "@in1 frcInput [@s u]\n@in2 posInput 0.\n@in3 posInput 0.\n"
    "@b nlBow @in2 @m 0.01 0.01\n@p nlPluck @in3 @n 0.02 0.01\n"
    "@out1 posOutput [@s 0.7]\n@out2 posOutput @m\n@out3 frcOutput @n\n"
    "@out4 posOutput [@B q]\n@out5 frcOutput [@w 0.5]\n";

inline const Network& network() {
  static const Network network = parse_network(model).network;
  return network;
}

// A process without a device; blocks of any length, noise at its inputs. The output is finite and
// below full scale.
class Harness {
 public:
  static constexpr double rate_hz = 48000.0;
  static constexpr std::size_t longest_block = 1024;
  static constexpr std::uint32_t serial = 1;

  Harness() {
    for (std::size_t n = 0; n < longest_block; ++n) {
      noise_[n] = static_cast<float>(0.1 * std::sin(0.3 * static_cast<double>(n * n)));
    }
  }
  explicit Harness(Compiled compiled) : Harness() { offer(std::move(compiled)); }

  void offer(Compiled compiled) {
    instrument = std::move(compiled.instrument);
    delete process.slot.collect();
    delete process.slot.offer(new PlayingEngine{std::move(compiled.engine), serial});
  }

  void block(std::size_t frames, std::span<const MidiPacket> midi = {}) {
    const std::array<const float*, 4> inputs{noise_.data(), nullptr, noise_.data(), noise_.data()};
    const std::array<float*, 2> outputs{left_.data(), right_.data()};
    process.block(std::span(inputs), std::span<float* const>(outputs), frames, midi, time_ns);
    time_ns += static_cast<std::int64_t>(1e9 * static_cast<double>(frames) / rate_hz);
    for (std::size_t n = 0; n < frames; ++n) {
      require(std::fabs(left_[n]) <= 1.0f && std::fabs(right_[n]) <= 1.0f);
    }
  }

  Process process{rate_hz};
  Instrument instrument;
  std::int64_t time_ns = 0;

 private:
  std::array<float, longest_block> noise_{};
  std::array<float, longest_block> left_{};
  std::array<float, longest_block> right_{};
};

}  // namespace ressort::fuzz
