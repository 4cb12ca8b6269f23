// A console with process and session, driven by a test.
#pragma once

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <future>
#include <string>
#include <vector>

#include "app/control/console.h"
#include "tests/support/app/data_folder.h"
#include "tests/support/catch.h"
#include "tests/support/networks/scenes.h"
#include "tests/support/rooms.h"

namespace ressort {

namespace fs = std::filesystem;

inline constexpr std::size_t period = 256;

// A console with process and session; the test is the audio thread.
struct Harness {
  explicit Harness(std::size_t channels = 2) : buffers(channels, std::vector<float>(period)) {}

  Process process{48000.0};
  Session session{process, {.compile = {.rate_hz = 48000.0}}, {}};
  std::string said;
  std::promise<std::string> news;  // The first message.
  Console console{process, session, [this](const std::string& text) { said += text + "\n"; },
                  [this](const std::string& text) { news.set_value(text); }};
  std::vector<std::vector<float>> buffers;

  // Runs a line and returns the console's output.
  std::string say(const std::string& line) {
    said.clear();
    console.run_line(line);
    return said;
  }

  // Plays at most one period; returns the first channel.
  std::vector<float> play(std::size_t frames = period) {
    std::vector<float*> outputs;
    for (auto& buffer : buffers) {
      outputs.push_back(buffer.data());
    }
    process.block(std::span<const float* const>{}, std::span<float* const>(outputs), frames, {}, 0);
    return {buffers[0].begin(), buffers[0].begin() + static_cast<std::ptrdiff_t>(frames)};
  }

  double loudest(int periods) {
    double peak = 0.0;
    for (int i = 0; i < periods; ++i) {
      for (const float sample : play()) {
        peak = std::max(peak, std::fabs(static_cast<double>(sample)));
      }
    }
    return peak;
  }
};

inline bool has(const std::string& text, const std::string& part) {
  return text.find(part) != text.npos;
}

inline const std::string triangle_preset =
    "model = \"triangle.mdl\"\n"
    "description = \"three masses, struck\"\n"
    "voices = 4\n"
    "[parameters]\n"
    "m_K = { value = 0.1, range = [0.01, 0.2] }\n"
    "[[control]]\n"
    "from = \"note\"\n"
    "to = \"in1\"\n"
    "how = \"impulse\"\n"
    "range = [0.01, 0.1]\n";

inline std::string write_triangle(const Folder& folder) {
  folder.write("triangle.mdl", scenes::poly_triangle());
  return folder.write("tri.toml", triangle_preset);
}

}  // namespace ressort
