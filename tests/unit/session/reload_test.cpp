// The playing scene is reloaded when its files change, in all the ways in which editors change
// them.
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <thread>

#include "app/session/session.h"
#include "tests/support/catch.h"
#include "tests/support/heap.h"
#include "tests/support/random.h"
#include "tests/support/rooms.h"

namespace ressort::reload_test {

using namespace std::chrono_literals;

namespace {

namespace fs = std::filesystem;

constexpr double rate_hz = 48000.0;

struct Folder {
  fs::path path = fs::temp_directory_path() / ("ressort-reload-" + std::to_string(getpid()));
  Folder() { fs::create_directories(path); }
  ~Folder() { fs::remove_all(path); }
  std::string file(const std::string& name) const { return (path / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path / name) << text;
    return file(name);
  }
};

// A mass on a spring with 7 kHz sqrt(K/M), struck by a key; its position is the output.
std::string model_text(const std::string& stiffness = "0.01", const std::string& mass = "1.",
                       const std::string& more = "") {
  return "@K param " + stiffness + "\n@s ground 0.\n@m mass " + mass +
         " 0. 0.\n@r springDamper @s @m K 0.00001\n@in1 frcInput @m\n@out1 posOutput @m\n" + more;
}

std::string preset(const std::string& gain = "0.2") {
  return "model = \"m.mdl\"\nvoices = 2\ntuning = \"fixed\"\ngain = " + gain +
         "\n[parameters]\n[[control]]\nfrom = \"note\"\nto = \"in1\"\nhow = \"impulse\"\nrange = "
         "[0.02, 0.1]\n";
}

struct Stage {
  explicit Stage(const std::string& path,
                 const SessionOptions& options = {.compile = {.rate_hz = rate_hz}, .watch = true})
      : process(rate_hz, false), session(process, options, {}) {
    const auto loaded = session.load_and_wait(path);
    INFO((loaded ? "" : loaded.error().message));
    REQUIRE(loaded);
    play(512);
  }

  void play(std::size_t frames, const std::vector<std::uint8_t>& midi = {}) {
    constexpr std::size_t block = 64;
    for (std::size_t at = 0; at < frames; at += block) {
      std::vector<double> left(block);
      std::vector<double> right(block);
      std::vector<double*> outputs = {left.data(), right.data()};
      const MidiPacket packet{0, midi};
      const support::HeapWatch watch;
      process.block(
          std::span<const double* const>(), std::span<double* const>(outputs), block,
          at == 0 && !midi.empty() ? std::span(&packet, 1) : std::span<const MidiPacket>(), 0);
      heap_calls += watch.calls();
      heard.insert(heard.end(), left.begin(), left.end());
    }
  }
  void strike(int key = 60) { play(64, {0x90, static_cast<std::uint8_t>(key), 127}); }

  // Returns the report on a change of the files.
  Reload after(const std::function<void()>& change) {
    const std::uint64_t before = session.last_reload().count;
    change();
    const auto end = std::chrono::steady_clock::now() + 20s;
    while (session.last_reload().count == before && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(1ms);
    }
    const Reload news = session.last_reload();
    INFO(news.news);
    REQUIRE(news.count > before);
    return news;
  }

  // Frequency of the last frames, from the upward zero crossings.
  double frequency_hz(std::size_t frames) const {
    double first = 0.0;
    double last = 0.0;
    int periods = -1;
    for (std::size_t n = heard.size() - frames + 1; n < heard.size(); ++n) {
      if (heard[n - 1] < 0.0 && heard[n] >= 0.0) {
        const double at = static_cast<double>(n) - heard[n] / (heard[n] - heard[n - 1]);
        first = periods < 0 ? at : first;
        last = at;
        ++periods;
      }
    }
    return periods > 0 ? rate_hz * periods / (last - first) : 0.0;
  }
  double peak(std::size_t frames) const {
    double most = 0.0;
    for (std::size_t n = heard.size() - frames; n < heard.size(); ++n) {
      most = std::max(most, std::fabs(heard[n]));
    }
    return most;
  }
  // The largest second difference. A click raises it; a sine of amplitude A and frequency w per
  // sample keeps it below A w^2.
  double largest_bend(std::size_t frames) const {
    double most = 0.0;
    for (std::size_t n = heard.size() - frames + 2; n < heard.size(); ++n) {
      most = std::max(most, std::fabs(heard[n] - 2.0 * heard[n - 1] + heard[n - 2]));
    }
    return most;
  }

