#include "app/commands/chart/judge.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/compile/machine.h"
#include "core/engine/reference.h"

namespace ressort::commands {
namespace {

constexpr double exact_db = 400.0;         // what cannot be told from exact
constexpr double trusted_db = 60.0;        // a reference agrees with itself
constexpr double heard_share = 1e-6;       // of the peak: the sound has begun
constexpr double loud_partial = 1e-3;      // 60 dB below the loudest
constexpr std::size_t small_scene = 1000;  // masses and links, for 256 times the rate
constexpr unsigned stress_times = 16;
constexpr double stress_s = 0.1;
constexpr double contact_stress_s = 5.0;  // a contact gains little at a time
constexpr double stress_gain = 1.1;       // of energy, without any work done
constexpr double stress_excess = 4.0;     // of energy, or twice the peak, above 16 times the rate

double stress_length_s(const ChartScene& scene) {
  const auto elements =
      static_cast<double>(scene.network.masses.size() + scene.network.links.size());
  return scene.has_contacts && !scene.is_driven()
             ? std::clamp(100.0 / elements, stress_s, contact_stress_s)
             : stress_s;
}

std::size_t frames_of(double seconds) {
  return static_cast<std::size_t>(std::lround(seconds * scene_rate_hz));
}

Way direct_at(unsigned times) {
  return {.name = "reference", .method = Method::direct, .oversampling = times};
}

double peak_of(const Waves& waves) {
  double peak = 0.0;
  for (const auto& wave : waves) {
    for (const double y : wave) {
      peak = std::isfinite(y) ? std::max(peak, std::fabs(y)) : HUGE_VAL;
    }
  }
  return peak;
}

std::array<double, 3> snr_of(const Waves& reference, const Waves& found, std::size_t onset) {
  std::array<double, 3> db{};
  for (std::size_t w = 0; w < db.size(); ++w) {
    db[w] = signal_to_error_db(reference, found, onset, onset + frames_of(chart_windows_s[w]));
  }
  return db;
}

// Keeps the first and the highest.
class EnergyMeter {
 public:
  void add(const StoredEnergy& energy) {
    if (!has_begun_) {
      reading_.first = energy.total;
    }
    has_begun_ = true;
    // Not a number is more than any.
    if (energy.held == 0.0 && !(energy.total <= highest_)) {
      highest_ = std::isfinite(energy.total) ? energy.total : HUGE_VAL;
    }
    held_ = std::max(held_, energy.total);
  }
  EnergyReading reading() const {
    return {reading_.first, highest_ > -HUGE_VAL ? highest_ : held_};
  }

 private:
  EnergyReading reading_;
  bool has_begun_ = false;
  double highest_ = -HUGE_VAL;  // while nothing is held
  double held_ = -HUGE_VAL;     // at any time
};

// What drives one part, sample by sample.
class PartInputs {
 public:
  PartInputs(const ChartScene& scene, const Machine& machine, const Program& program)
      : value(program.inputs.size()), velocity(value.size()) {
    for (const InputSlot& input : program.inputs) {
      motion_.push_back(scene.motions[input.input]);
      rest_.push_back(machine.inputs[input.input].position);
    }
    move_to(0.0);
  }
  void move_to(double seconds) {
    for (std::size_t i = 0; i < value.size(); ++i) {
      const double next = motion_[i] ? motion_[i](seconds) : rest_[i];
      velocity[i] = next - value[i];
      value[i] = next;
    }
  }
  std::vector<double> value;
  std::vector<double> velocity;

