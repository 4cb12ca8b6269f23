#include "core/compile/stability_check.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "core/model/language/expression.h"

namespace ressort {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::size_t most_quick_work = 10'000'000;  // parameters times links
constexpr double anywhere = 1e12;  // what counts as no limit where one has to reckon with it

double finite(double value) {
  return std::clamp(value, -anywhere, anywhere);
}

class StabilityChecker {
 public:
  StabilityChecker(const StabilityRequest& request, std::vector<ParameterInfo>& parameters)
      : request_(request),
        parameters_(parameters),
        stability_(always_felt(request.expanded), request.rate_ratio, most_quick_masses,
                   request.progress) {
    result_.is_together = parameters.size() * stability_.size() > most_quick_work;
  }

  StabilityCheck run() {
    result_.limits.assign(parameters_.size(), {-infinity, infinity});
    find_start();
    box_ = {start_, start_};
    result_.verdict = prove_start();
    if (result_.verdict != Verdict::stable) {
      result_.complaint = complain();
      return std::move(result_);
    }
    if (request_.is_open) {
      return std::move(result_);
    }
    ask();
    widen([&](std::size_t i) { return place_[i].has_value() && !is_audio(i); });
    widen([&](std::size_t i) { return is_audio(i); });
    widen([&](std::size_t i) { return !place_[i] && !is_audio(i); });
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
      settle(i);
    }
    return std::move(result_);
  }

 private:
  bool is_audio(std::size_t i) const { return request_.expanded.parameters[i].audio_input > 0; }

  void find_start() {
    for (const ParameterInfo& info : parameters_) {
      start_.push_back(info.value);
      for (const Setting& setting : request_.settings) {
        if (request_.bare && setting.parameter == info.name) {
          start_.back() = std::clamp(setting.value, info.minimum, info.maximum);
        }
      }
    }
  }

  Verdict prove_start() {
    const Verdict verdict = stability_.prove(box_);
    if (verdict != Verdict::unproved || request_.expanded.masses.size() <= most_quick_masses) {
      return verdict;
    }
    stability_ = Stability(always_felt(request_.expanded), request_.rate_ratio,
                           Stability::most_exact_masses, request_.progress);
    return stability_.prove(box_);
  }

  // By the network as it is written, where a macro is one element.
  Error complain() const {
    Error error = complaint(Stability(always_felt(request_.written), request_.rate_ratio,
                                      Stability::most_exact_masses, request_.progress)
                                .certify(box_));
    if (request_.rate_ratio != 1.0) {
      error.message += ", at " + print_number(request_.rate_hz) + " Hz";
    }
    return error;
  }

  // Where the parameters are to be turned to, and which of that the preset says.
  void ask() {
    asked_ = {start_, start_};
    place_.resize(parameters_.size());
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
      const ParameterInfo& info = parameters_[i];
      if (is_audio(i)) {
        reach_to(i, -anywhere);
        reach_to(i, anywhere);
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
  }

  void reach_to(std::size_t i, double value) {
    asked_.lowest[i] = std::min(asked_.lowest[i], finite(value));
    asked_.highest[i] = std::max(asked_.highest[i], finite(value));
  }

  // Takes some parameters as far as was asked for, or as far as they may go together.
  template <class Wanted>
  void widen(Wanted&& wanted) {
    std::vector<std::size_t> which;
    ParameterBox wide = box_;
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
      if (wanted(i)) {
        which.push_back(i);
        wide.lowest[i] = asked_.lowest[i];
        wide.highest[i] = asked_.highest[i];
      }
    }
    if (which.empty()) {
      return;
    }
    if (stability_.prove(wide) == Verdict::stable) {
      box_ = std::move(wide);
      return;
    }
    for (std::size_t i = 0; !result_.is_together && i < which.size(); ++i) {
      stretch(which[i], box_, wide);
    }
    if (!result_.is_together && stability_.prove(wide) == Verdict::stable) {
      box_ = std::move(wide);
      return;
    }
    // All by the same share, and then each as far as that leaves room.
    const double share = stability_.share(box_, wide);
    ParameterBox shared = box_;
    for (const std::size_t i : which) {
      shared.lowest[i] = towards(start_[i], std::lerp(start_[i], wide.lowest[i], share));
      shared.highest[i] = towards(start_[i], std::lerp(start_[i], wide.highest[i], share));
    }
    if (stability_.prove(shared) != Verdict::stable) {
      return;
    }
    for (std::size_t k = 0; !result_.is_together && k < which.size(); ++k) {
      const std::size_t i = which[k];
      ParameterBox wider = shared;
      stretch(i, shared, wider);
      if (stability_.prove(wider) == Verdict::stable) {
        shared = std::move(wider);
      }
    }
    box_ = std::move(shared);
  }

  // One parameter as far as it may go alone, with the others in `from`.
  void stretch(std::size_t i, const ParameterBox& from, ParameterBox& box) {
    if (const auto safe = stability_.safe_range(from, i, start_[i])) {
      box.lowest[i] = std::max(asked_.lowest[i], below(i, safe->lowest));
      box.highest[i] = std::min(asked_.highest[i], above(i, safe->highest));
    } else {
      box.lowest[i] = box.highest[i] = start_[i];
    }
  }

