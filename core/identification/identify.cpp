#include "core/identification/identify.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <numbers>
#include <optional>

#include "core/format.h"
#include "core/identification/fit.h"
#include "core/identification/poles.h"
#include "core/identification/spectrum.h"
#include "core/ranges.h"

namespace ressort::identification {
namespace {

constexpr double band_hz = 690.0;  // Rate of the bands in the first search.
constexpr double twin = 0.15;  // Poles closer than this share of their damping are the same pole.
// Least squared amplitude over twice its variance; noise reaches this with a probability of e^-21.
constexpr double chance = 21.0;
constexpr double deepest_db = -110.0;      // Modes this far below the strongest one are dropped.
constexpr double least_freedoms = 100.0;   // Size of the band whose noise is measured.
constexpr std::size_t least_fitted = 150;  // Number of modes that are fitted at once if found.
// Modes that leave less than this share of the energy are not those of noise.
constexpr double most_of_noise = 0.8;
// Largest share of the energy that may be lost by leaving out the contact.
constexpr double most_left_out = 0.01;
// Number of modes whose residual is reported, from the largest.
constexpr std::size_t choices[] = {40, 20, 10, 5};
// A residual below this share of the sound's energy is rounding error.
constexpr double rounding = 1e-24;
// A fit ends when a step reduces the residual's energy by less than this share.
constexpr double settled = 1e-3;
constexpr double much_more = 1.12;  // 0.5 dB, the energy that dropped modes may have explained.
constexpr double roughly_settled = 1e-2;  // The same between two searches.
constexpr double closely_settled = 1e-4;  // The same for modes that overlap.
// The same at the minimum: less than noise explains by one parameter in 200 s of sound.
constexpr double converged = 1e-7;
constexpr double lowest_hz = 15.0;
// Grid of modes that ESPRIT misses: ratio of its frequencies, and largest Q.
constexpr double fine = 1.03;
constexpr double strongly_damped = 50.0;
constexpr double least_quality = 0.5;
// Number of standard deviations that a mode must stand above the noise.
constexpr double sure = 3.0;

// The noise level of the residual around a mode, over the time that the mode rings.
class Noise {
 public:
  explicit Noise(const std::vector<std::vector<double>>& rest) : channels_(rest.size()) {
    for (std::size_t frames = std::bit_floor(rest[0].size()); frames >= 256; frames /= 4) {
      powers_.emplace_back(rest, frames);
    }
    if (powers_.empty()) {
      powers_.emplace_back(rest, rest[0].size());
    }
  }
  // Returns the variance per channel of white noise with the same power density at this frequency.
  double variance(Complex log_z) const {
    const double alpha = -log_z.real();
    const double omega = log_z.imag();
    const Power& power = powers_[index_of(alpha)];
    const double half_width =
        std::max({8.0 * std::numbers::pi / static_cast<double>(power.frames()), 2.0 * alpha,
                  0.02 * omega, 0.002});
    return power.density(omega, half_width) / static_cast<double>(channels_);
  }
  // Returns the same over a band that has many more degrees of freedom than the fit has taken from
  // it, and corrects for those taken. Steady noise is better known from a longer time, where the
  // fit has taken less of it.
  double variance_beside(Complex log_z, const std::vector<DampedMode>& modes) const {
    double most = 0.0;
    for (std::size_t i = 0; i <= index_of(-log_z.real()); ++i) {
      most = std::max(most, variance_beside(powers_[i], log_z.imag(), modes));
    }
    return most;
  }
  // Returns the same between the peaks of the residual (by the median of the density).
  double floor(Complex log_z) const {
    const Power& power = powers_[index_of(-log_z.real())];
    return power.floor(log_z.imag(), std::max({-4.0 * log_z.real(), 0.05 * log_z.imag(), 0.01})) /
           static_cast<double>(channels_);
  }

 private:
  std::size_t index_of(double alpha) const {
    std::size_t i = 0;
    while (i + 1 < powers_.size() && static_cast<double>(powers_[i + 1].frames()) * alpha > 2.0) {
      ++i;
    }
    return i;
  }
  double variance_beside(const Power& power, double omega,
                         const std::vector<DampedMode>& modes) const {
    const double freedoms = static_cast<double>(power.frames() * channels_) / std::numbers::pi;
    const double half_width = std::max(least_freedoms / (2.0 * freedoms), 0.1 * omega);
    const auto near = std::ranges::count_if(modes, [&](const DampedMode& mode) {
      return std::fabs(mode.log_z.imag() - omega) < half_width;
    });
    const double all = 2.0 * half_width * freedoms;
    const double taken = 2.0 * static_cast<double>(near) * static_cast<double>(1 + channels_);
    return power.density(omega, half_width) / static_cast<double>(channels_) * all /
           std::max(0.5 * all, all - taken);
  }

  std::vector<Power> powers_;  // Spectra of ever shorter beginnings of the residual.
  std::size_t channels_;
};

double decibels(double power) {
  return 10.0 * std::log10(std::max(power, 1e-40));
}

// Returns the sum of squares of the mode, approximated as if it rang forever.
double energy_of(const DampedMode& mode, std::size_t frames) {
  double square = 0.0;
  for (const Complex c : mode.c) {
    square += std::norm(c);
  }
  const double alpha = std::max(-mode.log_z.real(), 0.5 / static_cast<double>(frames));
  return square / (4.0 * alpha);
}

// Returns the squared ratio of the amplitude to its deviation.
double certainty(const DampedMode& mode, const DampedDeviation& deviation, double variance) {
  double sum = 0.0;
  for (std::size_t c = 0; c < mode.c.size(); ++c) {
    sum += std::norm(mode.c[c]) / (1e-300 + variance * deviation.c[c] * deviation.c[c]);
  }
  return sum;
}

bool are_twins(Complex a, Complex b, double share, std::size_t frames) {
  const double near =
      std::max(share * std::min(-a.real(), -b.real()), 0.02 / static_cast<double>(frames));
  return std::abs(a - b) < near;
}

double highest_omega(double rate_hz) {
  return 2.0 * std::numbers::pi * std::min(0.45, highest_mode_hz / rate_hz);
}

// Fits all numbers of a growing set of modes.
class Search {
 public:
  // Keeps `least` to `most` modes: more than `least` only if they stand above the noise.
  Search(const std::vector<std::vector<double>>& sound, std::size_t least, std::size_t most,
         const Progress& progress)
      : sound_(sound), least_(least), most_(most), progress_(progress), fit_(sound) {
    fit_.set_poles({});  // Starts with the constant alone.
    sound_energy_ = fit_.rest_energy();
  }