 private:
  std::vector<InputMotion> motion_;
  std::vector<double> rest_;
};

// Adds one part's sound and energy to those of the others.
void play_reference(const Program& program, PartInputs inputs, Waves& waves,
                    std::vector<StoredEnergy>& energy) {
  ReferenceScheme book(program);
  std::vector<double> x;
  std::vector<double> v;
  for (std::size_t n = 0; n < waves[0].size(); ++n) {
    inputs.move_to(static_cast<double>(n + 1) / scene_rate_hz);
    book.step(inputs.value, inputs.velocity);
    const std::vector<double> outputs = book.outputs();
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      waves[program.outputs[i].channel][n] += outputs[i];
    }
    if (n > energy.size()) {
      continue;
    }
    std::vector<double> after = book.velocities();
    if (n > 0) {
      const StoredEnergy more = energy_of(program, x, v, after);
      energy[n - 1].total += more.total;
      energy[n - 1].held += more.held;
    }
    x = book.positions();
    v = std::move(after);
  }
}

Reference published(const ChartScene& scene) {
  const Machine machine = make_machine(scene.network, scene_rate_hz, true);
  Reference reference{.waves = Waves(machine.channels, std::vector<double>(frames_of(heard_s))),
                      .how = "long double"};
  reference.floor_db.fill(exact_db);
  std::vector<StoredEnergy> energy(frames_of(energy_s));
  for (const Program& program : machine.parts) {
    play_reference(program, PartInputs(scene, machine, program), reference.waves, energy);
  }
  EnergyMeter meter;
  for (const StoredEnergy& one : energy) {
    meter.add(one);
  }
  reference.energy = meter.reading().highest;
  return reference;
}

Reference exact(const ChartScene& scene, const Continuous& continuous) {
  const std::size_t frames = frames_of(heard_s);
  Reference reference{.waves = Waves(static_cast<std::size_t>(output_count(scene.network)),
                                     std::vector<double>(frames)),
                      .how = "exact modes"};
  reference.floor_db.fill(exact_db);
  for (std::size_t o = 0; o < continuous.outputs.size(); ++o) {
    reference.waves[static_cast<std::size_t>(scene.network.outputs[o].number - 1)] =
        continuous.play(o, frames, 1.0);
  }
  const Machine machine = make_machine(scene.network, scene_rate_hz, true);
  for (const Program& program : machine.parts) {
    reference.energy +=
        energy_of(program, program.position, program.velocity, program.velocity).total;
  }
  return reference;
}

Result<Reference> rendered(const ChartScene& scene, Isa isa) {
  const unsigned times =
      scene.network.masses.size() + scene.network.links.size() <= small_scene ? 256 : 64;
  auto fine = make_way(scene, direct_at(times), 0.0, isa);
  auto half = make_way(scene, direct_at(times / 2), 0.0, isa);
  if (!fine) {
    return fine.error();
  }
  if (!half) {
    return half.error();
  }
  Reference reference{.waves = render_way(*fine, frames_of(heard_s)),
                      .how = "direct at " + std::to_string(times) + "x"};
  reference.floor_db = snr_of(reference.waves, render_way(*half, frames_of(heard_s)), 0);
  if (const auto energy = watch_energy(scene, *fine, energy_s)) {
    reference.energy = energy->highest;
  }
  return reference;
}

// The first sample that can be heard.
std::size_t onset_of(const Waves& waves) {
  const double least = heard_share * peak_of(waves);
  std::size_t first = waves.empty() ? 0 : waves[0].size();
  for (const auto& wave : waves) {
    const auto heard =
        std::find_if(wave.begin(), wave.end(), [&](double y) { return std::fabs(y) > least; });
    first = std::min(first, static_cast<std::size_t>(heard - wave.begin()));
  }
  return first;
}

Against beside(const ChartScene& scene, const Reference& reference, const References& references,
               const Poles& right, const Poles& found, const Waves& waves) {
  Against against{.snr_db = snr_of(reference.waves, waves, references.onset),
                  .cents = unknown,
                  .t60_percent = unknown,
                  .energy = unknown};
  for (std::size_t j = 0; j < found.size() && scene.is_linear; ++j) {
    if (references.continuous->modes[j].loudness < loud_partial ||
        !std::isfinite(found[j].imag()) || !std::isfinite(right[j].imag())) {
      continue;
    }
    const double cents = std::fabs(1200.0 * std::log2(found[j].imag() / right[j].imag()));
    against.cents = std::fmax(against.cents, cents);
    if (right[j].real() < 0.0) {
      const double off = std::fabs(100.0 * (right[j].real() / found[j].real() - 1.0));
      against.t60_percent = std::fmax(against.t60_percent, off);
    }
  }
  return against;
}

}  // namespace

