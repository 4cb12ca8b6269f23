// Abuses instruments for any time: ressort_abuse SECONDS [SEED [NAME...]]. Sweeps every parameter
// over its whole range and beyond at audio rate, once within the stable range and once forced;
// strikes, forces and positions of any size; random keys, bends and controllers; audio inputs with
// noise, NaN and infinity. Every output sample must be finite and below the limiter's ceiling,
// memory must not grow, and all notes must end once inputs, pedals and levers are released. The
// seed of the random numbers is printed, to reproduce a failure.
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <unistd.h>

#include "app/realtime/process.h"
#include "app/session/loader.h"
#include "core/compile/compile.h"
#include "tests/support/random.h"
#include "tests/support/rooms.h"

namespace {

using namespace ressort;

constexpr double rate_hz = 44100.0;
constexpr std::uint32_t serial = 1;

using support::Random;

class Abuser {
 public:
  Abuser(const Instrument& instrument, std::uint64_t seed, bool force)
      : instrument_(instrument), random_(seed), one_in_is_beyond_(force ? 3 : 50) {}

  // Makes a few events for a block, and sometimes none at all, so that sounds can fade.
  std::vector<Event> events(std::size_t frames) {
    if (chance(400)) {
      calm_blocks_ = random_.below(300);
    }
    std::vector<Event> events;
    if (calm_blocks_ > 0) {
      --calm_blocks_;
      return events;
    }
    const std::size_t count = random_.below(12);
    for (std::size_t i = 0; i < count; ++i) {
      events.push_back(event());
      events.back().frame = static_cast<std::uint32_t>(random_.below(frames));
    }
    if (!instrument_.parameters.empty() && chance(4)) {
      sweep(events, frames);
    }
    for (Event& event : events) {
      event.model = serial;
    }
    return events;
  }

  // Returns position inputs, keys, pedals, levers and parameters to their start.
  std::vector<Event> end() const {
    std::vector<Event> events;
    for (std::size_t i = 0; i < instrument_.parameters.size(); ++i) {
      events.push_back({.kind = EventKind::parameter,
                        .index = static_cast<std::uint16_t>(i),
                        .value = instrument_.parameters[i].value});
    }
    for (const InputInfo& input : instrument_.inputs) {
      for (const Gesture gesture : {Gesture::position, Gesture::force, Gesture::bow}) {
        events.push_back({.kind = EventKind::gesture,
                          .gesture = gesture,
                          .index = static_cast<std::uint16_t>(input.number)});
      }
    }
    for (const CustomInfo& lever : instrument_.custom) {
      events.push_back({.kind = EventKind::custom, .index = static_cast<std::uint16_t>(lever.row)});
    }
    for (const std::uint16_t number :
         std::array<std::uint16_t, 5>{64, 66, 67, 69, 121}) {  // pedals, and all controllers
      events.push_back({.kind = EventKind::controller, .index = number});
    }
    events.push_back({.kind = EventKind::pressure});
    events.push_back({.kind = EventKind::bend});
    for (std::uint16_t key = 0; key < 128; ++key) {
      events.push_back({.kind = EventKind::note_off, .index = key, .value = 1.0});
    }
    for (Event& event : events) {
      event.model = serial;
    }
    return events;
  }

