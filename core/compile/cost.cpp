#include "core/compile/cost.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/domains/sharded.h"
#include "core/laws/laws.h"

namespace ressort {
namespace {

// Links by what they cost: those that only pull, in a line or bent, and those that have to look
// first.
struct Count {
  double springs = 0.0;
  double bent = 0.0;
  double others = 0.0;
};

Count links_of(const Program& program) {
  Count count;
  for (const LinkRun& run : program.link_runs) {
    if (run.scheme != Scheme::plain) {
      continue;
    }
    const bool only_pulls = facts_of(run.law).contains_spring;
    (run.law == Law::spring ? count.springs : only_pulls ? count.bent : count.others) += run.count;
  }
  return count;
}

// What a link takes that is not plain, once for all lanes, or for one number: while it touches.
double passive_ns(const LinkRun& run) {
  const LawFacts& law = facts_of(run.law);
  const double steps = run.scheme == Scheme::substeps ? run.substeps : 1.0;
  return law.solve_ns + law.substep_ns * steps;
}
double passive_ns(const Program& program) {
  double sum = 0.0;
  for (const LinkRun& run : program.link_runs) {
    sum += run.scheme == Scheme::plain ? 0.0 : passive_ns(run) * run.count;
  }
  return sum;
}

// How many packs the voices fill, each counted as often as it is dearer than one of AVX2: the
// widest are worked on in two halves.
double packs_of(const Workload& load) {
  const double size = load.is_double ? 8.0 : 4.0;
  const double lanes = static_cast<double>(vector_bytes(load.isa)) / size;
  const bool is_halved = load.isa == Isa::v4 && load.voices > lanes / 2.0;
  return std::ceil(load.voices / lanes) * (is_halved ? 2.0 : load.isa == Isa::base ? 1.1 : 1.0);
}

// Parameters are still most of the time, so that a moving one counts by half; without that no mesh
// whose stiffness can be turned would ever be stepped by its modes.
double modal_ns(double modes, double places, double heard, double pushed, const Workload& load) {
  const double wide = load.isa == Isa::v4 ? 0.85 : load.isa == Isa::v3 ? 1.0 : 2.4;
  const double each = wide * (load.is_double ? 1.0 : 0.5) * modes;
  const double rows = places + pushed;
  const double slope = rows > 8.0 ? 0.23 : 0.09;
  const double bound = 25.0 + 5.0 * places + each * (0.30 + slope * rows);
  const double moving = 0.5 * (bound + 0.45 * each);
  const double still = places > 0.0 ? bound : 6.0 + each * (0.11 + 0.04 * heard + 0.045 * pushed);
  return std::max(still, moving);
}

class Predictor {
 public:
  Predictor(const Program& program, const Workload& load)
      : program_(program), load_(load), wide_(load.isa == Isa::base ? 0.0 : 1.0) {}

  double operator()(const Direct&) const {
    const auto widest =
        static_cast<double>(vector_bytes(load_.isa)) / (load_.is_double ? 8.0 : 4.0);
    const Count links = links_of(program_);
    return packs_of(load_) *
               (12.0 + 1.5 * passive_ns(program_) +
                1.6 * (program_.moving + links.springs + links.bent) + 5.0 * links.others) +
           10.0 * std::ceil(load_.voices / widest) * std::min<double>(load_.voices, widest) *
               static_cast<double>(program_.taps.size());
  }

  double operator()(const Chains& form) const {
    std::uint32_t longest = 0;
    for (const Chain& chain : form.chains) {
      longest = std::max(longest, chain.count);
    }
    const bool is_wide = wide_ > 0.0 && longest >= (load_.is_double ? 12u : 24u);
    const double lanes = (is_wide ? 32.0 : 16.0) / (load_.is_double ? 8.0 : 4.0);
    double sum = 6.0;
    for (const Chain& chain : form.chains) {
      const double stiff = chain.is_stiff ? 2.2 : 1.0;
      sum += 3.7 + stiff * (wide_ > 0.0 ? 0.62 : 0.9) * std::ceil(chain.count / lanes) +
             (chain.is_stiff ? 24.0 : 0.0);
    }
    if (!form.links.empty()) {
      sum += 4.0;
    }
    for (const std::uint32_t link : form.links) {
      const auto run = std::find_if(
          program_.link_runs.begin(), program_.link_runs.end(),
          [&](const LinkRun& r) { return link >= r.first && link < r.first + r.count; });
      if (run->scheme != Scheme::plain) {
        continue;
      }
      sum += run->law == Law::spring || run->law == Law::contact ? 2.3 : 5.0;
    }
    sum += 3.2 * static_cast<double>(form.loose.size()) + heard_and_pushed(0.5) +
           22.0 * static_cast<double>(program_.taps.size()) + passive_ns(program_);
    return sum * load_.voices;
  }

