#include "core/kernels/modal/modal_crossed.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "core/linear_algebra/eigen.h"

namespace ressort::kernels {

using namespace linear_algebra;

namespace {

using Complex = std::complex<double>;

constexpr double most_condition = 1e8;
// Poles whose relative difference is smaller than this count as equal.
constexpr double same_pole = 1e-9;
// A pole counts as defective if X^T P' X is below this fraction of its largest possible value.
constexpr double least_norm = 1e-9;
constexpr double least_pole = 1e-30;
constexpr double highest_frequency = 3.1;
constexpr double most_inconsistency = 1e-8;

class CrossedFinder {
 public:
  CrossedFinder(const Program& program, const LinearBody& body, bool is_exact,
                bool is_held_passively)
      : program_(program),
        body_(body),
        is_exact_(is_exact),
        is_held_passively_(is_held_passively),
        n_(body.count),
        k_(n_, n_),
        z_(n_, n_),
        own_k_(n_),
        own_z_(n_) {}

  std::optional<CrossedModes> find() {
    if (n_ > most_crossed_masses || !is_frozen() || !assemble() || !find_poles() ||
        !find_states() || (is_exact_ && is_held_passively_ && !is_passive())) {
      return std::nullopt;
    }
    write_rows();
    return std::move(made_);
  }

 private:
  bool is_frozen() const {
    const auto stays = [&](const Frame& frame) { return !body_.is_live[frame.coefficient]; };
    return std::all_of(body_.stiffness.begin(), body_.stiffness.end(), stays) &&
           std::all_of(body_.damping.begin(), body_.damping.end(), stays) &&
           (body_.inverse_mass == Modes::own_mass || !body_.is_live[body_.inverse_mass]);
  }

  // Assembles K and Z for masses of 1 (row i is mass i divided by its root), and the masses' own
  // springs and dampers, which act from the first sample on.
  bool assemble() {
    Vector pull(n_);
    const double w = body_.weight();
    for (const auto* frames : {&body_.stiffness, &body_.damping}) {
      Matrix& matrix = frames == &body_.stiffness ? k_ : z_;
      Vector& own = frames == &body_.stiffness ? own_k_ : own_z_;
      for (const Frame& frame : *frames) {
        const double value = w * body_.value[frame.coefficient];
        if (frames == &body_.stiffness) {
          for (const auto& [mass, force] : frame.pull) {
            pull[mass] += value * body_.root[mass] * force;
          }
        }
        for (const Bar& bar : frame.bars) {
          for (const auto& [a, share] : bar.shares) {
            for (const auto& [b, other] : bar.shares) {
              matrix(a, b) += value * bar.weight * share * body_.root[a] * other * body_.root[b];
            }
            own[a] += frame.is_late ? 0.0 : value * bar.weight * body_.root[a] * body_.root[a];
          }
        }
      }
    }
    const std::optional<Vector> rest = solution(k_, pull);
    if (!rest || !std::isfinite(rest->sum())) {
      return false;
    }
    rest_ = *rest;
    return true;
  }

