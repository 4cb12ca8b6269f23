#include "app/control/terminal.h"

#include <fcntl.h>
#include <histedit.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <clocale>
#include <cstdio>
#include <cstdlib>
#include <cwchar>
#include <filesystem>
#include <future>
#include <mutex>
#include <thread>
#include <vector>

#include "app/say.h"

namespace ressort::control {

namespace {

namespace fs = std::filesystem;

// Puts the terminal into raw mode without echo for its lifetime.
class RawMode {
 public:
  RawMode() {
    tcgetattr(STDIN_FILENO, &before_);
    termios raw = before_;
    raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO | ISIG | IEXTEN);
    raw.c_cc[VMIN] = 1;
    raw.c_cc[VTIME] = 0;
    tcsetattr(STDIN_FILENO, TCSADRAIN, &raw);
  }
  ~RawMode() { tcsetattr(STDIN_FILENO, TCSADRAIN, &before_); }
  RawMode(const RawMode&) = delete;
  RawMode& operator=(const RawMode&) = delete;

 private:
  termios before_{};
};

// Sets a UTF-8 locale for this thread only, so that number formats stay independent of the locale
// everywhere else.
class Utf8Thread {
 public:
  Utf8Thread()
      : locale_(newlocale(LC_CTYPE_MASK, "C.UTF-8", nullptr)), before_(uselocale(locale_)) {}
  ~Utf8Thread() {
    uselocale(before_);
    if (locale_ != nullptr) {
      freelocale(locale_);
    }
  }
  Utf8Thread(const Utf8Thread&) = delete;
  Utf8Thread& operator=(const Utf8Thread&) = delete;

 private:
  locale_t locale_;
  locale_t before_;
};

bool is_inside_character(char byte) {
  return (static_cast<unsigned char>(byte) & 0xC0u) == 0x80u;
}

// Returns the common prefix of all the words, in whole characters.
std::string common_beginning(const std::vector<std::string>& words) {
  std::size_t length = words[0].size();
  for (const std::string& word : words) {
    const auto differs = std::mismatch(words[0].begin(), words[0].end(), word.begin(), word.end());
    length = std::min(length, static_cast<std::size_t>(differs.first - words[0].begin()));
  }
  while (length > 0 && length < words[0].size() && is_inside_character(words[0][length])) {
    --length;
  }
  return words[0].substr(0, length);
}

std::string in_columns(const std::vector<std::string>& words) {
  winsize size{};
  const bool is_known = ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  const std::size_t room = is_known ? size.ws_col : 80;
  std::size_t width = 0;
  for (const std::string& word : words) {
    width = std::max(width, word.size() + 2);
  }
  const std::size_t columns = std::max<std::size_t>(1, room / width);
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const bool is_last = i + 1 == words.size() || (i + 1) % columns == 0;
    text += words[i] + (is_last ? "\n" : std::string(width - words[i].size(), ' '));
  }
  return text;
}

// Returns the path of the history file; empty without a home folder.
std::string history_path() {
  fs::path folder;
  if (const char* given = std::getenv("XDG_STATE_HOME"); given != nullptr && *given == '/') {
    folder = given;
  } else if (const char* home = std::getenv("HOME"); home != nullptr && *home == '/') {
    folder = fs::path(home) / ".local" / "state";
  } else {
    return "";
  }
  folder /= "ressort";
  std::error_code error;
  fs::create_directories(folder, error);
  return error ? "" : (folder / "history").string();
}

// Prints between the keystrokes of a line that is being edited; waits for the terminal.
void put(const std::string& text) {
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

// Releases a terminal that is stopped or not read; unread output is lost.
void release_terminal() {
  if (isatty(STDOUT_FILENO) != 0 && tcgetpgrp(STDOUT_FILENO) == getpgrp()) {
    tcflush(STDOUT_FILENO, TCOFLUSH);
    // The two calls together wake a blocked writer.
    tcflow(STDOUT_FILENO, TCOOFF);  // NOLINT(concurrency-mt-unsafe): a system call, no more
    tcflow(STDOUT_FILENO, TCOON);   // NOLINT(concurrency-mt-unsafe)
  }
}

}  // namespace

struct Terminal::Input {
  Input(Console& of, std::function<void()> quit) : console(of), on_quit(std::move(quit)) {
    if (pipe2(wake.data(), O_CLOEXEC | O_NONBLOCK) != 0) {
      wake = {-1, -1};
    }
    std::packaged_task<void()> task([this] { work(); });
    over = task.get_future();
    thread = std::thread(std::move(task));
  }

  ~Input() {
    {
      const std::lock_guard lock(mutex);
      is_over = true;
    }
    rouse();
    constexpr std::chrono::milliseconds patience{200};
    if (over.wait_for(patience) != std::future_status::ready && !flush_messages()) {
      stop_messages();
    }
    constexpr std::chrono::milliseconds moment{10};
    while (over.wait_for(moment) != std::future_status::ready) {
      release_terminal();
    }
    thread.join();
    console.set_keyboard({});
    close(wake[0]);
    close(wake[1]);
  }

