// The session with an audio thread: loading, swapping and returning engines.
#include "app/session/session.h"

#include "app/control/registry.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <thread>

#include "tests/support/catch.h"
#include "tests/support/heap.h"
#include "tests/support/rooms.h"
#include "tests/support/thorough.h"

namespace ressort::session_test {

namespace {

// A temporary folder with files.
struct Folder {
  std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("ressort-session-" + std::to_string(getpid()));
  Folder() { std::filesystem::create_directories(path); }
  ~Folder() { std::filesystem::remove_all(path); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path / name) << text;
    return (path / name).string();
  }
};

const char* const model_text =
    "@K param 0.1\n@s ground 0.\n@m mass 1. 0. 0.\n@n mass 1. 0. 0.\n"
    "@r0 springDamper @s @m K 0.0005\n@r1 springDamper @m @n K 0.0005\n"
    "@in1 frcInput @m\n@out1 posOutput @n\n";

std::string preset(double stiffness) {
  return "model = \"m.mdl\"\nvoices = 4\ngain = 0.5\n[parameters]\nK = { value = " +
         std::to_string(stiffness) +
         ", range = [0.01, 0.3] }\n[[control]]\nfrom = \"note\"\nto = \"in1\"\nhow = "
         "\"impulse\"\nrange = [0.02, 0.1]\n";
}

// Listens to a process block by block. A key is struck in one block of every `gap`, at any frame,
// so that strokes meet in every phase.
class Ear {
 public:
  Ear(Process& process, std::uint64_t gap) : process_(process), gap_(gap) {}

  void block(std::uint64_t n) {
    random_ = random_ * 1664525u + 1013904223u;
    const std::uint8_t on[] = {0x90, 60, 100};
    const std::uint8_t off[] = {0x80, 60, 0};
    const MidiPacket packet{random_ >> 26, n % gap_ == 0 ? std::span(on) : std::span(off)};
    const bool is_played = n % gap_ <= 1;
    process_.block(std::span<const float* const>(), std::span<float* const>(outputs_), 64,
                   is_played ? std::span(&packet, 1) : std::span<const MidiPacket>(),
                   static_cast<std::int64_t>(n) * 64 * 1'000'000'000 / 48000);
    for (const float sample : left_) {
      is_finite = is_finite && std::isfinite(sample);
      largest_step = std::max(largest_step.load(), std::fabs(sample - before_));
      peak = std::max(peak.load(), std::fabs(sample));
      before_ = sample;
    }
  }

  std::atomic<bool> is_finite{true};
  std::atomic<float> largest_step{0.0f};
  std::atomic<float> peak{0.0f};

 private:
  Process& process_;
  std::uint64_t gap_;
  std::vector<float> left_ = std::vector<float>(64);
  std::vector<float> right_ = left_;
  std::vector<float*> outputs_{left_.data(), right_.data()};
  float before_ = 0.0f;
  unsigned random_ = 1;
};

constexpr std::uint64_t gap = 40;

// An audio thread that plays without waiting until it is stopped.
class Player {
 public:
  explicit Player(Process& process) : ear_(process, gap), thread_([this] { run(); }) {}
  ~Player() {
    stop_ = true;
    thread_.join();
  }
  const Ear& ear() const { return ear_; }
  std::uint64_t blocks() const { return blocks_; }

 private:
  void run() {
    while (!stop_) {
      ear_.block(blocks_);
      ++blocks_;
      if (blocks_ % 16 == 0) {
        std::this_thread::yield();
      }
    }
  }

