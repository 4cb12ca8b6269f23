#include "core/engine/mixing/mixing.h"

#include <algorithm>
#include <cmath>

namespace ressort {

Mixing::Mixing(const Playing& playing)
    : gain_(playing.gain),
      loudest_(playing.bare ? runaway : std::min(runaway, runaway_level / playing.gain)) {}

template <class T>
void Mixing::add(Bank<T>& bank, std::size_t p, std::size_t first, const Segment& segment,
                 Voices& voices, EnergyWatch& watch) const {
  PartBank<T>& part = bank.parts[p];
  const std::size_t count = part.program.outputs.size();
  const Heard<T> heard{.outputs = bank.outputs.data(),
                       .frames = segment.frames,
                       .count = count,
                       .width = part.width};
  bank.mixer.find_peaks(heard, loudest_, bank.peak.data());
  std::fill(bank.gain.begin(), bank.gain.end(), 0.0);
  for (std::size_t lane = first; lane < voices.pack_end(first, part.width); ++lane) {
    Voice& voice = voices[lane];
    if (!voice.awake || watch.is_still(lane, p)) {
      continue;
    }
    const auto peak = static_cast<double>(bank.peak[lane - first]);
    if (!(peak < loudest_)) {
      lose(bank, p, lane, segment, voices, watch);
      continue;
    }
    voice.peak = std::max(voice.peak, peak);
    if (voice.gain_step != 0.0) {
      add_fading(bank, part, lane, segment, segment.frames, voice);
    } else {
      bank.gain[lane - first] = gain_ * voice.gain;
    }
  }
  std::copy_n(bank.outputs.data() + (segment.frames - 1) * part.row(), part.row(),
              part.last_of(first));
  for (std::size_t output = 0; output < count; ++output) {
    bank.heard[output] = segment.outputs[part.program.outputs[output].channel] + segment.at;
  }
  bank.mixer.add_voices(heard, bank.gain.data(), bank.heard.data());
  clear_wide_registers();
}

// One voice by itself, `frames` of the segment.
template <class T>
void Mixing::add_fading(const Bank<T>& bank, const PartBank<T>& part, std::size_t lane,
                        const Segment& segment, std::size_t frames, const Voice& voice) const {
  const std::size_t count = part.program.outputs.size();
  double faded = voice.gain;
  for (std::size_t n = 0; n < frames; ++n) {
    faded = voice.next_gain(faded);
    const double gain = gain_ * faded;
    for (std::size_t output = 0; output < count; ++output) {
      const std::size_t from = (n * count + output) * part.width + lane % part.width;
      segment.outputs[part.program.outputs[output].channel][segment.at + n] +=
          gain * static_cast<double>(bank.outputs[from]);
    }
  }
}

// The last sample of what stands still, from frame `from` of the segment on.
void Mixing::add_held(const Program& program, const double* held, const Segment& segment,
                      std::size_t from, const Voice& voice) const {
  double faded = voice.gain;
  for (std::size_t n = 0; n < segment.frames; ++n) {
    faded = voice.next_gain(faded);
    for (std::size_t output = 0; n >= from && output < program.outputs.size(); ++output) {
      segment.outputs[program.outputs[output].channel][segment.at + n] +=
          gain_ * faded * held[output];
    }
  }
}

void Mixing::add_still(const Program& program, std::size_t p, std::size_t first, std::size_t width,
                       const Segment& segment, const Voices& voices,
                       const EnergyWatch& watch) const {
  for (std::size_t lane = first; lane < voices.pack_end(first, width); ++lane) {
    const double* const held = watch.held(lane, p);
    if (voices[lane].awake && watch.is_still(lane, p) &&
        std::any_of(held, held + program.outputs.size(), [](double y) { return y != 0.0; })) {
      add_held(program, held, segment, 0, voices[lane]);
    }
  }
}

template <class T>
void Mixing::lose(Bank<T>& bank, std::size_t p, std::size_t lane, const Segment& segment,
                  Voices& voices, EnergyWatch& watch) const {
  PartBank<T>& part = bank.parts[p];
  const std::size_t count = part.program.outputs.size();
  const auto is_sane = [&](std::size_t n) {
    for (std::size_t output = 0; output < count; ++output) {
      const T y = bank.outputs[(n * count + output) * part.width + lane % part.width];
      if (!(std::fabs(static_cast<double>(y)) < loudest_)) {
        return false;
      }
    }
    return true;
  };
  std::size_t sane = 0;
  while (sane < segment.frames && is_sane(sane)) {
    ++sane;
  }
  add_fading(bank, part, lane, segment, sane, voices[lane]);
  watch.lose(part, sane > 0 ? bank.outputs.data() + (sane - 1) * part.row() : part.last_of(lane),
             lane, p, voices);
  add_held(part.program, watch.held(lane, p), segment, sane, voices[lane]);
}

void Mixing::make_noise(const Segment& segment) {
  for (std::size_t n = segment.at; n < segment.end(); ++n) {
    for (double* const output : segment.outputs) {
      output[n] *= white();
    }
  }
}

// Uniform in -1..1: xorshift, from a fixed seed so that a render repeats.
double Mixing::white() {
  noise_ ^= noise_ << 13;
  noise_ ^= noise_ >> 7;
  noise_ ^= noise_ << 17;
  return static_cast<double>(static_cast<std::int64_t>(noise_)) * 0x1p-63;
}

template void Mixing::add(Bank<float>&, std::size_t, std::size_t, const Segment&, Voices&,
                          EnergyWatch&) const;
template void Mixing::add(Bank<double>&, std::size_t, std::size_t, const Segment&, Voices&,
                          EnergyWatch&) const;

}  // namespace ressort
