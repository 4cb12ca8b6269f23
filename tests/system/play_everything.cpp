// Plays every model in the way of `ressort play`, with a simulated clock:
//
//   ressort_play_everything SECONDS [NETWORKS [SEED [FOLDER or FILE...]]]
//
// Plays each model in the folders (default: the program's models and presets and the tests' corpus)
// and random networks, each alone and with a preset that has controls of every kind, for SECONDS
// each: keys, controllers, every gesture of every input, every parameter over its range, a load of
// the same scene while it sounds, and panic, which must silence it. One model in four is computed
// in float, another with a clock by which it is never in time. A model may be rejected as unstable,
// and is then forced. All output must be finite and below full scale, and the numbers that the
// console prints must be valid.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <set>
#include <sstream>
#include <thread>

#include <unistd.h>

#include "app/control/console.h"
#include "app/control/registry.h"
#include "app/realtime/process.h"
#include "app/session/session.h"
#include "core/model/language/mdl.h"
#include "tests/support/networks/random_network.h"
#include "tests/support/random.h"
#include "tests/system/every_control.h"

namespace {

using namespace ressort;
namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr double rate_hz = 48000.0;
constexpr std::size_t longest_block = 512;
constexpr std::size_t block_lengths[] = {256, 64, 512, 1, 333};
constexpr double fade_s = 0.1;  // longer than every fade

// Actions on an instrument in one block.
struct Move {
  std::vector<std::uint8_t> midi;
  std::optional<Message> call;
};

std::vector<Move> moves_on(const Instrument& instrument) {
  std::vector<Move> moves;
  const auto send = [&](std::vector<std::uint8_t> bytes) {
    moves.push_back({std::move(bytes), {}});
  };
  const auto ask = [&](std::string address, std::vector<Argument> arguments) {
    moves.push_back({{}, Message{std::move(address), std::move(arguments)}});
  };
  const auto all_controllers = [&](std::uint8_t value) {
    std::vector<std::uint8_t> bytes;
    for (std::uint8_t number = 0; number < 120; ++number) {
      bytes.insert(bytes.end(), {0xb0, number, value});
    }
    send(std::move(bytes));
  };
  send({0x90, 60, 127});
  send({0x90, 36, 1, 96, 64});
  for (const InputInfo& input : instrument.inputs) {
    const std::string address = "/in/" + std::to_string(input.number);
    if (input.is_force) {
      ask(address + "/force", {1.0});
      ask(address + "/force", {-0.1, 0.02});
    } else {
      ask(address + "/position", {0.1});
      ask(address + "/position", {-0.1});
    }
    if (input.knows(Gesture::pluck)) {
      ask(address + "/pluck", {1.0});
    }
    if (input.knows(Gesture::bow)) {
      ask(address + "/bow", {1.0, 1.0});
      ask(address + "/bow", {-0.5});
    }
  }
  std::vector<ParameterInfo> parameters = instrument.parameters;
  std::erase_if(parameters, [](const ParameterInfo& info) { return info.audio_input > 0; });
  for (const ParameterInfo& info : parameters) {
    ask("/param/" + info.name, {info.maximum});
  }
  send({0x91, 60, 100, 0xe0, 127, 127});
  for (const ParameterInfo& info : parameters) {
    ask("/param/" + info.name, {info.minimum});
    ask("/param/" + info.name, {info.value});
  }
  for (const CustomInfo& custom : instrument.custom) {
    ask(custom.address, {1.0});
    ask(custom.address, {0.0});
  }
  all_controllers(127);
  send({0xd0, 127, 0xa0, 60, 127, 0xe0, 0, 0});
  all_controllers(0);
  send({0x80, 36, 0, 0xd0, 0, 0xe0, 0, 64});
  all_controllers(64);
  return moves;
}

// A clock by which every block is late, so that voices are stolen.
std::int64_t late_ns() {
  static std::int64_t now_ns = 0;
  return now_ns += 10'000'000;
}

class Harness {
 public:
  Harness(Precision precision, Process::Clock clock_ns)
      : process_(rate_hz, true, clock_ns),
        session_(process_,
                 {.compile = {.rate_hz = rate_hz, .precision = precision}, .third = std::nullopt},
                 [](const std::string&) {}),
        console_(
            process_, session_, [this](const std::string& text) { printed_ += text + "\n"; },
            [](const std::string&) {}) {
    for (std::size_t c = 0; c < outputs_.size(); ++c) {
      sound_[c].resize(longest_block);
      outputs_[c] = sound_[c].data();
    }
    session_.set_backend("nothing", true);
    session_.on_audio_inputs([this](int wanted) { audio_inputs_ = wanted; });
  }

