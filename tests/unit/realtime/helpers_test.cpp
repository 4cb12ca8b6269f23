// Helper threads: the output has the same bits as from one thread, whatever the helpers do or fail
// to do in time. Run it under ThreadSanitizer too.
#include <signal.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "app/realtime/denormals.h"
#include "app/realtime/thread_pool.h"
#include "app/session/loader.h"
#include "core/compile/compile.h"
#include "core/compile/make_engine.h"
#include "core/kernels/registry.h"
#include "core/kernels/threads/kernel_task.h"
#include "tests/support/harness.h"
#include "tests/support/heap.h"
#include "tests/support/random.h"

namespace ressort::helpers_test {

namespace {

const std::string source = RESSORT_SOURCE;

using Threads = std::set<int>;

Threads own_threads() {
  Threads threads;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task")) {
    threads.insert(std::stoi(entry.path().filename().string()));
  }
  return threads;
}

// Stops threads of this process at arbitrary instructions, like a scheduler, for up to
// `longest_us`.
class Stalls {
 public:
  Stalls(const Threads& threads, int longest_us)
      : thread_([this, threads, longest_us] { storm(threads, longest_us); }) {}
  ~Stalls() {
    ends_ = true;
    thread_.join();
  }
  static std::atomic<int> count;

 private:
  static void stop(int) {
    const int before = errno;
    timespec time{0, 1000L * pause_us};
    nanosleep(&time, nullptr);
    ++count;
    errno = before;
  }
  void storm(const Threads& threads, int longest_us) {
    struct sigaction action {};
    action.sa_handler = stop;
    action.sa_flags = SA_RESTART;
    sigaction(SIGUSR2, &action, nullptr);
    support::Random random(7);
    while (!ends_) {
      pause_us = 1 + static_cast<int>(random.below(static_cast<std::size_t>(longest_us)));
      for (const int thread : threads) {
        syscall(SYS_tgkill, getpid(), thread, SIGUSR2);
      }
      std::this_thread::sleep_for(std::chrono::microseconds(1 + random.below(700)));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  static std::atomic<int> pause_us;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};
std::atomic<int> Stalls::count{0};
std::atomic<int> Stalls::pause_us{1};

// Plays a chord, a bend, parameter ramps, releases and another chord in blocks of every length.
std::vector<double> played(Engine& engine, SeqLock<ClockReading>& clock, std::size_t frames,
                           int period) {
  const DenormalsFlushed flushed;
  support::Random random(3);
  std::vector<double> heard;
  const auto channels = static_cast<std::size_t>(engine.output_count());
  std::vector<std::vector<double>> buffers(channels, std::vector<double>(8192));
  std::vector<double*> outputs;
  for (auto& buffer : buffers) {
    outputs.push_back(buffer.data());
  }
  std::size_t next_event = 0;
  for (std::size_t at = 0; at < frames;) {
    const std::size_t count =
        period > 0 ? static_cast<std::size_t>(period) : std::size_t{1} << random.below(11);
    clock.write({static_cast<std::int64_t>(at), 0, 48000.0, static_cast<std::int64_t>(count)});
    std::vector<Event> events;
    // Events at the frames 0, 1000, 2000 and so on, each in the block that contains it.
    for (; next_event * 1000 < at + count; ++next_event) {
      const auto frame = static_cast<std::uint32_t>(next_event * 1000 - at);
      const auto key = static_cast<std::uint16_t>(40 + next_event * 5 % 37);
      const auto add = [&](Event event) {
        event.frame = frame;
        events.push_back(event);
      };
      add({.kind = EventKind::note_on, .index = key, .value = 0.6});
      add({.kind = EventKind::note_on, .index = static_cast<std::uint16_t>(key + 7), .value = 1.0});
      add({.kind = EventKind::bend, .value = 0.1 * static_cast<double>(next_event % 5)});
      if (next_event > 3) {
        const auto old = static_cast<std::uint16_t>(40 + (next_event - 3) * 5 % 37);
        add({.kind = EventKind::note_off, .index = old, .value = 0.5});
      }
    }
    engine.process(events, {}, outputs, count);
    for (std::size_t n = 0; n < count; ++n) {
      for (const auto& buffer : buffers) {
        heard.push_back(buffer[n]);
      }
    }
    at += count;
  }
  heard.resize(frames * channels);
  return heard;
}

std::unique_ptr<Engine> engine_of(const std::string& preset, Executor* executor,
                                  std::optional<Method> method, int voices = 12) {
  const auto scene = load_scene(source + "/presets/" + preset + ".toml", {});
  REQUIRE(scene);
  auto compiled = compile_network(
      scene->network, scene->preset,
      {.rate_hz = 48000.0, .voices = voices, .method = method, .executor = executor});
  REQUIRE(compiled);
  return std::move(compiled->engine);
}

// A task whose helper waits at a gate.
struct Gated final : Task {
  void perform() override { ++performed; }
  void offer() override { ++offered; }
  void perform_aside() override {
    ++inside;
    while (is_shut) {
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
    --inside;
  }
  void accept() override { ++accepted; }
  void take_over() override { ++taken; }
  std::atomic<bool> is_shut{false};
  std::atomic<int> inside{0};
  int performed = 0;
  int offered = 0;
  int accepted = 0;
  int taken = 0;
};

// Two tasks for two threads. The gate of the second is closed.
struct GatedCrew {
  GatedCrew() { second.is_shut = true; }
  void run() {
    crew->offer(0);
    crew->offer(1);
    crew->finish(0);
    crew->finish(1);
    ++runs;
  }
  // Waits until the helper is at the gate.
  void catch_helper() {
    while (second.inside == 0 && runs < 1000000) {
      run();
    }
    REQUIRE(second.inside == 1);
  }

  SeqLock<ClockReading> clock;
  ThreadPool pool{2, &clock};
  Gated first;
  Gated second;
  std::unique_ptr<Crew> crew = pool.gather({&first, &second});
  int runs = 0;
};

}  // namespace

TEST_CASE("a helper that is stopped during a task is not waited for", "[helpers]") {
  GatedCrew gated;
  gated.clock.write({0, 0, 48000.0, 64});
  gated.catch_helper();
  // The helper keeps the task for a hundred rounds; each round is played without it.
  const Gated& first = gated.first;
  Gated& second = gated.second;
  const int before = second.performed;
  for (int i = 0; i < 100; ++i) {
    gated.run();
  }
  CHECK(second.taken == 1);
  CHECK(second.performed - before >= 99);
  CHECK(second.performed + second.accepted + second.taken == gated.runs);
  CHECK(first.performed + first.accepted + first.taken == gated.runs);
  const int offered = second.offered;
  gated.run();
  CHECK(second.offered == offered);  // while a helper holds it
  second.is_shut = false;
  while (second.inside > 0) {
    std::this_thread::yield();
  }
  const int again = second.offered;
  for (int i = 0; i < 100000 && second.offered == again; ++i) {
    gated.run();
  }
  CHECK(second.offered > again);
}

TEST_CASE("a helper begins with the first task while others are prepared", "[helpers]") {
  GatedCrew gated;
  gated.clock.write({0, 0, 48000.0, 64});
  gated.first.is_shut = true;
  gated.second.is_shut = false;
  gated.crew->offer(0);
  while (gated.first.inside == 0) {
    std::this_thread::yield();
  }
  CHECK(gated.second.offered == 0);
  gated.first.is_shut = false;
  gated.crew->offer(1);
  gated.crew->finish(0);
  gated.crew->finish(1);
  CHECK(gated.first.performed == 0);
  CHECK(gated.first.accepted + gated.first.taken == 1);
  CHECK(gated.second.performed + gated.second.accepted + gated.second.taken == 1);
}

TEST_CASE("a crew is not destroyed while a helper uses it", "[helpers]") {
  GatedCrew gated;
  gated.clock.write({0, 0, 48000.0, 64});
  gated.catch_helper();
  std::thread opener([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    gated.second.is_shut = false;
  });
  gated.crew.reset();
  CHECK(gated.second.inside == 0);
  opener.join();
}

TEST_CASE("a task that is taken over continues as without a helper", "[helpers]") {
  struct Case {
    const char* preset;
    std::optional<Method> method;
  };
  const Case cases[] = {{"LargeTriangleMesh", {}},
                        {"LargeTriangleMesh", Method::direct},
                        {"20x30mesh", Method::grid},
                        {"CoupledStrings", Method::chains},
                        {"PolyTriangle", Method::batch}};
  for (const Case& scene : cases) {
    const auto engine = engine_of(scene.preset, nullptr, scene.method, 2);
    const Program& program = engine->machine().parts[0];
    INFO(scene.preset << ", " << description(program));
    const auto make = [&] { return make_kernel<double>(program, 2, best_isa()); };
    auto expected = make();
    auto found = make();
    const std::size_t row = found->width() * program.inputs.size();
    BlockBuffers<double> buffers;
    buffers.value.resize(64 * row);
    buffers.velocity.resize(64 * row);
    buffers.audio.resize(64);
    buffers.outputs.resize(64 * found->width() * program.outputs.size());
    BlockBuffers<double> alone = buffers;
    KernelTask<double> task(found, buffers, make);
    REQUIRE(task.can_copy());
    for (auto* kernel : {expected.get(), found.get()}) {
      for (std::uint32_t c = 0; c < program.coefficients.size(); ++c) {
        for (std::size_t lane = 0; lane < kernel->width(); ++lane) {
          kernel->coefficients.set(
              lane, c, coefficient_value(program, program.coefficients[c], program.parameters, 1.0),
              false);
        }
      }
    }
    support::Random random(5);
    int lent = 0;  // blocks since a late helper took it
    double peak = 0.0;
    for (int block = 0; block < 300; ++block) {
      task.frames = 1 + random.below(64);
      for (std::size_t i = 0; i < task.frames * row; ++i) {
        const double hand = 0.02 * std::sin(0.003 * (64 * block + static_cast<double>(i / row)));
        alone.value[i] = task.buffers.value[i] = hand;
        alone.velocity[i] = task.buffers.velocity[i] = 0.0;
      }
      expected->step({.frames = task.frames,
                      .value = alone.value.data(),
                      .velocity = alone.velocity.data(),
                      .audio = alone.audio.data(),
                      .outputs = alone.outputs.data()});
      const std::size_t way = random.below(4);
      if (lent > 0) {
        task.perform();
        if (--lent == 0) {
          task.perform_aside();  // late, for a round long past
        }
      } else if (way == 0) {
        task.perform();
      } else if (way == 1) {
        task.offer();
        task.perform_aside();
        task.accept();
      } else {
        task.offer();
        task.take_over();
        lent = static_cast<int>(way);
      }
      const std::size_t count = task.frames * found->width() * program.outputs.size();
      for (std::size_t i = 0; i < count; ++i) {
        peak = std::max(peak, std::fabs(alone.outputs[i]));
        REQUIRE(task.buffers.outputs[i] == alone.outputs[i]);
      }
    }
    CHECK(peak > 1e-9);
  }
}

TEST_CASE("helpers produce the bits of one thread, even when they are stopped", "[helpers]") {
  struct Case {
    const char* preset;
    std::optional<Method> method;
    std::size_t frames;
  };
  const Case cases[] = {
      {"LargeTriangleMesh", {}, 12000},         {"LargeTriangleMesh", Method::direct, 4000},
      {"20x30mesh", Method::grid, 6000},        {"Guitar", {}, 8000},
      {"CoupledStrings", Method::chains, 8000}, {"PolyTriangle", Method::batch, 12000},
  };
  for (const Case& scene : cases) {
    SeqLock<ClockReading> clock;
    for (const int period : {0, 16, 8192}) {
      const auto alone = engine_of(scene.preset, nullptr, scene.method);
      const std::vector<double> expected = played(*alone, clock, scene.frames, period);
      double peak = 0.0;
      for (const double sample : expected) {
        peak = std::max(peak, std::fabs(sample));
      }
      CHECK(peak > 1e-3);
      for (const std::size_t threads : {2u, 4u}) {
        const Threads before = own_threads();
        ThreadPool pool(threads, &clock);
        Threads helpers = own_threads();
        for (const int thread : before) {
          helpers.erase(thread);
        }
        REQUIRE(helpers.size() == threads - 1);
        const auto engine = engine_of(scene.preset, &pool, scene.method);
        const Stalls stalls(helpers, period == 16 ? 3000 : 300);
        INFO(scene.preset << ", period " << period << ", " << threads << " threads");
        CHECK(played(*engine, clock, scene.frames, period) == expected);
      }
    }
  }
#if !defined(__SANITIZE_THREAD__)  // ThreadSanitizer delays signals
  CHECK(Stalls::count > 100);
#endif
}

TEST_CASE("the memory of the helpers' copies is predicted", "[helpers]") {
  if (!support::heap_is_counted) {
    return;
  }
  SeqLock<ClockReading> clock;
  ThreadPool pool{2, &clock};
  for (Executor* const executor :
       {static_cast<Executor*>(nullptr), static_cast<Executor*>(&pool)}) {
    constexpr int voices = 64;
    const Network network = support::network_of(
        "@K param 0.01\n@s mesh 50 50 1. K 0.001 0. 0.\n@in1 frcInput [@s 0.3 0.3]\n"
        "@out1 posOutput [@s 0.3 0.4]\n");
    const auto compiled =
        compile_network(network, default_preset(network, true),
                        {.voices = voices, .method = Method::grid, .executor = executor});
    REQUIRE(compiled);
    const Machine& machine = compiled->engine->machine();
    const std::size_t before = support::heap_bytes();
    const Engine engine(machine, {.voices = voices}, Precision::float64, best_isa(), {}, executor);
    Machine copy = machine;
    const std::size_t held = support::heap_bytes();
    { const Machine gone = std::move(copy); }
    const auto of_machine = static_cast<double>(held - support::heap_bytes());
    const double taken = static_cast<double>(held - before) - 2.0 * of_machine;
    const auto told =
        static_cast<double>(engine_bytes(machine, voices, Precision::float64, executor));
    CAPTURE(executor != nullptr, taken, told);
    CHECK(told > 0.5 * taken);
    CHECK(told < 2.0 * taken);
  }
}

}  // namespace ressort::helpers_test
