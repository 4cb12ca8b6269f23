#include "app/commands/flight/flight_player.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <utility>

#include "app/session/files.h"
#include "app/session/sound_file.h"
#include "app/version.h"
#include "core/kernels/isa.h"

namespace ressort::commands {
namespace {

using Kind = FlightRecord::Kind;

Error out_of_order(std::int64_t frame) {
  return Error{"the flight has events out of order at frame " + std::to_string(frame)};
}

}  // namespace

FlightPlayer::FlightPlayer(Flight flight, double heard_s) : flight_(std::move(flight)) {
  // The played part must have one sample rate and one number of channels.
  for (const FlightRecord& record : flight_.records) {
    if (record.kind == Kind::rate) {
      rate_hz_ = record.event.value;
      heard_from_ = record.frame;
    } else if (record.kind == Kind::period &&
               std::exchange(channels_, record.channels) != record.channels) {
      heard_from_ = record.frame;
    }
  }
  const auto wanted = static_cast<std::int64_t>(std::llround(heard_s * rate_hz_));
  heard_from_ = std::max(heard_from_, flight_.end_frame - wanted);
}

Result<FlightPlayer> FlightPlayer::open(const std::string& path, double heard_s) {
  const auto text = read_text(path, max_flight_bytes);
  if (!text) {
    return text.error();
  }
  auto flight = parse_flight(*text);
  if (!flight) {
    return Error{to_string(finding_of(path, "", flight.error()))};
  }
  FlightPlayer player(*std::move(flight), heard_s);
  if (player.rate_hz_ <= 0.0 || player.channels_ == 0 || player.frames() <= 0) {
    return Error{"'" + path + "': the flight has no sound"};
  }
  return player;
}

std::vector<std::string> FlightPlayer::warnings() const {
  std::vector<std::string> all;
  const std::string ours = std::string(version) + " " + commit;
  if (flight_.made_by != ours) {
    all.push_back("the flight was made by ressort " + flight_.made_by + ", this is " + ours +
                  "; it may sound different");
  }
  if (flight_.isa != isa_name(best_isa())) {
    all.push_back("the flight was made with the instruction set " + flight_.isa +
                  ", this machine has " + std::string(isa_name(best_isa())) +
                  "; samples may differ in their last bits");
  }
  if (flight_.has_audio_inputs) {
    all.emplace_back("the flight does not contain the audio inputs");
  }
  return all;
}

Result<Done> FlightPlayer::play(const std::function<Result<Done>(std::span<const float>)>& hear,
                                const std::function<bool(double)>& progress) const {
  const std::int64_t base = flight_.records.front().frame;
  Process process(rate_hz_);
  std::vector<float> samples;
  std::vector<float> interleaved;
  std::vector<float*> outputs;
  std::size_t channels = 0;
  std::int64_t period = 0;
  std::int64_t left = 0;  // remaining frames of the block
  std::size_t next = 0;
  const auto& records = flight_.records;
  for (std::int64_t frame = base; frame < flight_.end_frame;) {
    // Events before the block, then events within the chunk.
    for (; next < records.size() && records[next].frame <= frame && left == 0 &&
           records[next].kind != Kind::event && records[next].kind != Kind::take;
         ++next) {
      const FlightRecord& record = records[next];
      if (record.kind == Kind::period) {
        period = record.count;
        channels = record.channels;
        samples.assign(channels * Process::chunk_frames, 0.0f);
        outputs.clear();
        for (std::size_t c = 0; c < channels; ++c) {
          outputs.push_back(samples.data() + c * Process::chunk_frames);
        }
      } else {
        process.repeat(record);
      }
    }
    if (period == 0) {
      return out_of_order(frame);
    }
    left = left == 0 ? period : left;
    const std::int64_t count =
        std::min<std::int64_t>(left, static_cast<std::int64_t>(Process::chunk_frames));
    for (; next < records.size() && records[next].frame < frame + count &&
           (records[next].kind == Kind::event || records[next].kind == Kind::take);
         ++next) {
      FlightRecord record = records[next];
      record.frame -= base;
      if (record.kind == Kind::event) {
        process.repeat(record);
        continue;
      }
      const auto made_of = std::ranges::find(flight_.engines, record.count, &FlightEngine::number);
      if (made_of == flight_.engines.end()) {
        return Error{"the flight has no engine " + std::to_string(record.count)};
      }
      auto engine = make_flight_engine(flight_, *made_of);
      if (!engine) {
        return engine.error();
      }
      auto sounding = std::make_unique<PlayingEngine>();
      sounding->engine = *std::move(engine);
      sounding->serial = made_of->serial;
      sounding->lets_ring = made_of->lets_ring;
      sounding->has_new_numbers = made_of->has_new_numbers;
      delete process.slot.offer(sounding.release());
    }
    if (next < records.size() && records[next].frame < frame + count && left > count) {
      return out_of_order(records[next].frame);
    }
    process.block(std::span<const float* const>(), std::span<float* const>(outputs),
                  static_cast<std::size_t>(count), {}, 0);
    delete process.slot.collect();
    if (frame + count > heard_from_) {
      const auto first = static_cast<std::size_t>(std::max<std::int64_t>(0, heard_from_ - frame));
      interleaved.clear();
      for (std::size_t n = first; n < static_cast<std::size_t>(count); ++n) {
        for (std::size_t c = 0; c < channels; ++c) {
          interleaved.push_back(outputs[c][n]);
        }
      }
      if (auto heard = hear(interleaved); !heard) {
        return heard;
      }
    }
    frame += count;
    left -= count;
    if (!progress(static_cast<double>(frame - base) /
                  static_cast<double>(flight_.end_frame - base))) {
      return Error{"interrupted"};
    }
  }
  return Done{};
}

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
