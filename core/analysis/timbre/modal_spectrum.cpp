#include "core/analysis/timbre/modal_spectrum.h"

#include <algorithm>
#include <cmath>

namespace ressort::analysis {

double pole_radius(double t60_s, double rate_hz) {
  return std::pow(10.0, -3.0 / (rate_hz * t60_s));
}

std::vector<Partial> partials_in_frame(std::span<const DecayingPartial> partials,
                                       const ModalFrame& frame, double rate_hz) {
  std::vector<Partial> lines;
  for (const DecayingPartial& partial : partials) {
    if (partial.frequency_hz > 0.0 && partial.frequency_hz < 0.5 * rate_hz) {
      const double log_r = std::log(std::max(partial.pole_radius, 1e-300));
      const double there = std::exp(static_cast<double>(frame.at) * log_r);
      const double seen = std::abs(window_response(frame.window, frame.size, log_r));
      lines.push_back({partial.frequency_hz, std::fabs(partial.residue) * there * seen});
    }
  }
  std::ranges::stable_sort(lines, {}, &Partial::frequency_hz);
  return lines;
}

std::optional<SpectralShape> spectral_shape(std::span<const Partial> partials, SpectrumKind kind) {
  std::vector<double> frequencies_hz;
  std::vector<double> spectrum;
  for (const Partial& partial : partials) {
    const double a = std::fabs(partial.amplitude);
    frequencies_hz.push_back(partial.frequency_hz);
    spectrum.push_back(kind == SpectrumKind::magnitude ? a : a * a);
  }
  return spectral_shape(frequencies_hz, spectrum, kind);
}

}  // namespace ressort::analysis