  // Computes the poles of the first-order system in the eigenvectors of K, scaled by their
  // frequencies. The matrix is normal if there is no damping, so slow poles are as accurate as fast
  // ones.
  bool find_poles() {
    const Eigenpairs stiff = symmetric_eigenpairs(k_);
    const double most = std::max(stiff.values.max(), 0.0);
    if (!(stiff.values.min() >= -1e-12 * most) || !(most > 0.0)) {
      return false;
    }
    const Matrix damping = in_basis(z_, stiff.vectors);
    Vector unit(n_);
    // Matrix of the state (q in units, change of q): its step minus 1, or its derivative.
    Matrix flow(2 * n_, 2 * n_);
    for (std::size_t i = 0; i < n_; ++i) {
      unit[i] = std::sqrt(std::max(stiff.values[i], 1e-8 * most));
    }
    for (std::size_t i = 0; i < n_; ++i) {
      const double stiffness = std::max(stiff.values[i], 0.0) / unit[i];
      flow(n_ + i, i) = -stiffness;
      flow(i, i) = is_exact_ ? 0.0 : -unit[i] * stiffness;
      for (std::size_t j = 0; j < n_; ++j) {
        flow(n_ + i, n_ + j) = -damping(i, j);
        flow(i, n_ + j) = unit[i] * ((i == j ? 1.0 : 0.0) - (is_exact_ ? 0.0 : damping(i, j)));
      }
    }
    const std::optional<ComplexEigenpairs> pairs = eigenpairs(flow);
    if (!pairs) {
      return false;
    }
    for (std::size_t j = 0; j < 2 * n_; ++j) {
      const Complex at = pairs->values[j];
      if (at.imag() < 0.0) {
        continue;
      }
      ComplexVector shape(n_);
      for (std::size_t i = 0; i < n_; ++i) {
        for (std::size_t m = 0; m < n_; ++m) {
          shape[m] += stiff.vectors(m, i) / unit[i] * pairs->vectors[j][i];
        }
      }
      if (!add_mode(at, std::move(shape))) {
        return false;
      }
    }
    return true;
  }

  // Returns e^s - 1 without cancellation.
  static Complex growth(Complex s) {
    const double half = std::sin(0.5 * s.imag());
    return {std::expm1(s.real()) * std::cos(s.imag()) - 2.0 * half * half,
            std::exp(s.real()) * std::sin(s.imag())};
  }

  // Returns X^T P' Y at a pole.
  Complex inner(Complex at, const ComplexVector& x, const ComplexVector& y) const {
    Complex sum = 0.0;
    for (std::size_t i = 0; i < n_; ++i) {
      Complex image = 2.0 * at * y[i];
      for (std::size_t j = 0; j < n_; ++j) {
        image += (z_(i, j) + (is_exact_ ? 0.0 : k_(i, j))) * y[j];
      }
      sum += x[i] * image;
    }
    return sum;
  }

  // Computes the eigenvectors; `at` is s or z - 1. Vectors of equal poles are made orthogonal.
  bool add_mode(Complex at, ComplexVector x) {
    const Complex less = is_exact_ ? growth(at) : at;
    const Complex pole = 1.0 + less;
    if (!(std::abs(pole) > least_pole) || (is_exact_ && at.imag() > highest_frequency)) {
      return false;
    }
    for (std::size_t i = 0; i < less_.size(); ++i) {
      if (std::abs(at - at_[i]) <= same_pole * (1.0 + std::abs(at))) {
        x -= inner(at, plain_[i], x) / inner(at, plain_[i], plain_[i]) * plain_[i];
      }
    }
    double length = 0.0;
    for (const Complex part : x) {
      length += std::norm(part);
    }
    const Complex norm = inner(at, x, x);
    if (!(std::abs(norm) > least_norm * std::abs(at) * length) || !(length > 0.0)) {
      return false;
    }
    const bool is_pair = at.imag() > 0.0;
    ComplexVector shape = std::sqrt((is_pair ? 2.0 : 1.0) * pole / norm) * x;
    at_.push_back(at);
    less_.push_back(less);
    plain_.push_back(std::move(x));
    shape_.push_back(std::move(shape));
    return true;
  }

  // Lists the real numbers of the modes: the real or the imaginary part of each.
  struct Number {
    std::size_t mode = 0;
    bool is_imaginary = false;
  };

