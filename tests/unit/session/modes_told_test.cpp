// Modes of the playing scene, from the console: listed, tuned, undone, saved.
#include <cstdlib>

#include "app/session/files.h"
#include "app/session/modes/known_modes.h"
#include "tests/support/app/console_harness.h"

namespace ressort::modes_told_test {

namespace {

const char* const string_text =
    "@k param 0.1\n@s string 40 1. k 0.0005 0. 0.\n@in1 frcInput [@s 0.3]\n"
    "@out1 posOutput [@s 0.71]\n";

// The user's cache is below the data folder during a test.
struct CachedData : DataFolder {
  CachedData() { setenv("XDG_CACHE_HOME", cache().c_str(), 1); }
  ~CachedData() { unsetenv("XDG_CACHE_HOME"); }
  std::string cache() const { return path("cache").string(); }
  std::string written(const std::string& name, const std::string& text) const {
    write(name, text);
    return path(name).string();
  }
};

}  // namespace

TEST_CASE("notes and their frequencies", "[modes_told]") {
  CHECK(note_name(440.0) == "A4 +0");
  CHECK(note_name(261.6255653) == "C4 +0");
  CHECK(note_name(445.0) == "A4 +20");
  CHECK(note_name(27.0) == "A0 -32");
  CHECK(note_name(0.0) == "-");
  CHECK(frequency_of("A4") == 440.0);
  CHECK(std::fabs(*frequency_of("c4") - 261.6255653) < 1e-6);
  CHECK(std::fabs(*frequency_of("Bb2") - *frequency_of("A#2")) < 1e-9);
  CHECK(std::fabs(*frequency_of("Cb4") - *frequency_of("B3")) < 1e-9);
  CHECK(std::fabs(*frequency_of("C-1") - 8.1757989) < 1e-6);
  CHECK(frequency_of("220.5") == 220.5);
  for (const char* const wrong : {"", "H4", "A", "A4.5", "-3", "0", " 4", "A4 x", "4A", "#4"}) {
    INFO(wrong);
    CHECK(!frequency_of(wrong));
  }
}

TEST_CASE("a mode is tuned, undone and saved", "[modes_told]") {
  const CachedData folder;
  Harness harness;
  const std::string path = folder.written("mine.mdl", string_text);
  CHECK(harness.say("modes").find("no model is loaded") != std::string::npos);
  harness.say("load " + path);
  const std::string before = harness.say("modes 3");
  CHECK(before.find("178.7") != std::string::npos);
  CHECK(harness.say("tune 1 H9").find("expected a note") != std::string::npos);
  CHECK(harness.say("tune 99 A3").find("there is no mode 99") != std::string::npos);
  CHECK(harness.say("tune 1 A3 2").find("mode 1 is at 220 Hz") != std::string::npos);
  const std::string after = harness.say("modes 1");
  CHECK(after.find("220.000") != std::string::npos);
  CHECK(after.find("2.000") != std::string::npos);
  CHECK(harness.session.parameter("k") == 0.1);
  CHECK(harness.say("undo").find("mine is restored") != std::string::npos);
  CHECK(harness.say("modes 3") == before);
  harness.say("tune 1 A3");
  CHECK(harness.say("save tuned_one").find("saved to") != std::string::npos);
  fs::remove_all(folder.cache());
  CHECK(harness.say("load tuned_one").find("error") == std::string::npos);
  CHECK(harness.say("modes 1").find("220.000") != std::string::npos);
}

TEST_CASE("slowly found modes are cached for the same text, values and version", "[modes_told]") {
  const CachedData folder;
  const std::string cache = folder.cache();
  const std::string path =
      folder.written("large.mdl",
                     "@k param 0.1\n@s mesh 30 34 1. k 0.0005 0. 0.\n@in1 frcInput [@s 0.3 0.2]\n"
                     "@out1 posOutput [@s 0.7 0.6]\n");
  const auto scene = load_scene(path, {});
  REQUIRE(scene);
  const auto first = known_modes(*scene, start_values(*scene), {});
  REQUIRE(first);
  const auto files = [&] {
    std::vector<fs::path> found;
    if (fs::exists(cache + "/ressort/modes")) {
      for (const auto& entry : fs::directory_iterator(cache + "/ressort/modes")) {
        found.push_back(entry.path());
      }
    }
    return found;
  };
  REQUIRE(files().size() == 1);
  const auto second = known_modes(*scene, start_values(*scene), {});
  REQUIRE(second);
  CHECK(to_json(*first) == to_json(*second));
  // The file is read: its content is reported.
  const std::string kept = *read_text(files()[0].string(), 1u << 30);
  KnownModes fewer = *first;
  fewer.modes.resize(3);
  std::ofstream(files()[0]) << to_json(fewer);
  CHECK(known_modes(*scene, start_values(*scene), {})->modes.size() == 3);
  // An invalid file is replaced.
  std::ofstream(files()[0]) << kept.substr(0, kept.size() / 2);
  CHECK(to_json(*known_modes(*scene, start_values(*scene), {})) == to_json(*first));
  // Another value is another network.
  const auto other = known_modes(*scene, {0.11}, {});
  REQUIRE(other);
  CHECK(other->modes[3].frequency_hz > first->modes[3].frequency_hz);
}

}  // namespace ressort::modes_told_test