  // Loads a scene, plays it and lets it fade. Returns an error message if anything was wrong.
  std::string play(const std::string& path, double seconds) {
    wrong_.clear();
    peak_ = 0.0;
    const std::uint64_t resets = process_.meters().resets;
    if (!load(path)) {
      return wrong_;
    }
    perform(seconds / 2.0);
    await_better_form();
    load(path);
    perform(seconds / 2.0);
    look();
    run_line("panic");
    has_audio_ = false;
    rest(fade_s);
    loudest_ = 0.0;
    block({});
    expect(loudest_ == 0.0, "is not silent after panic: " + support::show(loudest_));
    has_audio_ = true;
    resets_ = process_.meters().resets - resets;
    return wrong_;
  }

  bool was_forced() const { return is_forced_; }
  double peak() const { return peak_; }
  std::uint64_t resets() const { return resets_; }

 private:
  void expect(bool holds, const std::string& otherwise) {
    if (!holds && wrong_.empty()) {
      wrong_ = otherwise;
    }
  }

  // Loads a scene while another sounds, by force if it is unstable.
  bool load(const std::string& path) {
    is_forced_ = false;
    std::string refusal = try_to_load(path, false);
    if (refusal.find("pass --force") != refusal.npos) {
      is_forced_ = true;
      refusal = try_to_load(path, true);
    }
    expect(refusal.empty(), refusal);
    const std::uint64_t swaps = process_.meters().swaps;
    for (int i = 0; i < 2000 && swaps == swaps_ && refusal.empty(); ++i) {
      play_on();
      if (process_.meters().swaps != swaps) {
        break;
      }
    }
    swaps_ = process_.meters().swaps;
    return refusal.empty();
  }

  std::string try_to_load(const std::string& path, bool force) {
    std::atomic<bool> is_answered{false};
    std::string refusal;
    session_.load(
        path,
        [&](const auto& result) {
          refusal = result ? "" : result.error().message;
          is_answered = true;
        },
        force);
    while (!is_answered) {
      play_on();
    }
    return refusal;
  }

  // Waits for modes that took too long to find before the first note.
  void await_better_form() {
    const auto& parts = session_.current()->plan.parts;
    const bool is_coming =
        std::any_of(parts.begin(), parts.end(), [](const Part& part) { return part.may_gain; }) &&
        std::none_of(parts.begin(), parts.end(),
                     [](const Part& part) { return part.method == Method::modal; });
    for (int i = 0; i < 5000 && is_coming && process_.meters().swaps == swaps_; ++i) {
      play_on();
    }
    swaps_ = process_.meters().swaps;
  }

  void perform(double seconds) {
    const std::vector<Move> moves = moves_on(session_.current()->instrument);
    std::size_t next = 0;
    const auto frames = static_cast<std::size_t>(seconds * rate_hz);
    for (std::size_t at = 0; at < frames || next < moves.size();) {
      // Spreads the moves over the time, at most one in a block.
      const bool is_due = next < moves.size() && next * frames <= at * moves.size();
      const Move* const move = is_due || at >= frames ? &moves[next++] : nullptr;
      if (move != nullptr && move->call) {
        ask(*move->call);
      }
      at += block(move != nullptr ? std::span(move->midi) : std::span<const std::uint8_t>());
    }
  }

  void ask(const Message& call) {
    const auto loaded = session_.current();
    const auto events = to_events(call, loaded->instrument, loaded->serial);
    if (!events) {
      return expect(false, events.error().message);
    }
    std::vector<TimedEvent> timed;
    for (const Event& event : *events) {
      timed.push_back({.event = event});
    }
    expect(process_.send(process_.from_console, timed), call.address + " finds no room");
    session_.remember(timed);
  }

  void look() {
    for (const char* const line : {"status", "explain", "params"}) {
      run_line(line);
    }
  }

  void run_line(const char* line) {
    printed_.clear();
    console_.run_line(line);
    std::istringstream words(printed_);
    for (std::string word; words >> word;) {
      expect(!word.starts_with("nan") && !word.starts_with("-nan"),
             std::string(line) + " prints " + printed_);
    }
    expect(printed_.find("error: ") == printed_.npos, std::string(line) + ": " + printed_);
  }

  void rest(double seconds) {
    for (std::size_t at = 0; at < static_cast<std::size_t>(seconds * rate_hz);) {
      at += block({});
    }
  }

  // Plays a block now and then while the worker is busy, and leaves it most of the time.
  void play_on() {
    const auto start = std::chrono::steady_clock::now();
    block({});
    std::this_thread::sleep_for(1ms + 4 * (std::chrono::steady_clock::now() - start));
  }

