#include "core/engine/output_levels.h"

#include <algorithm>
#include <cmath>

namespace ressort::engine {
namespace {

// A level changes by less than 60 dB below full scale in each frame of this ramp.
constexpr double ramp_s = 0.025;

}  // namespace

template <class T>
void differentiate(Bank<T>& bank, const VoiceGroup& group, std::size_t frames) {
  PartBank<T>& part = bank.parts[group.part];
  const T per_reference = static_cast<T>(1.0 / part.program.rate_ratio);
  for (std::size_t output = 0; output < part.program.outputs.size(); ++output) {
    const int derivative = part.program.outputs[output].derivative;
    if (derivative == 0) {
      continue;
    }
    const std::size_t at = group.first / part.width * part.row() + output * part.width;
    for (std::size_t n = 0; n < frames; ++n) {
      T* const row = bank.block->outputs.data() + n * part.row() + output * part.width;
      for (std::size_t lane = 0; lane < part.width; ++lane) {
        T& before = part.before[at + lane];
        T& slope = part.slope[at + lane];
        const T velocity = (row[lane] - before) * per_reference;
        before = row[lane];
        row[lane] = derivative == 1 ? velocity : (velocity - slope) * per_reference;
        slope = velocity;
      }
    }
  }
}

OutputLevels::OutputLevels(const Machine& machine, const Playing& playing)
    : ramp_frames_(playing.bare ? 0
                                : static_cast<std::size_t>(std::ceil(ramp_s * machine.rate_hz))) {
  for (const Program& program : machine.parts) {
    std::vector<Level>& levels = parts_.emplace_back();
    for (std::uint32_t output = 0; output < program.outputs.size(); ++output) {
      const Coefficient& level = program.outputs[output].level;
      if (level.count > 0) {
        const double value = continuous_value(program, level, machine.parameters, 1.0);
        levels.push_back({.output = output, .now = value, .target = value});
      }
    }
  }
}

void OutputLevels::follow(const Machine& machine, std::span<const double> parameters,
                          bool at_once) {
  const std::size_t frames = at_once ? 0 : ramp_frames_;
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    const Program& program = machine.parts[p];
    for (Level& level : parts_[p]) {
      const double target =
          continuous_value(program, program.outputs[level.output].level, parameters, 1.0);
      if (target != level.target && std::isfinite(target)) {
        level.target = target;
        level.frames = frames;
        level.now = frames > 0 ? level.now : target;
        level.step = frames > 0 ? (target - level.now) / static_cast<double>(frames) : 0.0;
      }
    }
  }
}

template <class T>
void OutputLevels::apply(Bank<T>& bank, const VoiceGroup& group, std::size_t frames) const {
  const PartBank<T>& part = bank.parts[group.part];
  const std::vector<Level>& levels = parts_[group.part];
  const std::size_t row = part.row();
  T* const outputs = bank.block->outputs.data();
  if (std::any_of(levels.begin(), levels.end(), [](const Level& l) { return l.frames > 0; })) {
    for (const Level& level : levels) {
      for (std::size_t n = 0; n < frames; ++n) {
        T* const lanes = outputs + n * row + level.output * part.width;
        const T factor = static_cast<T>(level.after(n + 1));
        std::transform(lanes, lanes + part.width, lanes, [=](T y) { return y * factor; });
      }
    }
    return;
  }
  if (std::all_of(levels.begin(), levels.end(), [](const Level& l) { return l.target == 1.0; })) {
    return;
  }
  std::fill_n(bank.factors.begin(), rows_together * row, T(1));
  for (const Level& level : levels) {
    for (std::size_t n = 0; n < rows_together; ++n) {
      std::fill_n(bank.factors.data() + n * row + level.output * part.width, part.width,
                  static_cast<T>(level.target));
    }
  }
  bank.mixer.scale_rows(bank.factors.data(), row, frames, outputs);
}

void OutputLevels::advance(std::size_t frames) {
  for (std::vector<Level>& levels : parts_) {
    for (Level& level : levels) {
      level.now = level.after(frames);
      level.frames -= std::min(frames, level.frames);
    }
  }
}

template void differentiate(Bank<float>&, const VoiceGroup&, std::size_t);
template void differentiate(Bank<double>&, const VoiceGroup&, std::size_t);
template void OutputLevels::apply(Bank<float>&, const VoiceGroup&, std::size_t) const;
template void OutputLevels::apply(Bank<double>&, const VoiceGroup&, std::size_t) const;

}  // namespace ressort::engine
