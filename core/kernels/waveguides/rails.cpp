#include "core/kernels/waveguides/rails.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <span>

namespace ressort::kernels {
namespace {

constexpr std::size_t numbers_of_guide = 3;  // Frequency, T60, brightness.

}  // namespace

std::uint32_t most_waveguide_samples(const Program& program) {
  return waveguide_slots(program) - 1 - waveguide_run;
}

std::uint32_t waveguide_slots(const Program& program) {
  const double places = static_cast<double>(
      least_waveguide_samples(static_cast<std::uint32_t>(program.junctions.size())));
  return std::bit_ceil(
      static_cast<std::uint32_t>(program.rate_hz / lowest_waveguide_hz + 2.0 * places) +
      waveguide_run);
}

template <class T>
Rails<T>::Rails(const Program& program, std::size_t width_in)
    : width(width_in),
      stride(waveguide_slots(program) + widest_bytes / sizeof(T)),
      program_(program) {
  std::size_t most_places = 0;
  for (const WaveguideSlot& slot : program.waveguides) {
    guides.push_back({.slot = &slot,
                      .ring = guides.size() * stride * width,
                      .mask = waveguide_slots(program) - 1,
                      .row = guides.size() * width,
                      .place_row = slot.first * width,
                      .fading = 0,
                      .run = 1,
                      .is_run_known = false});
    most_places = std::max<std::size_t>(most_places, slot.count);
    gives.insert(gives.end(), slot.count, slot.inverse_impedance);
  }
  const std::size_t rows = guides.size() * width;
  const std::size_t places = program.junctions.size() * width;
  ring.resize(guides.size() * stride * width);
  for (auto* const delays : {&end, &next_end}) {
    delays->resize(rows);
  }
  for (auto* const numbers : {&allpass, &pole, &gain, &next_allpass, &next_pole, &next_gain,
                              &allpass_state, &pole_state}) {
    numbers->resize(rows);
  }
  for (auto* const delays : {&right, &left, &next_right, &next_left}) {
    delays->resize(places);
  }
  comes.resize(places * waveguide_run);
  goes.resize(places * waveguide_run);
  designed_.resize(numbers_of_guide * rows + places);
  u_.resize(most_places);
  order_.resize(2 * most_places);
  delays_.resize(2 * most_places);
  all_delays_.reserve(2 * (1 + 2 * most_places));
  for (std::size_t lane = 0; lane < width; ++lane) {
    clear(lane);
  }
}

template <class T>
void Rails<T>::clear(std::size_t lane) {
  for (const Guide& guide : guides) {
    std::fill_n(wave(guide, lane, 0), stride, T(0));
    allpass_state[guide.row + lane] = pole_state[guide.row + lane] = T(0);
    designed_[guide.row + lane] = std::numeric_limits<T>::quiet_NaN();
  }
}

template <class T>
bool Rails<T>::is_new(const Guide& guide, std::size_t lane, const T* coefficients) const {
  const auto differs = [&](std::size_t row, std::uint32_t c) {
    return !(designed_[row + lane] == coefficients[c * width + lane]);
  };
  const std::size_t rows = guides.size() * width;
  bool any = differs(guide.row, guide.slot->frequency) ||
             differs(rows + guide.row, guide.slot->t60) ||
             differs(2 * rows + guide.row, guide.slot->brightness);
  for (std::uint32_t i = 0; !any && i < guide.slot->count; ++i) {
    any = differs(numbers_of_guide * rows + guide.place_row + i * width,
                  program_.junctions[guide.slot->first + i].u);
  }
  return any;
}

template <class T>
void Rails<T>::prepare(const T* coefficients) {
  for (Guide& guide : guides) {
    bool fades = false;  // All lanes fade together; unchanged ones fade to themselves.
    for (std::size_t lane = 0; lane < width; ++lane) {
      const bool is_silent = std::isnan(designed_[guide.row + lane]);
      if (is_silent || (guide.fading == 0 && is_new(guide, lane, coefficients))) {
        design(guide, lane, coefficients);
        guide.is_run_known = false;
        is_silent ? jump_to_design(guide, lane) : void(fades = true);
      }
    }
    guide.fading = fades ? waveguide_fade_frames : guide.fading;
    if (!guide.is_run_known) {
      guide.run = longest_run(guide, coefficients);
      guide.is_run_known = true;
    }
  }
}

// A run may be as long as the shortest delay from the filters, and as the shortest delay between
// two places: within that time nothing is read that has not been written yet.
template <class T>
std::uint32_t Rails<T>::longest_run(const Guide& guide, const T* coefficients) {
  std::uint32_t longest = waveguide_run;
  const auto take = [&](const std::vector<std::uint32_t>& delays, std::size_t first,
                        std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      all_delays_.push_back(delays[first + i * width]);
    }
  };
  for (std::size_t lane = 0; lane < width; ++lane) {
    all_delays_.clear();
    for (const bool of_next : {false, true}) {
      if (of_next && guide.fading == 0) {
        break;
      }
      take(of_next ? next_end : end, guide.row + lane, 1);
      take(of_next ? next_right : right, guide.place_row + lane, guide.slot->count);
      take(of_next ? next_left : left, guide.place_row + lane, guide.slot->count);
    }
    std::sort(all_delays_.begin(), all_delays_.end());
    longest = std::min(longest, all_delays_.front());
    if (coefficients[guide.slot->inverse_impedance * width + lane] == T(0)) {
      continue;  // No note has played here yet.
    }
    for (std::size_t i = 1; i < all_delays_.size(); ++i) {
      const std::uint32_t way = all_delays_[i] - all_delays_[i - 1];
      longest = way > 0 ? std::min(longest, way) : longest;
    }
  }
  return longest;
}