  DampedFit& fit() { return fit_; }
  double rest_energy() const { return fit_.rest_energy(); }
  // Return the noise of the residual and the deviations of the modes, computed once for each fit.
  const Noise& noise() {
    forget_old();
    return noise_ ? *noise_ : noise_.emplace(fit_.rest());
  }
  const std::vector<DampedDeviation>& deviations() {
    forget_old();
    return deviations_ ? *deviations_ : deviations_.emplace(fit_.deviations(true));
  }

  // Searches the first `frames` samples of the residual and adds the poles found. Poles damped more
  // than `most_alpha` were out of reach of earlier searches, so they are searched again.
  void search_residual(const PoleSearch& search, std::size_t frames, double most_alpha) {
    if (frames < shortest_for(search) || fit_.rest_energy() < rounding * sound_energy_) {
      return;
    }
    const std::vector<DampedMode> before = fit_.modes();
    std::vector<DampedMode> kept = before;
    std::erase_if(kept, [&](const DampedMode& mode) { return -mode.log_z.real() > most_alpha; });
    fit_.set_modes(kept);
    std::vector<std::vector<double>> start;
    for (const std::vector<double>& channel : fit_.rest()) {
      start.emplace_back(channel.begin(), channel.begin() + static_cast<std::ptrdiff_t>(frames));
    }
    progress_.stage("searching for modes");
    const std::vector<Complex> found = find_poles(start, search, progress_);
    if (found.empty()) {
      fit_.set_modes(before);
      return;
    }
    progress_.stage("fitting the modes to the sound");
    add(strongest(found, start));
    for (int round = 0; round < 12 && drop_unlikely() > 0; ++round) {
    }
    fit_.refine(2, roughly_settled, progress_);
    if (drop_unlikely() > 0) {
      fit_.refine(2, roughly_settled, progress_);
    }
  }

  // Adds strongly damped modes that ESPRIT missed, from a grid of frequencies and Qs: those that
  // explain the most of the residual. Repeats while the residual falls by a twentieth.
  void add_damped_modes(double highest_omega) {
    constexpr int rounds = 6;
    progress_.stage("searching for damped modes");
    // From 30 Hz at 44,100 Hz, and four periods in the sound.
    const std::vector<Complex> grid =
        damped_grid(std::max(0.004, 8.0 * std::numbers::pi / static_cast<double>(frames())),
                    highest_omega, fine, strongly_damped);
    for (int round = 0; round < rounds && fit_.modes().size() < most_; ++round) {
      const double before = fit_.rest_energy();
      if (before < rounding * sound_energy_) {
        return;
      }
      add(explaining(grid, 0.0));
      drop_unlikely();
      fit_.refine(4, roughly_settled, progress_);
      drop_unlikely();
      drop_uncertain();
      if (fit_.rest_energy() > 0.95 * before) {
        return;
      }
    }
  }

  // Separates modes that overlap. Each round adds strongly damped modes that explain the residual,
  // fits all modes and removes those that their neighbours can replace. Changes nothing unless the
  // first round reduces the residual by a fifth, as it does if the sound is a sum of damped
  // sinusoids.
  void resolve(double rate_hz) {
    constexpr int rounds = 12;
    constexpr std::size_t most_overlapping = 100;  // More would take seconds.
    constexpr double clearly_less = 0.8;
    constexpr double hardly_less = 0.9;
    constexpr double much = 0.5;
    progress_.stage("separating modes that overlap");
    const DampedFit first = fit_;
    const double most_rest = clearly_less * first.rest_energy();
    limit(fit_, rate_hz);
    const std::vector<Complex> grid =
        damped_grid(fit_.lowest_omega(), highest_omega(rate_hz), fine, strongly_damped);
    for (int round = 0; round < rounds && rest_energy() > rounding * sound_energy_; ++round) {
      const DampedFit before = fit_;
      add(explaining(grid, 0.0, much));
      const bool is_quick = fit_.modes().size() <= std::min(most_, most_overlapping);
      if (is_quick) {
        fit_.refine(20, closely_settled, progress_);
      }
      if (!is_quick || rest_energy() > most_rest) {
        fit_ = before;
        break;
      }
      simplify(rate_hz, false);
      if (rest_energy() > hardly_less * before.rest_energy()) {
        break;
      }
    }
    overlap_ = rest_energy() < first.rest_energy();
    if (overlap_) {
      simplify(rate_hz, true);
    } else {
      fit_ = first;
    }
    fit_.limit(0.0, 0.0);
  }

  // Fits modes that overlap until they are at the minimum: they converge slowly, and their
  // deviations hold only there.
  void converge(double rate_hz) {
    if (overlap_) {
      progress_.stage("fitting the modes to the sound");
      limit(fit_, rate_hz);
      fit_.refine(60, converged, progress_);
      fit_.limit(0.0, 0.0);
    }
  }

  // Replaces the search by these poles, except those that noise could explain.
  void start(const std::vector<Complex>& poles) {
    fit_.set_poles(poles);
    for (int round = 0; round < 20 && drop_unlikely() + drop_uncertain() > 0; ++round) {
    }
  }

  // Removes modes until `count` are left, a quarter at a time so that the others can move.
  void shrink(std::size_t count) {
    std::size_t had = 0;
    do {
      had = fit_.modes().size();
      keep_best(std::max(count, had * 3 / 4), {});
      fit_.refine(4, roughly_settled, progress_);
    } while (fit_.modes().size() > count && fit_.modes().size() < had);
  }

  // Exchanges modes for strongly damped ones while the residual falls. At most `count` are left.
  void exchange(std::size_t count, const std::vector<Complex>& grid) {
    constexpr int rounds = 12;
    int poor = 0;
    for (int round = 0; round < rounds && poor < 2; ++round) {
      const DampedFit before = fit_;
      const double rest = before.rest_energy();
      if (rest < rounding * sound_energy_) {
        return;
      }
      add(explaining(grid, std::numbers::pi / static_cast<double>(frames())));
      if (fit_.rest_energy() > 0.97 * rest) {  // as much as modes of noise explain
        fit_ = before;
        return;
      }
      // The new modes move before the choice in every other round.
      fit_.refine(round % 2 * 4, roughly_settled, progress_);
      shrink(count);
      poor += fit_.rest_energy() > 0.99 * rest ? 1 : 0;
      if (fit_.rest_energy() > rest) {
        fit_ = before;
      }
    }
  }

