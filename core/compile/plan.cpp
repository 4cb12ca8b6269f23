#include "core/compile/plan.h"

#include <algorithm>
#include <cmath>

#include "core/compile/accuracy/springs.h"
#include "core/format.h"
#include "core/kernels/modal/modal_body.h"
#include "core/kernels/oversampled/oversampled_form.h"
#include "core/ranges.h"

namespace ressort::compile {
namespace {

constexpr std::uint32_t most_steps_to_reach = 8;
// ratio to the best estimate beyond which a form is not measured
constexpr double most_behind = 4.0;
// speed-up for which the form that ranks first is replaced
constexpr double least_gain = 1.0 / 0.9;

std::string in_ns(double ns) {
  return formatted(ns < 9.95 ? "%.1f ns" : "%.0f ns", ns);
}

std::string rounded(double value) {
  return formatted("%.3g", value);
}

// Returns whether all oscillators are modes of bodies, and all links passive. Every form samples
// such a mode exactly at any stiffness (core/sampled_mode.h).
bool has_free_modes(const Program& program) {
  const auto is_free = [&](const MassRun& run) {
    return !run.is_oscillator || program.coefficients[run.stiffness].mode != no_mode;
  };
  return !program.modes.empty() && std::ranges::all_of(program.mass_runs, is_free) &&
         std::ranges::all_of(program.link_runs, [](const LinkRun& run) {
           return run.scheme == Scheme::discrete_gradient && !is_linear(run.law);
         });
}

std::string describe(const Accuracy& accuracy) {
  if (!accuracy.is_known) {
    return "its error against the continuous network is unknown";
  }
  if (!std::isfinite(accuracy.cents)) {
    return "without a partial of the continuous network";
  }
  return std::string(accuracy.is_bound ? "at most " : "") + rounded(accuracy.cents) +
         " cents and " + rounded(accuracy.t60_percent) + " % of a decay off the continuous network";
}

class Chooser {
 public:
  // `recorded`: the name of the required form; empty: the choice is free.
  Chooser(Program& program, const Workload& load, std::uint32_t most_modes, const Budget& budget,
          const Progress& progress, const Timings* timings = nullptr, std::string recorded = {})
      : program_(program),
        load_(load),
        progress_(progress),
        timings_(timings),
        recorded_(std::move(recorded)),
        most_modes_(most_modes),
        eigenvectors_of_(most_tied_masses(program)),
        budget_(budget) {}

  // Chooses a form that keeps the budget of pitch and decay.
  Part choose(AccuracyMeter& meter) {
    meter_ = &meter;
    const Accuracy published = meter.of(Form());
    if (published.meets(budget_)) {
      budget_.cents = budget_.t60_percent = Budget::unlimited;
      meter_ = nullptr;
    } else {
      published_ = ", as published " + describe(published);
    }
    Part part = choose();
    part.accuracy = meter_ == nullptr ? published : accuracy_;
    return part;
  }

  Part choose() {
    if (meter_ != nullptr) {
      consider_physical();
    } else {
      consider_identical();
    }
    apply_measurements();
    Part part = take("");
    part.may_gain = may_gain_;
    return part;
  }

  // Chooses exact modes, which are stable at any stiffness, or enough steps a sample for the
  // stiffest key, or any form of free modes; nothing if the part has none of these.
  std::optional<Part> reach(AccuracyMeter* meter) {
    meter_ = meter;
    // Modes contain only the linear part of a nonlinear spring. The rest uses the published scheme,
    // so its stability limit applies.
    if (eigenvectors_of_ <= most_modes_ && !contains_bent_springs(program_)) {
      consider(Method::modal);
    }
    may_gain_ = eigenvectors_of_ > most_modes_ && eigenvectors_of_ <= patient_modes;
    const std::uint32_t times = steps_to_reach();
    if (program_.modes.empty() && times <= most_steps_to_reach && !may_gain_) {
      const bool is_by_key = times > 1 && (meter_ == nullptr || meter_->of(Form()).meets(budget_));
      add_steps(times, load_at_steps(), {}, is_by_key);
    }
    if (candidates_.empty() && has_free_modes(program_)) {
      consider_identical();
    }
    // One voice must be affordable. The number of affordable voices is found while playing.
    if (candidates_.empty() ||
        nominal_ns * candidates_[best_].operations > 0.5e9 / program_.rate_hz * load_.voices) {
      return std::nullopt;
    }
    apply_measurements();
    return take("chosen for the highest keys");
  }
  bool may_gain() const { return may_gain_; }

