// app/realtime: what share of its time the callback takes, and how many voices there is time for.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "app/rooms.h"

namespace ressort::realtime {

// What one block says is not believed: the machine holds up a thread now and then, whatever it
// plays. What lasts is the median of the last spans, and voices give way to that alone.
// All functions: [audio], wait-free.
class DspLoad {
 public:
  static constexpr std::size_t spans = 5;
  static constexpr double span_s = 0.005;  // of sound, or a block that is longer
  static constexpr double most = 0.9;      // of the time there is: above it voices give way
  static constexpr double wanted = 0.75;   // of it, when they have
  static constexpr double low = 0.6;       // of it: below it for so long more may sound again
  static constexpr double low_s = 1.0;
  static constexpr double patience_s = 10;  // until voices give way again, where it did not help

  // A block of `sound_s` seconds took `took_s`.
  void add(double took_s, double sound_s);

  double mean() const { return mean_; }        // over about a second
  double lasting() const { return lasting_; }  // 0 while nothing is known
  bool is_over() const { return lasting_ > most; }

  // How many voices may sound, if that changes now, where so many do; `all` is no limit at all.
  std::optional<int> judge(int sounding, int all);
  int limit() const { return limit_; }  // 0: none

  // Something else sounds from now on: no limit holds, and nothing is known.
  void begin_anew();
  // What was measured holds no more: voices have been taken away.
  void forget();

 private:
  std::optional<int> give_way(int sounding, int all);

  double mean_ = 0.0;
  double lasting_ = 0.0;
  double took_s_ = 0.0;  // of the span that is not yet whole
  double sound_s_ = 0.0;
  bool skips_ = false;   // this span: what gives way still fades in it
  bool is_new_ = false;  // `lasting_`, since the last judgement
  std::array<double, spans> loads_{};
  std::size_t next_ = 0;
  int limit_ = 0;         // of voices; 0: none
  double first_ = 0.0;    // load when voices began to give way
  double before_ = 0.0;   // load when some gave way last
  double quiet_s_ = 0.0;  // for so long the load has been low
  double waits_s_ = 0.0;  // until voices may give way again
};

}  // namespace ressort::realtime