  Process process;
  Session session;
  std::size_t heap_calls = 0;  // heap calls of the audio thread
  std::vector<double> heard;
};

// The scheme's frequency: 2 asin(sqrt(K/M)/2) per sample at 44100 Hz.
double pitch_hz(double stiffness, double mass) {
  return 44100.0 / M_PI * std::asin(0.5 * std::sqrt(stiffness / mass));
}

bool has(const std::string& text, const std::string& part) {
  INFO(text);
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("An edited parameter reaches the sounding voice", "[reload]") {
  const Folder folder;
  folder.write("m.mdl", model_text("0.01"));
  Stage stage(folder.write("p.toml", preset()));
  stage.strike();
  stage.play(9600);
  CHECK(stage.frequency_hz(4800) == Approx(pitch_hz(0.01, 1.0)).epsilon(1e-4));
  const std::uint32_t serial = stage.session.current()->serial;
  const auto swaps = stage.process.meters().swaps;
  const Reload news = stage.after([&] { folder.write("m.mdl", model_text("0.012")); });
  CHECK(news.is_done);
  CHECK(news.news == "p: K = 0.012");
  const std::size_t edited = 4800;
  stage.play(edited);
  CHECK(stage.frequency_hz(edited - 1024) == Approx(pitch_hz(0.012, 1.0)).epsilon(1e-4));
  CHECK(stage.process.meters().voices == 1);
  CHECK(stage.process.meters().swaps == swaps);  // the same engine
  CHECK(stage.session.current()->serial == serial);
  CHECK(stage.session.parameter("K") == 0.012);
}

TEST_CASE("An edit that is ignored is told", "[reload]") {
  const Folder folder;
  folder.write("m.mdl", model_text("0.01"));
  Stage stage(folder.write("p.toml", preset()));
  const std::string ignored = "warning: ignored: an element starts with '@'";
  const Reload same = stage.after([&] { folder.write("m.mdl", model_text("0.01") + "hello\n"); });
  CHECK(has(same.news, "p: reloaded; the sound is unchanged"));
  CHECK(has(same.news, ignored));
  const Reload moved = stage.after([&] { folder.write("m.mdl", model_text("0.012") + "hello\n"); });
  CHECK(has(moved.news, "p: K = 0.012"));
  CHECK(has(moved.news, ignored));
}

TEST_CASE("An edited number in the model reaches the sounding voice", "[reload]") {
  const Folder folder;
  folder.write("m.mdl", model_text("0.01", "1."));
  Stage stage(folder.write("p.toml", preset()));
  stage.strike();
  stage.play(9600);
  const double before = stage.peak(2400);
  const double bend = stage.largest_bend(2400);
  const std::uint32_t serial = stage.session.current()->serial;
  const Reload news = stage.after([&] { folder.write("m.mdl", model_text("0.01", "1.3")); });
  CHECK(has(news.news, "p: new numbers in "));
  stage.play(4800);
  CHECK(stage.process.meters().voices == 1);
  CHECK(stage.session.current()->serial == serial);
  CHECK(stage.frequency_hz(4096) == Approx(pitch_hz(0.01, 1.3)).epsilon(1e-4));
  CHECK(stage.peak(4096) == Approx(before).epsilon(0.2));
  CHECK(stage.largest_bend(4800) < 1.1 * bend);
  CHECK(stage.heap_calls == 0);
  SECTION("and the preset's gain changes without a step") {
    const double loud = stage.peak(2400);
    const double here = stage.largest_bend(2400);
    CHECK(stage.after([&] { folder.write("p.toml", preset("0.1")); }).is_done);
    stage.play(4800);
    CHECK(stage.peak(2400) == Approx(0.5 * loud).epsilon(0.05));
    CHECK(stage.largest_bend(4800) < 1.1 * here);
  }
}

TEST_CASE("A player's changes survive a reload", "[reload]") {
  const Folder folder;
  folder.write("m.mdl", model_text("0.01") + "@Z param 0.00001\n@t damper @s @m Z\n");
  Stage stage(folder.write("p.toml", preset()));
  const auto now = stage.session.current();
  const TimedEvent turn{
      .event = {.kind = EventKind::parameter, .index = 1, .model = now->serial, .value = 0.00002}};
  REQUIRE(now->instrument.parameters[1].name == "Z");
  REQUIRE(stage.process.send(stage.process.from_console, {&turn, 1}));
  stage.session.remember({&turn, 1});
  stage.play(64);
  CHECK(stage
            .after([&] {
              folder.write("m.mdl", model_text("0.01") +
                                        "@Z param 0.00001\n@t damper @s @m Z\n@n mass 1. 0. 0.\n"
                                        "@u springDamper @m @n K 0.00001\n");
            })
            .is_done);
  CHECK(stage.session.parameter("Z") == 0.00002);
  CHECK(stage.session.parameter("K") == 0.01);
}

TEST_CASE("Another structure is loaded like another scene", "[reload]") {
  const Folder folder;
  folder.write("m.mdl", model_text());
  Stage stage(folder.write("p.toml", preset()));
  const std::uint32_t serial = stage.session.current()->serial;
  const Reload news = stage.after([&] {
    folder.write("m.mdl",
                 model_text("0.01", "1.", "@n mass 1. 0. 0.\n@t springDamper @m @n K 0.\n"));
  });
  CHECK(has(news.news, "p: loaded again in "));
  CHECK(stage.session.current()->serial != serial);
  CHECK(stage.session.current()->instrument.masses == 2);
  stage.play(9600);
  stage.strike();
  stage.play(4800);
  CHECK(stage.peak(2400) > 0.01);
}

TEST_CASE("An error keeps the sound and is reported with its line and a caret", "[reload]") {
  const Folder folder;
  folder.write("m.mdl", model_text());
  Stage stage(folder.write("p.toml", preset()));
  Stage other(folder.file("p.toml"), {.compile = {.rate_hz = rate_hz}});
  for (Stage* const each : {&stage, &other}) {
    each->strike();
    each->play(4800);
  }
  Reload news =
      stage.after([&] { folder.write("m.mdl", model_text() + "@x spingDamper @s @m 1 0\n"); });
  CHECK(!news.is_done);
  CHECK(has(news.news, folder.file("m.mdl") + ":7:4: error: "));
  CHECK(has(news.news, "\n    @x spingDamper @s @m 1 0\n       ^"));
  news = stage.after([&] { folder.write("p.toml", preset() + "vocies = 3\n"); });
  CHECK(!news.is_done);
  CHECK(has(news.news, folder.file("p.toml") + ":"));
  news = stage.after([&] {
    folder.write("p.toml", preset());
    folder.write("m.mdl", model_text("40."));  // unstable
  });
  for (int i = 0; i < 100 && stage.session.last_reload().is_done; ++i) {
    std::this_thread::sleep_for(20ms);
  }
  CHECK(has(stage.session.last_reload().news, "unstable"));
  for (Stage* const each : {&stage, &other}) {
    each->play(4800);
  }
  CHECK(stage.heard == other.heard);
  // After a correction all is well.
  news = stage.after([&] { folder.write("m.mdl", model_text()); });
  CHECK(news.is_done);
}

TEST_CASE("A body that the voices pass through is watched", "[reload]") {
  const auto body = [](const std::string& ring, const std::string& hz) {
    return "@ring param " + ring + "\n@b body 1000. p\n@b1 mode @b " + hz +
           " ring 1.\n@in1 frcInput [@b p]\n@out1 posOutput [@b p]\n";
  };
  const Folder folder;
  folder.write("m.mdl", model_text());
  folder.write("b.mdl", body("1.", "300."));
  Stage stage(folder.write("p.toml", "through = [\"b.mdl\"]\n" + preset()));
  const auto told = [&](const std::string& ring, const std::string& hz) {
    return stage.after([&] { folder.write("b.mdl", body(ring, hz)); }).news;
  };
  CHECK(told("0.5", "300.") == "p: ring = 0.5");
  CHECK(has(told("0.5", "310."), "p: loaded again"));
  stage.play(9600);
  stage.strike();
  stage.play(4800);
  CHECK(stage.peak(2400) > 0.0);
  CHECK(has(told("0.5", "310.\n@b2 mode @b"), folder.file("b.mdl") + ":3:"));
  CHECK(stage.heap_calls == 0);
}

TEST_CASE("A file is watched however it is written", "[reload]") {
  const Folder folder;
  folder.write("m.mdl", model_text());
  Stage stage(folder.write("p.toml", preset()));
  const auto told = [&](const std::function<void()>& change, const std::string& stiffness) {
    CHECK(stage.after(change).news == "p: K = " + stiffness);
  };
  // Like vim and most editors: another file takes its name.
  told(
      [&] {
        folder.write("m.mdl.new", model_text("0.011"));
        fs::rename(folder.file("m.mdl.new"), folder.file("m.mdl"));
      },
      "0.011");
  // Moved away first, then written again.
  told(
      [&] {
        fs::rename(folder.file("m.mdl"), folder.file("m.mdl~"));
        folder.write("m.mdl", model_text("0.012"));
      },
      "0.012");
  // Written in two parts: the watch reads the file only after it is closed.
  told(
      [&] {
        std::ofstream out(folder.file("m.mdl"));
        const std::string text = model_text("0.013");
        out << text.substr(0, 60) << std::flush;
        std::this_thread::sleep_for(100ms);
        out << text.substr(60);
      },
      "0.013");
  // A symbolic link replaces the file, and then the link's target changes.
  folder.write("far.mdl", model_text("0.014"));
  told(
      [&] {
        fs::create_symlink("far.mdl", folder.file("link"));
        fs::rename(folder.file("link"), folder.file("m.mdl"));
      },
      "0.014");
  told([&] { folder.write("far.mdl", model_text("0.015")); }, "0.015");
  // Hundreds of other files in the same folder do not matter.
  const std::uint64_t count = stage.session.last_reload().count;
  for (int i = 0; i < 300; ++i) {
    folder.write("other" + std::to_string(i), "x");
  }
  std::this_thread::sleep_for(100ms);
  CHECK(stage.session.last_reload().count == count);
}

TEST_CASE("All files of a preset are watched, including missing ones", "[reload]") {
  const Folder folder;
  folder.write("m.mdl", model_text());
  folder.write("with.mdl", "@n mass 1. 0. 0.\n@t springDamper @m @n K 0.\n");
  folder.write("two.scl", "two\n1\n2/1\n");
  const std::string joins = preset() + "";
  const auto with = [&](const std::string& keys) { return keys + joins; };
  Stage stage(folder.write("p.toml", with("with = [\"with.mdl\"]\nscale = \"two.scl\"\n")));
  CHECK(stage.session.current()->instrument.masses == 2);
  CHECK(stage
            .after([&] {
              folder.write("with.mdl",
                           "@n mass 1. 0. 0.\n@o mass 1. 0. 0.\n@t springDamper @m @n K 0.\n"
                           "@u springDamper @m @o K 0.\n");
            })
            .is_done);
  CHECK(stage.session.current()->instrument.masses == 3);
  CHECK(has(stage.after([&] { folder.write("two.scl", "two\n1\nx\n"); }).news, "two.scl"));
  CHECK(stage.after([&] { folder.write("two.scl", "two\n1\n3/1\n"); }).is_done);
  CHECK(!stage.after([&] { folder.write("p.toml", with("with = [\"new.mdl\"]\n")); }).is_done);
  const Reload news = stage.after([&] { folder.write("new.mdl", "@q ground 0.\n"); });
  INFO(news.news);
  CHECK(news.is_done);
  CHECK(stage.session.current()->instrument.masses == 1);
}

// Many edits of any kind, including broken ones, while a key rings: no crash, no NaN and no click.
// The output is a x, where x swings and a is a moving gain: its second difference is at most A (w^2
// + 2 w a' + a''), with a' and a'' no larger than a level's ramp of 20 ms and a fade of 50 ms
// allow; a click of -60 dB would add 0.001 A.
TEST_CASE("Random edits neither crash nor click", "[reload]") {
  const char* const asked = std::getenv("RESSORT_EDITS");
  const int edits = asked != nullptr ? std::atoi(asked) : 20;
  const Folder folder;
  folder.write("m.mdl", model_text());
  Stage stage(folder.write("p.toml", preset()));
  support::Random random(7);
  struct Numbers {
    double stiffness = 0.01;
    double mass = 1.0;
    double gain = 0.2;
    std::size_t links = 0;
  } now;
  double stiffest = now.stiffness;
  double lightest = now.mass;
  int broken = 0;
  for (int i = 0; i < edits; ++i) {
    const Numbers before = now;
    const std::uint64_t resets = stage.process.meters().resets;
    switch (random.below(5)) {
      case 0:
        now.stiffness = random.uniform(0.002, 0.02);
        break;
      case 1:
        now.mass = random.uniform(0.5, 3.0);
        break;
      case 2:
        now.links = random.below(4);
        break;
      case 3:
        now.gain = random.uniform(0.05, 0.2);
        break;
      default:
        break;
    }
    std::string more;
    for (std::size_t k = 0; k < now.links; ++k) {
      const std::string name = "n" + std::to_string(k);
      more += "@" + name + " mass 1. 0. 0.\n@l" + name + " springDamper @m @" + name +
              " 0.0001 0.00001\n";
    }
    std::string text = model_text(std::to_string(now.stiffness), std::to_string(now.mass), more);
    const bool breaks = random.below(4) == 0;
    if (breaks) {
      const std::size_t at = random.below(text.size());
      if (random.below(2) == 0) {
        text.resize(at);
      } else {
        text[at] = static_cast<char>(1 + random.below(255));
      }
    }
    stage.strike(static_cast<int>(40 + random.below(40)));
    stage.play(4800);
    stage.heard.erase(stage.heard.begin(), stage.heard.end() - 2400);
    const Reload news = stage.after([&] {
      folder.write("p.toml", preset(std::to_string(now.gain)));
      folder.write("m.mdl", text);
    });
    for (std::uint64_t count = 0; count != stage.session.last_reload().count;) {
      count = stage.session.last_reload().count;  // the second of two files may come separately
      std::this_thread::sleep_for(60ms);
    }
    stage.play(4800);
    const auto same = stage.session.last_reload();
    broken += same.is_done ? 0 : 1;
    const auto loaded = stage.session.current();
    // A broken text may still be readable, with unknown numbers.
    if (breaks) {
      stage.after([&] {
        now = Numbers{};
        folder.write("p.toml", preset());
        folder.write("m.mdl", model_text());
      });
      std::this_thread::sleep_for(60ms);
      stage.play(9600);
      REQUIRE(std::isfinite(stage.peak(stage.heard.size())));
      continue;
    }
    stiffest = std::max(before.stiffness, now.stiffness) + 0.0003;
    lightest = std::min(before.mass, now.mass);
    const double w2 = stiffest / lightest * std::pow(44100.0 / rate_hz, 2);
    const double moves = 1.0 / 960.0 + 1.0 / 2400.0;
    const double loudest = stage.peak(stage.heard.size());
    CAPTURE(i, now.stiffness, now.mass, now.gain, now.links, news.news, loudest);
    CHECK(stage.largest_bend(stage.heard.size()) <
          loudest * (1.02 * w2 + (1.0 + 2.0 * std::sqrt(w2)) * moves + 1e-3));
    REQUIRE(std::isfinite(loudest));
    CHECK(stage.process.meters().resets == resets);  // a broken text may have a negative damper
  }
  CHECK(broken > 0);
}

}  // namespace ressort::reload_test
