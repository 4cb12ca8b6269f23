#include "core/kernels/measure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include "core/kernels/kernel.h"
#include "core/kernels/modal/modal_form.h"
#include "core/kernels/oversampled/oversampled_form.h"
#include "core/kernels/registry.h"
#include "core/laws/laws.h"

namespace ressort::kernels {
namespace {

constexpr std::size_t least_blocks = 3;
constexpr std::size_t most_blocks = 15;
constexpr double enough_ns = 3e6;  // measuring time for all blocks of one form
// steps of all voices in a sample; larger parts are not measured
constexpr double most_steps = 1e6;

// A part in one form, while it is played: modes ring, contacts touch, and no input moves. A mass
// that nothing holds, such as a hammer, touches for moments only, so its contacts stay open.
template <class T>
class Trial {
 public:
  Trial(const Program& program, const Workload& load)
      : program_(program), x_(program.position), v_(program.velocity) {
    const auto voices = static_cast<std::size_t>(std::max(1, load.voices));
    do {
      kernels_.push_back(make_kernel<T>(program, voices, load.isa));
    } while (kernels_.size() * kernels_[0]->width() < voices);
    for (const Coefficient& coefficient : program.coefficients) {
      values_.push_back(coefficient_value(program, coefficient, program.parameters, 1.0));
    }
    const std::size_t width = kernels_[0]->width();
    for (const auto& kernel : kernels_) {
      for (std::size_t lane = 0; lane < width; ++lane) {
        for (std::uint32_t c = 0; c < values_.size(); ++c) {
          kernel->coefficients.set(lane, c, values_[c], false);
        }
      }
    }
    close_gaps();
    set_inputs(width);
    outputs_.resize(max_block_frames * width * program.outputs.size());
  }

  // Moves all voices to positions where every link that can touch touches. A part in which no gap
  // was open keeps ringing instead.
  void start() {
    if (has_started_ && !has_closed_) {
      return;
    }
    has_started_ = true;
    for (const auto& kernel : kernels_) {
      for (std::size_t lane = 0; lane < kernel->width(); ++lane) {
        kernel->set_state(lane, x_.data(), v_.data());
      }
    }
  }

  void play() {
    for (const auto& kernel : kernels_) {
      kernel->step({.frames = max_block_frames,
                    .value = value_.data(),
                    .velocity = velocity_.data(),
                    .is_still = !is_pushed_,
                    .audio = audio_.data(),
                    .outputs = outputs_.data()});
    }
  }

  // Ends the push of the first block.
  void let_go() {
    is_pushed_ = false;
    const std::size_t count = program_.inputs.size();
    const std::size_t width = count == 0 ? 1 : value_.size() / count / max_block_frames;
    for (std::size_t i = 0; i < value_.size(); ++i) {
      if (program_.inputs[i / width % count].is_force) {
        value_[i] = T(0);
      }
    }
  }

 private:
  bool is_mass(std::uint32_t node) const {
    return node < program_.moving && !is_junction(program_, node);
  }
  bool is_input(std::uint32_t node) const {
    return std::any_of(program_.inputs.begin(), program_.inputs.end(), [&](const InputSlot& input) {
      return !input.is_force && input.node == node;
    });
  }

  // Moves one end of each open contact, pluck and the like to a quarter of its reach from the other
  // end: a position input if the link has one, else a mass. A mass that nothing holds has flown
  // away.
  void close_gaps() {
    const std::vector<bool> is_held = held_nodes();
    for (const LinkRun& run : program_.link_runs) {
      const LawFacts& law = facts_of(run.law);
      if (!law.can_detach()) {
        continue;
      }
      LawNumbers numbers{};
      for (std::size_t i = 0; i < law.count; ++i) {
        numbers[i] = values_[run.coefficients[i]];
      }
      const double reach = std::fabs(numbers[law.slot(Role::reach)]);
      const double inside = law.zone == Zone::near ? 0.25 * reach : least_overlap;
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        const auto [a, b] = program_.ends[i];
        if (is_mass(a) && !is_held[a]) {
          x_[a] = x_[b] - reach - flown;
          continue;
        }
        if (is_mass(b) && !is_held[b]) {
          x_[b] = x_[a] + reach + flown;
          continue;
        }
        if (law.gap(numbers, x_[a] - x_[b]) < 0.0) {
          continue;
        }
        has_closed_ = true;
        if (is_input(a) || (!is_input(b) && is_mass(a))) {
          x_[a] = x_[b] + inside;
        } else if (is_input(b) || is_mass(b)) {
          x_[b] = x_[a] - inside;
        }
      }
    }
  }

  // Returns which nodes something holds or pulls back.
  std::vector<bool> held_nodes() const {
    std::vector<bool> is_held(program_.position.size());
    for (const MassRun& run : program_.mass_runs) {
      std::fill_n(is_held.begin() + run.first, run.count, run.is_oscillator || run.has_gravity);
    }
    for (const LinkRun& run : program_.link_runs) {
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        if (!facts_of(run.law).can_detach()) {
          is_held[program_.ends[i].a] = is_held[program_.ends[i].b] = true;
        }
      }
    }
    return is_held;
  }

