#include <alsa/asoundlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <thread>
#include <vector>

#include "app/devices/audio.h"

namespace ressort {
namespace {

constexpr int periods = 3;
constexpr snd_pcm_format_t formats[] = {SND_PCM_FORMAT_FLOAT, SND_PCM_FORMAT_S32,
                                        SND_PCM_FORMAT_S16};

struct Alsa {
  explicit Alsa(Process& process_in) : process(process_in) {}
  ~Alsa() {
    if (pcm != nullptr) {
      snd_pcm_close(pcm);
    }
  }

  void run();
  void interleave();
  bool write();

  Process& process;
  snd_pcm_t* pcm = nullptr;
  snd_pcm_format_t format = SND_PCM_FORMAT_FLOAT;
  unsigned channels = 2;
  unsigned rate_hz = 48000;
  snd_pcm_uframes_t frames = 256;
  bool is_timed = false;       // the device takes everything at once: we keep the time
  std::vector<float> samples;  // [channel][frame]
  std::vector<float*> outputs;
  std::vector<std::byte> packed;  // [frame][channel] in the device's format
  Flag stop;
  Flag lost;
  std::thread thread;
};

// The process never passes full scale, so that nothing has to be clipped here.
void Alsa::interleave() {
  const auto fill = [&](auto zero, double scale) {
    using Sample = decltype(zero);
    auto* const target = reinterpret_cast<Sample*>(packed.data());
    for (std::size_t n = 0; n < frames; ++n) {
      for (std::size_t c = 0; c < channels; ++c) {
        target[n * channels + c] = static_cast<Sample>(static_cast<double>(outputs[c][n]) * scale);
      }
    }
  };
  switch (format) {
    case SND_PCM_FORMAT_S32:
      fill(std::int32_t{}, 2147483647.0);
      break;
    case SND_PCM_FORMAT_S16:
      fill(std::int16_t{}, 32767.0);
      break;
    default:
      fill(float{}, 1.0);
      break;
  }
}

// False when the device is gone for good.
bool Alsa::write() {
  const std::size_t frame_bytes =
      channels * static_cast<std::size_t>(snd_pcm_format_physical_width(format)) / 8;
  snd_pcm_uframes_t done = 0;
  while (done < frames && !stop.is_raised()) {
    const snd_pcm_sframes_t wrote =
        snd_pcm_writei(pcm, packed.data() + done * frame_bytes, frames - done);
    if (wrote >= 0) {
      done += static_cast<snd_pcm_uframes_t>(wrote);
      continue;
    }
    if (wrote == -EPIPE) {
      process.xruns.add(1);
    }
    if (snd_pcm_recover(pcm, static_cast<int>(wrote), 1) < 0) {
      return false;
    }
  }
  return true;
}

void Alsa::run() {
  raise_priority();
  const double period_ns = 1e9 * static_cast<double>(frames) / rate_hz;
  const std::int64_t start = monotonic_ns();
  for (std::uint64_t n = 0; !stop.is_raised(); ++n) {
    if (is_timed) {
      const auto due =
          start + static_cast<std::int64_t>(std::llround(period_ns * static_cast<double>(n)));
      sleep_until(due);
    }
    process.block(std::span<const float* const>(), std::span<float* const>(outputs), frames, {},
                  monotonic_ns());
    interleave();
    if (!write()) {
      lost.raise();
      return;
    }
  }
}

// Settles format, channels, rate and period with the device; the first call that fails says why.
int configure(Alsa& alsa, const AudioOptions& options) {
  snd_pcm_hw_params_t* hardware = nullptr;
  snd_pcm_hw_params_alloca(&hardware);
  int failure = snd_pcm_hw_params_any(alsa.pcm, hardware);
  const auto step = [&](int result) { failure = failure < 0 ? failure : result; };
  step(snd_pcm_hw_params_set_access(alsa.pcm, hardware, SND_PCM_ACCESS_RW_INTERLEAVED));
  const auto* format =
      std::find_if(std::begin(formats), std::end(formats), [&](snd_pcm_format_t wanted) {
        return snd_pcm_hw_params_test_format(alsa.pcm, hardware, wanted) == 0;
      });
  alsa.format = format != std::end(formats) ? *format : SND_PCM_FORMAT_S16;
  alsa.channels = static_cast<unsigned>(std::max(2, options.outputs));
  alsa.rate_hz = static_cast<unsigned>(options.rate_hz);
  alsa.frames = static_cast<snd_pcm_uframes_t>(options.period_frames);
  snd_pcm_uframes_t buffer = alsa.frames * periods;
  step(snd_pcm_hw_params_set_format(alsa.pcm, hardware, alsa.format));
  step(snd_pcm_hw_params_set_channels_near(alsa.pcm, hardware, &alsa.channels));
  step(snd_pcm_hw_params_set_rate_near(alsa.pcm, hardware, &alsa.rate_hz, nullptr));
  step(snd_pcm_hw_params_set_period_size_near(alsa.pcm, hardware, &alsa.frames, nullptr));
  step(snd_pcm_hw_params_set_buffer_size_near(alsa.pcm, hardware, &buffer));
  step(snd_pcm_hw_params(alsa.pcm, hardware));
  return failure;
}

void say_nothing(const char*, int, const char*, int, const char*, ...) {}

}  // namespace

Result<AudioDevice> open_alsa(Process& process, const AudioOptions& options) {
  snd_lib_error_set_handler(say_nothing);
  auto alsa = std::make_shared<Alsa>(process);
  int failure = snd_pcm_open(&alsa->pcm, options.device.c_str(), SND_PCM_STREAM_PLAYBACK, 0);
  if (failure < 0) {
    return Error{"the ALSA device '" + options.device +
                 "' does not open: " + snd_strerror(failure) +
                 "; 'aplay -L' lists the devices, -d NAME chooses one, -a dummy does without"};
  }
  failure = configure(*alsa, options);
  if (failure < 0) {
    return Error{"the ALSA device '" + options.device +
                 "' takes none of our settings: " + snd_strerror(failure)};
  }
  alsa->is_timed = snd_pcm_type(alsa->pcm) == SND_PCM_TYPE_NULL;
  alsa->samples.resize(alsa->channels * alsa->frames);
  alsa->packed.resize(alsa->samples.size() * 4);
  for (std::size_t c = 0; c < alsa->channels; ++c) {
    alsa->outputs.push_back(alsa->samples.data() + c * alsa->frames);
  }
  process.set_rate(alsa->rate_hz);
  alsa->thread = std::thread([alsa = alsa.get()] { alsa->run(); });
  AudioDevice device;
  device.rate_hz = alsa->rate_hz;
  device.description = "ALSA '" + options.device + "', " + std::to_string(alsa->rate_hz) + " Hz, " +
                       std::to_string(alsa->frames) + " frames";
  device.close = [alsa] {
    alsa->stop.raise();
    alsa->thread.join();
  };
  device.is_lost = [alsa] { return alsa->lost.is_raised(); };
  device.set_audio_inputs = [](int) {};
  device.tick = [] {};
  device.wiring = [] { return Wiring{}; };
  return device;
}

}  // namespace ressort