double signal_to_error_db(const Waves& reference, const Waves& found, std::size_t from,
                          std::size_t to) {
  double signal = 0.0;
  double error = 0.0;
  for (std::size_t c = 0; c < reference.size(); ++c) {
    for (std::size_t n = from; n < std::min(to, reference[c].size()); ++n) {
      const double off = found[c][n] - reference[c][n];
      signal += reference[c][n] * reference[c][n];
      error += off * off;
    }
  }
  if (!std::isfinite(error) || !(signal > 0.0)) {
    return unknown;
  }
  return error > 0.0 ? std::min(exact_db, 10.0 * std::log10(signal / error)) : exact_db;
}

Waves render_way(MadeWay& way, std::size_t frames) {
  const std::size_t channels = way.machine().channels;
  const unsigned times = way.way.oversampling;
  constexpr std::size_t chunk = 256;
  Waves waves(channels, std::vector<double>(frames));
  std::vector<double> block(chunk * times * channels);
  way.player->rewind();
  for (std::size_t n = 0; n < frames; n += chunk) {
    const std::size_t count = std::min(chunk, frames - n);
    way.player->play(count * times, block.data());
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t c = 0; c < channels; ++c) {
        waves[c][n + i] = block[((i + 1) * times - 1) * channels + c];
      }
    }
  }
  return waves;
}

std::optional<EnergyReading> watch_energy(const ChartScene& scene, MadeWay& way, double seconds) {
  const Machine machine = make_machine(scene.network, scene_rate_hz, true);
  std::vector<const Program*> programs;
  for (const Program& program : machine.parts) {
    if (program.moving > 0) {
      programs.push_back(&program);
    }
  }
  States x(programs.size());
  States v(programs.size());
  States next_x(programs.size());
  States next_v(programs.size());
  const unsigned times = way.way.oversampling;
  EnergyMeter meter;
  way.player->rewind();
  way.player->play(1, nullptr);
  if (!way.player->save(x, v) || x.size() != programs.size()) {
    return std::nullopt;
  }
  for (std::size_t n = 0; n < frames_of(seconds); ++n) {
    way.player->play(1, nullptr);
    way.player->save(next_x, next_v);
    StoredEnergy energy;
    for (std::size_t i = 0; i < programs.size(); ++i) {
      if (x[i].size() != programs[i]->position.size()) {
        return std::nullopt;  // what is stepped is not what is written
      }
      for (std::size_t node = 0; node < x[i].size(); ++node) {
        v[i][node] *= times;
        next_v[i][node] *= times;
      }
      const StoredEnergy more = energy_of(*programs[i], x[i], v[i], next_v[i]);
      energy.total += more.total;
      energy.held += more.held;
    }
    meter.add(energy);
    if (times > 1) {
      way.player->play(times - 1, nullptr);
      way.player->save(x, v);
    } else {
      std::swap(x, next_x);
      std::swap(v, next_v);
    }
  }
  return meter.reading();
}

Result<References> find_references(const ChartScene& scene, const ChartScene& stepped, Isa isa) {
  References references{.identical = published(stepped)};
  if (scene.is_linear) {
    references.continuous = solve_continuous(scene.network, parameter_values(scene.network));
  }
  if (references.continuous) {
    references.physical = exact(scene, *references.continuous);
  } else {
    auto physical = rendered(scene, isa);
    if (!physical) {
      return physical.error();
    }
    references.physical = *std::move(physical);
  }
  references.onset = onset_of(references.physical.waves);
  for (std::size_t w = 1; w < chart_windows_s.size() && !scene.has_contacts; ++w) {
    if (references.physical.floor_db[w] >= trusted_db) {
      references.window = w;
    }
  }
  return references;
}

