#include "app/commands.h"

#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <thread>

#include "app/midi_input.h"
#include "app/terminal.h"
#include "app/text.h"

namespace ressort {
namespace {

using namespace std::chrono_literals;

Flag interrupted;  // by Ctrl-C, while rendering

std::string db(double factor) {
  if (factor <= 0.0) {
    return "silent";
  }
  char text[32];
  const double level = 20.0 * std::log10(factor);
  std::snprintf(text, sizeof text, "%.1f dBFS", level > -0.05 && level < 0.0 ? 0.0 : level);
  return text;
}

void complain(const std::string& text) {
  std::fprintf(stderr, "%s\n", text.c_str());
}

// Signals are waited for, not handled: every thread inherits this, so that they reach main alone.
sigset_t block_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
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
      std::printf("%s\n", text.c_str());
      std::fflush(stdout);
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

// Everything that runs while the program plays, in the order in which it has to end.
class Player {
 public:
  explicit Player(const PlayOptions& options) : options_(options), signals_(block_signals()) {}

  int run() {
    const auto scene = load_scene(options_.name, {.third = options_.third});
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
                                                 .third = options_.third},
                                  [this](const std::string& news) { voice_.say(news); });
    connect_session();
    const auto loaded = session_->load_and_wait(options_.name, options_.force);
    if (!loaded) {
      complain(loaded.error().message);
      return exit_code::wrong_use;
    }
    greet(**loaded);
    if (const int failure = open_osc(); failure != exit_code::done) {
      return failure;
    }
    open_midi();
    return converse();
  }

  ~Player() {
    voice_.set_terminal(nullptr);
    terminal_.reset();
    console_.reset();
    osc_.reset();
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
    session_->set_backend(device_.description, [this] {
      const std::lock_guard lock(device_mutex_);
      return device_.cpu ? device_.cpu() : 0.0;
    });
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

  // Only a port that was asked for has to be had.
  int open_osc() {
    if (options_.osc_port == 0) {
      return exit_code::done;
    }
    auto osc =
        OscServer::open({options_.osc_bind, options_.osc_port.value_or(9777)}, process_, *session_);
    if (osc) {
      osc_ = *std::move(osc);
      voice_.say("OSC on " + options_.osc_bind + " port " + std::to_string(osc_->port()));
      return exit_code::done;
    }
    complain(osc.error().message);
    if (options_.osc_port) {
      return exit_code::our_failure;
    }
    complain("going on without OSC");
    return exit_code::done;
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
    console_ = std::make_unique<Console>(process_, *session_, [](const std::string& text) {
      std::printf("%s\n", text.c_str());
      std::fflush(stdout);
    });
    if (!options_.script.empty()) {
      if (auto ran = console_->run_script(options_.script); !ran) {
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

  int wait() {
    auto next_tick = std::chrono::steady_clock::now();
    while (!quit_.is_raised()) {
      const timespec patience{0, 50'000'000};
      if (sigtimedwait(&signals_, nullptr, &patience) > 0) {
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
      if (std::chrono::steady_clock::now() >= next_tick) {
        next_tick += 1s;
        device_.tick();
        if (midi_) {
          midi_->tick();
        }
      }
    }
    return exit_code::done;
  }

  // Waits for the same backend to come back; false if the user loses patience first.
  bool regain() {
    {
      const std::lock_guard lock(device_mutex_);
      device_ = AudioDevice();
    }
    voice_.say("waiting for it to come back; 'quit' or Ctrl-C ends that");
    while (!quit_.is_raised()) {
      const timespec patience{0, 200'000'000};
      if (sigtimedwait(&signals_, nullptr, &patience) > 0) {
        return false;
      }
      auto device = open_audio(options_.audio == "auto" ? last_kind() : options_.audio, process_,
                               options_.device);
      if (!device) {
        continue;
      }
      {
        const std::lock_guard lock(device_mutex_);
        device_ = *std::move(device);
        device_.set_audio_inputs(audio_inputs_);
      }
      session_->set_backend(device_.description, [this] {
        const std::lock_guard lock(device_mutex_);
        return device_.cpu ? device_.cpu() : 0.0;
      });
      session_->set_rate(device_.rate_hz);
      voice_.say("playing again on " + device_.description);
      return true;
    }
    return false;
  }

  std::string last_kind() const {
    return session_->status().backend.starts_with("JACK") ? "jack" : "alsa";
  }

  // So that leaving does not click.
  void fade_out() {
    process_.from_console.push({Event{.kind = EventKind::panic}});
    std::this_thread::sleep_for(50ms);
  }

  PlayOptions options_;
  sigset_t signals_;
  Process process_{48000.0};
  Voice voice_;
  Flag quit_;
  MidiDoor door_{process_};
  std::mutex device_mutex_;  // between main and the session's worker
  AudioDevice device_;
  int audio_inputs_ = 0;
  std::unique_ptr<Session> session_;
  std::unique_ptr<OscServer> osc_;
  std::unique_ptr<MidiInput> midi_;
  std::unique_ptr<Console> console_;
  std::unique_ptr<Terminal> terminal_;
};

}  // namespace

int play(const PlayOptions& options) {
  return Player(options).run();
}

int render_command(const RenderOptions& options, bool is_quiet) {
  signal(SIGINT, [](int) { interrupted.raise(); });
  const bool shows = !is_quiet && isatty(STDERR_FILENO) != 0;
  int shown = -1;
  const auto rendered = render(options, [&](double share) {
    if (const int percent = static_cast<int>(100.0 * share); shows && percent != shown) {
      shown = percent;
      std::fprintf(stderr, "\r%s: %3d %%", options.output.c_str(), percent);
    }
    return !interrupted.is_raised();
  });
  if (shows && shown >= 0) {
    std::fprintf(stderr, "\r\033[K");
  }
  if (!rendered) {
    complain(rendered.error().message);
    return exit_code::wrong_use;
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
    const bool was_asked = !options.score.empty() || !options.input.empty();
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

}  // namespace ressort
