// Overload: the quietest voices are stolen first. The test sets the clock.
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <mutex>
#include <thread>

#include "app/realtime/process.h"
#include "app/session/session.h"
#include "app/session/timing.h"
#include "tests/support/player.h"

namespace ressort::overload_test {
namespace {

using namespace support;

constexpr double rate = 44100.0;
constexpr std::size_t block = 256;  // a whole span: 5.8 ms
constexpr double period_s = block / rate;
constexpr std::size_t second = static_cast<std::size_t>(1.0 / period_s) + 1;  // in blocks

constexpr int first_key = 50;
constexpr int keys = 8;

// A clock that only advances by the duration of a block. It is read before and after each block.
struct HandClock {
  static std::int64_t read() {
    now_ns += ++reads % 2 == 0 ? took_ns : 0;
    return now_ns;
  }
  static inline std::int64_t now_ns = 0;
  static inline std::int64_t took_ns = 0;
  static inline std::size_t reads = 0;
};

// A process whose blocks take the time that the test sets, with its output.
struct Harness {
  explicit Harness(Process::Clock clock = &HandClock::read) : process(rate, false, clock) {
    offer(1);
    run(1, 0.0);
  }
  void offer(std::uint32_t serial) {
    auto compiled =
        compile_network(network_of(ringing_string()), struck(keys), {.method = Method::direct});
    REQUIRE(compiled);
    delete process.slot.offer(new PlayingEngine{std::move(compiled->engine), serial});
  }
  void strike_all() {
    for (int key = first_key; key < first_key + keys; ++key) {
      process.from_osc.push({.event = note_on(0, key)});
    }
  }
  // Runs blocks. The time of each block, and the additional time of each voice, are fractions of
  // the period.
  void run(std::size_t blocks, double fixed, double each = 0.0) {
    for (std::size_t n = 0; n < blocks; ++n) {
      const double share = fixed + each * process.meters().voices;
      HandClock::took_ns = std::llround(share * period_s * 1e9);
      std::vector<double> samples(block);
      double* const outputs[] = {samples.data()};
      const HeapWatch watch;
      process.block(std::span<const double* const>(), outputs, block, {}, 0);
      heap_calls += watch.calls();
    }
  }
  std::vector<Report> overloads() {
    std::vector<Report> found;
    for (Report report; process.reports.pop(report);) {
      if (report.kind == Report::Kind::overload) {
        found.push_back(report);
      }
    }
    return found;
  }

