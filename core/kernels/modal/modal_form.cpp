#include "core/kernels/modal/modal_form.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "core/kernels/estimates.h"
#include "core/kernels/modal/modal_body.h"
#include "core/kernels/modal/modal_crossed.h"
#include "core/kernels/modal/modal_worth.h"
#include "core/laws/law.h"
#include "core/sampled_mode.h"

namespace ressort::kernels {

using namespace linear_algebra;

namespace {

constexpr double zero_tolerance = 1e-13;  // share of the largest, below which a number counts as 0

// Replaces the continuous K and Z by lK and lZ of the published scheme (modal_exact.h). Returns the
// gain of the force.
double make_exact(double& k, double& z) {
  const SampledMode sampled = sampled_mode(1.0, k, z);
  const double stiffness = sampled.stiffness / sampled.mass;
  const double gain = k > 0.0 ? stiffness / k : 1.0;
  k = stiffness;
  z = sampled.damping / sampled.mass;
  return gain;
}

constexpr std::size_t most_passive = 32;  // links, which are solved together
constexpr double left_out_share = 0.02;   // fraction of the budget

// Makes the modal form of a Program.
class ModesFinder {
 public:
  ModesFinder(const Program& program, const LinearBody& body, const model::Budget& budget,
              const Progress& progress, bool is_untuned, bool is_exact)
      : program_(program),
        is_untuned_(is_untuned),
        progress_(progress),
        body_(body),
        count_(body.count),
        stiffness_(body.stiffness),
        damping_(body.damping) {
    modes_.inverse_mass = body.inverse_mass;
    modes_.reach = body.root.max();
    modes_.is_exact = is_exact;
    modes_.silence = std::pow(10.0, budget.silence_db / 20.0);
  }

  std::optional<Modes> find() {
    if (!program_.audio_coefficients.empty() || has_many_passive()) {
      return std::nullopt;
    }
    progress_.spend(program_.ends.size());
    const Eigenmodes eigenmodes(body_, progress_);
    shape_ = eigenmodes.shape();
    progress_.spend(std::size_t{count_} * count_);
    if (eigenmodes.measure(stiffness_, progress_) && eigenmodes.measure(damping_, progress_)) {
      choose_origin(eigenmodes);
    } else if (!cross()) {
      return std::nullopt;
    }
    place_pushes();
    place_holds();
    place_outputs();
    if (modes_.is_crossed) {
      keep_crossed();
      return std::move(modes_);
    }
    drop_idle_modes();
    find_felt();
    for (auto* frames : {&stiffness_, &damping_}) {
      for (const Frame& frame : *frames) {
        auto& shares = frames == &stiffness_ ? modes_.stiffness : modes_.damping;
        shares.push_back(share_of(frame));
      }
    }
    return std::move(modes_);
  }

 private:
  bool has_force_output() const {
    return std::any_of(program_.outputs.begin(), program_.outputs.end(),
                       [](const OutputSlot& output) { return output.is_force; });
  }

  // Returns whether there are too many passive links. They are coupled through the modes, so they
  // are solved together.
  bool has_many_passive() const {
    std::size_t count = 0;
    for (const LinkRun& run : program_.link_runs) {
      count += run.scheme == Scheme::plain ? 0 : run.count;
    }
    return count > most_passive;
  }

