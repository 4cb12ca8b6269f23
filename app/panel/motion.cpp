#include "app/panel/motion.h"

#include <bit>
#include <vector>

namespace ressort::panel {
namespace {

// Pictures of engines that are about to play or fading out.
constexpr std::size_t most_pictures = 4;

void put(std::string& bytes, std::uint64_t value, int size) {
  for (int shift = 0; shift < 8 * size; shift += 8) {
    bytes += static_cast<char>(value >> shift & 0xff);
  }
}

void put(std::string& bytes, std::span<const float> values) {
  if constexpr (std::endian::native == std::endian::little) {
    bytes.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
  } else {
    for (const float value : values) {
      put(bytes, std::bit_cast<std::uint32_t>(value), 4);
    }
  }
}

}  // namespace

std::uint32_t MotionFeed::watch(Engine& engine, const Network& network) {
  std::uint32_t number = 0;
  {
    const std::lock_guard lock(mutex_);
    number = ++last_;
  }
  auto picture = std::make_shared<const Picture>(make_picture(engine, network, number));
  const std::lock_guard lock(mutex_);
  pictures_.emplace(number, std::move(picture));
  while (pictures_.size() > most_pictures) {
    pictures_.erase(pictures_.begin());
  }
  return number;
}

std::shared_ptr<const Picture> MotionFeed::picture() const {
  const std::lock_guard lock(mutex_);
  const auto found = pictures_.find(shown_);
  return found != pictures_.end() ? found->second : nullptr;
}

std::shared_ptr<const MotionFeed::Frame> MotionFeed::newest_frame(bool is_slow) {
  const std::lock_guard lock(mutex_);
  if (process_.motion.take()) {
    const MotionFrame& frame = process_.motion.reading();
    shown_ = frame.picture;
    frame_ = std::make_shared<Frame>(Frame{frame.frame, pack(frame)});
  }
  (is_slow ? process_.wants_slow_motion : process_.wants_motion).raise();
  return frame_;
}

std::string MotionFeed::pack(const MotionFrame& frame) {
  const auto found = pictures_.find(frame.picture);
  std::vector<float> positions;
  if (found != pictures_.end()) {
    positions.resize(found->second->masses.size());
    find_positions(*found->second, frame, positions);
  }
  std::string bytes;
  put(bytes, frame.frame, 8);
  put(bytes, frame.picture, 4);
  put(bytes, positions.size(), 4);
  put(bytes, frame.heard.size(), 4);
  put(bytes, 0, 4);
  put(bytes, positions);
  put(bytes, frame.heard);
  return bytes;
}

}  // namespace ressort::panel
