#include "core/analysis/timbre/ask.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>

#include "core/curve.h"
#include "core/linear_algebra/eigen.h"

namespace ressort::analysis {
namespace {

constexpr double unnoticed = 0.01;  // Accepted error, in just noticeable differences (JND).
constexpr double little = 1e-5;     // Step of the finite differences, as a share of a range.
constexpr double still = 1e-9;      // A shorter step, as a share of a range, ends the descent.
// A smaller change over a whole range, in JND, counts as no influence.
constexpr double no_slope = 1e-6;
// A step that leaves more of the cost than this counts as stalled.
constexpr double crawling = 0.98;
constexpr double least_damping = 1e-9;
constexpr int most_crawls = 3;
constexpr double hopeful = 5.0;       // Worst error, in JND, of an end point worth refining.
constexpr double same_end = 1e-3;     // End points closer than this share of a range are the same.
constexpr std::size_t most_far = 4;   // Number of poor end points that are kept.
constexpr double farthest_hop = 0.1;  // Length of a hop, as a share of a range.
constexpr int most_hops = 4;          // Hops per start.
constexpr int most_turns = 60;
constexpr int most_tries = 8;        // Attempts per step, each shorter than the one before.
constexpr int most_stale_tries = 2;  // Attempts with outdated slopes.
// The slopes are kept after a step that reduces the cost to at most this fraction.
constexpr double well_told = 0.25;

using Place = std::vector<double>;  // [free parameter] 0 to 1.

class MeterReader {
 public:
  MeterReader(const FiguresAt& model, std::span<const double> values,
              std::span<const FreeParameter> free, std::span<const TimbreTarget> targets,
              const Progress& progress)
      : model_(model),
        values_(values.begin(), values.end()),
        free_(free),
        targets_(targets),
        progress_(progress) {}

  struct Trial {
    Place place;
    TargetValues figures;
    Vector noticed;  // [target] In JND.
    double cost() const { return dot(noticed, noticed); }
    double worst() const { return largest(noticed); }
    bool is_there() const { return worst() <= unnoticed; }
  };

  std::vector<double> values_at(const Place& place) const {
    std::vector<double> values = values_;
    for (std::size_t i = 0; i < free_.size(); ++i) {
      const auto& [index, low, high] = free_[i];
      const double value =
          is_wide(low, high) ? low * std::pow(high / low, place[i]) : low + (high - low) * place[i];
      values[index] = std::clamp(value, low, high);
    }
    return values;
  }

  Place place_of_values() const {
    Place place;
    for (const FreeParameter& one : free_) {
      const double value = std::clamp(values_[one.index], one.minimum, one.maximum);
      place.push_back(is_wide(one.minimum, one.maximum)
                          ? std::log(value / one.minimum) / std::log(one.maximum / one.minimum)
                          : (value - one.minimum) / (one.maximum - one.minimum));
    }
    return place;
  }

  Result<TargetValues> figures_before() const { return model_(values_); }

  // Stores an error in `error`.
  std::optional<Trial> trial(const Place& place) {
    const Result<TargetValues> found = model_(values_at(place));
    ++trials;
    progress_.spend(std::size_t{1} << 17);  // Counts the cost of one evaluation.
    if (!found) {
      error = found.error();
      return std::nullopt;
    }
    Trial trial{place, *found, Vector(targets_.size())};
    for (std::size_t t = 0; t < targets_.size(); ++t) {
      const TimbreTarget& target = targets_[t];
      const auto value = (*found)[static_cast<std::size_t>(target.figure)];
      const double noticed = value ? jnd_between(target.figure, *value, target.value)
                                   : std::numeric_limits<double>::quiet_NaN();
      if (!std::isfinite(noticed)) {
        error = Error{"the sound has no " + std::string(row_of(target.figure).name) + " there"};
        return std::nullopt;
      }
      trial.noticed[t] = noticed;
    }
    return trial;
  }

