#include "app/commands/commands.h"

#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <future>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "app/commands/progress_bar.h"
#include "app/commands/smf/midi_player.h"
#include "app/control/terminal.h"
#include "app/devices/midi_input.h"
#include "app/say.h"
#include "app/session/load_news.h"
#include "app/text.h"

namespace ressort {
namespace {

using namespace std::chrono_literals;

Flag interrupted;  // by a signal, while rendering

std::string db(double factor) {
  if (factor <= 0.0) {
    return "silent";
  }
  char text[32];
  const double level = 20.0 * std::log10(factor);
  std::snprintf(text, sizeof text, "%.1f dBFS", level > -0.05 && level < 0.0 ? 0.0 : level);
  return text;
}

// What ends the program. nohup's promise is kept.
std::vector<int> ending_signals() {
  std::vector<int> signals = {SIGINT, SIGTERM};
  struct sigaction now {};
  if (sigaction(SIGHUP, nullptr, &now) == 0 && now.sa_handler != SIG_IGN) {
    signals.push_back(SIGHUP);
  }
  return signals;
}

// Signals are waited for, not handled: every thread inherits this, so that they reach main alone.
sigset_t block_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : ending_signals()) {
    sigaddset(&signals, signal);
  }
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  signal(SIGPIPE, SIG_IGN);
  return signals;
}

// What a person hears of the program while it plays: above the console's prompt if there is one.
class Voice {
 public:
  void say(const std::string& text) {
    const std::lock_guard lock(mutex_);
    if (terminal_ != nullptr) {
      terminal_->say(text);
    } else {
      ressort::say(text);
    }
  }
  void set_terminal(Terminal* terminal) {
    const std::lock_guard lock(mutex_);
    terminal_ = terminal;
  }

 private:
  std::mutex mutex_;
  Terminal* terminal_ = nullptr;
};

// Ends the program where ending takes longer than anybody waits: a library is at work, or what it
// has freed is large.
class LastResort {
 public:
  LastResort()
      : thread_([this] {
          std::unique_lock lock(mutex_);
          if (!over_.wait_for(lock, 900ms, [this] { return is_over_; })) {
            std::_Exit(exit_code::done);
          }
        }) {}
  ~LastResort() {
    {
      const std::lock_guard lock(mutex_);
      is_over_ = true;
    }
    over_.notify_all();
    thread_.join();
  }

 private:
  std::mutex mutex_;
  std::condition_variable over_;
  bool is_over_ = false;
  std::thread thread_;
};

// Everything that runs while the program plays, in the order in which it has to end.
class Player {
 public:
  explicit Player(const PlayOptions& options) : options_(options), signals_(block_signals()) {}

  int run() {
    if (const auto allowed = allowed_senders(options_.osc); options_.osc.port != 0 && !allowed) {
      complain(allowed.error().message);
      return exit_code::wrong_use;
    }
    if (names_midi_file(options_.name)) {  // the first argument may be the song
      options_.midi = std::exchange(options_.name, PlayOptions().name);
    }
    std::optional<MidiFile> song;
    if (names_midi_file(options_.midi)) {
      auto read = read_midi_file(options_.midi);
      if (!read) {
        complain(read.error().message);
        return exit_code::wrong_use;
      }
      song = *std::move(read);
      options_.midi = PlayOptions().midi;
    }
    LoadNews news(options_.name, [this](const std::string& text) { voice_.say(text); });
    const Progress progress([&](std::string_view stage) {
      news.at(stage);
      return !is_called_off(0ms);
    });
    const auto scene = load_scene(
        options_.name, {.third = options_.third, .keys = options_.keys, .progress = progress});
    if (is_called_off(0ms)) {
      return exit_code::done;
    }
    if (!scene) {
      complain(scene.error().message);
      return exit_code::wrong_use;
    }
    options_.device.outputs = std::max(2, output_count(scene->network));
    if (const int failure = open_device(); failure != exit_code::done) {
      return failure;
    }
    session_ =
        std::make_unique<Session>(process_,
                                  SessionOptions{.compile = {.rate_hz = device_.rate_hz,
                                                             .rescale = options_.rescale,
                                                             .voices = options_.voices,
                                                             .precision = options_.precision,
                                                             .method = options_.method,
                                                             .budget = options_.budget},
                                                 .gain = std::pow(10.0, options_.gain_db / 20.0),
                                                 .third = options_.third,
                                                 .keys = options_.keys},
                                  [this](const std::string& news) { voice_.say(news); });
    connect_session();
    std::promise<Result<std::shared_ptr<const Loaded>>> promise;
    auto answer = promise.get_future();
    session_->load(
        options_.name, [&](const auto& result) { promise.set_value(result); }, options_.force);
    wait_for(answer);
    const auto loaded = answer.get();
    if (has_called_off_) {
      return exit_code::done;
    }
    if (!loaded) {
      complain(loaded.error().message);
      return exit_code::wrong_use;
    }
    greet(**loaded);
    open_osc();
    open_midi();
    if (song) {
      voice_.say("playing " + counted(song->messages.size(), "message", "messages") + " of MIDI, " +
                 fixed(song->length_s, 1) + " s");
      player_.emplace(*std::move(song), door_);
    }
    return converse();
  }