  // Fills one channel with noise that contains NaN and infinity.
  void fill(std::vector<double>& samples) {
    static constexpr double nothings[] = {std::numeric_limits<double>::quiet_NaN(),
                                          std::numeric_limits<double>::infinity(), -1e300, 1e38};
    const double level = chance(3) ? 0.0 : std::pow(10.0, random_.uniform(-4.0, 2.0));
    for (double& sample : samples) {
      sample = chance(20'000) ? nothings[random_.below(std::size(nothings))]
                              : random_.uniform(-level, level);
    }
  }

 private:
  // Sweeps a parameter sample by sample between random values.
  void sweep(std::vector<Event>& events, std::size_t frames) {
    const std::size_t index = random_.below(instrument_.parameters.size());
    for (std::uint32_t n = 0; n < frames; ++n) {
      events.push_back({.frame = n,
                        .kind = EventKind::parameter,
                        .index = static_cast<std::uint16_t>(index),
                        .value = value_of(instrument_.parameters[index])});
    }
  }

  bool chance(std::size_t one_in) { return random_.below(one_in) == 0; }
  // Returns a number of either sign with a magnitude from 1e-6 to 1e6.
  double any_size() {
    return (chance(2) ? 1.0 : -1.0) * std::pow(10.0, random_.uniform(-6.0, 6.0));
  }

  double value_of(const ParameterInfo& info) {
    const double width = info.maximum - info.minimum;
    const double beyond = chance(one_in_is_beyond_) ? 10.0 * width : 0.0;
    return random_.uniform(info.minimum - beyond, info.maximum + beyond);
  }

  Event event() {
    const auto key = [&] { return static_cast<std::uint16_t>(random_.below(128)); };
    const auto input = [&] {
      return instrument_.inputs.empty()
                 ? std::uint16_t{1}
                 : static_cast<std::uint16_t>(
                       instrument_.inputs[random_.below(instrument_.inputs.size())].number);
    };
    switch (random_.below(13)) {
      case 0:
      case 1:
        return {.kind = EventKind::note_on, .index = key(), .value = random_.uniform(0.01, 1.0)};
      case 2:
        return {.kind = EventKind::note_off, .index = key()};
      case 3:
        return {.kind = EventKind::controller, .index = key(), .value = random_.uniform(0.0, 1.0)};
      case 4:
        return {.kind = EventKind::bend, .value = random_.uniform(-1.0, 1.0)};
      case 5:
        return {.kind = EventKind::pressure, .value = random_.uniform(0.0, 1.0)};
      case 6:
        return {.kind = EventKind::gesture,
                .gesture = Gesture::position,
                .index = input(),
                .value = any_size()};
      case 7:
        return {.kind = EventKind::gesture,
                .gesture = Gesture::force,
                .index = input(),
                .value = any_size(),
                .value2 = chance(2) ? 0.0 : random_.uniform(0.0, 0.1)};
      case 8:
        return {.kind = EventKind::gesture,
                .gesture = Gesture::pluck,
                .index = input(),
                .value = random_.uniform(0.0, 1.0)};
      case 9:
        return {.kind = EventKind::gesture,
                .gesture = Gesture::bow,
                .index = input(),
                .value = random_.uniform(-1.0, 1.0),
                .value2 = random_.uniform(-1.0, 1.0)};
      case 10:
        return instrument_.custom.empty()
                   ? Event{.kind = EventKind::key_pressure, .index = key()}
                   : Event{.kind = EventKind::custom,
                           .index = static_cast<std::uint16_t>(
                               instrument_.custom[random_.below(instrument_.custom.size())].row),
                           .value = random_.uniform(0.0, 1.0)};
      case 11:
        return {.kind = EventKind::strike,
                .value = instrument_.blow * any_size(),
                .value2 = static_cast<double>(random_.below(2 * instrument_.masses + 2))};
      default:
        return chance(200) ? Event{.kind = EventKind::panic}
                           : Event{.kind = EventKind::note_off, .index = key()};
    }
  }

  const Instrument& instrument_;
  Random random_;
  std::size_t one_in_is_beyond_;
  std::size_t calm_blocks_ = 0;
};

struct Found {
  std::uint64_t wrong = 0;  // samples
  double peak = 0.0;
  std::uint64_t runaways = 0;
  double grown_mb = 0.0;  // resident memory, since the first tenth of the time
  double ended_s = 0.0;   // after the last event; infinite: a sound never ends
};

constexpr double longest_ring_s = 300.0;

double resident_mb() {
  std::ifstream file("/proc/self/statm");
  double pages = 0.0;
  double resident = 0.0;
  file >> pages >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

Found abuse(Compiled compiled, double seconds, std::uint64_t seed, bool force) {
  const Instrument instrument = compiled.instrument;
  Process process(rate_hz);
  process.slot.offer(new PlayingEngine{std::move(compiled.engine), serial});
  Abuser abuser(instrument, seed, force);
  Random lengths(seed + 1);
  const auto channels = static_cast<std::size_t>(std::max(2, instrument.outputs));
  std::vector<std::vector<double>> out(channels);
  std::vector<std::vector<double>> in(static_cast<std::size_t>(instrument.audio_inputs));
  Found found;
  const auto play = [&](std::int64_t at, std::size_t frames, std::span<const Event> events) {
    std::vector<double*> outputs;
    for (std::vector<double>& channel : out) {
      channel.assign(frames, 0.0);
      outputs.push_back(channel.data());
    }
    std::vector<const double*> inputs;
    for (const std::vector<double>& channel : in) {
      inputs.push_back(channel.data());
    }
    for (const Event& event : events) {
      process.schedule(at + event.frame, event);
    }
    process.block(std::span<const double* const>(inputs), std::span<double* const>(outputs), frames,
                  {}, 0);
    for (const std::vector<double>& channel : out) {
      for (const double sample : channel) {
        found.wrong += std::fabs(sample) <= Limiter::ceiling ? 0 : 1;  // counts NaN too
        found.peak = std::max(found.peak, std::fabs(sample));
      }
    }
  };
  const auto total = static_cast<std::int64_t>(seconds * rate_hz);
  std::int64_t at = 0;
  double start_mb = 0.0;
  while (at < total) {
    const std::size_t frames = lengths.below(3) == 0 ? 1 + lengths.below(512) : 64;
    for (std::vector<double>& channel : in) {
      channel.resize(frames);
      abuser.fill(channel);
    }
    play(at, frames, abuser.events(frames));
    at += static_cast<std::int64_t>(frames);
    start_mb = at < total / 10 ? resident_mb() : start_mb;
  }
  found.grown_mb = resident_mb() - start_mb;
  found.runaways = process.meters().resets;
  constexpr std::size_t frames = 512;
  for (std::vector<double>& channel : in) {
    channel.assign(frames, 0.0);
  }
  play(at, frames, abuser.end());
  const std::int64_t end = at;
  do {
    at += frames;
    play(at, frames, {});
    found.ended_s = static_cast<double>(at - end) / rate_hz;
  } while (process.meters().voices > 0 && found.ended_s < longest_ring_s);
  if (process.meters().voices > 0) {
    found.ended_s = std::numeric_limits<double>::infinity();
  }
  return found;
}

}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 0.0;
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  std::vector<std::string> names(argv + std::min(argc, 3), argv + argc);
  if (!(seconds > 0.0)) {
    std::fputs("ressort_abuse SECONDS [SEED [MODEL or PRESET...]]\n", stderr);
    return 2;
  }
  if (names.empty()) {
    names = {"IPlayTheTriangle", "PolyTriangle",      "PhysicalLFO",
             "Resonator",        "PluckedHarmonics",  "BowedString",
             "1000massString",   "LargeTriangleMesh", "20x30mesh"};
  }
  int failures = 0;
  for (const std::string& name : names) {
    const auto scene = load_scene(name, {});
    if (!scene) {
      std::fprintf(stderr, "%s\n", scene.error().message.c_str());
      return 2;
    }
    for (const bool force : {false, true}) {
      auto compiled =
          compile_network(scene->network, scene->preset, {.rate_hz = rate_hz, .force = force});
      if (!compiled) {
        std::fprintf(stderr, "%s: %s\n", name.c_str(), compiled.error().message.c_str());
        return 2;
      }
      const Found found = abuse(*std::move(compiled), seconds, seed, force);
      std::printf(
          "%-20s %6g s, seed %llu%s: peak %.3f, %llu voices ran away, %llu samples wrong, "
          "%.1f MB more, silent after %.1f s\n",
          name.c_str(), seconds, static_cast<unsigned long long>(seed), force ? ", forced" : "",
          found.peak, static_cast<unsigned long long>(found.runaways),
          static_cast<unsigned long long>(found.wrong), found.grown_mb, found.ended_s);
      std::fflush(stdout);
      // A forced scene may have any state by now.
      failures +=
          found.wrong > 0 || found.grown_mb > 4.0 || (!force && std::isinf(found.ended_s)) ? 1 : 0;
    }
  }
  return failures == 0 ? 0 : 1;
}
