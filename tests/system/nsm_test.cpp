// The protocol of a session manager: announce, open, save, switch, close, and everything is
// restored.
#include <lo/lo.h>

#include <filesystem>
#include <fstream>
#include <map>

#include "tests/system/server.h"

namespace ressort::servers::nsm_test {

namespace {

namespace fs = std::filesystem;

constexpr const char* osc_port = "19779";

struct Folder {
  fs::path path = fs::temp_directory_path() / ("ressort-nsm-" + std::to_string(getpid()));
  Folder() { fs::create_directories(path); }
  ~Folder() { fs::remove_all(path); }
  std::string file(const std::string& name) const { return (path / name).string(); }
};

// The manager.
class Manager {
 public:
  Manager() : server_(lo_server_new(nullptr, nullptr)) {
    REQUIRE(server_ != nullptr);
    lo_server_add_method(server_, nullptr, nullptr, &Manager::heard, this);
  }
  ~Manager() {
    if (client_ != nullptr) {
      lo_address_free(client_);
    }
    lo_server_free(server_);
  }
  std::string url() const {
    return "osc.udp://localhost:" + std::to_string(lo_server_get_port(server_)) + "/";
  }
  // Waits for a message with this address and first text. Returns all its texts.
  bool hears(const std::string& address, const std::string& first, std::string* all = nullptr) {
    return eventually([&] {
      lo_server_recv_noblock(server_, 20);
      for (std::size_t i = 0; i < said_.size(); ++i) {
        if (said_[i].first == address && said_[i].second.starts_with(first)) {
          if (all != nullptr) {
            *all = said_[i].second;
          }
          said_.erase(said_.begin() + static_cast<std::ptrdiff_t>(i));
          return true;
        }
      }
      return false;
    });
  }
  void welcome() {
    lo_send_from(client_, server_, LO_TT_IMMEDIATE, "/reply", "ssss", "/nsm/server/announce",
                 "Well hello", "Test Manager", ":server-control:");
  }
  void open(const std::string& path, const std::string& id) {
    lo_send_from(client_, server_, LO_TT_IMMEDIATE, "/nsm/client/open", "sss", path.c_str(),
                 "session", id.c_str());
  }
  void save() { lo_send_from(client_, server_, LO_TT_IMMEDIATE, "/nsm/client/save", ""); }

 private:
  static int heard(const char* path, const char* types, lo_arg** values, int count, lo_message said,
                   void* self) {
    auto& manager = *static_cast<Manager*>(self);
    std::string words;
    for (int i = 0; i < count; ++i) {
      words += i > 0 ? " " : "";
      words += types[i] == 's' ? std::string(&values[i]->s) : std::to_string(values[i]->i);
    }
    manager.said_.emplace_back(path, words);
    if (std::string(path) == "/nsm/server/announce") {
      const lo_address from = lo_message_get_source(said);
      manager.client_ = lo_address_new(lo_address_get_hostname(from), lo_address_get_port(from));
    }
    return 0;
  }

