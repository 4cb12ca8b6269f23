#include "core/compile/plan.h"

#include <algorithm>
#include <cmath>

#include "core/compile/shards.h"
#include "core/kernels/chains/chains_form.h"
#include "core/kernels/chorus/chorus_form.h"
#include "core/kernels/dense/dense_form.h"
#include "core/kernels/direct/fourth_form.h"
#include "core/kernels/grid/grid_form.h"
#include "core/kernels/modal/modal_form.h"
#include "core/kernels/slow/slow_form.h"

namespace ressort {
namespace {

template <class T>
std::optional<Form> any(std::optional<T> form) {
  return form ? std::optional<Form>(std::move(*form)) : std::nullopt;
}

std::optional<Form> form_of(const Program& program, Method method, const Workload& load,
                            const Budget& budget, const Progress& progress) {
  progress.spend(program.ends.size() + program.position.size());
  switch (method) {
    case Method::direct:
      return Direct{};
    case Method::chains:
      return any(chains_form(program, progress));
    case Method::dense:
      return any(dense_form(program));
    case Method::modal:
      return any(modal_form(program, budget, progress));
    case Method::grid:
      return any(grid_form(program, progress));
    case Method::chorus:
      return any(chorus_form(program));
    case Method::fourth:
      return any(fourth_form(program));
    case Method::slow:
      return any(slow_form(program, load.highest_factor));
  }
  return std::nullopt;
}

std::string count_of(std::size_t count, const char* one, const char* many) {
  return std::to_string(count) + " " + (count == 1 ? one : many);
}

std::string in_db(double share) {
  char text[32];
  std::snprintf(text, sizeof text, "%.0f dB", 20.0 * std::log10(std::max(share, 1e-15)));
  return text;
}

// What the form is, of this part.
struct Describer {
  const Program& program;

  std::string operator()(const Direct&) const {
    return "mass by mass and link by link, as published, a voice in each lane";
  }
  std::string operator()(const Chains& form) const {
    return count_of(form.chains.size(), "row of equal masses", "rows of equal masses") +
           " folded into vectors, " + count_of(form.loose.size(), "mass", "masses") + " and " +
           count_of(form.links.size(), "link", "links") + " one by one";
  }
  std::string operator()(const Dense& form) const {
    return form.ports.empty() ? "blocks of samples by one matrix"
                              : "blocks of samples by one matrix between contacts, " +
                                    count_of(form.ports.size(), "link", "links") + " one by one";
  }
  std::string operator()(const Modes& form) const {
    std::string text = count_of(form.modes, "mode", "modes");
    if (form.modes < form.of) {
      text = std::to_string(form.modes) + " of " + count_of(form.of, "mode", "modes") +
             ", the rest at most " + in_db(form.left_out) + ",";
    }
    text += " in place of the masses, ";
    if (form.is_exact) {
      text += "true to the continuous network, ";
    }
    text += count_of(form.places.size(), "place", "places") + " where links hold on";
    if (form.silence > 0.0) {
      text += ", asleep when all that sleep are below " + in_db(form.silence);
    }
    return text;
  }
  std::string operator()(const Chorus&) const {
    return std::string(program.moving <= most_held_masses ? "its masses in registers"
                                                          : "mass by mass and link by link") +
           ", a voice in each lane of many packs at once";
  }
  std::string operator()(const Fourth& form) const {
    std::size_t springs = 0;
    for (const FourthLinks& links : form.springs) {
      springs += links.count;
    }
    return "to fourth order, springs and dampers twice, " +
           count_of(program.ends.size() - springs, "link", "links") + " as published";
  }
  std::string operator()(const Compensated&) const {
    return "mass by mass and link by link, as published, each position in two numbers";
  }
  std::string operator()(const Slow& form) const {
    return "to fourth order once in " + std::to_string(form.frames) +
           " samples, a cubic between; what comes in acts up to " +
           std::to_string(2 * form.frames) + " samples later";
  }
  std::string operator()(const Shards& form) const {
    return "in " + std::to_string(form.shards->size()) + " shards at once, which meet every " +
           count_of(form.frames, "sample", "samples");
  }
  std::string operator()(const Grid& form) const {
    return std::string(form.segments.empty() ? "forces" : "rows that are alike") +
           " in vectors along the index, " + count_of(form.rest_ends.size(), "link", "links") +
           " one by one";
  }
};

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
    for (const Method method : all_methods) {
      if (method != Method::modal || may_be_modal()) {
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

  bool may_be_modal() {
    const bool may_pay =
        program_.moving <= patient_modes && program_.moving > 4 &&
        worth_ns(Method::modal, least_modal_ns(program_, load_)) < candidates_[best_].ns;
    may_gain_ = may_pay && program_.moving > most_modes_;
    return may_pay && !may_gain_;
  }

  bool consider(Method method) {
    auto form = form_of(program_, method, load_, budget_, progress_);
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
    Candidate& best = candidates_[best_];
    Part part{.method = best.method,
              .masses = program_.moving,
              .links = program_.ends.size(),
              .predicted_ns = best.ns,
              .reason = std::visit(Describer{program_}, best.form)};
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
    program_.form = std::move(best.form);
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

std::string_view method_name(Method method) {
  switch (method) {
    case Method::direct:
      return "direct";
    case Method::chains:
      return "chains";
    case Method::dense:
      return "dense";
    case Method::modal:
      return "modal";
    case Method::grid:
      return "grid";
    case Method::chorus:
      return "chorus";
    case Method::fourth:
      return "fourth";
    case Method::slow:
      return "slow";
  }
  return "";
}

Plan make_plan(Machine& machine, const Workload& load, std::optional<Method> method,
               std::uint32_t most_modes, const Budget& budget, const Progress& progress) {
  Plan plan;
  for (Program& program : machine.parts) {
    Chooser chooser(program, load, most_modes, budget, progress);
    Part part = load.is_compensated ? chooser.compensate()
                : method            ? chooser.obey(*method)
                                    : chooser.choose();
    if (auto shards = share_out(program, load, progress)) {
      program.form = *std::move(shards);
      part.predicted_ns = predicted_ns(program, load);
      part.reason += ", " + Describer{program}(std::get<Shards>(program.form));
    }
    if (part.masses > 0) {
      plan.parts.push_back(std::move(part));
    }
  }
  return plan;
}

std::string describe(const Plan& plan) {
  std::string text;
  for (const Part& part : plan.parts) {
    text += std::string(method_name(part.method)) + ": " + count_of(part.masses, "mass", "masses") +
            ", " + count_of(part.links, "link", "links") + " (" + part.reason +
            (part.measured_ns > 0.0 ? "; measured at rest: " + in_ns(part.measured_ns) : "") +
            ")\n";
  }
  text = text.empty() ? "nothing moves\n" : text;
  for (const std::string& note : plan.notes) {
    text += note + "\n";
  }
  return text;
}

}  // namespace ressort