  // Position inputs stay where they touch. Force inputs are noise in the first block, so that all
  // modes ring.
  void set_inputs(std::size_t width) {
    value_.resize(max_block_frames * width * program_.inputs.size());
    velocity_.resize(value_.size());
    audio_.resize(max_block_frames * width * program_.audio_coefficients.size());
    std::uint32_t seed = 1;
    for (std::size_t i = 0; i < value_.size(); ++i) {
      const InputSlot& input = program_.inputs[i / width % program_.inputs.size()];
      seed = seed * 1664525u + 1013904223u;  // Knuth's linear congruential generator
      const double noise = least_overlap * (static_cast<double>(seed >> 8) * 0x1p-23 - 1.0);
      value_[i] = static_cast<T>(input.is_force ? noise : x_[input.node]);
    }
    for (std::size_t i = 0; i < audio_.size(); ++i) {
      const std::size_t c = i / width % program_.audio_coefficients.size();
      audio_[i] = static_cast<T>(values_[program_.audio_coefficients[c]]);
    }
  }

  static constexpr double flown = 1.0;
  static constexpr double least_overlap = 1e-3;  // overlap of contacts, and amplitude of the noise

  const Program& program_;
  std::vector<std::unique_ptr<Kernel<T>>> kernels_;
  std::vector<double> values_;  // [coefficient]
  std::vector<double> x_;       // [node] at the start of every block
  std::vector<double> v_;
  Aligned<T> value_;
  Aligned<T> velocity_;
  Aligned<T> audio_;
  Aligned<T> outputs_;
  bool has_started_ = false;
  bool has_closed_ = false;
  bool is_pushed_ = true;
};

template <class T>
double measured_ns(const Program& program, const Workload& load, const Timings& timings) {
  Trial<T> trial(program, load);
  const auto block_ns = [&] {
    trial.start();
    return timings.time(program, [&] { trial.play(); });
  };
  block_ns();
  trial.let_go();
  std::vector<double> took;
  for (double sum = 0.0;
       took.size() < most_blocks && (took.size() < least_blocks || sum < enough_ns);) {
    took.push_back(block_ns());
    sum += took.back();
  }
  const auto middle = took.begin() + static_cast<std::ptrdiff_t>(took.size() / 2);
  std::nth_element(took.begin(), middle, took.end());
  return *middle / max_block_frames;
}

// The 64-bit FNV-1a hash of Fowler, Noll and Vo (1991), taken of whole numbers.
class Hash {
 public:
  Hash& add(std::uint64_t number) {
    for (int shift = 0; shift < 64; shift += 8) {
      value_ = (value_ ^ ((number >> shift) & 0xffu)) * 0x100000001b3u;
    }
    return *this;
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325u;
};

std::uint64_t structure_of(const Program& program) {
  Hash hash;
  hash.add(program.moving).add(program.position.size()).add(program.coefficients.size());
  for (const MassRun& run : program.mass_runs) {
    hash.add(run.count).add(run.is_oscillator).add(run.has_gravity).add(run.is_junction);
  }
  for (const LinkRun& run : program.link_runs) {
    hash.add(static_cast<std::uint64_t>(run.law))
        .add(static_cast<std::uint64_t>(run.scheme))
        .add(run.count);
  }
  for (const Ends ends : program.ends) {
    hash.add(ends.a).add(ends.b);
  }
  for (const InputSlot& input : program.inputs) {
    hash.add(input.is_force).add(input.node);
  }
  for (const OutputSlot& output : program.outputs) {
    hash.add(output.is_force).add(output.node);
  }
  for (const TapSlot& tap : program.taps) {
    hash.add(tap.length).add(tap.width).add(tap.places);
  }
  hash.add(program.waveguides.size()).add(program.audio_coefficients.size());
  return hash.value();
}

}  // namespace

std::string form_name(const Form& form) {
  std::string name(row_of(form).name);
  if (const auto* const modes = form.get_if<Modes>(); modes != nullptr && modes->is_exact) {
    name += " exact";
  }
  if (const auto* const steps = form.get_if<Oversampled>()) {
    name += (steps->coarse ? " 1 or " : " ") + std::to_string(steps->times) + " " +
            form_name(steps->fine->form);
  }
  return name;
}

std::string timing_key(const Program& program, const Workload& load) {
  std::array<char, 96> rest{};
  std::snprintf(rest.data(), rest.size(), "; held %016llx; %d voices, %s, %s, %.0f Hz",
                static_cast<unsigned long long>(structure_of(program)), load.voices,
                load.is_double ? "double" : "float", std::string(isa_name(load.isa)).c_str(),
                program.rate_hz);
  return form_name(program.form) + ": " + description(program) + rest.data();
}

bool is_measurable(const Program& program, const Workload& load) {
  return std::max(1, load.voices) * worst_steps(program) <= most_steps;
}

std::optional<double> known_ns(const Program& program, const Workload& load,
                               const Timings& timings) {
  const std::string key = timing_key(program, load);
  if (timings.recall) {
    if (const auto kept = timings.recall(key)) {
      return kept;
    }
  }
  if (!timings.time || !is_measurable(program, load)) {
    return std::nullopt;
  }
  const double ns = load.is_double ? measured_ns<double>(program, load, timings)
                                   : measured_ns<float>(program, load, timings);
  if (timings.keep) {
    timings.keep(key, ns);
  }
  return ns;
}

}  // namespace ressort::kernels
