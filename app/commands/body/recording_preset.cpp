// Writes the modes and the noise of a recording as a preset with its model.
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>

#include "app/commands/body/recording.h"
#include "app/text.h"
#include "core/format.h"
#include "core/identification/shapes.h"
#include "core/model/language/expression.h"

namespace ressort::commands {
namespace {

constexpr double model_rate_hz = 44100.0;
constexpr double noise_quality = 1.5;  // Q of the modes that carry noise.

std::string five_digits(double value) {
  return formatted("%.5g", value);
}

double power_at(double hertz, const NoiseBand& band) {
  const double low = hertz / band.low_hz;
  const double high = hertz / band.high_hz;
  return low * low / (1.0 + low * low) / (1.0 + high * high);
}

// A band of noise is heard through a mode of its own.
struct Carrier {
  explicit Carrier(const NoiseBand& given)
      : band(given),
        hertz(std::sqrt(given.low_hz * given.high_hz)),
        t60_s(std::log(1000.0) * noise_quality / (std::numbers::pi * hertz)) {
    const double r = std::pow(10.0, -3.0 / (model_rate_hz * t60_s));
    const double theta = 2.0 * std::numbers::pi * hertz / model_rate_hz;
    for (double at_hz = 0.5 * step_hz; at_hz < 0.5 * model_rate_hz; at_hz += step_hz) {
      const std::complex<double> back =
          std::polar(1.0, -2.0 * std::numbers::pi * at_hz / model_rate_hz);
      const double power = power_at(at_hz, band);
      played += power;
      heard += power / std::norm(1.0 - 2.0 * r * std::cos(theta) * back + r * r * back * back);
      heard_below.push_back(heard);
    }
  }
  // Returns the rms displacement of the mode, with mass 1, under noise of rms 1.
  double response() const { return std::sqrt(heard / played); }
  // Returns the share of its power between two frequencies.
  double share_between(double low_hz, double high_hz) const {
    const auto below = [&](double hz) {
      const auto steps = static_cast<std::size_t>(std::round(hz / step_hz));
      return steps == 0 ? 0.0 : heard_below[std::min(steps, heard_below.size()) - 1];
    };
    return (below(high_hz) - below(low_hz)) / heard;
  }

