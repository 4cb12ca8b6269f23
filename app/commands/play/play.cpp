// The command play.
#include <signal.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <future>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "app/commands/commands.h"
#include "app/commands/flight/flight_player.h"
#include "app/commands/play/announcer.h"
#include "app/commands/play/kept_stage.h"
#include "app/commands/smf/midi_player.h"
#include "app/control/nsm/nsm_client.h"
#include "app/control/terminal.h"
#include "app/devices/midi_input.h"
#include "app/realtime/thread_pool.h"
#include "app/say.h"
#include "app/session/load_progress.h"
#include "app/session/timing.h"
#include "app/session/wisdom.h"
#include "app/text.h"
#include "core/ranges.h"

namespace ressort::commands {
namespace {

using namespace std::chrono_literals;

// Blocks the signals in all threads, which inherit the mask, so that only main waits for them.
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

// Exits the process if a regular shutdown takes longer than 0.9 s, for example in a library.
void limit_shutdown() {
  signal(SIGALRM, [](int) { _exit(exit_code::done); });
  const itimerval time{{}, {0, 900'000}};
  setitimer(ITIMER_REAL, &time, nullptr);
}

// Prints an error in the arguments or the input. Returns its exit code.
int refuse(const std::string& message) {
  complain(message);
  return exit_code::wrong_use;
}

// All parts of the playing program, declared in reverse order of their shutdown.
class Player {
 public:
  explicit Player(const PlayOptions& options) : options_(options), signals_(block_signals()) {}

  int run() {
    if (const auto allowed = allowed_senders(options_.osc); options_.osc.port != 0 && !allowed) {
      return refuse(allowed.error().message);
    }
    if (is_midi_file_name(options_.name)) {  // MODEL may be a MIDI file
      options_.midi = std::exchange(options_.name, PlayOptions().name);
    }
    std::optional<MidiFile> song;
    if (is_midi_file_name(options_.midi)) {
      auto read = read_midi_file(options_.midi, options_.keys.song_channels);
      if (!read) {
        return refuse(read.error().message);
      }
      song = *std::move(read);
      for (const std::string& warning : song->warnings) {
        complain("warning: " + warning);
      }
      options_.midi = PlayOptions().midi;
    }
    if (is_flight_name(options_.name)) {
      return play_flight();
    }
    auto controllers = read_controllers();
    if (!controllers) {
      return refuse(controllers.error().message);
    }
    options_.device.sends_midi = std::ranges::any_of(
        *controllers, [](const ControllerSetting& setting) { return setting.input.sends; });
    if (const int failure = join_manager(); failure != exit_code::done || has_called_off_) {
      return failure;
    }
    LoadProgress news(options_.name, [this](const std::string& text) { voice_.say(text); });
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
      return refuse(scene.error().message);
    }
    options_.device.outputs = std::max(2, output_count(scene->network));
    if (options_.threads > 1) {
      const auto threads = static_cast<std::size_t>(options_.threads);
      if (threads > core_count()) {
        voice_.say("--threads " + std::to_string(threads) + ": using " +
                   std::to_string(core_count()) + ", the number of cores of this machine");
      }
      helpers_ = std::make_unique<ThreadPool>(std::min(threads, core_count()), &process_.clock);
    }
    if (const int failure = open_device(); failure != exit_code::done) {
      return failure;
    }
    session_ =
        std::make_unique<Session>(process_,
                                  SessionOptions{.compile = {.rate_hz = device_.rate_hz,
                                                             .rescale = options_.rescale,
                                                             .voices = options_.voices,
                                                             .share = options_.share,
                                                             .precision = options_.precision,
                                                             .method = options_.method,
                                                             .budget = options_.budget,
                                                             .executor = helpers_.get()},
                                                 .gain = std::pow(10.0, options_.gain_db / 20.0),
                                                 .third = options_.third,
                                                 .keys = options_.keys,
                                                 .controllers = *std::move(controllers),
                                                 .controllers_path = mapping_path(),
                                                 .watch = options_.watch,
                                                 .keeps_flights = true,
                                                 .time = cpu_time_ns,
                                                 .wisdom_path = wisdom_path()},
                                  [this](const std::string& news) { report(news); });
    connect_session();
    if (options_.panel.port != 0) {
      session_->on_engine([this](Engine& engine, const Network& network) {
        return motion_.watch(engine, network);
      });
    }
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
      return refuse(loaded.error().message);
    }
    greet(**loaded);
    if (options_.device.connect && device_kind_ != "jack") {
      voice_.say("--connect has no effect without JACK");
    }
    if (options_.device.device != AudioOptions{}.device && device_kind_ != "alsa") {
      voice_.say("--device has no effect without ALSA");
    }
    open_osc();
    open_panel();
    open_midi();
    if (song) {
      voice_.say((options_.is_paused ? "paused: " : "playing ") +
                 counted(song->messages.size(), "message", "messages") + " of MIDI, " +
                 fixed(song->length_s, 1) + " s");
      session_->song().begin(song->length_s, song->tempos, options_.is_paused);
      player_.emplace(*std::move(song), door_, session_->song());
    } else if (options_.is_paused) {
      voice_.say("--paused has no effect without --midi");
    }
    return converse();
  }

  ~Player() {
    if (session_) {
      session_->end();  // wakes commands that are waiting for a load
    }
    voice_.set_terminal(nullptr);
    terminal_.reset();
    console_.reset();
    {
      const std::lock_guard lock(panel_mutex_);
      panel_.reset();
    }
    osc_.reset();
    player_.reset();
    midi_.reset();
    if (device_.running) {
      fade_out();
    }
    // The session's worker may still call the device, but the device never calls the session.
    session_.reset();
    device_ = AudioDevice();
  }

 private:
  std::string mapping_path() const {
    return options_.controllers.empty() ? controllers_path() : options_.controllers;
  }

  // Reads the mapping of controllers. All errors are in one message.
  Result<std::vector<ControllerSetting>> read_controllers() const {
    const std::string path = mapping_path();
    std::error_code error;
    if (options_.controllers.empty() && !std::filesystem::exists(path, error)) {
      return std::vector<ControllerSetting>();
    }
    const auto text = read_text(path, max_preset_bytes);
    if (!text) {
      return text.error();
    }
    ParsedControllers read = parse_controllers(*text);
    if (read.ok()) {
      return std::move(read.rows);
    }
    return Error{joined(read.errors, "\n", [&](const Error& wrong) {
      return with_source(finding_of(path, *text, wrong));
    })};
  }

  int open_device() {
    auto device = open_audio(options_.audio, process_, options_.device);
    if (!device) {
      complain(device.error().message);
      return exit_code::audio_lost;
    }
    device_ = *std::move(device);
    device_kind_ = device_.kind;
    raise_helpers();
    return exit_code::done;
  }

  // At a lower priority than the audio thread, which takes over late tasks.
  void raise_helpers() {
    if (helpers_ && device_.priority > 1) {
      helpers_->set_priority(device_.priority - 1);
    }
  }

  // Reopens a device of the same kind; returns false if it is not available.
  bool reopen_device(const std::string& kind) {
    auto device = open_audio(kind, process_, options_.device);
    if (!device) {
      return false;
    }
    {
      const std::lock_guard lock(device_mutex_);
      device_ = *std::move(device);
      device_.set_audio_inputs(audio_inputs_);
      raise_helpers();
    }
    session_->set_backend(device_.description, true);
    session_->set_rate(device_.rate_hz);
    return true;
  }

  // Waits for the session manager to name the session, if it still runs.
  int join_manager() {
    const char* const url = std::getenv("NSM_URL");
    if (url == nullptr || *url == '\0') {
      return exit_code::done;
    }
    auto manager = NsmClient::announce(
        url, [this](const NsmProject& project) { return open_project(project); },
        [this] { return save_project(); },
        [this] { return session_ ? current_state(*session_) : std::string(); });
    if (!manager) {
      return refuse(manager.error().message);
    }
    manager_ = *std::move(manager);
    const auto end = std::chrono::steady_clock::now() + 5s;
    while (project_.path.empty() && !is_called_off(20ms)) {
      manager_->poll();
      const bool is_late = std::chrono::steady_clock::now() > end && manager_->manager().empty();
      if (is_late || !manager_->refusal().empty()) {
        voice_.say("playing without the session manager at " + std::string(url) + ": " +
                   (is_late ? "no answer" : manager_->refusal()));
        manager_.reset();
        return exit_code::done;
      }
    }
    return exit_code::done;
  }

  // Before the sound starts: selects the scene. Later: replaces the current state.
  Result<Done> open_project(const NsmProject& project) {
    auto stage = read_saved_state(project.path);
    if (!stage) {
      return stage.error();
    }
    const bool is_first = project_.path.empty();
    if (!is_first) {
      const auto loaded =
          session_->load_and_wait(stage->scene.empty() ? first_name_ : stage->scene);
      if (!loaded) {
        return loaded.error();
      }
    } else {
      first_name_ = options_.name;
      options_.name = stage->scene.empty() ? options_.name : stage->scene;
    }
    project_ = project;
    options_.device.client_name = project.client_id;
    options_.device.wiring = Wiring();
    for (const Cable& cable : stage->cables) {
      options_.device.wiring.add_missing(cable);
    }
    tuning_ = std::move(stage->tuning);
    if (!is_first) {
      {
        const std::lock_guard lock(device_mutex_);
        device_ = AudioDevice();
      }
      if (!reopen_device(device_kind_)) {
        return Error{"cannot reopen the audio device"};
      }
      tune_as_kept();
    }
    return Done{};
  }

  Result<Done> save_project() {
    if (!session_) {
      return Done{};
    }
    const Wiring wiring = device_.wiring ? device_.wiring() : options_.device.wiring;
    return save_state_to(project_.path, *session_, wiring.missing());
  }

  void tune_as_kept() {
    std::string line = "tuning";
    for (const std::string& path : tuning_) {
      line += " \"" + path + "\"";
    }
    console_->run_line(tuning_.empty() ? "tuning off" : line);
  }

  // Renders a flight completely and then plays it.
  int play_flight() {
    const auto player = FlightPlayer::open(options_.name, flight_heard_s);
    if (!player) {
      return refuse(player.error().message);
    }
    for (const std::string& warning : player->warnings()) {
      voice_.say(warning);
    }
    const auto tape = tape_of(*player, [this](double) { return !is_called_off(0ms); });
    if (has_called_off_) {
      return exit_code::done;
    }
    if (!tape) {
      return refuse(tape.error().message);
    }
    options_.device.outputs = static_cast<int>(std::max<std::size_t>(2, tape->channels));
    options_.device.rate_hz = player->rate_hz();
    if (const int failure = open_device(); failure != exit_code::done) {
      return failure;
    }
    if (device_.rate_hz != player->rate_hz()) {
      complain("the flight is at " + fixed(player->rate_hz(), 0) + " Hz, but the device is " +
               device_.description + "; use -a alsa or -a dummy, or render it to a file");
      return exit_code::wrong_use;
    }
    voice_.say(options_.name + ": the last " +
               fixed(static_cast<double>(tape->frames()) / player->rate_hz(), 1) + " s on " +
               device_.description);
    tape_ = std::make_unique<const SampleTape>(*tape);
    process_.tape.set(tape_.get());
    while (!process_.is_tape_over.is_raised() && !is_called_off(50ms) && !device_.is_lost()) {
      device_.tick();
    }
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
          "no permission for real-time priority, so the sound may drop out; to get it, run\n"
          "  echo '@audio - rtprio 95' | sudo tee /etc/security/limits.d/ressort.conf\n"
          "  sudo usermod -aG audio $USER\n"
          "and log in again");
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

  // Plays on without OSC if the port is taken.
  void open_osc() {
    const auto hear = [this](const std::string& news) { report(news); };
    if (options_.osc.port != 0) {
      auto osc = OscServer::open(options_.osc, process_, *session_, hear);
      if (osc) {
        osc_ = *std::move(osc);
      } else {
        voice_.say("playing without OSC: " + osc.error().message);
      }
    } else if (options_.osc.reply_port != 0 || !options_.osc.allow.empty()) {
      voice_.say("--osc-reply and --osc-allow have no effect with -u off");
    }
    if (osc_ == nullptr) {
      if (auto osc = OscServer::open_without_udp(process_, *session_, hear);
          osc && options_.panel.port != 0) {
        osc_ = *std::move(osc);  // used by the panel
      }
      return;
    }
    voice_.say("OSC on " + options_.osc.bind_address + " port " + std::to_string(osc_->port()) +
               ", " + osc_->access());
  }

  void open_panel() {
    if (options_.panel.port == 0 || osc_ == nullptr) {
      return;
    }
    auto panel = WebPanel::open(options_.panel, process_, *session_, motion_, *osc_);
    if (!panel) {
      voice_.say("playing without the panel: " + panel.error().message);
      return;
    }
    voice_.say("panel: " + (*panel)->address());
    if ((*panel)->is_for_all()) {
      voice_.say(
          "anyone with this address and its token can play and load; the connection is not "
          "encrypted");
    }
    const std::lock_guard lock(panel_mutex_);
    panel_ = *std::move(panel);
  }

  // On any thread.
  void report(const std::string& news) {
    voice_.say(news);
    const std::lock_guard lock(panel_mutex_);
    if (panel_) {
      panel_->show_message(news);
    }
  }

  void open_midi() {
    const bool wants_jack = options_.midi == "jack" && !device_.has_midi;
    const bool wants_alsa =
        options_.midi == "alsa" || (options_.midi == "auto" && !device_.has_midi);
    if (!wants_jack && !wants_alsa) {
      if (options_.device.sends_midi && !device_.has_midi) {
        voice_.say("'send' in the mapping of controllers needs MIDI; nothing is sent");
      }
      return;
    }
    auto midi =
        MidiInput::open(wants_jack ? MidiApi::jack : MidiApi::alsa, options_.device.client_name,
                        true, door_, options_.device.sends_midi ? &process_ : nullptr);
    if (midi) {
      midi_ = *std::move(midi);
    } else {
      voice_.say(midi.error().message);
    }
  }

  int converse() {
    console_ = std::make_unique<Console>(process_, *session_, say,
                                         [this](const std::string& news) { voice_.say(news); });
    if (!tuning_.empty()) {
      tune_as_kept();
    }
    if (!options_.script.empty()) {
      auto script =
          std::async(std::launch::async, [this] { return console_->run_script(options_.script); });
      wait_for(script);
      const auto ran = script.get();
      if (has_called_off_) {
        return exit_code::done;
      }
      if (!ran) {
        return refuse(ran.error().message);
      }
      if (console_->has_quit()) {
        return exit_code::done;
      }
    }
    if (!options_.no_console) {
      if (isatty(STDIN_FILENO) != 0) {
        voice_.say("type 'help' for the commands, 'keys' to play, 'quit' to leave");
      }
      terminal_ = std::make_unique<Terminal>(*console_, [this] { quit_.raise(); });
      voice_.set_terminal(terminal_.get());
    }
    return wait();
  }

  // Waits for a signal, at most this long.
  bool is_called_off(std::chrono::milliseconds patience) {
    const timespec time{0, std::chrono::nanoseconds(patience).count()};
    if (!has_called_off_ && sigtimedwait(&signals_, nullptr, &time) > 0) {
      has_called_off_ = true;
      limit_shutdown();
    }
    return has_called_off_;
  }

  // Waits for another thread or for a signal, which ends the session and its load.
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
    const auto patience = player_ || options_.device.sends_midi ? 5ms : 50ms;
    while (!quit_.is_raised()) {
      if (is_called_off(patience)) {
        return exit_code::done;
      }
      if (manager_) {
        manager_->poll();
      }
      if (device_.is_lost()) {
        voice_.say("the connection to " + device_.description + " is lost");
        if (options_.exit_on_loss) {
          return exit_code::audio_lost;
        }
        if (!regain()) {
          return exit_code::done;
        }
      }
      session_->song().clock(process_.meters(), process_.clock.read());
      if (options_.no_console && player_ && session_->song().is_over() && has_fallen_silent()) {
        return exit_code::done;
      }
      device_.tick();
      if (midi_) {
        midi_->send();
      }
      if (std::chrono::steady_clock::now() >= next_tick) {
        next_tick += 1s;
        if (midi_) {
          midi_->tick();
        }
      }
    }
    return exit_code::done;
  }

