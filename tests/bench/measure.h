// bench: measures players in turn, in CPU time of this thread.
#pragma once

#include <algorithm>
#include <csignal>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tests/bench/players.h"

namespace ressort::bench {

// A player and its measurements: ns per sample, one number per round.
class Timed {
 public:
  Timed(std::string method_in, bool is_double_in, std::unique_ptr<Player> player);

  // Measures the player briefly, returns ns per sample, and sets the length of a round: whole
  // cycles if they are short, otherwise a few blocks.
  double calibrate();
  void play_round();

  bool has_played() const { return !took_.empty(); }
  // Returns the quantile `share` of the rounds, in ns per sample. The player must have played.
  double quantile(double share) const;
  double median() const { return quantile(0.5); }
  double minimum() const;

  std::string method;
  std::string form;  // form that the engine plays, for printing
  bool is_double;

 private:
  double play(std::size_t blocks);
  std::unique_ptr<Player> player_;
  std::size_t blocks_ = 1;  // blocks in a round
  std::size_t next_ = 0;    // next block of the cycle
  std::vector<double> took_;
};

// Plays rounds in which each player plays in turn, until `seconds` have passed, and at least three
// rounds unless `stops`. The caller has flushed denormals.
void measure(std::vector<Timed>& all, double seconds, const volatile std::sig_atomic_t& stops);

// Binds this thread to the core that it runs on.
void stay_on_one_core();

// Returns the CPU time of `play` in this thread, in ns, as Timings::time. The caller has flushed
// denormals.
double time_of(const kernels::Program& program, const std::function<void()>& play);

}  // namespace ressort::bench
