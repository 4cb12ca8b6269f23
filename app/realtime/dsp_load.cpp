#include "app/realtime/dsp_load.h"

#include <algorithm>

namespace ressort::realtime {
namespace {

// Stealing voices did not help if the load stays above this fraction of the previous load.
constexpr double unmoved = 0.9;

// Returns how many of `sounding` equally expensive voices there is time for.
int affordable(int sounding, double load) {
  const double voices = DspLoad::wanted / std::max(load, 1e-3) * sounding;
  return static_cast<int>(std::min(voices, 1e6));
}

}  // namespace

void DspLoad::add(double took_s, double sound_s) {
  if (!(sound_s > 0.0)) {
    return;
  }
  mean_ += std::min(1.0, std::max(took_s, sound_s)) * (took_s / sound_s - mean_);
  took_s_ += took_s;
  sound_s_ += sound_s;
  if (sound_s_ < span_s) {
    return;
  }
  if (!skips_) {
    loads_[next_++ % spans] = took_s_ / sound_s_;
    std::array<double, spans> sorted = loads_;
    std::nth_element(sorted.begin(), sorted.begin() + spans / 2, sorted.end());
    lasting_ = sorted[spans / 2];
    quiet_s_ = lasting_ < low ? quiet_s_ + sound_s_ : 0.0;
    waits_s_ = std::max(0.0, waits_s_ - sound_s_);
    is_new_ = true;
  }
  skips_ = false;
  took_s_ = sound_s_ = 0.0;
}

std::optional<int> DspLoad::update_limit(int sounding, int all) {
  if (!is_new_) {
    return {};
  }
  is_new_ = false;
  if (is_over() && waits_s_ == 0.0) {
    return steal_voices(sounding, all);
  }
  if (limit_ == 0 || quiet_s_ < low_s) {
    return {};
  }
  quiet_s_ = first_ = before_ = 0.0;
  limit_ = std::max(limit_ + 1, affordable(sounding, lasting_));
  if (limit_ >= all) {
    limit_ = 0;
    return all;
  }
  return limit_;
}

std::optional<int> DspLoad::steal_voices(int sounding, int all) {
  first_ = first_ == 0.0 ? lasting_ : first_;
  if (sounding <= 1) {
    if (limit_ == 0 || lasting_ < unmoved * first_) {
      return {};
    }
    // The load has another cause than the voices.
    restart();
    waits_s_ = patience_s;
    return all;
  }
  if (lasting_ < 1.0 && lasting_ > unmoved * before_ && before_ > 0.0) {
    return {};  // The voices fit, and fading more of them would not help.
  }
  before_ = lasting_;
  limit_ = std::clamp(affordable(sounding, lasting_), 1, sounding - 1);
  forget();
  return limit_;
}

void DspLoad::restart() {
  limit_ = 0;
  first_ = before_ = waits_s_ = 0.0;
  forget();
}

void DspLoad::forget() {
  loads_.fill(0.0);
  lasting_ = took_s_ = sound_s_ = quiet_s_ = 0.0;
  skips_ = true;
  is_new_ = false;
}

}  // namespace ressort::realtime
