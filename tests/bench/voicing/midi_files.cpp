#include "tests/bench/voicing/midi_files.h"

#include <time.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <utility>

#include "app/commands/smf/midi_file.h"
#include "app/realtime/process.h"
#include "app/session/compile_scene.h"
#include "app/session/loader.h"
#include "tests/bench/voicing/sound.h"
#include "tests/support/rooms.h"

namespace ressort::voicing {
namespace {

constexpr double rate_hz = 48000.0;
constexpr double longest_ring_s = 30.0;  // of notes that no damper ends, after the file
constexpr double least_lufs = -30.0;
constexpr double most_lufs = -3.0;

// CPU time of this thread. The process measures its load with it, so that other programs on this
// machine do not count.
std::int64_t cpu_ns() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return std::int64_t{1'000'000'000} * time.tv_sec + time.tv_nsec;
}

struct Played {
  double lufs = -200.0;      // after the limiter
  double peak = 0.0;         // before the limiter, linear
  double limited = 0.0;      // share of the blocks with a peak above full scale
  double rings_s = 0.0;      // from the end of the file to the end of the last voice
  int hung = 0;              // voices that have not ended then
  int voices = 0;            // greatest number of audible voices
  std::uint64_t stolen = 0;  // voices stolen by new notes
  std::uint64_t shed = 0;
  std::uint64_t wrong = 0;    // unstable voices and messages that are not understood
  double load = 0.0;          // mean share of one core
  double busiest_load = 0.0;  // in the busiest second
};

Played play(const Scene& scene, const MidiFile& midi) {
  std::vector<std::string> warnings;
  auto compiled = compile_scene(scene, {.rate_hz = rate_hz}, warnings);
  if (!compiled) {
    throw std::runtime_error(compiled.error().message);
  }
  Process process(rate_hz, false, cpu_ns);
  process.slot.offer(new PlayingEngine{std::move(compiled->engine), 1});
  Limiter limiter(rate_hz);
  Played played;
  Stereo sound{.channels = {}, .rate_hz = rate_hz};
  std::array<std::array<double, block_frames>, 2> block{};
  const std::array<double*, 2> outputs = {block[0].data(), block[1].data()};
  const auto length = static_cast<long long>(midi.length_s * rate_hz);
  const auto longest = length + std::llround(longest_ring_s * rate_hz);
  std::vector<MidiPacket> packets;
  std::size_t next = 0;
  std::int64_t all_ns = 0;
  std::int64_t second_ns = 0;
  long long limited = 0;
  long long at = 0;
  for (; at < length || (at < longest && process.meters().stepped > 0); at += block_frames) {
    packets.clear();
    for (; next < midi.messages.size(); ++next) {
      const MidiFile::Message& message = midi.messages[next];
      const long long frame = std::llround(message.time_s * rate_hz) - at;
      if (frame >= static_cast<long long>(block_frames)) {
        break;
      }
      packets.push_back({static_cast<std::uint32_t>(frame), midi.bytes_of(message)});
    }
    const std::int64_t start_ns = cpu_ns();
    process.block(std::span<const double* const>(), std::span<double* const>(outputs), block_frames,
                  packets, 0);
    const std::int64_t took_ns = cpu_ns() - start_ns;
    all_ns += took_ns;
    second_ns += took_ns;
    constexpr auto second = static_cast<long long>(rate_hz / block_frames);
    if (at / static_cast<long long>(block_frames) % second == second - 1) {
      const double load = 1e-9 * static_cast<double>(second_ns) * rate_hz /
                          static_cast<double>(second * static_cast<long long>(block_frames));
      played.busiest_load = std::max(played.busiest_load, load);
      second_ns = 0;
    }
    played.voices = std::max(played.voices, process.meters().voices);
    double peak = 0.0;
    for (const auto& channel : block) {
      for (const double sample : channel) {
        peak = std::max(peak, std::fabs(sample));
      }
    }
    limiter.process(outputs, block_frames);
    for (std::size_t c = 0; c < block.size(); ++c) {
      sound.channels[c].insert(sound.channels[c].end(), block[c].begin(), block[c].end());
    }
    played.peak = std::max(played.peak, peak);
    limited += peak > Limiter::ceiling ? 1 : 0;
  }
  const Meters meters = process.meters();
  played.lufs = loudness_lufs(sound);
  played.limited =
      static_cast<double>(limited * static_cast<long long>(block_frames)) / static_cast<double>(at);
  played.rings_s = static_cast<double>(at - length) / rate_hz;
  played.hung = meters.stepped;
  played.stolen = meters.stolen;
  played.shed = meters.shed;
  played.wrong = meters.resets + meters.malformed + meters.dropped;
  played.load = 1e-9 * static_cast<double>(all_ns) * rate_hz / static_cast<double>(at);
  return played;
}

MidiFile read(const std::string& path, double seconds) {
  auto midi = read_midi_file(path);
  if (!midi) {
    throw std::runtime_error(midi.error().message);
  }
  if (seconds > 0.0 && midi->length_s > seconds) {
    std::erase_if(midi->messages,
                  [&](const MidiFile::Message& message) { return message.time_s > seconds; });
    midi->length_s = seconds;
    release_all(*midi);
  }
  return *std::move(midi);
}

const char* mark(bool is_broken) {
  return is_broken ? " !" : "";
}

}  // namespace

void print_midi_head() {
  std::printf(
      "| preset | file | LUFS | peak dBFS | limited %% | voices | stolen | shed | rings s | hung "
      "| wrong | CPU %% | busiest s |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
}

int play_midi_files(const std::string& preset, const std::vector<std::string>& files,
                    double seconds) {
  const auto scene = load_scene(preset, {});
  if (!scene) {
    throw std::runtime_error(scene.error().message);
  }
  int broken = 0;
  Played all;
  double quietest_lufs = 1e9;
  double loudest_lufs = -1e9;
  for (const std::string& path : files) {
    const Played played = play(*scene, read(path, seconds));
    const bool is_level_wrong = played.lufs < least_lufs || played.lufs > most_lufs;
    std::printf(
        "| %s | %s | %.1f%s | %.1f | %.2f | %d | %llu | %llu%s | %.1f | %d%s | %llu%s | %.1f | "
        "%.1f |\n",
        preset.c_str(), std::filesystem::path(path).stem().c_str(), played.lufs,
        mark(is_level_wrong), decibels(played.peak), 100.0 * played.limited, played.voices,
        static_cast<unsigned long long>(played.stolen),
        static_cast<unsigned long long>(played.shed), mark(played.shed > 0), played.rings_s,
        played.hung, mark(played.hung > 0), static_cast<unsigned long long>(played.wrong),
        mark(played.wrong > 0), 100.0 * played.load, 100.0 * played.busiest_load);
    std::fflush(stdout);
    broken += (is_level_wrong ? 1 : 0) + (played.shed > 0 ? 1 : 0) + (played.hung > 0 ? 1 : 0) +
              (played.wrong > 0 ? 1 : 0);
    quietest_lufs = std::min(quietest_lufs, played.lufs);
    loudest_lufs = std::max(loudest_lufs, played.lufs);
    all.peak = std::max(all.peak, played.peak);
    all.limited = std::max(all.limited, played.limited);
    all.voices = std::max(all.voices, played.voices);
    all.stolen += played.stolen;
    all.shed += played.shed;
    all.rings_s = std::max(all.rings_s, played.rings_s);
    all.hung += played.hung;
    all.wrong += played.wrong;
    all.load += played.load / static_cast<double>(files.size());
    all.busiest_load = std::max(all.busiest_load, played.busiest_load);
  }
  std::printf(
      "| %s | all %zu | %.1f to %.1f | %.1f | %.2f | %d | %llu | %llu | %.1f | %d | %llu | %.1f | "
      "%.1f |\n",
      preset.c_str(), files.size(), quietest_lufs, loudest_lufs, decibels(all.peak),
      100.0 * all.limited, all.voices, static_cast<unsigned long long>(all.stolen),
      static_cast<unsigned long long>(all.shed), all.rings_s, all.hung,
      static_cast<unsigned long long>(all.wrong), 100.0 * all.load, 100.0 * all.busiest_load);
  std::fflush(stdout);
  return broken;
}

}  // namespace ressort::voicing
