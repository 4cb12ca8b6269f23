#include "core/analysis/timbre/modal_sound.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

namespace ressort::analysis {
namespace {

constexpr double gone = 1e-100;  // States below this are set to 0, so that none becomes denormal.

}  // namespace

ModalSound::ModalSound(std::span<const Motion> motions, std::vector<std::vector<double>> pulses)
    : pulses_(std::move(pulses)),
      real_(motions.size()),
      imaginary_(motions.size()),
      pushed_(pulses_.size()) {
  for (const auto& pulse : pulses_) {
    pulse_end_ = std::max(pulse_end_, pulse.size());
  }
  std::vector<const Motion*> order;
  for (const Motion& motion : motions) {
    order.push_back(&motion);
  }
  std::ranges::sort(
      order, [](const Motion* a, const Motion* b) { return a->pole.imag() < b->pole.imag(); });
  const auto add = [](Turns& turns, std::complex<double> number) {
    turns.real.push_back(number.real());
    turns.imaginary.push_back(number.imag());
  };
  for (const Motion* const motion : order) {
    add(turns_, std::exp(motion->pole));
    for (std::size_t p = 0; p < pulses_.size(); ++p) {
      add(pushed_[p], motion->pushed[p]);
    }
  }
}

void ModalSound::turn(const Turns& turns) {
  const double* const c = turns.real.data();
  const double* const s = turns.imaginary.data();
  double* const x = real_.data();
  double* const y = imaginary_.data();
  for (std::size_t i = 0; i < real_.size(); ++i) {
    const double turned = c[i] * x[i] - s[i] * y[i];
    y[i] = s[i] * x[i] + c[i] * y[i];
    x[i] = turned;
  }
}

// Adds the pulses of this sample and advances by one.
void ModalSound::push_and_turn() {
  for (std::size_t p = 0; p < pulses_.size() && at_ < pulse_end_; ++p) {
    const double push = at_ < pulses_[p].size() ? pulses_[p][at_] : 0.0;
    for (std::size_t i = 0; i < real_.size(); ++i) {
      real_[i] += push * pushed_[p].real[i];
      imaginary_[i] += push * pushed_[p].imaginary[i];
    }
  }
  turn(turns_);
  ++at_;
}

void ModalSound::clear_faint() {
  for (std::size_t i = 0; i < real_.size(); ++i) {
    if (std::fabs(real_[i]) + std::fabs(imaginary_[i]) < gone) {
      real_[i] = imaginary_[i] = 0.0;
    }
  }
}

// std::reduce adds up groups of four, so that an addition seldom waits for the one before.
void ModalSound::next(std::span<double> samples) {
  for (double& sample : samples) {
    push_and_turn();
    sample = std::reduce(imaginary_.begin(), imaginary_.end());
  }
  clear_faint();
}

void ModalSound::next_magnitudes(std::span<double> magnitudes, std::size_t step) {
  Turns far = turns_;
  for (std::size_t i = 0; i < real_.size(); ++i) {
    const std::complex<double> turn =
        std::pow(std::complex<double>(far.real[i], far.imaginary[i]), static_cast<double>(step));
    far.real[i] = turn.real();
    far.imaginary[i] = turn.imag();
  }
  for (double& magnitude : magnitudes) {
    if (is_pushed()) {
      for (std::size_t m = 0; m < step; ++m) {
        push_and_turn();
      }
    } else {
      turn(far);
      at_ += step;
    }
    magnitude = std::hypot(std::reduce(real_.begin(), real_.end()),
                           std::reduce(imaginary_.begin(), imaginary_.end()));
  }
  clear_faint();
}

double ModalSound::most_left(double rate_hz, double resolution_s) const {
  const double near = 2.0 * std::numbers::pi / (rate_hz * resolution_s);
  double energy = 0.0;
  double together = 0.0;
  double before = 0.0;
  for (std::size_t i = 0; i < real_.size(); ++i) {
    const double angle = std::atan2(turns_.imaginary[i], turns_.real[i]);
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