Judged judge(const ChartScene& scene, const References& references, const Poles& published_poles,
             MadeWay& way, const Waves& waves) {
  Judged judged;
  judged.is_finite = peak_of(waves) < runaway;
  Poles poles;
  Poles right;
  if (references.continuous && judged.is_finite) {
    poles = way.way.precision == Precision::float64 ? poles_of(scene, *references.continuous, way)
                                                    : Poles();
    for (const ContinuousMode& mode : references.continuous->modes) {
      right.push_back(mode.pole * scene_rate_hz);
    }
  }
  judged.identical = beside(scene, references.identical, references, published_poles,
                            published_poles.empty() ? Poles() : poles, waves);
  judged.physical = beside(scene, references.physical, references, right, poles, waves);
  judged.energy_gain = unknown;
  if (const auto energy = watch_energy(scene, way, energy_s)) {
    judged.identical.energy = energy->highest / references.identical.energy;
    judged.physical.energy = energy->highest / references.physical.energy;
    if (!scene.is_driven()) {
      judged.energy_gain = energy->highest / energy->first;
    }
  }
  return judged;
}

Stress::Stress(const ChartScene& scene, Isa isa) : isa_(isa) {
  ChartScene worst = scene;
  for (std::size_t p = 0; p < worst.network.parameters.size(); ++p) {
    worst.network.parameters[p].value = scene.worst[p];
  }
  const bool has_range = worst.network.parameters != scene.network.parameters;
  if (scene.has_contacts) {
    cases_.push_back({.name = "as it is", .scene = scene});
  }
  if (!scene.is_linear || !has_range) {
    cases_.push_back({.name = "hit ten times harder", .scene = struck_harder(scene)});
  }
  if (has_range) {
    cases_.push_back({.name = "at the ends of the ranges", .scene = worst});
  }
  if (has_range && !scene.is_linear) {
    cases_.push_back(
        {.name = "hit harder at the ends of the ranges", .scene = struck_harder(worst)});
  }
  // An input that is too fast to do much is not to blame for little more: what it usually does
  // counts.
  Case usual{.name = "", .scene = scene};
  if (scene.is_driven()) {
    measure(usual);
  }
  for (Case& one : cases_) {
    measure(one);
    one.peak = std::max(one.peak, usual.peak);
    one.energy = std::max(one.energy, usual.energy);
  }
}

void Stress::measure(Case& one) const {
  const double seconds = stress_length_s(one.scene);
  if (auto fine = make_way(one.scene, direct_at(stress_times), seconds, isa_)) {
    one.peak = peak_of(render_way(*fine, frames_of(seconds)));
    const auto energy = watch_energy(one.scene, *fine, seconds);
    one.energy = energy ? energy->highest : HUGE_VAL;
  }
}

std::string Stress::verdict(const Way& way) const {
  for (const Case& one : cases_) {
    if (std::string why = verdict(one, way); !why.empty()) {
      return one.name + ": " + why;
    }
  }
  return "";
}

std::string Stress::verdict(const Case& one, const Way& way) const {
  const double seconds = stress_length_s(one.scene);
  auto made = make_way(one.scene, way, seconds, isa_);
  if (!made) {
    return "";
  }
  const double peak = peak_of(render_way(*made, frames_of(seconds)));
  if (!(peak < runaway)) {
    return "out of all bounds";
  }
  const auto energy = watch_energy(one.scene, *made, seconds);
  if (!energy) {
    return peak > std::sqrt(stress_excess) * one.peak ? "louder than it can be" : "";
  }
  if (!one.scene.is_driven()) {
    return energy->highest > stress_gain * energy->first ? "gains energy" : "";
  }
  return energy->highest > stress_excess * one.energy ? "has more energy than it got" : "";
}

}  // namespace ressort::commands