  // Fits the `count` modes that explain the most. Starts twice, with all modes found and with none,
  // and keeps the better set.
  void choose(std::size_t count, double rate_hz) {
    progress_.stage("choosing the modes");
    limit(fit_, rate_hz);
    const std::vector<Complex> grid =
        damped_grid(1.4 * fit_.lowest_omega(), highest_omega(rate_hz), fine, strongly_damped);
    std::vector<Complex> pool = poles_of(fit_.modes());
    std::ranges::copy(grid, std::back_inserter(pool));
    shrink(count);
    exchange(count, grid);
    const DampedFit first = fit_;
    if (first.rest_energy() < rounding * sound_energy_) {
      return;
    }
    fit_.set_poles({});
    for (std::size_t had = count; fit_.modes().size() < count && fit_.modes().size() != had;) {
      had = fit_.modes().size();
      std::vector<Complex> best =
          explaining(pool, std::numbers::pi / static_cast<double>(frames()));
      best.resize(std::min(best.size(), 1 + (count - had) / 12));
      add(best);
      fit_.refine(2, roughly_settled, progress_);
    }
    exchange(count, grid);
    if (first.rest_energy() < fit_.rest_energy()) {
      fit_ = first;
    }
    fit_.refine(10, settled, progress_);
  }

  void finish() {
    progress_.stage("fitting the modes to the sound");
    fit_.refine(10, settled, progress_);
    keep_likely(least_);
  }

  // Removes the modes for which `is_wrong` holds.
  void remove(const std::vector<bool>& is_wrong) {
    fit_.eliminate([&](const std::vector<double>& drops) {
      std::size_t k = 0;
      while (k < drops.size() && !(is_wrong[k] && drops[k] < HUGE_VAL)) {
        ++k;
      }
      return k;
    });
  }

  // Keeps the `count` modes that explain the most together, not counting those for which `is_kept`
  // holds. The poles stay.
  void keep_best(std::size_t count, std::vector<bool> is_kept) {
    is_kept.resize(fit_.modes().size());
    auto left = static_cast<std::size_t>(std::ranges::count(is_kept, false));
    fit_.eliminate([&](const std::vector<double>& drops) {
      std::size_t least = drops.size();
      for (std::size_t k = 0; k < drops.size() && left > count; ++k) {
        if (!is_kept[k] && (least == drops.size() || drops[k] < drops[least])) {
          least = k;
        }
      }
      left -= left > count ? 1 : 0;
      return least;
    });
  }

  // Keeps only modes that stand above the noise, but at least this many. Uncertain modes are kept
  // if the sound cannot be explained without them: each mode of a group can be uncertain while the
  // group is not.
  void keep_likely(std::size_t least) {
    least_ = least;
    bool drops_uncertain = true;
    for (int round = 0; round < 20; ++round) {
      const std::size_t unlikely = drop_unlikely();
      const std::vector<DampedMode> before = fit_.modes();
      const double most_rest = much_more * fit_.rest_energy();
      const std::size_t uncertain = drops_uncertain ? drop_uncertain() : 0;
      if (unlikely + uncertain == 0) {
        return;
      }
      fit_.refine(10, settled, progress_);
      if (uncertain > 0 && fit_.rest_energy() > most_rest) {
        drops_uncertain = false;
        fit_.set_modes(before);
      }
    }
  }

  std::size_t frames() const { return sound_[0].size(); }

 private:
  void forget_old() {
    if (known_version_ != fit_.version()) {
      noise_.reset();
      deviations_.reset();
      known_version_ = fit_.version();
    }
  }

  // Limits the modes that `fit` finds from now on to those that have a period in the sound. A sound
  // of less than a second does not show whether a tone is steady, so there they decay, too.
  void limit(DampedFit& fit, double rate_hz) const {
    const auto length = static_cast<double>(frames());
    fit.limit(2.0 * std::numbers::pi * std::max(lowest_hz / rate_hz, 1.0 / length),
              length < rate_hz ? 1.01 / length : 0.0);
  }

  // Removes modes that their neighbours can replace: for each, the residual's energy grows by no
  // more than noise explains. All of them together add at most 0.5 dB. The fit of all modes may
  // move each of them a little; if `is_last`, all are tried again after it.
  void simplify(double rate_hz, bool is_last) {
    const double most_rest = much_more * rest_energy();
    const double wanted = 2.0 * (chance + static_cast<double>(sound_.size() - 1));
    const Noise noise = this->noise();
    const std::vector<DampedMode> all = fit_.modes();
    std::vector<bool> is_needed(all.size());  // None of the modes beside it was fitted since.
    bool are_all_tried = true;
    for (bool goes_on = true; goes_on;) {
      goes_on = false;
      std::vector<DampedMode> modes = fit_.modes();
      const std::vector<double> variances = mapped(
          modes, [&](const DampedMode& mode) { return noise.variance_beside(mode.log_z, all); });
      std::vector<std::pair<double, std::size_t>> order;
      fit_.eliminate([&](const std::vector<double>& drops) {
        for (std::size_t k = 0; k < drops.size(); ++k) {
          order.emplace_back(drops[k] / variances[k], k);
        }
        return drops.size();
      });
      std::ranges::sort(order);
      std::vector<bool> is_removed(modes.size());
      for (const auto& [drop, k] : order) {
        if (is_needed[k]) {
          continue;
        }
        const std::optional<Replaced> others = without(k, is_removed, rate_hz);
        is_needed[k] = !others || others->more >= wanted * variances[k] ||
                       rest_energy() + others->more >= most_rest;
        if (is_needed[k]) {
          continue;
        }
        for (std::size_t i = 0; i < others->places.size(); ++i) {
          modes[others->places[i]] = others->modes[i];
          is_needed[others->places[i]] = false;
        }
        std::ranges::fill(modes[k].c, Complex());
        is_removed[k] = goes_on = true;
        fit_.set_modes(modes);
      }
      std::size_t k = 0;
      std::erase_if(modes, [&](const DampedMode&) { return is_removed[k++]; });
      std::erase_if(is_needed, [&, j = std::size_t{0}](bool) mutable { return is_removed[j++]; });
      fit_.set_modes(std::move(modes));
      fit_.refine(10, closely_settled, progress_);
      are_all_tried = is_last && !goes_on && !are_all_tried;
      if (are_all_tried) {
        is_needed.assign(is_needed.size(), false);
        goes_on = true;
      }
    }
    fit_.refine(20, closely_settled, progress_);
  }

  // The neighbours of a mode, fitted without it.
  struct Replaced {
    std::vector<std::size_t> places;
    std::vector<DampedMode> modes;
    double more;  // growth of the residual's energy without the mode
  };

