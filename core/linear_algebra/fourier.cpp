#include "core/linear_algebra/fourier.h"

#include <cassert>
#include <unsupported/Eigen/FFT>

namespace ressort::linear_algebra {

struct Fourier::Library {
  Eigen::FFT<double> fft{Eigen::FFT<double>::impl_type(), Eigen::FFT<double>::HalfSpectrum};
};

Fourier::Fourier(std::size_t size) : size_(size), library_(std::make_unique<Library>()) {
  assert(size >= 2);
}
Fourier::Fourier(Fourier&&) noexcept = default;
Fourier& Fourier::operator=(Fourier&&) noexcept = default;
Fourier::~Fourier() = default;

void Fourier::forward(std::span<const double> x, std::span<std::complex<double>> bins) {
  assert(x.size() == size_ && bins.size() == this->bins());
  library_->fft.fwd(bins.data(), x.data(), static_cast<Eigen::Index>(size_));
}

void Fourier::inverse(std::span<const std::complex<double>> bins, std::span<double> x) {
  assert(x.size() == size_ && bins.size() == this->bins() && size_ % 2 == 0);
  library_->fft.inv(x.data(), bins.data(), static_cast<Eigen::Index>(size_));
}

}  // namespace ressort::linear_algebra
