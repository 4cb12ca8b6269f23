#include "core/compile/plan.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/direct/fourth_form.h"
#include "core/kernels/domains/shards.h"

namespace ressort {
namespace {

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

class Chooser {
 public:
  Chooser(Program& program, const Workload& load, std::uint32_t most_modes, const Budget& budget,
          const Progress& progress)
      : program_(program),
        load_(load),
        progress_(progress),
        most_modes_(most_modes),
        budget_(budget),
        is_asked_(budget.is_physical() || budget.silence_db > -Budget::unlimited) {
    if (budget.is_physical()) {
      judge();
    }
  }

  Part choose() {
    if (is_asked_) {
      consider(Method::slow);
    }
    if (!published_.empty()) {
      consider_physical();
    }
    if (published_.empty() || candidates_.empty()) {
      consider_identical();
    }
    Part part = take("");
    part.may_gain = may_gain_;
    return part;
  }

  // In single precision with compensated positions there is one form for all.
  Part compensate() {
    add(Method::direct, Compensated{});
    return take("in the precision asked for");
  }

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
  };

  void consider_identical() {
    for (const Method method : methods_for(KernelRow::Use::published)) {
      if (row_of(method).least_ns == nullptr || may_pay(row_of(method))) {
        consider(method);
      }
    }
  }

  // What is nearer to the continuous network than the published scheme: modes, which are exact, or
  // the fourth order where that is near enough or there are no modes.
  void consider_physical() {
    bool has_modes = false;
    if (program_.moving <= most_modes_) {
      has_modes = consider(Method::modal);
    } else {
      may_gain_ = program_.moving <= patient_modes;
    }
    if (!has_modes || meets(fourth_error(steepness_of(program_)))) {
      consider(Method::fourth);
    }
  }

  bool meets(const SchemeError& error) const {
    return error.cents <= budget_.cents && error.t60_percent <= budget_.t60_percent;
  }

  // Where the published scheme is near enough, no other is needed.
  void judge() {
    const SchemeError error = published_error(steepness_of(program_));
    if (meets(error)) {
      budget_.cents = budget_.t60_percent = Budget::unlimited;
      return;
    }
    published_ = ", as published up to " + rounded(error.cents) + " cents and " +
                 rounded(error.t60_percent) + " % of a decay off the continuous network";
  }

  // Of modes most sleep most of the time, where they may.
  double worth_ns(Method method, double ns) const {
    return method == Method::modal && budget_.silence_db > -Budget::unlimited ? 0.5 * ns : ns;
  }

  // Whether a form that takes long to find is worth the search.
  bool may_pay(const KernelRow& row) {
    const bool pays = program_.moving <= patient_modes && program_.moving > 4 &&
                      worth_ns(row.method, row.least_ns(program_, load_)) < candidates_[best_].ns;
    may_gain_ = pays && program_.moving > most_modes_;
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

  void add(Method method, Form form) {
    program_.form = std::move(form);
    const double ns = predicted_ns(program_, load_);
    candidates_.push_back({method, std::move(program_.form), ns});
    if (worth_ns(method, ns) < worth_ns(candidates_[best_].method, candidates_[best_].ns)) {
      best_ = candidates_.size() - 1;
    }
  }

  Part take(const std::string& why) {
    const Candidate& best = candidates_[best_];
    program_.form = std::move(candidates_[best_].form);
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
    part.reason += published_;
    part.reason += !why.empty() ? ", " + why : others.empty() ? "" : ", " + others;
    return part;
  }

  Program& program_;
  const Workload& load_;
  const Progress& progress_;
  std::uint32_t most_modes_;
  Budget budget_;  // without what the published scheme meets
  bool is_asked_;
  std::string published_;  // how far off it would be, where that is too far
  bool may_gain_ = false;
  std::vector<Candidate> candidates_;
  std::size_t best_ = 0;
};

}  // namespace

Planned make_plan(Machine machine, const Workload& load, std::optional<Method> method,
                  std::uint32_t most_modes, const Budget& budget, const Progress& progress) {
  std::vector<Part> parts;
  for (Program& program : machine.parts) {
    Chooser chooser(program, load, most_modes, budget, progress);
    Part part = load.is_compensated ? chooser.compensate()
                : method            ? chooser.obey(*method)
                                    : chooser.choose();
    if (auto shards = share_out(program, load, progress)) {
      program.form = *std::move(shards);
      part.predicted_ns = predicted_ns(program, load);
      part.reason += ", " + description(program);
    }
    if (part.masses > 0) {
      parts.push_back(std::move(part));
    }
  }
  return {std::move(machine), std::move(parts)};
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

}  // namespace ressort
