#include "tests/bench/measure.h"

#include <sched.h>

#include <chrono>
#include <cmath>
#include <ctime>

namespace ressort::bench {
namespace {

constexpr double longest_cycle_ns = 60e6;  // A longer cycle is not played as a whole.
constexpr double round_ns = 2e6;
constexpr double long_round_ns = 10e6;  // Length of a round if a cycle is too long.
constexpr std::size_t least_rounds = 3;
constexpr std::size_t most_rounds = 400;

double cpu_ns() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e9 * static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec);
}

}  // namespace

Timed::Timed(std::string method_in, bool is_double_in, std::unique_ptr<Player> player)
    : method(std::move(method_in)), is_double(is_double_in), player_(std::move(player)) {}

double Timed::play(std::size_t blocks) {
  const double start = cpu_ns();
  for (std::size_t i = 0; i < blocks; ++i) {
    player_->play(next_);
    next_ = (next_ + 1) % cycle_blocks;
  }
  return (cpu_ns() - start) / static_cast<double>(blocks * block_frames);
}

double Timed::calibrate() {
  constexpr double block = block_frames;
  constexpr double cycle = cycle_frames;
  play(1);
  double ns = play(1);
  for (std::size_t blocks = 2;
       blocks <= cycle_blocks && ns * block * static_cast<double>(blocks) < 0.2 * longest_cycle_ns;
       blocks *= 2) {
    ns = play(blocks);
  }
  if (ns * cycle <= longest_cycle_ns) {
    next_ = 0;
    blocks_ = cycle_blocks * static_cast<std::size_t>(std::ceil(round_ns / (ns * cycle)));
    ns = std::min({play(cycle_blocks), play(cycle_blocks), play(cycle_blocks)});
  } else {
    blocks_ = static_cast<std::size_t>(std::ceil(long_round_ns / (ns * block)));
  }
  return ns;
}

void Timed::play_round() {
  took_.push_back(play(blocks_));
}

double Timed::quantile(double share) const {
  std::vector<double> sorted = took_;
  std::sort(sorted.begin(), sorted.end());
  const double at = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

double Timed::minimum() const {
  return *std::min_element(took_.begin(), took_.end());
}

void measure(std::vector<Timed>& all, double seconds, const volatile std::sig_atomic_t& stops) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  for (std::size_t round = 0; round < most_rounds && stops == 0; ++round) {
    if (round >= least_rounds && Clock::now() > end) {
      return;
    }
    for (Timed& one : all) {
      one.play_round();
    }
  }
}

double time_of(const kernels::Program&, const std::function<void()>& play) {
  const double start = cpu_ns();
  play();
  return cpu_ns() - start;
}

void stay_on_one_core() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  CPU_SET(static_cast<std::size_t>(std::max(0, sched_getcpu())), &cores);
  sched_setaffinity(0, sizeof cores, &cores);
}

}  // namespace ressort::bench
