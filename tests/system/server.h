// tests: fixtures for the whole program: a JACK server, the program, and a listener that plays MIDI
// and records every sample.
#pragma once

#include <fcntl.h>
#include <jack/jack.h>
#include <jack/midiport.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "tests/support/catch.h"

namespace ressort::servers {

using namespace std::chrono_literals;

// Waits until `holds` is true; returns false after a time that only a hang exceeds.
inline bool eventually(const std::function<bool()>& holds, std::chrono::seconds patience = 20s) {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!holds()) {
    if (std::chrono::steady_clock::now() > end) {
      return false;
    }
    std::this_thread::sleep_for(10ms);
  }
  return true;
}

// A child process. Its output can be awaited, and its input written.
class Child {
 public:
  explicit Child(std::vector<std::string> words,
                 const std::vector<std::pair<std::string, std::string>>& environment = {}) {
    int in[2];
    int out[2];
    REQUIRE(pipe2(in, O_CLOEXEC) == 0);
    REQUIRE(pipe2(out, O_CLOEXEC) == 0);
    pid_ = fork();
    REQUIRE(pid_ >= 0);
    if (pid_ == 0) {
      dup2(in[0], STDIN_FILENO);
      dup2(out[1], STDOUT_FILENO);
      dup2(out[1], STDERR_FILENO);
      for (const auto& [name, value] : environment) {
        setenv(name.c_str(), value.c_str(), 1);
      }
      std::vector<char*> arguments;
      for (std::string& word : words) {
        arguments.push_back(word.data());
      }
      arguments.push_back(nullptr);
      execvp(arguments[0], arguments.data());
      _exit(127);
    }
    close(in[0]);
    close(out[1]);
    input_ = in[1];
    output_ = out[0];
    fcntl(output_, F_SETFL, O_NONBLOCK);
  }
  ~Child() {
    if (pid_ > 0) {
      kill(pid_, SIGTERM);
      if (!eventually([this] { return has_ended(); }, 10s)) {
        kill(pid_, SIGKILL);
        waitpid(pid_, &status_, 0);
      }
    }
    end_input();
    close(output_);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  void write(const std::string& text) {
    REQUIRE(::write(input_, text.data(), text.size()) == static_cast<ssize_t>(text.size()));
  }
  void end_input() {
    if (input_ >= 0) {
      close(input_);
      input_ = -1;
    }
  }
  const std::string& said() {
    char block[4096];
    for (ssize_t got = 0; (got = read(output_, block, sizeof block)) > 0;) {
      said_.append(block, static_cast<std::size_t>(got));
    }
    return said_;
  }
  bool says(const std::string& text) {
    return eventually([&] { return said().find(text) != std::string::npos; });
  }
  // says() only searches the output after this call.
  void forget() {
    said();
    said_.clear();
  }
  bool has_ended() {
    if (pid_ > 0 && waitpid(pid_, &status_, WNOHANG) == pid_) {
      pid_ = -1;
    }
    return pid_ < 0;
  }
  void signal(int number) { kill(pid_, number); }
  // -1 if it was killed or does not end.
  int exit_code() {
    if (!eventually([this] { return has_ended(); })) {
      return -1;
    }
    return WIFEXITED(status_) ? WEXITSTATUS(status_) : -1;
  }
  pid_t pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
  int input_ = -1;
  int output_ = -1;
  int status_ = 0;
  std::string said_;
};

// One name for all servers, because a killed server leaves its slot in JACK's registry.
inline constexpr const char* server_name = "ressort-test";

inline void use_test_server() {
  setenv("JACK_DEFAULT_SERVER", server_name, 1);
  setenv("JACK_NO_START_SERVER", "1", 1);
  setenv("JACK_NO_AUDIO_RESERVATION", "1", 1);
  // Keeps the user's own data untouched.
  setenv("XDG_DATA_HOME", ("/tmp/ressort-data-" + std::to_string(getpid())).c_str(), 1);
  setenv("XDG_CONFIG_HOME", ("/tmp/ressort-config-" + std::to_string(getpid())).c_str(), 1);
  jack_set_error_function([](const char*) {});
  jack_set_info_function([](const char*) {});
}

class Server {
 public:
  // While a program waits for this server, pass `is_awaited = false` and await the program's own
  // message. A client that closes while another one opens can leave its semaphore in that other
  // client (JACK 1.9.21), and the next client in the same slot then never runs.
  explicit Server(int period_frames, int rate_hz = 48000, bool is_awaited = true,
                  int speakers = 2) {
    use_test_server();
    // Output to a full pipe would block the server.
    jackd_ = std::make_unique<Child>(std::vector<std::string>{
        "sh", "-c",
        "exec jackd -r -n " + std::string(server_name) + " -d dummy -r " + std::to_string(rate_hz) +
            " -p " + std::to_string(period_frames) + " -P " + std::to_string(speakers) +
            " > /dev/null 2>&1"});
    if (!is_awaited) {
      return;
    }
    REQUIRE(eventually([] {
      jack_client_t* client = jack_client_open("knock", JackNoStartServer, nullptr);
      if (client != nullptr) {
        jack_client_close(client);
      }
      return client != nullptr;
    }));
  }
  void kill() { jackd_->signal(SIGKILL); }
  void end() { jackd_->signal(SIGTERM); }

 private:
  std::unique_ptr<Child> jackd_;
};

// The program as built.
inline std::vector<std::string> program(std::initializer_list<std::string> arguments) {
  std::vector<std::string> words{RESSORT_PROGRAM};
  words.insert(words.end(), arguments);
  return words;
}

// A JACK client that sends MIDI at exact frames and records every sample. Frames are its own count,
// which is also the index into `heard`.
class Listener {
 public:
  struct Message {
    std::size_t frame = 0;
    std::array<unsigned char, 3> bytes{};
  };

