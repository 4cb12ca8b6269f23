#include "tests/bench/voicing/played.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <limits>
#include <optional>
#include <stdexcept>

#include "app/realtime/denormals.h"
#include "core/model/language/print.h"
#include "tests/bench/faust.h"
#include "tests/bench/voicing/player.h"

namespace ressort::voicing {
namespace {

constexpr double played_rate_hz = 48000.0;
constexpr double played_s = 1.0;
constexpr double between_strikes_s = 0.1;

std::vector<TimedEvent> restruck(const std::vector<TimedEvent>& once) {
  std::vector<TimedEvent> events;
  for (double at_s = 0.0; at_s < played_s; at_s += between_strikes_s) {
    for (TimedEvent timed : once) {
      timed.time_s = at_s;
      events.push_back(timed);
    }
  }
  return events;
}

double median(std::vector<double> numbers) {
  const auto middle = numbers.begin() + static_cast<std::ptrdiff_t>(numbers.size() / 2);
  std::nth_element(numbers.begin(), middle, numbers.end());
  return *middle;
}

// The published models, which FAUST plays too.
constexpr std::array published{"IPlayTheTriangle", "PolyTriangle",      "PhysicalLFO",
                               "Resonator",        "BowedString",       "PluckedHarmonics",
                               "1000massString",   "LargeTriangleMesh", "20x30mesh"};

// One instance of a FAUST program for each voice, summed as FAUST's polyphonic
// architectures do. The first frame of every input excites them.
class FaustVoices {
 public:
  FaustVoices(const bench::FaustLibrary& library, int voices, std::size_t inputs)
      : library_(library), inputs_(inputs * bench::block_frames) {
    for (int voice = 0; voice < voices; ++voice) {
      instances_.push_back(library.make(static_cast<int>(played_rate_hz)));
    }
    const auto outputs = static_cast<std::size_t>(library.outputs(instances_[0]));
    outputs_.resize(outputs * bench::block_frames);
    sum_.resize(outputs_.size());
    for (std::size_t i = 0; i < inputs; ++i) {
      inputs_[i * bench::block_frames] = 0.01;
      input_pointers_.push_back(inputs_.data() + i * bench::block_frames);
    }
    for (std::size_t i = 0; i < outputs; ++i) {
      output_pointers_.push_back(outputs_.data() + i * bench::block_frames);
    }
  }
  FaustVoices(const FaustVoices&) = delete;
  FaustVoices& operator=(const FaustVoices&) = delete;
  ~FaustVoices() {
    for (void* const instance : instances_) {
      library_.destroy(instance);
    }
  }

  double processor_share() {
    const auto blocks = static_cast<int>(played_s * played_rate_hz / bench::block_frames);
    const realtime::DenormalsFlushed flushed;
    const std::clock_t start = std::clock();
    for (int block = 0; block < blocks; ++block) {
      std::fill(sum_.begin(), sum_.end(), 0.0);
      for (void* const instance : instances_) {
        library_.compute(instance, bench::block_frames, input_pointers_.data(),
                         output_pointers_.data());
        for (std::size_t i = 0; i < sum_.size(); ++i) {
          sum_[i] += outputs_[i];
        }
      }
      std::fill(inputs_.begin(), inputs_.end(), 0.0);
    }
    return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / played_s;
  }

 private:
  const bench::FaustLibrary& library_;
  std::vector<void*> instances_;
  std::vector<double> inputs_;
  std::vector<double> outputs_;
  std::vector<double> sum_;
  std::vector<double*> input_pointers_;
  std::vector<double*> output_pointers_;
};

// FAUST's code of a preset's model in double precision, with all options and compilers.
class FaustPeers {
 public:
  explicit FaustPeers(const Player& player)
      : voices_(player.instrument().voices), inputs_(player.scene().network.inputs.size()) {
    const Network& network = player.scene().network;
    libraries_ = bench::faust_libraries(
        {.text = print_network(network), .is_noisy = player.scene().preset.noise}, network,
        std::filesystem::temp_directory_path() / "ressort-faust");
    std::erase_if(libraries_, [](const auto& library) { return !library.is_double; });
    shares_.resize(libraries_.size());
  }
  void measure() {
    for (std::size_t i = 0; i < libraries_.size(); ++i) {
      shares_[i].push_back(FaustVoices(libraries_[i], voices_, inputs_).processor_share());
    }
  }
  // Returns the median of the fastest one; infinity if there is none.
  double best_share() const {
    double best = std::numeric_limits<double>::infinity();
    for (const std::vector<double>& shares : shares_) {
      best = std::min(best, median(shares));
    }
    return best;
  }

 private:
  int voices_;
  std::size_t inputs_;
  std::vector<bench::FaustLibrary> libraries_;
  std::vector<std::vector<double>> shares_;  // [library][turn]
};

}  // namespace

int print_played(const std::vector<std::string>& names, int turns) {
  std::printf(
      "| %% of a core | voices | idle | one | all | re-struck | low keys | high keys "
      "| double, all | predicted | FAUST, all |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
  int failures = 0;
  for (const std::string& name : names) {
    try {
      Player player(name, played_rate_hz);
      Player in_double(name, played_rate_hz, true, Precision::float64);
      const int voices = player.instrument().voices;
      const std::vector<TimedEvent> all = chord(voices);
      const std::array<std::vector<TimedEvent>, 6> played = {
          {{},
           chord(1, 60, 1),
           all,
           restruck(all),
           chord(voices, 28, 1),
           chord(voices, std::max(28, 97 - voices), 1)}};
      std::array<std::vector<double>, played.size() + 1> shares;
      std::optional<FaustPeers> faust;
      if (std::find(published.begin(), published.end(), name) != published.end()) {
        faust.emplace(player);
      }
      for (int turn = 0; turn < turns; ++turn) {
        for (std::size_t i = 0; i < played.size(); ++i) {
          shares[i].push_back(player.processor_share(played[i], played_s));
        }
        shares.back().push_back(in_double.processor_share(all, played_s));
        if (faust) {
          faust->measure();
        }
      }
      std::printf("| %s | %d ", name.c_str(), voices);
      for (const std::vector<double>& share : shares) {
        std::printf("| %.2f ", 100.0 * median(share));
      }
      std::printf("| %.2f ", 100.0 * player.predicted_share());
      const double best = faust ? faust->best_share() : std::numeric_limits<double>::infinity();
      std::isfinite(best) ? std::printf("| %.2f |\n", 100.0 * best) : std::printf("| |\n");
      std::fflush(stdout);
    } catch (const std::runtime_error& error) {
      std::fprintf(stderr, "%s\n", error.what());
      ++failures;
    }
  }
  return failures;
}

}  // namespace ressort::voicing
