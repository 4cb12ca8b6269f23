// tests: profiles of the bells among the models, as solids of revolution. They were found by
// axisymmetric finite elements: starting from a church bell one metre wide, radii and wall
// thicknesses were changed by Newton's method, as little as needed, until hum, prime, tierce, quint
// and nominal were 0.5 : 1 : 1.2 : 1.5 : 2 (ChurchBell) and 0.5 : 1 : 1.25 : 1.5 : 2 (MajorBell);
// likewise from a bell three times as wide, with its twelfth at 3 and its nominal at 261.6 Hz
// (Bourdon), and from a thin cup, until its two lowest partials were 1 : 3 at 392 Hz (HandBell).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tests/support/solids.h"

namespace ressort::support {

// Height, radius of the wall's centre line and thickness, in metres, from the lip to the crown,
// joined by a Catmull-Rom spline.
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

inline const BellProfile bourdon = {{0.0000, 1.6000, 0.1050}, {0.1800, 1.5065, 0.2500},
                                    {0.4600, 1.2614, 0.1746}, {0.8800, 1.0706, 0.1208},
                                    {1.3700, 0.9782, 0.1012}, {1.8500, 0.9154, 0.0966},
                                    {2.2800, 0.8860, 0.1021}, {2.5300, 0.7750, 0.1120},
                                    {2.6100, 0.5100, 0.1120}, {2.6300, 0.1000, 0.1120}};

inline const BellProfile hand_bell = {{0.00000, 0.07400, 0.00318}, {0.00700, 0.07120, 0.00431},
                                      {0.01700, 0.06720, 0.00300}, {0.03400, 0.06025, 0.00223},
                                      {0.05400, 0.05716, 0.00205}, {0.07400, 0.05523, 0.00205},
                                      {0.09200, 0.05262, 0.00242}, {0.10500, 0.04538, 0.00335},
                                      {0.11200, 0.03200, 0.00460}, {0.11400, 0.01000, 0.00500}};

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

// Returns its surface with `pieces` from the lip to the crown and `steps` around.
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

// A partial: its number of nodal meridians, its order among those, and its index in the model.
struct BellPartial {
  int meridians = 2;
  std::size_t from_below = 0;
  std::size_t place = 0;
};

struct Bell {
  const char* name;
  BellProfile profile;
  std::vector<BellPartial> partials;  // The others are relative to the first.
};

// Nominal, hum, prime, tierce, quint and twelfth; for the handbell its six lowest.
inline const std::vector<BellPartial> church_partials = {{4, 0, 4}, {2, 0, 0}, {2, 1, 1},
                                                         {3, 0, 2}, {3, 1, 3}, {5, 0, 7}};
inline const std::vector<BellPartial> hand_partials = {{2, 0, 0}, {3, 0, 1}, {4, 0, 2},
                                                       {3, 1, 3}, {4, 1, 4}, {5, 0, 5}};

inline const std::vector<Bell> bells = {{"ChurchBell", church_bell, church_partials},
                                        {"MajorBell", major_bell, church_partials},
                                        {"Bourdon", bourdon, church_partials},
                                        {"HandBell", hand_bell, hand_partials}};

}  // namespace ressort::support
