// Motion frames for the panel, made at the end of a block.
#include "app/realtime/motion.h"

#include <algorithm>

#include "app/realtime/process.h"

namespace ressort::realtime {

void Process::hear(std::size_t channels, std::size_t frames) {
  const double share = channels > 0 ? 1.0 / static_cast<double>(channels) : 0.0;
  for (std::size_t n = 0; n < frames; ++n) {
    double sum = 0.0;
    for (std::size_t c = 0; c < channels; ++c) {
      sum += mixed_[c * chunk_frames + n];
    }
    heard_[heard_at_] = static_cast<float>(share * sum);
    heard_at_ = (heard_at_ + 1) % heard_.size();
  }
}

// Writes the motion frame that was requested. A stroboscope frame waits for its phase, up to
// longest_strobe_s. An engine that fades out must not write any more where the next one will.
void Process::look() {
  MotionFrame& out = motion.writing();
  if (strobed_ != nullptr) {
    const bool is_here = strobed_ == current_;
    const std::size_t count = is_here ? current_->engine->take_slow_look() : 0;
    if (count == 0 && is_here && frame_ < strobed_until_) {
      return;
    }
    if (is_here || strobed_ == fading_) {
      strobed_->engine->look_slowly({});
    }
    strobed_ = nullptr;
    if (count > 0) {
      out.count = count;
      return show();
    }
    wants_motion.raise();
  }
  const bool is_slow = wants_slow_motion.lower();
  if (is_slow && current_ != nullptr && current_->picture != 0 &&
      current_->engine->look_slowly(out.numbers)) {
    strobed_ = current_;
    strobed_until_ = frame_ + static_cast<std::int64_t>(longest_strobe_s * rate_hz_);
  } else if (wants_motion.lower() || is_slow) {
    out.count =
        current_ != nullptr && current_->picture != 0 ? current_->engine->look(out.numbers) : 0;
    show();
  }
}

// Publishes the motion frame with the latest output. From now on the output is kept for the next
// frame, for looked_for_s.
void Process::show() {
  MotionFrame& out = motion.writing();
  out.frame = static_cast<std::uint64_t>(frame_);
  out.picture = current_ != nullptr ? current_->picture : 0;
  const auto at = heard_.begin() + static_cast<std::ptrdiff_t>(heard_at_);
  std::copy(heard_.begin(), at, std::copy(at, heard_.end(), out.heard.begin()));
  motion.publish();
  looked_until_ = frame_ + static_cast<std::int64_t>(looked_for_s * rate_hz_);
}

}  // namespace ressort::realtime
