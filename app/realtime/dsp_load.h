// app/realtime: the callback's load, and the number of voices that it leaves time for.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "app/rooms.h"

namespace ressort::realtime {

// Measures the load of the callback and limits the number of voices. One slow block does not count,
// because the operating system delays any thread now and then. Voices are stolen only if the median
// of the last `spans` spans is too high. All functions: [audio], wait-free.
class DspLoad {
 public:
  static constexpr std::size_t spans = 5;
  static constexpr double span_s = 0.005;  // length of a span of sound; a longer block is a span
  static constexpr double most = 0.9;      // load above which voices are stolen
  static constexpr double wanted = 0.75;   // load that the remaining voices should have
  static constexpr double low = 0.6;  // load below which more voices may sound, after low_s seconds
  static constexpr double low_s = 1.0;
  static constexpr double patience_s = 10;  // until the next stealing, after one that did not help

  // Records that a block of `sound_s` seconds took `took_s` seconds to compute.
  void add(double took_s, double sound_s);

  double mean() const { return mean_; }        // mean load of about the last second
  double lasting() const { return lasting_; }  // median load of the last spans; 0: not known yet
  bool is_over() const { return lasting_ > most; }

  // Returns the new limit on the number of voices if it changes now. `sounding` voices sound of
  // `all`; a limit of `all` is none.
  std::optional<int> update_limit(int sounding, int all);
  int limit() const { return limit_; }  // voices; 0: no limit

  // Removes the limit and forgets the measurements, because another model plays from now on.
  void restart();
  // Forgets the measurements, because voices have just been stolen.
  void forget();

 private:
  std::optional<int> steal_voices(int sounding, int all);

  double mean_ = 0.0;
  double lasting_ = 0.0;
  double took_s_ = 0.0;  // computing time of the current span
  double sound_s_ = 0.0;
  bool skips_ = false;   // ignore this span: stolen voices still fade in it
  bool is_new_ = false;  // `lasting_` has changed since the last update_limit()
  std::array<double, spans> loads_{};
  std::size_t next_ = 0;
  int limit_ = 0;         // voices; 0: no limit
  double first_ = 0.0;    // load when stealing began
  double before_ = 0.0;   // load at the last stealing
  double quiet_s_ = 0.0;  // seconds of low load
  double waits_s_ = 0.0;  // seconds until voices may be stolen again
};

}  // namespace ressort::realtime
