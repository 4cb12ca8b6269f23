// core/identification: sums of damped sinusoids Re(c z^n), and the moments that a fit needs of
// them. All quantities are per sample: log z = -alpha + i omega, with alpha = ln(1000) / (rate T60)
// and omega = 2 pi f / rate. [any thread but audio]
#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "core/rooms.h"

namespace ressort::identification {

using Complex = std::complex<double>;

// Returns a b without the standard library's handling of infinities.
inline Complex times(Complex a, Complex b) {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

// Returns the sum of squares of all samples.
double energy_in(std::span<const std::vector<double>> channels);

// Adds the sum over k of Re(c[k] z[k]^n) to sample n. O(samples until the modes have decayed)
void add_damped(std::span<double> samples, std::span<const Complex> c,
                std::span<const Complex> log_z);

// Sums over all n of x[n] z^n and of n x[n] z^n.
struct Moments {
  Complex zeroth;
  Complex first;
};
std::vector<Moments> moments_of(std::span<const double> samples, std::span<const Complex> log_z);

// Returns the energy of all channels that each mode alone explains, approximated as if it rang for
// ever.
std::vector<double> explained_energies(std::span<const std::vector<double>> channels,
                                       std::span<const Complex> log_z);

// Returns log z of modes of all frequencies and Qs from 2.5 up to a largest one, in steps of a
// ratio and of octaves.
std::vector<Complex> damped_grid(double lowest_omega, double highest_omega, double ratio,
                                 double most_quality);

// The pole z and z^count.
struct Powers {
  Powers(Complex log_z, std::size_t count)
      : z(std::exp(log_z)), last(std::exp(log_z * static_cast<double>(count))) {}
  Powers(Complex first_power, Complex last_power) : z(first_power), last(last_power) {}
  Powers operator*(const Powers& other) const {
    return {times(z, other.z), times(last, other.last)};
  }
  Powers conjugate() const { return {std::conj(z), std::conj(last)}; }

  Complex z;
  Complex last;
};

// Sums over n < count of n^p z^n for p = 0, 1, 2. Uses the closed form, or doubling in O(log count)
// if z is so near 1 that the closed form would lose digits.
struct PowerSums {
  Complex of_power[3];
};
PowerSums power_sums(const Powers& powers, std::size_t count);

}  // namespace ressort::identification
