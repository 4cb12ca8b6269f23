#include <alsa/asoundlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <thread>
#include <type_traits>
#include <vector>

#include "app/devices/audio.h"
#include "app/say.h"

namespace ressort::devices {
namespace {

constexpr int periods = 3;
constexpr int most_captured = 2;  // channels
constexpr snd_pcm_format_t formats[] = {SND_PCM_FORMAT_FLOAT, SND_PCM_FORMAT_S32,
                                        SND_PCM_FORMAT_S16};

// One direction of a device, with the settings that the device accepted.
struct Stream {
  ~Stream() {
    if (pcm != nullptr) {
      snd_pcm_close(pcm);
    }
  }

  snd_pcm_t* pcm = nullptr;
  snd_pcm_format_t format = SND_PCM_FORMAT_FLOAT;
  unsigned channels = 2;
  unsigned rate_hz = 48000;
  snd_pcm_uframes_t frames = 256;
  std::vector<std::byte> packed;  // [frame][channel] in the device's format
};

// The audio inputs. They are read one period late, so that a device that is slightly out of step
// always has data.
struct Capture {
  Stream stream;
  bool is_filled = false;
  std::vector<float> samples;  // [channel][frame]
  std::vector<const float*> inputs;
};

// Calls use(samples, full_scale) with the stream's packed samples in their own type.
template <class Use>
void with_samples(Stream& stream, Use&& use) {
  void* const packed = stream.packed.data();
  switch (stream.format) {
    case SND_PCM_FORMAT_S32:
      return use(static_cast<std::int32_t*>(packed), 2147483648.0);
    case SND_PCM_FORMAT_S16:
      return use(static_cast<std::int16_t*>(packed), 32768.0);
    default:
      return use(static_cast<float*>(packed), 1.0);
  }
}

struct Alsa {
  explicit Alsa(Process& process_in) : process(process_in) {}

  void run();
  void interleave();
  bool write();
  std::span<const float* const> listen();