  // [target, free parameter] Computed by finite differences towards the inside of the range.
  Matrix slopes(const Trial& at) {
    Matrix slopes(targets_.size(), free_.size());
    for (std::size_t i = 0; i < free_.size(); ++i) {
      const double first = at.place[i] + little <= 1.0 ? little : -little;
      for (const double step : {first, -first}) {
        Place place = at.place;
        place[i] = std::clamp(place[i] + step, 0.0, 1.0);
        const double moved = place[i] - at.place[i];
        if (moved == 0.0) {
          continue;
        }
        if (const auto there = trial(place)) {
          slopes.values[std::slice(i * targets_.size(), targets_.size(), 1)] =
              Vector((there->noticed - at.noticed) / moved);
          break;
        }
      }
    }
    return slopes;
  }

  struct Descent {
    Vector gradient;            // [free parameter] Gradient of half the cost.
    std::vector<bool> is_held;  // At a bound, with the descent direction pointing outwards.
    Matrix slopes;
  };
  Descent descent(const Trial& at, Matrix slopes) const {
    Descent down{Vector(free_.size()), std::vector<bool>(free_.size()), std::move(slopes)};
    for (std::size_t i = 0; i < free_.size(); ++i) {
      down.gradient[i] = dot(down.slopes.column(i), at.noticed);
      down.is_held[i] = (at.place[i] <= 0.0 && down.gradient[i] > 0.0) ||
                        (at.place[i] >= 1.0 && down.gradient[i] < 0.0);
    }
    return down;
  }
  Descent descent(const Trial& at) { return descent(at, slopes(at)); }

  // Levenberg-Marquardt descent until the target is reached, the cost is flat, or no step helps. A
  // step that did what the slopes predicted updates them (Broyden's rank-one update); otherwise
  // they are computed again.
  Trial descend(Trial at) {
    double damping = 1e-3;
    int crawls = 0;
    Descent down;
    bool is_new = false;
    bool is_wanted = true;
    for (int step = 0; step < most_turns && !at.is_there(); ++step) {
      if (is_wanted) {
        down = descent(at);
        is_new = true;
      }
      std::optional<Trial> next;
      for (int tries = 0; tries < (is_new ? most_tries : most_stale_tries) && !next; ++tries) {
        const auto to = stepped(at, down, damping);
        next = to ? trial(*to) : std::nullopt;
        next = next && next->cost() < at.cost() ? next : std::nullopt;
        damping = next ? std::max(least_damping, 0.2 * damping) : 5.0 * damping;
      }
      if (!next && !is_new) {
        is_wanted = true;
        continue;
      }
      if (!next) {
        break;
      }
      double moved = 0.0;
      for (std::size_t i = 0; i < free_.size(); ++i) {
        moved = std::max(moved, std::fabs(next->place[i] - at.place[i]));
      }
      const double left = next->cost() / at.cost();
      crawls = left > crawling ? crawls + 1 : 0;
      if (moved < still || crawls == most_crawls) {
        return *next;
      }
      is_wanted = left > well_told;
      is_new = false;
      if (!is_wanted) {
        down = descent(*next, updated(down.slopes, at, *next));
      }
      at = *std::move(next);
    }
    return at;
  }

  // Takes one more step with the current slopes.
  Trial polished(const Trial& at) {
    const auto to = stepped(at, descent(at), least_damping);
    const auto there = to ? trial(*to) : std::nullopt;
    return there && there->cost() < at.cost() ? *there : at;
  }

  Error error;
  std::size_t trials = 0;

 private:
  // J + (change of the error - J step) step^T / step^T step.
  Matrix updated(Matrix slopes, const Trial& from, const Trial& to) const {
    Vector step(free_.size());
    for (std::size_t i = 0; i < free_.size(); ++i) {
      step[i] = to.place[i] - from.place[i];
    }
    const double square = dot(step, step);
    Vector untold = to.noticed - from.noticed;
    for (std::size_t i = 0; i < free_.size(); ++i) {
      untold -= slopes.column(i) * step[i];
    }
    for (std::size_t i = 0; i < free_.size(); ++i) {
      slopes.values[std::slice(i * targets_.size(), targets_.size(), 1)] +=
          Vector(untold * step[i] / square);
    }
    return slopes;
  }