  // Leaves mode k out and fits its neighbours anew, for as long as they ring. Modes that ring much
  // longer stay as they are. Returns nothing if the neighbours cannot be distinguished.
  std::optional<Replaced> without(std::size_t k, const std::vector<bool>& is_removed,
                                  double rate_hz) const {
    constexpr double much_longer = 16.0;
    constexpr double nepers = 12.0;  // Decay after which nothing is left to fit.
    const std::vector<DampedMode>& modes = fit_.modes();
    const double least_alpha =
        std::max(-modes[k].log_z.real(), 1.0 / static_cast<double>(frames())) / much_longer;
    Replaced found;
    std::vector<DampedMode> local;
    for (std::size_t j = 0; j < modes.size(); ++j) {
      if (j != k && !is_removed[j] && -modes[j].log_z.real() > least_alpha &&
          are_neighbours(modes[j].log_z, modes[k].log_z)) {
        found.places.push_back(j);
        local.push_back(modes[j]);
      }
    }
    const std::vector<Complex> others = poles_of(local);
    local.push_back(modes[k]);
    const auto window =
        static_cast<std::ptrdiff_t>(std::min(static_cast<double>(frames()), nepers / least_alpha));
    std::vector<std::vector<double>> start;
    for (const std::vector<double>& channel : fit_.rest()) {
      start.emplace_back(channel.begin(), channel.begin() + window);
    }
    const double before = energy_in(start);
    for (std::size_t c = 0; c < start.size(); ++c) {
      const auto added = mapped(local, [&](const DampedMode& mode) { return mode.c[c]; });
      add_damped(start[c], added, poles_of(local));
    }
    DampedFit fit(start);
    limit(fit, rate_hz);
    if (!fit.set_poles(others)) {
      return std::nullopt;
    }
    fit.refine(20, closely_settled, progress_);
    found.modes = fit.modes();
    found.more = fit.rest_energy() - before;
    return found;
  }

  struct Ranked {
    double explained;  // Energy that the pole alone explains, approximately.
    Complex log_z;
  };
  // Returns the poles, those that explain the most energy on their own first.
  std::vector<Ranked> rank(const std::vector<Complex>& poles,
                           const std::vector<std::vector<double>>& sound) const {
    const std::vector<double> energies = explained_energies(sound, poles);
    progress_.spend(sound.size() * sound[0].size() * poles.size() / 4);
    std::vector<Ranked> ranked;
    for (std::size_t k = 0; k < poles.size(); ++k) {
      ranked.push_back({energies[k], poles[k]});
    }
    std::ranges::sort(ranked, std::ranges::greater(), &Ranked::explained);
    return ranked;
  }

  // Returns the poles that would each explain the most energy on their own.
  std::vector<Complex> strongest(const std::vector<Complex>& found,
                                 const std::vector<std::vector<double>>& start) const {
    const std::size_t room = most_ * 3 / 2;
    if (found.size() <= room) {
      return found;
    }
    const std::vector<Ranked> ranked = rank(found, start);
    std::vector<Complex> strongest;
    for (std::size_t i = 0; i < room; ++i) {
      strongest.push_back(ranked[i].log_z);
    }
    return strongest;
  }

  // Returns the poles that explain at least the share `much` of the energy that the best one
  // explains, none within twice its damping plus `distance` of one that explains more.
  std::vector<Complex> explaining(const std::vector<Complex>& poles, double distance,
                                  double much = 0.1) const {
    std::vector<Complex> best;
    const std::vector<Ranked> ranked = rank(poles, fit_.rest());
    for (const auto& [explained, log_z] : ranked) {
      const auto is_near = [z = log_z, distance](Complex other) {
        return std::fabs(other.imag() - z.imag()) <
               2.0 * std::max(-other.real(), -z.real()) + distance;
      };
      if (explained > much * ranked[0].explained && std::ranges::none_of(best, is_near)) {
        best.push_back(log_z);
      }
    }
    return best;
  }

  void add(const std::vector<Complex>& found) {
    const std::vector<Complex> known = poles_of(fit_.modes());
    for (double share = twin; share < 20.0; share *= 4.0) {
      std::vector<Complex> all = known;
      for (const Complex log_z : found) {
        if (std::ranges::none_of(
                all, [&](Complex other) { return are_twins(log_z, other, share, frames()); })) {
          all.push_back(log_z);
        }
      }
      if (fit_.set_poles(all)) {
        return;
      }
    }
    fit_.set_poles(known);
  }

  // Removes modes that are so close to others that their amplitudes are not known. Of a group of
  // neighbours only one is removed at a time. Returns their number.
  std::size_t drop_uncertain() {
    const std::vector<DampedMode>& modes = fit_.modes();
    const std::vector<DampedDeviation>& deviations = this->deviations();
    const Noise& noise = this->noise();
    std::vector<std::pair<double, std::size_t>> uncertain;  // certainty, mode
    for (std::size_t k = 0; k < modes.size(); ++k) {
      const double certain = certainty(modes[k], deviations[k], noise.variance(modes[k].log_z));
      if (!(certain >= 1.0)) {
        uncertain.emplace_back(certain, k);
      }
    }
    std::ranges::sort(uncertain);
    std::vector<bool> is_dropped(modes.size());
    std::size_t left = modes.size();
    for (const auto& row : uncertain) {
      const std::size_t k = row.second;
      bool has_gone_beside = left <= least_;
      for (std::size_t j = 0; j < modes.size() && !has_gone_beside; ++j) {
        has_gone_beside = is_dropped[j] && are_neighbours(modes[j].log_z, modes[k].log_z);
      }
      is_dropped[k] = !has_gone_beside;
      left -= has_gone_beside ? 0 : 1;
    }
    remove(is_dropped);
    return is_dropped.size() - left;
  }

  bool are_neighbours(Complex a, Complex b) const {
    const double resolved = 8.0 * std::numbers::pi / static_cast<double>(frames());
    return std::fabs(a.imag() - b.imag()) < 4.0 * std::max(-a.real(), -b.real()) + resolved;
  }