  // A force that sounds all the time costs more than the body; a body in contact is walked sample
  // by sample.
  double operator()(const Dense& form) const {
    const double n = program_.moving;
    const double slow = wide_ > 0.0 ? 1.0 : 1.8;
    const double half = load_.is_double ? 1.0 : 0.6;
    const double signals = static_cast<double>(program_.inputs.size() * program_.outputs.size());
    if (form.ports.empty()) {
      return load_.voices * slow * (0.95 + half * 0.12 * n + 3.0 * signals);
    }
    const double stride = load_.is_double ? 4.0 * std::ceil(n / 4.0) : 2.0 * std::ceil(n / 2.0);
    const double one = n <= 4.0 ? 8.0 : load_.is_double ? 2.8 * stride - 5.7 : 1.3 * stride + 2.0;
    return load_.voices * slow * (one + 5.0 * static_cast<double>(form.ports.size() - 1));
  }

  // Beyond most_held_masses everything goes through memory.
  double operator()(const Chorus&) const {
    const Count links = links_of(program_);
    const double others = links.bent + links.others;
    const double passive = 0.8 * packs_of(load_) * passive_ns(program_);
    if (program_.moving <= most_held_masses) {
      return 6.0 + 3.0 * others + passive +
             packs_of(load_) * (0.6 * (program_.moving + links.springs) + 2.8 * others);
    }
    return 6.0 + passive +
           (0.6 + 1.6 * packs_of(load_)) * (program_.moving + links.springs + others);
  }

  double operator()(const Modes& form) const {
    return load_.voices * modal_ns(form.modes, static_cast<double>(form.places.size()),
                                   static_cast<double>(form.outputs.size()),
                                   static_cast<double>(form.pushes.size()), load_);
  }

  double operator()(const Grid& form) const {
    const double slow = wide_ > 0.0 ? 1.0 : 2.3;
    const double d = load_.is_double ? 1.0 : 0.0;
    const double rest = static_cast<double>(form.rest_ends.size() + form.ports.size());
    double sum = passive_ns(program_) + (3.5 + 1.5 * d) * rest +
                 10.0 * static_cast<double>(program_.taps.size());
    for (const GridSegment& segment : form.segments) {
      const double offsets = static_cast<double>(segment.offsets.size());
      sum += 6.0 + 4.0 * d + slow * segment.count * (0.13 + 0.14 * d + (0.03 + 0.02 * d) * offsets);
    }
    for (const GridLinks& links : form.links) {
      const bool is_cheap = program_.link_runs[links.run].law == Law::spring;
      sum += slow * form.count * static_cast<double>(links.offsets.size()) * (0.24 + 0.21 * d) *
             (is_cheap ? 0.8 : 1.2);
    }
    return load_.voices * sum;
  }

  // Twice through the springs, and two loops over the masses.
  double operator()(const Fourth&) const { return 2.5 * (*this)(Direct{}); }

  // A third more than without.
  double operator()(const Compensated&) const {
    return (wide_ > 0.0 ? 1.3 : 4.0) * (*this)(Direct{});
  }

  // A voice's outputs, and its share of a coarse step.
  double operator()(const Slow& form) const {
    Workload one = load_;
    one.voices = 1;
    return load_.voices * (4.0 + 3.0 * static_cast<double>(program_.outputs.size()) +
                           predicted_ns(*form.coarse, one) / form.frames);
  }

  double operator()(const Shards& form) const { return sharded_ns(form, load_); }

 private:
  double heard_and_pushed(double each) const {
    return each * static_cast<double>(program_.inputs.size() + program_.outputs.size());
  }

  const Program& program_;
  const Workload& load_;
  double wide_;
};

}  // namespace

double exchange_ns(std::size_t copies) {
  return 3000.0 + 7.0 * static_cast<double>(copies);
}

double sharded_ns(const Shards& form, const Workload& load) {
  double slowest = 0.0;
  for (const Shard& shard : *form.shards) {
    slowest = std::max(slowest, predicted_ns(shard.program, load) +
                                    exchange_ns(shard.copies.size()) / form.frames);
  }
  return slowest;
}

double predicted_ns(const Program& program, const Workload& load) {
  return std::visit(Predictor(program, load), program.form);
}

double least_modal_ns(const Program& program, const Workload& load) {
  const Count links = links_of(program);
  // Two links at one mass share its place, so each is counted as half of one.
  return load.voices * modal_ns(program.moving, 0.5 * (links.bent + links.others),
                                static_cast<double>(program.outputs.size()), 0.0, load);
}

double worst_steps(const Program& program) {
  constexpr double of_a_point = 10.0;
  constexpr double of_an_audio_coefficient = 20.0;
  constexpr double of_a_solved_link = 400.0;
  double steps = program.moving + static_cast<double>(program.ends.size()) +
                 of_a_point * static_cast<double>(program.taps.size()) +
                 of_an_audio_coefficient * static_cast<double>(program.audio_coefficients.size());
  for (const LinkRun& run : program.link_runs) {
    steps += run.scheme == Scheme::plain ? 0.0 : of_a_solved_link * run.count;
  }
  return steps;
}

}  // namespace ressort
