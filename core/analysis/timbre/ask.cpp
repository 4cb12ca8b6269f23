#include "core/analysis/timbre/ask.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>

#include "core/curve.h"
#include "core/linear_algebra/eigen.h"

namespace ressort {
namespace {

constexpr double near_enough = 0.01;  // of what is noticed
constexpr double little = 1e-5;       // of a range, for differences
constexpr double still = 1e-9;        // of a range: a step that is none
constexpr double no_slope = 1e-6;     // what is noticed over a whole range
constexpr double crawling = 0.98;     // of the cost is left by a step that is hardly one
constexpr int most_crawls = 3;
constexpr double hopeful = 5.0;       // of what is noticed
constexpr double farthest_hop = 0.1;  // of a range
constexpr int most_hops = 4;          // of one start
constexpr int most_steps = 60;
constexpr int most_tries = 8;  // of one step, each shorter

using Place = std::vector<double>;  // [free] 0..1

class Asker {
 public:
  Asker(const FiguresAt& figures, std::span<const double> values,
        std::span<const FreeParameter> free, std::span<const TimbreTarget> targets,
        const Progress& progress)
      : figures_(figures),
        values_(values.begin(), values.end()),
        free_(free),
        targets_(targets),
        progress_(progress) {}

  struct Trial {
    Place place;
    AskedValues figures;
    std::vector<double> noticed;  // [target]
    double cost() const {
      double sum = 0.0;
      for (const double one : noticed) {
        sum += one * one;
      }
      return sum;
    }
    double worst() const {
      double most = 0.0;
      for (const double one : noticed) {
        most = std::max(most, std::fabs(one));
      }
      return most;
    }
    bool is_there() const { return worst() <= near_enough; }
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

  // The error stays in `error`.
  std::optional<Trial> trial(const Place& place) {
    ++trials;
    progress_.spend(std::size_t{1} << 17);  // looked at every time
    const auto found = figures_(values_at(place));
    if (!found) {
      error = found.error();
      return std::nullopt;
    }
    Trial trial{place, *found, {}};
    for (const TimbreTarget& target : targets_) {
      const auto value = (*found)[static_cast<std::size_t>(target.figure)];
      const double noticed = value ? noticed_between(target.figure, *value, target.value)
                                   : std::numeric_limits<double>::quiet_NaN();
      if (!std::isfinite(noticed)) {
        error = Error{"it has no " + std::string(row_of(target.figure).name) + " there"};
        return std::nullopt;
      }
      trial.noticed.push_back(noticed);
    }
    return trial;
  }

  // [target, free] by differences, into the range.
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
          for (std::size_t t = 0; t < targets_.size(); ++t) {
            slopes(t, i) = (there->noticed[t] - at.noticed[t]) / moved;
          }
          break;
        }
      }
    }
    return slopes;
  }

  struct Descent {
    Vector gradient;            // [free] of half the cost
    std::vector<bool> is_held;  // at a bound, and would go beyond
    Matrix slopes;
  };
  Descent descent(const Trial& at) {
    Descent down{Vector(free_.size()), std::vector<bool>(free_.size()), slopes(at)};
    for (std::size_t i = 0; i < free_.size(); ++i) {
      for (std::size_t t = 0; t < targets_.size(); ++t) {
        down.gradient[i] += down.slopes(t, i) * at.noticed[t];
      }
      down.is_held[i] = (at.place[i] <= 0.0 && down.gradient[i] > 0.0) ||
                        (at.place[i] >= 1.0 && down.gradient[i] < 0.0);
    }
    return down;
  }

  // Downhill from there, until it is there, flat, or stuck.
  Trial descend(Trial at) {
    double damping = 1e-3;
    int crawls = 0;
    for (int step = 0; step < most_steps && !at.is_there(); ++step) {
      const Descent down = descent(at);
      bool has_moved = false;
      double moved = 0.0;
      for (int tries = 0; tries < most_tries && !has_moved; ++tries) {
        const auto to = stepped(at, down, damping);
        const auto there = to ? trial(*to) : std::nullopt;
        if (there && there->cost() < at.cost()) {
          for (std::size_t i = 0; i < free_.size(); ++i) {
            moved = std::max(moved, std::fabs(there->place[i] - at.place[i]));
          }
          has_moved = true;
          crawls = there->cost() > crawling * at.cost() ? crawls + 1 : 0;
          at = *there;
          damping = std::max(1e-9, 0.2 * damping);
        } else {
          damping *= 5.0;
        }
      }
      if (!has_moved || moved < still || crawls == most_crawls) {
        break;
      }
    }
    return at;
  }

  Error error;
  std::size_t trials = 0;

 private:
  // (J^T J + damping (D + tiny)) step = -gradient, of those that no bound holds.
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
        for (std::size_t t = 0; t < targets_.size(); ++t) {
          normal(a, b) += down.slopes(t, moving[a]) * down.slopes(t, moving[b]);
        }
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

  const FiguresAt& figures_;
  std::vector<double> values_;
  std::span<const FreeParameter> free_;
  std::span<const TimbreTarget> targets_;
  const Progress& progress_;
};