  Part obey(Method method) {
    consider(Method::direct);
    if (method == Method::direct || consider(method)) {
      best_ = candidates_.size() - 1;
      return take("as requested");
    }
    return take(std::string(method_name(method)) + " cannot do this part");
  }

 private:
  struct Candidate {
    Method method;
    Form form;
    std::string name;
    double operations;
    double share_of_one;  // of one voice, of the operations of all
    Accuracy accuracy;
    std::optional<double> measured_ns = {};
  };

  std::uint32_t steps_to_reach() const {
    std::uint32_t times = 1;
    while (load_.highest_factor * times * times < load_.wanted_factor &&
           times <= most_steps_to_reach) {
      times *= 2;
    }
    return times;
  }
  Workload load_at_steps() const {
    Workload load = load_;
    load.highest_factor = load.wanted_factor = 1.0;
    return load;
  }

  void consider_identical() {
    for (const Method method : published_methods()) {
      if (row_of(method).least_operations == nullptr || may_pay(row_of(method))) {
        consider(method);
      }
    }
  }

  // Considers exact modes, the published scheme, and more steps per sample until the budget is met.
  void consider_physical() {
    if (eigenvectors_of_ <= most_modes_) {
      consider(Method::modal);
    } else {
      may_gain_ = eigenvectors_of_ <= patient_modes;
    }
    consider(Method::direct);
    if (program_.moving == 0 || !program_.modes.empty()) {
      return;  // More steps do not improve a body's modes.
    }
    for (std::uint32_t times = 2; times <= most_oversampling; times *= 2) {
      if (consider_steps(times)) {
        return;
      }
    }
  }

  // Adds the cheapest published form at `times` steps per sample, if its accuracy is known. Returns
  // whether it meets the budget.
  bool consider_steps(std::uint32_t times) {
    Program fine = oversampled_program(program_, times);
    const Accuracy accuracy = meter_->of(oversampled_form(std::move(fine), times));
    if (!accuracy.is_known) {
      return false;
    }
    add_steps(times, load_, accuracy);
    return candidates_.back().accuracy.meets(budget_);
  }

  // Adds `times` steps a sample in every published form that may be the cheapest. All of them have
  // the same accuracy. `by_key`: for high keys only.
  void add_steps(std::uint32_t times, const Workload& load, std::optional<Accuracy> accuracy = {},
                 bool by_key = false) {
    Program fine = oversampled_program(program_, times);
    Chooser chooser(fine, load, 0, {}, progress_);
    chooser.consider_identical();
    progress_.spend(program_.ends.size() + program_.position.size());
    const std::vector<std::size_t> all =
        is_open() ? chooser.leading() : std::vector<std::size_t>{chooser.best_};
    for (const std::size_t i : all) {
      fine.form = chooser.candidates_[i].form;
      add(Method::oversampled, oversampled_form(fine, times, by_key), accuracy);
      accuracy = candidates_.back().accuracy;
    }
  }

  // Returns whether a form other than the first in rank may be chosen.
  bool is_open() const { return timings_ != nullptr || !recorded_.empty(); }

  // Modes below the budget of silence are not stepped; on average these are half of them.
  double weight_of(Method method) const {
    return method == Method::modal && budget_.silence_db > -Budget::unlimited ? 0.5 : 1.0;
  }

