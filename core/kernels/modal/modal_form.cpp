#include "core/kernels/modal/modal_form.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <map>
#include <utility>

#include "core/kernels/modal/modal_worth.h"
#include "core/laws/laws.h"
#include "core/linear_algebra/eigen.h"

namespace ressort {
namespace {

constexpr std::uint32_t nowhere = 0xffffffffu;
constexpr double shared_tolerance = 1e-12;  // of a matrix' largest element: is it diagonal?
constexpr double zero_tolerance = 1e-13;    // of the largest: is it anything?

// A spring or a damper between masses a and b, or on a alone.
struct Bar {
  std::uint32_t a = nowhere;
  std::uint32_t b = nowhere;
  double weight = 1.0;
};

// All bars that one coefficient stiffens.
struct Frame {
  std::uint32_t coefficient = 0;
  bool is_late = false;
  std::vector<Bar> bars;
  Vector pull;    // [mass] the force on the masses at 0, for a coefficient of 1
  Vector factor;  // [mode]
};

// The published scheme's lK and lZ that are the continuous K and Z, sampled; gives the force's gain
// (core/kernels/modal/modal_exact.h).
double make_exact(double& k, double& z) {
  const std::complex<double> pole =
      std::exp(std::complex<double>(-0.5 * z) + std::sqrt(std::complex<double>(0.25 * z * z - k)));
  const double r = std::exp(-0.5 * z);
  const double stiffness = 1.0 + r * r - (pole + r * r / pole).real();
  const double gain = k > 0.0 ? stiffness / k : 1.0;
  k = stiffness;
  z = 1.0 - r * r;
  return gain;
}

constexpr double left_out_share = 0.02;  // of the budget
// Each takes a matrix of all masses, or a vector; with so many the form is of no use.
constexpr std::size_t most_frames = 256;
constexpr std::size_t most_runs = 65'536;

class ModesFinder {
 public:
  ModesFinder(const Program& program, const Budget& budget, const Progress& progress)
      : program_(program), progress_(progress), count_(program.moving) {
    modes_.is_exact = budget.is_physical();
    modes_.silence = std::pow(10.0, budget.silence_db / 20.0);
  }

  std::optional<Modes> find() {
    if (count_ == 0 || count_ > most_modes || !program_.taps.empty() ||
        !program_.audio_coefficients.empty() || has_force_output() || has_other_schemes()) {
      return std::nullopt;
    }
    look_at_parameters();
    if (has_sliding_ground() || !weigh_masses()) {
      return std::nullopt;
    }
    if (!sort_links() || program_.link_runs.size() > most_runs) {
      return std::nullopt;
    }
    progress_.spend(program_.ends.size());
    solve();
    progress_.spend(std::size_t{count_} * count_);
    if (!measure(stiffness_) || !measure(damping_)) {
      return std::nullopt;
    }
    settle();
    place_pushes();
    place_holds();
    place_outputs();
    drop_idle_modes();
    for (auto* frames : {&stiffness_, &damping_}) {
      for (const Frame& frame : *frames) {
        auto& shares = frames == &stiffness_ ? modes_.stiffness : modes_.damping;
        shares.push_back({frame.coefficient, frame.is_late, kept(frame.factor)});
      }
    }
    return std::move(modes_);
  }

 private:
  bool has_force_output() const {
    return std::any_of(program_.outputs.begin(), program_.outputs.end(),
                       [](const OutputSlot& output) { return output.is_force; });
  }

  bool has_other_schemes() const {
    return std::any_of(program_.link_runs.begin(), program_.link_runs.end(),
                       [](const LinkRun& run) { return run.scheme != Scheme::plain; });
  }

  void look_at_parameters() {
    is_live_.assign(program_.coefficients.size(), false);
    for (const auto& depending : program_.depending) {
      for (const std::uint32_t c : depending) {
        is_live_[c] = true;
      }
    }
    for (const Coefficient& coefficient : program_.coefficients) {
      value_.push_back(coefficient_value(program_, coefficient, program_.parameters, 1.0));
    }
    hand_.assign(program_.position.size(), nowhere);
    for (std::uint32_t i = 0; i < program_.inputs.size(); ++i) {
      if (!program_.inputs[i].is_force) {
        hand_[program_.inputs[i].node] = i;
      }
    }
  }

