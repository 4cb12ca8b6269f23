// app/commands: reference solutions of a scene, and the error and the stability of a method.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "app/commands/chart/ways.h"

namespace ressort::commands {

inline constexpr double heard_s = 1.0;  // length of everything that is played

// [channel][sample]
using Waves = std::vector<std::vector<double>>;

// The published scheme in long double, and the continuous network: exact modes of a linear scene,
// else the published scheme at 64 or 256 times the rate.
struct References {
  Waves published;
  Waves physical;
  bool is_exact = false;  // the physical reference
  // agreement of a reference that is not exact with the same reference at half its rate
  double floor_db = 0.0;
  std::string how;        // the physical reference was found
  std::size_t onset = 0;  // first audible sample
  // length from the onset: the longest in which the reference can be trusted
  double window_s = 0.0;

  // Signal to error in the window, [ChartReference].
  std::array<double, 2> snr_db(const Waves& found) const;
};

// Plays the scene from its start; [channel][output sample] at 44,100 Hz.
Waves render_way(MadeWay& way, std::size_t frames);

// Finds both references. `stepped` is the scene as a scheme starts it; see Starts. Blocks for
// seconds if the scene is nonlinear. Fails if the scene is too large.
Result<References> find_references(const ChartScene& scene, const ChartScene& stepped, Isa isa);

// The energy at the start, and the highest in `seconds`, as far as the energy of nonlinear links is
// certain. Empty if a kernel does not know the positions of its masses.
struct EnergyReading {
  double first = 0.0;
  double highest = 0.0;
};
std::optional<EnergyReading> watch_energy(MadeWay& way, double seconds);

// Tests methods with a scene, as written and struck ten times harder.
class Stress {
 public:
  Stress(const ChartScene& scene, Isa isa);
  // Returns a description of the instability; empty for a stable method and for one that cannot
  // play the scene.
  std::string verdict(const Way& way) const;

 private:
  struct Case {
    std::string name;
    ChartScene scene;
    double peak = 0.0;    // value at 16 times the rate
    double energy = 0.0;  // the highest at 16 times the rate
  };
  std::vector<Case> cases_;
  Isa isa_;
};

// 10 log10 of signal over error in [from, to), over all channels; at most 400. NaN for silence.
double signal_to_error_db(const Waves& reference, const Waves& found, std::size_t from,
                          std::size_t to);

}  // namespace ressort::commands
