#include "core/identification/damped.h"

#include <algorithm>
#include <numeric>

#include "core/identification/damped_step.h"

namespace ressort::identification {
namespace {

// Samples are processed as a matrix with a block in each column, and all modes at once.
constexpr std::size_t block_frames = 256;
constexpr std::size_t blocks_at_once = panel_rows;
constexpr std::size_t stretch_frames = block_frames * blocks_at_once;
constexpr double gone = 34.0;  // Decay in nepers (295 dB) after which a mode is treated as silent.

void multiply_here(const Product& given) {
  static const auto best =
      kernels::with_isa(kernels::best_isa(), []<kernels::Isa isa>() { return &multiply<isa>; });
  best(given);
}

std::size_t padded(std::size_t columns) {
  return (columns + 3) / 4 * 4;
}

// The modes, the longest ones first, and their powers in the first block.
struct Ordered {
  explicit Ordered(std::span<const Complex> log_z)
      : order(log_z.size()), powers(block_frames * padded(2 * log_z.size())) {
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_sort(
        order, [&](std::size_t a, std::size_t b) { return log_z[a].real() > log_z[b].real(); });
    for (std::size_t i = 0; i < order.size(); ++i) {
      double* const re = &powers[2 * i * block_frames];
      double* const im = re + block_frames;
      re[0] = 1.0;
      for (std::size_t known = 1; known < block_frames; known *= 2) {
        const Complex step = std::exp(log_z[order[i]] * static_cast<double>(known));
        for (std::size_t n = 0; n < known; ++n) {
          const Complex power = times(step, {re[n], im[n]});
          re[known + n] = power.real();
          im[known + n] = power.imag();
        }
      }
      steps.push_back(std::exp(log_z[order[i]] * static_cast<double>(block_frames)));
    }
  }
  // Returns the number of modes that ring at this sample.
  std::size_t ringing_at(std::size_t sample, std::span<const Complex> log_z) const {
    const auto last = std::ranges::partition_point(order, [&](std::size_t k) {
      return -log_z[k].real() * static_cast<double>(sample) <= gone;
    });
    return static_cast<std::size_t>(last - order.begin());
  }

  std::vector<std::size_t> order;
  std::vector<double> powers;  // [real and imaginary part of z^n for each mode][n]
  std::vector<Complex> steps;  // z^256
};

}  // namespace

double energy_in(std::span<const std::vector<double>> channels) {
  double sum = 0.0;
  for (const std::vector<double>& channel : channels) {
    sum = std::transform_reduce(channel.begin(), channel.end(), channel.begin(), sum);
  }
  return sum;
}

void add_damped(std::span<double> samples, std::span<const Complex> c,
                std::span<const Complex> log_z) {
  if (log_z.empty()) {
    return;
  }
  const Ordered modes(log_z);
  const std::size_t columns = 2 * log_z.size();
  std::vector<double> panels(block_frames * columns);
  for (std::size_t n = 0; n < block_frames; ++n) {
    for (std::size_t j = 0; j < columns; ++j) {
      panels[(n / panel_rows * columns + j) * panel_rows + n % panel_rows] =
          modes.powers[j * block_frames + n];
    }
  }
  std::vector<double> starts(columns * blocks_at_once);
  std::vector<double> sums(stretch_frames);
  for (std::size_t from = 0; from < samples.size(); from += stretch_frames) {
    const std::size_t ringing = modes.ringing_at(from, log_z);
    for (std::size_t i = 0; i < ringing; ++i) {
      const std::size_t k = modes.order[i];
      Complex start = times(c[k], std::exp(log_z[k] * static_cast<double>(from)));
      for (std::size_t b = 0; b < blocks_at_once; ++b, start = times(start, modes.steps[i])) {
        starts[b * columns + 2 * i] = start.real();
        starts[b * columns + 2 * i + 1] = -start.imag();
      }
    }
    multiply_here({panels.data(), panel_rows * columns, block_frames / panel_rows, 2 * ringing,
                   starts.data(), columns, blocks_at_once, sums.data()});
    for (std::size_t n = 0; n < std::min(samples.size() - from, stretch_frames); ++n) {
      samples[from + n] += sums[n];
    }
  }
}

std::vector<Moments> moments_of(std::span<const double> samples, std::span<const Complex> log_z) {
  std::vector<Moments> sums(log_z.size());
  const Ordered modes(log_z);
  constexpr std::size_t rows = 2 * blocks_at_once;
  std::vector<double> panels(2 * stretch_frames);  // x[n], then n x[n], with a block in each row
  std::vector<double> products(rows * padded(2 * log_z.size()));
  for (std::size_t from = 0; from < samples.size(); from += stretch_frames) {
    const std::size_t ringing = modes.ringing_at(from, log_z);
    for (std::size_t i = 0; i < stretch_frames; ++i) {
      const std::size_t n = i % block_frames;
      const std::size_t place = n * panel_rows + i / block_frames;
      panels[place] = from + i < samples.size() ? samples[from + i] : 0.0;
      panels[stretch_frames + place] = static_cast<double>(n) * panels[place];
    }
    multiply_here({panels.data(), stretch_frames, 2, block_frames, modes.powers.data(),
                   block_frames, padded(2 * ringing), products.data()});
    for (std::size_t i = 0; i < ringing; ++i) {
      const std::size_t k = modes.order[i];
      Complex power = std::exp(log_z[k] * static_cast<double>(from));
      const double* const re = &products[2 * i * rows];
      for (std::size_t b = 0; b < blocks_at_once; ++b, power = times(power, modes.steps[i])) {
        const Complex sum(re[b], re[rows + b]);
        const Complex within(re[blocks_at_once + b], re[rows + blocks_at_once + b]);
        const auto start = static_cast<double>(from + b * block_frames);
        sums[k].zeroth += times(power, sum);
        sums[k].first += times(power, within + start * sum);
      }
    }
  }
  return sums;
}

std::vector<double> explained_energies(std::span<const std::vector<double>> channels,
                                       std::span<const Complex> log_z) {
  std::vector<double> energies(log_z.size());
  for (const std::vector<double>& channel : channels) {
    const std::vector<Moments> moments = moments_of(channel, log_z);
    for (std::size_t k = 0; k < log_z.size(); ++k) {
      energies[k] -= std::norm(moments[k].zeroth) * log_z[k].real();
    }
  }
  return energies;
}

std::vector<Complex> damped_grid(double lowest_omega, double highest_omega, double ratio,
                                 double most_quality) {
  std::vector<Complex> grid;
  for (double omega = lowest_omega; omega < highest_omega; omega *= ratio) {
    for (double quality = 2.5; quality < most_quality; quality *= 2.0) {
      grid.emplace_back(-0.5 * omega / quality, omega);
    }
  }
  return grid;
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