  Console& console;
  std::function<void()> on_quit;
  std::array<int, 2> wake{-1, -1};  // A pipe: a byte written to [1] ends a wait.
  std::mutex mutex;                 // Protects the next three.
  bool is_over = false;
  bool is_editing = false;     // libedit controls the terminal.
  std::string unsaid;          // Text waiting to be printed above the line being typed.
  EditLine* editor = nullptr;  // Used by the thread only.
  std::thread thread;
  std::future<void> over;  // Result of the thread.

  enum class Woken { key, nothing, over };

  void rouse() {
    const char byte = 0;
    // A full pipe wakes the reader as well.
    static_cast<void>(!write(wake[1], &byte, 1));
  }

  void say(const std::string& text) {
    {
      const std::lock_guard lock(mutex);
      if (!is_editing) {
        ressort::say(text);
        return;
      }
      constexpr std::size_t most_bytes = std::size_t{1} << 20;  // Limit for a stopped terminal.
      if (unsaid.size() < most_bytes) {
        unsaid += text + "\n";
      }
    }
    rouse();
  }

  // Waits for a key or the end of the input. Negative: without a limit.
  Woken wait(int timeout_ms) {
    std::string news;
    while (true) {
      {
        const std::lock_guard lock(mutex);
        if (is_over) {
          return Woken::over;
        }
        news = is_editing ? std::exchange(unsaid, {}) : "";
      }
      if (!news.empty()) {
        put("\r\x1b[K" + for_terminal(news));
        el_set(editor, EL_REFRESH);
      }
      pollfd both[] = {{STDIN_FILENO, POLLIN, 0}, {wake[0], POLLIN, 0}};
      const int count = poll(both, 2, timeout_ms);
      if (count == 0) {
        return Woken::nothing;
      }
      if (count < 0 && errno != EINTR) {
        return Woken::over;
      }
      if (count > 0 && both[1].revents != 0) {
        char bytes[64];
        static_cast<void>(!read(wake[0], bytes, sizeof bytes));
      } else if (count > 0) {
        return Woken::key;
      }
    }
  }

  void work() {
    if (isatty(STDIN_FILENO) == 0) {
      read_lines();
      return;
    }
    // Access to the terminal from the background would stop the whole program, including the sound.
    if (tcgetpgrp(STDIN_FILENO) != getpgrp()) {
      return;
    }
    const Utf8Thread utf8;
    editor = isatty(STDOUT_FILENO) != 0 ? el_init("ressort", stdin, stdout, stderr) : nullptr;
    if (editor == nullptr) {
      read_lines();
      return;
    }
    console.set_keyboard([this](const auto& on_key) { read_keys(on_key); });
    edit_lines();
    el_end(editor);
  }

  // Returns false after the last line.
  bool run_line(std::string_view line) {
    if (console.run_line(line)) {
      return true;
    }
    on_quit();
    return false;
  }

  void read_lines() {
    constexpr std::size_t max_line = 65536;
    std::string text;
    bool is_skipping = false;  // Skips the rest of a line that is too long.
    while (wait(-1) == Woken::key) {
      char bytes[4096];
      const ssize_t got = read(STDIN_FILENO, bytes, sizeof bytes);
      if (got < 0 && (errno == EINTR || errno == EAGAIN)) {
        continue;
      }
      const bool is_end = got <= 0;
      text.append(bytes, static_cast<std::size_t>(is_end ? 0 : got));
      if (is_end && !text.empty()) {
        text += '\n';
      }
      std::size_t at = 0;
      for (std::size_t end = 0; (end = text.find('\n', at)) != text.npos; at = end + 1) {
        if (is_skipping) {
          is_skipping = false;
        } else if (!run_line(std::string_view(text).substr(at, end - at))) {
          return;
        }
      }
      if (is_end) {
        return;
      }
      text.erase(0, at);
      if (text.size() > max_line) {
        if (!is_skipping) {
          ressort::say("error: a line of more than 65536 characters was left out");
        }
        is_skipping = true;
        text.clear();
      }
    }
  }

