#include "app/commands/flight/flight_sound.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "app/session/sound_file.h"

namespace ressort::commands {

Result<Rendered> render_flight(const RenderOptions& options,
                               const std::function<bool(double)>& progress) {
  auto player = FlightPlayer::open(options.name, options.seconds.value_or(flight_heard_s));
  if (!player) {
    return player.error();
  }
  const std::string read[] = {options.name};
  if (auto spared = check_not_input(options.output, read); !spared) {
    return spared.error();
  }
  Rendered rendered{.name = std::filesystem::path(options.name).stem().string(),
                    .rate_hz = player->rate_hz(),
                    .channels = static_cast<int>(player->channels()),
                    .warnings = player->warnings()};
  if (progress && !progress(0.0)) {
    return Error{"interrupted before the first sample"};
  }
  auto file = SoundWriter::open(options.output,
                                {.rate_hz = rendered.rate_hz,
                                 .channels = rendered.channels,
                                 .samples = options.format,
                                 .frames = player->frames()},
                                Existing::replace);
  if (!file) {
    return file.error();
  }
  double energy = 0.0;
  std::vector<double> samples;
  const auto played = player->play(
      [&](std::span<const float> heard) -> Result<Done> {
        samples.assign(heard.begin(), heard.end());
        for (const double sample : samples) {
          rendered.peak = std::max(rendered.peak, std::fabs(sample));
          energy += sample * sample;
        }
        const std::size_t frames = samples.size() / player->channels();
        rendered.frames += static_cast<long long>(frames);
        auto wrote = file->write(samples.data(), frames);
        if (!wrote) {
          rendered.failure = wrote.error();
        }
        return wrote;
      },
      [&](double share) {
        rendered.was_interrupted = progress && !progress(share);
        return !rendered.was_interrupted;
      });
  if (rendered.failure) {
    return rendered;
  }
  if (!played && !rendered.was_interrupted) {
    return played.error();
  }
  if (auto closed = file->close(); !closed) {
    rendered.failure = closed.error();
  }
  rendered.rms =
      std::sqrt(energy / std::max(1.0, static_cast<double>(rendered.frames * rendered.channels)));
  return rendered;
}

Result<SampleTape> tape_of(const FlightPlayer& player,
                           const std::function<bool(double)>& progress) {
  SampleTape tape{.channels = player.channels(), .samples = {}};
  const auto played = player.play(
      [&](std::span<const float> heard) -> Result<Done> {
        tape.samples.insert(tape.samples.end(), heard.begin(), heard.end());
        return Done{};
      },
      progress);
  return played ? Result<SampleTape>(std::move(tape)) : played.error();
}

}  // namespace ressort::commands
