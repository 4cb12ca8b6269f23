// Written files: inputs and existing files are never lost, and a killed recording is a sound file.
#include "app/session/files.h"

#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <thread>

#include "app/session/loader.h"
#include "app/session/sound_file.h"
#include "tests/support/app/data_folder.h"
#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::files_test {
namespace {

namespace fs = std::filesystem;

using Names = std::set<std::string>;

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != text.npos;
}

template <class T>
std::string error_of(const Result<T>& result) {
  REQUIRE_FALSE(result);
  return result.error().message;
}

// A ramp that lossless formats store exactly to one part in 2^15.
std::vector<double> ramp(std::size_t frames) {
  std::vector<double> samples(2 * frames);
  for (std::size_t n = 0; n < frames; ++n) {
    samples[2 * n] = 0.5 * std::sin(0.05 * static_cast<double>(n));
    samples[2 * n + 1] = 0.0;
  }
  return samples;
}

// Limits the size of files while this object lives.
class FileLimit {
 public:
  explicit FileLimit(rlim_t bytes) : before_(signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit limit{bytes, old_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileLimit() {
    setrlimit(RLIMIT_FSIZE, &old_);
    signal(SIGXFSZ, before_);
  }
  FileLimit(const FileLimit&) = delete;
  FileLimit& operator=(const FileLimit&) = delete;

 private:
  rlimit old_{};
  void (*before_)(int);
};

}  // namespace

TEST_CASE("a file gets its name when it is complete", "[files]") {
  const Folder folder;
  const std::string path = folder.write("a.txt", "old");
  chmod(path.c_str(), 0640);
  {
    auto file = NewFile::open(path, Existing::replace);
    REQUIRE(file);
    REQUIRE(file->write("new"));
    CHECK(folder.text("a.txt") == "old");
    CHECK(folder.text("a.part.txt") == "new");
    auto second = NewFile::open(path, Existing::replace);  // two at once
    REQUIRE(second);
    CHECK(folder.names() == Names{"a.txt", "a.part.txt", "a.part2.txt"});
    REQUIRE(file->keep());
  }
  CHECK(folder.text("a.txt") == "new");
  CHECK(folder.names() == Names{"a.txt"});
  struct stat now {};
  REQUIRE(stat(path.c_str(), &now) == 0);
  CHECK((now.st_mode & 0777) == 0640);
}

TEST_CASE("an existing file is not overwritten without --force", "[files]") {
  const Folder folder;
  const std::string path = folder.write("a.txt", "old");
  CHECK(has(error_of(write_text(path, "new", Existing::refuse)),
            "a.txt' exists already; --force overwrites it"));
  CHECK(folder.text("a.txt") == "old");
  auto file = NewFile::open(folder.file("b.txt"), Existing::refuse);
  REQUIRE(file);
  REQUIRE(file->write("mine"));
  folder.write("b.txt", "came meanwhile");
  CHECK(has(error_of(file->keep()), "File exists"));
  CHECK(folder.text("b.txt") == "came meanwhile");
  CHECK(has(error_of(write_text(folder.file(""), "x", Existing::replace)), "is a folder"));
}

TEST_CASE("a link's target is replaced, not the link", "[files]") {
  const Folder folder;
  folder.write("real.txt", "old");
  fs::create_symlink("real.txt", folder.file("link.txt"));
  fs::create_symlink("later.txt", folder.file("dangling.txt"));
  REQUIRE(write_text(folder.file("link.txt"), "new", Existing::replace));
  REQUIRE(write_text(folder.file("dangling.txt"), "first", Existing::refuse));
  CHECK(fs::is_symlink(folder.file("link.txt")));
  CHECK(folder.text("real.txt") == "new");
  CHECK(folder.text("later.txt") == "first");
}

TEST_CASE("an input file is recognised by any of its names", "[files]") {
  const Folder folder;
  const std::string read[] = {"", folder.write("in.wav", "x")};
  fs::create_symlink("in.wav", folder.file("soft.wav"));
  fs::create_hard_link(folder.file("in.wav"), folder.file("hard.wav"));
  fs::create_directory(folder.file("sub"));
  for (const char* name : {"in.wav", "./in.wav", "sub/../in.wav", "soft.wav", "hard.wav"}) {
    INFO(name);
    CHECK(has(error_of(check_not_input(folder.file(name), read)), "cannot be the output"));
  }
  CHECK(check_not_input(folder.file("out.wav"), read));
  CHECK(check_not_input(folder.write("same_text.wav", "x"), read));
}

TEST_CASE("a failed write keeps the old file", "[files]") {
  const Folder folder;
  const std::string path = folder.write("a.txt", "old");
  {
    const FileLimit limit(4096);
    CHECK(has(error_of(write_text(path, std::string(5000, 'x'), Existing::replace)),
              "File too large"));
  }
  CHECK(folder.text("a.txt") == "old");
  CHECK(folder.names() == Names{"a.txt"});
  CHECK(has(error_of(write_text("/dev/full", "x", Existing::refuse)), "No space left on device"));
  CHECK(write_text("/dev/null", "x", Existing::refuse));
  CHECK(fs::is_character_file("/dev/null"));
}

TEST_CASE("the error for a name says what is there instead of a file", "[files]") {
  const Folder folder;
  const auto said = [&](const std::string& name) {
    return error_of(find_scene(folder.file(name), Reach::any_file));
  };
  REQUIRE(mkfifo(folder.file("Pipe.toml").c_str(), 0600) == 0);
  fs::create_directory(folder.file("Folder"));
  fs::create_symlink(folder.file("Loop.mdl"), folder.file("Loop.mdl"));
  fs::create_symlink(folder.file("nowhere"), folder.file("Lost.mdl"));
  CHECK(has(said("Pipe"), "Pipe.toml' is a pipe; expected a .mdl model"));
  CHECK(has(said("Folder"), "Folder' is a folder; expected"));
  CHECK(has(said("Loop"), "Loop.mdl' is a loop of links; expected"));
  CHECK(has(said("Lost"), "Lost.mdl' is a link to nothing; expected"));
  CHECK(has(said("None"), "there is no model or preset"));
}

TEST_CASE("a byte order mark is skipped, and UTF-16 is an error", "[files]") {
  const Folder folder;
  const auto text = read_text(folder.write("a",
                                           "\xef\xbb\xbf"
                                           "0 /panic"),
                              100);
  REQUIRE(text);
  CHECK(*text == "0 /panic");
  for (const std::string mark : {"\xff\xfe", "\xfe\xff"}) {
    CHECK(has(error_of(read_text(folder.write("b", mark + std::string("0\0", 2)), 100)),
              "b' is text in UTF-16; save it as UTF-8"));
  }
}

TEST_CASE("the ending selects the sound file type", "[files]") {
  const Folder folder;
  const std::vector<double> samples = ramp(4000);
  for (const std::string_view ending : sound_endings()) {
    INFO(ending);
    const std::string path = folder.file("a" + std::string(ending));
    auto file = SoundWriter::open(path, {.rate_hz = 48000.0}, Existing::refuse);
    REQUIRE(file);
    REQUIRE(file->write(samples.data(), 4000));
    REQUIRE(file->close());
    const auto read = read_sound(path);
    REQUIRE(read);
    CHECK(read->rate_hz == 48000.0);
    REQUIRE(read->channels.size() == 2);
    REQUIRE(read->channels[0].size() == 4000);
    double worst = 0.0;
    for (std::size_t n = 0; n < 4000; ++n) {
      worst = std::max(worst, std::fabs(read->channels[0][n] - samples[2 * n]));
    }
    CHECK(worst <= (ending == ".ogg" ? 0.05 : 0x1p-23));
  }
  // Each has the first bytes of its own type.
  CHECK(folder.text("a.wav").substr(0, 4) == "RIFF");
  CHECK(folder.text("a.flac").substr(0, 4) == "fLaC");
  CHECK(folder.text("a.ogg").substr(0, 4) == "OggS");
  CHECK(folder.text("a.w64").substr(0, 4) == "riff");
  CHECK(folder.text("a.aiff").substr(0, 4) == "FORM");
  CHECK(folder.text("a.au").substr(0, 4) == ".snd");
  CHECK(folder.text("a.caf").substr(0, 4) == "caff");
}

TEST_CASE("impossible sound formats are rejected", "[files]") {
  const Folder folder;
  const auto refusal = [&](const std::string& name, const SoundForm& form) {
    return error_of(SoundWriter::open(folder.file(name), form, Existing::refuse));
  };
  for (const char* name : {"a.mp4", "a", "a.mdl", ".wav"}) {
    INFO(name);
    CHECK(has(refusal(name, {}), "no known sound file ending; use one of .wav, .w64"));
  }
  CHECK(has(refusal("a.flac", {.samples = SampleFormat::float32}), "holds pcm24, but no floats"));
  CHECK(has(refusal("a.ogg", {.samples = SampleFormat::pcm24}), "holds compressed samples only"));
  CHECK(has(refusal("a.aiff", {.frames = 1LL << 30}), "is limited to 4 GB"));
  CHECK(folder.names().empty());
}

TEST_CASE("a sound file overwrites only sound files", "[files]") {
  const Folder folder;
  const auto open = [&](const std::string& name) {
    return SoundWriter::open(folder.file(name), {}, Existing::replace);
  };
  folder.write("poem.wav", "it is no sound");
  CHECK(has(error_of(open("poem.wav")), "is not a sound file, so it is not overwritten"));
  CHECK(folder.text("poem.wav") == "it is no sound");
  folder.write("empty.wav", "");
  CHECK(open("empty.wav"));
  folder.write("old.wav", "RIFF, and then it was killed");
  {
    auto file = open("old.wav");
    REQUIRE(file);
    REQUIRE(file->write(ramp(100).data(), 100));
  }  // not closed
  CHECK(folder.text("old.wav") == "RIFF, and then it was killed");
  CHECK(folder.names() == Names{"poem.wav", "empty.wav", "old.wav"});
}

TEST_CASE("a WAV of unknown or great length can exceed 4 GB", "[files]") {
  const Folder folder;
  for (const std::optional<long long> frames : {std::optional<long long>(), {1LL << 32}}) {
    const std::string path = folder.file("a.wav");
    auto file = SoundWriter::open(path, {.frames = frames}, Existing::replace);
    REQUIRE(file);
    CHECK(folder.text("a.part.wav").substr(0, 4) == "RF64");
    REQUIRE(file->write(ramp(100).data(), 100));
    REQUIRE(file->close());
    const std::string text = folder.text("a.wav");
    CHECK(text.substr(0, 4) == "RIFF");  // it did not exceed 4 GB in the end
    const std::size_t peaks = text.find("PEAK");
    CHECK((peaks == std::string::npos || text.substr(peaks + 12, 4) == std::string(4, '\0')));
    CHECK(read_sound(path)->channels[0].size() == 100);
  }
}

TEST_CASE("a full disk is reported by the write, and the sound before it can be saved", "[files]") {
  const Folder folder;
  constexpr std::size_t block = 256;
  const std::vector<double> samples = ramp(block);
  for (const std::string_view ending : sound_endings()) {
    INFO(ending);
    const std::string path = folder.file("a" + std::string(ending));
    const FileLimit limit(40960);
    auto file = SoundWriter::open(path, {.samples = {}, .is_shown = true}, Existing::refuse);
    REQUIRE(file);
    std::size_t written = 0;
    Result<Done> last = Done{};
    for (int i = 0; i < 2000 && (last = file->write(samples.data(), block)); ++i) {
      written += block;
    }
    CHECK(has(error_of(last), "failed: File too large"));
    REQUIRE(file->salvage());
    const auto read = read_sound(path);
    REQUIRE(read);
    if (ending != ".flac" && ending != ".ogg") {  // these formats buffer data
      CHECK(read->channels[0].size() >= written);
      CHECK(read->channels[0].size() < written + block);
    }
  }
  auto full = SoundWriter::open("/dev/full", {}, Existing::refuse);
  CHECK(has(error_of(full), "No space left on device"));
}

TEST_CASE("a killed recording is complete up to the last second", "[files]") {
  const Folder folder;
  constexpr std::size_t block = 480;
  constexpr std::size_t blocks = 60;
  const char* const names[] = {"a.wav", "a.w64", "a.flac", "a.ogg", "a.aiff", "a.au", "a.caf"};
  const std::vector<double> samples = ramp(block);
  int told[2];
  REQUIRE(pipe(told) == 0);
  const pid_t child = fork();
  if (child == 0) {  // writes a block every 20 ms until it is killed, and reports each
    std::vector<SoundWriter> files;
    for (const char* name : names) {
      files.push_back(*SoundWriter::open(folder.file(name), {.is_shown = true}, Existing::refuse));
    }
    do {
      for (SoundWriter& file : files) {
        static_cast<void>(file.write(samples.data(), block));
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    } while (write(told[1], "x", 1) == 1);
    _exit(1);
  }
  close(told[1]);
  char byte = 0;
  std::size_t count = 0;
  while (count < blocks && read(told[0], &byte, 1) == 1) {
    ++count;
  }
  kill(child, SIGKILL);
  int status = 0;
  waitpid(child, &status, 0);
  close(told[0]);
  REQUIRE(count == blocks);
  for (const char* name : names) {
    INFO(name);
    const auto sound = read_sound(folder.file(name));
    REQUIRE(sound);
    CHECK(sound->channels[0].size() >= blocks * block / 4);
  }
}

TEST_CASE("a sound is read from a regular file", "[files]") {
  const Folder folder;
  REQUIRE(mkfifo(folder.file("pipe.wav").c_str(), 0600) == 0);
  CHECK(has(error_of(SoundReader::open(folder.file("pipe.wav"))), "is not a regular file"));
  CHECK(has(error_of(SoundReader::open(folder.file("none.wav"))), "there is no file"));
  CHECK(has(error_of(SoundReader::open(folder.file(""))), "is not a regular file"));
  CHECK(has(error_of(SoundReader::open(folder.write("text.wav", "no sound"))),
            "is not a readable sound file"));
}

TEST_CASE("a preset joins several models, and an error names the right file", "[files]") {
  const Folder folder;
  const std::string box = "@box body 40. bridge\n@box_1 mode @box 100. 0.5 1.\n";
  folder.write("string.mdl",
               "# a string\n@s string 8 1. 0.1 0.001 0. 0.\n@in1 frcInput [@s 0.3]\n");
  folder.write("box.mdl",
               box + "@tie spring [@s 0.9] [@box bridge] 0.05\n@out1 posOutput [@box bridge]");
  const std::string preset =
      folder.write("both.toml", "model = \"string.mdl\"\nwith = [\"box.mdl\"]\n");
  const auto scene = load_scene(preset, {});
  REQUIRE(scene);
  CHECK(scene->network.macros.size() == 2);
  CHECK(scene->network.links.size() == 1);
  REQUIRE(scene->warnings.size() == 1);
  CHECK(has(scene->warnings[0],
            "both.toml:1:9: warning: there is no [[control]], so neither keys nor sound"));
  const auto played = load_scene(
      folder.write("played.toml",
                   "model = \"string.mdl\"\nwith = [\"box.mdl\"]\n[[control]]\nfrom = \"note\"\n"
                   "to = \"in1\"\nhow = \"impulse\"\nrange = [1.0, 1.0]\n"),
      {});
  REQUIRE(played);
  CHECK(played->warnings.empty());
  folder.write("box.mdl", box + "@tie spring [@s 0.9] [@box brigde] 0.05\n");
  const auto broken = load_scene(preset, {});
  CHECK(has(error_of(broken), "box.mdl:3:28: error: the body '@box' has no place called 'brigde'"));
  const std::string missing =
      folder.write("missing.toml", "model = \"string.mdl\"\nwith = [\"bix.mdl\"]\n");
  CHECK(has(error_of(load_scene(missing, {})), "the model 'bix.mdl' is neither beside"));
}

}  // namespace ressort::files_test