  Process& process;
  std::string device;
  Stream out;
  std::unique_ptr<Capture> in;  // opened when a model needs audio inputs; stays open
  Published<Capture*> captured;
  bool is_timed = false;       // the device accepts any amount at once: this thread keeps the time
  std::vector<float> samples;  // [channel][frame]
  std::vector<float*> outputs;
  Flag stop;
  Flag lost;
  std::thread thread;
};

// Converts the output to the device's format. The process limits it to full scale, so nothing
// clips.
void Alsa::interleave() {
  with_samples(out, [&](auto* target, double full_scale) {
    using Sample = std::remove_pointer_t<decltype(target)>;
    // The largest whole number is one less than full scale.
    const double scale = std::is_integral_v<Sample> ? full_scale - 1.0 : full_scale;
    for (std::size_t n = 0; n < out.frames; ++n) {
      for (std::size_t c = 0; c < out.channels; ++c) {
        target[n * out.channels + c] =
            static_cast<Sample>(static_cast<double>(outputs[c][n]) * scale);
      }
    }
  });
}

// Writes a period to the device; false if the device is lost.
bool Alsa::write() {
  const std::size_t frame_bytes =
      out.channels * static_cast<std::size_t>(snd_pcm_format_physical_width(out.format)) / 8;
  snd_pcm_uframes_t done = 0;
  while (done < out.frames && !stop.is_raised()) {
    const snd_pcm_sframes_t wrote =
        snd_pcm_writei(out.pcm, out.packed.data() + done * frame_bytes, out.frames - done);
    if (wrote >= 0) {
      done += static_cast<snd_pcm_uframes_t>(wrote);
      continue;
    }
    if (wrote == -EPIPE) {
      process.xruns.add(1);
    }
    if (snd_pcm_recover(out.pcm, static_cast<int>(wrote), 1) < 0) {
      return false;
    }
  }
  return true;
}

void Alsa::run() {
  raise_priority();
  const double period_ns = 1e9 * static_cast<double>(out.frames) / out.rate_hz;
  const std::int64_t start = monotonic_ns();
  for (std::uint64_t n = 0; !stop.is_raised(); ++n) {
    if (is_timed) {
      const auto due =
          start + static_cast<std::int64_t>(std::llround(period_ns * static_cast<double>(n)));
      sleep_until(due);
    }
    process.block(listen(), std::span<float* const>(outputs), out.frames, {}, monotonic_ns());
    interleave();
    if (!write()) {
      lost.raise();
      return;
    }
  }
}

// Returns the next period of the inputs, or silence if the device has no data.
std::span<const float* const> Alsa::listen() {
  Capture* const capture = captured.get();
  if (capture == nullptr) {
    return {};
  }
  Stream& stream = capture->stream;
  const auto wanted = static_cast<snd_pcm_sframes_t>(out.frames);
  snd_pcm_sframes_t there = snd_pcm_avail_update(stream.pcm);
  if (there < 0) {
    process.xruns.add(1);
    capture->is_filled = false;
    if (snd_pcm_recover(stream.pcm, static_cast<int>(there), 1) == 0) {
      snd_pcm_start(stream.pcm);
    }
    there = 0;
  }
  capture->is_filled = there >= (capture->is_filled ? wanted : 2 * wanted);
  snd_pcm_sframes_t got = 0;
  if (capture->is_filled) {
    got =
        std::max<snd_pcm_sframes_t>(0, snd_pcm_readi(stream.pcm, stream.packed.data(), out.frames));
  }
  with_samples(stream, [&](const auto* source, double full_scale) {
    const auto scale = static_cast<float>(1.0 / full_scale);
    for (std::size_t c = 0; c < stream.channels; ++c) {
      for (std::size_t n = 0; n < out.frames; ++n) {
        capture->samples[c * out.frames + n] =
            n < static_cast<std::size_t>(got)
                ? static_cast<float>(source[n * stream.channels + c]) * scale
                : 0.0f;
      }
    }
  });
  return capture->inputs;
}

// Negotiates format, channels, rate and period with the device. Returns the first error.
int configure(Stream& alsa, unsigned channels, double rate_hz, snd_pcm_uframes_t frames) {
  snd_pcm_hw_params_t* hardware = nullptr;
  snd_pcm_hw_params_alloca(&hardware);
  int failure = snd_pcm_hw_params_any(alsa.pcm, hardware);
  const auto step = [&](int result) { failure = failure < 0 ? failure : result; };
  step(snd_pcm_hw_params_set_access(alsa.pcm, hardware, SND_PCM_ACCESS_RW_INTERLEAVED));
  const auto* format = std::ranges::find_if(formats, [&](snd_pcm_format_t wanted) {
    return snd_pcm_hw_params_test_format(alsa.pcm, hardware, wanted) == 0;
  });
  alsa.format = format != std::end(formats) ? *format : SND_PCM_FORMAT_S16;
  alsa.channels = channels;
  alsa.rate_hz = static_cast<unsigned>(rate_hz);
  alsa.frames = frames;
  snd_pcm_uframes_t buffer = alsa.frames * periods;
  step(snd_pcm_hw_params_set_format(alsa.pcm, hardware, alsa.format));
  step(snd_pcm_hw_params_set_channels_near(alsa.pcm, hardware, &alsa.channels));
  step(snd_pcm_hw_params_set_rate_near(alsa.pcm, hardware, &alsa.rate_hz, nullptr));
  step(snd_pcm_hw_params_set_period_size_near(alsa.pcm, hardware, &alsa.frames, nullptr));
  step(snd_pcm_hw_params_set_buffer_size_near(alsa.pcm, hardware, &buffer));
  step(snd_pcm_hw_params(alsa.pcm, hardware));
  alsa.packed.resize(alsa.channels * alsa.frames * 4);
  return failure;
}

// Opens the device's inputs for a model. If that fails, reports it; the model gets silence.
void open_capture(Alsa& alsa, int wanted) {
  if (wanted <= 0 || alsa.in != nullptr) {
    return;
  }
  auto capture = std::make_unique<Capture>();
  Stream& stream = capture->stream;
  int failure =
      snd_pcm_open(&stream.pcm, alsa.device.c_str(), SND_PCM_STREAM_CAPTURE, SND_PCM_NONBLOCK);
  if (failure >= 0) {
    failure =
        configure(stream, static_cast<unsigned>(most_captured), alsa.out.rate_hz, alsa.out.frames);
  }
  if (failure >= 0) {
    failure = snd_pcm_start(stream.pcm);
  }
  if (failure < 0 || stream.rate_hz != alsa.out.rate_hz) {
    say("the ALSA device '" + alsa.device + "' has no inputs for the model: " +
        (failure < 0 ? snd_strerror(failure) : "their sample rate differs"));
    return;
  }
  stream.packed.resize(stream.channels * alsa.out.frames * 4);
  capture->samples.resize(stream.channels * alsa.out.frames);
  for (std::size_t c = 0; c < stream.channels; ++c) {
    capture->inputs.push_back(capture->samples.data() + c * alsa.out.frames);
  }
  alsa.in = std::move(capture);
  alsa.captured.set(alsa.in.get());
}

void ignore_message(const char*, int, const char*, int, const char*, ...) {}

}  // namespace

Result<AudioDevice> open_alsa(Process& process, const AudioOptions& options) {
  snd_lib_error_set_handler(ignore_message);
  auto alsa = std::make_shared<Alsa>(process);
  alsa->device = options.device;
  int failure = snd_pcm_open(&alsa->out.pcm, options.device.c_str(), SND_PCM_STREAM_PLAYBACK, 0);
  if (failure < 0) {
    return Error{"cannot open the ALSA device '" + options.device + "': " + snd_strerror(failure) +
                 "; 'aplay -L' lists the devices, -d NAME selects one, -a dummy plays silently"};
  }
  failure = configure(alsa->out, static_cast<unsigned>(std::max(2, options.outputs)),
                      options.rate_hz, static_cast<snd_pcm_uframes_t>(options.period_frames));
  if (failure < 0) {
    return Error{"the ALSA device '" + options.device +
                 "' rejects all settings: " + snd_strerror(failure)};
  }
  alsa->is_timed = snd_pcm_type(alsa->out.pcm) == SND_PCM_TYPE_NULL;
  alsa->samples.resize(alsa->out.channels * alsa->out.frames);
  for (std::size_t c = 0; c < alsa->out.channels; ++c) {
    alsa->outputs.push_back(alsa->samples.data() + c * alsa->out.frames);
  }
  process.set_rate(alsa->out.rate_hz);
  alsa->thread = std::thread([alsa = alsa.get()] { alsa->run(); });
  AudioDevice device;
  device.rate_hz = alsa->out.rate_hz;
  device.priority = audio_priority;
  device.description = "ALSA '" + options.device + "', " + std::to_string(alsa->out.rate_hz) +
                       " Hz, " + std::to_string(alsa->out.frames) + " frames";
  device.running = std::shared_ptr<void>(alsa.get(), [alsa](void*) {
    alsa->stop.raise();
    alsa->thread.join();
  });
  device.is_lost = [alsa] { return alsa->lost.is_raised(); };
  device.set_audio_inputs = [alsa](int wanted) { open_capture(*alsa, wanted); };
  device.tick = [] {};
  device.wiring = [] { return Wiring{}; };
  return device;
}

}  // namespace ressort::devices
