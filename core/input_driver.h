// core: the driver of one input in one voice. It turns targets, sweeps, strikes and pushes into a
// position or a force for every sample. The gestures of gesture.h call it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>

#include "core/noise.h"
#include "core/raised_cosine.h"

namespace ressort {

// A position with its change per sample, or a force, which has no velocity.
struct InputSample {
  double value = 0.0;
  double velocity = 0.0;
};

// Every method is wait-free. [audio]
class alignas(64) InputDriver {
 public:
  // Puts the driver to rest at `position`; a force input starts at 0.
  void place(double position) {
    *this = InputDriver{};
    value_ = target_ = position;
  }

  // Moves towards `target` as a one-pole filter: y += (1 - pole)(target - y). Pole 0 jumps.
  void follow(double target, double pole) {
    motion_ = Motion::follow;
    target_ = target;
    pole_ = pole;
  }

  // Moves to `target` at a constant speed in units per sample, and rests there.
  void sweep(double target, double speed) {
    motion_ = Motion::sweep;
    target_ = target;
    speed_ = std::fabs(speed);
  }

  // Moves continuously. The velocity approaches `speed` units per sample by a one-pole filter.
  void draw(double speed, double pole) {
    motion_ = Motion::draw;
    speed_ = speed;
    pole_ = pole;
  }

  // Makes the velocity of draws fluctuate: v (1 + level * noise), as rosin and hair do.
  void roughen(double level, const BandNoise& noise) {
    roughness_ = level;
    rough_ = noise;
  }

  // Multiplies the speed of a draw, to follow a change of the voice's pitch.
  void scale_speed(double ratio) {
    if (motion_ == Motion::draw) {
      speed_ *= ratio;
    }
  }

  // Adds a pulse of force or displacement to the current motion: one sample, or a raised cosine of
  // `frames` samples with the same sum.
  void strike(double force, double frames = 1.0) {
    const RaisedCosine pulse(frames);
    if (pulse.count == 1) {
      pulse_ += force;
    } else {
      blow_ = force;
      blow_pulse_ = pulse;
      blow_left_ = pulse.count;
    }
  }

  // Lets a blow that has not begun choose its direction by the motion of its place. `cycles`:
  // cycles per sample of the lowest mode there.
  void wait_for_motion(double cycles) { cycles_ = cycles; }
  bool waits_for_motion() const { return cycles_ > 0.0 && blow_left_ == blow_pulse_.count; }
  // Turns the blow so that it adds energy to a mode with this position and velocity per sample: the
  // velocity in the middle of a blow of length T is v cos(w T / 2) - x w sin(w T / 2).
  void follow_motion(double position, double velocity) {
    const double omega = 2.0 * std::numbers::pi * cycles_;
    const double half = 0.5 * omega * static_cast<double>(blow_pulse_.count);
    const double middle = velocity * std::cos(half) - position * omega * std::sin(half);
    blow_ = middle * blow_ < 0.0 ? -blow_ : blow_;
    cycles_ = 0.0;
  }

  // Adds a constant force for `frames` samples.
  void push(double force, std::size_t frames) {
    held_ = force;
    held_frames_ = frames;
  }

  // Adds a burst of noise with this initial rms to the current motion; `kept` is the share of its
  // level that remains after each sample. A new burst replaces the last one.
  void rustle(double level, double kept, const BandNoise& noise) {
    burst_ = level;
    burst_left_ = 1.0;
    burst_kept_ = kept;
    burst_noise_ = noise;
  }

  bool is_moving() const {
    return motion_ != Motion::rest || is_struck() || bump_ != 0.0 || held_frames_ > 0;
  }
  bool is_drawn() const { return motion_ == Motion::draw; }
  double value() const { return value_; }
  double target() const { return target_; }

  // Writes the next positions, `step` apart in memory.
  template <class T>
  void fill_positions(std::size_t frames, std::size_t step, T* value, T* velocity) {
    for_parts(frames, [&](std::size_t first, std::size_t end, const double* pulses) {
      std::size_t n = first;
      if (motion_ == Motion::follow && bump_ == 0.0 && pulses == nullptr) {
        n = fill_approach(n, end, step, value, velocity);
      }
      double bump = bump_;
      for (; n < end; ++n) {
        const double before = std::exchange(bump, pulses != nullptr ? pulses[n - first] : 0.0);
        const InputSample sample = move();
        value[n * step] = static_cast<T>(sample.value + bump);
        velocity[n * step] = static_cast<T>(sample.velocity + (bump - before));
      }
      bump_ = bump;
    });
  }

  // Writes the next forces, `step` apart in memory.
  template <class T>
  void fill_forces(std::size_t frames, std::size_t step, T* force) {
    for_parts(frames, [&](std::size_t first, std::size_t end, const double* pulses) {
      for (std::size_t n = first; n < end; ++n) {
        if (motion_ == Motion::follow) {
          approach();
        }
        double now = value_ + (pulses != nullptr ? pulses[n - first] : 0.0);
        if (held_frames_ > 0) {
          now += held_;
          --held_frames_;
        }
        force[n * step] = static_cast<T>(now);
      }
    });
  }

