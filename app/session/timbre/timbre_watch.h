// app/session: what the sound is like while it plays, 94 frames a second at 48 kHz, from a thread
// of its own that runs while somebody wants to know.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "app/realtime/process.h"
#include "app/session/timbre/timbre_figures.h"

namespace ressort::session {

// Of the mean of all outputs, 2048 samples under a Hann window, 512 from one to the next; of
// amplitudes. Two channels at 48 kHz take 0.7 % of a core.
class TimbreWatch {
 public:
  static constexpr std::size_t frame = 2048;
  static constexpr std::size_t hop = 512;

  // The process must outlive it.
  explicit TimbreWatch(Process& process) : process_(process) {}
  ~TimbreWatch();

  // From now on for so long at least. [any thread but audio]
  void listen(std::chrono::duration<double> time);

  struct Heard {
    std::uint64_t number = 0;  // of the frame, from 1 on: since this program's first
    FrameTimbre timbre;        // without a pitch, nothing harmonic
  };
  // Those after a number, the last second's at most. [any thread but audio]
  std::vector<Heard> since(std::uint64_t number) const;

  struct Moment {
    std::optional<double> f0_hz;
    FigureValues figures;
  };
  // The last frame with its harmonics, whose f0 is that of the last 0.3 s: once so much has been
  // heard. O(a few ms) [any thread but audio]
  std::optional<Moment> now() const;

 private:
  void work();
  void hear();

  Process& process_;
  mutable std::mutex mutex_;  // all below
  std::condition_variable wake_;
  bool stop_ = false;
  std::chrono::steady_clock::time_point until_;
  std::uint64_t number_ = 0;
  std::deque<Heard> frames_;
  std::vector<double> recent_;  // the last samples, as many as a pitch needs or a few more
  double rate_hz_ = 0.0;
  std::thread thread_;  // since the first listen()
};

}  // namespace ressort::session
