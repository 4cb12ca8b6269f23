#include "app/say.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <mutex>
#include <string_view>
#include <thread>
#include <utility>

#include "app/text.h"

namespace ressort {
namespace {

constexpr std::size_t most_bytes = std::size_t{1} << 20;
constexpr std::chrono::milliseconds patience{200};

// Returns when everything is written, or nothing can be written any more.
void write_all(int descriptor, const std::string& text) {
  for (std::size_t at = 0; at < text.size();) {
    const ssize_t count = write(descriptor, text.data() + at, text.size() - at);
    if (count > 0) {
      at += static_cast<std::size_t>(count);
    } else if (count < 0 && errno == EAGAIN) {
      pollfd ready{descriptor, POLLOUT, 0};
      poll(&ready, 1, -1);
    } else if (count == 0 || errno != EINTR) {
      return;
    }
  }
}

// Writes the lines on a thread of its own. The thread may block for ever, so it is never joined and
// this object is never destroyed.
class LinePrinter {
 public:
  LinePrinter() {
    std::thread([this] { run(); }).detach();
  }

  void put(int descriptor, const std::string& line) {
    const std::lock_guard lock(mutex_);
    if (is_silent_) {
      return;
    }
    if (bytes_ + line.size() > most_bytes) {
      ++left_out_;
      return;
    }
    add(descriptor, line);
  }

  bool wait() {
    std::unique_lock lock(mutex_);
    return idle_.wait_for(lock, patience, [this] { return lines_.empty() || is_silent_; });
  }

  void stop_messages() {
    const std::lock_guard lock(mutex_);
    is_silent_ = true;
    lines_.resize(std::min<std::size_t>(lines_.size(), 1));  // the first is being written
    idle_.notify_all();
  }

 private:
  void add(int descriptor, const std::string& line) {
    bytes_ += line.size() + 1;
    lines_.emplace_back(descriptor, line + "\n");
    wake_.notify_one();
  }

  void run() {
    std::unique_lock lock(mutex_);
    while (true) {
      wake_.wait(lock, [this] { return !lines_.empty(); });
      const auto& [descriptor, text] = lines_.front();  // push_back does not move it
      lock.unlock();
      write_all(descriptor, text);
      lock.lock();
      bytes_ -= text.size();
      const int last = descriptor;
      lines_.pop_front();
      if (const std::size_t count = std::exchange(left_out_, 0); count > 0 && !is_silent_) {
        add(last, "(" + counted(count, "unread line was", "unread lines were") + " dropped)");
      }
      if (lines_.empty()) {
        idle_.notify_all();
      }
    }
  }

  std::mutex mutex_;
  std::condition_variable wake_;
  std::condition_variable idle_;
  std::deque<std::pair<int, std::string>> lines_;
  std::size_t bytes_ = 0;  // total size of `lines_`
  std::size_t left_out_ = 0;
  bool is_silent_ = false;
};

LinePrinter& printer() {
  static LinePrinter* const one = new LinePrinter;
  return *one;
}

// Returns the terminal's columns; 0: no terminal or unknown.
std::size_t columns_of(int descriptor) {
  winsize size{};
  return isatty(descriptor) != 0 && ioctl(descriptor, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

// https://no-color.org
bool has_colour(int descriptor) {
  const char* const no_color = std::getenv("NO_COLOR");
  const char* const kind = std::getenv("TERM");
  return isatty(descriptor) != 0 && (no_color == nullptr || *no_color == '\0') && kind != nullptr &&
         std::string_view(kind) != "dumb";
}

// Colours a word at the start of a line or after "FILE:LINE:COLUMN: ".
void colour(std::string& text, std::string_view word, std::string_view code) {
  for (std::size_t at = 0; (at = text.find(word, at)) != text.npos;) {
    const bool is_first = at == 0 || text[at - 1] == '\n';
    const bool is_after_place = at >= 2 && text.compare(at - 2, 2, ": ") == 0;
    if (is_first || is_after_place) {
      const std::string shown = std::string(code) + std::string(word) + "\033[0m";
      text.replace(at, word.size(), shown);
      at += shown.size();
    } else {
      at += word.size();
    }
  }
}

}  // namespace

std::string for_terminal(const std::string& text) {
  constexpr std::size_t narrowest = 20;
  const std::size_t columns = columns_of(STDOUT_FILENO);
  std::string shown = columns >= narrowest ? wrapped(text, columns) : text;
  if (has_colour(STDOUT_FILENO)) {
    colour(shown, "error:", "\033[1;31m");
    colour(shown, "warning:", "\033[1;33m");
  }
  return shown;
}

void say(const std::string& line) {
  printer().put(STDOUT_FILENO, for_terminal(line));
}
void complain(const std::string& line) {
  printer().put(STDERR_FILENO, line);
}
bool flush_messages() {
  return printer().wait();
}
void stop_messages() {
  printer().stop_messages();
}

}  // namespace ressort
