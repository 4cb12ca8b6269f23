// Mapped and learned controllers, and clocks, on a real JACK server.
#include <jack/transport.h>

#include <cmath>
#include <deque>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <optional>

#include "tests/system/server.h"

namespace ressort::servers::controllers_test {
namespace {

using Bytes = std::vector<unsigned char>;

// A JACK client that sends MIDI when it is told to, and keeps what it receives: messages, and the
// frame at which sound begins after it was silent.
class Surface {
 public:
  Surface() {
    client_ = jack_client_open("surface", JackNoStartServer, nullptr);
    REQUIRE(client_ != nullptr);
    out_ = jack_port_register(client_, "out", JACK_DEFAULT_MIDI_TYPE, JackPortIsOutput, 0);
    in_ = jack_port_register(client_, "in", JACK_DEFAULT_MIDI_TYPE, JackPortIsInput, 0);
    sound_ = jack_port_register(client_, "sound", JACK_DEFAULT_AUDIO_TYPE, JackPortIsInput, 0);
    jack_set_process_callback(client_, &Surface::process, this);
    REQUIRE(jack_activate(client_) == 0);
    connect("surface:out", port(":midi_in$", JackPortIsInput).c_str(), out_);
  }
  ~Surface() { jack_client_close(client_); }

  void listen() { connect(port(":midi_out$", JackPortIsOutput).c_str(), "surface:in", in_); }
  void listen_to_sound() { connect("ressort:out_left", "surface:sound", sound_); }
  jack_client_t* client() { return client_; }

  // Sends messages at once, in order.
  void send(const std::vector<Bytes>& messages) {
    const std::lock_guard lock(mutex_);
    waiting_.insert(waiting_.end(), messages.begin(), messages.end());
  }
  // Sends ticks of a clock from now on, this many frames from one to the next; 0: none.
  void tick_every(double frames) {
    const std::lock_guard lock(mutex_);
    tick_frames_ = frames;
    next_tick_ = 0.0;
  }
  // The first tick since tick_every(), and the first sound since forget(), in frames of this client
  // and of JACK's transport.
  struct Times {
    std::optional<std::int64_t> tick;
    std::optional<std::int64_t> sound;
    std::int64_t transport = 0;  // at the sound
  };
  Times times() {
    const std::lock_guard lock(mutex_);
    return times_;
  }
  void forget() {
    const std::lock_guard lock(mutex_);
    times_ = {};
  }
  std::vector<Bytes> received() {
    const std::lock_guard lock(mutex_);
    return received_;
  }

 private:
  // Returns the first port with a name like this.
  std::string port(const char* pattern, unsigned long flags) {
    std::string name;
    REQUIRE(eventually([&] {
      const char** const names = jack_get_ports(client_, pattern, JACK_DEFAULT_MIDI_TYPE, flags);
      name = names != nullptr ? names[0] : "";
      jack_free(names);
      return !name.empty();
    }));
    return name;
  }
  void connect(const char* from, const char* to, jack_port_t* ours) {
    REQUIRE(eventually([&] {
      jack_connect(client_, from, to);
      return jack_port_connected(ours) > 0;
    }));
  }
  static int process(jack_nframes_t frames, void* self) {
    return static_cast<Surface*>(self)->block(frames);
  }
  int block(jack_nframes_t frames) {
    void* const out = jack_port_get_buffer(out_, frames);
    jack_midi_clear_buffer(out);
    const std::lock_guard lock(mutex_);
    for (; !waiting_.empty(); waiting_.pop_front()) {
      const Bytes& message = waiting_.front();
      if (jack_midi_event_write(out, 0, message.data(), message.size()) != 0) {
        break;  // full
      }
    }
    for (; tick_frames_ > 0.0 && next_tick_ < frames; next_tick_ += tick_frames_) {
      const unsigned char tick = 0xf8;
      times_.tick = times_.tick.value_or(frame_ + static_cast<std::int64_t>(next_tick_));
      jack_midi_event_write(out, static_cast<jack_nframes_t>(next_tick_), &tick, 1);
    }
    next_tick_ -= frames;
    const auto* const sound = static_cast<const float*>(jack_port_get_buffer(sound_, frames));
    for (jack_nframes_t i = 0; i < frames && !times_.sound; ++i) {
      if (std::fabs(sound[i]) > 1e-4f) {
        jack_position_t position;
        jack_transport_query(client_, &position);
        times_.sound = frame_ + i;
        times_.transport = static_cast<std::int64_t>(position.frame) + i;
      }
    }
    frame_ += frames;
    void* const in = jack_port_get_buffer(in_, frames);
    for (unsigned i = 0; i < jack_midi_get_event_count(in); ++i) {
      jack_midi_event_t event;
      jack_midi_event_get(&event, in, i);
      received_.emplace_back(event.buffer, event.buffer + event.size);
    }
    return 0;
  }