  // Computes the modes of positions and velocities: the inverse of the matrix of shapes.
  bool find_states() {
    const std::size_t count = shape_.size();
    std::vector<Number> numbers;
    for (std::size_t j = 0; j < count; ++j) {
      const bool is_pair = at_[j].imag() > 0.0;
      const bool is_turned = has_imaginary(shape_[j]);
      if (is_pair || !is_turned) {
        numbers.push_back({j, false});
      }
      if (is_pair || is_turned) {
        numbers.push_back({j, true});
      }
    }
    if (numbers.size() != 2 * n_) {
      return false;
    }
    Matrix put(2 * n_, 2 * n_);
    Vector scale(2 * n_);
    for (std::size_t c = 0; c < numbers.size(); ++c) {
      const auto [j, is_imaginary] = numbers[c];
      const Complex step = less_[j] / (1.0 + less_[j]);
      for (std::size_t m = 0; m < n_; ++m) {
        const Complex x = shape_[j][m];
        const Complex v = shape_[j][m] * step;
        put(m, c) = is_imaginary ? -x.imag() : x.real();
        put(n_ + m, c) = is_imaginary ? -v.imag() : v.real();
      }
      const Vector column = put.column(c);
      scale[c] = std::sqrt(dot(column, column));
      put.values[std::slice(c * 2 * n_, 2 * n_, 1)] = column / scale[c];
    }
    const std::optional<Matrix> taken = inverse(put);
    const auto length = [](const Matrix& matrix) {
      return std::sqrt(dot(matrix.values, matrix.values));
    };
    if (!taken || !(length(*taken) * length(put) < most_condition)) {
      return false;
    }
    worth_.assign(2 * n_, Vector(2 * count));
    for (std::size_t c = 0; c < numbers.size(); ++c) {
      const std::size_t at = numbers[c].mode + (numbers[c].is_imaginary ? count : 0);
      for (std::size_t i = 0; i < 2 * n_; ++i) {
        worth_[i][at] = (*taken)(c, i) / scale[c];
      }
    }
    return replies_agree();
  }
  static bool has_imaginary(const ComplexVector& shape) {
    double real = 0.0;
    double imaginary = 0.0;
    for (const Complex part : shape) {
      real += part.real() * part.real();
      imaginary += part.imag() * part.imag();
    }
    return imaginary > real;
  }

  // Checks the shapes: a force must change position and velocity of a mass by the same amount.
  bool replies_agree() {
    const std::size_t count = shape_.size();
    double most = 0.0;
    for (std::size_t m = 0; m < n_; ++m) {
      Vector row(2 * count);
      for (std::size_t j = 0; j < count; ++j) {
        row[j] = shape_[j][m].real();
        row[count + j] = shape_[j][m].imag();
      }
      most = std::max(most, largest(row));
      rows_.push_back(std::move(row));
    }
    for (std::size_t m = 0; m < n_; ++m) {
      Vector kick(2 * count);
      for (std::size_t i = 0; i < n_; ++i) {
        double reply = 0.0;
        for (std::size_t j = 0; j < count; ++j) {
          reply += rows_[m][j] * rows_[i][j] - rows_[m][count + j] * rows_[i][count + j];
        }
        kick += reply * (worth_[i] + worth_[n_ + i]);
      }
      if (!(largest(kick - rows_[m]) <= most_inconsistency * most)) {
        return false;
      }
    }
    return true;
  }

