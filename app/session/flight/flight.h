// app/session: a flight: everything that was played since the start, with the scenes. It reproduces
// the same samples.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/realtime/process.h"
#include "app/session/loader.h"
#include "core/compile/compile.h"

namespace ressort::session {

// The inputs of an engine's compilation.
struct FlightEngine {
  std::uint32_t number = 0;  // FlightRecord::count of its take record
  std::uint32_t serial = 0;
  bool lets_ring = false;
  bool has_new_numbers = false;
  std::string path;                                     // path of the scene
  std::shared_ptr<const std::vector<SceneFile>> files;  // all files of the scene
  std::vector<Setting> kept;  // present parameter values, which override the texts'
  double rate_hz = 0.0;
  std::uint32_t most_modes = 0;
  bool find_gain = false;
  bool force = false;
  double gain = 1.0;               // gain of the compiled preset, which may differ from its text
  std::vector<std::string> forms;  // forms of its plan, which depend on measurements; see Choice
};

// Options common to all engines.
struct FlightSetup {
  bool rescale = true;
  int voices = 0;
  NoteShare::Part share;  // the part of the notes that was played; all notes are recorded
  std::optional<Precision> precision;
  std::optional<Method> method;
  std::optional<Budget> budget;
  std::optional<ThirdArgument> third;
  KeyOptions keys;
};

struct Flight {
  std::string made_by;  // name, version and commit of the program
  std::string isa;      // instruction set of the kernels
  FlightSetup setup;
  std::vector<FlightEngine> engines;
  std::vector<FlightRecord> records;
  std::int64_t end_frame = 0;     // one past the last frame played
  bool has_audio_inputs = false;  // sound at audio inputs is not recorded
};

// Returns the flight as text lines, with the whole texts of models and presets.
std::string print_flight(const Flight& flight);

// Parses such a text. An error has its line.
Result<Flight> parse_flight(std::string_view text);

inline constexpr std::size_t max_flight_bytes = std::size_t{256} << 20;
inline constexpr double flight_heard_s = 30.0;  // the end is played, the rest only computed

// Returns true for a flight's file name.
bool is_flight_name(std::string_view name);

// Reads an engine's scene from the flight's texts and compiles it. [any thread but audio]
Result<std::unique_ptr<Engine>> make_flight_engine(const Flight& flight,
                                                   const FlightEngine& engine);

// Replaces parameter values in a scene. Returns the values that the texts have.
std::vector<Setting> keep_values(Scene& scene, std::span<const Setting> kept);

}  // namespace ressort::session
