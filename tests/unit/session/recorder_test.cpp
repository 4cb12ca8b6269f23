// Recordings by the console command `rec`.
#include <signal.h>
#include <sys/resource.h>

#include <chrono>

#include "app/session/sound_file.h"
#include "tests/support/app/console_harness.h"

namespace ressort::recorder_test {

TEST_CASE("rec records the output frame by frame", "[recorder]") {
  const Folder folder;
  const std::string path = folder.file("take.wav");
  Harness harness;
  harness.say("load " + write_triangle(folder));
  harness.say("noteon 60 127");
  harness.loudest(4);
  CHECK(harness.say("rec " + path) == "recording to " + path + "; 'rec stop' ends it\n");
  CHECK(has(harness.say("status"), "recording  yes"));
  CHECK(has(harness.say("rec " + path), "error: a recording to '" + path + "' is running"));
  std::vector<double> heard;
  for (const std::size_t frames : {period, std::size_t{1}, std::size_t{100}, period}) {
    for (const float sample : harness.play(frames)) {
      heard.push_back(static_cast<double>(sample));
    }
  }
  CHECK(harness.say("rec stop") == path + ": 0.01 s, nothing lost\n");
  harness.play();

  const auto sound = read_sound(path);
  REQUIRE(sound);
  CHECK(sound->rate_hz == 48000.0);
  REQUIRE(sound->channels.size() == 2);
  REQUIRE(sound->channels[0].size() == heard.size());
  REQUIRE(sound->channels[1].size() == heard.size());
  double worst = 0.0;
  for (std::size_t i = 0; i < heard.size(); ++i) {
    worst = std::max(worst, std::fabs(sound->channels[0][i] - heard[i]));
  }
  CHECK(worst <= 0x1p-23);  // one step of 24 bits
  CHECK(has(harness.say("rec stop"), "error: nothing is being recorded"));
}

TEST_CASE("a recording starts at the command, with the actual channels", "[recorder]") {
  const Folder folder;
  Harness harness(4);
  harness.process.is_recording.raise();  // chunks left over in the ring
  harness.play();
  harness.process.is_recording.lower();
  harness.say("rec " + folder.file("four.wav"));
  harness.play(100);
  CHECK(has(harness.say("rec stop"), "nothing lost"));
  const auto sound = read_sound(folder.file("four.wav"));
  REQUIRE(sound);
  REQUIRE(sound->channels.size() == 4);
  CHECK(sound->channels[3].size() == 100);
}

TEST_CASE("a recording of nothing is a valid file", "[recorder]") {
  const Folder folder;
  Harness harness;
  harness.say("rec " + folder.file("nothing.wav"));
  CHECK(has(harness.say("rec stop"), "nothing.wav: 0.00 s, nothing lost"));
  const auto sound = read_sound(folder.file("nothing.wav"));
  REQUIRE(sound);
  CHECK(sound->channels.size() == 2);
  CHECK(sound->channels[0].empty());
}

TEST_CASE("a recording reports lost chunks", "[recorder]") {
  const Folder folder;
  Harness harness;
  harness.say("rec " + folder.file("gap.wav"));
  harness.play();
  Meters meters;
  meters.record_lost = 3;
  harness.process.board.write(meters);
  CHECK(has(harness.say("rec stop"), "gap.wav: 0.01 s, 3 pieces lost"));
}

TEST_CASE("an unwritable file is reported at once", "[recorder]") {
  const Folder folder;
  Harness harness;
  CHECK(has(harness.say("rec " + folder.file("none/x.wav")), "x.wav' cannot be written"));
  CHECK_FALSE(harness.process.is_recording.is_raised());
  CHECK(has(harness.say("rec stop"), "error: nothing is being recorded"));
}

TEST_CASE("rec overwrites a sound with --force, and other files never", "[recorder]") {
  const Folder folder;
  Harness harness;
  const std::string path = folder.file("take.wav");
  harness.say("rec " + path);
  harness.play(100);
  harness.say("rec stop");
  CHECK(has(harness.say("rec " + path), "take.wav' exists already; --force overwrites it"));
  CHECK(has(harness.say("rec " + path + " --force"), "recording to"));
  harness.play(50);
  CHECK(read_sound(path)->channels[0].size() == 100);  // until the new one is complete
  harness.say("rec stop");
  CHECK(read_sound(path)->channels[0].size() == 50);
  CHECK(has(harness.say("rec " + folder.write("poem.wav", "text") + " --force"),
            "is not a sound file"));
  CHECK(has(harness.say("rec " + folder.file("take.mp4")), "has no known sound file ending"));
}

TEST_CASE("rec writes the file type of the ending", "[recorder]") {
  const Folder folder;
  Harness harness;
  for (const std::string_view ending : sound_endings()) {
    const std::string path = folder.file("take" + std::string(ending));
    INFO(path);
    CHECK(has(harness.say("rec " + path), "recording to"));
    harness.play(200);
    CHECK(has(harness.say("rec stop"), "nothing lost"));
    const auto sound = read_sound(path);
    REQUIRE(sound);
    CHECK(sound->rate_hz == 48000.0);
    CHECK(sound->channels[0].size() == 200);
  }
}

TEST_CASE("a full disk ends a recording at once, and the sound continues", "[recorder]") {
  const Folder folder;
  Harness harness;
  harness.say("load " + write_triangle(folder));
  const std::string path = folder.file("take.wav");
  harness.say("rec " + path);
  auto news = harness.news.get_future();
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{40960, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &limit);
  while (news.wait_for(std::chrono::milliseconds(1)) != std::future_status::ready) {
    harness.play();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, handler);
  const std::string told = news.get();
  CHECK(has(told, "writing '" + path + "' failed: File too large; the recording ended after 0."));
  harness.say("noteon 60 127");
  CHECK(harness.loudest(20) > 0.0);
  const auto sound = read_sound(path);
  REQUIRE(sound);
  CHECK(sound->channels[0].size() > 6000);  // of the 6826 that fit
  CHECK(sound->channels[0].size() <= 6826);
  CHECK_FALSE(has(harness.say("status"), "recording"));
  CHECK(harness.say("rec stop") == "error: " + told + "\n");
  CHECK(has(harness.say("rec stop"), "nothing is being recorded"));
  CHECK(has(harness.say("rec " + folder.file("next.wav")), "recording to"));
}

TEST_CASE("an unfinished recording ends with the console", "[recorder]") {
  const Folder folder;
  {
    Harness harness;
    harness.say("rec " + folder.file("end.wav"));
    harness.play(100);
  }
  const auto sound = read_sound(folder.file("end.wav"));
  REQUIRE(sound);
  CHECK(sound->channels[0].size() == 100);
}

}  // namespace ressort::recorder_test
