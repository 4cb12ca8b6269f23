// Measured times that are kept from one run to the next.
#include "app/session/wisdom.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "app/session/session.h"
#include "tests/support/player.h"

namespace ressort::wisdom_test {
namespace {

namespace fs = std::filesystem;

struct Folder {
  fs::path path = fs::temp_directory_path() / ("ressort-wisdom-" + std::to_string(getpid()));
  Folder() { fs::create_directories(path); }
  ~Folder() { fs::remove_all(path); }
  std::string file() const { return (path / "cache" / "wisdom.json").string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path / name) << text;
    return (path / name).string();
  }
};

TEST_CASE("wisdom is kept from one run to the next", "[wisdom]") {
  const Folder folder;
  Wisdom first(folder.file());
  CHECK_FALSE(first.recall("a"));
  first.keep("a", 100.0);
  CHECK(first.recall("a") == 100.0);
  first.save();
  Wisdom second(folder.file());
  CHECK(second.recall("a") == 100.0);
  CHECK_FALSE(second.recall("b"));
  // Another process writes meanwhile.
  Wisdom other(folder.file());
  other.keep("b", 200.0);
  other.save();
  second.keep("c", 300.0);
  second.save();
  Wisdom third(folder.file());
  CHECK(third.recall("a") == 100.0);
  CHECK(third.recall("b") == 200.0);
  CHECK(third.recall("c") == 300.0);
}

TEST_CASE("a damaged or unreadable wisdom file counts as empty", "[wisdom]") {
  const Folder folder;
  fs::create_directories(fs::path(folder.file()).parent_path());
  for (const std::string text :
       {"", "{", "[1, 2]", "{\"a\": \"b\"}", "{\"a\": -1}", "\xff\xfe\x01"}) {
    std::ofstream(folder.file()) << text;
    Wisdom wisdom(folder.file());
    CAPTURE(text);
    CHECK_FALSE(wisdom.recall("a"));
    wisdom.keep("a", 100.0);
    wisdom.save();
    CHECK(Wisdom(folder.file()).recall("a") == 100.0);
  }
  // A folder in its place cannot be written either.
  fs::remove(folder.file());
  fs::create_directories(folder.file());
  Wisdom wisdom(folder.file());
  CHECK_FALSE(wisdom.recall("a"));
  wisdom.keep("a", 100.0);
  wisdom.save();
  CHECK(wisdom.recall("a") == 100.0);
  Wisdom nowhere("");
  nowhere.keep("a", 100.0);
  nowhere.save();
  CHECK(nowhere.recall("a") == 100.0);
}

// A callback of 64 frames, in which a key may be struck.
std::vector<double> listen(Process& process, bool strikes) {
  std::vector<double> left(64);
  std::vector<double*> outputs{left.data()};
  const std::uint8_t on[] = {0x90, 48, 100};
  const MidiPacket packet{7, on};
  process.block(std::span<const double* const>(), std::span<double* const>(outputs), 64,
                std::span(&packet, strikes ? 1 : 0), 0);
  return left;
}

// A session with a clock by which one form is ten times cheaper than the others.
struct Stage {
  Stage(const Folder& folder, const std::string& cheap)
      : process(48000.0),
        session(process,
                {.compile = {.rate_hz = 48000.0},
                 .time =
                     [this, cheap](const Program& program, const std::function<void()>& play) {
                       play();
                       ++calls;
                       return form_name(program.form) == cheap ? 1e3 : 1e4;
                     },
                 .wisdom_path = folder.file()},
                {}) {}

  std::string form() const { return session.current()->plan.parts.at(0).form; }
  bool is_measured() const { return session.current()->plan.parts.at(0).measured_ns > 0.0; }

  std::atomic<std::size_t> calls = 0;
  Process process;
  Session session;
};

const std::string model = scenes::string("s", 12, "0.1", "0.0005") +
                          "@b nlSpring3 @s_m2 @s_m7 0.01 0.05 0.\n@in1 frcInput @s_m3\n" +
                          scenes::output(1, "s_m10");
const std::string preset =
    "model = \"m.mdl\"\nvoices = 2\n[[control]]\nfrom = \"note\"\n"
    "to = \"in1\"\nhow = \"impulse\"\nkeys = [0, 50]\n";

TEST_CASE(
    "a session measures the forms of a model while it plays, and takes the cheaper without a "
    "click",
    "[wisdom]") {
  const Folder folder;
  folder.write("m.mdl", model);
  const std::string path = folder.write("m.toml", preset);
  Process stays(48000.0);
  Session as_estimated(stays, {.compile = {.rate_hz = 48000.0}}, {});
  const auto loaded = as_estimated.load_and_wait(path);
  REQUIRE(loaded);
  const std::string first = (*loaded)->plan.parts.at(0).form;
  REQUIRE(first != "modal");
  CHECK((*loaded)->plan.parts.at(0).measured_ns == 0.0);
  const std::string cheap = first == "direct" ? "chains" : "direct";
  {
    Stage stage(folder, cheap);
    const auto begun = stage.session.load_and_wait(path);
    REQUIRE(begun);
    CHECK((*begun)->plan.parts.at(0).form == first);
    support::Comparison comparison;
    const auto play = [&](std::size_t blocks) {
      for (std::size_t n = 0; n < blocks; ++n) {
        const auto expected = listen(stays, n == 0);
        const auto found = listen(stage.process, n == 0);
        for (std::size_t i = 0; i < expected.size(); ++i) {
          comparison.add(expected[i], found[i]);
        }
      }
    };
    play(50);
    for (int patience = 0; patience < 5000 && stage.process.meters().swaps < 2; ++patience) {
      play(20);
    }
    play(500);
    CHECK(stage.process.meters().swaps == 2);
    CHECK(stage.form() == cheap);
    CHECK(stage.is_measured());
    CHECK(stage.calls > 0);
    CHECK(comparison.peak > 1e-6);
    INFO(support::show(comparison.relative()));
    CHECK(comparison.relative() < 1e-11);
  }
  REQUIRE(fs::exists(folder.file()));
  // The next run uses the cheap form at once and measures nothing.
  {
    Stage stage(folder, cheap);
    const auto again = stage.session.load_and_wait(path);
    REQUIRE(again);
    CHECK((*again)->plan.parts.at(0).form == cheap);
    CHECK_FALSE((*again)->plan.parts.at(0).is_untimed);
    CHECK(stage.calls == 0);
  }
  // A damaged file is ignored: the times are measured again and the file is rewritten.
  std::ofstream(folder.file()) << "{\"half";
  {
    Stage stage(folder, cheap);
    const auto again = stage.session.load_and_wait(path);
    REQUIRE(again);
    CHECK((*again)->plan.parts.at(0).form == first);
    for (int patience = 0; patience < 5000 && stage.process.meters().swaps < 2; ++patience) {
      listen(stage.process, false);
      stage.session.wait(std::chrono::milliseconds(1));
    }
    CHECK(stage.calls > 0);
  }
  Stage stage(folder, cheap);
  const auto last = stage.session.load_and_wait(path);
  REQUIRE(last);
  CHECK((*last)->plan.parts.at(0).form == cheap);
  CHECK(stage.calls == 0);
}

}  // namespace
}  // namespace ressort::wisdom_test