  // After a MIDI file: returns true after half a second of silence, or after a minute.
  bool has_fallen_silent() {
    constexpr double quiet_db = -80.0;
    const auto now = std::chrono::steady_clock::now();
    song_ended_ = song_ended_.value_or(now);
    if (session_->status().peak_db > quiet_db || !quiet_since_) {
      quiet_since_ = now;
    }
    return now - *quiet_since_ > 500ms || now - *song_ended_ > 60s;
  }

  // Waits until the same backend is available again; returns false if the user quits first.
  bool regain() {
    const std::string kind = device_.kind;
    options_.device.wiring = device_.wiring();
    session_->set_backend("none; waiting for " + device_.description, false);
    {
      const std::lock_guard lock(device_mutex_);
      device_ = AudioDevice();
    }
    voice_.say("waiting for it to restart; 'quit' or Ctrl-C exits");
    while (!quit_.is_raised()) {
      if (is_called_off(200ms)) {
        return false;
      }
      if (manager_) {
        manager_->poll();
      }
      if (!reopen_device(kind)) {
        continue;
      }
      voice_.say("playing again on " + device_.description);
      return true;
    }
    return false;
  }

  // Fades out, to avoid a click.
  void fade_out() {
    const TimedEvent panic{Event{.kind = EventKind::panic}};
    process_.send(process_.from_console, {&panic, 1});
    std::this_thread::sleep_for(50ms);
  }

  PlayOptions options_;
  sigset_t signals_;
  bool has_called_off_ = false;  // set by a signal
  MotionFeed motion_{process_};
  std::unique_ptr<const SampleTape> tape_;  // outlives the process that plays it
  std::unique_ptr<ThreadPool> helpers_;     // outlives the engines; null: the audio thread is alone
  Process process_{48000.0, true, monotonic_ns};
  Announcer voice_;
  Flag quit_;
  MidiSink door_{process_};
  std::mutex device_mutex_;  // between main and the session's worker
  AudioDevice device_;
  std::string device_kind_;  // kind of the open device
  int audio_inputs_ = 0;
  std::unique_ptr<NsmClient> manager_;  // null: none
  NsmProject project_;                  // the open one
  std::string first_name_;              // played if the session is new
  std::vector<std::string> tuning_;     // tuning files of the session
  std::unique_ptr<Session> session_;
  std::unique_ptr<OscServer> osc_;
  std::mutex panel_mutex_;  // guards the panel's pointer
  std::unique_ptr<WebPanel> panel_;
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
  static_cast<void>(flush_messages());
  return code;
}

}  // namespace ressort::commands