  // Solves (J^T J + damping (D + tiny)) step = -gradient for the parameters that no bound holds.
  std::optional<Place> stepped(const Trial& at, const Descent& down, double damping) const {
    std::vector<std::size_t> moving;
    for (std::size_t i = 0; i < free_.size(); ++i) {
      if (!down.is_held[i]) {
        moving.push_back(i);
      }
    }
    if (moving.empty()) {
      return std::nullopt;
    }
    Matrix normal(moving.size(), moving.size());
    Vector back(moving.size());
    double steepest = 0.0;
    for (std::size_t a = 0; a < moving.size(); ++a) {
      back[a] = -down.gradient[moving[a]];
      for (std::size_t b = 0; b < moving.size(); ++b) {
        normal(a, b) = dot(down.slopes.column(moving[a]), down.slopes.column(moving[b]));
      }
      steepest = std::max(steepest, normal(a, a));
    }
    if (!(steepest > 0.0)) {
      return std::nullopt;
    }
    for (std::size_t a = 0; a < moving.size(); ++a) {
      normal(a, a) += damping * (normal(a, a) + 1e-3 * steepest);
    }
    const auto step = solution(normal, back);
    if (!step) {
      return std::nullopt;
    }
    Place place = at.place;
    for (std::size_t a = 0; a < moving.size(); ++a) {
      place[moving[a]] = std::clamp(place[moving[a]] + (*step)[a], 0.0, 1.0);
    }
    return place == at.place ? std::nullopt : std::optional(place);
  }

  const FiguresAt& model_;
  std::vector<double> values_;
  std::span<const FreeParameter> free_;
  std::span<const TimbreTarget> targets_;
  const Progress& progress_;
};

// Returns a number from 0 to 1, the same on every machine.
double next_share(std::mt19937_64& random) {
  return 0x1p-53 * static_cast<double>(random() >> 11U);
}

std::optional<Error> wrong_target(const TimbreTarget& target) {
  const std::string_view wrong = target_error(target.figure, target.value);
  return wrong.empty() ? std::nullopt
                       : std::optional(Error{std::string(row_of(target.figure).name) + " " +
                                             std::string(wrong)});
}

// Descends from many starts with the smooth model, then refines the promising end points with the
// exact model, which is slower.
class Search {
 public:
  Search(const FiguresAt& model, std::span<const double> values,
         std::span<const FreeParameter> free, std::span<const TimbreTarget> targets,
         const TimbreSearchOptions& options)
      : options_(options),
        free_(free),
        asker_(model, values, free, targets, options.progress),
        judge_(options.exactly ? *options.exactly : model, values, free, targets, options.progress),
        random_(options.seed) {}

  Result<FoundTimbre> run() {
    options_.progress.stage("searching for the timbre");
    std::vector<MeterReader::Trial> far;
    int start = 0;
    for (; start < options_.starts && !is_there(); ++start) {
      report(start);
      Place place = asker_.place_of_values();
      for (std::size_t i = 0; start > 0 && i < free_.size(); ++i) {
        place[i] = next_share(random_);
      }
      auto end = asker_.trial(place);
      if (!end) {
        first_error_ = first_error_ ? first_error_ : asker_.error;
        continue;
      }
      end = asker_.descend(*end);
      if (start > 0 && options_.exactly && end->worst() > hopeful) {
        far.push_back(*std::move(end));
      } else {
        bring_nearer(*end);
      }
    }
    std::ranges::sort(far, [](const auto& a, const auto& b) { return a.cost() < b.cost(); });
    for (std::size_t i = 0; i < far.size() && (!best_ || i < most_far) && !is_there(); ++i) {
      bring_nearer(far[i]);
    }
    if (!best_) {
      return *first_error_;
    }
    if (is_there()) {
      best_ = judge_.polished(*best_);
    }
    return summary(start);
  }