  explicit Listener(std::size_t most_frames) : heard_(most_frames) {
    client_ = jack_client_open("listener", JackNoStartServer, nullptr);
    REQUIRE(client_ != nullptr);
    audio_ = jack_port_register(client_, "in", JACK_DEFAULT_AUDIO_TYPE, JackPortIsInput, 0);
    midi_ = jack_port_register(client_, "out", JACK_DEFAULT_MIDI_TYPE, JackPortIsOutput, 0);
    jack_set_process_callback(client_, &Listener::process, this);
    jack_set_xrun_callback(
        client_,
        [](void* self) {
          ++static_cast<Listener*>(self)->overruns_;
          return 0;
        },
        this);
  }
  ~Listener() { jack_client_close(client_); }

  // Call it before start(), with messages sorted by frame.
  void plan(std::vector<Message> messages) { messages_ = std::move(messages); }

  // `connect` is called before the recording starts.
  void start(
      const std::string& from, const std::string& midi_to,
      const std::function<void()>& connect = [] {}) {
    REQUIRE(jack_activate(client_) == 0);
    if (!from.empty()) {
      REQUIRE(eventually([&] {
        jack_connect(client_, from.c_str(), "listener:in");
        return jack_port_connected(audio_) > 0;
      }));
    }
    if (!midi_to.empty()) {
      REQUIRE(eventually([&] {
        jack_connect(client_, "listener:out", midi_to.c_str());
        return jack_port_connected(midi_) > 0;
      }));
    }
    connect();
    is_rolling_ = true;
  }

  std::size_t frames() const { return at_; }
  // Returns how often the server said that a client missed its period.
  int overruns() const { return overruns_; }
  bool wait_for(std::size_t frames) {
    return eventually([&] { return at_ >= frames; }, 180s);
  }
  float heard(std::size_t frame) const { return heard_[frame]; }

  // Returns the first frame from `from` on where the sound exceeds the threshold.
  std::size_t onset(std::size_t from, std::size_t to, float threshold) const {
    for (std::size_t i = from; i < std::min(to, frames()); ++i) {
      if (std::fabs(heard_[i]) > threshold) {
        return i;
      }
    }
    return to;
  }

 private:
  static int process(jack_nframes_t frames, void* self) {
    return static_cast<Listener*>(self)->block(frames);
  }
  int block(jack_nframes_t frames) {
    void* const midi = jack_port_get_buffer(midi_, frames);
    jack_midi_clear_buffer(midi);
    if (!is_rolling_) {
      return 0;
    }
    const auto* const audio = static_cast<const float*>(jack_port_get_buffer(audio_, frames));
    const std::size_t at = at_;
    while (next_ < messages_.size() && messages_[next_].frame < at + frames) {
      const Message& message = messages_[next_++];
      jack_midi_event_write(midi, static_cast<jack_nframes_t>(message.frame - at),
                            message.bytes.data(), message.bytes.size());
    }
    const std::size_t room = heard_.size() - std::min(heard_.size(), at);
    std::copy(audio, audio + std::min<std::size_t>(frames, room),
              heard_.begin() + static_cast<std::ptrdiff_t>(at));
    at_ = at + std::min<std::size_t>(frames, room);
    return 0;
  }

  jack_client_t* client_ = nullptr;
  jack_port_t* audio_ = nullptr;
  jack_port_t* midi_ = nullptr;
  std::vector<float> heard_;
  std::vector<Message> messages_;
  std::size_t next_ = 0;
  std::atomic<std::size_t> at_{0};
  std::atomic<bool> is_rolling_{false};
  std::atomic<int> overruns_{0};
};

// A silent JACK client with ports to connect by hand.
class Neighbour {
 public:
  Neighbour() {
    client_ = jack_client_open("neighbour", JackNoStartServer, nullptr);
    REQUIRE(client_ != nullptr);
    for (const auto& [name, type, flags] :
         {std::tuple{"left", JACK_DEFAULT_AUDIO_TYPE, JackPortIsInput},
          std::tuple{"right", JACK_DEFAULT_AUDIO_TYPE, JackPortIsInput},
          std::tuple{"sound", JACK_DEFAULT_AUDIO_TYPE, JackPortIsOutput},
          std::tuple{"keys", JACK_DEFAULT_MIDI_TYPE, JackPortIsOutput}}) {
      REQUIRE(jack_port_register(client_, name, type, static_cast<unsigned long>(flags), 0) !=
              nullptr);
    }
    REQUIRE(jack_activate(client_) == 0);
  }
  ~Neighbour() { jack_client_close(client_); }

  bool connect(const std::string& from, const std::string& to) const {
    return eventually([&] {
      jack_connect(client_, from.c_str(), to.c_str());
      return is_connected(from, to);
    });
  }
  jack_client_t* client() { return client_; }
  void disconnect(const std::string& from, const std::string& to) {
    REQUIRE(jack_disconnect(client_, from.c_str(), to.c_str()) == 0);
  }
  bool is_connected(const std::string& from, const std::string& to) const {
    const jack_port_t* const port = jack_port_by_name(client_, from.c_str());
    const char** const others =
        port != nullptr ? jack_port_get_all_connections(client_, port) : nullptr;
    bool found = false;
    for (std::size_t i = 0; others != nullptr && others[i] != nullptr; ++i) {
      found = found || others[i] == to;
    }
    jack_free(others);
    return found;
  }

 private:
  jack_client_t* client_ = nullptr;
};

}  // namespace ressort::servers
