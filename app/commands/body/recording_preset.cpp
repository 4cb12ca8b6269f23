// Writes the modes and the noise of a recording as a preset with its model.
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "app/commands/body/recording.h"
#include "app/text.h"
#include "core/identification/shapes.h"
#include "core/model/language/expression.h"

namespace ressort::commands {
namespace {

constexpr double model_rate_hz = 44100.0;
constexpr double noise_quality = 1.0;  // Q of the modes that carry noise.

std::string five_digits(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.5g", value);
  return text;
}

double power_at(double hertz, const NoiseBand& band) {
  const double low = hertz / band.low_hz;
  const double high = hertz / band.high_hz;
  return low * low / (1.0 + low * low) / (1.0 + high * high);
}

// Returns the rms displacement of a mode of mass 1 under noise of rms 1 in this band.
double response(double mode_hz, double t60_s, const NoiseBand& band) {
  const double r = std::pow(10.0, -3.0 / (model_rate_hz * t60_s));
  const double theta = 2.0 * std::numbers::pi * mode_hz / model_rate_hz;
  double heard = 0.0;
  double played = 0.0;
  for (double hertz = 5.0; hertz < 0.5 * model_rate_hz; hertz += 10.0) {
    const std::complex<double> back =
        std::polar(1.0, -2.0 * std::numbers::pi * hertz / model_rate_hz);
    const std::complex<double> below = 1.0 - 2.0 * r * std::cos(theta) * back + r * r * back * back;
    const double power = power_at(hertz, band);
    played += power;
    heard += power / std::norm(below);
  }
  return std::sqrt(heard / played);
}

// Returns the coordinate of a place.
std::string place_of(std::size_t places, std::size_t number) {
  return five_digits(static_cast<double>(number) / static_cast<double>(places - 1));
}

// One blow of the hand: the same in both directions in turn, so that chords add no offset.
std::string strike(double direction, int turn) {
  const std::string one = direction < 0.0 ? "-1.0" : "1.0";
  return "\n[[control]]\nfrom = \"note\"\nto = \"in1\"\nhow = \"impulse\"\nrange = [" + one + ", " +
         one + "]\nlevel_db = [-24.0, 0.0]\nround_robin = [" + std::to_string(turn) +
         ", 2]\nlength_ms = [4.0, 0.05]\n";
}

std::string knob(const std::string& from, const std::string& to, const std::string& name,
                 const std::string& range) {
  return "\n[[control]]\nfrom = \"" + from + "\"\nto = \"" + to + "\"\nname = \"" + name +
         "\"\nrange = " + range + "\n";
}

}  // namespace

std::string played_model(const Identification& found, const std::vector<NoiseBand>& noise,
                         const std::string& label, const std::string& source, double mass) {
  const std::vector<BodyShape> shapes = body_shapes(found, mass);
  const double lowest_hz = found.modes.front().frequency_hz.value;
  const std::size_t channels = found.sound.size();
  std::vector<std::string> names = {"centre", "hit", "edge"};
  for (std::size_t c = 0; c < channels; ++c) {
    names.push_back("mic" + std::to_string(c + 1));
  }
  for (std::size_t b = 0; b < noise.size(); ++b) {
    names.push_back("noise" + std::to_string(b + 1));
  }
  std::string text =
      "# " + source + " as an instrument: " + counted(found.modes.size(), "mode", "modes") +
      ", and " + counted(noise.size(), "band", "bands") +
      " of noise.\n"
      "# `place` moves the blow from a centre past the recorded place, `hit`, to an\n"
      "# edge. High modes are weaker at the centre and stronger at the edge, by 3 dB\n"
      "# per octave.\n"
      "@ring param 1.    # scales all decay times\n"
      "@damp param 0.    # additional loss in 1/s per kHz\n"
      "@place param " +
      place_of(names.size(), 1) + "\n@" + label + " body " + print_number(mass) + " " +
      joined(names, " ") + "\n";
  const std::string zeros = [&] {
    std::string some;
    for (std::size_t b = 0; b < noise.size(); ++b) {
      some += " 0";
    }
    return some;
  }();
  for (std::size_t k = 0; k < found.modes.size(); ++k) {
    const double hertz = found.modes[k].frequency_hz.value;
    const double t60_s = found.modes[k].t60_s.value;
    const double tilt = std::sqrt(hertz / lowest_hz);
    text += "@" + label + "_" + std::to_string(k + 1) + " mode @" + label + " " +
            print_number(hertz) + " [" + five_digits(t60_s) + "*ring/(1+" +
            five_digits(1e-3 * hertz * t60_s) + "*damp)] " + five_digits(shapes[k].hit / tilt) +
            " " + five_digits(shapes[k].hit) + " " + five_digits(shapes[k].hit * tilt);
    for (const double heard : shapes[k].heard) {
      text += " " + five_digits(heard);
    }
    text += zeros + "\n";
  }
  for (std::size_t b = 0; b < noise.size(); ++b) {
    // The lowest mode sets the pitch, so no carrier of noise is below it.
    const double hertz = std::max(1.01 * lowest_hz, std::sqrt(noise[b].low_hz * noise[b].high_hz));
    const double t60_s = std::log(1000.0) * noise_quality / (std::numbers::pi * hertz);
    text += "@" + label + "_n" + std::to_string(b + 1) + " mode @" + label + " " +
            five_digits(hertz) + " " + five_digits(t60_s) + " 0 0 0";
    for (const double level : noise[b].level) {
      text += " " + five_digits(mass * level / response(hertz, t60_s, noise[b]));
    }
    for (std::size_t other = 0; other < noise.size(); ++other) {
      text += other == b ? " 1" : " 0";
    }
    text += "  # noise up to " + five_digits(noise[b].high_hz) + " Hz\n";
  }
  text += "@in1 frcInput [@" + label + " place]\n";
  for (std::size_t b = 0; b < noise.size(); ++b) {
    text += "@in" + std::to_string(b + 2) + " frcInput [@" + label + " noise" +
            std::to_string(b + 1) + "]\n";
  }
  for (std::size_t c = 0; c < channels; ++c) {
    text += "@out" + std::to_string(c + 1) + " posOutput [@" + label + " mic" +
            std::to_string(c + 1) + "]\n";
  }
  return text;
}

std::string played_preset(const Identification& found, const std::vector<NoiseBand>& noise,
                          const std::string& model, const std::string& source) {
  constexpr double wanted_peak = 0.25;  // -12 dBFS
  double peak = 1e-30;
  for (const std::vector<double>& channel : found.sound) {
    for (const double x : channel) {
      peak = std::max(peak, std::fabs(x));
    }
  }
  const std::size_t places = 3 + found.sound.size() + noise.size();
  const std::string range = "[0, " + place_of(places, 2) + "]";
  std::string text =
      "model = \"" + model + "\"\ndescription = \"" + source + ": " +
      counted(found.modes.size(), "mode", "modes") +
      ". The wheel moves the blow.\"\nvoices = 8\ngain = " + five_digits(wanted_peak / peak) +
      "\nhardness = \"mallet\"\n\n[parameters]\nmallet = { value = 0, range = [-0.5, 0.5] }\nring "
      "= { value = 1, range = [0.5, 2] }\n"
      "damp = { value = 0, range = [0, 20] }\nplace = { value = " +
      place_of(places, 1) + ", range = " + range + " }\n" + strike(1.0, 1) + strike(-1.0, 2);
  for (std::size_t b = 0; b < noise.size(); ++b) {
    const std::string ms = five_digits(std::clamp(1e3 * noise[b].t60_s, 1.0, 10000.0));
    text += "\n[[control]]\nfrom = \"note\"\nto = \"in" + std::to_string(b + 2) +
            "\"\nhow = \"noise\"\nrange = [0.06, 1.0]\ncurve = \"exponential\"\nlength_ms = [" +
            ms + ", " + ms + "]\nband_hz = [" + five_digits(noise[b].low_hz) + ", " +
            five_digits(noise[b].high_hz) + "]\n";
  }
  return text + knob("cc1", "place", "Place", range) +
         knob("cc16", "mallet", "Mallet", "[-0.5, 0.5]") +
         knob("cc71", "ring", "Ring", "[0.5, 2]\ncurve = \"exponential\"") +
         knob("cc74", "damp", "Brightness", "[20, 0]");
}

}  // namespace ressort::commands
