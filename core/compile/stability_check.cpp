#include "core/compile/stability_check.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "core/compile/schemes.h"
#include "core/laws/law.h"
#include "core/model/language/expression.h"
#include "core/model/preset/fit.h"

namespace ressort::compile {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::size_t most_quick_work = 10'000'000;  // parameters times links
constexpr double unbounded = 1e12;                   // stands for infinity in interval arithmetic
constexpr double keys_share = 0.98;  // fraction of the margin: modes at the limit hardly decay

double finite(double value) {
  return std::clamp(value, -unbounded, unbounded);
}

class StabilityChecker {
 public:
  explicit StabilityChecker(const StabilityRequest& request)
      : request_(request),
        start_(request.start.begin(), request.start.end()),
        stability_(std::in_place, felt(), request.rate_ratio, most_quick_masses, request.progress) {
    result_.proved = without_passive(starting(request.written), request.schemes);
    result_.parameters = request.parameters;
    result_.is_together = start_.size() * stability_->size() > most_quick_work;
  }

  StabilityCheck run() {
    result_.limits.resize(start_.size());
    box_ = {start_, start_};
    result_.verdict = prove_start();
    if (result_.verdict != Verdict::stable) {
      result_.complaint = complain();
      return std::move(result_);
    }
    if (request_.is_open) {
      return std::move(result_);
    }
    find_requested_box();
    // Ranges of the preset come first, then other parameters, then audio inputs.
    widen([&](std::size_t i) { return place_[i].has_value() && !is_audio(i); });
    widen([&](std::size_t i) { return !place_[i] && !is_audio(i); });
    widen_audio();
    for (std::size_t i = 0; i < start_.size(); ++i) {
      report_range(i);
    }
    return std::move(result_);
  }

 private:
  Network starting(Network network) const {
    for (std::size_t i = 0; i < start_.size(); ++i) {
      network.parameters[i].value = start_[i];
    }
    return network;
  }
  Network felt() const {
    return always_felt(without_passive(starting(request_.expanded), request_.schemes));
  }

  bool is_audio(std::size_t i) const { return request_.expanded.parameters[i].audio_input > 0; }

  Verdict prove_start() {
    const Verdict verdict = stability_->prove(box_);
    if (verdict != Verdict::unproved || request_.expanded.masses.size() <= most_quick_masses) {
      return verdict;
    }
    stability_.emplace(felt(), request_.rate_ratio, Stability::most_exact_masses,
                       request_.progress);
    return stability_->prove(box_);
  }

  // Names the culprit in the written network, where a macro is one element.
  Error complain() const {
    Error error = complaint(Stability(always_felt(result_.proved), request_.rate_ratio,
                                      Stability::most_exact_masses, request_.progress)
                                .certify(box_));
    if (request_.rate_ratio != 1.0) {
      error.message += ", at " + print_number(request_.rate_hz) + " Hz";
    }
    return error;
  }

  // Collects the values that parameters may get: from ranges, controls and later settings.
  void find_requested_box() {
    asked_ = {start_, start_};
    place_.resize(start_.size());
    for (std::size_t i = 0; i < start_.size(); ++i) {
      const ParameterInfo& info = request_.parameters[i];
      if (is_audio(i)) {
        reach_to(i, -unbounded);
        reach_to(i, unbounded);
      } else if (!request_.bare) {
        reach_to(i, info.minimum);
        reach_to(i, info.maximum);
      }
      for (const ParameterSetting& setting : request_.preset.parameters) {
        if (setting.name == info.name) {
          place_[i] = setting.location;
        }
      }
      for (const ControlSetting& control : request_.preset.controls) {
        if (control.gesture == Gesture::parameter && control.target == info.name) {
          reach_to(i, control.low);
          reach_to(i, control.high);
        }
      }
      for (const Setting& setting : request_.reach) {
        if (setting.parameter == info.name) {
          reach_to(i, setting.value);
        }
      }
    }
    wanted_ = asked_;
    // Passive links are not in the proof, but their stiffness and damping must not be negative.
    for (std::size_t k = 0; k < request_.schemes.size() && !request_.bare; ++k) {
      if (request_.schemes[k] != Scheme::plain) {
        keep_attractive(request_.expanded.links[k]);
      }
    }
  }

