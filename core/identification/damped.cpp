#include "core/identification/damped.h"

#include <algorithm>

#include "core/linear_algebra/complex.h"
#include "core/linear_algebra/eigen.h"

namespace ressort::identification {
namespace {

// Samples are processed as a matrix with a block in each column, and all modes at once.
constexpr std::size_t block_frames = 256;
constexpr std::size_t blocks_at_once = 32;
constexpr double gone = 34.0;  // Decay in nepers (295 dB) after which a mode is treated as silent.

// The modes that ring in a stretch of samples.
struct Stretch {
  Stretch(std::span<const Complex> log_z, std::size_t first, std::size_t frames)
      : from(first), samples(block_frames, blocks_at_once) {
    size = std::min(frames - first, block_frames * blocks_at_once);
    for (std::size_t k = 0; k < log_z.size(); ++k) {
      if (-log_z[k].real() * static_cast<double>(first) <= gone) {
        ringing.push_back(k);
      }
    }
    powers = Matrix(block_frames, 2 * ringing.size());
    for (std::size_t i = 0; i < ringing.size(); ++i) {
      double* const re = &powers.values[2 * i * block_frames];
      double* const im = re + block_frames;
      re[0] = 1.0;
      for (std::size_t known = 1; known < block_frames; known *= 2) {
        const Complex step = std::exp(log_z[ringing[i]] * static_cast<double>(known));
        for (std::size_t n = 0; n < known; ++n) {
          const Complex power = times(step, {re[n], im[n]});
          re[known + n] = power.real();
          im[known + n] = power.imag();
        }
      }
    }
  }
  double start_of(std::size_t block) const {
    return static_cast<double>(from + block * block_frames);
  }

  std::size_t from;
  std::size_t size;
  std::vector<std::size_t> ringing;
  Matrix powers;   // [sample, real and imaginary part of z^n for each mode that rings]
  Matrix samples;  // [sample, block]
};

}  // namespace

void add_damped(std::span<double> samples, std::span<const Complex> c,
                std::span<const Complex> log_z) {
  constexpr std::size_t step = block_frames * blocks_at_once;
  for (std::size_t from = 0; from < samples.size(); from += step) {
    const Stretch stretch(log_z, from, samples.size());
    if (stretch.ringing.empty()) {
      return;
    }
    Matrix starts(2 * stretch.ringing.size(), blocks_at_once);
    for (std::size_t b = 0; b < blocks_at_once; ++b) {
      for (std::size_t i = 0; i < stretch.ringing.size(); ++i) {
        const std::size_t k = stretch.ringing[i];
        const Complex start = times(c[k], std::exp(log_z[k] * stretch.start_of(b)));
        starts(2 * i, b) = start.real();
        starts(2 * i + 1, b) = -start.imag();
      }
    }
    const Matrix sums = product(stretch.powers, starts);
    for (std::size_t n = 0; n < stretch.size; ++n) {
      samples[from + n] += sums.values[n];
    }
  }
}

std::vector<Moments> moments_of(std::span<const double> samples, std::span<const Complex> log_z) {
  std::vector<Moments> sums(log_z.size());
  constexpr std::size_t step = block_frames * blocks_at_once;
  for (std::size_t from = 0; from < samples.size(); from += step) {
    Stretch stretch(log_z, from, samples.size());
    if (stretch.ringing.empty()) {
      break;
    }
    std::copy_n(samples.begin() + static_cast<std::ptrdiff_t>(from), stretch.size,
                std::begin(stretch.samples.values));
    const Matrix zeroth = transposed_product(stretch.powers, stretch.samples);
    for (std::size_t n = 0; n < stretch.samples.values.size(); ++n) {
      stretch.samples.values[n] *= static_cast<double>(n % block_frames);
    }
    const Matrix first = transposed_product(stretch.powers, stretch.samples);
    for (std::size_t i = 0; i < stretch.ringing.size(); ++i) {
      const std::size_t k = stretch.ringing[i];
      for (std::size_t b = 0; b < blocks_at_once; ++b) {
        const Complex power = std::exp(log_z[k] * stretch.start_of(b));
        const Complex sum(zeroth(2 * i, b), zeroth(2 * i + 1, b));
        const Complex within(first(2 * i, b), first(2 * i + 1, b));
        sums[k].zeroth += times(power, sum);
        sums[k].first += times(power, within + stretch.start_of(b) * sum);
      }
    }
  }
  return sums;
}

PowerSums power_sums(const Powers& powers, std::size_t count) {
  // At this distance from z = 1 the closed form still has 12 of 16 digits.
  constexpr double far = 20.0;
  const auto all = static_cast<double>(count);
  const Complex z = powers.z;
  const Complex away = 1.0 - z;
  if (std::norm(away) * all * all > far * far) {
    const Complex inverse = std::conj(away) / std::norm(away);
    const Complex end = powers.last;
    const Complex s0 = times(1.0 - end, inverse);
    const Complex s1 = times(times(z, s0) - all * end, inverse);
    // Solves (1 - z) S2 = z S0 + 2 z S1 - N^2 z^N for S2.
    const Complex s2 = times(times(z, s0 + 2.0 * s1) - all * all * end, inverse);
    return {s0, s1, s2};
  }
  PowerSums sums{};
  auto& [s0, s1, s2] = sums.of_power;
  std::size_t done = 0;
  Complex power = 1.0;  // z^done
  int bit = 0;
  while (count >> (bit + 1) != 0) {
    ++bit;
  }
  for (; bit >= 0; --bit) {
    const auto m = static_cast<double>(done);
    s2 += times(power, s2 + 2.0 * m * s1 + m * m * s0);
    s1 += times(power, s1 + m * s0);
    s0 += times(power, s0);
    power = times(power, power);
    done *= 2;
    if ((count >> bit & 1U) != 0) {
      const auto n = static_cast<double>(done);
      s0 += power;
      s1 += n * power;
      s2 += n * n * power;
      power = times(power, z);
      ++done;
    }
  }
  return sums;
}

}  // namespace ressort::identification