  // Returns whether a form that takes long to compute may be the cheapest.
  bool may_pay(const KernelRow& row) {
    const double behind = is_open() ? most_behind : 1.0;
    const bool pays = eigenvectors_of_ <= patient_modes && program_.moving > 4 &&
                      weight_of(row.method) * row.least_operations(program_, load_) <
                          behind * candidates_[best_].operations;
    may_gain_ = pays && eigenvectors_of_ > most_modes_;
    return pays && !may_gain_;
  }

  bool consider(Method method) {
    progress_.spend(program_.ends.size() + program_.position.size());
    auto form = row_of(method).fits({program_, load_, budget_, progress_});
    if (!form) {
      return false;
    }
    add(method, *std::move(form));
    return true;
  }

  // Returns the factor by which the budget is exceeded: 1 if it is kept, unlimited if the error is
  // not known.
  double excess(const Candidate& c) const {
    return meter_ == nullptr      ? 1.0
           : !c.accuracy.is_known ? Budget::unlimited
                                  : std::max({1.0, c.accuracy.cents / budget_.cents,
                                              c.accuracy.t60_percent / budget_.t60_percent});
  }
  // Most of the time few voices sound, so one voice counts half as much as all of them.
  double cost(const Candidate& c) const {
    constexpr double weight_of_one = 0.5;
    return weight_of(c.method) * (c.measured_ns ? *c.measured_ns : c.operations) *
           (1.0 + weight_of_one * c.share_of_one);
  }

  // Ranks by excess, then by cost. Among forms with unknown error, the published scheme is first.
  bool is_better(const Candidate& a, const Candidate& b) const {
    const bool is_published = a.method == Method::direct;
    if (meter_ != nullptr && !a.accuracy.is_known && !b.accuracy.is_known &&
        is_published != (b.method == Method::direct)) {
      return !is_published;
    }
    return excess(a) != excess(b) ? excess(a) < excess(b) : cost(a) < cost(b);
  }

  void add(Method method, Form form, std::optional<Accuracy> accuracy = {}) {
    if (meter_ != nullptr && !accuracy) {
      accuracy = meter_->of(form);
    }
    program_.form = std::move(form);
    const double count = operations(program_, load_);
    Workload one = load_;
    one.voices = 1;
    const double share = operations(program_, one) / count;
    std::string name = form_name(program_.form);
    candidates_.push_back({method, std::move(program_.form), std::move(name), count, share,
                           accuracy.value_or(Accuracy{})});
    if (is_better(candidates_.back(), candidates_[best_])) {
      best_ = candidates_.size() - 1;
    }
  }

  // Returns the candidates that may be the cheapest: those that keep the budget as well as the best
  // candidate and have estimates close to the best.
  std::vector<std::size_t> leading() const {
    std::vector<std::size_t> found;
    const Candidate& best = candidates_[best_];
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      const Candidate& one = candidates_[i];
      if (i == best_ ||
          (excess(one) == excess(best) && one.accuracy.is_known == best.accuracy.is_known &&
           cost(one) < most_behind * cost(best))) {
        found.push_back(i);
      }
    }
    return found;
  }

  // Replaces the first in rank by the form of an earlier plan, or by a form that is measured to be
  // clearly cheaper.
  void apply_measurements() {
    const auto recorded = std::ranges::find(candidates_, recorded_, &Candidate::name);
    if (recorded != candidates_.end()) {
      best_ = static_cast<std::size_t>(recorded - candidates_.begin());
      return;
    }
    if (timings_ == nullptr || !is_measurable(program_, load_)) {
      return;
    }
    const std::vector<std::size_t> all = leading();
    bool is_known = true;
    for (const std::size_t i : all) {
      progress_.spend(1);
      program_.form = std::move(candidates_[i].form);
      candidates_[i].measured_ns = known_ns(program_, load_, *timings_);
      candidates_[i].form = std::move(program_.form);
      is_known = is_known && candidates_[i].measured_ns;
    }
    is_untimed_ = all.size() > 1 && !is_known;
    if (!is_known) {
      for (const std::size_t i : all) {
        candidates_[i].measured_ns = i == best_ ? candidates_[i].measured_ns : std::nullopt;
      }
      return;
    }
    const double first = cost(candidates_[best_]);
    for (const std::size_t i : all) {
      if (cost(candidates_[i]) * least_gain < first &&
          cost(candidates_[i]) < cost(candidates_[best_])) {
        best_ = i;
      }
    }
  }