  // Removes modes that noise could explain, the least likely first. A mode counts by how much more
  // the residual would be without it, relative to the noise around it. Returns their number.
  std::size_t drop_unlikely() {
    const std::vector<DampedMode>& modes = fit_.modes();
    const Noise& noise = this->noise();
    std::vector<std::vector<std::size_t>> neighbours(modes.size());
    std::vector<double> variance;
    std::vector<double> floor;
    for (std::size_t k = 0; k < modes.size(); ++k) {
      variance.push_back(noise.variance(modes[k].log_z));
      floor.push_back(noise.floor(modes[k].log_z));
      for (std::size_t j = 0; j < modes.size(); ++j) {
        if (are_neighbours(modes[k].log_z, modes[j].log_z)) {
          neighbours[k].push_back(j);
        }
      }
    }
    const double wanted = chance + static_cast<double>(sound_.size() - 1);
    std::size_t left = modes.size();
    return fit_.eliminate([&](const std::vector<double>& drops) {
      if (left <= least_) {
        return drops.size();
      }
      if (left > most_) {
        --left;
        return static_cast<std::size_t>(std::ranges::min_element(drops) - drops.begin());
      }
      double most = 0.0;
      for (const double drop : drops) {
        most = std::max(most, drop < HUGE_VAL ? drop : 0.0);
      }
      const double least_drop = most * std::pow(10.0, deepest_db / 10.0);
      std::size_t next = drops.size();
      double least = wanted;
      for (std::size_t k = 0; k < drops.size(); ++k) {
        // A peak that is not exactly a damped sinusoid leaves a large residual around it, but it is
        // still a peak. Any other mode near it must exceed that residual.
        const bool is_peak = std::ranges::none_of(neighbours[k], [&](std::size_t j) {
          return drops[j] > drops[k] && drops[j] < HUGE_VAL;
        });
        const double likelihood =
            drops[k] < least_drop ? 0.0 : 0.5 * drops[k] / (is_peak ? floor[k] : variance[k]);
        if (!(likelihood >= least) && drops[k] < HUGE_VAL) {
          least = likelihood;
          next = k;
        }
      }
      --left;
      return next;
    });
  }

