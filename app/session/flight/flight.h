// app/session: a flight: what was played since the program began, and from what: enough to play the
// same samples once more.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/realtime/process.h"
#include "app/session/loader.h"
#include "core/compile/compile.h"

namespace ressort::session {

// What an engine was made of.
struct FlightEngine {
  std::uint32_t number = 0;  // FlightRecord::count of its take
  std::uint32_t serial = 0;
  bool lets_ring = false;
  bool has_new_numbers = false;
  std::string path;                                     // of the scene
  std::shared_ptr<const std::vector<SceneFile>> files;  // all that the scene is read from
  std::vector<Setting> kept;  // values that parameters had by then, in place of the texts'
  double rate_hz = 0.0;
  std::uint32_t most_modes = 0;
  bool find_gain = false;
  bool force = false;
  double gain = 1.0;  // of the preset that was compiled, whatever its text says
};

// How all of them are compiled.
struct FlightSetup {
  bool rescale = true;
  int voices = 0;
  NoteShare::Part share;  // of the notes, of which all are recorded
  Precision precision = Precision::float64;
  std::optional<Method> method;
  std::optional<Budget> budget;
  std::optional<ThirdArgument> third;
  KeyOptions keys;
};

struct Flight {
  std::string made_by;  // program, version, commit
  std::string isa;      // what the kernels were compiled for
  FlightSetup setup;
  std::vector<FlightEngine> engines;
  std::vector<FlightRecord> records;
  std::int64_t end_frame = 0;     // one past the last that was played
  bool has_audio_inputs = false;  // which are not kept
};

// As text, in lines; the texts of models and presets are in it, whole.
std::string print_flight(const Flight& flight);

// Back; an error has the line.
Result<Flight> parse_flight(std::string_view text);

inline constexpr std::size_t max_flight_bytes = std::size_t{256} << 20;
inline constexpr double flight_heard_s = 30.0;  // of its end; what was before is computed only

// Whether a name is that of a flight's file.
bool names_flight(std::string_view name);

// Reads the scene of an engine from the flight's own texts and makes the engine. [any thread but
// audio]
Result<std::unique_ptr<Engine>> make_flight_engine(const Flight& flight,
                                                   const FlightEngine& engine);

// Puts parameters of what was read to other values; gives back those that the texts have.
std::vector<Setting> keep_values(Scene& scene, std::span<const Setting> kept);

// Collects a flight beside the sound. [one thread]
class FlightLog {
 public:
  // More, and what was first is not known any more.
  static constexpr std::size_t most_records = std::size_t{1} << 19;
  static constexpr std::size_t most_engines = 10'000;
  static constexpr std::size_t most_text_bytes = std::size_t{64} << 20;

  explicit FlightLog(FlightSetup setup) { flight_.setup = std::move(setup); }

  void add(FlightEngine engine, bool has_audio_inputs);
  // All that there is by now.
  void drain(Process& process);
  // Whether an engine has sounded yet.
  bool has_begun() const;
  // Nothing before the first engine, and once it has become more than is kept.
  Result<Flight> flight() const;

 private:
  void forget();

  Flight flight_;
  std::deque<FlightRecord> records_;  // its records: it grows without moving
  std::vector<std::shared_ptr<const std::vector<SceneFile>>> texts_;  // of its engines
  std::size_t text_bytes_ = 0;
  std::string lost_;  // why the beginning is not known; empty: it is
};

}  // namespace ressort::session