  ~Player() {
    if (session_) {
      session_->end();  // a command may be waiting for a load
    }
    voice_.set_terminal(nullptr);
    terminal_.reset();
    console_.reset();
    osc_.reset();
    player_.reset();
    midi_.reset();
    if (device_.close) {
      fade_out();
    }
    // The session's worker may still call the device; the device's thread never calls the session.
    session_.reset();
    device_ = AudioDevice();
  }

 private:
  int open_device() {
    auto device = open_audio(options_.audio, process_, options_.device);
    if (!device) {
      complain(device.error().message);
      return exit_code::audio_lost;
    }
    device_ = *std::move(device);
    return exit_code::done;
  }

  void connect_session() {
    session_->set_backend(device_.description, true);
    session_->on_audio_inputs([this](int wanted) {
      const std::lock_guard lock(device_mutex_);
      audio_inputs_ = wanted;
      if (device_.set_audio_inputs) {
        device_.set_audio_inputs(wanted);
      }
    });
  }

  void greet(const Loaded& loaded) {
    if (!device_.note.empty()) {
      voice_.say(device_.note);
    }
    if (device_.kind != "dummy" && !may_raise_priority()) {
      voice_.say(
          "without permission for real-time priority the sound may break up; to have it, type\n"
          "  echo '@audio - rtprio 95' | sudo tee /etc/security/limits.d/ressort.conf\n"
          "  sudo usermod -aG audio $USER\n"
          "and log in anew");
    }
    voice_.say(loaded.name + ": " + counted(loaded.instrument.masses, "mass", "masses") + ", " +
               counted(loaded.instrument.links, "link", "links") + ", " +
               counted(static_cast<std::size_t>(loaded.instrument.voices), "voice", "voices") +
               " on " + device_.description);
    if (!loaded.description.empty()) {
      voice_.say(loaded.description);
    }
    for (const std::string& warning : loaded.warnings) {
      voice_.say(warning);
    }
  }

  // The sound is worth more than a port.
  void open_osc() {
    if (options_.osc.port == 0) {
      return;
    }
    auto osc = OscServer::open(options_.osc, process_, *session_,
                               [this](const std::string& news) { voice_.say(news); });
    if (!osc) {
      voice_.say("playing without OSC: " + osc.error().message);
      return;
    }
    osc_ = *std::move(osc);
    voice_.say("OSC on " + options_.osc.bind_address + " port " + std::to_string(osc_->port()) +
               ", " + osc_->access());
  }

  void open_midi() {
    const bool wants_jack = options_.midi == "jack" && !device_.has_midi;
    const bool wants_alsa =
        options_.midi == "alsa" || (options_.midi == "auto" && !device_.has_midi);
    if (!wants_jack && !wants_alsa) {
      return;
    }
    auto midi = MidiInput::open(wants_jack ? MidiApi::jack : MidiApi::alsa,
                                options_.device.client_name, true, door_);
    if (midi) {
      midi_ = *std::move(midi);
    } else {
      voice_.say(midi.error().message);
    }
  }