  void reach_to(std::size_t i, double value) {
    asked_.lowest[i] = std::min(asked_.lowest[i], finite(value));
    asked_.highest[i] = std::max(asked_.highest[i], finite(value));
  }

  // Extends the proved box in some parameters to the requested values or, if that is not stable, as
  // far as all of them may go together.
  template <class Wanted>
  void widen(Wanted&& wanted) {
    std::vector<std::size_t> which;
    ParameterBox wide = box_;
    for (std::size_t i = 0; i < start_.size(); ++i) {
      if (wanted(i)) {
        which.push_back(i);
        wide.lowest[i] = wanted_.lowest[i];
        wide.highest[i] = wanted_.highest[i];
      }
    }
    if (which.empty()) {
      return;
    }
    if (stability_->prove(wide) == Verdict::stable) {
      box_ = std::move(wide);
      return;
    }
    for (std::size_t i = 0; !result_.is_together && i < which.size(); ++i) {
      extend_alone(which[i], box_, wide);
    }
    if (!result_.is_together && stability_->prove(wide) == Verdict::stable) {
      box_ = std::move(wide);
      return;
    }
    // Finds the largest share for all by bisection; then each parameter takes the remaining room.
    const double share = stability_->share(box_, wide);
    ParameterBox shared = box_;
    for (const std::size_t i : which) {
      shared.lowest[i] = towards(start_[i], std::lerp(start_[i], wide.lowest[i], share));
      shared.highest[i] = towards(start_[i], std::lerp(start_[i], wide.highest[i], share));
    }
    if (stability_->prove(shared) != Verdict::stable) {
      return;
    }
    for (std::size_t k = 0; !result_.is_together && k < which.size(); ++k) {
      const std::size_t i = which[k];
      ParameterBox wider = shared;
      extend_alone(i, shared, wider);
      if (stability_->prove(wider) == Verdict::stable) {
        shared = std::move(wider);
      }
    }
    box_ = std::move(shared);
  }

  // Gives audio inputs the room that other parameters leave. If these leave none, their ranges
  // shrink by a tenth, provided that an audio range grows tenfold by that. Audio must not make a
  // stiffness, damping or mass negative that is not negative at the start.
  void widen_audio() {
    constexpr double knobs_share = 0.9;
    constexpr double least_growth = 10.0;
    ParameterBox back = box_;
    bool has_sound = false;
    for (std::size_t i = 0; i < start_.size(); ++i) {
      has_sound |= is_audio(i);
      if (box_.lowest[i] > wanted_.lowest[i]) {
        back.lowest[i] = towards(start_[i], std::lerp(start_[i], box_.lowest[i], knobs_share));
      }
      if (box_.highest[i] < wanted_.highest[i]) {
        back.highest[i] = towards(start_[i], std::lerp(start_[i], box_.highest[i], knobs_share));
      }
    }
    if (!has_sound) {
      return;
    }
    const auto is_sound = [&](std::size_t i) { return is_audio(i); };
    for (std::size_t i = 0; i < start_.size(); ++i) {
      if (is_audio(i) && !request_.bare) {
        each_strength([&](ArgumentId argument) { keep_positive(argument, i); });
      }
    }
    widen(is_sound);
    const ParameterBox beside = std::exchange(box_, std::move(back));
    widen(is_sound);
    const auto gains = [&](std::size_t i) {
      return is_audio(i) && box_.highest[i] - box_.lowest[i] >
                                least_growth * (beside.highest[i] - beside.lowest[i]);
    };
    bool is_better = false;
    for (std::size_t i = 0; i < start_.size(); ++i) {
      is_better |= gains(i);
    }
    if (!is_better) {
      box_ = beside;
    }
  }

