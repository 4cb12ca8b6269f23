// core/identification: sums of damped sinusoids, Re(c z^n), and the few things that a fit asks of
// them. Everything is per sample: log z = -alpha + i omega, with alpha = ln(1000) / (rate T60) and
// omega = 2 pi f / rate. [any thread but audio]
#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

namespace ressort {

using Complex = std::complex<double>;

// Adds Re(c z^n) to sample n. O(samples until it has died away)
void add_damped(std::span<double> samples, Complex c, Complex log_z);

// The sums over all n of x[n] z^n and of n x[n] z^n.
struct Moments {
  Complex zeroth;
  Complex first;
};
Moments moments_of(std::span<const double> samples, Complex log_z);

// The sums over n < count of n^p z^n for p = 0, 1, 2, by doubling: exact to rounding however near
// z is to 1. O(log count)
struct PowerSums {
  Complex of_power[3];
};
PowerSums power_sums(Complex log_z, std::size_t count);

}  // namespace ressort