  jack_client_t* client_ = nullptr;
  jack_port_t* out_ = nullptr;
  jack_port_t* in_ = nullptr;
  jack_port_t* sound_ = nullptr;
  std::mutex mutex_;  // guards all below
  std::deque<Bytes> waiting_;
  std::vector<Bytes> received_;
  double tick_frames_ = 0.0;
  double next_tick_ = 0.0;  // frame of the next block
  std::int64_t frame_ = 0;
  Times times_;
};

Bytes turn(int number, int value) {
  return {0xb0, static_cast<unsigned char>(number), static_cast<unsigned char>(value)};
}

// The program with two presets of one mass, "one" and "two", which both have the parameter `k`.
class Desk {
 public:
  static constexpr double low = 0.05;
  static constexpr double high = low + 127 * 0.001;

  explicit Desk(const std::string& mapping, const Bytes& song = {},
                const std::vector<std::string>& more = {"-a", "jack"})
      : server_(256), folder_("/tmp/ressort-desk-" + std::to_string(getpid())) {
    for (const char* const kind : {"models", "presets"}) {
      std::filesystem::create_directories(folder_ + "/" + kind);
    }
    write("models/mass.mdl",
          "@k param 0.1\n@g ground 0.\n@m mass 1. 0. 0.\n@l springDamper @g @m k 0.0001\n"
          "@in1 frcInput @m\n@out1 posOutput @m\n");
    for (const char* const name : {"one", "two"}) {
      write("presets/" + std::string(name) + ".toml",
            "model = \"mass.mdl\"\n[parameters]\nk = { value = 0.1, range = [0.05, 0.177] }\n"
            "[[control]]\nfrom = \"note\"\nto = \"in1\"\nhow = \"impulse\"\n"
            "[[control]]\nfrom = \"cc74\"\nto = \"k\"\nrange = [0.05, 0.177]\n");
    }
    write("controllers.toml", mapping);
    arguments_ =
        program({"play", "one", "-u", "off", "--controllers", folder_ + "/controllers.toml"});
    arguments_.insert(arguments_.end(), more.begin(), more.end());
    if (!song.empty()) {
      write("song.mid", std::string(song.begin(), song.end()));
      arguments_.insert(arguments_.end(), {"--paused", "--midi", folder_ + "/song.mid"});
    }
    start();
  }
  ~Desk() {
    surface.reset();
    program_.reset();
    std::filesystem::remove_all(folder_);
  }

  // Starts the program and the surface, again if they run.
  void start() {
    surface.reset();
    program_.reset();
    program_.emplace(arguments_,
                     std::vector<std::pair<std::string, std::string>>{{"RESSORT_DATA", folder_}});
    REQUIRE(program_->says("one: 1 mass"));
    surface.emplace();
  }
  std::string mapping() const {
    std::ifstream file(folder_ + "/controllers.toml");
    return {std::istreambuf_iterator<char>(file), {}};
  }

  Child& child() { return *program_; }
  // Sends a console command. Returns whether the program answers with this text.
  bool answers(const std::string& command, const std::string& text) {
    program_->forget();
    program_->write(command + "\n");
    return program_->says(text);
  }
  double value() {
    program_->forget();
    program_->write("get k\n");
    REQUIRE(program_->says("k = "));
    const std::string& said = program_->said();
    return std::stod(said.substr(said.find("k = ") + 4));
  }
  // Returns whether the parameter soon has this value.
  bool reaches(double wanted) {
    return eventually([&] { return std::fabs(value() - wanted) < 1e-9; }, 5s);
  }
  bool stays(double wanted) {
    std::this_thread::sleep_for(200ms);
    return std::fabs(value() - wanted) < 1e-9;
  }