 private:
  bool is_there() const { return best_ && best_->is_there(); }

  void report(int start) const {
    if (options_.on_progress) {
      options_.on_progress(static_cast<double>(start) / options_.starts);
    }
  }

  // Returns whether another start ended at the same place.
  bool is_again(const Place& end) const {
    return std::ranges::any_of(ends_, [&](const Place& other) {
      return std::ranges::equal(end, other,
                                [](double a, double b) { return std::fabs(a - b) < same_end; });
    });
  }

  void keep(std::optional<MeterReader::Trial> end) {
    if (end && (!best_ || end->cost() < best_->cost())) {
      best_ = std::move(end);
    }
  }

  void bring_nearer(const MeterReader::Trial& end) {
    if (!options_.exactly) {
      keep(end);
      return;
    }
    if (is_again(end.place)) {
      return;
    }
    ends_.push_back(end.place);
    auto judged = judge_.trial(end.place);
    if (!judged) {
      first_error_ = first_error_ ? first_error_ : judge_.error;
      return;
    }
    keep(judge_.descend(*std::move(judged)));
    // Near the target, a spectral peak that moves to the next bin can stop the descent. A small
    // random hop gets past it.
    for (int hop = 0; hop < most_hops && !is_there() && best_->worst() <= hopeful; ++hop) {
      const double reach = farthest_hop * std::exp2(-hop);
      Place place = best_->place;
      for (double& one : place) {
        one = std::clamp(one + reach * (2.0 * next_share(random_) - 1.0), 0.0, 1.0);
      }
      auto hopped = judge_.trial(place);
      keep(hopped ? judge_.descend(*std::move(hopped)) : hopped);
    }
  }

  FoundTimbre summary(int starts) {
    FoundTimbre asked;
    asked.starts = starts;
    // The model may be silent at its current parameters.
    if (const auto before = judge_.figures_before()) {
      asked.before = *before;
    }
    asked.values = judge_.values_at(best_->place);
    asked.reached = best_->figures;
    asked.noticed.assign(std::begin(best_->noticed), std::end(best_->noticed));
    asked.is_reached = best_->is_there();
    if (!asked.is_reached) {
      const auto down = judge_.descent(*best_);
      asked.has_influence = largest(down.slopes.values) > no_slope;
      for (std::size_t i = 0; i < free_.size(); ++i) {
        if (down.is_held[i]) {
          asked.held.push_back({free_[i].index, best_->place[i] >= 1.0});
        }
      }
    }
    asked.trials = asker_.trials + judge_.trials;
    return asked;
  }

  const TimbreSearchOptions& options_;
  std::span<const FreeParameter> free_;
  MeterReader asker_;
  MeterReader judge_;
  std::mt19937_64 random_;
  std::vector<Place> ends_;  // End points of the smooth model.
  std::optional<MeterReader::Trial> best_;
  std::optional<Error> first_error_;
};

}  // namespace

FiguresAt timbre_model(StruckModel& model, StruckAs how) {
  return [&model, how](std::span<const double> at) { return model.figures(at, how); };
}

Result<FoundTimbre> find_timbre(const FiguresAt& model, std::span<const double> values,
                                std::span<const FreeParameter> free,
                                std::span<const TimbreTarget> targets,
                                const TimbreSearchOptions& options) {
  if (free.empty()) {
    return Error{"no parameter is free to change"};
  }
  if (targets.empty()) {
    return Error{"no target is given"};
  }
  for (const TimbreTarget& target : targets) {
    if (auto wrong = wrong_target(target)) {
      return *wrong;
    }
  }
  try {
    return Search(model, values, free, targets, options).run();
  } catch (const Stopped&) {
    return Error{stopped};
  }
}

}  // namespace ressort::analysis