  // Returns the displacement of a weighted sum of masses per displacement of each mode.
  Vector row_of(const std::vector<MassShare>& shares) const {
    if (modes_.is_crossed) {
      return sum_of(crossed_.shape, shares);
    }
    Vector row(count_);
    for (const auto& [mass, share] : shares) {
      row += share * body_.root[mass] * shape_[mass];
    }
    return row;
  }
  Vector sum_of(const std::vector<Vector>& rows, const std::vector<MassShare>& shares) const {
    Vector sum(rows[0].size());
    for (const auto& [mass, share] : shares) {
      sum += share * rows[mass];
    }
    return sum;
  }
  Vector shape_of(std::uint32_t node) const { return row_of(body_.readout[node].shares); }
  ModalPlace place_of(std::uint32_t node, const Vector& shape) const {
    ModalPlace place{.rest = body_.readout[node].offset};
    if (!modes_.is_crossed) {
      place.rest += dot(shape, rest_);
      return place;
    }
    place.offset = place.rest;
    for (const auto& [mass, share] : body_.readout[node].shares) {
      place.rest += share * crossed_.rest[mass];
      place.masses.push_back({mass, share});
    }
    place.shape = numbers_of(shape);
    place.speed = numbers_of(sum_of(crossed_.speed, body_.readout[node].shares));
    return place;
  }
  static std::vector<double> numbers_of(const Vector& row) {
    return {std::begin(row), std::end(row)};
  }
  // Returns the force on each mode by forces on the masses.
  Vector modal(const Vector& force) const {
    if (modes_.is_crossed) {
      Vector row(crossed_.push[0].size());
      for (std::uint32_t mass = 0; mass < count_; ++mass) {
        row += force[mass] * crossed_.push[mass];
      }
      return row;
    }
    return in_modes(body_.root * force);
  }
  // Collects the coefficients of links, pushes, forces and masses.
  void find_felt() {
    std::set<std::uint32_t> felt = {modes_.give_by};
    if (modes_.inverse_mass != Modes::own_mass) {
      felt.insert(modes_.inverse_mass);
    }
    for (const ModalPush& push : modes_.pushes) {
      felt.insert({push.stiffness, push.damping});
    }
    for (const ModalHold& hold : modes_.holds) {
      const auto& coefficients = program_.link_runs[hold.run].coefficients;
      felt.insert(std::begin(coefficients), std::end(coefficients));
    }
    for (const ModalOutput& output : modes_.outputs) {
      for (const ModalForce::Part& part : output.force.parts) {
        felt.insert(part.coefficient);
      }
      for (const ModalForce::Hand& hand : output.force.hands) {
        felt.insert({hand.stiffness, hand.damping});
      }
    }
    felt.erase(felt.lower_bound(static_cast<std::uint32_t>(program_.coefficients.size())),
               felt.end());
    modes_.felt.assign(felt.begin(), felt.end());
  }
  // Returns a sum over masses for each mode.
  Vector in_modes(const Vector& masses) const {
    Vector modes(count_);
    for (std::uint32_t mass = 0; mass < count_; ++mass) {
      modes += masses[mass] * shape_[mass];
    }
    return modes;
  }

  // Chooses the origin of q: the equilibrium of all springs, or the start for modes without
  // springs.
  void choose_origin(const Eigenmodes& eigenmodes) {
    Vector position(count_);
    Vector velocity(count_);
    for (std::uint32_t i = 0; i < count_; ++i) {
      position[i] = program_.position[i] / body_.root[i];
      velocity[i] = program_.velocity[i] / body_.root[i];
    }
    const Vector start = in_modes(position);
    Vector pull = Vector(count_);
    Vector hold = Vector(count_);
    for (const Frame& frame : stiffness_) {
      frame.add_to(pull, body_.value[frame.coefficient] * eigenmodes.pull_of(frame));
      frame.add_to(hold, body_.value[frame.coefficient] * frame.factor);
    }
    const double most = largest(hold);
    rest_ = start;
    for (std::uint32_t i = 0; i < count_; ++i) {
      if (std::fabs(hold[i]) > 1e-9 * most) {
        rest_[i] = pull[i] / hold[i];
      }
    }
    q_ = start - rest_;
    d_ = in_modes(velocity);
    for (const Frame& frame : stiffness_) {
      const Vector wanted = eigenmodes.pull_of(frame);
      const Vector held = frame.factor * frame.part_of(rest_);
      if (largest(wanted - held) > 1e-13 * (largest(wanted) + largest(held))) {
        Vector left(count_);
        frame.add_to(left, wanted - held);
        add_push({.by = frame.is_late ? ModalPush::By::late : ModalPush::By::constant,
                  .stiffness = frame.coefficient},
                 left);
      }
    }
  }

  // Makes crossed modes, if damping is not proportional and nothing changes the coefficients.
  bool cross() {
    if (!is_untuned_) {
      return false;
    }
    progress_.spend(std::size_t{8} * count_ * count_);
    auto crossed = crossed_modes(program_, body_, modes_.is_exact, !is_plain(program_));
    if (!crossed) {
      return false;
    }
    crossed_ = *std::move(crossed);
    modes_.is_crossed = true;
    modes_.silence = 0.0;  // Amplitudes of crossed modes have no such bound.
    return true;
  }