 private:
  void write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ + "/" + name) << text;
  }

  Server server_;
  std::string folder_;
  std::vector<std::string> arguments_;
  std::optional<Child> program_;

 public:
  std::optional<Surface> surface;
};

constexpr double at(double position) {
  return Desk::low + position * (Desk::high - Desk::low);
}

}  // namespace

TEST_CASE("encoders, pickup, pairs, NRPNs and buttons act through JACK", "[controllers]") {
  Desk desk(
      "[[controller]]\nfrom = \"cc20\"\nto = \"k\"\nmode = \"offset\"\n"
      "[[controller]]\nfrom = \"cc21\"\nto = \"k\"\npickup = true\n"
      "[[controller]]\nfrom = \"cc22\"\nto = \"k\"\nbits = 14\n"
      "[[controller]]\nfrom = \"nrpn 1234\"\nto = \"k\"\n"
      "[[controller]]\nfrom = \"cc23\"\nto = \"cc74\"\nmode = \"twos-complement\"\n"
      "[[controller]]\nfrom = \"cc24\"\nto = \"next\"\n"
      "[[controller]]\nfrom = \"note 36\"\nto = \"load 1\"\n"
      "[[controller]]\nfrom = \"cc25\"\nto = \"load TWO\"\n"
      "[[controller]]\nfrom = \"cc26\"\nto = \"previous\"\n");
  Surface& surface = *desk.surface;

  // 50 ticks down from 0.1 to 0.05, then 127 ticks up to the end, one by one.
  surface.send(std::vector<Bytes>(50, turn(20, 63)));
  CHECK(desk.reaches(Desk::low));
  for (int tick = 1; tick <= 127; ++tick) {
    surface.send({turn(20, 65)});
    if (tick % 16 == 0) {
      CHECK(desk.reaches(Desk::low + 0.001 * tick));
    }
  }
  CHECK(desk.reaches(Desk::high));
  CHECK(desk.answers("set k 0.1", "k = 0.1"));
  CHECK(desk.stays(0.1));  // until the audio thread has it
  surface.send({turn(20, 65)});
  CHECK(desk.reaches(0.101));

  // 0.101 is 51 steps from the lower end.
  surface.send({turn(21, 10), turn(21, 40)});
  CHECK(desk.stays(0.101));
  surface.send({turn(21, 60), turn(21, 61)});
  CHECK(desk.reaches(at(61 / 127.0)));

  for (const int n : {0, 8191, 8192, 8193, 16383}) {
    surface.send({turn(22, n >> 7), turn(54, n & 0x7f)});
    CHECK(desk.reaches(at(n / 16383.0)));
  }

  surface.send({turn(99, 9), turn(98, 82), turn(6, 32), turn(38, 5)});
  CHECK(desk.reaches(at((32 * 128 + 5) / 16383.0)));

  // By the preset's own controller, from the present value.
  CHECK(desk.answers("set k 0.1", "k = 0.1"));
  CHECK(desk.stays(0.1));  // until the audio thread has it
  surface.send({turn(23, 127), turn(23, 127)});
  CHECK(desk.reaches(0.098));

  desk.child().forget();
  surface.send({turn(24, 127), turn(24, 0)});
  CHECK(desk.child().says("next: two"));
  CHECK(desk.reaches(0.1));
  desk.child().forget();
  surface.send({{0x90, 36, 100}, {0x80, 36, 0}});
  CHECK(desk.child().says("load 1: one"));
  surface.send({turn(25, 127)});
  CHECK(desk.child().says("load TWO: TWO"));
  desk.child().forget();
  surface.send({turn(26, 127), turn(26, 0)});
  CHECK(desk.child().says("previous: one"));
}