  // A ground that stays but claims to have a velocity is left to the direct form.
  bool has_sliding_ground() const {
    for (std::uint32_t node = count_; node < program_.velocity.size(); ++node) {
      if (hand_[node] == nowhere && program_.velocity[node] != 0.0) {
        return true;
      }
    }
    return false;
  }

  bool moves(std::uint32_t node) const { return node < count_; }
  bool is_nothing(std::uint32_t c) const { return !is_live_[c] && value_[c] == 0.0; }

  // All masses turn with one coefficient, or none turns.
  bool weigh_masses() {
    root_ = Vector(1.0, count_);
    const std::uint32_t first = program_.mass_runs.front().inverse_mass;
    const bool together =
        std::all_of(program_.mass_runs.begin(), program_.mass_runs.end(),
                    [&](const MassRun& run) { return run.inverse_mass == first; });
    if (together) {
      modes_.inverse_mass = first;
      return true;
    }
    for (const MassRun& run : program_.mass_runs) {
      const double inverse = value_[run.inverse_mass];
      if (is_live_[run.inverse_mass] || !(inverse > 0.0) || !std::isfinite(inverse)) {
        return false;
      }
      root_[std::slice(run.first, run.count, 1)] = std::sqrt(inverse);
    }
    modes_.reach = root_.max();
    return true;
  }

  // The frame of a coefficient. Constants are one frame, as nothing but a voice's pitch moves
  // them: then the coefficient is that of the first, and the weight is relative to it.
  Frame& frame_of(std::vector<Frame>& frames, std::uint32_t c, bool is_late, double& weight) {
    weight = 1.0;
    for (Frame& frame : frames) {
      if (frame.is_late != is_late) {
        continue;
      }
      if (frame.coefficient == c) {
        return frame;
      }
      if (!is_live_[c] && !is_live_[frame.coefficient]) {
        weight = value_[c] / value_[frame.coefficient];
        return frame;
      }
    }
    frames.push_back({.coefficient = c, .is_late = is_late, .pull = Vector(count_)});
    return frames.back();
  }

  void add_bar(std::vector<Frame>& frames, std::uint32_t c, bool is_late, Bar bar,
               double position) {
    if (is_nothing(c)) {
      return;
    }
    Frame& frame = frame_of(frames, c, is_late, bar.weight);
    frame.bars.push_back(bar);
    frame.pull[bar.a] += bar.weight * position;
  }

  // Linear links and oscillators become frames, all others holds. False if there are too many.
  bool sort_links() {
    for (const MassRun& run : program_.mass_runs) {
      for (std::uint32_t i = run.first; run.is_oscillator && i < run.first + run.count; ++i) {
        add_bar(stiffness_, run.stiffness, false, {i}, 0.0);
        add_bar(damping_, run.damping, false, {i}, 0.0);
      }
    }
    for (const LinkRun& run : program_.link_runs) {
      for (std::uint32_t i = run.first; run.law == Law::spring && i < run.first + run.count; ++i) {
        Bar bar{program_.ends[i].a, program_.ends[i].b};
        if (!moves(bar.a)) {
          std::swap(bar.a, bar.b);
        }
        if (!moves(bar.a) || bar.a == bar.b) {
          continue;
        }
        double position = 0.0;
        if (!moves(bar.b)) {
          position = program_.position[bar.b];
          bar.b = nowhere;
        }
        add_bar(stiffness_, run.coefficients[0], true, bar, position);
        add_bar(damping_, run.coefficients[1], true, bar, 0.0);
      }
      if (stiffness_.size() + damping_.size() > most_frames) {
        return false;
      }
    }
    return true;
  }