  // Describes how the other forms compare with the chosen one: in ns if they were measured
  // together, otherwise in operations.
  std::string comparison() const {
    const Candidate& best = candidates_[best_];
    std::string text;
    for (const Candidate& one : candidates_) {
      if (&one == &best) {
        continue;
      }
      const bool is_measured = best.measured_ns && one.measured_ns;
      text += (text.empty() ? "" : ", ") + one.name + " " +
              (is_measured ? in_ns(*one.measured_ns)
                           : rounded(one.operations / best.operations) + " times the operations");
    }
    return text;
  }

  Part take(const std::string& why) {
    std::string others = why.empty() ? comparison() : why;
    Candidate& best = candidates_[best_];
    program_.form = std::move(best.form);
    accuracy_ = best.accuracy;
    Part part{.method = best.method,
              .masses = program_.moving,
              .links = program_.ends.size(),
              .form = best.name,
              .estimated_ns = nominal_ns * best.operations,
              .measured_ns = best.measured_ns.value_or(0.0),
              .voices = load_.voices,
              .is_untimed = is_untimed_,
              .reason = description(program_)};
    part.reason += meter_ != nullptr ? ", " + describe(accuracy_) : "";
    part.reason += published_;
    part.reason += !others.empty() ? ", " + others : "";
    return part;
  }

  Program& program_;
  const Workload& load_;
  const Progress& progress_;
  const Timings* timings_;
  std::string recorded_;
  std::uint32_t most_modes_;
  std::uint32_t eigenvectors_of_;   // connected masses
  Budget budget_;                   // without the limits that the published scheme keeps
  AccuracyMeter* meter_ = nullptr;  // null: the published scheme is accurate enough
  Accuracy accuracy_;               // error of the chosen form
  std::string published_;           // the error of the published scheme, if it is too large
  bool may_gain_ = false;
  bool is_untimed_ = false;
  std::vector<Candidate> candidates_;
  std::size_t best_ = 0;
};

// Returns the form that an earlier plan had for the next part; empty if there was none.
std::string recorded_form(const Choice& choice, std::size_t part) {
  return part < choice.forms.size() ? choice.forms[part] : std::string();
}

// Plans all parts in forms that are stable for the stiffest key; nothing if one part has none.
std::optional<Planned> reach(const Machine& machine, const Workload& load, std::uint32_t most_modes,
                             const Budget& budget, const Progress& progress,
                             const BudgetRegion& region, const Choice& choice, bool& may_gain) {
  Planned planned{machine, {}, Budget::unlimited};
  for (Program& program : planned.machine.parts) {
    if (program.moving == 0) {
      continue;
    }
    Chooser chooser(program, load, most_modes, budget, progress, choice.timings,
                    recorded_form(choice, planned.parts.size()));
    std::optional<AccuracyMeter> meter;
    if (budget.is_physical()) {
      meter.emplace(program,
                    corners_of(program, machine.parameters, region.lowest, region.highest,
                               load.wanted_factor),
                    most_modes, progress);
    }
    std::optional<Part> part = chooser.reach(meter ? &*meter : nullptr);
    may_gain |= chooser.may_gain();
    if (!part) {
      return std::nullopt;
    }
    if (meter) {
      part->accuracy = meter->of(program.form);
    }
    if (const auto* steps = program.form.get_if<Oversampled>()) {
      planned.more = std::min(planned.more, static_cast<double>(steps->times * steps->times));
    }
    planned.parts.push_back(*std::move(part));
  }
  return planned;
}

}  // namespace

