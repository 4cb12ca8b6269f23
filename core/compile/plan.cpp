#include "core/compile/plan.h"

#include <algorithm>
#include <cmath>

#include "core/compile/accuracy/springs.h"
#include "core/kernels/domains/shards.h"
#include "core/kernels/modal/modal_body.h"
#include "core/kernels/oversampled/oversampled_form.h"

namespace ressort::compile {
namespace {

constexpr std::uint32_t most_steps_to_reach = 8;

std::string in_ns(double ns) {
  char text[32];
  std::snprintf(text, sizeof text, ns < 9.95 ? "%.1f ns" : "%.0f ns", ns);
  return text;
}

std::string rounded(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

std::string describe(const Accuracy& accuracy) {
  if (!accuracy.is_known) {
    return "nobody knows how far off the continuous network";
  }
  if (!std::isfinite(accuracy.cents)) {
    return "without a partial of the continuous network";
  }
  return std::string(accuracy.is_bound ? "at most " : "") + rounded(accuracy.cents) +
         " cents and " + rounded(accuracy.t60_percent) + " % of a decay off the continuous network";
}

class Chooser {
 public:
  Chooser(Program& program, const Workload& load, std::uint32_t most_modes, const Budget& budget,
          const Progress& progress)
      : program_(program),
        load_(load),
        progress_(progress),
        most_modes_(most_modes),
        eigenvectors_of_(most_tied_masses(program)),
        budget_(budget),
        is_asked_(budget.is_physical() || budget.silence_db > -Budget::unlimited) {}

  // Keeps what is left of a budget of pitch and decay.
  Part choose(Judge& judge, const Accuracy& spent) {
    spent_ = spent;
    judge_ = &judge;
    const Accuracy published = sum_of(judge.of(Form()), spent_);
    if (published.meets(budget_)) {
      budget_.cents = budget_.t60_percent = Budget::unlimited;
      judge_ = nullptr;
    } else {
      published_ = ", as published " + describe(published);
    }
    Part part = choose();
    part.accuracy = judge_ == nullptr ? published : accuracy_;
    return part;
  }

  Part choose() {
    if (judge_ != nullptr) {
      consider_physical();
    } else {
      consider_identical();
    }
    Part part = take("");
    part.may_gain = may_gain_;
    return part;
  }

  // Exact modes, which bear any stiffness, or so many steps a sample that they bear what keys ask
  // for; nothing where neither is to be had.
  std::optional<Part> reach(Judge* judge, const Accuracy& spent) {
    spent_ = spent;
    judge_ = judge;
    // Of a spring that bends the straight part is no mode, and bears no more than as published.
    if (eigenvectors_of_ <= most_modes_ && !contains_bent_springs(program_)) {
      consider(Method::modal);
    }
    may_gain_ = eigenvectors_of_ > most_modes_ && eigenvectors_of_ <= patient_modes;
    const std::uint32_t times = steps_to_reach();
    if (program_.modes.empty() && times <= most_steps_to_reach && !may_gain_) {
      Program fine = oversampled_program(program_, times);
      const Workload load = load_at_steps();
      Chooser chooser(fine, load, 0, {}, progress_);
      chooser.choose();
      progress_.spend(program_.ends.size() + program_.position.size());
      add(Method::oversampled, oversampled_form(std::move(fine), times));
    }
    // How many voices of it a machine can play is found as it plays; one it must.
    if (candidates_.empty() || candidates_[best_].ns > 0.5e9 / program_.rate_hz * load_.voices) {
      return std::nullopt;
    }
    return take("for its highest keys");
  }
  bool may_gain() const { return may_gain_; }

  Part obey(Method method) {
    consider(Method::direct);
    if (method == Method::direct || consider(method)) {
      best_ = candidates_.size() - 1;
      return take("as asked for");
    }
    return take(std::string(method_name(method)) + " cannot do this part");
  }

 private:
  struct Candidate {
    Method method;
    Form form;
    double ns;
    Accuracy accuracy;
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
    for (const Method method : methods_for(KernelRow::Use::published)) {
      if (row_of(method).least_ns == nullptr || may_pay(row_of(method))) {
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
      return;  // more steps bring a body's modes nowhere nearer
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
    if (!judge_->of(oversampled_form(fine, times)).is_known) {
      return false;
    }
    Chooser chooser(fine, load_, 0, {}, progress_);
    chooser.choose();
    progress_.spend(program_.ends.size() + program_.position.size());
    add(Method::oversampled, oversampled_form(std::move(fine), times));
    return candidates_.back().accuracy.meets(budget_);
  }

  // Of modes most sleep most of the time, where they may.
  double worth_ns(Method method, double ns) const {
    return method == Method::modal && budget_.silence_db > -Budget::unlimited ? 0.5 * ns : ns;
  }

  // Whether a form that takes long to find is worth the search.
  bool may_pay(const KernelRow& row) {
    const bool pays = eigenvectors_of_ <= patient_modes && program_.moving > 4 &&
                      worth_ns(row.method, row.least_ns(program_, load_)) < candidates_[best_].ns;
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

  // Of those that keep the budget the cheapest, else the nearest to it; what nobody knows comes
  // last, and of that what is as published.
  bool is_better(const Candidate& a, const Candidate& b) const {
    const auto cost = [&](const Candidate& c) { return worth_ns(c.method, c.ns); };
    if (judge_ == nullptr) {
      return cost(a) < cost(b);
    }
    const auto excess = [&](const Candidate& c) {
      return !c.accuracy.is_known ? Budget::unlimited
                                  : std::max({1.0, c.accuracy.cents / budget_.cents,
                                              c.accuracy.t60_percent / budget_.t60_percent});
    };
    const bool is_published = a.method == Method::direct;
    if (!a.accuracy.is_known && !b.accuracy.is_known &&
        is_published != (b.method == Method::direct)) {
      return !is_published;
    }
    return excess(a) != excess(b) ? excess(a) < excess(b) : cost(a) < cost(b);
  }

  void add(Method method, Form form) {
    const Accuracy accuracy = judge_ == nullptr ? Accuracy{} : sum_of(judge_->of(form), spent_);
    program_.form = std::move(form);
    const double ns = predicted_ns(program_, load_);
    candidates_.push_back({method, std::move(program_.form), ns, accuracy});
    if (is_better(candidates_.back(), candidates_[best_])) {
      best_ = candidates_.size() - 1;
    }
  }

  Part take(const std::string& why) {
    const Candidate& best = candidates_[best_];
    program_.form = std::move(candidates_[best_].form);
    accuracy_ = best.accuracy;
    Part part{.method = best.method,
              .masses = program_.moving,
              .links = program_.ends.size(),
              .predicted_ns = best.ns,
              .reason = description(program_)};
    std::string others;
    for (const Candidate& candidate : candidates_) {
      if (candidate.method != best.method) {
        others += (others.empty() ? "" : ", ") + std::string(method_name(candidate.method)) +
                  " would take " + in_ns(candidate.ns);
      }
    }
    part.reason += "; at most about " + in_ns(best.ns) + " a sample";
    part.reason += judge_ != nullptr ? ", " + describe(accuracy_) : "";
    part.reason += published_;
    part.reason += !why.empty() ? ", " + why : others.empty() ? "" : ", " + others;
    return part;
  }

  Program& program_;
  const Workload& load_;
  const Progress& progress_;
  std::uint32_t most_modes_;
  std::uint32_t eigenvectors_of_;  // masses that hang together
  Budget budget_;                  // without what the published scheme meets
  bool is_asked_;
  Judge* judge_ = nullptr;  // null: whatever is as published is near enough
  Accuracy spent_;
  Accuracy accuracy_;      // of what was taken
  std::string published_;  // how far off it would be, where that is too far
  bool may_gain_ = false;
  std::vector<Candidate> candidates_;
  std::size_t best_ = 0;
};

// All parts in forms that bear what keys ask for; nothing where one has none.
std::optional<Planned> reach(const Machine& machine, const Workload& load, std::uint32_t most_modes,
                             const Budget& budget, const Progress& progress, const Promise& promise,
                             bool& may_gain) {
  Planned planned{machine, {}, Budget::unlimited};
  for (Program& program : planned.machine.parts) {
    if (program.moving == 0) {
      continue;
    }
    Chooser chooser(program, load, most_modes, budget, progress);
    std::optional<Judge> judge;
    if (budget.is_physical()) {
      judge.emplace(program,
                    corners_of(program, machine.parameters, promise.lowest, promise.highest,
                               load.wanted_factor),
                    most_modes, progress);
    }
    std::optional<Part> part = chooser.reach(judge ? &*judge : nullptr, promise.merged);
    may_gain |= chooser.may_gain();
    if (!part) {
      return std::nullopt;
    }
    if (judge) {
      part->accuracy = sum_of(judge->of(program.form), promise.merged);
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
                  const Promise& promise) {
  std::vector<Part> parts;
  bool may_gain = false;
  if (load.reaches_beyond() && !method) {
    if (auto planned = reach(machine, load, most_modes, budget, progress, promise, may_gain)) {
      return *std::move(planned);
    }
  }
  Workload published = load;
  published.wanted_factor = load.highest_factor;
  for (Program& program : machine.parts) {
    Chooser chooser(program, published, most_modes, budget, progress);
    std::optional<Judge> judge;
    if (budget.is_physical() && program.moving > 0 && program.waveguides.empty()) {
      judge.emplace(program,
                    corners_of(program, machine.parameters, promise.lowest, promise.highest,
                               promise.highest_factor),
                    most_modes, progress);
    }
    Part part = method  ? chooser.obey(*method)
                : judge ? chooser.choose(*judge, promise.merged)
                        : chooser.choose();
    if (judge && !part.accuracy) {
      part.accuracy = sum_of(judge->of(program.form), promise.merged);
    }
    if (auto shards = share_out(program, load, progress)) {
      program.form = *std::move(shards);
      part.predicted_ns = predicted_ns(program, load);
      part.reason += ", " + description(program);
    }
    part.may_gain |= may_gain;
    if (part.masses > 0) {
      parts.push_back(std::move(part));
    }
  }
  return {std::move(machine), std::move(parts)};
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

std::optional<std::string> broken_promise(const Plan& plan) {
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
             : "whether the budget " + promised + " is kept is not known: the poles of so many " +
                   "masses would take too long to find";
}

std::string describe(const std::vector<Part>& parts) {
  std::string text;
  for (const Part& part : parts) {
    text += std::string(method_name(part.method)) + ": " + count_of(part.masses, "mass", "masses") +
            ", " + count_of(part.links, "link", "links") + " (" + part.reason +
            (part.measured_ns > 0.0 ? "; measured at rest: " + in_ns(part.measured_ns) : "") +
            ")\n";
  }
  return text.empty() ? "nothing moves\n" : text;
}

std::string describe(const Plan& plan) {
  std::string text = describe(plan.parts);
  for (const std::string& note : plan.notes) {
    text += note + "\n";
  }
  return text;
}

}  // namespace ressort::compile