  // Calls use(argument) for every mass, stiffness and damping.
  template <class Use>
  void each_strength(Use&& use) const {
    std::set<ArgumentId> all;
    for (const Mass& mass : request_.expanded.masses) {
      all.insert({mass.mass, mass.stiffness, mass.damping});
    }
    for (const Link& link : request_.expanded.links) {
      const LawFacts& law = facts_of(link.law);
      for (std::size_t i = 0; i < law.count; ++i) {
        if (law.is_strength(i)) {
          all.insert(link.arguments[i]);
        }
      }
    }
    all.erase(no_argument);
    std::for_each(all.begin(), all.end(), use);
  }

  // Limits an audio parameter to values that keep this argument from falling below 0.
  void keep_positive(ArgumentId argument, std::size_t i) {
    const Formula& formula = request_.expanded.arguments[argument];
    const auto uses = [&](const Step& step) { return step.op == Op::parameter && step.index == i; };
    if (std::ranges::none_of(formula, uses)) {
      return;
    }
    keep(i, [&](const ParameterBox& box) { return formula_range(formula, box).lowest >= 0.0; });
  }

  // Limits parameters to values that keep the stiffness and damping of a link from falling below 0.
  void keep_attractive(const Link& link) {
    const auto& formulas = request_.expanded.arguments;
    const auto pulls = [&](const ParameterBox& box) {
      LawNumbers least{};
      for (std::size_t k = 0; k < least.size(); ++k) {
        const ArgumentId id = link.arguments[k];
        least[k] = id == no_argument ? 0.0 : formula_range(formulas[id], box).lowest;
      }
      const Slopes slopes = gentlest(link.law, least);
      return slopes.pull >= 0.0 && slopes.damping >= 0.0;
    };
    for (const ArgumentId id : link.arguments) {
      for (const Step& step : id == no_argument ? Formula() : formulas[id]) {
        if (step.op == Op::parameter) {
          keep(step.index, pulls);
        }
      }
    }
  }

  // Limits a parameter to values for which `holds(box)`, by bisection from the start.
  template <class Holds>
  void keep(std::size_t i, Holds&& holds) {
    ParameterBox box = box_;
    const auto holds_to = [&](double value) {
      box.lowest[i] = std::min(start_[i], value);
      box.highest[i] = std::max(start_[i], value);
      return holds(box);
    };
    if (!holds_to(start_[i])) {
      return;
    }
    for (double* const wanted : {&wanted_.lowest[i], &wanted_.highest[i]}) {
      double inside = start_[i];
      double outside = *wanted;
      if (holds_to(outside)) {
        continue;
      }
      if (std::min(inside, outside) < 0.0 && std::max(inside, outside) > 0.0 && holds_to(0.0)) {
        inside = 0.0;
      }
      constexpr int halvings = 120;  // enough from 1e12 to the last digit of a small number
      for (int n = 0; n < halvings; ++n) {
        const double middle = std::midpoint(inside, outside);
        (holds_to(middle) ? inside : outside) = middle;
      }
      *wanted = towards(start_[i], inside);
    }
  }

  // Extends one parameter as far as is stable with the others in `from`.
  void extend_alone(std::size_t i, const ParameterBox& from, ParameterBox& box) {
    if (const auto safe = stability_->safe_range(from, i, start_[i])) {
      box.lowest[i] = std::max(wanted_.lowest[i], below(i, safe->lowest));
      box.highest[i] = std::min(wanted_.highest[i], above(i, safe->highest));
    } else {
      box.lowest[i] = box.highest[i] = start_[i];
    }
  }

  // Rounds a limit inwards; the start stays inside.
  double below(std::size_t i, double limit) const {
    return std::min(start_[i], finite(inside_limit(limit, false)));
  }
  double above(std::size_t i, double limit) const {
    return std::max(start_[i], finite(inside_limit(limit, true)));
  }
  static double towards(double start, double value) {
    return value == start  ? start
           : value > start ? std::max(start, inside_limit(value, true))
                           : std::min(start, inside_limit(value, false));
  }