  // The eigenvectors of a mixture of all frames in odd shares: where frames share eigenvectors,
  // two eigenvalues of it are the same only if they are so in every frame.
  void solve() {
    Matrix mixture(count_, count_);
    double share = 1.0;
    for (auto* frames : {&stiffness_, &damping_}) {
      for (const Frame& frame : *frames) {
        progress_.spend(std::size_t{count_} * count_ / 8);
        share = std::fmod(share + 0.6180339887498949, 1.0) + 0.1;
        Matrix matrix(count_, count_);
        for (const Bar& bar : frame.bars) {
          add(matrix, bar);
        }
        const double most = largest(matrix.values);
        if (most > 0.0) {
          mixture.values += share / most * matrix.values;
        }
      }
    }
    const Eigenpairs pairs = symmetric_eigenpairs(mixture);
    for (std::uint32_t mass = 0; mass < count_; ++mass) {
      shape_.emplace_back(pairs.vectors.values[std::slice(mass, count_, count_)]);
    }
  }

  void add(Matrix& matrix, const Bar& bar) const {
    const double ra = root_[bar.a];
    matrix(bar.a, bar.a) += bar.weight * ra * ra;
    if (bar.b != nowhere) {
      const double rb = root_[bar.b];
      matrix(bar.b, bar.b) += bar.weight * rb * rb;
      matrix(bar.a, bar.b) -= bar.weight * ra * rb;
      matrix(bar.b, bar.a) -= bar.weight * ra * rb;
    }
  }

  // Each frame's factors, bar by bar: as sums of squares they are exact even where small. False
  // if an eigenvector is none of a frame's.
  bool measure(std::vector<Frame>& frames) {
    for (Frame& frame : frames) {
      progress_.spend((frame.bars.size() + count_) * count_ / 8);
      frame.factor.resize(count_);
      std::vector<Vector> image(count_, Vector(count_));  // [mass][mode]
      for (const Bar& bar : frame.bars) {
        Vector stretch = root_[bar.a] * shape_[bar.a];
        if (bar.b != nowhere) {
          stretch -= root_[bar.b] * shape_[bar.b];
          image[bar.b] -= bar.weight * root_[bar.b] * stretch;
        }
        image[bar.a] += bar.weight * root_[bar.a] * stretch;
        frame.factor += bar.weight * stretch * stretch;
      }
      const double most = largest(frame.factor);
      for (std::uint32_t i = 0; i < count_; ++i) {
        if (!(largest(image[i] - frame.factor * shape_[i]) <= shared_tolerance * most)) {
          return false;
        }
      }
      // A mode that moves as a whole is not held at all.
      for (double& factor : frame.factor) {
        factor = std::fabs(factor) < zero_tolerance * most ? 0.0 : factor;
      }
    }
    return true;
  }

  Vector shape_of(std::uint32_t node) const { return root_[node] * shape_[node]; }
  // What a force on each mass does to the modes.
  Vector modal(const Vector& force) const { return in_modes(root_ * force); }
  // By mode what is by mass.
  Vector in_modes(const Vector& masses) const {
    Vector modes(count_);
    for (std::uint32_t mass = 0; mass < count_; ++mass) {
      modes += masses[mass] * shape_[mass];
    }
    return modes;
  }

  // q is counted from where all springs are at rest, or from the start where none pulls.
  void settle() {
    Vector position(count_);
    Vector velocity(count_);
    for (std::uint32_t i = 0; i < count_; ++i) {
      position[i] = program_.position[i] / root_[i];
      velocity[i] = program_.velocity[i] / root_[i];
    }
    const Vector start = in_modes(position);
    Vector pull = Vector(count_);
    Vector hold = Vector(count_);
    for (const Frame& frame : stiffness_) {
      pull += value_[frame.coefficient] * modal(frame.pull);
      hold += value_[frame.coefficient] * frame.factor;
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
      const Vector wanted = modal(frame.pull);
      const Vector left = wanted - frame.factor * rest_;
      const double all = largest(wanted) + largest(frame.factor * rest_);
      if (largest(left) > 1e-13 * all) {
        add_push({.by = frame.is_late ? ModalPush::By::late : ModalPush::By::constant,
                  .stiffness = frame.coefficient},
                 left);
      }
    }
  }

