#include "core/engine/lfos.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/kernel.h"

namespace ressort::engine {

Lfos::Lfos(const Playing& playing, double rate_hz)
    : playing_(playing),
      block_s_(static_cast<double>(max_block_frames) / rate_hz),
      count_(playing.lfos.size()),
      states_(lane_count(playing.voices) * count_),
      scales_(states_.size(), 1.0),
      channel_scales_(Channels::count * count_),
      swings_(playing.swings_parameters() ? playing.curves.size() : 0) {
  for (std::size_t i = 0; i < channel_scales_.size(); ++i) {
    channel_scales_[i] = playing.lfos[i % count_].is_scaled ? 0.0 : 1.0;
  }
}

void Lfos::continue_from(const Lfos& from) {
  if (from.count_ == count_ && from.states_.size() == states_.size()) {
    beats_per_s_ = from.beats_per_s_;
    states_ = from.states_;
    scales_ = from.scales_;
    channel_scales_ = from.channel_scales_;
  }
}

void Lfos::restart(std::size_t lane, std::uint64_t note, Keyboard& keyboard) {
  if (count_ == 0) {
    return;
  }
  for (std::size_t i = 0; i < count_; ++i) {
    states_[lane * count_ + i] = LfoState(playing_.lfos[i].lfo, beats_per_s_, note << 8 | i);
    scales_[lane * count_ + i] = channel_scales_[keyboard.voices[lane].channel * count_ + i];
  }
  apply(lane, keyboard);
}

void Lfos::follow_level(std::size_t lane, Keyboard& keyboard) {
  if (count_ > 0) {
    apply(lane, keyboard);
  }
}

void Lfos::set_tempo(double beats_per_s) {
  if (!(beats_per_s > 0.0) || beats_per_s == beats_per_s_) {
    return;
  }
  beats_per_s_ = beats_per_s;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    states_[i].set_tempo(playing_.lfos[i % count_].lfo, beats_per_s);
  }
}

void Lfos::scale(Source source, int number, double amount, const Scope& scope,
                 const Keyboard& keyboard) {
  for (std::size_t i = 0; i < count_; ++i) {
    const PlayedLfo& lfo = playing_.lfos[i];
    if (!lfo.is_scaled || lfo.by != source ||
        (source == Source::controller && lfo.number != number)) {
      continue;
    }
    for (unsigned channel = 0; channel < Channels::count; ++channel) {
      if (scope.key == Scope::every_key && has_channel(scope.channels, channel)) {
        channel_scales_[channel * count_ + i] = amount;
      }
    }
    for (std::size_t lane = 0; lane < keyboard.voices.size(); ++lane) {
      if (keyboard.is_addressed(keyboard.voices[lane], scope)) {
        scales_[lane * count_ + i] = amount;
      }
    }
  }
}

void Lfos::advance(Keyboard& keyboard) {
  for (std::size_t lane = 0; count_ > 0 && lane < keyboard.voices.size(); ++lane) {
    if (keyboard.voices[lane].awake && keyboard.voices[lane].has_key) {
      for (std::size_t i = 0; i < count_; ++i) {
        states_[lane * count_ + i].advance(block_s_);
      }
      apply(lane, keyboard);
    }
  }
}

void Lfos::apply(std::size_t lane, Keyboard& keyboard) {
  double semitones = 0.0;
  double db = 0.0;
  for (std::size_t i = 0; i < swings_.size(); ++i) {
    const VoiceCurve* const curve = playing_.curve_of(i);
    swings_[i] = curve != nullptr ? curve->neutral() : 0.0;
  }
  for (const Control& control : playing_.controls) {
    if (control.source == Source::lfo) {
      const std::size_t i = lane * count_ + control.number;
      const PlayedLfo& lfo = playing_.lfos[control.number];
      const double strength = keyboard.voices[lane].strength;
      const double scale = lfo.by == Source::note ? strength * strength : scales_[i];
      const double value = scale * states_[i].value(lfo.lfo);
      const GestureSettings& range = control.settings;
      const double wanted = range.low + (range.high - range.low) * (0.5 + 0.5 * value);
      constexpr double cents = 0.01;
      if (control.target == Control::pitch) {
        semitones += cents * wanted;
      } else if (control.target == Control::level) {
        db += wanted;
      } else {
        const std::size_t parameter = control.target - Control::first_parameter;
        swings_[parameter] = playing_.curves[parameter]->joined(swings_[parameter], wanted);
      }
    }
  }
  keyboard.vibrate(keyboard.voices[lane], semitones, std::pow(10.0, db / 20.0));
  keyboard.voices.swing(lane, swings_);
}

}  // namespace ressort::engine