TEST_CASE("a learned knob moves the same parameter of the next preset", "[controllers]") {
  Desk desk("");
  Surface& surface = *desk.surface;
  CHECK(desk.answers("learn k", "turn the knob"));
  surface.send({turn(30, 10)});
  CHECK(desk.child().says("controller 30 now controls k"));
  surface.send({turn(30, 127)});
  CHECK(desk.reaches(Desk::high));
  CHECK(desk.answers("load two", "two: 1 mass"));
  CHECK(desk.reaches(0.1));
  surface.send({turn(30, 0)});
  CHECK(desk.reaches(Desk::low));
  CHECK(desk.answers("unlearn k", "1 controller"));
  surface.send({turn(30, 127)});
  CHECK(desk.stays(Desk::low));
}

// The knob turns right and back while it is learned, and then moves by the steps of its kind.
TEST_CASE("learn recognises a knob's kind and keeps it for the next start", "[controllers]") {
  const std::string comment = "# the desk at home\n";
  Desk desk(comment);
  const auto learn = [&](const std::vector<Bytes>& messages, const std::string& answer) {
    CHECK(desk.answers("learn k", "turn the knob"));
    std::this_thread::sleep_for(100ms);  // until the audio thread hears controllers
    for (const Bytes& message : messages) {
      desk.surface->send({message});
    }
    CHECK(desk.child().says(answer + " now controls k"));
    CHECK(desk.answers("set k 0.1", "k = 0.1"));
    CHECK(desk.stays(0.1));
  };
  const auto turned = [](int number, int up, int down) {
    std::vector<Bytes> messages(6, turn(number, up));
    messages.insert(messages.end(), 6, turn(number, down));
    return messages;
  };
  learn(turned(40, 1, 65), "controller 40, an encoder (sign-magnitude),");
  desk.surface->send({turn(40, 65), turn(40, 65)});
  CHECK(desk.reaches(0.098));
  learn(turned(41, 1, 127), "controller 41, an encoder (twos-complement),");
  desk.surface->send({turn(41, 127), turn(41, 127)});
  CHECK(desk.reaches(0.098));
  std::vector<Bytes> pair;
  std::vector<Bytes> nrpn;
  for (int value = 9000; value < 9900; value += 60) {
    pair.insert(pair.end(), {turn(20, value >> 7), turn(52, value & 127)});
    nrpn.insert(nrpn.end(),
                {turn(99, 9), turn(98, 82), turn(6, value >> 7), turn(38, value & 127)});
  }
  learn(pair, "controller 20 with 14 bits");
  desk.surface->send({turn(20, 8193 >> 7), turn(52, 8193 & 127)});
  CHECK(desk.reaches(at(8193 / 16383.0)));
  learn(nrpn, "NRPN 1234 with 14 bits");
  desk.surface->send({turn(99, 9), turn(98, 82), turn(6, 64), turn(38, 1)});
  CHECK(desk.reaches(at(8193 / 16383.0)));
  learn(turned(42, 65, 63), "controller 42, an encoder (offset),");
  CHECK(desk.mapping() == comment +
                              "\n[[controller]]\nfrom = \"cc42\"\nto = \"k\"\n"
                              "mode = \"offset\"\n");
  desk.start();
  desk.surface->send({turn(42, 65)});
  CHECK(desk.reaches(0.101));
  CHECK(desk.answers("unlearn k", "1 controller"));
  CHECK(desk.mapping() == comment);
  desk.surface->send({turn(42, 65)});
  CHECK(desk.stays(0.101));
}

TEST_CASE("a controller gets the values that others set, and those of a new preset",
          "[controllers]") {
  Desk desk("[[controller]]\nfrom = \"cc20\"\nto = \"k\"\nsend = true\nchannel = 3\n");
  desk.surface->listen();
  const auto received = [&](int value) {
    const Bytes wanted = {0xb2, 20, static_cast<unsigned char>(value)};
    return eventually(
        [&] {
          const auto all = desk.surface->received();
          return !all.empty() && all.back() == wanted;
        },
        5s);
  };
  CHECK(desk.answers("set k 0.15", "k = 0.15"));
  CHECK(received(100));
  CHECK(desk.answers("load two", "two: 1 mass"));
  CHECK(received(50));
  const std::size_t before = desk.surface->received().size();
  desk.surface->send({{0xb2, 20, 77}});
  CHECK(desk.reaches(0.127));
  CHECK(desk.surface->received().size() == before);  // its own value does not come back
}

