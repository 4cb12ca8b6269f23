#include "app/session/load_progress.h"

#include <new>
#include <utility>

namespace ressort::session {

LoadProgress::LoadProgress(std::string name, MessageHandler on_message)
    : name_(std::move(name)), on_message_(std::move(on_message)) {}

void LoadProgress::at(std::string_view stage) {
  const auto now = Clock::now();
  if (now < next_ || !on_message_) {
    return;
  }
  next_ = now + std::chrono::seconds(2);
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(now - start_).count();
  on_message_("still loading '" + name_ + "', " + std::to_string(seconds) +
              " s: " + std::string(stage));
}

std::string describe(const std::exception& error) {
  return dynamic_cast<const std::bad_alloc*>(&error) != nullptr
             ? "not enough memory; use a smaller model or fewer voices (-p)"
             : error.what();
}

}  // namespace ressort::session