  void keep_crossed() {
    const std::size_t count = crossed_.count;
    modes_.modes = static_cast<std::uint32_t>(count);
    modes_.pole = numbers_of(crossed_.pole);
    modes_.q = numbers_of(crossed_.start[std::slice(0, count, 1)]);
    modes_.d = numbers_of(crossed_.start[std::slice(count, count, 1)]);
    for (const auto* rows : {&crossed_.from_position, &crossed_.from_velocity}) {
      for (std::size_t i = 0; i < 2 * count; ++i) {
        for (const Vector& row : *rows) {
          modes_.basis.push_back(row[i]);
        }
      }
    }
    for (std::size_t i = 0; i < 2 * count; ++i) {
      for (std::uint32_t mass = 0; mass < count_; ++mass) {
        modes_.basis.push_back(crossed_.push[mass][i] / (body_.root[mass] * body_.root[mass]));
      }
    }
    modes_.reach = 0.0;
    for (const Vector& row : crossed_.shape) {
      modes_.reach = std::max(modes_.reach, std::sqrt(dot(row, row)));
    }
    for (std::size_t i = 0; i < pushed_.size(); ++i) {
      modes_.pushes[i].shape = numbers_of(pushed_[i]);
    }
    std::size_t part = 0;
    for (ModalOutput& output : modes_.outputs) {
      for (ModalForce::Part& felt : output.force.parts) {
        felt.shape = numbers_of(felt_[part++]);
      }
    }
  }

  void add_push(ModalPush push, Vector shape) {
    modes_.pushes.push_back(std::move(push));
    pushed_.push_back(std::move(shape));
  }

  void place_pushes() {
    for (std::uint32_t i = 0; i < program_.inputs.size(); ++i) {
      if (program_.inputs[i].is_force && body_.moves(program_.inputs[i].node)) {
        add_push({.by = ModalPush::By::force, .input = i},
                 modal(body_.force_at(program_.inputs[i].node)));
      }
    }
    for (const MassRun& run : program_.mass_runs) {
      if (run.has_gravity && !body_.is_nothing(run.gravity)) {
        Vector force = Vector(count_);
        force[std::slice(run.first, run.count, 1)] = -1.0;
        add_push({.by = ModalPush::By::constant, .stiffness = run.gravity}, modal(force));
      }
    }
    for (const LinkRun& run : program_.link_runs) {
      std::map<std::uint32_t, Vector> forces;  // [input] on the masses that it holds
      for (std::uint32_t i = run.first; is_linear(run.law) && i < run.first + run.count; ++i) {
        auto [a, b] = program_.ends[i];
        if (!body_.moves(a)) {
          std::swap(a, b);
        }
        if (body_.moves(a) && !body_.moves(b) && body_.input[b] != LinearBody::nowhere) {
          forces.try_emplace(body_.input[b], Vector(count_)).first->second += body_.force_at(a);
        }
      }
      for (const auto& [input, force] : forces) {
        add_push({.by = ModalPush::By::position,
                  .input = input,
                  .stiffness = run.coefficients[0],
                  .damping = run.coefficients[1],
                  .start = program_.position[program_.inputs[input].node]},
                 modal(force));
      }
    }
  }

  void place_holds() {
    std::map<std::uint32_t, std::uint32_t> number;
    for (const LinkRun& run : program_.link_runs) {
      if (is_linear(run.law)) {
        continue;
      }
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        for (const std::uint32_t node : {program_.ends[i].a, program_.ends[i].b}) {
          if (body_.moves(node) && number.try_emplace(node, heard_.size()).second) {
            heard_.push_back(shape_of(node));
            modes_.places.push_back(place_of(node, heard_.back()));
          }
        }
      }
    }
    const auto end_of = [&](std::uint32_t node) {
      const std::uint32_t end = body_.moves(node) ? number.at(node) : other_end(node);
      held_.emplace(node, end);
      return end;
    };
    for (std::uint32_t r = 0; r < program_.link_runs.size(); ++r) {
      const LinkRun& run = program_.link_runs[r];
      ModalHold hold{.run = r, .a = {}, .b = {}};
      for (std::uint32_t i = run.first; !is_linear(run.law) && i < run.first + run.count; ++i) {
        const auto [a, b] = program_.ends[i];
        if (body_.moves(a) || body_.moves(b) || has_force_output()) {
          hold.a.push_back(end_of(a));
          hold.b.push_back(end_of(b));
        }
      }
      if (!hold.a.empty()) {
        modes_.holds.push_back(std::move(hold));
      }
    }
  }

