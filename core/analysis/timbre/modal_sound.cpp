#include "core/analysis/timbre/modal_sound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace ressort::analysis {
namespace {

constexpr double gone = 1e-100;  // States below this are set to 0, so that none becomes denormal.

}  // namespace

ModalSound::ModalSound(std::span<const Motion> motions, std::vector<std::vector<double>> pulses)
    : pulses_(std::move(pulses)) {
  const std::size_t count = (motions.size() + group - 1) / group * group;
  std::vector<const Motion*> order;
  for (const Motion& motion : motions) {
    order.push_back(&motion);
  }
  std::sort(order.begin(), order.end(),
            [](const Motion* a, const Motion* b) { return a->pole.imag() < b->pole.imag(); });
  for (auto* const numbers : {&turn_real_, &turn_imaginary_, &real_, &imaginary_}) {
    numbers->resize(count);
  }
  pushed_real_.resize(pulses_.size() * count);
  pushed_imaginary_.resize(pulses_.size() * count);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::complex<double> turn = std::exp(order[i]->pole);
    turn_real_[i] = turn.real();
    turn_imaginary_[i] = turn.imag();
    for (std::size_t p = 0; p < pulses_.size(); ++p) {
      pushed_real_[p * count + i] = order[i]->pushed[p].real();
      pushed_imaginary_[p * count + i] = order[i]->pushed[p].imag();
    }
  }
}

std::size_t ModalSound::pulse_end() const {
  std::size_t end = 0;
  for (const auto& pulse : pulses_) {
    end = std::max(end, pulse.size());
  }
  return end;
}

struct ModalSound::Group {
  using Numbers = std::array<double, group>;
  Numbers x{}, y{};  // States.
  Numbers c{}, s{};  // Rotations per sample.
  void turn() {
    for (std::size_t i = 0; i < group; ++i) {
      const double turned = c[i] * x[i] - s[i] * y[i];
      y[i] = s[i] * x[i] + c[i] * y[i];
      x[i] = turned;
    }
  }
  static double sum(const Numbers& numbers) {
    return (numbers[0] + numbers[1]) + (numbers[2] + numbers[3]);
  }
};

ModalSound::Group ModalSound::group_at(std::size_t first) const {
  Group all;
  for (std::size_t i = 0; i < group; ++i) {
    all.x[i] = real_[first + i];
    all.y[i] = imaginary_[first + i];
    all.c[i] = turn_real_[first + i];
    all.s[i] = turn_imaginary_[first + i];
  }
  return all;
}

void ModalSound::keep(const Group& all, std::size_t first) {
  for (std::size_t i = 0; i < group; ++i) {
    const bool is_gone = std::fabs(all.x[i]) + std::fabs(all.y[i]) < gone;
    real_[first + i] = is_gone ? 0.0 : all.x[i];
    imaginary_[first + i] = is_gone ? 0.0 : all.y[i];
  }
}

// Advances one sample and adds the pulses of that sample.
void ModalSound::push(Group& all, std::size_t first, std::size_t sample) const {
  for (std::size_t p = 0; p < pulses_.size(); ++p) {
    const double push = sample < pulses_[p].size() ? pulses_[p][sample] : 0.0;
    for (std::size_t i = 0; i < group; ++i) {
      all.x[i] += push * pushed_real_[p * real_.size() + first + i];
      all.y[i] += push * pushed_imaginary_[p * real_.size() + first + i];
    }
  }
  all.turn();
}

void ModalSound::next(std::span<double> samples) {
  std::fill(samples.begin(), samples.end(), 0.0);
  const std::size_t driven = std::min(samples.size(), std::max(pulse_end(), at_) - at_);
  for (std::size_t first = 0; first < real_.size(); first += group) {
    Group all = group_at(first);
    for (std::size_t n = 0; n < samples.size(); ++n) {
      if (n < driven) {
        push(all, first, at_ + n);
      } else {
        all.turn();
      }
      samples[n] += Group::sum(all.y);
    }
    keep(all, first);
  }
  at_ += samples.size();
}

void ModalSound::next_magnitudes(std::span<double> magnitudes, std::size_t step) {
  std::vector<double> real(magnitudes.size());
  std::vector<double> imaginary(magnitudes.size());
  const std::size_t driven =
      std::min(magnitudes.size(), (std::max(pulse_end(), at_) - at_ + step - 1) / step);
  for (std::size_t first = 0; first < real_.size(); first += group) {
    Group all = group_at(first);
    Group far = all;
    for (std::size_t i = 0; i < group; ++i) {
      const std::complex<double> turn =
          std::pow(std::complex<double>(all.c[i], all.s[i]), static_cast<double>(step));
      far.c[i] = turn.real();
      far.s[i] = turn.imag();
    }
    for (std::size_t n = 0; n < magnitudes.size(); ++n) {
      if (n < driven) {
        for (std::size_t m = 0; m < step; ++m) {
          push(all, first, at_ + n * step + m);
        }
        far.x = all.x;
        far.y = all.y;
      } else {
        far.turn();
      }
      real[n] += Group::sum(far.x);
      imaginary[n] += Group::sum(far.y);
    }
    keep(far, first);
  }
  for (std::size_t n = 0; n < magnitudes.size(); ++n) {
    magnitudes[n] = std::hypot(real[n], imaginary[n]);
  }
  at_ += magnitudes.size() * step;
}

double ModalSound::most_left(double rate_hz, double resolution_s) const {
  const double near = 2.0 * std::numbers::pi / (rate_hz * resolution_s);
  double energy = 0.0;
  double together = 0.0;
  double before = 0.0;
  for (std::size_t i = 0; i < real_.size(); ++i) {
    const double angle = std::atan2(turn_imaginary_[i], turn_real_[i]);
    if (angle - before > near) {
      energy += together * together;
      together = 0.0;
    }
    together += std::hypot(real_[i], imaginary_[i]);
    before = angle;
  }
  return std::sqrt(energy + together * together);
}

}  // namespace ressort::analysis
