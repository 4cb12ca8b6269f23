// app/devices: a silent backend driven by a timer.

#include <cmath>
#include <memory>
#include <thread>
#include <vector>

#include "app/devices/audio.h"

namespace ressort::devices {
namespace {

struct Dummy {
  Dummy(Process& process_in, const AudioOptions& options)
      : process(process_in),
        rate_hz(options.rate_hz),
        frames(static_cast<std::size_t>(options.period_frames)),
        samples(static_cast<std::size_t>(std::max(2, options.outputs)) * frames) {
    for (std::size_t i = 0; i < samples.size(); i += frames) {
      outputs.push_back(samples.data() + i);
    }
  }

  void run() {
    raise_priority();
    const double period_ns = 1e9 * static_cast<double>(frames) / rate_hz;
    const std::int64_t start = monotonic_ns();
    for (std::uint64_t n = 0; !stop.is_raised(); ++n) {
      const auto due =
          start + static_cast<std::int64_t>(std::llround(period_ns * static_cast<double>(n)));
      sleep_until(due);
      process.block(std::span<const float* const>(), std::span<float* const>(outputs), frames, {},
                    due);
    }
  }

  Process& process;
  double rate_hz;
  std::size_t frames;
  std::vector<float> samples;
  std::vector<float*> outputs;
  Flag stop;
  std::thread thread;
};

}  // namespace

Result<AudioDevice> open_dummy(Process& process, const AudioOptions& options) {
  auto dummy = std::make_shared<Dummy>(process, options);
  process.set_rate(options.rate_hz);
  dummy->thread = std::thread([dummy = dummy.get()] { dummy->run(); });
  AudioDevice device;
  device.rate_hz = options.rate_hz;
  device.priority = audio_priority;
  device.description = "dummy (silent), " + std::to_string(static_cast<int>(options.rate_hz)) +
                       " Hz, " + std::to_string(options.period_frames) + " frames";
  device.running = std::shared_ptr<void>(dummy.get(), [dummy](void*) {
    dummy->stop.raise();
    dummy->thread.join();
  });
  device.is_lost = [] { return false; };
  device.set_audio_inputs = [](int) {};
  device.tick = [] {};
  device.wiring = [] { return Wiring{}; };
  return device;
}

}  // namespace ressort::devices
