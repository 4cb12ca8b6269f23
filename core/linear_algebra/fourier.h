// core/linear_algebra: the discrete Fourier transform of real numbers; fourier.cpp alone includes
// the library, Eigen's kissfft. [any thread but audio]
#pragma once

#include <complex>
#include <cstddef>
#include <memory>
#include <span>

#include "core/rooms.h"

namespace ressort::linear_algebra {

// Of one size, for which it keeps its roots of unity. O(size log size) where that has small factors
// alone, else more, up to size^2 of a prime.
class Fourier {
 public:
  explicit Fourier(std::size_t size);  // from 2 on
  Fourier(Fourier&&) noexcept;
  Fourier& operator=(Fourier&&) noexcept;
  ~Fourier();

  std::size_t size() const { return size_; }
  std::size_t bins() const { return size_ / 2 + 1; }
  // X[k] = sum of x[n] e^(-2 pi i k n / size), for k < bins(): the others are their conjugates.
  void forward(std::span<const double> x, std::span<std::complex<double>> bins);
  // The x that has these bins, an even number of samples.
  void inverse(std::span<const std::complex<double>> bins, std::span<double> x);

 private:
  struct Library;
  std::size_t size_;
  std::unique_ptr<Library> library_;
};

}  // namespace ressort::linear_algebra
