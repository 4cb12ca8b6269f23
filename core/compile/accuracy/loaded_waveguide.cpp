#include "core/compile/accuracy/loaded_waveguide.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "core/compile/accuracy/springs.h"
#include "core/kernels/waveguides/rails.h"
#include "core/linear_algebra/complex.h"
#include "core/ranges.h"

namespace ressort::compile {
namespace {

using Complex = std::complex<double>;

// Largest detuning by the load, as a logarithm of the factor. The second partial is at ln 4.
constexpr double most_detuning = 1.1;
// Ratio of frequencies beyond the limits of a waveguide at which its design is no longer
// meaningful.
constexpr double out_of_range = 1.5;

// [place, 2] delay in samples from the filters: of the left-going and of the right-going wave.
using Delays = std::vector<std::uint32_t>;

// The transfer functions of a waveguide at one pole.
struct Loop {
  // Delay from one position to another.
  Complex after(std::uint32_t from, std::uint32_t to) const {
    return std::pow(back, static_cast<int>(to) - static_cast<int>(from));
  }
  // Gain of one round trip.
  Complex round() const { return filters * after(0, samples); }
  // From the filters' output to a place, and from a place to the filters' output.
  Complex heard(std::size_t place) const {
    return after(0, right(place)) + sign * after(0, left(place));
  }
  Complex sent(std::size_t place) const {
    return filters * (after(right(place), samples) + sign * after(left(place), samples));
  }
  // From one place to another without passing the filters.
  Complex between(std::size_t from, std::size_t to) const {
    Complex sum = 0.0;
    for (const auto& [start, way] : {std::pair(right(from), 1.0), std::pair(left(from), sign)}) {
      for (const auto& [end, other] : {std::pair(right(to), 1.0), std::pair(left(to), sign)}) {
        sum += end > start ? way * other * after(start, end) : 0.0;
      }
    }
    return sum;
  }
  std::uint32_t left(std::size_t place) const { return (*delays)[2 * place]; }
  std::uint32_t right(std::size_t place) const { return (*delays)[2 * place + 1]; }

  double inverse_impedance = 0.0;
  double sign = 1.0;  // sign of the left-going wave
  Complex back;       // 1/z
  Complex filters;
  std::uint32_t samples = 0;
  const Delays* delays = nullptr;
};

class LoadedWaveguide final : public TunedMotion {
 public:
  LoadedWaveguide(const Program& program, std::span<const double> parameters, std::size_t tuned,
                  const Progress& progress)
      : program_(program), parameters_(parameters), tuned_(tuned), progress_(progress) {
    const std::vector<double> value = values_at(1.0);
    const WaveguideSlot& slot = program.waveguides[tuned];
    own_hz_ = value[slot.frequency];
    highest_hz_ = highest_waveguide_hz(least_waveguide_samples(slot.count), program.rate_hz);
  }

  bool round_at(double log_factor) override;
  Complex residual(double log_factor, double decay, double theta) const override;
  double alone_at(double theta) const override {
    const double hz = theta * program_.rate_hz / (2.0 * std::numbers::pi);
    return (hz / own_hz_) * (hz / own_hz_);
  }
  double decay_at(double factor) const override {
    const double t60_s = values_at(factor)[program_.waveguides[tuned_].t60];
    return 3.0 * std::numbers::ln10 / (t60_s * program_.rate_hz);
  }

 private:
  std::vector<double> values_at(double factor) const {
    return mapped(program_.coefficients, [&](const Coefficient& coefficient) {
      return coefficient_value(program_, coefficient, parameters_, factor);
    });
  }
  WaveguideDesign design_of(const WaveguideSlot& slot, const std::vector<double>& value) const {
    return design_waveguide({.frequency_hz = value[slot.frequency],
                             .t60_s = value[slot.t60],
                             .brightness = value[slot.brightness]},
                            least_waveguide_samples(slot.count), most_waveguide_samples(program_),
                            program_.rate_hz);
  }
  Loop loop_of(std::size_t guide, const std::vector<double>& value, Complex z) const;

