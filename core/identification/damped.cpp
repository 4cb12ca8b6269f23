#include "core/identification/damped.h"

#include <algorithm>
#include <array>

namespace ressort::identification {
namespace {

constexpr std::size_t block_frames = 256;
constexpr double gone = 34.0;  // Decay in nepers (295 dB) after which a mode is treated as silent.

// Powers z^n for n below the block length, computed by doubling.
struct PowerTable {
  explicit PowerTable(Complex log_z) {
    re[0] = 1.0;
    im[0] = 0.0;
    for (std::size_t known = 1; known < block_frames; known *= 2) {
      const Complex step = std::exp(log_z * static_cast<double>(known));
      for (std::size_t n = 0; n < known; ++n) {
        const Complex power = times(step, {re[n], im[n]});
        re[known + n] = power.real();
        im[known + n] = power.imag();
      }
    }
  }
  std::array<double, block_frames> re;
  std::array<double, block_frames> im;
};

std::size_t length_of(std::size_t frames, Complex log_z) {
  const double alpha = -log_z.real();
  return alpha * static_cast<double>(frames) > gone
             ? std::min(frames, static_cast<std::size_t>(gone / alpha) + 1)
             : frames;
}

}  // namespace

void add_damped(std::span<double> samples, Complex c, Complex log_z) {
  const PowerTable table(log_z);
  const std::size_t frames = length_of(samples.size(), log_z);
  for (std::size_t from = 0; from < frames; from += block_frames) {
    const Complex start = c * std::exp(log_z * static_cast<double>(from));
    const double re = start.real();
    const double im = start.imag();
    double* const block = samples.data() + from;
    const std::size_t count = std::min(block_frames, frames - from);
    for (std::size_t n = 0; n < count; ++n) {
      block[n] += re * table.re[n] - im * table.im[n];
    }
  }
}

Moments moments_of(std::span<const double> samples, Complex log_z) {
  // Number of independent sums, so that the compiler can keep them in vector registers.
  constexpr std::size_t lanes = 4;
  const PowerTable table(log_z);
  std::array<double, block_frames> place_re;
  std::array<double, block_frames> place_im;
  for (std::size_t n = 0; n < block_frames; ++n) {
    place_re[n] = static_cast<double>(n) * table.re[n];
    place_im[n] = static_cast<double>(n) * table.im[n];
  }
  const std::size_t frames = length_of(samples.size(), log_z);
  Moments sums{};
  for (std::size_t from = 0; from < frames; from += block_frames) {
    std::array<double, lanes> re{};
    std::array<double, lanes> im{};
    std::array<double, lanes> n_re{};
    std::array<double, lanes> n_im{};
    const double* const block = samples.data() + from;
    const std::size_t count = std::min(block_frames, frames - from);
    std::size_t n = 0;
    for (; n + lanes <= count; n += lanes) {
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        re[lane] += block[n + lane] * table.re[n + lane];
        im[lane] += block[n + lane] * table.im[n + lane];
        n_re[lane] += block[n + lane] * place_re[n + lane];
        n_im[lane] += block[n + lane] * place_im[n + lane];
      }
    }
    for (; n < count; ++n) {
      re[0] += block[n] * table.re[n];
      im[0] += block[n] * table.im[n];
      n_re[0] += block[n] * place_re[n];
      n_im[0] += block[n] * place_im[n];
    }
    const Complex zeroth((re[0] + re[1]) + (re[2] + re[3]), (im[0] + im[1]) + (im[2] + im[3]));
    const Complex first((n_re[0] + n_re[1]) + (n_re[2] + n_re[3]),
                        (n_im[0] + n_im[1]) + (n_im[2] + n_im[3]));
    const auto before = static_cast<double>(from);
    const Complex power = std::exp(log_z * before);
    sums.zeroth += times(power, zeroth);
    sums.first += times(power, first + before * zeroth);
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