  static constexpr double step_hz = 10.0;
  NoiseBand band;
  double hertz;
  double t60_s;
  double played = 0.0;
  double heard = 0.0;               // for mass 1
  std::vector<double> heard_below;  // [step] Power below the step's upper end.
};

// Sets the levels such that the carriers, which overlap, have the energy of each band together
// (Richardson 1972, Lucy 1974: no level becomes negative).
void remove_overlap(std::vector<Carrier>& carriers) {
  constexpr int steps = 100;
  const std::size_t count = carriers.size();
  std::vector<double> share;  // [carrier][band]
  for (const Carrier& carrier : carriers) {
    for (const Carrier& other : carriers) {
      share.push_back(carrier.share_between(other.band.low_hz, other.band.high_hz));
    }
  }
  for (std::size_t c = 0; count > 0 && c < carriers[0].band.level.size(); ++c) {
    std::vector<double> wanted;
    for (const Carrier& carrier : carriers) {
      wanted.push_back(carrier.band.level[c] * carrier.band.level[c] * carrier.band.t60_s);
    }
    std::vector<double> energy = wanted;
    for (int step = 0; step < steps; ++step) {
      std::vector<double> ratio;
      for (std::size_t b = 0; b < count; ++b) {
        double sum = 1e-300;
        for (std::size_t k = 0; k < count; ++k) {
          sum += share[k * count + b] * energy[k];
        }
        ratio.push_back(wanted[b] / sum);
      }
      for (std::size_t k = 0; k < count; ++k) {
        double sum = 0.0;
        double all = 1e-300;
        for (std::size_t b = 0; b < count; ++b) {
          sum += share[k * count + b] * ratio[b];
          all += share[k * count + b];
        }
        energy[k] *= sum / all;
      }
    }
    for (std::size_t k = 0; k < count; ++k) {
      carriers[k].band.level[c] = std::sqrt(energy[k] / carriers[k].band.t60_s);
    }
  }
}

// Returns the label of the body that carries the noise, which keys do not retune.
std::string noise_label(const std::string& label) {
  return label + "_noise";
}

// Returns the coordinate of a place.
std::string place_of(std::size_t places, std::size_t number) {
  return five_digits(static_cast<double>(number) / static_cast<double>(places - 1));
}

// One blow of the hand: the same in both directions in turn, so that chords add no offset. Its
// force is the same on all keys, because the velocities that are heard would grow with the pitch.
std::string strike(double direction, int turn, const std::string& longest_ms) {
  const std::string one = direction < 0.0 ? "-1.0" : "1.0";
  return "\n[[control]]\nfrom = \"note\"\nto = \"in1\"\nhow = \"impulse\"\nrange = [" + one + ", " +
         one + "]\nlevel_db = [-24.0, 0.0]\nround_robin = [" + std::to_string(turn) +
         ", 2]\nlength_ms = [" + longest_ms + ", 0.05]\nfollows_pitch = false\n";
}

std::string knob(const std::string& from, const std::string& to, const std::string& name,
                 const std::string& range) {
  return "\n[[control]]\nfrom = \"" + from + "\"\nto = \"" + to + "\"\nname = \"" + name +
         "\"\nrange = " + range + "\n";
}

double energy_of(const IdentifiedMode& mode) {
  double square = 0.0;
  for (const Measured& amplitude : mode.amplitude) {
    square += amplitude.value * amplitude.value;
  }
  return square * mode.t60_s.value;
}

// Returns the frequency of the mode with the most energy.
double loudest_hz(const Identification& found) {
  return std::ranges::max_element(found.modes, {}, energy_of)->frequency_hz.value;
}

// Returns the energy of the modes in one of several recordings.
double energy_at(const Identification& found, std::size_t recording) {
  double energy = 0.0;
  for (std::size_t k = 0; k < found.modes.size(); ++k) {
    energy += energy_of(found.modes[k]) * std::pow(hit_of(found, recording, k), 2.0);
  }
  return energy;
}

// Returns whether each of several recordings is louder than the one before, by 2 dB or more. Their
// blows are then from the softest to the hardest.
bool gets_louder(const Identification& found) {
  constexpr double louder = 1.58;
  bool is_louder = found.hits.size() > 1;
  for (std::size_t r = 1; r < found.hits.size(); ++r) {
    is_louder = is_louder && energy_at(found, r) > louder * energy_at(found, r - 1);
  }
  return is_louder;
}

// Returns the modes as they are when their sum is smallest, in the first millisecond, so that they
// start without a click.
std::vector<IdentifiedMode> starting_modes(const Identification& found) {
  constexpr double longest_s = 0.001;
  std::vector<IdentifiedMode> best;
  double least = HUGE_VAL;
  for (double time_s = 0.0; time_s < longest_s; time_s += 1.0 / found.rate_hz) {
    const double later_s = found.onset_s + time_s - found.time_zero_s;
    std::vector<IdentifiedMode> modes = found.modes;
    std::vector<double> sums(found.sound.size());
    for (IdentifiedMode& mode : modes) {
      const double decay = std::pow(10.0, -3.0 * later_s / mode.t60_s.value);
      for (std::size_t c = 0; c < sums.size(); ++c) {
        mode.amplitude[c].value *= decay;
        mode.phase_rad[c].value += 2.0 * std::numbers::pi * mode.frequency_hz.value * later_s;
        sums[c] += mode.amplitude[c].value * std::cos(mode.phase_rad[c].value);
      }
    }
    const double square = std::inner_product(sums.begin(), sums.end(), sums.begin(), 0.0);
    if (square < least) {
      least = square;
      best = std::move(modes);
    }
  }
  return best;
}

}  // namespace

std::string played_model(const Identification& found, const std::vector<NoiseBand>& noise,
                         const std::string& label, const std::string& source, double mass) {
  const std::vector<BodyShape> shapes = body_shapes(starting_modes(found), mass);
  const double lowest_hz = found.modes.front().frequency_hz.value;
  const std::size_t channels = found.sound.size();
  const bool is_one = found.hits.empty();
  std::vector<std::string> names =
      is_one ? std::vector<std::string>{"centre", "hit", "edge"} : struck_places(found);
  // The level of a note follows its velocity, so blows of several strengths get the same energy. At
  // one place they move a mode in the same direction.
  std::vector<std::vector<double>> hits = found.hits;
  for (std::size_t r = 0; r < hits.size() && gets_louder(found); ++r) {
    const double gain = std::sqrt(energy_at(found, hits.size() - 1) / energy_at(found, r));
    for (double& hit : hits[r]) {
      hit = gain * std::fabs(hit);
    }
  }
  for (std::size_t c = 0; c < channels; ++c) {
    names.push_back("mic" + std::to_string(c + 1));
    names.push_back("velocity" + std::to_string(c + 1));
  }
  std::string text =
      "# " + source + " as an instrument: " + counted(found.modes.size(), "mode", "modes") +
      ", and " + counted(noise.size(), "band", "bands") + " of noise.\n" +
      (is_one ? "# `place` moves the blow from a centre past the recorded place, `hit`, to an\n"
                "# edge. High modes are weaker at the centre and stronger at the edge, by 3 dB\n"
                "# per octave."
              : "# `place` moves the blow from that of the first recording to that of the last.") +
      " The velocities give the modes their phases.\n"
      "@ring param 1.    # scales all decay times\n"
      "@damp param 0.    # additional loss in 1/s per kHz\n"
      "@place param " +
      place_of(names.size(), is_one ? 1 : 0) + "\n@" + label + " body " + print_number(mass) + " " +
      joined(names, " ") + "\n";
  for (std::size_t k = 0; k < found.modes.size(); ++k) {
    const double hertz = found.modes[k].frequency_hz.value;
    const double t60_s = found.modes[k].t60_s.value;
    const double tilt = std::sqrt(hertz / lowest_hz);
    text += "@" + label + "_" + std::to_string(k + 1) + " mode @" + label + " " +
            print_number(hertz) + " [" + five_digits(t60_s) + "*ring/(1+" +
            five_digits(1e-3 * hertz * t60_s) + "*damp)]";
    for (const double factor : {1.0 / tilt, 1.0, tilt}) {
      text += is_one ? " " + five_digits(shapes[k].hit * factor) : "";
    }
    for (const std::vector<double>& hit : hits) {
      text += " " + five_digits(shapes[k].hit * hit[k]);
    }
    for (std::size_t c = 0; c < channels; ++c) {
      text += " " + five_digits(shapes[k].position[c]) + " " + five_digits(shapes[k].velocity[c]);
    }
    text += "\n";
  }
  std::vector<Carrier> carriers(noise.begin(), noise.end());
  remove_overlap(carriers);
  const std::string carrier = noise_label(label);
  if (!noise.empty()) {
    text += "@" + carrier + " body " + print_number(mass);
    for (std::size_t c = 0; c < channels; ++c) {
      text += " mic" + std::to_string(c + 1);
    }
    for (std::size_t b = 0; b < noise.size(); ++b) {
      text += " noise" + std::to_string(b + 1);
    }
    text += "\n";
  }
  for (std::size_t b = 0; b < noise.size(); ++b) {
    text += "@" + carrier + "_" + std::to_string(b + 1) + " mode @" + carrier + " " +
            five_digits(carriers[b].hertz) + " " + five_digits(carriers[b].t60_s);
    for (const double level : carriers[b].band.level) {
      text += " " + five_digits(mass * level / carriers[b].response());
    }
    for (std::size_t other = 0; other < noise.size(); ++other) {
      text += other == b ? " 1" : " 0";
    }
    text += "  # noise up to " + five_digits(noise[b].high_hz) + " Hz\n";
  }
  text += "@in1 frcInput [@" + label + " place]\n";
  for (std::size_t b = 0; b < noise.size(); ++b) {
    text += "@in" + std::to_string(b + 2) + " frcInput [@" + carrier + " noise" +
            std::to_string(b + 1) + "]\n";
  }
  for (std::size_t c = 0; c < channels; ++c) {
    const std::string number = std::to_string(c + 1);
    text += "@out" + number + " posOutput [@" + label + " mic" + number + "]\n@out" + number +
            " velOutput [@" + label + " velocity" + number + "]\n";
    if (!noise.empty()) {
      text += "@out" + number + " posOutput [@" + carrier + " mic" + number + "]\n";
    }
  }
  return text;
}

std::string played_preset(const Identification& found, const std::vector<NoiseBand>& noise,
                          const std::string& label, const std::string& model,
                          const std::string& source) {
  constexpr double wanted_peak = 0.25;  // -12 dBFS
  double peak = 1e-30;
  for (const std::vector<double>& channel : found.sound) {
    for (const double x : channel) {
      peak = std::max(peak, std::fabs(x));
    }
  }
  const std::size_t struck = found.hits.empty() ? 3 : found.hits.size();
  const std::size_t places = struck + 2 * found.sound.size();
  const double cents =
      1200.0 * std::log2(loudest_hz(found) / found.modes.front().frequency_hz.value);
  const double semitones = std::round(cents / 100.0);
  const std::string last = place_of(places, struck - 1);
  // Recorded blows of several strengths have their own contact times, so no mallet changes them.
  const bool has_mallet = !gets_louder(found);
  const std::string longest_ms = has_mallet ? "4.0" : "0.05";
  const std::string range = "[0, " + last + "]";
  std::string text =
      "model = \"" + model + "\"\ndescription = \"" + source + ": " +
      counted(found.modes.size(), "mode", "modes") +
      ". The wheel moves the blow.\"\nvoices = 8\ntranspose = " + five_digits(0.0 - semitones) +
      "\nflattening_cents = " + five_digits(100.0 * semitones - cents) +
      "\ngain = " + five_digits(wanted_peak / peak) +
      (noise.empty() ? std::string() : "\nfixed = [\"" + noise_label(label) + "\"]") +
      (has_mallet ? "\nhardness = \"mallet\"\n\n[parameters]\nmallet = { value = 0, range = [-0.5, "
                    "0.5] }"
                  : "\n\n[parameters]") +
      "\nring = { value = 1, range = [0.5, 2] }\n"
      "damp = { value = 0, range = [0, 20] }\nplace = { value = " +
      place_of(places, found.hits.empty() ? 1 : 0) + ", range = " + range +
      (has_mallet ? "" : ", velocity = [[0, 0], [127, " + last + "]]") + " }\n" +
      strike(1.0, 1, longest_ms) + strike(-1.0, 2, longest_ms);
  for (std::size_t b = 0; b < noise.size(); ++b) {
    const std::string ms = five_digits(std::clamp(1e3 * noise[b].t60_s, 1.0, 10000.0));
    text += "\n[[control]]\nfrom = \"note\"\nto = \"in" + std::to_string(b + 2) +
            "\"\nhow = \"noise\"\nrange = [0.06, 1.0]\ncurve = \"exponential\"\nlength_ms = [" +
            ms + ", " + ms + "]\nband_hz = [" + five_digits(noise[b].low_hz) + ", " +
            five_digits(noise[b].high_hz) + "]\n";
  }
  if (found.fall.cents.value > 0.0) {
    const std::string cents = five_digits(found.fall.cents.value);
    text += "\n[[lfo]]\nname = \"tension\"\nshape = \"fall\"\nrate_hz = " +
            five_digits(std::clamp(1.0 / found.fall.decay_s.value, 0.01, 50.0)) +
            "\nby = \"level\"\n\n[[control]]\nfrom = \"tension\"\nto = \"pitch\"\nrange = [-" +
            cents + ", " + cents + "]\n";
  }
  return text + knob("cc1", "place", "Place", range) +
         (has_mallet ? knob("cc16", "mallet", "Mallet", "[-0.5, 0.5]") : "") +
         knob("cc71", "ring", "Ring", "[0.5, 2]\ncurve = \"exponential\"") +
         knob("cc74", "damp", "Brightness", "[20, 0]");
}

}  // namespace ressort::commands
