#include "app/session/load_news.h"

#include <new>
#include <utility>

namespace ressort::session {

LoadProgress::LoadProgress(std::string name, Tell tell)
    : name_(std::move(name)), tell_(std::move(tell)) {}

void LoadProgress::at(std::string_view stage) {
  const auto now = Clock::now();
  if (now < next_ || !tell_) {
    return;
  }
  next_ = now + std::chrono::seconds(2);
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(now - start_).count();
  tell_("still loading '" + name_ + "', " + std::to_string(seconds) + " s: " + std::string(stage));
}

std::string describe(const std::exception& error) {
  return dynamic_cast<const std::bad_alloc*>(&error) != nullptr
             ? "not enough memory; use a smaller model or fewer voices (-p)"
             : error.what();
}

}  // namespace ressort::session