  void edit_lines() {
    const std::string path = history_path();
    History* const lines = history_init();
    HistEvent event;
    history(lines, &event, H_SETSIZE, 1000);
    history(lines, &event, H_SETUNIQUE, 1);
    if (!path.empty()) {
      history(lines, &event, H_LOAD, path.c_str());
    }
    el_set(editor, EL_CLIENTDATA, this);
    el_set(editor, EL_PROMPT, prompt);
    el_set(editor, EL_EDITOR, "emacs");
    el_set(editor, EL_SIGNAL, 0);
    el_set(editor, EL_GETCFN, next_character);
    el_set(editor, EL_HIST, history, lines);
    // The narrow-character variant of this call leaks its copies.
    el_wset(editor, EL_ADDFN, L"ressort-complete", L"Completes a word", complete);
    el_set(editor, EL_BIND, "^I", "ressort-complete", nullptr);
    el_set(editor, EL_BIND, "^R", "em-inc-search-prev", nullptr);
    bool should_continue = true;
    while (should_continue) {
      el_resize(editor);
      flush_messages();  // The prompt is printed after it.
      set_editing(true);
      int count = 0;
      const char* const typed = el_gets(editor, &count);
      const std::string line(typed != nullptr ? typed : "",
                             typed != nullptr ? static_cast<std::size_t>(count) : 0);
      set_editing(false);
      if (!line.ends_with('\n')) {
        ressort::say(
            must_end() ? ""
                       : "\nThe console is closed and the sound continues; press Ctrl-C to quit.");
        break;
      }
      const std::string words = line.substr(0, line.find_last_not_of(" \t\n") + 1);
      if (!words.empty()) {
        history(lines, &event, H_ENTER, words.c_str());
      }
      should_continue = run_line(words);
    }
    if (!path.empty()) {
      history(lines, &event, H_SAVE, path.c_str());
    }
    history_end(lines);
  }

  bool must_end() {
    const std::lock_guard lock(mutex);
    return is_over;
  }

  void set_editing(bool now) {
    const std::lock_guard lock(mutex);
    is_editing = now;
    if (!unsaid.empty()) {
      unsaid.pop_back();  // The last line end is added by the editor.
      ressort::say(std::exchange(unsaid, {}));
    }
  }

  void read_keys(const std::function<bool(char)>& on_key) {
    using Clock = std::chrono::steady_clock;
    // Shorter than the shortest time between two keystrokes: the keyboard repeats a key that is
    // held down.
    constexpr std::chrono::milliseconds repetition{60};
    const RawMode raw;
    char last = 0;
    Clock::time_point last_time;
    bool should_continue = true;
    while (should_continue) {
      const Woken woken = wait(1000);
      if (woken == Woken::over) {
        return;
      }
      if (woken == Woken::nothing) {
        should_continue = on_key(0);
        last = 0;
        continue;
      }
      char bytes[64];
      const ssize_t got = read(STDIN_FILENO, bytes, sizeof bytes);
      if (got <= 0) {
        return;
      }
      constexpr char escape = 27;
      if (got > 1 && bytes[0] == escape) {  // An arrow or a function key.
        continue;
      }
      const Clock::time_point now = Clock::now();
      for (ssize_t i = 0; i < got && should_continue; ++i) {
        if (bytes[i] != last || now - last_time > repetition) {
          should_continue = on_key(bytes[i]);
        }
        last = bytes[i];
      }
      last_time = now;
    }
  }

  static char* prompt(EditLine*) {
    static char text[] = "ressort> ";
    return text;
  }

  static Input& of(EditLine* editor) {
    void* input = nullptr;
    el_get(editor, EL_CLIENTDATA, &input);
    return *static_cast<Input*>(input);
  }

  // Reads one character; 0 ends the line and the input.
  static int next_character(EditLine* editor, wchar_t* character) {
    std::mbstate_t state{};
    while (of(editor).wait(-1) == Woken::key) {
      char byte = 0;
      const ssize_t got = read(STDIN_FILENO, &byte, 1);
      if (got < 0 && (errno == EINTR || errno == EAGAIN)) {
        continue;
      }
      if (got <= 0) {
        return 0;
      }
      // NOLINTNEXTLINE(concurrency-mt-unsafe): it has a state of its own
      const std::size_t used = std::mbrtowc(character, &byte, 1, &state);
      if (used == static_cast<std::size_t>(-1)) {
        state = {};  // Skips bytes that are not UTF-8.
      } else if (used != static_cast<std::size_t>(-2)) {
        return 1;
      }
    }
    return 0;
  }

  static unsigned char complete(EditLine* editor, int) {
    const LineInfo* const info = el_line(editor);
    const std::string line(info->buffer, info->cursor);
    const std::vector<std::string> words = of(editor).console.completions(line);
    if (words.empty()) {
      return CC_ERROR;
    }
    const std::string typed(last_word(line));
    std::string text = common_beginning(words);
    const bool is_whole = words.size() == 1 && !text.ends_with('/');
    const bool is_quoted = typed.starts_with('"') || text.find(' ') != text.npos;
    text = (is_quoted ? "\"" : "") + text;
    if (is_whole) {
      text += is_quoted ? "\" " : " ";
    }
    if (text == typed) {
      put("\n" + in_columns(words));
      return CC_REDISPLAY;
    }
    const auto characters =
        std::ranges::count_if(typed, [](char byte) { return !is_inside_character(byte); });
    el_deletestr(editor, static_cast<int>(characters));
    el_insertstr(editor, text.c_str());
    return words.size() == 1 ? CC_REFRESH : CC_REFRESH_BEEP;
  }
};

Terminal::Terminal(Console& console, std::function<void()> on_quit)
    : input_(std::make_unique<Input>(console, std::move(on_quit))) {}

Terminal::~Terminal() = default;

void Terminal::say(const std::string& text) {
  input_->say(text);
}

}  // namespace ressort::control