  Ear ear_;
  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> blocks_{0};
  std::thread thread_;
};

SessionOptions at_48k() {
  return {.compile = {.rate_hz = 48000.0}};
}

void wait_for_blocks(const Player& player, std::uint64_t count) {
  const std::uint64_t end = player.blocks() + count;
  while (player.blocks() < end) {
    std::this_thread::yield();
  }
}

// A bound on the step between two samples of a linear model with one stroke in every `gap` blocks,
// in any phase: the sum of the steps of all strokes, each decayed further than the next. Two
// strokes are at least gap - 1 blocks apart.
float largest_step_of(const std::string& path) {
  Process process(48000.0);
  Session session(process, at_48k(), {});
  REQUIRE(session.load_and_wait(path));
  Ear ear(process, 1'000'000);
  float sum = 0.0f;
  for (std::uint64_t n = 0; n < 100 * (gap - 1);) {
    ear.largest_step = 0.0f;
    for (const std::uint64_t end = n + gap - 1; n < end; ++n) {
      ear.block(n);
    }
    sum += ear.largest_step;
  }
  return sum;
}

}  // namespace

TEST_CASE("Hundreds of swaps while notes sound cause no clicks, leaks or crashes", "[session]") {
  const Folder folder;
  folder.write("m.mdl", model_text);
  const std::string soft = folder.write("soft.toml", preset(0.05));
  const std::string hard = folder.write("hard.toml", preset(0.25));
  const float own = std::max(largest_step_of(soft), largest_step_of(hard));
  Process process(48000.0);
  Session session(process, at_48k(), {});
  REQUIRE(session.load_and_wait(soft));
  const Player player(process);
  wait_for_blocks(player, 200);
  for (int n = 0; n < 20; ++n) {  // one-time allocations
    REQUIRE(session.load_and_wait(n % 2 == 0 ? hard : soft));
  }
  wait_for_blocks(player, 400);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  const std::size_t before = support::heap_bytes();
  for (int n = 0; n < support::of_all(250, 1000); ++n) {
    REQUIRE(session.load_and_wait(n % 2 == 0 ? hard : soft));
    // some loads wait for the end of the fade, some come during it
    wait_for_blocks(player, static_cast<std::uint64_t>(n % 50));
  }
  // The worker has to collect the last engine before memory is counted.
  std::size_t after = support::heap_bytes();
  for (int patience = 0; patience < 400 && after > before + 4096; ++patience) {
    wait_for_blocks(player, 50);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    after = support::heap_bytes();
  }
  CAPTURE(own, player.ear().largest_step.load(), before, after);
  CHECK(player.ear().is_finite.load());
  // A fade of that many frames from the highest to the lowest value adds this to a step.
  const float slope =
      2.0f * player.ear().peak.load() / (48000.0f * static_cast<float>(Process::fade_s));
  CHECK(player.ear().largest_step.load() <= own + slope);
  CHECK(after <= before + 4096);  // bytes; an engine has more than 20,000
  CHECK(process.meters().swaps > 100);
}

TEST_CASE("A failed load reports all errors, and the sound continues", "[session]") {
  const Folder folder;
  folder.write("m.mdl", model_text);
  const std::string good = folder.write("good.toml", preset(0.1));
  const std::string bad = folder.write("bad.mdl", "@m mass 1. 0. 0.\n@r sprong @m @m 1\n@x\n");
  Process process(48000.0);
  Session session(process, at_48k(), {});
  REQUIRE(session.load_and_wait(good));
  const auto failed = session.load_and_wait(bad);
  REQUIRE_FALSE(failed);
  CHECK(failed.error().message.find(bad + ":2:4: error: unknown keyword 'sprong'") == 0);
  CHECK(failed.error().message.find(bad + ":3:3: error:") != std::string::npos);
  CHECK(session.current()->name == "good");
  const Player player(process);
  wait_for_blocks(player, 100);
  CHECK(player.ear().largest_step.load() > 0.001f);
}

TEST_CASE("A newer load replaces an older one, and ending cancels all", "[session]") {
  const Folder folder;
  // Several seconds of work.
  const std::string large = folder.write(
      "large.mdl",
      "@K param 0.01\n@s mesh 600 600 1. K 0.001 0. 0.\n@out1 posOutput [@s 0.3 0.3]\n");
  const std::string quick = folder.write("quick.mdl", model_text);
  Process process(48000.0);
  std::mutex mutex;
  std::vector<std::string> answers;
  const auto note = [&](const auto& result) {
    const std::lock_guard lock(mutex);
    answers.push_back(result ? (*result)->name : result.error().message);
  };
  {
    Session session(process, at_48k(), {});
    session.load(large, note);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    session.load(large, note);
    session.load(large, note);
    const auto loaded = session.load_and_wait(quick);
    REQUIRE(loaded);
    CHECK((*loaded)->name == "quick");
    CHECK(session.current()->name == "quick");
    session.load(large, note);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    session.load(large, note);
    session.end();
    const auto late = session.load_and_wait(quick);
    REQUIRE_FALSE(late);
    CHECK(late.error().message == "the program is ending");
  }
  REQUIRE(answers.size() == 5);
  for (int i = 0; i < 3; ++i) {
    CHECK(answers[static_cast<std::size_t>(i)] == "replaced by a newer load");
  }
  CHECK((answers[3] == "replaced by a newer load" || answers[3] == "the program is ending"));
  CHECK(answers[4] == "the program is ending");
}

TEST_CASE("The scene is compiled again for another rate, once", "[session]") {
  const Folder folder;
  const std::string file = folder.write("quick.mdl", model_text);
  Process process(48000.0);
  Session session(process, at_48k(), {});
  session.set_rate(44100.0);  // before a scene is loaded
  REQUIRE(session.load_and_wait(file));
  const std::uint32_t first = session.current()->serial;
  session.set_rate(96000.0);
  for (int patience = 0; patience < 1000 && session.current()->serial == first; ++patience) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  CHECK(session.current()->serial == first + 1);
  CHECK(session.status().rate_hz == 96000.0);
}

TEST_CASE("Parameters are remembered, clamped, and follow their controllers", "[session]") {
  const Folder folder;
  folder.write("m.mdl", model_text);
  const std::string file = folder.write(
      "p.toml", preset(0.1) + "[[control]]\nfrom = \"cc74\"\nto = \"K\"\nrange = [0.02, 0.2]\n");
  Process process(48000.0);
  Session session(process, at_48k(), {});
  CHECK_FALSE(session.parameter("K"));
  REQUIRE(session.load_and_wait(file));
  CHECK(session.parameter("K") == 0.1);
  const auto loaded = session.current();
  const auto events = to_events({"/param/K", {0.7}}, loaded->instrument, loaded->serial);
  REQUIRE(events);
  CHECK(session.parameter("K") == 0.1);  // not before it is sent
  const TimedEvent sent{.event = events->front()};
  session.remember({&sent, 1});
  CHECK(session.parameter("K") == 0.3);  // end of the range
  std::vector<float> samples(64);
  std::vector<float*> outputs{samples.data()};
  const std::uint8_t turn[] = {0xb0, 74, 127};
  const MidiPacket packet{0, turn};
  process.block(std::span<const float* const>(), std::span<float* const>(outputs), 64,
                std::span(&packet, 1), 0);
  for (int patience = 0; patience < 500 && session.parameter("K") != 0.2; ++patience) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  CHECK(session.parameter("K") == 0.2);
}

TEST_CASE("Repeated problems are reported once, with their number", "[session]") {
  const Folder folder;
  const std::string file = folder.write("m.mdl", model_text);
  Process process(48000.0);
  std::mutex mutex;
  std::vector<std::string> told;
  Session session(process, at_48k(), [&](const std::string& news) {
    const std::lock_guard lock(mutex);
    told.push_back(news);
  });
  REQUIRE(session.load_and_wait(file));
  Ear ear(process, 1'000'000);
  for (std::uint64_t n = 1; n < 751; ++n) {
    ear.block(n);  // a second has passed
  }
  const TimedEvent late{
      .event = {.kind = EventKind::bend}, .timing = TimedEvent::When::at_frame, .when = 24000};
  for (int packet = 0; packet < 738; ++packet) {
    REQUIRE(process.send_ahead({&late, 1}));
  }
  REQUIRE_FALSE(process.send_ahead(std::vector<TimedEvent>(Process::max_ahead, late)));
  ear.block(751);
  // Returns the reported number of occurrences; the worker may read the counter during the block.
  const auto count = [&](const std::string& news) {
    const std::lock_guard lock(mutex);
    int times = 0;
    for (const std::string& text : told) {
      int more = 0;
      if (text.starts_with(news)) {
        std::sscanf(text.c_str() + news.size(), " (and %d more)", &more);
        times += 1 + more;
      }
    }
    return times;
  };
  const std::string late_news = "an event came 0.500 s late";
  const std::string lost_news =
      "an event was dropped, because more events arrived than can be played, or a period was "
      "missed";
  for (int patience = 0; patience < 2000 && (count(late_news) < 738 || count(lost_news) < 4096);
       ++patience) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  CHECK(count(late_news) == 738);
  CHECK(count(lost_news) == 4096);
  const std::lock_guard lock(mutex);
  CAPTURE(told);
  CHECK(told.size() <= 4);
}

}  // namespace ressort::session_test