  lo_server server_;
  lo_address client_ = nullptr;
  std::vector<std::pair<std::string, std::string>> said_;
};

bool has_port(const std::string& name) {
  jack_client_t* const client = jack_client_open("knock", JackNoStartServer, nullptr);
  REQUIRE(client != nullptr);
  const bool found = jack_port_by_name(client, name.c_str()) != nullptr;
  jack_client_close(client);
  return found;
}

}  // namespace

TEST_CASE("A session manager restores everything", "[nsm]") {
  const Server server(256);
  const Folder folder;
  { std::ofstream(folder.file("two.scl")) << "two steps\n2\n600.\n2/1\n"; }
  const auto start = [&](const Manager& manager) {
    return std::make_unique<Child>(
        program({"play", "PolyTriangle", "-a", "jack", "-u", osc_port}),
        std::vector<std::pair<std::string, std::string>>{{"NSM_URL", manager.url()}});
  };
  const std::string first = folder.file("first.nABC");
  {
    Manager manager;
    auto play = start(manager);
    std::string said;
    REQUIRE(manager.hears("/nsm/server/announce", "ressort", &said));
    CHECK(said == "ressort :switch:dirty: ressort 1 1 " + std::to_string(play->pid()));
    // The program waits for the manager and uses its name.
    manager.welcome();
    std::this_thread::sleep_for(300ms);
    CHECK_FALSE(has_port("ressort:out_left"));
    manager.open(first, "ressort.nABC");
    REQUIRE(manager.hears("/reply", "/nsm/client/open"));
    REQUIRE(play->says("on JACK"));
    CHECK_FALSE(has_port("ressort:out_left"));
    REQUIRE(has_port("ressort.nABC:out_left"));
    Neighbour neighbour;
    REQUIRE(neighbour.connect("ressort.nABC:out_left", "neighbour:left"));
    play->write("load BowedString\n");
    REQUIRE(play->says("loaded in"));
    play->write("load PolyTriangle\nset m_K 0.0625\ntuning \"" + folder.file("two.scl") + "\"\n");
    REQUIRE(play->says("m_K = 0.0625"));
    CHECK(manager.hears("/nsm/client/is_dirty", ""));
    std::this_thread::sleep_for(1500ms);  // so that the connection is seen
    manager.save();
    REQUIRE(manager.hears("/reply", "/nsm/client/save"));
    CHECK(manager.hears("/nsm/client/is_clean", ""));
    // Another project under another name has nothing of the first.
    manager.open(folder.file("second.nDEF"), "ressort.nDEF");
    REQUIRE(manager.hears("/reply", "/nsm/client/open"));
    CHECK_FALSE(has_port("ressort.nABC:out_left"));
    CHECK(has_port("ressort.nDEF:out_left"));
    play->forget();
    play->write("get m_K\n");
    REQUIRE(play->says("m_K = 0.015"));
    std::this_thread::sleep_for(1500ms);
    CHECK_FALSE(neighbour.is_connected("ressort.nDEF:out_left", "neighbour:left"));
    // Back to the first project while the program runs.
    manager.open(first, "ressort.nABC");
    REQUIRE(manager.hears("/reply", "/nsm/client/open"));
    play->forget();
    play->write("get m_K\n");
    REQUIRE(play->says("m_K = 0.0625"));
    CHECK(eventually(
        [&] { return neighbour.is_connected("ressort.nABC:out_left", "neighbour:left"); }));
    play->signal(SIGTERM);
    CHECK(play->exit_code() == 0);
  }
  CHECK(fs::exists(folder.path / "first.nABC" / "PolyTriangle.mdl"));
  CHECK(fs::exists(folder.path / "first.nABC" / "two.scl"));
  fs::remove(folder.file("two.scl"));  // the project has its own copy
  Manager manager;
  auto play = start(manager);
  REQUIRE(manager.hears("/nsm/server/announce", "ressort"));
  manager.welcome();
  manager.open(first, "ressort.nABC");
  REQUIRE(play->says("on JACK"));
  const Neighbour neighbour;
  CHECK(eventually(
      [&] { return neighbour.is_connected("ressort.nABC:out_left", "neighbour:left"); }));
  CHECK_FALSE(neighbour.is_connected("ressort.nABC:out_right", "neighbour:left"));
  play->forget();
  play->write("get m_K\nstatus\n");
  REQUIRE(play->says("m_K = 0.0625"));
  REQUIRE(play->says("model   PolyTriangle"));
  // Half an octave per key from middle C: key 62 is C5, 523.25 Hz, instead of D4, 293.7 Hz.
  Listener listener(48000 * 3);
  listener.plan({{4800, {0x90, 62, 127}}});
  listener.start("ressort.nABC:out_left", "ressort.nABC:midi_in");
  REQUIRE(listener.wait_for(48000));
  std::map<int, double> level;  // level of a band around each
  for (const int hz : {294, 523}) {
    double re = 0.0;
    double im = 0.0;
    for (std::size_t n = 9600; n < 19200; ++n) {
      const double phase = 2.0 * M_PI * hz * static_cast<double>(n) / 48000.0;
      re += static_cast<double>(listener.heard(n)) * std::cos(phase);
      im += static_cast<double>(listener.heard(n)) * std::sin(phase);
    }
    level[hz] = std::hypot(re, im);
  }
  CAPTURE(level[294], level[523]);
  CHECK(level[523] > 10.0 * level[294]);
  play->signal(SIGTERM);
  CHECK(play->exit_code() == 0);
}

TEST_CASE("Without a session manager the program plays", "[nsm]") {
  const Server server(256);
  Child play(program({"play", "PolyTriangle", "-a", "jack", "-u", osc_port}),
             {{"NSM_URL", "osc.udp://127.0.0.1:9/"}});
  REQUIRE(play.says("playing without the session manager"));
  REQUIRE(play.says("on JACK"));
  Child wrong(program({"play", "PolyTriangle", "-a", "jack", "-i"}), {{"NSM_URL", "http://x"}});
  CHECK(wrong.says("NSM_URL is not the address"));
  CHECK(wrong.exit_code() == 2);
}

}  // namespace ressort::servers::nsm_test
