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

// A JACK client that sends MIDI when it is told to, and keeps what it receives.
class Surface {
 public:
  Surface() {
    client_ = jack_client_open("surface", JackNoStartServer, nullptr);
    REQUIRE(client_ != nullptr);
    out_ = jack_port_register(client_, "out", JACK_DEFAULT_MIDI_TYPE, JackPortIsOutput, 0);
    in_ = jack_port_register(client_, "in", JACK_DEFAULT_MIDI_TYPE, JackPortIsInput, 0);
    jack_set_process_callback(client_, &Surface::process, this);
    REQUIRE(jack_activate(client_) == 0);
    connect("surface:out", "ressort:midi_in", out_);
  }
  ~Surface() { jack_client_close(client_); }

  void listen() { connect("ressort:midi_out", "surface:in", in_); }
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
  std::vector<Bytes> received() {
    const std::lock_guard lock(mutex_);
    return received_;
  }

 private:
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
      jack_midi_event_write(out, static_cast<jack_nframes_t>(next_tick_), &tick, 1);
    }
    next_tick_ -= frames;
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
  std::mutex mutex_;  // guards all below
  std::deque<Bytes> waiting_;
  std::vector<Bytes> received_;
  double tick_frames_ = 0.0;
  double next_tick_ = 0.0;  // frame of the next block
};

Bytes turn(int number, int value) {
  return {0xb0, static_cast<unsigned char>(number), static_cast<unsigned char>(value)};
}

// The program with two presets of one mass, "one" and "two", which both have the parameter `k`.
class Desk {
 public:
  static constexpr double low = 0.05;
  static constexpr double high = low + 127 * 0.001;

  explicit Desk(const std::string& mapping)
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
    program_.emplace(program({"play", "one", "-a", "jack", "-u", "off", "--controllers",
                              folder_ + "/controllers.toml"}),
                     std::vector<std::pair<std::string, std::string>>{{"RESSORT_DATA", folder_}});
    REQUIRE(program_->says("one: 1 mass"));
    surface.emplace();
  }
  ~Desk() {
    surface.reset();
    program_.reset();
    std::filesystem::remove_all(folder_);
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
  CHECK(desk.answers("learn k", "move the knob"));
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

}  // namespace ressort::servers::controllers_test
