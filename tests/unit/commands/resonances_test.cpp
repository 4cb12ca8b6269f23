// Bodies from resonance models, and how files and options are told apart.
#include "app/commands/body/resonances.h"

#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>
#include <thread>

#include "app/commands/offline.h"
#include "app/session/sound_file.h"
#include "tests/support/app/data_folder.h"
#include "tests/support/pitch.h"
#include "tests/support/player.h"
#include "tests/support/rooms.h"

namespace ressort::resonances_test {
namespace {

using namespace support;

std::string text_of(const std::string& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

const std::string bell =
    "@K param 0.003\n@o osc 1. K 0.00005 0. 0.\n@in1 frcInput @o\n@out1 posOutput @o\n";

Rendered rendered(const RenderOptions& options) {
  auto done = render(options, {});
  INFO((done ? "" : done.error().message));
  REQUIRE(done);
  return *std::move(done);
}

}  // namespace

TEST_CASE("a resonance model becomes a body with its frequencies, levels and decays",
          "[resonances]") {
  const auto modes = parse_resonances("; made here\n2 447.1 0.3 2.0\n3 220.0 0.5 1.2 # low\n\n");
  REQUIRE(modes);
  REQUIRE(modes->size() == 2);
  CHECK((*modes)[0].frequency_hz == 220.0);
  const Folder folder;
  const std::string output = folder.file("body.mdl");
  REQUIRE(resonance_body(*modes, {.input = "a.txt", .output = output}, 40.0) == 0);
  Preset preset = struck(1);
  Player player(text_of(output), preset, {.bare = true});
  // The model's impulse response is the sum of a exp(-pi b t) sin(2 pi f t).
  const Network network = network_of(text_of(output));
  Bare<double> bare(make_program(network, 44100.0, true));
  double worst = 0.0;
  for (int n = 0; n < 20000; ++n) {
    const double t = (n + 1) / 44100.0;
    double expected = 0.0;
    for (const Resonance& mode : *modes) {
      expected += mode.amplitude * std::exp(-std::numbers::pi * mode.bandwidth_hz * t) *
                  std::sin(2.0 * std::numbers::pi * mode.frequency_hz * t);
    }
    worst = std::max(worst, std::fabs(bare.step({n == 0 ? 1.0 : 0.0})[0] - expected));
  }
  CHECK(worst < 1e-9);
}

TEST_CASE("other texts are no resonance models", "[resonances]") {
  for (const char* const text :
       {"", "; nothing\n", "1 2\n", "220 0.5 0\n", "220 0.5 x\n", "1 220 0.5 1\n7 440 0.5 1\n",
        "-1 0.5 1\n", "v 0 0 0\n", "1 2 3 4 5\n", "220 0 1\n"}) {
    INFO(text);
    CHECK_FALSE(parse_resonances(text));
  }
  CHECK(parse_resonances("220,0.5,1.2\r\n440 0.1 2"));
}

TEST_CASE("notes of a score tune a model without a preset, as those of a MIDI file do",
          "[resonances]") {
  const Folder folder;
  const std::string model = folder.write("bell.mdl", bell);
  const std::string output = folder.file("bell.wav");
  for (const int key : {48, 60, 67}) {
    const std::string score =
        folder.write("keys.score", "0 /note/on " + std::to_string(key) + " 100\n");
    rendered({.name = model, .output = output, .seconds = 1.0, .score = score});
    const auto sound = read_sound(output);
    REQUIRE(sound);
    const double hz = 440.0 * std::exp2((key - 69) / 12.0);
    CHECK(std::fabs(measured_hz(sound->channels[0], 44100.0, hz) / hz - 1.0) < 1e-3);
  }
}

TEST_CASE("options for keys without keys cause a warning", "[resonances]") {
  const Folder folder;
  const std::string model = folder.write("bell.mdl", bell);
  const std::string output = folder.file("bell.wav");
  const auto warnings = [&](RenderOptions options) {
    options.name = model;
    options.output = output;
    options.seconds = 0.01;
    return rendered(options).warnings;
  };
  const auto has = [](const std::vector<std::string>& all, const std::string& part) {
    return std::count_if(all.begin(), all.end(), [&](const std::string& text) {
             return text.find(part) != std::string::npos;
           }) == 1;
  };
  CHECK(has(warnings({.keys = {.a4_hz = 432.0}}), "the tuning has no effect"));
  CHECK(has(warnings({.voices = 3}), "--voices has no effect"));
  CHECK(has(warnings({.keys = {.channels = 2U}}), "--channel has no effect without --midi"));
  const std::string score = folder.write("keys.score", "0 /note/on 60 100\n");
  CHECK_FALSE(has(warnings({.score = score, .keys = {.a4_hz = 432.0}}), "no effect"));
  CHECK_FALSE(has(warnings({.score = score, .voices = 3}), "no effect"));
}

TEST_CASE("a score may come through a pipe", "[resonances]") {
  const Folder folder;
  const std::string model = folder.write("bell.mdl", bell);
  const std::string pipe = folder.file("pipe");
  const std::string output = folder.file("bell.wav");
  REQUIRE(mkfifo(pipe.c_str(), 0600) == 0);
  std::thread writer([&] { std::ofstream(pipe) << "0 /note/on 60 100\n"; });
  const Rendered done = rendered({.name = model, .output = output, .seconds = 0.2, .score = pipe});
  writer.join();
  CHECK(done.peak > 1e-4);
}

}  // namespace ressort::resonances_test