  std::uint32_t other_end(std::uint32_t node) {
    const auto next = static_cast<std::uint32_t>(modes_.places.size() + modes_.ends.size());
    const auto [entry, is_new] = end_of_.try_emplace(node, next);
    if (is_new) {
      const bool follows = body_.input[node] != LinearBody::nowhere;
      modes_.ends.push_back({follows, follows ? body_.input[node] : 0, node});
    }
    return entry->second;
  }

  void place_outputs() {
    for (const OutputSlot& output : program_.outputs) {
      if (output.is_force) {
        FeltForce felt = force_felt(program_, body_, output.node, rest_of_masses(), held_);
        for (std::size_t i = 0; i < felt.shares.size(); ++i) {
          const bool is_speed = modes_.is_crossed && felt.force.parts[i].is_damping;
          felt_.push_back(is_speed ? sum_of(crossed_.speed, felt.shares[i])
                                   : row_of(felt.shares[i]));
        }
        modes_.outputs.push_back({.is_force = true, .force = std::move(felt.force)});
      } else if (body_.moves(output.node)) {
        heard_.push_back(shape_of(output.node));
        modes_.outputs.push_back({.is_place = true, .place = place_of(output.node, heard_.back())});
      } else {
        modes_.outputs.push_back({.end = other_end(output.node)});
      }
    }
  }

  Vector rest_of_masses() const {
    if (modes_.is_crossed) {
      return crossed_.rest;
    }
    Vector rest(count_);
    for (std::uint32_t mass = 0; mass < count_; ++mass) {
      rest[mass] = body_.root[mass] * dot(shape_[mass], rest_);
    }
    return rest;
  }

  // Drops modes that no output and no link reads. All others may be excited.
  void drop_idle_modes() {
    const auto matters = [](const std::vector<Vector>& rows, std::uint32_t i) {
      return std::any_of(rows.begin(), rows.end(), [&](const Vector& row) {
        return std::fabs(row[i]) > zero_tolerance * largest(row);
      });
    };
    for (std::uint32_t i = 0; i < count_; ++i) {
      if (matters(heard_, i) || matters(felt_, i)) {
        kept_.push_back(i);
      }
    }
    if (has_force_output()) {
      modes_.silence = 0.0;  // There is no bound for outputs that are forces.
    }
    const bool is_driven =
        !pushed_.empty() || !modes_.places.empty() || largest(q_) > 0.0 || largest(d_) > 0.0;
    if (modes_.silence > 0.0 && is_driven) {
      leave_out();
    }
    modes_.modes = static_cast<std::uint32_t>(kept_.size());
    modes_.q = kept(q_);
    modes_.d = kept(d_);
    for (const std::uint32_t i : kept_) {
      for (std::uint32_t mass = 0; mass < count_; ++mass) {
        modes_.basis.push_back(shape_[mass][i] / body_.root[mass]);
      }
    }
    for (std::size_t i = 0; i < pushed_.size(); ++i) {
      modes_.pushes[i].shape = kept(pushed_[i]);
    }
    std::size_t row = 0;
    for (ModalPlace& place : modes_.places) {
      place.shape = kept(heard_[row++]);
    }
    std::size_t part = 0;
    for (ModalOutput& output : modes_.outputs) {
      if (output.is_place) {
        output.place.shape = kept(heard_[row++]);
      }
      for (ModalForce::Part& felt : output.force.parts) {
        felt.shape = kept(felt_[part++]);
      }
    }
  }

  // Returns the stiffness or damping of each mode at the start.
  Vector sum_of(const std::vector<Frame>& frames) const {
    const double w = body_.weight();
    Vector sum = Vector(count_);
    for (const Frame& frame : frames) {
      frame.add_to(sum, w * body_.value[frame.coefficient] * frame.factor);
    }
    return sum;
  }

