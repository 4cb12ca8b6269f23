// app/commands: the two references about a scene, and what each way is worth beside them.
//
// T1, "identical": the published scheme at 44 100 Hz in long double. T2, "physical": the continuous
// network with the same M, K, Z: exact modes where the scene is linear, else the published scheme
// at up to 256 times the rate, which is known as far as it agrees with itself at half of that.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "app/commands/chart/ways.h"
#include "core/analysis/continuous.h"

namespace ressort::commands {

inline constexpr std::array<double, 3> chart_windows_s = {0.005, 0.05, 1.0};
inline constexpr double heard_s = 1.0;    // how long everything is played
inline constexpr double energy_s = 0.25;  // how long energy is watched
inline constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

// [channel][sample]
using Waves = std::vector<std::vector<double>>;

struct Reference {
  Waves waves;
  double energy = 0.0;             // the highest
  std::array<double, 3> floor_db;  // [window] how far it agrees with itself
  std::string how;                 // it was found
};

// The references, and where their sound begins.
struct References {
  Reference identical;
  Reference physical;
  std::optional<Continuous> continuous;  // where the scene is linear
  std::size_t onset = 0;                 // sample: the windows begin here
  std::size_t window = 0;                // that waveforms are judged in: the longest trustworthy
};

// Beside one reference. What is not known is no number.
struct Against {
  std::array<double, 3> snr_db;
  double cents = 0.0;        // the largest error of a partial within 60 dB of the loudest
  double t60_percent = 0.0;  // the same
  double energy = 0.0;       // the highest energy, in shares of the reference's
};

struct Judged {
  Against identical;
  Against physical;
  double energy_gain = 0.0;  // the highest energy in shares of that at the start; hands at rest
  bool is_finite = true;
};

// A partial's pole in a scheme, per second: e^(pole t); no number where it does not swing.
using Poles = std::vector<std::complex<double>>;

// Plays the scene in a way, from the start; [channel][output sample] at 44 100 Hz.
Waves render_way(MadeWay& way, std::size_t frames);

// `stepped`: the same as a scheme starts it. Blocks for seconds where the scene is not linear.
// Fails where it is too large.
Result<References> find_references(const ChartScene& scene, const ChartScene& stepped, Isa isa);

// The partials of a linear scene as this way has them, for each of the continuous modes.
Poles poles_of(const ChartScene& scene, const Continuous& continuous, MadeWay& way);

// The highest energy in `seconds`, and that at the start; nothing where a kernel does not tell.
// Where links can let go, only moments count in which they have.
struct EnergyReading {
  double first = 0.0;
  double highest = 0.0;
};
std::optional<EnergyReading> watch_energy(const ChartScene& scene, MadeWay& way, double seconds);

Judged judge(const ChartScene& scene, const References& references, const Poles& published,
             MadeWay& way, const Waves& waves);

// Whether ways can be trusted with a scene: hit ten times harder, with the parameters at the ends
// of their ranges, and both.
class Stress {
 public:
  Stress(const ChartScene& scene, Isa isa);
  // What goes wrong; empty if nothing does. A way that refuses to play does no harm.
  std::string verdict(const Way& way) const;

 private:
  struct Case {
    std::string name;
    ChartScene scene;
    double peak = 0.0;    // of what 16 times the rate plays, here or in the scene as it is
    double energy = 0.0;  // the highest of the same
  };
  void measure(Case& one) const;
  std::string verdict(const Case& one, const Way& way) const;
  std::vector<Case> cases_;
  Isa isa_;
};

// 10 log10 of signal over error in [from, to), all channels together; at most 400.
double signal_to_error_db(const Waves& reference, const Waves& found, std::size_t from,
                          std::size_t to);

}  // namespace ressort::commands