  // Writes the range and the limits of one parameter, and an error if the preset's range is too
  // wide.
  void report_range(std::size_t i) {
    ParameterInfo& info = result_.parameters[i];
    if (is_audio(i) && box_.lowest[i] == box_.highest[i]) {
      return;  // An audio input without a range has no use here, and no range is proved.
    }
    if (const auto safe = request_.bare || result_.is_together
                              ? std::nullopt
                              : stability_->safe_range(box_, i, start_[i])) {
      info.safe = *safe;
    }
    if (is_audio(i)) {
      const auto or_none = [](double value) {
        return std::fabs(value) < unbounded ? value : std::copysign(infinity, value);
      };
      result_.limits[i] = {or_none(box_.lowest[i]), or_none(box_.highest[i])};
      info.minimum = result_.limits[i].lowest;
      info.maximum = result_.limits[i].highest;
      return;
    }
    info.is_raised = box_.lowest[i] > asked_.lowest[i];
    info.is_lowered = box_.highest[i] < asked_.highest[i];
    Limits& limit = result_.limits[i];
    // A side without a stability limit has no enforced limit either: the range is a preference.
    if (info.is_raised || (!request_.bare && std::isfinite(info.safe.lowest))) {
      limit.lowest = box_.lowest[i];
    }
    if (info.is_lowered || (!request_.bare && std::isfinite(info.safe.highest))) {
      limit.highest = box_.highest[i];
    }
    if (info.is_raised) {
      info.minimum = std::max(info.minimum, box_.lowest[i]);
    }
    if (info.is_lowered) {
      info.maximum = std::min(info.maximum, box_.highest[i]);
    }
    if (place_[i] && (info.is_raised || info.is_lowered)) {
      const std::string kept =
          info.is_raised && info.is_lowered ? "between " + print_number(info.minimum) + " and " +
                                                  print_number(info.maximum) + "; beyond them"
          : info.is_raised ? "above " + print_number(info.minimum) + "; below it"
                           : "below " + print_number(info.maximum) + "; above it";
      result_.narrowed.push_back(
          {"'" + info.name + "' is kept " + kept + " the model is not stable", place_[i]->line,
           place_[i]->column});
    }
  }

  const StabilityRequest& request_;
  std::vector<double> start_;
  std::optional<Stability> stability_;
  StabilityCheck result_;
  ParameterBox asked_;                                // requested values
  ParameterBox wanted_;                               // values that make no stiffness negative
  ParameterBox box_;                                  // proved values
  std::vector<std::optional<SourceLocation>> place_;  // [parameter] line of its range in the preset
};

class MarginFinder {
 public:
  MarginFinder(const Network& network, double rate_ratio, const Progress& progress)
      : is_quick_(network.masses.size() <= most_quick_masses),
        progress_(progress),
        stability_(network, rate_ratio, most_quick_masses, progress) {}

  struct Factors {
    double whole = 0.0;
    double keys = 0.0;
  };
  Factors at(const ParameterBox& box) {
    progress_.spend(4 * stability_.size());
    const double bound = stability_.bounded_stiffness_factor(box);
    const double whole = bound >= most_bounded || !is_quick_
                             ? bound
                             : std::min(most_bounded, stability_.stiffness_factor(box));
    return {whole,
            std::max(bound, keys_share * whole)};  // the edge bound is conservative by itself
  }

 private:
  const bool is_quick_;
  const Progress& progress_;
  Stability stability_;
};

}  // namespace

double inside_limit(double limit, bool is_upper) {
  constexpr double room = 1e-8;  // exceeds the tolerance of the proof
  if (limit == 0.0 || !std::isfinite(limit)) {
    return limit;
  }
  double value = limit;
  parse_number(print_limit(limit - std::copysign(room * limit, is_upper ? 1.0 : -1.0), is_upper),
               value);
  return value;
}

