// app/panel: the way of what moves from the audio thread to whoever watches.
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
  // The process outlives it.
  explicit MotionFeed(Process& process) : process_(process) {}

  // Draws an engine that is about to be offered; the picture's number. [session's worker]
  std::uint32_t watch(Engine& engine, const Network& network);

  // What sounds was drawn so, as far as frames have told; null before the first. [any thread but
  // audio]
  std::shared_ptr<const Picture> picture() const;

  // The newest frame, as it goes out, and asks for the next. [any thread but audio]
  //   u64 samples played   u32 picture   u32 dots   u32 samples   u32 0
  //   f32 [dot] position   f32 [sample] output, the mean of all channels
  // All little-endian.
  struct Frame {
    std::uint64_t frame = 0;
    std::string bytes;
  };
  // `is_slow`: as a stroboscope sees it, one for all who watch.
  std::shared_ptr<const Frame> look(bool is_slow = false);

 private:
  std::string pack(const MotionFrame& frame);

  Process& process_;
  mutable std::mutex mutex_;
  std::uint32_t last_ = 0;
  std::map<std::uint32_t, std::shared_ptr<const Picture>> pictures_;  // of late, by number
  std::shared_ptr<const Frame> frame_ = std::make_shared<Frame>();
  std::uint32_t shown_ = 0;  // picture of the newest frame
};

}  // namespace ressort::panel