// The sound goes nowhere, and MIDI goes through RtMidi.
TEST_CASE("a controller gets values through RtMidi too", "[controllers]") {
  Desk desk("[[controller]]\nfrom = \"cc20\"\nto = \"k\"\nsend = true\n", {},
            {"-a", "dummy", "-m", "jack"});
  desk.surface->listen();
  // JACK may connect the ports a few periods after it says so.
  CHECK(eventually([&] {
    desk.answers("set k 0.1", "k = 0.1");
    desk.answers("set k 0.15", "k = 0.15");
    std::this_thread::sleep_for(100ms);
    const auto all = desk.surface->received();
    return !all.empty() && all.back() == turn(20, 100);
  }));
}

TEST_CASE("the tempo is that of a MIDI clock or of JACK's transport", "[controllers]") {
  Desk desk("");
  const auto shows = [&](const std::string& text) {
    return eventually(
        [&] {
          return desk.answers("status", "clock   ") &&
                 desk.child().said().find("clock   " + text) != std::string::npos;
        },
        5s);
  };
  CHECK(shows("none"));
  desk.surface->tick_every(48000.0 * 60.0 / (24.0 * 133.0));
  CHECK(shows("133.0 beats per minute"));
  desk.surface->tick_every(0.0);
  const auto fill = [](jack_transport_state_t, jack_nframes_t, jack_position_t* position, int,
                       void*) {
    position->valid = JackPositionBBT;
    position->bar = position->beat = 1;
    position->tick = 0;
    position->beats_per_bar = position->beat_type = 4.0f;
    position->ticks_per_beat = 1920.0;
    position->beats_per_minute = 97.5;
  };
  REQUIRE(jack_set_timebase_callback(desk.surface->client(), 0, fill, nullptr) == 0);
  jack_transport_start(desk.surface->client());
  CHECK(shows("97.5 beats per minute"));
}

// The song has one note, two beats from its start, at 120 beats per minute. By a wrong tempo or
// place it would begin at least 9600 frames too early or too late. A machine that is busy with
// other tests delays a period by up to half of that.
TEST_CASE("a MIDI clock and JACK's transport start, stop and move the song", "[controllers]") {
  const Bytes song = {'M',  'T', 'h', 'd',  0,    0,   0,  6, 0,    0,    0,    1,
                      0,    96,  'M', 'T',  'r',  'k', 0,  0, 0,    13,   0x81, 64,
                      0x90, 60,  100, 0x60, 0x80, 60,  64, 0, 0xff, 0x2f, 0};
  Desk desk("", song);
  Surface& surface = *desk.surface;
  surface.listen_to_sound();
  CHECK(desk.answers("song tempo clock", "by the clock"));
  constexpr std::int64_t most_error = 4800;
  const auto begins = [&](std::int64_t wanted) {
    REQUIRE(eventually([&] { return surface.times().sound.has_value(); }));
    const Surface::Times times = surface.times();
    const std::int64_t heard = times.tick ? *times.sound - *times.tick : times.transport;
    INFO(heard << " instead of " << wanted);
    CHECK(std::abs(heard - wanted) <= most_error);
  };
  const auto pauses = [&] {
    return eventually([&] {
      return desk.answers("song loop", " of 1.5 s") &&
             desk.child().said().find("paused") != std::string::npos;
    });
  };
  const auto silence = [&] {
    desk.answers("panic", "");
    std::this_thread::sleep_for(300ms);
    surface.forget();
  };
  // 800 frames from tick to tick are 150 beats per minute.
  surface.send({{0xfa}});
  surface.tick_every(800.0);
  begins(48 * 800);
  surface.send({{0xfc}});
  surface.tick_every(0.0);
  CHECK(pauses());
  silence();
  surface.send({{0xf2, 4, 0}, {0xfb}});  // four sixteenths, then continue
  surface.tick_every(800.0);
  begins(24 * 800);
  surface.send({{0xfc}});
  surface.tick_every(0.0);
  silence();
  jack_transport_locate(surface.client(), 24000);
  jack_transport_start(surface.client());
  begins(48000);
  jack_transport_stop(surface.client());
  CHECK(pauses());
  silence();
  jack_transport_locate(surface.client(), 36000);
  jack_transport_start(surface.client());
  begins(48000);
}

}  // namespace ressort::servers::controllers_test