  const std::vector<std::vector<double>>& sound_;
  std::size_t least_;
  std::size_t most_;
  const Progress& progress_;
  DampedFit fit_;
  std::optional<Noise> noise_;
  std::optional<std::vector<DampedDeviation>> deviations_;
  std::size_t known_version_ = 0;  // of the fit
  double sound_energy_ = 0.0;
  bool overlap_ = false;  // resolve() has separated modes.
};

void search_all(Search& search, double rate_hz) {
  const double highest = highest_omega(rate_hz);
  const auto decimation = std::size_t{1} << static_cast<unsigned>(
                              std::max(1.0, std::round(std::log2(rate_hz / band_hz))));
  struct Stage {
    std::size_t decimation;
    double length_s;
    // Unit: 1 / (samples that the previous search lost while its filter filled).
    double most_alpha;
  };
  const Stage stages[] = {{decimation, longest_ring_s, HUGE_VAL},
                          {std::max<std::size_t>(2, decimation / 4), 0.7, 1.5},
                          {std::max<std::size_t>(2, decimation / 16), 0.12, 1.5},
                          {decimation, longest_ring_s, HUGE_VAL}};
  std::size_t lost = 1;
  for (const Stage& stage : stages) {
    const PoleSearch wanted{stage.decimation, highest};
    search.search_residual(
        wanted, std::min(search.frames(), static_cast<std::size_t>(stage.length_s * rate_hz)),
        stage.most_alpha / static_cast<double>(lost));
    lost = frames_lost(wanted);
  }
  search.add_damped_modes(highest);
  search.finish();
  search.resolve(rate_hz);
}

// Returns the number of leading samples that belong to the contact itself rather than to free
// ringing: their residual exceeds that of the following samples.
std::size_t blow_frames(const std::vector<std::vector<double>>& rest, double rate_hz) {
  constexpr double frame_s = 0.001;
  constexpr double longest_s = 0.03;
  constexpr double much_more = 10.0;
  const auto frame = static_cast<std::size_t>(frame_s * rate_hz);
  std::vector<double> energies;
  for (std::size_t from = 0; from + frame <= rest[0].size(); from += frame) {
    double energy = 0.0;
    for (const std::vector<double>& channel : rest) {
      for (std::size_t n = from; n < from + frame; ++n) {
        energy += channel[n] * channel[n];
      }
    }
    energies.push_back(energy);
  }
  const auto most = static_cast<std::size_t>(longest_s / frame_s);
  if (energies.size() < 4 * most) {
    return 0;
  }
  std::vector<double> following(energies.begin() + static_cast<std::ptrdiff_t>(most),
                                energies.begin() + static_cast<std::ptrdiff_t>(4 * most));
  const auto middle = following.begin() + static_cast<std::ptrdiff_t>(following.size() / 2);
  std::nth_element(following.begin(), middle, following.end());
  std::size_t frames = most;
  while (frames > 0 && energies[frames - 1] <= much_more * *middle) {
    --frames;
  }
  return frames * frame;
}

// A fitted mode and its uncertainty.
struct Found {
  DampedMode mode;
  DampedDeviation deviation;  // For the noise around this mode.
};

enum class Fate { kept, steady, unfit };

// Returns the modes, extrapolated back by `head` samples.
DampedFit from_blow(const DampedFit& later, const std::vector<std::vector<double>>& sound,
                    std::size_t head) {
  std::vector<DampedMode> modes = later.modes();
  for (DampedMode& mode : modes) {
    for (Complex& c : mode.c) {
      c *= std::exp(-mode.log_z * static_cast<double>(head));
    }
  }
  DampedFit whole(sound);
  whole.set_modes(std::move(modes));
  return whole;
}

// Returns whether the modes that follow the clipped samples explain the samples between those, too.
bool explains_clipped(const DampedFit& later, const Blow& whole, std::size_t head) {
  constexpr double most_unexplained = 0.25;
  double energy = 0.0;
  double left = 0.0;
  const DampedFit fit = from_blow(later, whole.channels, head);
  for (std::size_t c = 0; c < whole.channels.size(); ++c) {
    for (std::size_t n = 0; n < head; ++n) {
      const double x = whole.channels[c][n];
      if (std::fabs(x) < 0.98 * whole.peak) {
        energy += x * x;
        left += fit.rest()[c][n] * fit.rest()[c][n];
      }
    }
  }
  return left <= most_unexplained * energy;
}

// Returns the deviation of a part of an amplitude after this many samples, relative to the decay
// since then. Takes its size and deviation, its covariance with its part of log_z, and the
// deviation of that.
double deviation_after(double samples, double size, double own, double covariance, double pole) {
  if (!(own < HUGE_VAL && pole < HUGE_VAL)) {
    return HUGE_VAL;
  }
  const double moved = samples * size;
  return std::sqrt(
      std::max(0.0, own * own + 2.0 * moved * covariance + moved * moved * pole * pole));
}

// Extrapolates the mode back in time.
void extrapolate_back(Found& found, double samples) {
  DampedDeviation& deviation = found.deviation;
  const double growth = std::exp(-found.mode.log_z.real() * samples);
  for (std::size_t c = 0; c < found.mode.c.size(); ++c) {
    const double moved = samples * std::abs(found.mode.c[c]);
    deviation.c[c] = growth * deviation_after(-samples, std::abs(found.mode.c[c]), deviation.c[c],
                                              deviation.with_alpha[c], deviation.alpha);
    deviation.with_alpha[c] =
        growth * (deviation.with_alpha[c] - moved * deviation.alpha * deviation.alpha);
    deviation.with_omega[c] =
        growth * (deviation.with_omega[c] - moved * deviation.omega * deviation.omega);
    found.mode.c[c] *= std::exp(-found.mode.log_z * samples);
  }
}

// Returns whether the mode, extrapolated to the blow, would be louder than it can have been. Such a
// mode had decayed before the first analysed sample, and what was fitted is rounding error.
bool is_too_loud(const Found& found, double peak) {
  constexpr double much_more = 30.0;
  return std::ranges::any_of(found.mode.c,
                             [&](Complex c) { return std::abs(c) > much_more * peak; });
}

Fate fate_of(const Found& found, double rate_hz, std::size_t frames, bool must_be_known) {
  const double alpha = -found.mode.log_z.real();
  const double omega = found.mode.log_z.imag();
  const bool is_seen_to_decay = alpha > sure * found.deviation.alpha;
  if ((!is_seen_to_decay && alpha * static_cast<double>(frames) < 1.0) || alpha * rate_hz < 0.05) {
    return Fate::steady;
  }
  const bool is_known = !must_be_known || found.deviation.alpha < alpha;
  // The search may have put a pole on these limits, with rounding.
  const bool rings = is_known && omega > 1.99 * std::numbers::pi * lowest_hz / rate_hz &&
                     omega < 0.999 * std::numbers::pi && omega > 1.99 * least_quality * alpha &&
                     omega <= 2.0 * std::numbers::pi * highest_mode_hz / rate_hz;
  return rings ? Fate::kept : Fate::unfit;
}

std::vector<Found> all_found(Search& search) {
  std::vector<Found> all;
  const DampedFit& fit = search.fit();
  const Noise& noise = search.noise();
  const std::vector<DampedDeviation>& deviations = search.deviations();
  for (std::size_t k = 0; k < fit.modes().size(); ++k) {
    all.push_back({fit.modes()[k], deviations[k]});
    const double scale = std::sqrt(noise.variance_beside(fit.modes()[k].log_z, fit.modes()));
    all.back().deviation.alpha *= scale;
    all.back().deviation.omega *= scale;
    for (std::size_t c = 0; c < fit.modes()[k].c.size(); ++c) {
      all.back().deviation.c[c] *= scale;
      all.back().deviation.with_alpha[c] *= scale * scale;
      all.back().deviation.with_omega[c] *= scale * scale;
    }
  }
  return all;
}

FallingPitch fall_of(const FoundGlide& found, double rate_hz) {
  constexpr double cents = 1200.0 / std::numbers::ln2;
  const auto& [one, other] = found.steps;
  return {.cents = {cents * found.glide.size, cents * one.size},
          .decay_s = {found.glide.decay / rate_hz, std::hypot(one.decay, other.decay) / rate_hz}};
}

// Gives the modes the damping that they have beside the glide, and adds to their deviations how far
// they move if the glide moves by its own. `modes` begin at the first analysed sample, `all` at the
// blow.
void follow_glide(std::vector<Found>& all, const std::vector<DampedMode>& modes,
                  const FoundGlide& falling, const Blow& blow, const Progress& progress) {
  const Glide& glide = falling.glide;
  for (const Glide& step : falling.steps) {
    const Channels straight = without_glide(
        blow.channels, {glide.size + step.size, glide.decay + step.decay, glide.damping});
    DampedFit fit(straight);
    if (!fit.set_poles(poles_of(modes))) {
      continue;
    }
    fit.refine(4, settled, progress);
    for (std::size_t k = 0; k < all.size(); ++k) {
      DampedDeviation& deviation = all[k].deviation;
      const Complex moved = fit.modes()[k].log_z - modes[k].log_z;
      deviation.alpha = std::hypot(deviation.alpha, moved.real());
      deviation.omega = std::hypot(deviation.omega, moved.imag());
      for (std::size_t c = 0; c < deviation.c.size(); ++c) {
        const double size = std::abs(fit.modes()[k].c[c] - modes[k].c[c]);
        deviation.c[c] = std::hypot(deviation.c[c], size / std::numbers::sqrt2);
      }
    }
  }
  for (Found& found : all) {
    found.mode.log_z.real(-glide.true_damping(-found.mode.log_z.real()));
  }
}

// Returns what the modes leave of the sound, which begins `skipped` samples after the blow.
Channels rest_beside(const Glide& glide, const Channels& sound, const std::vector<Found>& modes,
                     double skipped) {
  Channels rest = sound;
  for (std::size_t n = 0; n < sound[0].size(); ++n) {
    const auto time = static_cast<double>(n);
    const double phase = glide.straight(time) + skipped;
    for (const Found& found : modes) {
      const Complex turned = std::polar(std::exp(found.mode.log_z.real() * (time + skipped)),
                                        found.mode.log_z.imag() * phase);
      for (std::size_t c = 0; c < rest.size(); ++c) {
        rest[c][n] -= times(found.mode.c[c], turned).real();
      }
    }
  }
  return rest;
}

// Returns the time, in samples from the onset, at which one impulse would best explain all phases:
// there every mode of a body that starts at rest passes through 0.
double time_of_impulse(const std::vector<Found>& all, double rate_hz) {
  const double reach = 0.001 * rate_hz;
  double best = 0.0;
  double most = -1.0;
  for (double t = -std::ceil(reach); t <= 0.5 * reach; t += 0.0625) {
    double sum = 0.0;
    double weight = 1e-300;
    for (const Found& found : all) {
      for (const Complex c : found.mode.c) {
        // Weights by amplitude instead of power, so that the loudest mode does not decide alone.
        const double sine = std::arg(c) + found.mode.log_z.imag() * t + 0.5 * std::numbers::pi;
        sum += std::abs(c) * std::cos(sine) * std::cos(sine);
        weight += std::abs(c);
      }
    }
    const double match = sum / weight - 0.1 * std::fabs(t) / reach;
    if (match > most) {
      most = match;
      best = t;
    }
  }
  return best;
}

// Returns what the best modes leave, for several numbers of them.
std::vector<Unexplained> try_choices(Search search, double energy) {
  std::vector<Unexplained> tried;
  for (const std::size_t count : choices) {
    if (search.fit().modes().size() >= count) {
      search.shrink(count);
      tried.insert(tried.begin(), {count, decibels(search.fit().rest_energy() / energy)});
    }
  }
  return tried;
}

IdentifiedMode measured(const Found& found, double rate_hz, double time_zero) {
  constexpr double last_digit = 2.3e-16;
  const double alpha = -found.mode.log_z.real();
  const double omega = found.mode.log_z.imag();
  const double hertz = rate_hz / (2.0 * std::numbers::pi);
  IdentifiedMode mode;
  mode.frequency_hz = {omega * hertz,
                       hertz * std::hypot(found.deviation.omega, last_digit * omega)};
  mode.t60_s.value = std::log(1000.0) / (alpha * rate_hz);
  mode.t60_s.deviation = mode.t60_s.value * std::hypot(found.deviation.alpha / alpha, last_digit);
  for (std::size_t c = 0; c < found.mode.c.size(); ++c) {
    const DampedDeviation& deviation = found.deviation;
    const Complex start = found.mode.c[c] * std::exp(found.mode.log_z * time_zero);
    const double size = std::abs(found.mode.c[c]);
    const auto after = [&](double covariance, double pole) {
      return deviation_after(time_zero, size, deviation.c[c], covariance, pole);
    };
    mode.amplitude.push_back(
        {std::abs(start),
         std::exp(-alpha * time_zero) * after(deviation.with_alpha[c], deviation.alpha)});
    const double phase = after(deviation.with_omega[c], deviation.omega) / size;
    mode.phase_rad.push_back(
        {std::arg(start), size > 0.0 ? std::min(std::numbers::pi, phase) : std::numbers::pi});
  }
  return mode;
}

std::vector<OctaveResidual> by_octave(const std::vector<std::vector<double>>& sound,
                                      const std::vector<std::vector<double>>& residual,
                                      double rate_hz) {
  const Power whole(sound, sound[0].size());
  const Power left(residual, sound[0].size());
  const double all = whole.between(0.0, std::numbers::pi);
  std::vector<OctaveResidual> octaves;
  for (double centre_hz = 31.25; centre_hz < 0.45 * rate_hz && centre_hz < 20000.0;
       centre_hz *= 2.0) {
    OctaveResidual octave{.low_hz = centre_hz / std::numbers::sqrt2,
                          .high_hz = std::min(centre_hz * std::numbers::sqrt2, 0.5 * rate_hz)};
    const double low = 2.0 * std::numbers::pi * octave.low_hz / rate_hz;
    const double high = 2.0 * std::numbers::pi * octave.high_hz / rate_hz;
    const double there = whole.between(low, high);
    octave.level_db = decibels(there / all);
    octave.residual_db = decibels(left.between(low, high) / std::max(there, 1e-300));
    octaves.push_back(octave);
  }
  return octaves;
}

void warn_of_recording(const Blow& blow, Identification& found) {
  const double rings_s = found.analysed_s;
  if (blow.clipped > 0) {
    found.warnings.push_back(
        std::to_string(blow.clipped) + " samples are clipped: " +
        (blow.skipped > 0
             ? "the first " +
                   formatted("%.3g", 1e3 * static_cast<double>(blow.skipped) / found.rate_hz) +
                   " ms are extrapolated from the sound that follows"
             : "some modes may be spurious and some amplitudes too small"));
  }
  if (!blow.is_first) {
    found.warnings.push_back("it has several blows; the loudest one is used, which begins at " +
                             formatted("%.3g", found.onset_s) + " s");
  }
  if (blow.offset > 0.01) {
    found.warnings.push_back("it has an offset (DC) of " + formatted("%.0f", 100.0 * blow.offset) +
                             " % of its peak, which is removed");
  }
  if (blow.length_s > longest_ring_s + 0.001 && rings_s > longest_ring_s - 0.001) {
    found.warnings.push_back("only the first " + formatted("%.0f", longest_ring_s) +
                             " s after the blow, at " + formatted("%.3g", found.onset_s) +
                             " s, are analysed");
  }
}

// Identifies the modes of a recording's blow beside a glide.
Result<Identification> identify_beside(const FoundGlide& falling, const Recording& recording,
                                       Blow blow, const IdentifyOptions& options,
                                       const Progress& progress) {
  const double rate_hz = recording.rate_hz;
  Identification made{.rate_hz = rate_hz, .onset_s = static_cast<double>(blow.first) / rate_hz};
  made.sound = without_glide(blow.channels, falling.glide);
  const std::size_t least = std::max(choices[0], options.least_modes);
  const std::size_t most = std::max({least_fitted, least, options.most_modes});
  std::optional<Search> search(std::in_place, made.sound, least, most, progress);
  search_all(*search, rate_hz);
  if (blow.skipped > 0) {
    auto whole = find_blow(recording, false);
    if (!explains_clipped(search->fit(), *whole, blow.skipped)) {
      blow = *std::move(whole);
      made.sound = without_glide(blow.channels, falling.glide);
      search.emplace(made.sound, least, most, progress);
      search_all(*search, rate_hz);
    }
  }
  made.analysed_s = static_cast<double>(made.sound[0].size()) / rate_hz;
  warn_of_recording(blow, made);
  // A residual at the level of rounding errors contains no blow.
  const double rest_share = search->fit().rest_energy() / std::max(energy_in(made.sound), 1e-300);
  if (const std::size_t head = blow_frames(search->fit().rest(), rate_hz);
      head > 0 && rest_share > rounding && falling.glide.size == 0.0) {
    std::vector<std::vector<double>> later = made.sound;
    for (std::vector<double>& channel : later) {
      channel.erase(channel.begin(), channel.begin() + static_cast<std::ptrdiff_t>(head));
    }
    Search free(later, 0, most, progress);
    free.start(poles_of(search->fit().modes()));
    const double most_rest = search->fit().rest_energy() + most_left_out * energy_in(made.sound);
    const auto continues_back = [&] {
      return from_blow(free.fit(), made.sound, head).rest_energy() < most_rest;
    };
    // The fit moves the poles, so the second test can fail although the first one did not.
    if (continues_back() && (free.finish(), continues_back())) {
      made.sound = std::move(later);
      blow.skipped += head;
      search.emplace(made.sound, least, most, progress);
      search->start(poles_of(free.fit().modes()));
    }
  }
  const std::size_t frames = made.sound[0].size();
  const auto skipped = static_cast<double>(blow.skipped);
  made.skipped_s = skipped / rate_hz;
  made.analysed_s = static_cast<double>(frames) / rate_hz;
  const auto fates = [&](bool must_be_known) {
    std::vector<Fate> all;
    for (Found& found : all_found(*search)) {
      all.push_back(fate_of(found, rate_hz, frames, must_be_known));
      extrapolate_back(found, skipped);
      all.back() =
          all.back() == Fate::kept && is_too_loud(found, blow.peak) ? Fate::unfit : all.back();
    }
    return all;
  };
  const auto are = [](const std::vector<Fate>& all, Fate fate) {
    std::vector<bool> is(all.size());
    std::transform(all.begin(), all.end(), is.begin(), [&](Fate each) { return each == fate; });
    return is;
  };
  search->remove(are(fates(false), Fate::unfit));
  made.choices = try_choices(*search, std::max(energy_in(made.sound), 1e-300));
  bool must_be_known = options.least_modes == 0;
  if (options.least_modes > 0) {
    const Search whole = *search;
    const auto steady_count = [&] {
      return static_cast<std::size_t>(std::ranges::count(fates(false), Fate::steady));
    };
    // Steady tones are not modes of the body, and each choice may find more of them.
    std::size_t steady = 0;
    for (std::size_t now = steady_count(); now >= steady && steady < 8; now = steady_count()) {
      search.emplace(whole);
      search->choose(options.least_modes + now, rate_hz);
      steady = now + 1;
    }
  } else {
    search->keep_likely(0);
  }
  search->keep_best(options.most_modes, are(fates(false), Fate::steady));
  // The modes that are left move, so some of them may become unfit.
  for (std::size_t had = 0; search->fit().modes().size() != had;) {
    search->converge(rate_hz);
    const std::vector<DampedMode> likely = search->fit().modes();
    const double most_rest = much_more * search->rest_energy();
    had = likely.size();
    search->remove(are(fates(must_be_known), Fate::unfit));
    if (must_be_known && search->rest_energy() > most_rest) {
      must_be_known = false;
      search->fit().set_modes(likely);
      search->remove(are(fates(must_be_known), Fate::unfit));
    }
  }
  std::vector<Found> kept;
  double steady_hz = 0.0;
  double steady_energy = 0.0;
  std::size_t steady = 0;
  const std::vector<Fate> fate = fates(must_be_known);
  std::vector<Found> all = all_found(*search);
  for (std::size_t k = 0; k < all.size(); ++k) {
    extrapolate_back(all[k], skipped);
    if (fate[k] == Fate::kept) {
      kept.push_back(std::move(all[k]));
    } else if (fate[k] == Fate::steady) {
      ++steady;
      if (energy_of(all[k].mode, frames) > steady_energy) {
        steady_energy = energy_of(all[k].mode, frames);
        steady_hz = all[k].mode.log_z.imag() * rate_hz / (2.0 * std::numbers::pi);
      }
    }
  }
  std::ranges::sort(kept, [&](const Found& a, const Found& b) {
    return energy_of(a.mode, frames) > energy_of(b.mode, frames);
  });
  std::size_t count = 0;
  while (count < kept.size() &&
         energy_of(kept[count].mode, frames) >=
             energy_of(kept[0].mode, frames) * std::pow(10.0, options.floor_db / 10.0)) {
    ++count;
  }
  kept.resize(std::min(count, options.most_modes));
  if (steady > 0) {
    made.warnings.push_back(
        (steady == 1 ? "a tone" : std::to_string(steady) + " tones") +
        std::string(" without a measurable decay ") + (steady == 1 ? "is" : "are") + " left out, " +
        (steady == 1 ? "" : "the loudest ") + "at " + formatted("%.1f Hz", steady_hz));
  }
  // The modes of noise are uncertain and explain little of it.
  const double rest_now = search->fit().rest_energy() / std::max(energy_in(made.sound), 1e-300);
  const bool rings = options.least_modes > 0 || rest_now < most_of_noise ||
                     std::ranges::any_of(kept, [&](const Found& found) {
                       return certainty(found.mode, found.deviation, 1.0) >= 2.0 * chance;
                     });
  if (kept.empty() || !rings) {
    return Error{"nothing in it rings: no decaying tone stands above its noise"};
  }
  std::ranges::sort(kept, [](const Found& a, const Found& b) {
    return a.mode.log_z.imag() < b.mode.log_z.imag();
  });
  const double time_zero = time_of_impulse(kept, rate_hz);
  made.time_zero_s = made.onset_s + time_zero / rate_hz;
  std::vector<DampedMode> modes;
  for (Found& found : kept) {
    modes.push_back(found.mode);
    for (Complex& c : modes.back().c) {
      c *= std::exp(found.mode.log_z * skipped);
    }
  }
  if (falling.glide.size > 0.0) {
    made.fall = fall_of(falling, rate_hz);
    follow_glide(kept, modes, falling, blow, progress);
  }
  for (const Found& found : kept) {
    made.modes.push_back(measured(found, rate_hz, time_zero));
  }
  search->fit().set_modes(std::move(modes));
  made.residual = search->fit().rest();
  for (std::size_t c = 0; c < made.sound.size(); ++c) {
    for (double& x : made.sound[c]) {
      x -= search->fit().constant()[c];
    }
  }
  if (falling.glide.size > 0.0) {
    made.sound = std::move(blow.channels);
    made.residual = rest_beside(falling.glide, made.sound, kept, skipped);
  }
  made.residual_db = decibels(energy_in(made.residual) / std::max(energy_in(made.sound), 1e-300));
  made.octaves = by_octave(made.sound, made.residual, rate_hz);
  if (made.modes.size() < options.least_modes) {
    made.warnings.push_back("only " + std::to_string(made.modes.size()) + " modes were found");
  }
  if (made.residual_db > -6.0) {
    made.warnings.push_back(
        "the modes explain only " +
        formatted("%.0f", 100.0 * (1.0 - std::pow(10.0, made.residual_db / 10.0))) +
        " % of its energy; the recording does not sound like the ringing of one blow");
  }
  return made;
}

}  // namespace

Result<Identification> identify(const Recording& recording, const IdentifyOptions& options,
                                const Progress& progress) try {
  constexpr double little_db = 0.2;
  progress.stage("searching for the blow");
  const auto blow = find_blow(recording);
  if (!blow) {
    return blow.error();
  }
  auto constant = identify_beside({}, recording, *blow, options, progress);
  const FoundGlide falling = find_glide(blow->channels, recording.rate_hz, progress);
  if (falling.glide.size == 0.0) {
    return constant;
  }
  // Groups of close modes describe a falling pitch as well. The glide is better if it leaves less,
  // or about as little with fewer modes.
  auto gliding = identify_beside(falling, recording, *blow, options, progress);
  if (gliding && constant) {
    const bool has_fewer = gliding->modes.size() < constant->modes.size();
    const double most_db = constant->residual_db + (has_fewer ? little_db : -little_db);
    return gliding->residual_db < most_db ? gliding : constant;
  }
  return gliding ? gliding : constant;
} catch (const Stopped&) {
  return Error{stopped};
}

}  // namespace ressort::identification
