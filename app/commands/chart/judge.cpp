#include "app/commands/chart/judge.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "app/commands/chart/reference_scheme.h"
#include "core/analysis/continuous.h"
#include "core/compile/machine.h"
#include "core/engine/energy.h"

namespace ressort::commands {
namespace {

constexpr double exact_db = 400.0;    // indistinguishable from exact
constexpr double trusted_db = 60.0;   // a reference agrees with itself
constexpr double heard_share = 1e-6;  // relative to the peak: here the sound has begun
// largest number of masses and links for a reference at 256 times the rate
constexpr std::size_t small_scene = 1000;
constexpr std::array<double, 3> windows_s = {0.005, 0.05, heard_s};
constexpr unsigned stress_times = 16;
constexpr double stress_s = 0.1;
constexpr double contact_stress_s = 5.0;  // long, because a contact gains little energy at a time
constexpr double stress_gain = 1.1;       // factor of energy, without any work done
// factor of the energy, or twice that of the peak, relative to 16 times the rate
constexpr double stress_excess = 4.0;

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

Waves published_waves(const ChartScene& scene) {
  const Machine machine = make_machine(scene.network, scene_rate_hz, true);
  Waves waves(machine.channels, std::vector<double>(frames_of(heard_s)));
  const auto position_of = [&](const InputSlot& slot, std::size_t n) {
    const InputMotion& motion = scene.motions[slot.input];
    return motion ? motion(static_cast<double>(n) / scene_rate_hz)
                  : machine.inputs[slot.input].position;
  };
  for (const Program& program : machine.parts) {
    std::vector<double> value;
    for (const InputSlot& slot : program.inputs) {
      value.push_back(position_of(slot, 0));
    }
    std::vector<double> velocity(value.size());
    ReferenceScheme scheme(program);
    for (std::size_t n = 0; n < waves[0].size(); ++n) {
      for (std::size_t i = 0; i < value.size(); ++i) {
        const double next = position_of(program.inputs[i], n + 1);
        velocity[i] = next - std::exchange(value[i], next);
      }
      scheme.step(value, velocity);
      const std::vector<double> outputs = scheme.outputs();
      for (std::size_t i = 0; i < outputs.size(); ++i) {
        waves[program.outputs[i].channel][n] += outputs[i];
      }
    }
  }
  return waves;
}

Waves exact_waves(const ChartScene& scene, const std::vector<ContinuousOutput>& outputs) {
  Waves waves(static_cast<std::size_t>(output_count(scene.network)),
              std::vector<double>(frames_of(heard_s)));
  for (std::size_t o = 0; o < outputs.size(); ++o) {
    waves[static_cast<std::size_t>(scene.network.outputs[o].number - 1)] =
        outputs[o].play(frames_of(heard_s), 1.0);
  }
  return waves;
}

// Returns the first audible sample.
std::size_t onset_of(const Waves& waves) {
  const double least = heard_share * peak_of(waves);
  std::size_t first = waves.empty() ? 0 : waves[0].size();
  for (const auto& wave : waves) {
    const auto heard = std::ranges::find_if(wave, [&](double y) { return std::fabs(y) > least; });
    first = std::min(first, static_cast<std::size_t>(heard - wave.begin()));
  }
  return first;
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
    return std::numeric_limits<double>::quiet_NaN();
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

std::optional<EnergyReading> watch_energy(MadeWay& way, double seconds) {
  if (way.methods.find(method_name(Method::oversampled)) != std::string::npos) {
    return std::nullopt;  // its velocities are those of the last of several steps
  }
  const std::vector<Program>& parts = way.machine().parts;
  std::vector<std::vector<double>> coefficients;  // [part]
  for (const Program& program : parts) {
    coefficients.emplace_back();
    for (const Coefficient& one : program.coefficients) {
      coefficients.back().push_back(coefficient_value(program, one, program.parameters, 1.0));
    }
  }
  const unsigned times = way.way.oversampling;
  EnergyReading reading{.highest = -HUGE_VAL};
  States x;
  States v;
  way.player->rewind();
  for (std::size_t n = 0; n < frames_of(seconds); ++n) {
    way.player->play(times, nullptr);
    if (!way.player->save(x, v)) {
      return std::nullopt;
    }
    Energy all;
    std::size_t moving = 0;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (parts[i].moving > 0) {
        const Energy own = energy_of(parts[i], LaneValues<double>{coefficients[i].data()},
                                     x[moving].data(), v[moving].data());
        all.value += times * times * own.value;
        all.uncertainty += times * times * own.uncertainty;
        ++moving;
      }
    }
    reading.first = n == 0 ? all.value + all.uncertainty : reading.first;
    // NaN counts as the highest.
    if (const double least = all.value - all.uncertainty; !(least <= reading.highest)) {
      reading.highest = std::isfinite(least) ? least : HUGE_VAL;
    }
  }
  return reading;
}

std::array<double, 2> References::snr_db(const Waves& found) const {
  const std::size_t end = onset + frames_of(window_s);
  return {signal_to_error_db(published, found, onset, end),
          signal_to_error_db(physical, found, onset, end)};
}

Result<References> find_references(const ChartScene& scene, const ChartScene& stepped, Isa isa) {
  References references{.published = published_waves(stepped), .window_s = windows_s[0]};
  const auto continuous = scene.is_linear
                              ? solve_continuous(scene.network, parameter_values(scene.network))
                              : std::nullopt;
  Waves half_rate;
  if (continuous) {
    references.physical = exact_waves(scene, *continuous);
    references.is_exact = true;
    references.how = "exact modes";
  } else {
    const std::size_t size = scene.network.masses.size() + scene.network.links.size();
    const unsigned times = size <= small_scene ? 256 : 64;
    auto fine = make_way(scene, direct_at(times), 0.0, isa);
    auto half = make_way(scene, direct_at(times / 2), 0.0, isa);
    if (!fine || !half) {
      return fine ? half.error() : fine.error();
    }
    references.physical = render_way(*fine, frames_of(heard_s));
    references.how = "direct at " + std::to_string(times) + "x";
    half_rate = render_way(*half, frames_of(heard_s));
  }
  references.onset = onset_of(references.physical);
  // Contacts are chaotic: their waveforms can be compared for some milliseconds only.
  for (const double window_s : windows_s) {
    const double floor_db =
        continuous ? exact_db
                   : signal_to_error_db(references.physical, half_rate, 0, frames_of(window_s));
    if (window_s == windows_s[0] || (!scene.has_contacts && floor_db >= trusted_db)) {
      references.window_s = window_s;
      references.floor_db = floor_db;
    }
  }
  return references;
}

Stress::Stress(const ChartScene& scene, Isa isa) : isa_(isa) {
  if (scene.has_contacts || scene.is_driven()) {
    cases_.push_back({.name = "as written", .scene = scene});
  }
  cases_.push_back({.name = "struck ten times harder", .scene = struck_harder(scene)});
  for (Case& one : cases_) {
    const double seconds = stress_length_s(one.scene);
    if (auto fine = make_way(one.scene, direct_at(stress_times), seconds, isa_)) {
      one.peak = peak_of(render_way(*fine, frames_of(seconds)));
      const auto energy = watch_energy(*fine, seconds);
      one.energy = energy ? energy->highest : HUGE_VAL;
    }
    // An input that moves too fast to do much work must not tighten the bounds.
    one.peak = std::max(one.peak, cases_[0].peak);
    one.energy = std::max(one.energy, cases_[0].energy);
  }
}

std::string Stress::verdict(const Way& way) const {
  for (const Case& one : cases_) {
    const double seconds = stress_length_s(one.scene);
    auto made = make_way(one.scene, way, seconds, isa_);
    if (!made) {
      continue;
    }
    const double peak = peak_of(render_way(*made, frames_of(seconds)));
    if (!(peak < runaway)) {
      return one.name + ": grows without bounds";
    }
    const auto energy = watch_energy(*made, seconds);
    if (!energy && peak > std::sqrt(stress_excess) * one.peak) {
      return one.name + ": louder than possible";
    }
    if (energy && !one.scene.is_driven() && energy->highest > stress_gain * energy->first) {
      return one.name + ": gains energy";
    }
    if (energy && one.scene.is_driven() && energy->highest > stress_excess * one.energy) {
      return one.name + ": has more energy than the input supplies";
    }
  }
  return "";
}

}  // namespace ressort::commands