  int converse() {
    console_ = std::make_unique<Console>(process_, *session_, say,
                                         [this](const std::string& news) { voice_.say(news); });
    if (!options_.script.empty()) {
      auto script =
          std::async(std::launch::async, [this] { return console_->run_script(options_.script); });
      wait_for(script);
      const auto ran = script.get();
      if (has_called_off_) {
        return exit_code::done;
      }
      if (!ran) {
        complain(ran.error().message);
        return exit_code::wrong_use;
      }
      if (console_->has_quit()) {
        return exit_code::done;
      }
    }
    if (!options_.no_console) {
      if (isatty(STDIN_FILENO) != 0) {
        voice_.say("type 'help' for what there is, 'keys' to play, 'quit' to leave");
      }
      terminal_ = std::make_unique<Terminal>(*console_, [this] { quit_.raise(); });
      voice_.set_terminal(terminal_.get());
    }
    return wait();
  }

  // Whether a signal has come, or comes within so long.
  bool is_called_off(std::chrono::milliseconds patience) {
    const timespec time{0, std::chrono::nanoseconds(patience).count()};
    if (!has_called_off_ && sigtimedwait(&signals_, nullptr, &time) > 0) {
      has_called_off_ = true;
      last_resort_.emplace();
    }
    return has_called_off_;
  }

  // For what another thread does, or for a signal: that ends the session, and so what is loaded.
  template <class Future>
  void wait_for(const Future& future) {
    while (future.wait_for(0ms) != std::future_status::ready) {
      if (is_called_off(20ms)) {
        session_->end();
        future.wait();
      }
    }
  }

  int wait() {
    auto next_tick = std::chrono::steady_clock::now();
    while (!quit_.is_raised()) {
      if (is_called_off(50ms)) {
        return exit_code::done;
      }
      if (device_.is_lost()) {
        voice_.say("the audio of " + device_.description + " is gone");
        if (options_.exit_on_loss) {
          return exit_code::audio_lost;
        }
        if (!regain()) {
          return exit_code::done;
        }
      }
      if (options_.no_console && player_ && player_->is_over() && has_fallen_silent()) {
        return exit_code::done;
      }
      device_.tick();
      if (std::chrono::steady_clock::now() >= next_tick) {
        next_tick += 1s;
        if (midi_) {
          midi_->tick();
        }
      }
    }
    return exit_code::done;
  }

  // After a song: whether nothing has been heard for half a second, or something for a minute.
  bool has_fallen_silent() {
    constexpr double quiet_db = -80.0;
    const auto now = std::chrono::steady_clock::now();
    song_ended_ = song_ended_.value_or(now);
    if (session_->status().peak_db > quiet_db || !quiet_since_) {
      quiet_since_ = now;
    }
    return now - *quiet_since_ > 500ms || now - *song_ended_ > 60s;
  }

  // Waits for the same backend to come back; false if the user loses patience first.
  bool regain() {
    const std::string kind = device_.kind;
    options_.device.wiring = device_.wiring();
    session_->set_backend("none; waiting for " + device_.description, false);
    {
      const std::lock_guard lock(device_mutex_);
      device_ = AudioDevice();
    }
    voice_.say("waiting for it to come back; 'quit' or Ctrl-C ends that");
    while (!quit_.is_raised()) {
      if (is_called_off(200ms)) {
        return false;
      }
      auto device = open_audio(kind, process_, options_.device);
      if (!device) {
        continue;
      }
      {
        const std::lock_guard lock(device_mutex_);
        device_ = *std::move(device);
        device_.set_audio_inputs(audio_inputs_);
      }
      session_->set_backend(device_.description, true);
      session_->set_rate(device_.rate_hz);
      voice_.say("playing again on " + device_.description);
      return true;
    }
    return false;
  }

  // So that leaving does not click.
  void fade_out() {
    const TimedEvent panic{Event{.kind = EventKind::panic}};
    process_.send(process_.from_console, {&panic, 1});
    std::this_thread::sleep_for(50ms);
  }