  std::size_t block(std::span<const std::uint8_t> midi) {
    const std::size_t frames = block_lengths[blocks_++ % std::size(block_lengths)];
    for (double& sample : noise_) {
      sample = has_audio_ ? random_.uniform(-0.1, 0.1) : 0.0;
    }
    const std::vector<const double*> inputs(static_cast<std::size_t>(audio_inputs_.load()),
                                            noise_.data());
    const MidiPacket packet{static_cast<std::uint32_t>(frames - 1), midi};
    process_.block(std::span(inputs), std::span<double* const>(outputs_), frames,
                   std::span(&packet, midi.empty() ? 0 : 1), time_ns_);
    time_ns_ += std::llround(1e9 * static_cast<double>(frames) / rate_hz);
    for (const std::vector<double>& channel : sound_) {
      for (std::size_t n = 0; n < frames; ++n) {
        loudest_ = std::max(loudest_, std::fabs(channel[n]));
        if (!(std::fabs(channel[n]) <= Limiter::ceiling)) {
          expect(false, "comes out as " + support::show(channel[n]));
        }
      }
    }
    peak_ = std::max(peak_, loudest_);
    return frames;
  }

  Process process_;
  std::string printed_;
  std::string wrong_;
  std::atomic<int> audio_inputs_{0};
  bool has_audio_ = true;
  bool is_forced_ = false;
  support::Random random_{1};
  std::array<double, longest_block> noise_{};
  std::array<std::vector<double>, 2> sound_;
  std::array<double*, 2> outputs_{};
  std::size_t blocks_ = 0;
  std::int64_t time_ns_ = 0;
  std::uint64_t swaps_ = 0;
  double loudest_ = 0.0;
  double peak_ = 0.0;
  std::uint64_t resets_ = 0;
  Session session_;
  Console console_;
};

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

class Everything {
 public:
  explicit Everything(double seconds) : seconds_(seconds) { fs::create_directories(folder_); }
  ~Everything() { fs::remove_all(folder_); }
  Everything(const Everything&) = delete;
  Everything& operator=(const Everything&) = delete;

  void play_model(const std::string& shown, const std::string& text) {
    const std::string model = "model" + std::to_string(turn_) + ".mdl";
    const std::string preset = "preset" + std::to_string(turn_) + ".toml";
    std::ofstream(folder_ / model) << text;
    std::ofstream(folder_ / preset)
        << support::PresetWriter(parse_network(text).network, model, turn_).write();
    play(shown, {folder_ / model, folder_ / preset});
  }

  // Plays scenes one after the other on one harness, so that each fades into the next.
  void play(const std::string& shown, const std::vector<fs::path>& scenes) {
    const std::size_t turn = turn_++;
    Harness harness(turn % 4 == 3 ? Precision::float32 : Precision::float64,
                    turn % 4 == 2 ? late_ns : nullptr);
    for (const fs::path& scene : scenes) {
      std::printf("%s, %s", shown.c_str(), scene.extension().c_str());
      std::fflush(stdout);  // before anything can crash
      const std::string wrong = harness.play(scene.string(), seconds_);
      std::printf(": peak %.3g, %llu voices ran away%s\n", harness.peak(),
                  static_cast<unsigned long long>(harness.resets()),
                  harness.was_forced() ? ", by force" : "");
      if (!wrong.empty()) {
        std::printf("  WRONG: %s\n", wrong.c_str());
        ++failures_;
      }
      ++played_;
    }
  }

  std::size_t played() const { return played_; }
  std::size_t failures() const { return failures_; }

 private:
  const double seconds_;
  const fs::path folder_ =
      fs::temp_directory_path() / ("ressort-everything-" + std::to_string(getpid()));
  std::size_t turn_ = 0;
  std::size_t played_ = 0;
  std::size_t failures_ = 0;
};

// Returns the scenes in a folder and its subfolders, or one file; sorted.
std::set<fs::path> scenes_in(const fs::path& where) {
  std::set<fs::path> found;
  if (fs::is_directory(where)) {
    for (const auto& entry : fs::recursive_directory_iterator(where)) {
      if (entry.path().extension() == ".mdl" || entry.path().extension() == ".toml") {
        found.insert(entry.path());
      }
    }
  } else {
    found.insert(where);
  }
  return found;
}

}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 0.0;
  const std::uint64_t networks = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 0;
  const std::uint64_t seed = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1;
  std::vector<fs::path> folders(argv + std::min(argc, 4), argv + argc);
  if (!(seconds > 0.0)) {
    std::fputs("ressort_play_everything SECONDS [NETWORKS [SEED [FOLDER or FILE...]]]\n", stderr);
    return 2;
  }
  if (argc <= 4) {
    const fs::path source = RESSORT_SOURCE;
    folders = {source / "models", source / "presets", source / "tests" / "corpus"};
  }
  Everything everything(seconds);
  for (const fs::path& folder : folders) {
    for (const fs::path& scene : scenes_in(folder)) {
      scene.extension() == ".toml" ? everything.play(scene.string(), {scene})
                                   : everything.play_model(scene.string(), text_of(scene));
    }
  }
  for (std::uint64_t i = seed; i < seed + networks; ++i) {
    everything.play_model("random network " + std::to_string(i), support::random_network(i).text);
  }
  std::printf("%zu played, %zu of them wrong\n", everything.played(), everything.failures());
  return everything.failures() == 0 ? 0 : 1;
}
