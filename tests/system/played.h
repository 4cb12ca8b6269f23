// tests: the program on a server, with its own reports.
#pragma once

#include <lo/lo.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/system/server.h"

namespace ressort::servers {

inline constexpr const char* osc_port = "19777";

inline lo_address osc() {
  static const lo_address address = lo_address_new("127.0.0.1", osc_port);
  return address;
}

// A preset with one click for every note, which decays by 60 dB within 1400 frames, so that the
// next click can be detected.
inline const char* click() {
  static const std::string path = [] {
    const std::string name = "ressort-click-" + std::to_string(getpid());
    const std::string there = (std::filesystem::temp_directory_path() / name).string();
    std::ofstream(there + ".mdl") << "@g ground 0\n@m mass 1 0 0\n@s springDamper @m @g 0.02 0.01\n"
                                     "@in1 frcInput @m\n@out1 posOutput @m\n";
    std::ofstream(there + ".toml")
        << "model = \"" << name
        << ".mdl\"\nvoices = 16\ntuning = \"fixed\"\n[[control]]\n"
           "from = \"note\"\nto = \"in1\"\nhow = \"impulse\"\nrange = [0.01, 0.1]\n";
    return there + ".toml";
  }();
  return path.c_str();
}

// Waits until the program answers on OSC.
inline bool answers() {
  std::atomic<bool> heard{false};
  const lo_server server = lo_server_new(nullptr, nullptr);
  lo_server_add_method(
      server, "/status.reply", nullptr,
      [](const char*, const char*, lo_arg**, int, lo_message, void* flag) {
        *static_cast<std::atomic<bool>*>(flag) = true;
        return 0;
      },
      &heard);
  const bool answered = eventually([&] {
    lo_send_from(osc(), server, LO_TT_IMMEDIATE, "/status", "");
    lo_server_recv_noblock(server, 50);
    return heard.load();
  });
  lo_server_free(server);
  return answered;
}

// Returns true if the console's status contains this text now.
inline bool status_shows(Child& play, const std::string& text) {
  play.forget();
  play.write("status\n");
  return play.says("events") && play.said().find(text) != std::string::npos;
}

}  // namespace ressort::servers
