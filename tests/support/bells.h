// tests: the profiles of the church bells among the models, as solids of revolution. They were
// found by axisymmetric finite elements: from that of a swinging bell a metre wide, radii and walls
// were changed by Newton's method, as little as needed, until hum, prime, tierce, quint and nominal
// were 0.5 : 1 : 1.2 : 1.5 : 2 (ChurchBell) and 0.5 : 1 : 1.25 : 1.5 : 2 (MajorBell).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tests/support/solids.h"

namespace ressort::support {

// Height, radius of the wall's middle and its thickness, in metres, from the lip to the crown; a
// Catmull-Rom spline goes through them.
using BellProfile = std::vector<std::array<double, 3>>;

inline const BellProfile church_bell = {{0.0000, 0.4920, 0.0300}, {0.0550, 0.4620, 0.0729},
                                        {0.1400, 0.3860, 0.0575}, {0.2700, 0.3307, 0.0403},
                                        {0.4200, 0.2979, 0.0304}, {0.5700, 0.2769, 0.0296},
                                        {0.7000, 0.2714, 0.0323}, {0.7750, 0.2350, 0.0340},
                                        {0.8000, 0.1550, 0.0340}, {0.8050, 0.0300, 0.0340}};

inline const BellProfile major_bell = {{0.0000, 0.4920, 0.0300}, {0.0550, 0.4620, 0.0703},
                                       {0.1400, 0.3748, 0.0564}, {0.2700, 0.3417, 0.0405},
                                       {0.4200, 0.3254, 0.0314}, {0.5700, 0.2664, 0.0305},
                                       {0.7000, 0.2655, 0.0324}, {0.7750, 0.2350, 0.0340},
                                       {0.8000, 0.1550, 0.0340}, {0.8050, 0.0300, 0.0340}};

inline std::array<double, 3> along_bell(const BellProfile& profile, double s) {
  const auto last = static_cast<int>(profile.size()) - 1;
  const int i = std::min(static_cast<int>(s), last - 1);
  const double u = s - i;
  std::array<double, 3> at{};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto knot = [&](int j) {
      const auto inside = static_cast<std::size_t>(std::clamp(j, 0, last));
      const std::size_t inner = j < 0 ? 1 : static_cast<std::size_t>(last) - 1;
      return j == static_cast<int>(inside) ? profile[inside][k]
                                           : 2.0 * profile[inside][k] - profile[inner][k];
    };
    const double a = knot(i - 1);
    const double b = knot(i);
    const double c = knot(i + 1);
    const double d = knot(i + 2);
    at[k] = b + 0.5 * u * (c - a + u * (2 * a - 5 * b + 4 * c - d + u * (3 * (b - c) + d - a)));
  }
  return at;
}

// Its surface, with so many pieces from the lip to the crown and around.
inline Surface bell_surface(const BellProfile& profile, int pieces, int steps) {
  const double last = static_cast<double>(profile.size()) - 1.0;
  std::vector<std::array<double, 2>> outside;
  std::vector<std::array<double, 2>> inside;
  for (int i = 0; i <= pieces; ++i) {
    const double s = last * i / pieces;
    const auto [z, r, wall] = along_bell(profile, s);
    const auto before = along_bell(profile, std::max(0.0, s - 1e-4));
    const auto after = along_bell(profile, std::min(last, s + 1e-4));
    const double dz = after[0] - before[0];
    const double dr = after[1] - before[1];
    const double half = 0.5 * wall / std::hypot(dz, dr);
    outside.push_back({r + half * dz, z - half * dr});
    inside.push_back({r - half * dz, z + half * dr});
  }
  std::vector<std::array<double, 2>> around = outside;
  around.insert(around.end(), inside.rbegin(), inside.rend());
  around.push_back(around.front());
  return revolved(around, steps);
}

inline const std::array<std::pair<const char*, BellProfile>, 2> bells = {
    {{"ChurchBell", church_bell}, {"MajorBell", major_bell}}};

}  // namespace ressort::support
