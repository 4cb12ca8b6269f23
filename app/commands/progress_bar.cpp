#include "app/commands/progress_bar.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace ressort::commands {

ProgressBar::ProgressBar(bool is_wanted) : is_shown_(is_wanted && isatty(STDERR_FILENO) != 0) {}

ProgressBar::~ProgressBar() {
  if (!shown_.empty()) {
    std::fputs("\r\033[K", stderr);
  }
}

void ProgressBar::show(double share, const std::string& what) {
  constexpr int width = 30;
  const double done = std::clamp(share, 0.0, 1.0);
  char percent[16];
  std::snprintf(percent, sizeof percent, "%3d %% ", static_cast<int>(100.0 * done));
  const auto filled = static_cast<std::size_t>(done * width);
  const std::string line =
      "[" + std::string(filled, '=') + std::string(width - filled, ' ') + "] " + percent + what;
  pollfd ready{STDERR_FILENO, POLLOUT, 0};
  if (is_shown_ && line != shown_ && poll(&ready, 1, 0) > 0) {
    std::fprintf(stderr, "\r\033[K%s", line.c_str());
    shown_ = line;
  }
}

}  // namespace ressort::commands
