// app/panel: transports positions from the audio thread to the viewers.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "app/panel/picture.h"
#include "app/realtime/process.h"

namespace ressort::panel {

class MotionFeed {
 public:
  // The process must outlive it.
  explicit MotionFeed(Process& process) : process_(process) {}

  // Makes the picture of an engine that is about to be offered; returns its number. [session's
  // worker]
  std::uint32_t watch(Engine& engine, const Network& network);

  // Returns the picture of the sounding engine, as far as frames have arrived; null before the
  // first. [any thread but audio]
  std::shared_ptr<const Picture> picture() const;

  // Returns the newest frame as it is sent, and requests the next. [any thread but audio]
  //  u64 samples played   u32 picture   u32 dots   u32 samples   u32 0
  //  f32 [dot] position   f32 [sample] output, the mean of all channels
  // All values are little-endian.
  struct Frame {
    std::uint64_t frame = 0;
    std::string bytes;
  };
  // `is_slow`: stroboscopic slow motion, shared by all viewers.
  std::shared_ptr<const Frame> newest_frame(bool is_slow = false);

 private:
  std::string pack(const MotionFrame& frame);

  Process& process_;
  mutable std::mutex mutex_;
  std::uint32_t last_ = 0;
  std::map<std::uint32_t, std::shared_ptr<const Picture>> pictures_;  // Recent pictures by number.
  std::shared_ptr<const Frame> frame_ = std::make_shared<Frame>();
  std::uint32_t shown_ = 0;  // Number of the newest frame's picture.
};

}  // namespace ressort::panel
