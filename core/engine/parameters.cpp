#include "core/engine/parameters.h"

#include <algorithm>
#include <cmath>

namespace ressort::engine {
namespace {

// Coefficients are ramped, because steps are audible as clicks. The ramp of a retuned voice spans
// two blocks, from one bend or glide value to the next.
constexpr std::size_t tuning_frames = 128;
// Ramp of a changed parameter. It joins the steps of a controller, which are about 10 ms apart.
constexpr double turn_s = 0.02;

bool retunes_voices(const Control& control) {
  return control.source == Source::lfo && control.target != Control::level;
}

}  // namespace

Parameters::Parameters(const Machine& machine, const Playing& playing, std::size_t lanes)
    : playing_(playing),
      turn_frames_(static_cast<std::size_t>(std::lround(turn_s * machine.rate_hz))),
      glides_(!playing.bare &&
              std::any_of(playing.controls.begin(), playing.controls.end(), retunes_voices)),
      values_(machine.parameters),
      played_(values_),
      is_turned_(values_.size()) {
  for (std::size_t lane = 0; !playing.curves.empty() && lane < lanes; ++lane) {
    voice_values_.insert(voice_values_.end(), values_.begin(), values_.end());
  }
  turned_.reserve(values_.size());
  swung_.reserve(values_.size());
  gliding_.reserve(values_.size());
  changes_.reserve(max_parameter_changes);
  taken_.reserve(max_parameter_changes);
}

void Parameters::continue_from(const Parameters& from) {
  values_ = from.values_;
  played_ = from.played_;
  gliding_.assign(from.gliding_.begin(), from.gliding_.end());
  if (voice_values_.size() == from.voice_values_.size()) {
    voice_values_ = from.voice_values_;
  }
  changes_ = from.changes_;
  beyond_ = from.beyond_;
}

double Parameters::within_limits(std::size_t index, double value) const {
  const Limits& limits = playing_.limits[index];
  return std::max(limits.lowest, std::min(value, limits.highest));
}

double Parameters::highest_factor() const {
  double way = 0.0;
  for (std::size_t i = 0; i < values_.size(); ++i) {
    const Limits& home = playing_.home[i];
    const Limits& limits = playing_.limits[i];
    if (values_[i] > home.highest) {
      way = std::max(way, (values_[i] - home.highest) / (limits.highest - home.highest));
    } else if (values_[i] < home.lowest) {
      way = std::max(way, (home.lowest - values_[i]) / (home.lowest - limits.lowest));
    }
  }
  if (way == 0.0 || playing_.away.empty()) {
    return std::max(1.0, playing_.highest_factor);
  }
  const double steps = static_cast<double>(playing_.away.size());
  return std::max(1.0, playing_.away[static_cast<std::size_t>(std::ceil(way * steps)) - 1]);
}

bool Parameters::has_changed_highest_factor() const {
  return has_changed() && highest_factor() != highest_before_;
}

void Parameters::set(std::size_t index, double wanted) {
  if (index >= values_.size()) {
    return;
  }
  const double value = within_limits(index, wanted);
  beyond_ += value == wanted ? 0 : 1;
  if (values_[index] == value) {
    return;
  }
  const auto parameter = static_cast<std::uint16_t>(index);
  note_turn(parameter);
  values_[index] = value;
  if (changes_.size() < max_parameter_changes &&
      std::find(changes_.begin(), changes_.end(), parameter) == changes_.end()) {
    changes_.push_back(parameter);
  }
}

void Parameters::note_turn(std::uint16_t parameter) {
  if (!has_changed()) {
    highest_before_ = highest_factor();
  }
  if (!is_turned_[parameter]) {
    is_turned_[parameter] = true;
    turned_.push_back(parameter);
  }
}

std::span<const std::uint16_t> Parameters::take_changes() {
  taken_.swap(changes_);
  changes_.clear();
  return taken_;
}

// Kernels ramp all coefficients alike. Where LFOs retune voices in every block, such a ramp is
// shorter than that of a knob, so that the parameter itself has to glide.
void Parameters::start_glides(bool is_any_audible) {
  if (!is_any_audible) {
    for (const Glide& glide : gliding_) {
      note_turn(glide.parameter);
    }
    gliding_.clear();
    played_ = values_;
    return;
  }
  for (const std::uint16_t parameter : turned_) {
    const double target = values_[parameter];
    auto glide = std::find_if(gliding_.begin(), gliding_.end(),
                              [&](const Glide& g) { return g.parameter == parameter; });
    if (!glides_) {
      played_[parameter] = target;
    } else if (glide == gliding_.end()) {
      if (played_[parameter] != target) {
        gliding_.push_back({parameter, target, turn_frames_});
      }
    } else if (glide->target != target) {
      glide->target = target;
      glide->frames = turn_frames_;
    }
  }
}

void Parameters::advance() {
  for (Glide& glide : gliding_) {
    double& value = played_[glide.parameter];
    const std::size_t frames = std::min(max_block_frames, glide.frames);
    value = frames < glide.frames ? value + (glide.target - value) * static_cast<double>(frames) /
                                                static_cast<double>(glide.frames)
                                  : glide.target;
    glide.frames -= frames;
    note_turn(glide.parameter);
  }
  std::erase_if(gliding_, [](const Glide& glide) { return glide.frames == 0; });
}

void Parameters::update_voice_values(const Voices& voices) {
  swung_.clear();
  for (std::size_t lane = 0; !voice_values_.empty() && lane < voices.size(); ++lane) {
    const Voice& voice = voices[lane];
    const bool may_differ = has_changed() || voice.is_new || voice.is_retuned;
    const std::span<const double> swings = voices.swings_in(lane);
    for (std::size_t i = 0; voice.awake && may_differ && i < values_.size(); ++i) {
      const VoiceCurve* const curve = playing_.curve_of(i);
      double value = value_in_voice(playing_, i, played_[i], voice);
      if (voice.has_key && curve != nullptr && !swings.empty()) {
        value = curve->moved(value, swings[i]);
      }
      double& before = voice_values_[lane * values_.size() + i];
      const auto parameter = static_cast<std::uint16_t>(i);
      if (before != value && !voice.is_new && !is_turned_[i] &&
          std::find(swung_.begin(), swung_.end(), parameter) == swung_.end()) {
        swung_.push_back(parameter);
      }
      before = value;
    }
  }
}

template <class T>
void Parameters::apply(Bank<T>& bank, const Voices& voices, EnergyWatch& watch) {
  start_glides(voices.is_any_audible());
  update_voice_values(voices);
  const double highest = highest_factor();
  bank.each_group([&](PartBank<T>& part, const VoiceGroup& group) {
    const auto& depending = part.program.depending;
    const bool has_turned = std::any_of(turned_.begin(), turned_.end(), [&](std::uint16_t index) {
      return !depending[index].empty();
    });
    Kernel<T>& kernel = part.of(group.first);
    std::size_t frames = 0;  // length of the ramps that start
    for (std::size_t lane = group.first; lane < group.end; ++lane) {
      const Voice& voice = voices[lane];
      const bool is_tuned = voice.is_new || voice.is_retuned;
      if (!voice.awake || !(has_turned || is_tuned)) {
        continue;
      }
      const bool has_warp = voice.sounding_hz > 0.0 && !playing_.warp.factors.empty();
      kernel.tune(
          lane - group.first,
          {.warp =
               has_warp ? playing_.warp.factor_at(playing_.warp.inside(voice.sounding_hz)) : 0.0,
           .share = voice.factor / highest,
           .is_new = voice.is_new});
      if (voice.is_new) {
        watch.reset(lane, group.part);
        kernel.reset(lane - group.first);
        part.restart_slopes(lane);
      }
      watch.mark_driven(voice, lane, group.part);
      const bool ramped = !voice.is_new && !playing_.bare;
      part.evaluate(lane, values_in(lane));
      const auto set = [&](std::uint32_t c) {
        kernel.coefficients.set(lane - group.first, c,
                                part.value(lane, c, values_in(lane), voice.factor), ramped);
      };
      const auto set_depending = [&](std::uint16_t parameter) {
        std::for_each(depending[parameter].begin(), depending[parameter].end(), set);
      };
      for (std::uint32_t c = 0; is_tuned && c < part.program.coefficients.size(); ++c) {
        set(c);
      }
      if (!is_tuned) {
        std::for_each(turned_.begin(), turned_.end(), set_depending);
        std::for_each(swung_.begin(), swung_.end(), set_depending);
      }
      if (ramped && (frames == 0 || is_tuned)) {
        frames = is_tuned || !gliding_.empty() ? tuning_frames : turn_frames_;
      }
    }
    if (frames > 0) {
      kernel.coefficients.ramp(frames);
    }
  });
  for (const std::uint16_t index : turned_) {
    is_turned_[index] = false;
  }
  turned_.clear();
}

template <class T>
void Parameters::fill_audio(Bank<T>& bank, const VoiceGroup& group, const Segment& segment,
                            const Voices& voices) {
  const PartBank<T>& part = bank.parts[group.part];
  const Program& program = part.program;
  if (program.audio_coefficients.empty()) {
    return;
  }
  T* value = bank.block->audio.data();
  bool is_beyond = false;
  for (std::size_t n = segment.at; n < segment.end(); ++n) {
    for (const AudioParameter& audio : program.audio_parameters) {
      const auto channel = static_cast<std::size_t>(audio.channel);
      const bool is_there = channel < segment.inputs.size() && segment.inputs[channel] != nullptr;
      const double wanted = is_there ? segment.inputs[channel][n] : 0.0;
      values_[audio.parameter] = within_limits(audio.parameter, wanted);
      played_[audio.parameter] = values_[audio.parameter];
      is_beyond |= values_[audio.parameter] != wanted;
      for (std::size_t lane = group.first; !voice_values_.empty() && lane < group.end; ++lane) {
        voice_values_[lane * values_.size() + audio.parameter] = values_[audio.parameter];
      }
    }
    for (const std::uint32_t c : program.audio_coefficients) {
      for (std::size_t lane = group.first; lane < group.first + part.width; ++lane) {
        const bool is_voice = lane < group.end;
        *value++ = static_cast<T>(coefficient_value(program, program.coefficients[c],
                                                    is_voice ? values_in(lane) : values_,
                                                    is_voice ? voices[lane].factor : 1.0));
      }
    }
  }
  beyond_ += is_beyond ? 1 : 0;
}

template void Parameters::apply(Bank<float>&, const Voices&, EnergyWatch&);
template void Parameters::apply(Bank<double>&, const Voices&, EnergyWatch&);
template void Parameters::fill_audio(Bank<float>&, const VoiceGroup&, const Segment&,
                                     const Voices&);
template void Parameters::fill_audio(Bank<double>&, const VoiceGroup&, const Segment&,
                                     const Voices&);

}  // namespace ressort::engine
