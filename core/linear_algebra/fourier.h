// core/linear_algebra: discrete Fourier transform of real signals. Only fourier.cpp includes the
// library, Eigen's kissfft. [any thread but audio]
#pragma once

#include <complex>
#include <cstddef>
#include <memory>
#include <span>

#include "core/rooms.h"

namespace ressort::linear_algebra {

// A transform of one size that keeps its twiddle factors. O(size log size) for sizes with small
// prime factors, up to O(size^2) for a prime.
class Fourier {
 public:
  explicit Fourier(std::size_t size);  // At least 2.
  Fourier(Fourier&&) noexcept;
  Fourier& operator=(Fourier&&) noexcept;
  ~Fourier();

  std::size_t size() const { return size_; }
  std::size_t bins() const { return size_ / 2 + 1; }
  // Computes X[k] = sum of x[n] e^(-2 pi i k n / size) for k < bins(); the other bins are
  // conjugates.
  void forward(std::span<const double> x, std::span<std::complex<double>> bins);
  // Computes the signal with these bins. Its number of samples is even.
  void inverse(std::span<const std::complex<double>> bins, std::span<double> x);

 private:
  struct Library;
  std::size_t size_;
  std::unique_ptr<Library> library_;
};

}  // namespace ressort::linear_algebra