std::vector<ParameterInfo> requested_ranges(const Network& network, const Preset& preset,
                                            bool bare) {
  std::vector<ParameterInfo> infos;
  for (const Parameter& parameter : network.parameters) {
    const double reach = bare                     ? std::numeric_limits<double>::max()
                         : parameter.value == 0.0 ? 1.0
                                                  : 4.0 * std::fabs(parameter.value);
    const double least = bare || parameter.value < 0.0 ? -reach : 0.0;
    infos.push_back({.name = parameter.name,
                     .value = parameter.value,
                     .minimum = least,
                     .maximum = reach,
                     .audio_input = parameter.audio_input});
  }
  if (bare) {
    return infos;
  }
  for (const Mass& mass : network.masses) {
    if (mass.mass != no_argument && network.arguments[mass.mass].size() == 1 &&
        network.arguments[mass.mass][0].op == Op::parameter) {
      ParameterInfo& info = infos[network.arguments[mass.mass][0].index];
      info.minimum = 0.25 * info.value;  // a mass must not become 0
    }
  }
  for (const ParameterSetting& setting : preset.parameters) {
    ParameterInfo& info = infos[static_cast<std::size_t>(find_parameter(network, setting.name))];
    info.value = setting.value;
    info.minimum = setting.minimum;
    info.maximum = setting.maximum;
  }
  return infos;
}

std::vector<double> start_values(const std::vector<ParameterInfo>& parameters,
                                 const std::vector<Setting>& settings, bool bare) {
  std::vector<double> values;
  for (const ParameterInfo& info : parameters) {
    values.push_back(info.value);
    for (const Setting& setting : settings) {
      if (bare && setting.parameter == info.name) {
        values.back() = std::clamp(setting.value, info.minimum, info.maximum);
      }
    }
  }
  return values;
}

ParameterBox preset_box(const std::vector<ParameterInfo>& parameters, const Preset& preset) {
  ParameterBox box;
  for (const ParameterInfo& info : parameters) {
    const auto given = std::ranges::find(preset.parameters, info.name, &ParameterSetting::name);
    const bool is_given = given != preset.parameters.end();
    box.lowest.push_back(is_given ? given->minimum : info.value);
    box.highest.push_back(is_given ? given->maximum : info.value);
  }
  return box;
}

StabilityCheck check_stability(const StabilityRequest& request) {
  return StabilityChecker(request).run();
}

ParameterBox proved_box(const StabilityCheck& check, const Preset& preset) {
  ParameterBox box = preset_box(check.parameters, preset);
  for (std::size_t i = 0; i < check.parameters.size(); ++i) {
    box.lowest[i] = std::max(box.lowest[i], check.parameters[i].minimum);
    box.highest[i] = std::min(box.highest[i], check.parameters[i].maximum);
  }
  return box;
}

Margins find_margins(const Network& network, std::span<const Scheme> schemes,
                     const ParameterBox& box, std::span<const Limits> limits, double rate_ratio,
                     const Progress& progress) {
  Network inside = network;  // network with parameter values in the box
  for (std::size_t i = 0; i < inside.parameters.size(); ++i) {
    double& value = inside.parameters[i].value;
    value = std::clamp(value, box.lowest[i], box.highest[i]);
  }
  const Network felt = without_passive(inside, schemes);
  MarginFinder finder(felt, rate_ratio, progress);
  const auto [whole, keys] = finder.at(box);
  Margins margins{.whole = whole, .keys = keys, .home = {}, .away = {}};
  ParameterBox far = box;
  bool may_leave = false;
  for (std::size_t i = 0; i < limits.size(); ++i) {
    const auto [lowest, highest] = limits[i];
    far.lowest[i] = std::isfinite(lowest) ? std::min(lowest, box.lowest[i]) : box.lowest[i];
    far.highest[i] = std::isfinite(highest) ? std::max(highest, box.highest[i]) : box.highest[i];
    Limits home;
    home.lowest = far.lowest[i] < box.lowest[i] ? box.lowest[i] : home.lowest;
    home.highest = far.highest[i] > box.highest[i] ? box.highest[i] : home.highest;
    may_leave |= std::isfinite(home.lowest) || std::isfinite(home.highest);
    margins.home.push_back(home);
  }
  constexpr int steps = 8;
  for (int step = 1; may_leave && step <= steps; ++step) {
    const double way = static_cast<double>(step) / steps;
    ParameterBox between = box;
    for (std::size_t i = 0; i < box.lowest.size(); ++i) {
      between.lowest[i] = std::lerp(box.lowest[i], far.lowest[i], way);
      between.highest[i] = std::lerp(box.highest[i], far.highest[i], way);
    }
    margins.away.push_back(finder.at(between).keys);
  }
  return margins;
}

}  // namespace ressort::compile