Planned make_plan(Machine machine, const Workload& load, std::optional<Method> method,
                  std::uint32_t most_modes, const Budget& budget, const Progress& progress,
                  const BudgetRegion& region, const Choice& choice) {
  std::vector<Part> parts;
  bool may_gain = false;
  if (load.reaches_beyond() && !method) {
    if (auto planned =
            reach(machine, load, most_modes, budget, progress, region, choice, may_gain)) {
      return *std::move(planned);
    }
  }
  Workload published = load;
  published.wanted_factor = load.highest_factor;
  for (Program& program : machine.parts) {
    Chooser chooser(program, published, most_modes, budget, progress, choice.timings,
                    recorded_form(choice, parts.size()));
    std::optional<AccuracyMeter> meter;
    if (budget.is_physical() && program.moving > 0 && program.waveguides.empty()) {
      meter.emplace(program,
                    corners_of(program, machine.parameters, region.lowest, region.highest,
                               region.highest_factor),
                    most_modes, progress);
    }
    Part part = method ? chooser.obey(*method) : meter ? chooser.choose(*meter) : chooser.choose();
    if (meter && !part.accuracy) {
      part.accuracy = meter->of(program.form);
    }
    part.may_gain |= may_gain;
    if (part.masses > 0) {
      parts.push_back(std::move(part));
    }
  }
  return {std::move(machine), std::move(parts)};
}

std::vector<std::string> forms_of(const Plan& plan) {
  return mapped(plan.parts, &Part::form);
}

std::optional<Accuracy> accuracy_of(const std::vector<Part>& parts) {
  std::optional<Accuracy> worst;
  for (const Part& part : parts) {
    if (part.accuracy) {
      worst = worst ? worse_of(*worst, *part.accuracy) : *part.accuracy;
    }
  }
  return worst;
}

std::optional<std::string> missed_budget(const Plan& plan) {
  if (!plan.accuracy || plan.accuracy->meets(plan.budget)) {
    return std::nullopt;
  }
  const Accuracy& accuracy = *plan.accuracy;
  std::string promised;
  std::string found;
  const auto add = [&](const char* word, double asked, double is, const char* unit) {
    if (asked < Budget::unlimited && !(accuracy.is_known && is <= asked)) {
      promised += (promised.empty() ? "" : " and ") + std::string(word) + rounded(asked);
      found += (found.empty() ? "" : " and ") + rounded(is) + unit;
    }
  };
  add("cents=", plan.budget.cents, accuracy.cents, " cents");
  add("t60=", plan.budget.t60_percent, accuracy.t60_percent, " % of a decay");
  if (accuracy.is_known && !std::isfinite(accuracy.cents)) {
    return "the budget " + promised +
           " is not kept: a partial of the continuous network is missing";
  }
  return accuracy.is_known
             ? "the budget " + promised + " is not kept: a partial may be " +
                   (accuracy.is_bound ? "up to " : "") + found + " off"
             : "it is unknown whether the budget " + promised + " is kept: the poles of so many " +
                   "masses would take too long to compute";
}

std::string describe(const std::vector<Part>& parts) {
  std::string text;
  for (const Part& part : parts) {
    text += (part.body.empty() ? "" : part.body + ": ") + std::string(method_name(part.method)) +
            ": " + count_of(part.masses, "mass", "masses") + ", " +
            count_of(part.links, "link", "links") + " (" + part.reason +
            (part.measured_ns > 0.0
                 ? "; measured " + in_ns(part.measured_ns) + " a sample for " +
                       count_of(static_cast<std::size_t>(part.voices), "voice", "voices") +
                       " on this machine"
                 : "") +
            ")\n";
  }
  return text.empty() ? "no mass moves\n" : text;
}

std::string describe(const Plan& plan) {
  std::string text = describe(plan.parts);
  if (plan.precision == Precision::float32) {
    text += "in single precision\n";
  }
  for (const std::string& note : plan.notes) {
    text += note + "\n";
  }
  return text;
}

}  // namespace ressort::compile
