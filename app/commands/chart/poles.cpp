// The poles of a way, found by watching its kernels: whatever it computes, each partial follows
// y[n+2] = a y[n+1] + b y[n].
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "app/commands/chart/judge.h"
#include "core/compile/machine.h"

namespace ressort::commands {
namespace {

constexpr std::size_t most_mapped = 128;  // states, where partials do not swing alone

// Which mass of the network a node is: the same machine once more, with the masses' numbers for
// their positions.
States numbers_of(const ChartScene& scene, const Machine& machine) {
  Network numbered = scene.network;
  for (std::size_t i = 0; i < numbered.masses.size(); ++i) {
    numbered.masses[i].position = static_cast<double>(i);
    numbered.masses[i].third = static_cast<double>(i);
  }
  const Machine twin = make_machine(numbered, machine.rate_hz, machine.rate_ratio != 1.0);
  States numbers;
  for (const Program& program : twin.parts) {
    if (program.moving > 0) {
      numbers.push_back(program.position);
    }
  }
  return numbers;
}

bool fits(const States& numbers, const Machine& machine) {
  std::size_t part = 0;
  for (const Program& program : machine.parts) {
    if (program.moving > 0 &&
        (part >= numbers.size() || numbers[part++].size() != program.position.size())) {
      return false;
    }
  }
  return part == numbers.size();
}

// Where the machine's nodes are, and what moves of them.
class Placer {
 public:
  Placer(const ChartScene& scene, const Machine& machine)
      : numbers_(numbers_of(scene, machine)), fits_(fits(numbers_, machine)) {
    for (const Program& program : machine.parts) {
      if (program.moving > 0) {
        moving_.push_back(program.moving);
        rest_.push_back(program.position);
        still_.emplace_back(program.position.size(), 0.0);
      }
    }
  }
  bool fits_machine() const { return fits_; }

  // Displaced from where it rests by a shape over the network's masses.
  void shape(ChartPlayer& player, const std::vector<double>& rest,
             const std::vector<double>& shape) const {
    States x = rest_;
    for (std::size_t part = 0; part < x.size(); ++part) {
      for (std::size_t node = 0; node < moving_[part]; ++node) {
        const auto mass = static_cast<std::size_t>(numbers_[part][node]);
        x[part][node] = rest[mass] + shape[mass];
      }
    }
    player.place(x, still_);
  }

  std::size_t states() const {
    std::size_t sum = 0;
    for (const std::size_t moving : moving_) {
      sum += 2 * moving;
    }
    return sum;
  }

  // All at 0 and still, but for one number of the state, which is 1: positions and velocities of
  // the moving nodes in turn. All of them, where `state` is beyond.
  void unit(ChartPlayer& player, std::size_t state) const {
    States x = rest_;
    States v = still_;
    std::size_t next = 0;
    for (std::size_t part = 0; part < x.size(); ++part) {
      for (std::size_t i = 0; i < moving_[part]; ++i) {
        x[part][i] = next++ == state ? 1.0 : 0.0;
        v[part][i] = next++ == state ? 1.0 : 0.0;
      }
    }
    player.place(x, v);
  }

  bool read(const ChartPlayer& player, std::vector<double>& state) const {
    States x = rest_;
    States v = still_;
    if (!player.save(x, v)) {
      return false;
    }
    state.clear();
    for (std::size_t part = 0; part < x.size(); ++part) {
      for (std::size_t i = 0; i < moving_[part]; ++i) {
        state.push_back(x[part][i]);
        state.push_back(v[part][i]);
      }
    }
    return true;
  }