  const Program& program_;
  std::span<const double> parameters_;
  std::size_t tuned_;
  const Progress& progress_;
  double own_hz_;
  double highest_hz_;           // limit by the number of places
  std::vector<Delays> delays_;  // [waveguide]
};

bool LoadedWaveguide::round_at(double log_factor) {
  const std::vector<double> value = values_at(std::exp(log_factor));
  std::vector<Delays> rounded;
  for (const WaveguideSlot& slot : program_.waveguides) {
    std::vector<double> u;
    for (std::uint32_t i = 0; i < slot.count; ++i) {
      u.push_back(value[program_.junctions[slot.first + i].u]);
    }
    Delays order(std::size_t{2} * slot.count);
    rounded.emplace_back(order.size());
    find_places(design_of(slot, value), slot.filters_at, u, order, rounded.back());
  }
  return std::exchange(delays_, rounded) != rounded;
}

Loop LoadedWaveguide::loop_of(std::size_t guide, const std::vector<double>& value,
                              Complex z) const {
  const WaveguideSlot& slot = program_.waveguides[guide];
  const WaveguideDesign design = design_of(slot, value);
  const Complex back = 1.0 / z;
  return {.inverse_impedance = value[slot.inverse_impedance],
          .sign = slot.is_open ? 1.0 : -1.0,
          .back = back,
          .filters = design.gain * (1.0 - design.pole) / (1.0 - design.pole * back) *
                     (design.allpass + back) / (1.0 + design.allpass * back),
          .samples = design.samples,
          .delays = &delays_[guide]};
}

Complex LoadedWaveguide::residual(double log_factor, double decay, double theta) const {
  const double hz = own_hz_ * std::exp(0.5 * log_factor);
  if (std::fabs(log_factor - std::log(alone_at(theta))) > most_detuning ||
      hz > out_of_range * highest_hz_ || hz * out_of_range < lowest_waveguide_hz) {
    return std::nan("");
  }
  const std::vector<double> value = values_at(std::exp(log_factor));
  const Complex z = std::exp(Complex(-decay, theta));
  const Complex back = 1.0 / z;
  const Complex both = z - back;  // central difference over two samples
  // Displacement of each mass under a force of 1.
  std::vector<Complex> gives(program_.moving);
  for (const MassRun& run : program_.mass_runs) {
    if (run.is_junction) {
      continue;
    }
    const Complex own =
        run.is_oscillator ? value[run.stiffness] + value[run.damping] * (1.0 - back) : Complex(0.0);
    const Complex held = (z - 2.0 + back) + value[run.inverse_mass] * own;
    std::fill_n(gives.begin() + run.first, run.count, value[run.inverse_mass] / held);
  }
  std::vector<Loop> loops;
  struct Place {
    std::size_t loop = 0;
    std::size_t number = 0;
    bool is_one = false;
  };
  std::vector<Place> places(program_.moving);
  for (const WaveguideSlot& slot : program_.waveguides) {
    for (std::uint32_t i = 0; i < slot.count; ++i) {
      places[program_.junctions[slot.first + i].node] = {loops.size(), i, true};
    }
    loops.push_back(loop_of(loops.size(), value, z));
  }
  // Displacement of one place under a force of 1 on another.
  const auto way = [&](const Place& a, const Place& b, bool is_same) {
    if (a.loop != b.loop) {
      return Complex(0.0);
    }
    const Loop& loop = loops[a.loop];
    const Complex sum = (is_same ? 1.0 : 0.0) + loop.between(b.number, a.number);
    return loop.inverse_impedance * sum / both;
  };
  std::vector<SpringDamper> springs = spring_dampers_of(program_, value);
  std::erase_if(springs,
                [](const SpringDamper& spring) { return spring.is_own || spring.shares.empty(); });
  const std::size_t guides = loops.size();
  ComplexMatrix rows(guides + springs.size(), guides + springs.size());
  // The tuned loop has row 0.
  const auto row_of = [&](std::size_t loop) {
    return loop == tuned_ ? 0 : (loop < tuned_ ? loop + 1 : loop);
  };
  for (std::size_t g = 0; g < guides; ++g) {
    rows(row_of(g), row_of(g)) = 1.0 - loops[g].round();
  }
  // Elongation of each spring under a tension of 1 in each: by shared masses and by pairs of
  // places.
  std::vector<Complex> moved(program_.moving);
  for (std::size_t k = 0; k < springs.size(); ++k) {
    for (const auto& [node, share] : springs[k].shares) {
      moved[node] += share * gives[node];
    }
    for (std::size_t i = 0; i < springs.size(); ++i) {
      Complex& longer = rows(guides + i, guides + k);
      for (const auto& [node, share] : springs[i].shares) {
        longer += share * moved[node];
        for (std::size_t j = 0; places[node].is_one && j < springs[k].shares.size(); ++j) {
          const auto& [other, weight] = springs[k].shares[j];
          longer += places[other].is_one
                        ? share * weight * way(places[node], places[other], node == other)
                        : Complex(0.0);
        }
      }
      progress_.spend(springs[i].shares.size());
    }
    for (const auto& [node, share] : springs[k].shares) {
      moved[node] = 0.0;
    }
  }
  for (std::size_t i = 0; i < springs.size(); ++i) {
    const SpringDamper& spring = springs[i];
    const Complex pull = spring.scheme == Scheme::plain
                             ? spring.stiffness + spring.damping * (1.0 - back)
                             : 0.5 * (spring.stiffness * (z + back) + spring.damping * both);
    const std::size_t row = guides + i;
    for (std::size_t k = 0; k < springs.size(); ++k) {
      rows(row, guides + k) *= pull;
    }
    rows(row, row) += 1.0;
    for (const auto& [node, share] : spring.shares) {
      if (places[node].is_one) {
        const Loop& loop = loops[places[node].loop];
        const std::size_t column = row_of(places[node].loop);
        const std::size_t number = places[node].number;
        rows(row, column) -= pull * share * 2.0 * loop.heard(number) / both;
        rows(column, row) += 0.5 * loop.inverse_impedance * share * loop.sent(number);
      }
    }
  }
  progress_.spend(springs.size() * springs.size() * springs.size() / 3);
  return schur_complement_of_first(std::move(rows));
}

}  // namespace

std::optional<Pitches> loaded_waveguide_pitches(const Machine& machine,
                                                std::span<const double> parameters,
                                                const Progress& progress,
                                                const PitchWindow& window) {
  const Program* part = nullptr;
  std::size_t tuned = 0;
  double lowest_hz = 0.0;
  for (const Program& program : machine.parts) {
    for (std::size_t i = 0; i < program.waveguides.size(); ++i) {
      const Coefficient& frequency = program.coefficients[program.waveguides[i].frequency];
      const double hz = coefficient_value(program, frequency, parameters, 1.0);
      if (!frequency.is_fixed && (part == nullptr || hz < lowest_hz)) {
        part = &program;
        tuned = i;
        lowest_hz = hz;
      }
    }
  }
  std::size_t springs = 0;
  for (const LinkRun& run : part == nullptr ? std::vector<LinkRun>() : part->link_runs) {
    springs += facts_of(run.law).contains_spring ? run.count : 0;
  }
  if (part == nullptr || springs > most_loading_springs) {
    return std::nullopt;
  }
  progress.stage("tuning its waveguide");
  LoadedWaveguide waveguide(*part, parameters, tuned, progress);
  return make_pitches(waveguide, part->rate_hz, window);
}

}  // namespace ressort::compile