  PlayOptions options_;
  sigset_t signals_;
  bool has_called_off_ = false;            // by a signal
  std::optional<LastResort> last_resort_;  // from then on; it goes last
  Process process_{48000.0, true, monotonic_ns};
  Voice voice_;
  Flag quit_;
  MidiDoor door_{process_};
  std::mutex device_mutex_;  // between main and the session's worker
  AudioDevice device_;
  int audio_inputs_ = 0;
  std::unique_ptr<Session> session_;
  std::unique_ptr<OscServer> osc_;
  std::unique_ptr<MidiInput> midi_;
  std::optional<MidiPlayer> player_;
  std::optional<std::chrono::steady_clock::time_point> song_ended_;
  std::optional<std::chrono::steady_clock::time_point> quiet_since_;
  std::unique_ptr<Console> console_;
  std::unique_ptr<Terminal> terminal_;
};

}  // namespace

int play(const PlayOptions& options) {
  const int code = Player(options).run();
  static_cast<void>(wait_until_said());
  return code;
}

namespace {

// From now on a signal ends the render where it is, and a second one the program.
void watch_signals() {
  struct sigaction once {};
  once.sa_handler = [](int) { interrupted.raise(); };
  once.sa_flags = static_cast<int>(SA_RESETHAND);
  for (const int signal : ending_signals()) {
    sigaction(signal, &once, nullptr);
  }
}

void ignore_signals_no_more() {
  for (const int signal : ending_signals()) {
    ::signal(signal, SIG_DFL);
  }
}

}  // namespace

int render_command(const RenderOptions& options, bool is_quiet) {
  std::optional<ProgressBar> bar(!is_quiet);
  RenderOptions watched = options;
  LoadNews news(options.name, is_quiet ? LoadNews::Tell() : complain);
  watched.loading = Progress([&](std::string_view stage) {
    news.at(stage);
    return true;  // a signal ends it at once
  });
  bool is_watched = false;
  const auto rendered = render(watched, [&](double share) {
    if (!std::exchange(is_watched, true)) {
      watch_signals();
    }
    bar->show(share, options.output);
    return !interrupted.is_raised();
  });
  ignore_signals_no_more();
  bar.reset();
  const auto complain = [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); };
  if (!rendered) {
    const bool was_stopped = interrupted.is_raised();
    complain(was_stopped ? options.name + ": interrupted before the first sample"
                         : rendered.error().message);
    return was_stopped ? exit_code::our_failure : exit_code::wrong_use;
  }
  if (rendered->failure) {
    complain(rendered->failure->message);
    return exit_code::our_failure;
  }
  if (!is_quiet) {
    for (const std::string& warning : rendered->warnings) {
      complain(warning);
    }
    std::printf("%s: %s, %.2f s, %d %s, %g Hz, peak %s, rms %s%s\n", options.output.c_str(),
                rendered->name.c_str(), static_cast<double>(rendered->frames) / options.rate_hz,
                rendered->channels, rendered->channels == 1 ? "channel" : "channels",
                options.rate_hz, db(rendered->peak).c_str(), db(rendered->rms).c_str(),
                rendered->was_interrupted ? ", interrupted" : "");
    if (rendered->peak > 1.0) {
      complain("the peak passes full scale; --limit keeps it below");
    }
    const bool was_asked =
        !options.score.empty() || !options.input.empty() || !options.midi.empty();
    if (rendered->peak == 0.0 && rendered->frames > 0 && !was_asked) {
      complain("nothing excites the model: give it a --score or an --input");
    }
  }
  if (rendered->resets > 0) {
    complain(rendered->name + ": " + counted(rendered->resets, "voice", "voices") +
             " became unstable and faded out; the sound is not to be trusted");
  }
  return rendered->was_interrupted ? exit_code::our_failure : exit_code::done;
}

int gallery_command(const GalleryOptions& options) {
  watch_signals();
  return gallery(options, [] { return !interrupted.is_raised(); });
}

int describe_command(const DescribeOptions& options) {
  watch_signals();
  return describe(options, [] { return !interrupted.is_raised(); });
}

int shape_command(const ShapeOptions& options) {
  watch_signals();
  return shape_model(options, [] { return !interrupted.is_raised(); });
}

}  // namespace ressort