  void add_push(ModalPush push, Vector shape) {
    modes_.pushes.push_back(std::move(push));
    pushed_.push_back(std::move(shape));
  }

  void place_pushes() {
    for (std::uint32_t i = 0; i < program_.inputs.size(); ++i) {
      if (program_.inputs[i].is_force && moves(program_.inputs[i].node)) {
        add_push({.by = ModalPush::By::force, .input = i}, shape_of(program_.inputs[i].node));
      }
    }
    for (const MassRun& run : program_.mass_runs) {
      if (run.has_gravity && !is_nothing(run.gravity)) {
        Vector force = Vector(count_);
        force[std::slice(run.first, run.count, 1)] = -1.0;
        add_push({.by = ModalPush::By::constant, .stiffness = run.gravity}, modal(force));
      }
    }
    for (const LinkRun& run : program_.link_runs) {
      std::map<std::uint32_t, Vector> forces;  // [input] on the masses that it holds
      for (std::uint32_t i = run.first; run.law == Law::spring && i < run.first + run.count; ++i) {
        auto [a, b] = program_.ends[i];
        if (!moves(a)) {
          std::swap(a, b);
        }
        if (moves(a) && !moves(b) && hand_[b] != nowhere) {
          forces.try_emplace(hand_[b], Vector(count_)).first->second[a] += 1.0;
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
    std::map<std::uint32_t, std::uint32_t> place_of;
    for (const LinkRun& run : program_.link_runs) {
      if (run.law == Law::spring) {
        continue;
      }
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        for (const std::uint32_t node : {program_.ends[i].a, program_.ends[i].b}) {
          if (moves(node) && place_of.try_emplace(node, heard_.size()).second) {
            heard_.push_back(shape_of(node));
            modes_.places.push_back({dot(heard_.back(), rest_), {}});
          }
        }
      }
    }
    const auto end_of = [&](std::uint32_t node) {
      return moves(node) ? place_of.at(node) : other_end(node);
    };
    for (std::uint32_t r = 0; r < program_.link_runs.size(); ++r) {
      const LinkRun& run = program_.link_runs[r];
      ModalHold hold{.run = r, .a = {}, .b = {}};
      for (std::uint32_t i = run.first; run.law != Law::spring && i < run.first + run.count; ++i) {
        const auto [a, b] = program_.ends[i];
        if (moves(a) || moves(b)) {
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
      const bool follows = hand_[node] != nowhere;
      modes_.ends.push_back({follows, follows ? hand_[node] : 0, node});
    }
    return entry->second;
  }

  void place_outputs() {
    for (const OutputSlot& output : program_.outputs) {
      if (moves(output.node)) {
        heard_.push_back(shape_of(output.node));
        modes_.outputs.push_back({0, true, {dot(heard_.back(), rest_), {}}});
      } else {
        modes_.outputs.push_back({other_end(output.node), false, {}});
      }
    }
  }

  // Modes that nothing hears, and modes that nothing sets moving, are as good as not there.
  void drop_idle_modes() {
    const auto matters = [](const std::vector<Vector>& rows, std::uint32_t i) {
      return std::any_of(rows.begin(), rows.end(), [&](const Vector& row) {
        return std::fabs(row[i]) > zero_tolerance * largest(row);
      });
    };
    std::vector<Vector> driven = pushed_;
    driven.insert(driven.end(), heard_.begin(),
                  heard_.begin() + std::ptrdiff_t(modes_.places.size()));
    driven.push_back(q_);
    driven.push_back(d_);
    for (std::uint32_t i = 0; i < count_; ++i) {
      if (matters(heard_, i) && matters(driven, i)) {
        kept_.push_back(i);
      }
    }
    if (modes_.silence > 0.0) {
      leave_out();
    }
    modes_.modes = static_cast<std::uint32_t>(kept_.size());
    modes_.q = kept(q_);
    modes_.d = kept(d_);
    for (const std::uint32_t i : kept_) {
      for (std::uint32_t mass = 0; mass < count_; ++mass) {
        modes_.basis.push_back(shape_[mass][i] / root_[mass]);
      }
    }
    for (std::size_t i = 0; i < pushed_.size(); ++i) {
      modes_.pushes[i].shape = kept(pushed_[i]);
    }
    std::size_t row = 0;
    for (ModalPlace& place : modes_.places) {
      place.shape = kept(heard_[row++]);
    }
    for (ModalOutput& output : modes_.outputs) {
      if (output.is_place) {
        output.place.shape = kept(heard_[row++]);
      }
    }
  }

  // What all stiffnesses or dampings give to each mode, at the start.
  Vector sum_of(const std::vector<Frame>& frames) const {
    const double w = modes_.inverse_mass == Modes::own_mass ? 1.0 : value_[modes_.inverse_mass];
    Vector sum = Vector(count_);
    for (const Frame& frame : frames) {
      sum += w * value_[frame.coefficient] * frame.factor;
    }
    return sum;
  }

  // Most of the budget is for modes that sleep: these cost nothing either.
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
    Hearing hearing{kept(stiffness), kept(damping), {}, {start_of(q_), start_of(d_)}, {}};
    for (const Vector& row : pushed_) {
      hearing.blows.push_back(kept_of(row));
    }
    for (std::size_t i = 0; i < heard_.size(); ++i) {
      hearing.listeners.push_back(kept_of(heard_[i]));
      if (i < modes_.places.size()) {
        hearing.blows.push_back(hearing.listeners.back());
      }
    }
    const Worth worth = weigh(hearing, left_out_share * modes_.silence);
    modes_.of = static_cast<std::uint32_t>(kept_.size());
    modes_.left_out = worth.share;
    modes_.silence -= worth.share;
    const std::vector<std::uint32_t> all = std::exchange(kept_, {});
    for (const std::uint32_t i : worth.kept) {
      kept_.push_back(all[i]);
    }
    give_at_holds(worth.left_out, all, flexible);
  }

  // How far the modes that are left out let the ends of a link give way, per force, with the
  // stiffness of the first frame.
  void give_at_holds(const std::vector<std::uint32_t>& left_out,
                     const std::vector<std::uint32_t>& all, const Vector& stiffness) {
    if (left_out.empty() || stiffness_.empty()) {
      return;
    }
    const double w = modes_.inverse_mass == Modes::own_mass ? 1.0 : value_[modes_.inverse_mass];
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
        hold.give.push_back(give * value_[modes_.give_by]);
      }
    }
  }

  std::vector<double> kept(const Vector& row) const {
    std::vector<double> values;
    for (const std::uint32_t i : kept_) {
      values.push_back(row[i]);
    }
    return values;
  }

  const Program& program_;
  const Progress& progress_;
  const std::uint32_t count_;
  Modes modes_;
  std::vector<bool> is_live_;        // [coefficient] does a parameter move it?
  std::vector<double> value_;        // [coefficient] at the start
  std::vector<std::uint32_t> hand_;  // [node] the input that moves it, or nowhere
  Vector root_;                      // [mass] of its inverse
  std::vector<Frame> stiffness_;
  std::vector<Frame> damping_;
  std::vector<Vector> shape_;  // [mass][mode] orthonormal
  Vector rest_;                // [mode]
  Vector q_;
  Vector d_;
  std::vector<Vector> pushed_;                     // [push][mode]
  std::vector<Vector> heard_;                      // [place, then output][mode]
  std::map<std::uint32_t, std::uint32_t> end_of_;  // [node] that is no mass
  std::vector<std::uint32_t> kept_;                // modes
};

}  // namespace

std::optional<Modes> modal_form(const Program& program, const Budget& budget,
                                const Progress& progress) {
  return is_plain(program) ? ModesFinder(program, budget, progress).find() : std::nullopt;
}

}  // namespace ressort
