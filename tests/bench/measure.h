// bench: how long players take, in turns, in CPU time of this thread.
#pragma once

#include <algorithm>
#include <csignal>
#include <memory>
#include <string>
#include <vector>

#include "tests/bench/players.h"

namespace ressort::bench {

// A player, and what it took: nanoseconds per sample, one number for every round.
class Timed {
 public:
  Timed(std::string method_in, bool is_double_in, std::unique_ptr<Player> player);

  // How long it takes, roughly; and from it how much it plays in a round: whole cycles while they
  // are short, else a few blocks.
  double calibrate();
  void play_round();

  bool has_played() const { return !took_.empty(); }
  // ns per sample, which so great a share of the rounds took less than; it has played
  double quantile(double share) const;
  double median() const { return quantile(0.5); }
  double minimum() const;

  std::string method;
  std::string form;  // that an engine plays, for people
  bool is_double;

 private:
  double play(std::size_t blocks);
  std::unique_ptr<Player> player_;
  std::size_t blocks_ = 1;  // in a round
  std::size_t next_ = 0;    // block of the cycle
  std::vector<double> took_;
};

// Rounds in which each plays in turn, until `seconds` have passed; at least three unless `stops`.
// What is too small to hear is taken for 0.
void measure(std::vector<Timed>& all, double seconds, const volatile std::sig_atomic_t& stops);

// This thread stays on the core that it is on.
void stay_on_one_core();

}  // namespace ressort::bench