 private:
  States numbers_;
  bool fits_;
  std::vector<std::size_t> moving_;
  States rest_;
  States still_;
};

// e^(pole * steps) solves z^2 = a z + b; the pole per step.
std::complex<double> pole_from(double a, double b, std::size_t steps) {
  const double radius = std::sqrt(-b);
  const double cosine = a / (2.0 * radius);
  if (!(b < 0.0) || !(std::fabs(cosine) < 1.0)) {
    return {unknown, unknown};
  }
  return std::complex<double>(std::log(radius), std::acos(cosine)) / static_cast<double>(steps);
}

// One partial that swings alone, by samples that are about a quarter of its period apart.
std::complex<double> watch_partial(MadeWay& way, const Placer& placer,
                                   const std::vector<double>& masses_rest,
                                   const std::vector<double>& outputs_rest,
                                   const ContinuousMode& mode) {
  const double turn = mode.pole.imag() / way.way.oversampling;  // per sample of the machine
  const auto steps =
      static_cast<std::size_t>(std::max(1.0, std::round(std::numbers::pi / 2.0 / turn)));
  const std::size_t channels = way.machine().channels;
  placer.shape(*way.player, masses_rest, mode.shape);
  std::vector<double> y(3 * steps * channels + channels);
  way.player->play(1, y.data());  // nothing has pulled yet
  way.player->play(3 * steps, y.data() + channels);
  // Least squares over the channels: y2 = a y1 + b y0 and y3 = a y2 + b y1.
  double s11 = 0.0;
  double s12 = 0.0;
  double s22 = 0.0;
  double r1 = 0.0;
  double r2 = 0.0;
  for (std::size_t c = 0; c < channels; ++c) {
    const auto at = [&](std::size_t i) { return y[i * steps * channels + c] - outputs_rest[c]; };
    for (const std::size_t i : {std::size_t{0}, std::size_t{1}}) {
      s11 += at(i + 1) * at(i + 1);
      s12 += at(i + 1) * at(i);
      s22 += at(i) * at(i);
      r1 += at(i + 2) * at(i + 1);
      r2 += at(i + 2) * at(i);
    }
  }
  const double det = s11 * s22 - s12 * s12;
  return pole_from((r1 * s22 - r2 * s12) / det, (r2 * s11 - r1 * s12) / det, steps);
}

// All poles at once, from what a step makes of every state.
Poles map_states(MadeWay& way, const Placer& placer) {
  std::vector<std::vector<double>> before;
  std::vector<std::vector<double>> after;
  std::vector<double> base[2];
  const std::size_t count = placer.states();
  for (std::size_t i = 0; i <= count; ++i) {
    std::vector<double> state[2];
    placer.unit(*way.player, i == 0 ? count : i - 1);
    for (std::vector<double>& one : state) {
      way.player->play(1, nullptr);
      if (!placer.read(*way.player, one)) {
        return {};
      }
    }
    for (std::size_t k = 0; k < 2; ++k) {
      if (i == 0) {
        base[k] = state[k];
        continue;
      }
      std::transform(state[k].begin(), state[k].end(), base[k].begin(), state[k].begin(),
                     std::minus<>());
      (k == 0 ? before : after).push_back(std::move(state[k]));
    }
  }
  Poles poles;
  for (const std::complex<double>& factor : factors_between(before, after)) {
    poles.push_back(std::log(factor));
  }
  return poles;
}

std::complex<double> nearest(const Poles& poles, std::complex<double> wanted) {
  std::complex<double> best{unknown, unknown};
  double distance = HUGE_VAL;
  for (const std::complex<double>& pole : poles) {
    if (pole.imag() > 0.0 && std::abs(pole - wanted) < distance) {
      distance = std::abs(pole - wanted);
      best = pole;
    }
  }
  return best;
}

}  // namespace

Poles poles_of(const ChartScene& scene, const Continuous& continuous, MadeWay& way) {
  const Placer placer(scene, way.machine());
  if (!placer.fits_machine()) {
    return {};
  }
  const double machine_rate_hz = scene_rate_hz * way.way.oversampling;
  Poles all;
  if (!continuous.is_proportional && placer.states() <= most_mapped) {
    all = map_states(way, placer);
  }
  std::vector<double> outputs_rest(way.machine().channels);
  for (std::size_t o = 0; o < continuous.outputs.size(); ++o) {
    outputs_rest[static_cast<std::size_t>(scene.network.outputs[o].number - 1)] +=
        continuous.outputs[o].rest;
  }
  Poles poles;
  for (const ContinuousMode& mode : continuous.modes) {
    std::complex<double> pole{unknown, unknown};
    if (!continuous.is_proportional) {
      pole = nearest(all, mode.pole / static_cast<double>(way.way.oversampling));
    } else if (mode.loudness >= 1e-3) {
      pole = watch_partial(way, placer, continuous.rest, outputs_rest, mode);
    }
    poles.push_back(pole * machine_rate_hz);
  }
  return poles;
}

}  // namespace ressort::commands