  // Checks passivity. The modes are those of a published scheme with other M, K and Z,
  //   v[n+1] = v[n] - M^-1 (K x + Z v),  M^-1 = the real part of u u^T
  // which gains no energy at any end if K, Z and 4M - K - 2Z are positive semidefinite.
  bool is_passive() const {
    const std::size_t count = shape_.size();
    Matrix reply(n_, n_);
    Matrix held(n_, n_);
    Matrix slowed(n_, n_);
    for (std::size_t m = 0; m < n_; ++m) {
      ComplexVector next(count);  // contribution of each mode to the velocity of mass m
      for (std::size_t j = 0; j < count; ++j) {
        next[j] = shape_[j][m] * less_[j];
      }
      for (std::size_t i = 0; i < n_; ++i) {
        for (std::size_t j = 0; j < count; ++j) {
          const Complex x(worth_[i][j], worth_[i][count + j]);
          const Complex v(worth_[n_ + i][j], worth_[n_ + i][count + j]);
          reply(m, i) += (shape_[j][m] * shape_[j][i]).real();
          held(i, m) -= (next[j] * x).real();
          slowed(i, m) -= (next[j] * v).real();
        }
      }
      slowed(m, m) += 1.0;
    }
    const std::optional<Matrix> mass = inverse(reply);
    const std::optional<Matrix> stiffness = quotient(held, reply);
    const std::optional<Matrix> damping = quotient(slowed, reply);
    if (!mass || !stiffness || !damping) {
      return false;
    }
    Matrix margin = *mass;
    margin.values = 4.0 * mass->values - stiffness->values - 2.0 * damping->values;
    const auto least = [](const Matrix& matrix) {
      return symmetric_eigenpairs(matrix).values.min();
    };
    const double rounding = -1e-12 * largest(mass->values);
    return least(*stiffness) >= rounding && least(*damping) >= rounding && least(margin) >= 0.0;
  }
  static std::optional<Matrix> inverse(const Matrix& matrix) {
    Matrix one(matrix.rows(), matrix.rows());
    for (std::size_t i = 0; i < matrix.rows(); ++i) {
      one(i, i) = 1.0;
    }
    return quotient(one, matrix);
  }

  void write_rows() {
    const std::size_t count = shape_.size();
    made_.count = count;
    made_.pole = row_of([&](std::size_t j) { return less_[j]; });
    made_.start = Vector(2 * count);
    made_.rest = body_.root * rest_;
    for (std::size_t m = 0; m < n_; ++m) {
      const double root = body_.root[m];
      made_.shape.push_back(root * rows_[m]);
      made_.speed.push_back(
          row_of([&](std::size_t j) { return root * shape_[j][m] * less_[j] / (1.0 + less_[j]); }));
      made_.push.push_back(!is_exact_ ? made_.shape.back() : row_of([&](std::size_t j) {
        const Complex held = at_[j] == 0.0 ? 1.0 : less_[j] / at_[j];
        return root * shape_[j][m] * held / (1.0 + less_[j]);
      }));
      const Vector both = worth_[m] + worth_[n_ + m];
      made_.from_position.push_back((worth_[m] - own_k_[m] * both) / root);
      made_.from_velocity.push_back((1.0 - own_z_[m]) / root * both);
      made_.start += program_.position[m] * made_.from_position[m] +
                     program_.velocity[m] * made_.from_velocity[m] - rest_[m] * worth_[m];
    }
  }
  template <class Value>
  Vector row_of(Value&& value) const {
    const std::size_t count = shape_.size();
    Vector row(2 * count);
    for (std::size_t j = 0; j < count; ++j) {
      const Complex number = value(j);
      row[j] = number.real();
      row[count + j] = number.imag();
    }
    return row;
  }

  const Program& program_;
  const LinearBody& body_;
  const bool is_exact_;
  const bool is_held_passively_;
  const std::size_t n_;
  Matrix k_;
  Matrix z_;
  Vector own_k_;  // [mass]
  Vector own_z_;
  Vector rest_;                       // [row]
  std::vector<Complex> at_;           // [mode] s, or p - 1
  std::vector<Complex> less_;         // [mode] p - 1
  std::vector<ComplexVector> plain_;  // [mode] X
  std::vector<ComplexVector> shape_;  // [mode] u, in rows
  std::vector<Vector> rows_;          // [row] u
  std::vector<Vector> worth_;         // [row of positions, then of velocities] in modes
  CrossedModes made_;
};

}  // namespace

std::optional<CrossedModes> crossed_modes(const Program& program, const LinearBody& body,
                                          bool is_exact, bool is_held_passively) {
  return CrossedFinder(program, body, is_exact, is_held_passively).find();
}

}  // namespace ressort::kernels