  // Leaves out modes. Most of the budget is kept for modes that sleep, which cost nothing either.
  void leave_out() {
    Vector stiffness = sum_of(stiffness_);
    Vector damping = sum_of(damping_);
    const Vector flexible = stiffness;
    Vector root(1.0, count_);
    for (std::uint32_t i = 0; modes_.is_exact && i < count_; ++i) {
      root[i] = std::sqrt(make_exact(stiffness[i], damping[i]));
    }
    const auto kept_of = [&](const Vector& row) { return kept(row * root); };
    const auto start_of = [&](const Vector& row) { return kept(row / root); };
    ModalResponse hearing{kept(stiffness), kept(damping), {}, {start_of(q_), start_of(d_)}, {}};
    for (const Vector& row : pushed_) {
      hearing.blows.push_back(kept_of(row));
    }
    for (std::size_t i = 0; i < heard_.size(); ++i) {
      hearing.listeners.push_back(kept_of(heard_[i]));
      if (i < modes_.places.size()) {
        hearing.blows.push_back(hearing.listeners.back());
      }
    }
    const ModeSelection worth = select_modes(hearing, left_out_share * modes_.silence);
    modes_.of = static_cast<std::uint32_t>(kept_.size());
    modes_.left_out = worth.share;
    modes_.silence -= worth.share;
    const std::vector<std::uint32_t> all = std::exchange(kept_, {});
    for (const std::uint32_t i : worth.kept) {
      kept_.push_back(all[i]);
    }
    give_at_holds(worth.left_out, all, flexible);
  }

  // Computes the static compliance of the ends of links by the modes that are left out (residual
  // flexibility), relative to the stiffness of the first frame.
  void give_at_holds(const std::vector<std::uint32_t>& left_out,
                     const std::vector<std::uint32_t>& all, const Vector& stiffness) {
    if (left_out.empty() || stiffness_.empty()) {
      return;
    }
    const double w = body_.weight();
    modes_.give_by = stiffness_.front().coefficient;
    const Vector nothing(count_);
    const auto shape_at = [&](std::uint32_t end) -> const Vector& {
      return end < modes_.places.size() ? heard_[end] : nothing;
    };
    for (ModalHold& hold : modes_.holds) {
      for (std::size_t link = 0; link < hold.a.size(); ++link) {
        const Vector apart = shape_at(hold.a[link]) - shape_at(hold.b[link]);
        double give = 0.0;
        for (const std::uint32_t i : left_out) {
          give += w * apart[all[i]] * apart[all[i]] / stiffness[all[i]];
        }
        hold.give.push_back(give * body_.value[modes_.give_by]);
      }
    }
  }

  ModalShare share_of(const Frame& frame) const {
    ModalShare share{.coefficient = frame.coefficient, .is_late = frame.is_late};
    for (std::uint32_t i = 0; i < kept_.size(); ++i) {
      const std::uint32_t at = kept_[i] - frame.first;  // or far above
      if (at < frame.factor.size()) {
        share.first = share.factor.empty() ? i : share.first;
        share.factor.resize(i - share.first + 1);
        share.factor.back() = frame.factor[at];
      }
    }
    return share;
  }

  std::vector<double> kept(const Vector& row) const {
    std::vector<double> values;
    for (const std::uint32_t i : kept_) {
      values.push_back(row[i]);
    }
    return values;
  }

  const Program& program_;
  const bool is_untuned_;
  const Progress& progress_;
  const LinearBody& body_;
  const std::uint32_t count_;
  Modes modes_;
  std::vector<Frame> stiffness_;
  std::vector<Frame> damping_;
  std::vector<Vector> shape_;  // [mass][mode] orthonormal
  Vector rest_;                // [mode]
  Vector q_;
  Vector d_;
  std::vector<Vector> pushed_;                     // [push][mode]
  std::vector<Vector> heard_;                      // [place, then output][mode]
  std::vector<Vector> felt_;                       // [part of a force][mode]
  std::map<std::uint32_t, std::uint32_t> end_of_;  // [node] that is no mass
  std::map<std::uint32_t, std::uint32_t> held_;    // [node] that nonlinear links hold: its end
  std::vector<std::uint32_t> kept_;                // modes
  CrossedModes crossed_;
};

}  // namespace

std::optional<Modes> modal_form(const Program& program, const model::Budget& budget,
                                const Progress& progress, bool is_untuned, bool is_exact) {
  if (program.moving > most_modes || most_tied_masses(program) > most_tied_modes) {
    return std::nullopt;
  }
  const bool is_continuous = is_exact || budget.is_physical();
  const std::optional<LinearBody> body = linear_body(program, is_continuous);
  return body ? ModesFinder(program, *body, budget, progress, is_untuned, is_continuous).find()
              : std::nullopt;
}

}  // namespace ressort::kernels
