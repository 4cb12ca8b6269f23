// core/kernels: the response G of places on macros and of the masses under them to the links of a
// cluster (joint.h): the displacement of one place under a unit force on another. G may be
// singular, since two places may coincide and a body may have fewer modes than places.
#pragma once

#include <algorithm>

#include "core/kernels/passive/joint.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

template <class V>
class Places {
 public:
  // `at`: displacement of each place by the forces so far.
  Places(const std::vector<std::uint32_t>& nodes, V* numbers, V* at, JointBody<V>& body)
      : nodes_(nodes),
        count_(nodes.size()),
        pressed_(numbers),
        give_(pressed_ + count_),
        root_(give_ + count_ * count_),
        product_(root_ + count_ * count_),
        matrix_(product_ + count_ * count_),
        y_(matrix_ + count_ * count_),
        at_(at),
        body_(body) {
    for (std::size_t p = 0; p < count_; ++p) {
      pressed_[p] = V{};
      at_[p] = V{};
    }
  }

  template <class Lanes>
  void rest(Lanes live) {
    for (std::size_t p = 0; p < count_; ++p) {
      pressed_[p] = select(live, V{}, pressed_[p]);
      at_[p] = select(live, V{}, at_[p]);
    }
  }
  void press(std::size_t place, V force) {
    measure();
    pressed_[place] += force;
    const V* const row = give_ + place * count_;
    for (std::size_t p = 0; p < count_; ++p) {
      at_[p] += row[p] * force;
    }
  }
  // Moves each place by the sum of its forces.
  void push() {
    for (std::size_t p = 0; p < count_; ++p) {
      if (any_of(pressed_[p] != V{})) {
        body_.push_node(nodes_[p], pressed_[p]);
      }
    }
  }
  V inertia_along(const V* way) const {
    V sum{};
    for (std::size_t p = 0; p < count_; ++p) {
      sum += way[p] * pressed_[p];
    }
    return sum;
  }

  // Solves w + G A w = G b for w, in place of b; `diagonal` and `below` are those of A >= 0. With G
  // = L L^T and w = L y this becomes (I + L^T A L) y = L^T b, which is positive definite.
  void solve(const V* diagonal, const V* below, V* b) {
    measure();
    if (!is_factorised_) {
      find_root();
    }
    multiply(diagonal, below);
    for (std::size_t i = 0; i < count_; ++i) {
      y_[i] = V{};
      for (std::size_t k = i; k < count_; ++k) {
        y_[i] += root_[k * count_ + i] * b[k];
      }
      for (std::size_t j = 0; j <= i; ++j) {
        V sum{};
        for (std::size_t k = i; k < count_; ++k) {
          sum += root_[k * count_ + i] * product_[k * count_ + j];
        }
        matrix_[i * count_ + j] = i == j ? sum + 1 : sum;
      }
    }
    substitute();
    for (std::size_t i = 0; i < count_; ++i) {
      b[i] = V{};
      for (std::size_t k = 0; k <= i; ++k) {
        b[i] += root_[i * count_ + k] * y_[k];
      }
    }
  }

 private:
  // Computes G once per sample, and not at all if nothing touches.
  void measure() {
    for (std::size_t p = 0; !is_measured_ && p < count_; ++p) {
      for (std::size_t q = 0; q <= p; ++q) {
        give_[p * count_ + q] = give_[q * count_ + p] = body_.give(nodes_[p], nodes_[q]);
      }
    }
    is_measured_ = true;
  }

  // Cholesky factor L of G; columns of places that depend on others are set to 0.
  void find_root() {
    constexpr auto nothing = static_cast<Scalar<V>>(sizeof(Scalar<V>) == 4 ? 1e-5 : 1e-13);
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        V rest = give_[i * count_ + j];
        for (std::size_t k = 0; k < j; ++k) {
          rest -= root_[i * count_ + k] * root_[j * count_ + k];
        }
        if (i == j) {
          const auto moves = rest > nothing * give_[i * count_ + i];
          root_[i * count_ + i] = select(moves, square_root(select(moves, rest, V{})), V{});
        } else {
          const V pivot = root_[j * count_ + j];
          const auto moves = pivot > V{};
          root_[i * count_ + j] = select(moves, rest / select(moves, pivot, V{} + 1), V{});
        }
      }
    }
    is_factorised_ = true;
  }

  // Computes A L.
  void multiply(const V* diagonal, const V* below) {
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        product_[i * count_ + j] = diagonal[i] * root_[i * count_ + j];
      }
      for (std::size_t j = i + 1; j < count_; ++j) {
        product_[i * count_ + j] = V{};
      }
    }
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t k = i + 1; k < count_; ++k) {
        const V entry = *below++;
        for (std::size_t j = 0; j <= i; ++j) {
          product_[k * count_ + j] += entry * root_[i * count_ + j];
        }
        for (std::size_t j = 0; j <= k; ++j) {
          product_[i * count_ + j] += entry * root_[k * count_ + j];
        }
      }
    }
  }

  void substitute() {
    for (std::size_t k = 0; k < count_; ++k) {
      // The pivot is at least 1 in exact arithmetic.
      const V pivot = matrix_[k * count_ + k];
      const V inverse = 1 / select(pivot > V{} + 1, pivot, V{} + 1);
      for (std::size_t i = k + 1; i < count_; ++i) {
        const V share = matrix_[i * count_ + k] * inverse;
        for (std::size_t j = k + 1; j <= i; ++j) {
          matrix_[i * count_ + j] -= share * matrix_[j * count_ + k];
        }
        y_[i] -= share * y_[k];
      }
      for (std::size_t i = k + 1; i < count_; ++i) {
        matrix_[i * count_ + k] *= inverse;
      }
      y_[k] *= inverse;
    }
    for (std::size_t k = count_; k-- > 0;) {
      for (std::size_t i = k + 1; i < count_; ++i) {
        y_[k] -= matrix_[i * count_ + k] * y_[i];
      }
    }
  }

  const std::vector<std::uint32_t>& nodes_;
  std::size_t count_;
  bool is_measured_ = false;
  bool is_factorised_ = false;
  V* pressed_;  // [place] Sum of its forces.
  V* give_;
  V* root_;     // L, below the diagonal.
  V* product_;  // A L.
  V* matrix_;
  V* y_;
  V* at_;
  JointBody<V>& body_;
};

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