template <class T>
void Rails<T>::design(Guide& guide, std::size_t lane, const T* coefficients) {
  const WaveguideSlot& slot = *guide.slot;
  const std::size_t rows = guides.size() * width;
  const auto number = [&](std::size_t row, std::uint32_t c) {
    designed_[row + lane] = coefficients[c * width + lane];
    // NaN is replaced, so that it does not trigger a new design in every block.
    designed_[row + lane] = std::isnan(designed_[row + lane]) ? T(0) : designed_[row + lane];
    return static_cast<double>(designed_[row + lane]);
  };
  const WaveguideNumbers numbers{.frequency_hz = number(guide.row, slot.frequency),
                                 .t60_s = number(rows + guide.row, slot.t60),
                                 .brightness = number(2 * rows + guide.row, slot.brightness)};
  const WaveguideDesign found =
      design_waveguide(numbers, least_waveguide_samples(slot.count),
                       most_waveguide_samples(program_), program_.rate_hz);
  const std::size_t at = guide.row + lane;
  next_end[at] = found.samples;
  next_allpass[at] = static_cast<T>(found.allpass);
  next_pole[at] = static_cast<T>(found.pole);
  next_gain[at] = static_cast<T>(found.gain);
  for (std::uint32_t i = 0; i < slot.count; ++i) {
    u_[i] = number(numbers_of_guide * rows + guide.place_row + i * width,
                   program_.junctions[slot.first + i].u);
  }
  find_places(found, slot.filters_at, std::span(u_).first(slot.count), order_, delays_);
  for (std::uint32_t i = 0; i < slot.count; ++i) {
    next_left[guide.place_row + i * width + lane] = delays_[std::size_t{2} * i];
    next_right[guide.place_row + i * width + lane] = delays_[std::size_t{2} * i + 1];
  }
}

// Without a fade, because the lane is silent.
template <class T>
void Rails<T>::jump_to_design(Guide& guide, std::size_t lane) {
  const std::size_t at = guide.row + lane;
  end[at] = next_end[at];
  allpass[at] = next_allpass[at];
  pole[at] = next_pole[at];
  gain[at] = next_gain[at];
  for (std::size_t i = guide.place_row + lane; i < guide.place_row + guide.slot->count * width;
       i += width) {
    right[i] = next_right[i];
    left[i] = next_left[i];
  }
}

template <class T>
bool Rails<T>::is_quiet(std::size_t lane, double bound) const {
  for (const Guide& guide : guides) {
    for (std::uint32_t delay = 1; delay <= end[guide.row + lane]; ++delay) {
      if (!(std::fabs(*wave(guide, lane, now - delay)) < bound)) {
        return false;
      }
    }
  }
  return true;
}

template <class T>
std::size_t Rails<T>::read_positions(std::size_t lane, std::size_t number,
                                     std::span<double> numbers) const {
  if (number >= guides.size() || numbers.size() < 2) {
    return 0;
  }
  const Guide& guide = guides[number];
  const std::uint32_t samples = end[guide.row + lane];
  const double sign = guide.slot->is_open ? 1.0 : -1.0;
  const auto pieces = static_cast<double>(numbers.size() - 1);
  const double half = pieces / samples;  // Half a sample to either side.
  std::fill(numbers.begin(), numbers.end(), 0.0);
  for (std::uint32_t delay = 1; delay <= samples; ++delay) {
    // Position on the loop, from the right end to the left one and back.
    const double round = guide.slot->filters_at.share + (delay - 0.5) / samples;
    const double way = 2.0 * (round - std::floor(round));
    const double speed = *wave(guide, lane, now - delay);
    const double rise = way < 1.0 ? sign * speed : -speed;
    const double first = std::max(pieces * std::fabs(1.0 - way) - half, 0.0);
    const double last = std::min(pieces * std::fabs(1.0 - way) + half, pieces);
    auto piece = static_cast<std::size_t>(first);
    if (last <= static_cast<double>(piece + 1)) {
      numbers[std::min(piece + 1, numbers.size() - 1)] += rise;
      continue;
    }
    for (double from = first; from < last; ++piece) {
      const double until = std::min(last, static_cast<double>(piece + 1));
      numbers[piece + 1] += rise * (until - from) / (last - first);
      from = until;
    }
  }
  for (std::size_t i = 1; i < numbers.size(); ++i) {
    numbers[i] += numbers[i - 1];
  }
  return numbers.size();
}

template <class T>
double Rails<T>::energy(std::size_t lane, const T* coefficients) const {
  double sum = 0.0;
  for (const Guide& guide : guides) {
    double waves = 0.0;
    const std::size_t at = guide.row + lane;
    for (std::uint32_t delay = 1; delay <= end[at]; ++delay) {
      const double speed = *wave(guide, lane, now - delay);
      waves += speed * speed;
    }
    const double c = allpass[at];
    waves += static_cast<double>(allpass_state[at]) * allpass_state[at] / (1.0 - c * c);
    sum += waves / coefficients[guide.slot->inverse_impedance * width + lane];
  }
  return sum;
}

template class Rails<float>;
template class Rails<double>;

}  // namespace ressort::kernels
