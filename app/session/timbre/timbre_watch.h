// app/session: measures the timbre of the output while it plays, 94 times a second at 48 kHz, on a
// thread that runs while somebody listens.
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

// Analyses the mean of all outputs: amplitude spectra of 2048 samples, Hann window, hop of 512. Two
// channels at 48 kHz take 0.7 % of a core.
class TimbreWatch {
 public:
  static constexpr std::size_t frame = 2048;
  static constexpr std::size_t hop = 512;

  // The process must outlive this object.
  explicit TimbreWatch(Process& process) : process_(process) {}
  ~TimbreWatch();

  // Analyses the output for at least this time from now. [any thread but audio]
  void listen(std::chrono::duration<double> time);

  struct Heard {
    std::uint64_t number = 0;  // number of the frame, from 1
    FrameTimbre timbre;        // without pitch and harmonics
  };
  // Returns the frames after a number, at most those of the last second. [any thread but audio]
  std::vector<Heard> since(std::uint64_t number) const;

  struct Moment {
    std::optional<double> f0_hz;
    FigureValues figures;
  };
  // Returns the latest frame with harmonics, with the f0 of the last 0.3 s, once that much was
  // heard. Takes a few ms. [any thread but audio]
  std::optional<Moment> now() const;

 private:
  void work();
  void analyse_output();

  Process& process_;
  mutable std::mutex mutex_;  // guards all below
  std::condition_variable wake_;
  bool stop_ = false;
  std::chrono::steady_clock::time_point until_;
  std::uint64_t number_ = 0;
  std::deque<Heard> frames_;
  std::vector<double> recent_;  // latest samples, slightly more than pitch detection needs
  double rate_hz_ = 0.0;
  std::thread thread_;  // started by the first listen()
};

}  // namespace ressort::session