  Process process;
  std::size_t heap_calls = 0;
};

// The voice limits that DspLoad sets if a block takes `fixed` plus `each` for every voice, while
// all keys are repeated.
struct Played {
  int least = keys;
  int last = keys;
  int changes = 0;
};
Played played(std::size_t blocks, double fixed, double each) {
  DspLoad load;
  Played result;
  for (std::size_t n = 0; n < blocks; ++n) {
    load.add((fixed + each * result.last) * period_s, period_s);
    if (const auto voices = load.update_limit(result.last, keys)) {
      ++result.changes;
      result.last = *voices;
      result.least = std::min(result.least, result.last);
    }
  }
  return result;
}

}  // namespace

// --- order of stealing --------------------------------------------------------------------------

TEST_CASE("an engine keeps the loudest held voices and the newest", "[overload]") {
  // The newest voice is the quietest; the loudest is released.
  const double velocities[keys] = {0.9, 0.3, 0.6, 1.0, 0.2, 0.5, 0.8, 0.1};
  const auto notes = [&](const std::vector<int>& wanted) {
    std::vector<Event> events;
    for (const int n : wanted) {
      events.push_back(note_on(static_cast<std::uint32_t>(256 * n), first_key + n, velocities[n]));
    }
    events.push_back(note_off(256 * keys, first_key + 3));
    return events;
  };
  Player player(ringing_string(), struck(keys), {.method = Method::direct});
  Player expected(ringing_string(), struck(keys), {.method = Method::direct});
  const std::size_t start = 44100;  // a new voice counts as loud at first
  player.run(start, notes({0, 1, 2, 3, 4, 5, 6, 7}));
  expected.run(start, notes({0, 6, 7}));
  CHECK(player.engine().voice_count() == keys);
  player.engine().limit_voices(3);
  CHECK(player.engine().meters().shed == 5);
  CHECK(player.engine().meters().stepped == 3);
  const std::size_t faded = start + 512;  // 5 ms are 221 frames
  player.run(4096);
  expected.run(4096);
  double worst = 0.0;
  for (std::size_t n = faded; n < player.y().size(); ++n) {
    worst = std::max(worst, std::fabs(player.y()[n] - expected.y()[n]));
  }
  INFO(show(worst));
  CHECK(worst < 1e-12 * peak(expected.y()));
  CHECK(largest_step(std::span(player.y()).subspan(start - 1)) <
        1.5 * largest_step(std::span(player.y()).first(start)));  // no clicks

  // A new note steals a voice until there is time for all.
  player.run(256, {note_on(0, 70), note_on(10, 71)});
  CHECK(player.engine().meters().stepped == 3);
  player.engine().limit_voices(keys);
  player.run(1024, {note_on(0, 72), note_on(10, 73)});
  CHECK(player.engine().meters().stepped == 5);
  player.engine().limit_voices(0);  // at least one voice: the newest
  CHECK(player.engine().meters().stepped == 1);
  CHECK(player.heap_calls == 0);
}

// --- voice limit --------------------------------------------------------------------------------

TEST_CASE("the mean covers a second, and the lasting load is the median of five spans",
          "[overload]") {
  DspLoad load;
  for (std::size_t n = 0; n < second; ++n) {
    load.add(0.5 * period_s, period_s);
  }
  CHECK(load.mean() == Approx(0.5 * (1.0 - std::exp(-1.0))).epsilon(0.01));
  for (std::size_t n = 0; n < 9 * second; ++n) {
    load.add(0.5 * period_s, period_s);
  }
  CHECK(load.mean() == Approx(0.5).epsilon(0.001));
  CHECK(load.lasting() == Approx(0.5).epsilon(1e-12));
  load.add(100.0 * period_s, period_s);
  load.add(100.0 * period_s, period_s);
  CHECK(load.lasting() == Approx(0.5).epsilon(1e-12));
  load.add(100.0 * period_s, period_s);
  CHECK(load.lasting() == Approx(100.0).epsilon(1e-12));
  // Short blocks are added up to 5 ms: 16 frames are 0.36 ms.
  load.forget();
  for (int n = 0; n < 14 * 6; ++n) {
    load.add(n % 14 == 0 ? 2e-3 : 1e-4, 16.0 / rate);
  }
  CHECK(load.lasting() == Approx((2e-3 + 13e-4) / (14 * 16.0 / rate)).epsilon(1e-12));
}

TEST_CASE("the computing time limits the number of voices", "[overload]") {
  // 8 voices take 1.68; three take 0.63 and stay.
  const Played heavy = played(10 * second, 0.0, 0.21);
  CHECK(heavy.last == 3);
  CHECK(heavy.changes == 1);
  // At 5 per voice one voice remains after 500 ms. At 12 even one voice is too much, but less than
  // eight.
  CHECK(played(10 * second, 0.0, 12.0).last == 1);
  // A load that fits is not reduced.
  CHECK(played(10 * second, 0.0, 0.11).changes == 0);
}

TEST_CASE("voices are not stolen if that does not lower the load", "[overload]") {
  // The period is full, but the load fits: one attempt has no effect, and no other follows.
  const Played full = played(10 * second, 0.95, 0.0);
  CHECK(full.changes == 1);
  CHECK(full.least == 6);
  // The load is too much with any number of voices: all voices return and stay for a while.
  const Played fixed = played(5 * second, 1.4, 0.0);
  CHECK(fixed.changes == 4);  // to 4, 2, 1, and back to all
  CHECK(fixed.least == 1);
  CHECK(fixed.last == keys);
}

TEST_CASE("after a second of low load more voices may sound, by their cost", "[overload]") {
  DspLoad load;
  const auto run = [&](std::size_t blocks, double share, int sounding) {
    std::optional<int> said;
    for (std::size_t n = 0; n < blocks; ++n) {
      load.add(share * period_s, period_s);
      if (const auto voices = load.update_limit(sounding, 64)) {
        CHECK_FALSE(said);
        said = voices;
      }
    }
    return said;
  };
  CHECK(run(3, 1.5, 32) == 16);
  CHECK_FALSE(run(second, 0.65, 16));  // neither too much nor little
  CHECK_FALSE(run(second - 4, 0.5, 16));
  CHECK_FALSE(run(5, 0.65, 16));
  CHECK(run(second + 5, 0.5, 16) == 24);
  CHECK(run(second + 5, 0.25, 24) == 64);
  CHECK(load.limit() == 0);
}

// --- in the audio thread ------------------------------------------------------------------------

TEST_CASE("an overloaded process steals voices, reports it once, and recovers", "[overload]") {
  Harness harness;
  harness.strike_all();
  harness.run(second, 0.0, 0.05);
  const auto meters = [&] { return harness.process.meters(); };
  REQUIRE(meters().voices == keys);
  CHECK(meters().load == Approx(0.4 * (1.0 - std::exp(-1.0))).epsilon(0.03));
  CHECK(meters().cpu_peak == Approx(0.4).epsilon(1e-6));
  CHECK(meters().overruns == 0);
  harness.run(2, 0.0, 0.21);
  CHECK(meters().overruns == 2);
  CHECK(harness.overloads().empty());
  harness.run(2, 0.0, 0.21);
  CHECK(meters().shed == 5);
  CHECK(meters().voices == 3);
  harness.strike_all();
  harness.run(second / 2, 0.0, 0.21);
  CHECK(meters().voices == 3);
  const auto told = harness.overloads();
  REQUIRE(told.size() == 1);
  CHECK(told[0].value == Approx(1.68).epsilon(1e-6));
  CHECK(told[0].index == 3);
  harness.run(3 * second, 0.0, 0.05);
  harness.strike_all();
  harness.run(4, 0.0, 0.05);
  CHECK(meters().voices == keys);
  CHECK(meters().shed == 5);
  CHECK(harness.heap_calls == 0);
}

TEST_CASE("one or two slow blocks steal no voice", "[overload]") {
  Harness harness;
  harness.strike_all();
  harness.run(second, 0.1);
  const auto meters = [&] { return harness.process.meters(); };
  for (int hiccup = 0; hiccup < 2; ++hiccup) {
    harness.run(1, 30.0);
    harness.run(2, 0.1);
  }
  harness.run(second, 0.1);
  CHECK(meters().voices == keys);
  CHECK(meters().shed == 0);
  CHECK(meters().overruns == 2);
  CHECK(meters().cpu_peak == Approx(30.0).epsilon(1e-6));
  CHECK(harness.overloads().empty());
  harness.process.meters_were_read.raise();
  harness.run(2, 0.1);
  CHECK(meters().cpu_peak == Approx(0.1).epsilon(1e-6));
  // Three slow spans of five are an overload; fewer are not.
  harness.run(3, 30.0);
  harness.run(2, 0.1);
  CHECK(meters().shed == keys - 1);
}

TEST_CASE("during a crossfade an overload ends the old model first", "[overload]") {
  Harness harness;
  harness.strike_all();
  harness.run(second, 0.1);
  harness.offer(2);
  harness.strike_all();
  harness.run(8, 1.5);
  harness.run(second, 0.1);
  CHECK(harness.process.meters().swaps == 2);
  CHECK(harness.process.meters().voices == keys);
  CHECK(harness.process.meters().shed == 0);
  CHECK(harness.overloads().empty());
}

TEST_CASE("without a clock the load is not measured and no voice is stolen", "[overload]") {
  const std::size_t reads = HandClock::reads;
  Harness harness(nullptr);
  harness.strike_all();
  harness.run(20, 30.0);
  CHECK(HandClock::reads == reads);
  CHECK(harness.process.meters().voices == keys);
  CHECK(harness.process.meters().shed == 0);
  CHECK(harness.process.meters().cpu_peak == 0.0);
}

// --- messages -----------------------------------------------------------------------------------

TEST_CASE("the warning about a plan too large for one core says how many voices fit",
          "[overload]") {
  const auto warning = [](double share, int voices, double rate_hz, Precision precision) {
    Compiled compiled;
    compiled.instrument.voices = voices;
    compiled.plan.precision = precision;
    compiled.plan.parts.push_back({.estimated_ns = 0.25 * share * 1e9 / 48000.0});
    compiled.plan.parts.push_back({.estimated_ns = 0.75 * share * 1e9 / 48000.0});
    return overload_warning(compiled, {.rate_hz = rate_hz}, {});
  };
  CHECK(warning(1.75, 64, 48000.0, Precision::float64) ==
        "all 64 voices would take about 175 % of one core: 32 fit; to lower the load, use -p 32, a "
        "lower "
        "rate, --precision float");
  CHECK(warning(1.75, 64, 48000.0, Precision::float32) ==
        "all 64 voices would take about 175 % of one core: 32 fit; to lower the load, use -p 32, a "
        "lower "
        "rate");
  CHECK(
      warning(2.4, 1, 48000.0, Precision::float64) ==
      "its one voice would take about 240 % of one core; to lower the load, use a smaller model, a "
      "lower rate, --precision float");
  CHECK(warning(2.4, 2, 48000.0, Precision::float32) ==
        "all 2 voices would take about 240 % of one core, one alone about 120 % of one core; to "
        "lower the load, use a smaller model, a lower rate");
  CHECK(warning(0.89, 64, 48000.0, Precision::float64).empty());
  CHECK_FALSE(warning(0.89, 64, 96000.0, Precision::float64).empty());
}

TEST_CASE("a plan that the estimate finds too dear is measured before it is warned of",
          "[overload]") {
  // 256 voices of a hammer beside a string: the estimate counts its contact as closed, the clock of
  // the test says that all take a hundredth of a core.
  const Network network = network_of(
      "@h mass 20. 0. 1.\n@s modalString 40 3. 261.6 3e-4 0.05 0.02 0\n"
      "@k powerContact [@s 0.12] @h 0.4 2.5\n@in1 frcInput @h\n@out1 posOutput [@s bridge]\n");
  Preset preset = struck(256);
  CompileOptions options;
  auto compiled = compile_network(network, preset, options);
  REQUIRE(compiled);
  const double frames_ns = max_block_frames * 1e9 / options.rate_hz;
  const auto takes = [&](double share) {
    return Timings{
        .time = [=](const Program&, const std::function<void()>&) { return share * frames_ns; }};
  };
  CHECK_FALSE(overload_warning(*compiled, options, {}).empty());
  CHECK(overload_warning(*compiled, options, takes(0.01)).empty());
  CHECK(overload_warning(*compiled, options, takes(2.0)).find("about 200 %") != std::string::npos);
}

TEST_CASE("a session warns about a plan that is too large and reports an overload", "[overload]") {
  const auto folder =
      std::filesystem::temp_directory_path() / ("ressort-overload-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  // Too many masses for exact modes and a law in every link: 256 voices take seconds per second.
  std::ofstream(folder / "m.mdl") << "@s string 1500 1. 0.1 0.0001 0. 0.\n"
                                     "@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.6]\n";
  std::ofstream(folder / "m.toml")
      << "model = \"m.mdl\"\nvoices = 256\n[[control]]\nfrom = \"note\"\nto = \"in1\"\n"
         "how = \"impulse\"\nrange = [1.0, 1.0]\n";
  Process process(48000.0);
  std::mutex mutex;
  std::string told;
  {
    Session session(process, {.compile = {.rate_hz = 48000.0}}, [&](const std::string& text) {
      const std::lock_guard lock(mutex);
      told += text + "\n";
    });
    const auto loaded = session.load_and_wait((folder / "m.toml").string());
    REQUIRE(loaded);
    REQUIRE((*loaded)->warnings.size() == 1);
    CHECK((*loaded)->warnings[0].find("all 256 voices would take about ") == 0);
    CHECK((*loaded)->warnings[0].find(" fit; to lower the load, use -p ") != std::string::npos);

    CHECK(session.status().cpu == -1.0);  // no backend runs
    Meters meters;
    meters.load = 0.25;
    meters.cpu_peak = 1.5;
    meters.peak = 0.5;
    process.meters_were_read.lower();  // as the audio thread does
    process.board.write(meters);
    session.set_backend("a device", true);
    const Status now = session.status();
    CHECK(now.cpu == 0.25);
    CHECK(now.cpu_peak == 1.5);
    CHECK(now.peak_db == Approx(20.0 * std::log10(0.5)));
    // Each reader sees the peak once.
    CHECK(session.status(MeterReader::panel).cpu_peak == 1.5);
    CHECK(session.status(MeterReader::panel).cpu_peak == 0.0);
    CHECK(session.status(MeterReader::console).cpu_peak == 0.0);
    CHECK(session.status(MeterReader::osc).peak == 0.5);
    session.set_backend("none; waiting for a device", false);
    CHECK(session.status().cpu == -1.0);

    process.reports.push({Report::Kind::overload, (*loaded)->serial, 3, 1.404});
    const auto has_told = [&] {
      const std::lock_guard lock(mutex);
      return !told.empty();
    };
    while (!has_told()) {
      std::this_thread::yield();
    }
  }
  std::filesystem::remove_all(folder);
  CHECK(
      told ==
      "the load is 140 %; the quietest voices fade out, and at most 3 voices sound until the load "
      "falls; to lower the load, use a longer period, -p 3, a lower rate, --precision float\n");
}

}  // namespace ressort::overload_test
