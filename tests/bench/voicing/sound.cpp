#include "tests/bench/voicing/sound.h"

#include <ebur128.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <memory>
#include <numbers>
#include <numeric>

namespace ressort::voicing {
namespace {

double energy_of(std::span<const double> y) {
  return std::inner_product(y.begin(), y.end(), y.begin(), 0.0);
}

// Returns the energy of consecutive pieces of 5 ms, both channels together.
std::vector<double> envelope_of(const Stereo& sound) {
  const auto step = static_cast<std::size_t>(0.005 * sound.rate_hz);
  std::vector<double> envelope;
  for (std::size_t at = 0; at + step <= sound.size(); at += step) {
    double energy = 0.0;
    for (const std::vector<double>& channel : sound.channels) {
      energy += energy_of(std::span(channel).subspan(at, step));
    }
    envelope.push_back(energy);
  }
  return envelope;
}

// Fast Fourier transform in place; the length is a power of two.
void transform(std::vector<std::complex<double>>& x) {
  const std::size_t n = x.size();
  for (std::size_t i = 1, j = 0; i < n; ++i) {
    std::size_t bit = n >> 1;
    for (; (j & bit) != 0; bit >>= 1) {
      j ^= bit;
    }
    j ^= bit;
    if (i < j) {
      std::swap(x[i], x[j]);
    }
  }
  for (std::size_t length = 2; length <= n; length *= 2) {
    const std::complex<double> turn =
        std::polar(1.0, -2.0 * std::numbers::pi / static_cast<double>(length));
    for (std::size_t at = 0; at < n; at += length) {
      std::complex<double> w = 1.0;
      for (std::size_t k = 0; k < length / 2; ++k) {
        const std::complex<double> odd = w * x[at + k + length / 2];
        x[at + k + length / 2] = x[at + k] - odd;
        x[at + k] += odd;
        w *= turn;
      }
    }
  }
}

std::vector<double> windowed(std::span<const double> y) {
  std::vector<double> out(y.size());
  for (std::size_t n = 0; n < y.size(); ++n) {
    const double turn =
        2.0 * std::numbers::pi * (static_cast<double>(n) + 0.5) / static_cast<double>(y.size());
    out[n] = y[n] * (1.0 - std::cos(turn));
  }
  return out;
}

struct Spectrum {
  std::vector<double> magnitude;  // [bin]
  double bin_hz = 1.0;
};

// `zeros`: smallest factor by which zero padding lengthens the signal.
Spectrum spectrum_of(std::span<const double> y, double rate_hz, std::size_t zeros) {
  std::size_t length = 1;
  while (length < y.size() * zeros) {
    length *= 2;
  }
  const std::vector<double> seen = windowed(y);
  std::vector<std::complex<double>> x(length);
  std::copy(seen.begin(), seen.end(), x.begin());
  transform(x);
  Spectrum spectrum{.magnitude = {}, .bin_hz = rate_hz / static_cast<double>(length)};
  for (std::size_t k = 0; k < length / 2; ++k) {
    spectrum.magnitude.push_back(std::abs(x[k]) / static_cast<double>(y.size()));
  }
  return spectrum;
}

// Returns the magnitudes of both channels, computed separately so that nothing cancels.
Spectrum spectrum_of(const Stereo& sound, std::size_t zeros) {
  Spectrum both = spectrum_of(sound.channels[0], sound.rate_hz, zeros);
  const Spectrum right = spectrum_of(sound.channels[1], sound.rate_hz, zeros);
  for (std::size_t k = 0; k < both.magnitude.size(); ++k) {
    both.magnitude[k] = std::hypot(both.magnitude[k], right.magnitude[k]);
  }
  return both;
}

// Returns one point of the spectrum of a signal that is already windowed.
double power_at(std::span<const double> seen, double step) {
  std::complex<double> sum = 0.0;
  std::complex<double> w = 1.0;
  const std::complex<double> turn = std::polar(1.0, -step);
  for (const double y : seen) {
    sum += y * w;
    w *= turn;
  }
  return std::norm(sum);
}

// The mean pitch of partials, and how far they scatter around it.
struct Fit {
  double cents = 0.0;
  double scatter = 0.0;
};

struct Partial {
  int n = 0;
  double cents = 0.0;  // above n times the wanted frequency
  double power = 0.0;
};

Fit fit_partials(std::span<const Partial> partials, double stiffness) {
  Fit fit;
  double weight = 0.0;
  double moment = 0.0;
  const auto of_string = [&](const Partial& partial) {
    return partial.cents - stretch_cents(partial.n, stiffness);
  };
  for (const Partial& partial : partials) {
    weight += partial.power;
    moment += partial.power * of_string(partial);
  }
  fit.cents = weight > 0.0 ? moment / weight : 0.0;
  for (const Partial& partial : partials) {
    const double off = of_string(partial) - fit.cents;
    fit.scatter += partial.power * off * off;
  }
  return fit;
}

std::vector<Partial> find_partials(const Stereo& sound, double wanted_hz) {
  const Spectrum spectrum = spectrum_of(sound, 2);
  const std::vector<double>& magnitude = spectrum.magnitude;
  constexpr double half_semitone = 0.029;
  std::vector<Partial> partials;
  for (int n = 1; n <= 8; ++n) {
    const double hz = wanted_hz * n;
    const auto first = static_cast<std::size_t>(hz * (1.0 - half_semitone) / spectrum.bin_hz);
    const auto last = static_cast<std::size_t>(hz * (1.0 + half_semitone) / spectrum.bin_hz) + 1;
    if (last + 1 >= magnitude.size()) {
      break;
    }
    const auto peak = static_cast<std::size_t>(
        std::max_element(magnitude.begin() + static_cast<std::ptrdiff_t>(first),
                         magnitude.begin() + static_cast<std::ptrdiff_t>(last) + 1) -
        magnitude.begin());
    if (peak == first || peak == last) {
      continue;  // the slope of another peak
    }
    // A parabola through the logarithms of three bins.
    const double a = std::log(magnitude[peak - 1] + 1e-30);
    const double b = std::log(magnitude[peak] + 1e-30);
    const double c = std::log(magnitude[peak + 1] + 1e-30);
    const double curve = a - 2.0 * b + c;
    const double at = static_cast<double>(peak) + (curve < 0.0 ? 0.5 * (a - c) / curve : 0.0);
    partials.push_back({.n = n,
                        .cents = cents(at * spectrum.bin_hz, hz),
                        .power = magnitude[peak] * magnitude[peak]});
  }
  return partials;
}

}  // namespace

std::vector<double> Stereo::sum() const {
  std::vector<double> out(size());
  for (std::size_t n = 0; n < out.size(); ++n) {
    out[n] = (channels[0][n] + channels[1][n]) / 2.0;
  }
  return out;
}

Stereo Stereo::part(double from_s, double to_s) const {
  const std::size_t from = std::min(size(), static_cast<std::size_t>(from_s * rate_hz));
  const std::size_t to = std::clamp(static_cast<std::size_t>(to_s * rate_hz), from, size());
  Stereo out{.channels = {}, .rate_hz = rate_hz};
  for (std::size_t c = 0; c < channels.size(); ++c) {
    const auto first = channels[c].begin();
    out.channels[c].assign(first + static_cast<std::ptrdiff_t>(from),
                           first + static_cast<std::ptrdiff_t>(to));
  }
  return out;
}

double decibels(double ratio) {
  return 20.0 * std::log10(std::max(ratio, 1e-10));
}

double peak_of(const Stereo& sound) {
  double peak = 0.0;
  for (const std::vector<double>& channel : sound.channels) {
    for (const double y : channel) {
      peak = std::max(peak, std::fabs(y));
    }
  }
  return peak;
}

bool is_finite(const Stereo& sound) {
  return std::all_of(sound.channels.begin(), sound.channels.end(), [](const auto& channel) {
    return std::all_of(channel.begin(), channel.end(), [](double y) { return std::isfinite(y); });
  });
}

double offset_of(const Stereo& sound) {
  double worst = 0.0;
  for (const std::vector<double>& channel : sound.channels) {
    const std::vector<double> seen = windowed(channel);
    const double mean =
        std::accumulate(seen.begin(), seen.end(), 0.0) / static_cast<double>(seen.size());
    worst = std::max(worst, std::fabs(mean));
  }
  return worst;
}

double loudness_lufs(const Stereo& sound) {
  struct Closer {
    void operator()(ebur128_state* state) const { ebur128_destroy(&state); }
  };
  const std::unique_ptr<ebur128_state, Closer> state(
      ebur128_init(2, static_cast<unsigned long>(sound.rate_hz), EBUR128_MODE_I));
  std::vector<double> interleaved;
  for (std::size_t n = 0; n < sound.size(); ++n) {
    interleaved.insert(interleaved.end(), {sound.channels[0][n], sound.channels[1][n]});
  }
  double lufs = -std::numeric_limits<double>::infinity();
  ebur128_add_frames_double(state.get(), interleaved.data(), sound.size());
  ebur128_loudness_global(state.get(), &lufs);
  return std::max(lufs, -200.0);
}

double correlation_of(const Stereo& sound) {
  const auto& [left, right] = sound.channels;
  const double both = std::inner_product(left.begin(), left.end(), right.begin(), 0.0);
  const double alone = std::sqrt(energy_of(left) * energy_of(right));
  return alone > 0.0 ? both / alone : 1.0;
}

double mono_loss_db(const Stereo& sound) {
  const double channels = (energy_of(sound.channels[0]) + energy_of(sound.channels[1])) / 2.0;
  const double sum = energy_of(sound.sum());
  return channels > 0.0 ? -decibels(std::sqrt(sum / channels)) : 0.0;
}

double attack_s(const Stereo& sound, bool steady) {
  std::vector<double> envelope = envelope_of(sound);
  const std::size_t second = std::min<std::size_t>(envelope.size(), 200);
  double level =
      *std::max_element(envelope.begin(), envelope.begin() + static_cast<std::ptrdiff_t>(second));
  if (steady && envelope.size() > 100) {
    std::vector<double> late(envelope.begin() + 100, envelope.end());
    std::nth_element(late.begin(), late.begin() + static_cast<std::ptrdiff_t>(late.size() / 2),
                     late.end());
    level = late[late.size() / 2];
  }
  const auto reached = std::find_if(envelope.begin(), envelope.end(),
                                    [&](double energy) { return energy >= 0.5 * level; });
  return 0.005 * static_cast<double>(reached - envelope.begin());
}

double t60_s(const Stereo& sound) {
  std::vector<double> left = envelope_of(sound);
  for (std::size_t i = left.size(); i-- > 1;) {
    left[i - 1] += left[i];
  }
  const auto below = [&](double ratio) {
    return static_cast<std::size_t>(
        std::find_if(left.begin(), left.end(),
                     [&](double energy) { return energy <= ratio * left[0]; }) -
        left.begin());
  };
  const std::size_t from = below(std::pow(10.0, -0.5));
  const std::size_t to = below(std::pow(10.0, -2.5));
  // A sound that ends together with the render: its integral falls at once at the end, so there is
  // no slope to measure.
  if (left.empty() || left[0] <= 0.0 || to + 2 >= left.size() ||
      static_cast<double>(to) > 0.95 * static_cast<double>(left.size())) {
    return std::numeric_limits<double>::infinity();
  }
  return 3.0 * 0.005 * static_cast<double>(to - from);
}

double centroid_hz(const Stereo& sound) {
  const Spectrum spectrum = spectrum_of(sound, 1);
  double weight = 0.0;
  double moment = 0.0;
  for (std::size_t k = 0; k < spectrum.magnitude.size(); ++k) {
    const double hz = spectrum.bin_hz * static_cast<double>(k);
    if (hz > 20.0 && hz < 16000.0) {
      weight += spectrum.magnitude[k] * spectrum.magnitude[k];
      moment += hz * spectrum.magnitude[k] * spectrum.magnitude[k];
    }
  }
  return weight > 0.0 ? moment / weight : 0.0;
}

Pitch pitch_of(const Stereo& sound, double wanted_hz) {
  const Spectrum spectrum = spectrum_of(sound, 2);
  const std::vector<double>& magnitude = spectrum.magnitude;
  const auto bin_of = [&](double hz) {
    return std::min(magnitude.size() - 1, static_cast<std::size_t>(hz / spectrum.bin_hz + 0.5));
  };
  const auto largest = [&](double hz, double width_hz) {
    const auto first = magnitude.begin();
    return std::max_element(
               first + static_cast<std::ptrdiff_t>(bin_of(std::max(0.0, hz - width_hz))),
               first + static_cast<std::ptrdiff_t>(bin_of(hz + width_hz)) + 1) -
           first;
  };
  Pitch pitch;
  const auto partial = static_cast<std::size_t>(largest(wanted_hz, 0.03 * wanted_hz));
  const double strongest = *std::max_element(
      magnitude.begin() + static_cast<std::ptrdiff_t>(bin_of(20.0)), magnitude.end());
  pitch.level_db = decibels(magnitude[partial] / std::max(strongest, 1e-30));

  const std::size_t louder = energy_of(sound.channels[0]) < energy_of(sound.channels[1]) ? 1 : 0;
  const std::vector<double> seen = windowed(sound.channels[louder]);
  const double middle = spectrum.bin_hz * static_cast<double>(partial);
  double low = middle - spectrum.bin_hz * 2.0;
  double high = middle + spectrum.bin_hz * 2.0;
  const double to_step = 2.0 * std::numbers::pi / sound.rate_hz;
  constexpr double golden = 0.6180339887498949;
  for (int i = 0; i < 24; ++i) {
    const double a = high - (high - low) * golden;
    const double b = low + (high - low) * golden;
    if (power_at(seen, a * to_step) > power_at(seen, b * to_step)) {
      high = b;
    } else {
      low = a;
    }
  }
  pitch.partial_hz = 0.5 * (low + high);

  // Chooses the frequency whose first eight harmonics are the loudest; energy between the harmonics
  // counts against it.
  double best = -1.0;
  for (double hz = 20.0; hz < 5000.0; hz *= std::exp2(1.0 / 48.0)) {
    double salience = 0.0;
    for (int h = 1; h <= 8; ++h) {
      const double at = hz * static_cast<double>(h);
      if (at > 0.45 * sound.rate_hz) {
        break;
      }
      const auto peak = static_cast<std::size_t>(largest(at, 0.01 * at));
      salience += std::pow(0.8, h - 1) * std::sqrt(magnitude[peak]);
    }
    const bool has_fundamental =
        magnitude[static_cast<std::size_t>(largest(hz, 0.01 * hz))] > 0.03 * strongest;
    if (has_fundamental && salience > best) {
      best = salience;
      pitch.heard_hz = hz;
    }
  }
  return pitch;
}

Stereo band_around(const Stereo& sound, double hz, double width) {
  std::size_t length = 1;
  // The padding keeps the end from ringing into the start.
  while (length < sound.size() + static_cast<std::size_t>(2.0 * sound.rate_hz / (width * hz))) {
    length *= 2;
  }
  // The channels are the real and the imaginary part of one signal.
  std::vector<std::complex<double>> x(length);
  for (std::size_t n = 0; n < sound.size(); ++n) {
    x[n] = {sound.channels[0][n], sound.channels[1][n]};
  }
  transform(x);
  for (std::size_t k = 0; k < length; ++k) {
    const double bin = static_cast<double>(std::min(k, length - k));
    const double off = (bin * sound.rate_hz / static_cast<double>(length) / hz - 1.0) / width;
    x[k] *= std::exp(-0.5 * off * off) / static_cast<double>(length);
  }
  // The inverse transform is the conjugate of the transform of the conjugate.
  for (std::complex<double>& value : x) {
    value = std::conj(value);
  }
  transform(x);
  Stereo band{.channels = {}, .rate_hz = sound.rate_hz};
  for (std::size_t n = 0; n < sound.size(); ++n) {
    band.channels[0].push_back(x[n].real());
    band.channels[1].push_back(-x[n].imag());
  }
  return band;
}

double yin_hz(const Stereo& sound, double lowest_hz, double highest_hz) {
  constexpr double deep = 0.1;
  const std::size_t louder = energy_of(sound.channels[0]) < energy_of(sound.channels[1]) ? 1 : 0;
  const std::vector<double>& y = sound.channels[louder];
  const auto longest =
      std::min(static_cast<std::size_t>(sound.rate_hz / lowest_hz) + 2, y.size() / 2);
  const auto shortest =
      std::max<std::size_t>(2, static_cast<std::size_t>(sound.rate_hz / highest_hz));
  const auto difference = [&](std::size_t lag) {
    double sum = 0.0;
    for (std::size_t n = 0; n + y.size() / 2 < y.size(); ++n) {
      sum += (y[n] - y[n + lag]) * (y[n] - y[n + lag]);
    }
    return sum;
  };
  std::vector<double> d(longest + 1);
  std::vector<double> normalised(longest + 1, 1.0);
  double sum = 0.0;
  for (std::size_t lag = 1; lag <= longest; ++lag) {
    d[lag] = difference(lag);
    sum += d[lag];
    normalised[lag] = sum > 0.0 ? d[lag] * static_cast<double>(lag) / sum : 1.0;
  }
  std::size_t dip = shortest;
  for (std::size_t lag = shortest; lag < longest; ++lag) {
    dip = normalised[lag] < normalised[dip] ? lag : dip;
    if (normalised[dip] < deep && normalised[lag + 1] > normalised[lag]) {
      break;
    }
  }
  // Returns the minimum of a parabola through three neighbours.
  const auto minimum_near = [&](std::size_t lag) {
    const double a = difference(lag - 1);
    const double b = difference(lag);
    const double c = difference(lag + 1);
    const double curve = a - 2.0 * b + c;
    const double offset = curve > 0.0 ? std::clamp(0.5 * (a - c) / curve, -1.0, 1.0) : 0.0;
    return static_cast<double>(lag) + offset;
  };
  // The period is refined at a multiple after each doubling, where a sample is a smaller share.
  double period = minimum_near(dip);
  constexpr double fine = 400.0;  // samples: a tenth of one is 0.4 cents
  for (double times = 2.0; times * period < std::min(fine, 0.45 * static_cast<double>(y.size()));
       times *= 2.0) {
    auto lag = static_cast<std::size_t>(std::lround(times * period));
    lag = difference(lag - 1) < difference(lag)   ? lag - 1
          : difference(lag + 1) < difference(lag) ? lag + 1
                                                  : lag;
    period = minimum_near(lag) / times;
  }
  return sound.rate_hz / period;
}

double stretch_cents(int n, double stiffness) {
  return 600.0 * std::log2((1.0 + stiffness * n * n) / (1.0 + stiffness));
}

PartialsPitch partials_pitch(const Stereo& sound, double wanted_hz) {
  const std::vector<Partial> partials = find_partials(sound, wanted_hz);
  // Ternary search of the stiffness whose series scatters least, to 1e-3 of itself.
  constexpr double stiffest = 0.05;
  double low = 0.0;
  double high = stiffest;
  while (high - low > 1e-3 * high && high > 1e-7) {
    const double a = low + (high - low) / 3.0;
    const double b = high - (high - low) / 3.0;
    if (fit_partials(partials, a).scatter <= fit_partials(partials, b).scatter) {
      high = b;
    } else {
      low = a;
    }
  }
  const auto strongest =
      std::max_element(partials.begin(), partials.end(),
                       [](const Partial& a, const Partial& b) { return a.power < b.power; });
  return {.cents = fit_partials(partials, high).cents,
          .stiffness = high,
          .strongest = strongest == partials.end() ? 1 : strongest->n};
}

double cents(double hz, double from_hz) {
  return 1200.0 * std::log2(hz / from_hz);
}

}  // namespace ressort::voicing