 private:
  enum class Motion : std::uint8_t { rest, follow, sweep, draw };

  bool is_struck() const { return pulse_ != 0.0 || blow_left_ > 0 || burst_left_ > 0.0; }

  static constexpr std::size_t most_pulses = 64;  // computed at once

  // Calls use(first, end, pulses) for the frames of every part; without pulses these are null.
  template <class Use>
  void for_parts(std::size_t frames, Use&& use) {
    for (std::size_t first = 0; first < frames; first += most_pulses) {
      const std::size_t end = std::min(frames, first + most_pulses);
      double pulses[most_pulses];
      const bool is_pulsed = is_struck();
      if (is_pulsed) {
        fill_pulses(end - first, pulses);
      }
      use(first, end, is_pulsed ? pulses : nullptr);
    }
  }

  // Writes the next pulses of blows and bursts. `frames` is not 0.
  void fill_pulses(std::size_t frames, double* pulses) {
    std::fill_n(pulses, frames, 0.0);
    pulses[0] = std::exchange(pulse_, 0.0);
    for (std::size_t n = 0; n < frames && blow_left_ > 0; ++n, --blow_left_) {
      pulses[n] += blow_ * blow_pulse_.at(blow_pulse_.count - blow_left_);
    }
    if (!(burst_left_ > 0.0)) {
      return;
    }
    constexpr double inaudible = 1e-5;  // -100 dB of the burst's start
    const double level = burst_;
    const double kept = burst_kept_;
    double left = burst_left_;
    burst_noise_.each(frames, [&](std::size_t n, double sample) {
      pulses[n] += level * left * sample;
      left *= kept;
      left = left < inaudible ? 0.0 : left;
    });
    burst_left_ = left;
  }

  InputSample move() {
    const double before = value_;
    switch (motion_) {
      case Motion::rest:
        return {value_, 0.0};
      case Motion::follow:
        approach();
        break;
      case Motion::sweep:
        if (std::fabs(target_ - value_) <= speed_) {
          value_ = target_;
          motion_ = Motion::rest;
        } else {
          value_ += target_ > value_ ? speed_ : -speed_;
        }
        break;
      case Motion::draw: {
        velocity_ += (1.0 - pole_) * (speed_ - velocity_);
        if (speed_ == 0.0 && std::fabs(velocity_) < 1e-12) {
          velocity_ = 0.0;
          motion_ = Motion::rest;
        }
        // The velocity is returned directly. The difference of two positions would lose precision
        // once the bow has travelled far.
        const double velocity =
            roughness_ == 0.0 ? velocity_ : velocity_ * (1.0 + roughness_ * rough_.next());
        value_ += velocity;
        return {value_, velocity};
      }
    }
    return {value_, value_ - before};
  }

  double arrival() const { return 1e-12 * (1.0 + std::fabs(target_)); }

  // Writes the approach to a target. Returns the index of the first sample not written.
  template <class T>
  std::size_t fill_approach(std::size_t n, std::size_t frames, std::size_t step, T* value,
                            T* velocity) {
    const double pole = pole_;
    const double target = target_;
    const double pull = (1.0 - pole) * target;
    const double near = arrival();
    double here = value_;
    for (; n < frames; ++n) {
      const double next = pole * here + pull;
      if (std::fabs(target - next) <= near) {
        break;
      }
      value[n * step] = static_cast<T>(next);
      velocity[n * step] = static_cast<T>(next - here);
      here = next;
    }
    value_ = here;
    return n;
  }

  void approach() {
    value_ = pole_ * value_ + (1.0 - pole_) * target_;
    if (std::fabs(target_ - value_) <= arrival()) {
      value_ = target_;
      motion_ = Motion::rest;
    }
  }

  // The fields that every block reads share a cache line.
  double value_ = 0.0;
  double pulse_ = 0.0;
  double bump_ = 0.0;  // displacement by a pulse in this sample
  std::size_t blow_left_ = 0;
  std::size_t held_frames_ = 0;
  double burst_left_ = 0.0;  // share of the burst's initial level; 0: it is over
  Motion motion_ = Motion::rest;
  double velocity_ = 0.0;
  double target_ = 0.0;
  double speed_ = 0.0;
  double pole_ = 0.0;
  double blow_ = 0.0;    // sum of the current pulse
  double cycles_ = 0.0;  // of the motion that its direction follows; 0: none
  RaisedCosine blow_pulse_;
  double held_ = 0.0;
  double burst_ = 0.0;       // initial rms
  double burst_kept_ = 0.0;  // factor per sample
  BandNoise burst_noise_;
  double roughness_ = 0.0;  // rms of the fluctuation of a drawn velocity, as a share of it
  BandNoise rough_;
};

}  // namespace ressort
