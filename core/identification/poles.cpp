#include "core/identification/poles.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/linear_algebra/complex.h"
#include "core/linear_algebra/fourier.h"

namespace ressort::identification {
namespace {

constexpr std::size_t taps_per_step = 14;  // Filter taps per step of decimation.
constexpr double kaiser_beta = 12.0;  // Kaiser window with 118 dB between passband and stopband.
constexpr double cutoff = 0.4;  // Cutoff as a share of the lower rate; poles are kept within 0.25.
constexpr std::size_t longest_window = 96;
constexpr std::size_t least_window = 32;
constexpr std::size_t least_frames = 96;  // Shortest usable band signal.
// Frames per energy measurement, which decides how long a band rings.
constexpr std::size_t energy_frames = 16;
constexpr std::size_t most_poles = 40;  // Most poles per band.
// Smallest ratio of a signal eigenvalue to the median (noise) eigenvalue.
constexpr double above_median = 25.0;
// Stopband leakage, relative to the largest eigenvalue of the loudest band.
constexpr double leak = 3e-12;
constexpr double most_lost = 4.0;  // Most decay of a pole, in nepers, while the filter fills.
constexpr double lowest_omega = 0.0005;
// Smallest ratio of the largest eigenvalue to the mean; below it the band holds only noise.
constexpr double peaked = 8.0;

using Band = std::vector<std::vector<Complex>>;  // [channel][frame] at the lower rate.

// Returns I0, the modified Bessel function of the first kind.
double bessel(double x) {
  double term = 1.0;
  double sum = 1.0;
  for (int k = 1; term > 1e-17 * sum; ++k) {
    term *= 0.25 * x * x / (k * k);
    sum += term;
  }
  return sum;
}

// Returns a Kaiser-windowed sinc, normalised to a sum of 1.
std::vector<double> lowpass(std::size_t decimation) {
  const std::size_t count = taps_per_step * decimation + 1;
  const double middle = 0.5 * static_cast<double>(count - 1);
  std::vector<double> taps(count);
  double sum = 0.0;
  for (std::size_t n = 0; n < count; ++n) {
    const double t = static_cast<double>(n) - middle;
    const double x = 2.0 * std::numbers::pi * cutoff / static_cast<double>(decimation) * t;
    const double share = t / middle;
    taps[n] = (t == 0.0 ? 1.0 : std::sin(x) / x) *
              bessel(kaiser_beta * std::sqrt(std::max(0.0, 1.0 - share * share)));
    sum += taps[n];
  }
  for (double& tap : taps) {
    tap /= sum;
  }
  return taps;
}

// Adds a channel to all bands, decimated, for all positions where the whole filter lies within the
// sound. Band b has its centre at (b + 1/2) pi / decimation, so the filters of all bands are one
// filter and a Fourier transform: in n = m + 2 p decimation, their oscillation has period 2
// decimation but for the sign (-1)^p.
void split(const std::vector<double>& sound, const std::vector<double>& taps,
           std::size_t decimation, std::vector<Band>& bands) {
  Fourier fourier(4 * decimation);
  std::vector<double> folded(fourier.size());
  std::vector<Complex> bins(fourier.bins());
  for (Band& band : bands) {
    band.emplace_back();
  }
  for (std::size_t from = 0; from + taps.size() <= sound.size(); from += decimation) {
    std::fill(folded.begin(), folded.end(), 0.0);
    double sign = 1.0;
    for (std::size_t first = 0; first < taps.size(); first += 2 * decimation, sign = -sign) {
      for (std::size_t m = 0; m < std::min(2 * decimation, taps.size() - first); ++m) {
        folded[m] += sign * taps[first + m] * sound[from + first + m];
      }
    }
    fourier.forward(folded, bins);
    // The filter was modulated to the centre; this shifts the result back to frequency 0.
    constexpr Complex quarter_turns[] = {{1.0, 0.0}, {0.0, -1.0}, {-1.0, 0.0}, {0.0, 1.0}};
    for (std::size_t b = 0; b < bands.size(); ++b) {
      const std::size_t bin = 2 * b + 1;
      bands[b].back().push_back(times(bins[bin], quarter_turns[bin * (from / decimation) % 4]));
    }
  }
}

double energy_of(const Band& band, std::size_t from, std::size_t to) {
  double sum = 0.0;
  for (const std::vector<Complex>& channel : band) {
    for (std::size_t n = from; n < to; ++n) {
      sum += std::norm(channel[n]);
    }
  }
  return sum;
}

// Returns the number of frames until only the noise floor of the end is left.
std::size_t ringing_frames(const Band& band) {
  const std::size_t all = band[0].size();
  std::vector<double> energies;
  for (std::size_t from = 0; from + energy_frames <= all; from += energy_frames) {
    energies.push_back(energy_of(band, from, from + energy_frames));
  }
  std::vector<double> tail(energies.end() - static_cast<std::ptrdiff_t>((energies.size() + 3) / 4),
                           energies.end());
  std::nth_element(tail.begin(), tail.begin() + static_cast<std::ptrdiff_t>(tail.size() / 2),
                   tail.end());
  const double noise = tail[tail.size() / 2];
  std::size_t last = energies.size();
  while (last > 0 && energies[last - 1] < 4.0 * noise) {
    --last;
  }
  // If no frame stands out, a weak and long mode may still ring through all frames.
  return last == 0 ? all
                   : std::clamp(last * energy_frames * 5 / 4, std::min(all, least_window * 3), all);
}

// Returns the covariance matrix: the mean over all windows of x[i] conj(x[j]). Each diagonal is
// updated recursively from its first element.
ComplexMatrix covariance(const Band& band, std::size_t frames, std::size_t window) {
  ComplexMatrix made(window, window);
  const std::size_t windows = frames - window + 1;
  const double share = 1.0 / static_cast<double>(windows);
  for (const std::vector<Complex>& x : band) {
    for (std::size_t lag = 0; lag < window; ++lag) {
      Complex sum;
      for (std::size_t n = 0; n < windows; ++n) {
        sum += times(x[n + lag], std::conj(x[n]));
      }
      for (std::size_t j = 0; j + lag < window; ++j) {
        made(j + lag, j) += share * sum;
        if (j + lag + 1 < window) {
          sum += times(x[windows + j + lag], std::conj(x[windows + j])) -
                 times(x[j + lag], std::conj(x[j]));
        }
      }
    }
  }
  return made;
}

// Approximates the largest eigenvalue by a few power iterations.
double largest_eigenvalue(const ComplexMatrix& lower) {
  const std::size_t size = lower.rows;
  ComplexMatrix whole = lower;
  for (std::size_t j = 0; j < size; ++j) {
    for (std::size_t i = 0; i < j; ++i) {
      whole(i, j) = std::conj(whole(j, i));
    }
  }
  std::vector<Complex> from(size);
  for (std::size_t i = 0; i < size; ++i) {
    // A start vector with a component in every direction.
    from[i] = std::polar(1.0, static_cast<double>(i * i));
  }
  double length = 0.0;
  for (int round = 0; round < 12; ++round) {
    std::vector<Complex> to(size);
    for (std::size_t j = 0; j < size; ++j) {
      for (std::size_t i = 0; i < size; ++i) {
        to[i] += times(whole(i, j), from[j]);
      }
    }
    double square = 0.0;
    for (const Complex& x : to) {
      square += std::norm(x);
    }
    length = std::sqrt(square);
    if (length == 0.0) {
      return 0.0;
    }
    for (std::size_t i = 0; i < size; ++i) {
      from[i] = to[i] / length;
    }
  }
  return length;
}

struct Candidate {
  Band band;
  double centre = 0.0;  // Centre omega at the full rate.
  double energy = 0.0;
  std::size_t frames = 0;
  std::size_t window = 0;
  ComplexMatrix covariance{0, 0};
  double largest = 0.0;
};

void find_in(const Candidate& candidate, double loudest, std::size_t decimation, double highest,
             std::vector<Complex>& poles) {
  const std::size_t window = candidate.window;
  const std::size_t most = std::min(most_poles, window / 2);
  const HermitianEigenpairs pairs = hermitian_eigenpairs(candidate.covariance, most);
  const double median = pairs.values[window / 2];
  const double floor =
      std::max({above_median * median, 1e-15 * pairs.values[window - 1], leak * loudest});
  std::size_t order = 0;
  while (order < most && pairs.values[window - 1 - order] > floor) {
    ++order;
  }
  if (order == 0) {
    return;
  }
  ComplexMatrix basis(window, order);
  for (std::size_t j = 0; j < order; ++j) {
    for (std::size_t i = 0; i < window; ++i) {
      basis(i, j) = pairs.vectors(i, most - 1 - j);
    }
  }
  const auto steps = static_cast<double>(decimation);
  for (const Complex z : shift_eigenvalues(basis)) {
    const Complex log_z = std::log(z) / steps;
    const double omega = candidate.centre + log_z.imag();
    const bool is_kept = std::fabs(log_z.imag()) * steps <= 1.02 * 0.5 * std::numbers::pi &&
                         -log_z.real() * steps > -1.0 / static_cast<double>(candidate.frames) &&
                         -log_z.real() * steps < most_lost / static_cast<double>(taps_per_step) &&
                         omega > lowest_omega && omega < highest;
    if (is_kept) {
      poles.emplace_back(log_z.real(), omega);
    }
  }
}

}  // namespace

std::size_t frames_lost(const PoleSearch& search) {
  return taps_per_step * search.decimation;
}

std::size_t shortest_for(const PoleSearch& search) {
  return frames_lost(search) + least_frames * search.decimation + 1;
}

std::vector<Complex> find_poles(std::span<const std::vector<double>> channels,
                                const PoleSearch& search, const Progress& progress) {
  std::vector<Complex> poles;
  const std::size_t decimation = search.decimation;
  if (channels.empty() || channels[0].size() < shortest_for(search)) {
    return poles;
  }
  const std::vector<double> taps = lowpass(decimation);
  const double spacing = std::numbers::pi / static_cast<double>(decimation);
  std::vector<Band> bands(
      std::min(decimation, static_cast<std::size_t>(std::ceil(search.highest_omega / spacing))));
  for (const std::vector<double>& channel : channels) {
    split(channel, taps, decimation, bands);
    progress.spend(channel.size() * 64);
  }
  std::vector<Candidate> candidates;
  double loudest_energy = 0.0;
  for (Band& band : bands) {
    const double energy = energy_of(band, 0, band[0].size());
    const double centre = (static_cast<double>(candidates.size()) + 0.5) * spacing;
    loudest_energy = std::max(loudest_energy, energy);
    candidates.push_back({.band = std::move(band), .centre = centre, .energy = energy});
  }
  double loudest = 0.0;
  for (Candidate& candidate : candidates) {
    if (candidate.energy <= 1e-14 * loudest_energy) {
      continue;
    }
    candidate.frames = ringing_frames(candidate.band);
    candidate.window = std::min(candidate.frames / 3, longest_window);
    candidate.covariance = covariance(candidate.band, candidate.frames, candidate.window);
    candidate.largest = largest_eigenvalue(candidate.covariance);
    loudest = std::max(loudest, candidate.largest);
    progress.spend(candidate.window * candidate.frames);
  }
  for (const Candidate& candidate : candidates) {
    double trace = 0.0;
    for (std::size_t i = 0; i < candidate.window; ++i) {
      trace += candidate.covariance(i, i).real();
    }
    if (candidate.largest > leak * loudest &&
        candidate.largest > std::min(peaked, 0.3 * static_cast<double>(candidate.window)) * trace /
                                static_cast<double>(candidate.window)) {
      find_in(candidate, loudest, decimation, search.highest_omega, poles);
      progress.spend(candidate.window * candidate.window * candidate.window);
    }
  }
  return poles;
}

}  // namespace ressort::identification