// 0 to 1, alike on every machine.
double next_share(std::mt19937_64& random) {
  return 0x1p-53 * static_cast<double>(random() >> 11U);
}

std::optional<Error> wrong_target(const TimbreTarget& target) {
  const std::string_view wrong = wrong_with(target.figure, target.value);
  return wrong.empty() ? std::nullopt
                       : std::optional(Error{std::string(row_of(target.figure).name) + " " +
                                             std::string(wrong)});
}

Result<AskedTimbre> ask(const FiguresAt& figures, std::span<const double> values,
                        std::span<const FreeParameter> free, std::span<const TimbreTarget> targets,
                        const AskOptions& options) {
  options.progress.stage("looking for the timbre");
  const FiguresAt& judge = options.exactly ? *options.exactly : figures;
  Asker asker(figures, values, free, targets, options.progress);
  Asker judging(judge, values, free, targets, options.progress);
  AskedTimbre asked;
  std::optional<Asker::Trial> best;
  std::optional<Error> first_error;
  std::mt19937_64 random(options.seed);
  for (int start = 0; start < options.starts && !(best && best->is_there()); ++start) {
    if (options.tell) {
      options.tell(static_cast<double>(start) / options.starts);
    }
    ++asked.starts;
    Place place = asker.place_of_values();
    for (std::size_t i = 0; start > 0 && i < free.size(); ++i) {
      place[i] = next_share(random);
    }
    auto end = asker.trial(place);
    if (end) {
      end = asker.descend(*end);
      end = options.exactly ? judging.trial(end->place) : end;
    }
    if (end && options.exactly) {
      end = judging.descend(*end);
    }
    if (end && (!best || end->cost() < best->cost())) {
      best = end;
    } else if (!end && !first_error) {
      first_error = asker.error.message.empty() ? judging.error : asker.error;
    }
    // So near, what stops it may be a peak that moved to the next bin: over that from around it.
    for (int hop = 0; options.exactly && best && hop < most_hops; ++hop) {
      if (best->is_there() || best->worst() > hopeful) {
        break;
      }
      const double reach = farthest_hop * std::exp2(-hop);
      place = best->place;
      for (double& one : place) {
        one = std::clamp(one + reach * (2.0 * next_share(random) - 1.0), 0.0, 1.0);
      }
      auto hopped = judging.trial(place);
      hopped = hopped ? judging.descend(*hopped) : hopped;
      best = hopped && hopped->cost() < best->cost() ? hopped : best;
    }
  }
  if (!best) {
    return *first_error;
  }
  // It may be silent where it is.
  if (const auto before = judge(values)) {
    asked.before = *before;
  }
  asked.values = judging.values_at(best->place);
  asked.reached = best->figures;
  asked.noticed = best->noticed;
  asked.is_reached = best->is_there();
  if (!asked.is_reached) {
    const auto down = judging.descent(*best);
    asked.has_influence = largest(down.slopes.values) > no_slope;
    for (std::size_t i = 0; i < free.size(); ++i) {
      if (down.is_held[i]) {
        asked.held.push_back({free[i].index, best->place[i] >= 1.0});
      }
    }
  }
  asked.trials = asker.trials + judging.trials;
  return asked;
}

}  // namespace

Result<AskedTimbre> ask_timbre(const FiguresAt& figures, std::span<const double> values,
                               std::span<const FreeParameter> free,
                               std::span<const TimbreTarget> targets, const AskOptions& options) {
  if (free.empty()) {
    return Error{"no parameter may be turned"};
  }
  if (targets.empty()) {
    return Error{"nothing is asked for"};
  }
  for (const TimbreTarget& target : targets) {
    if (auto wrong = wrong_target(target)) {
      return *wrong;
    }
  }
  try {
    return ask(figures, values, free, targets, options);
  } catch (const Stopped&) {
    return Error{stopped};
  }
}

}  // namespace ressort