  // A limit from within; the start is always inside.
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

  // Writes back what one parameter came to.
  void settle(std::size_t i) {
    ParameterInfo& info = parameters_[i];
    if (is_audio(i) && box_.lowest[i] == box_.highest[i]) {
      return;  // nothing is proved of it; sound that cannot move would be of no use
    }
    // Nobody reads it of the bare network.
    if (const auto safe = request_.bare || result_.is_together
                              ? std::nullopt
                              : stability_.safe_range(box_, i, start_[i])) {
      info.safe = *safe;
    }
    info.is_raised = box_.lowest[i] > asked_.lowest[i];
    info.is_lowered = box_.highest[i] < asked_.highest[i];
    Range& limit = result_.limits[i];
    // Where nothing limits, the range is a matter of taste.
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
  std::vector<ParameterInfo>& parameters_;
  Stability stability_;
  StabilityCheck result_;
  std::vector<double> start_;
  ParameterBox asked_;
  ParameterBox box_;                                  // proved
  std::vector<std::optional<SourceLocation>> place_;  // in the preset, of what it has ranges for
};

// Looks at the arguments of one element after the other, for no_number().
class NumberCheck {
 public:
  NumberCheck(const Network& network, std::span<const double> parameters, double rate_ratio)
      : network_(network), parameters_(parameters) {
    const double grown = std::max(1.0, rate_ratio * rate_ratio);
    for (const Formula& formula : network.arguments) {
      const double value = evaluate(formula, parameters);
      const bool is_live = std::any_of(formula.begin(), formula.end(), [&](const Step& step) {
        return step.op == Op::parameter && network.parameters[step.index].audio_input > 0;
      });
      is_wrong_.push_back(!is_live && !std::isfinite(grown * value));
      is_nothing_.push_back(!is_live && !std::isfinite(1.0 / value));
    }
  }

  std::optional<Error> run() {
    for (const Mass& mass : network_.masses) {
      look(mass, {{"mass", mass.mass},
                  {"stiffness", mass.stiffness},
                  {"damping", mass.damping},
                  {"gravity", mass.gravity}});
      if (mass.kind == MassKind::point) {
        const Tap& tap = network_.taps[mass.tap];
        look(mass, {{"place", tap.u}, {"place", tap.v}});
      }
    }
    for (const Macro& macro : network_.macros) {
      look(macro, {{"mass", macro.mass},
                   {"stiffness", macro.stiffness},
                   {"stiffness", macro.second_stiffness},
                   {"damping", macro.damping},
                   {"damping", macro.air_damping}});
    }
    for (const Link& link : network_.links) {
      for (const ArgumentId argument : link.arguments) {
        look(link, {{"argument", argument}});
      }
    }
    return std::move(error_);
  }

 private:
  struct Asked {
    std::string_view quantity;
    ArgumentId argument;
  };

  template <class Element>
  void look(const Element& element, std::initializer_list<Asked> all) {
    for (const Asked& asked : all) {
      if (error_ || asked.argument == no_argument) {
        continue;
      }
      const bool is_wrong = is_wrong_[asked.argument];
      if (is_wrong || (asked.quantity == "mass" && is_nothing_[asked.argument])) {
        error_ = {told(asked, std::string(element.name),
                       is_wrong ? " is no finite number" : " is not above 0"),
                  element.location.line, element.location.column};
      }
    }
  }

  // "the argument 1/P of 'r' is no finite number where P = 0"
  std::string told(const Asked& asked, const std::string& name, std::string_view what) const {
    const Formula& formula = network_.arguments[asked.argument];
    std::vector<std::string> names;
    for (const Parameter& parameter : network_.parameters) {
      names.push_back(parameter.name);
    }
    std::string values;
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (std::any_of(formula.begin(), formula.end(), [&](const Step& step) {
            return step.op == Op::parameter && step.index == i;
          })) {
        values += (values.empty() ? " where " : " and ") + names[i] + " = " +
                  print_number(parameters_[i]);
      }
    }
    return "the " + std::string(asked.quantity) + " " + print_expression(formula, names) +
           (name.empty() ? "" : " of '" + name + "'") + std::string(what) + values;
  }

  const Network& network_;
  std::span<const double> parameters_;
  std::vector<bool> is_wrong_;    // [argument]
  std::vector<bool> is_nothing_;  // [argument] if it is a mass
  std::optional<Error> error_;
};

}  // namespace

std::optional<Error> no_number(const Network& network, std::span<const double> parameters,
                               double rate_ratio) {
  return NumberCheck(network, parameters, rate_ratio).run();
}

double inside_limit(double limit, bool is_upper) {
  constexpr double room = 1e-8;  // more than the proof leaves for rounding
  if (limit == 0.0 || !std::isfinite(limit)) {
    return limit;
  }
  double value = limit;
  parse_number(print_limit(limit - std::copysign(room * limit, is_upper ? 1.0 : -1.0), is_upper),
               value);
  return value;
}

StabilityCheck check_stability(const StabilityRequest& request,
                               std::vector<ParameterInfo>& parameters) {
  return StabilityChecker(request, parameters).run();
}

}  // namespace ressort
