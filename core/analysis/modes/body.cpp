#include "core/analysis/modes/body.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/analysis/places.h"
#include "core/linear_algebra/matrix.h"
#include "core/model/language/expression.h"
#include "core/ranges.h"

namespace ressort::analysis {
namespace {

// Highest frequency of a mode, relative to the rate; higher modes would alias.
constexpr double highest_share = 0.45;
constexpr double endless_t60_s = 1e9;  // T60 written for an undamped mode of a body.
constexpr double faint = 1e-12;        // Displacements below this share of the largest count as 0.

double rate_of(const NetworkModes& modes) {
  return modes.scheme == ModeScheme::published ? modes.rate_hz : Network::reference_rate_hz;
}

// Stiffness and damping of a single oscillator that has the mode's pole in the published scheme.
struct PolePair {
  double k = 0.0;
  double z = 0.0;
};

double damping_of(double t60_s, double rate_hz) {
  return std::isfinite(t60_s) ? -std::expm1(-6.0 * std::numbers::ln10 / (rate_hz * t60_s)) : 0.0;
}

// Returns the k that gives, with z, this angle per sample, computed without cancellation for small
// angles.
double stiffness_of(double angle, double z) {
  const double r = std::sqrt(1.0 - z);
  const double half = std::sin(0.5 * angle);
  const double lost = z / (1.0 + r);  // 1 - r
  return lost * lost + 4.0 * r * half * half;
}

// Returns the line z = a + b k that fits best in relative error, with a and b not below 0.
PolePair nearest_line(const std::vector<PolePair>& pairs) {
  double ww = 0.0;
  double wk = 0.0;
  double kk = 0.0;
  double wz = 0.0;
  double kz = 0.0;
  for (const PolePair& pair : pairs) {
    const double w = pair.z > 0.0 ? 1.0 / (pair.z * pair.z) : 0.0;
    ww += w;
    wk += w * pair.k;
    kk += w * pair.k * pair.k;
    wz += w * pair.z;
    kz += w * pair.k * pair.z;
  }
  const double area = ww * kk - wk * wk;
  if (!(ww > 0.0)) {
    return {};
  }
  PolePair line{.k = 0.0, .z = wz / ww};
  if (area > 1e-12 * ww * kk) {
    line = {.k = (ww * kz - wk * wz) / area, .z = (kk * wz - wk * kz) / area};
    if (line.k < 0.0) {
      line = {.k = 0.0, .z = wz / ww};
    } else if (line.z < 0.0) {
      line = {.k = kz / kk, .z = 0.0};
    }
  }
  return line;
}

// Tridiagonalises diag(values) by Lanczos from the unit vector `start`, with each vector
// orthogonalised twice against all before it.
struct Tridiagonal {
  std::vector<double> diagonal;
  std::vector<double> beside;  // [row] Element between this row and the next.
};

Tridiagonal tridiagonal_of(const Vector& values, const Vector& start) {
  Tridiagonal out;
  std::vector<Vector> known{start};
  for (std::size_t j = 0; j < values.size(); ++j) {
    Vector next = values * known[j];
    out.diagonal.push_back(dot(known[j], next));
    if (j + 1 == values.size()) {
      break;
    }
    for (int round = 0; round < 2; ++round) {
      for (const Vector& other : known) {
        next -= dot(other, next) * other;
      }
    }
    const double length = std::sqrt(dot(next, next));
    out.beside.push_back(length);
    known.emplace_back(next / length);
  }
  return out;
}

// Returns u of T u = (1, 0, 0, ...), where T has -beside off its diagonal.
std::vector<double> solve_first(const Tridiagonal& t) {
  const std::size_t size = t.diagonal.size();
  std::vector<double> pivot = t.diagonal;  // Filled from the last to the first.
  for (std::size_t i = size - 1; i-- > 0;) {
    pivot[i] -= t.beside[i] * t.beside[i] / pivot[i + 1];
  }
  std::vector<double> u{1.0 / pivot[0]};
  for (std::size_t i = 1; i < size; ++i) {
    u.push_back(u.back() * t.beside[i - 1] / pivot[i]);
  }
  return u;
}

class ChainWriter {
 public:
  explicit ChainWriter(std::string name) : name_(std::move(name)) {}

  void add_mass(double mass, double stiffness, double damping) {
    network_.masses.push_back({.name = name_ + "_m" + std::to_string(network_.masses.size()),
                               .kind = MassKind::oscillator,
                               .mass = network_.add(mass),
                               .stiffness = network_.add(stiffness),
                               .damping = network_.add(damping)});
  }
  void add_spring(std::uint32_t from, double stiffness, double damping) {
    Link link{.name = name_ + "_r" + std::to_string(from), .a = from, .b = from + 1};
    link.arguments[0] = network_.add(stiffness);
    link.arguments[1] = network_.add(damping);
    network_.links.push_back(std::move(link));
  }
  Network take() { return canonical(std::move(network_)); }

 private:
  std::string name_;
  Network network_;
};

}  // namespace

PlacedModes placed_modes(const NetworkModes& modes) {
  PlacedModes out;
  const Network& network = modes.network;
  std::vector<std::uint32_t> masses;
  const auto add = [&](std::uint32_t mass, const std::string& name) {
    if (std::ranges::find(masses, mass) == masses.end()) {
      masses.push_back(mass);
      out.places.push_back(name);
    }
  };
  for (const Input& input : network.inputs) {
    if (input.is_force) {
      add(input.mass, "in" + std::to_string(input.number));
    }
  }
  for (const Output& output : network.outputs) {
    if (!output.is_force) {
      add(output.mass, "out" + std::to_string(output.number));
    }
  }
  std::vector<std::size_t> row(network.masses.size(), modes.system.size());
  for (std::size_t i = 0; i < modes.system.size(); ++i) {
    row[modes.system.masses[i]] = i;
  }
  double largest = 0.0;
  for (const NetworkMode& mode : modes.modes) {
    if (mode.frequency_hz > highest_share * rate_of(modes)) {
      continue;
    }
    PlacedMode& placed = out.modes.emplace_back(PlacedMode{mode.frequency_hz, mode.t60_s, {}});
    for (const std::uint32_t mass : masses) {
      std::complex<double> sum;
      each_share(network, mass, [&](std::uint32_t node, double share) {
        if (row[node] < modes.system.size()) {
          sum += share * mode.shape[row[node]] / modes.system.root[row[node]];
        }
      });
      placed.displacement.push_back(sum.real());
      largest = std::max(largest, std::fabs(sum.real()));
      out.left_out = std::max(out.left_out, std::fabs(sum.imag()) / (1e-300 + std::abs(sum)));
    }
  }
  std::erase_if(out.modes, [&](const PlacedMode& mode) {
    return std::ranges::all_of(mode.displacement,
                               [&](double d) { return std::fabs(d) <= faint * largest; });
  });
  return out;
}

std::string body_text(const PlacedModes& modes) {
  std::string text = "@" + modes.name + " body " + print_number(modes.mass);
  for (const std::string& place : modes.places) {
    text += " " + place;
  }
  text += "\n";
  for (std::size_t i = 0; i < modes.modes.size(); ++i) {
    const PlacedMode& mode = modes.modes[i];
    text += "@" + modes.name + std::to_string(i + 1) + " mode @" + modes.name + " " +
            print_number(mode.frequency_hz) + " " +
            print_number(std::min(mode.t60_s, endless_t60_s));
    for (const double displacement : mode.displacement) {
      text += " " + print_number(displacement);
    }
    text += "\n";
  }
  return text;
}

Result<ModalChain> chain_of(const PlacedModes& modes, std::string_view place) {
  constexpr double rate_hz = Network::reference_rate_hz;
  const auto at = std::ranges::find(modes.places, place);
  if (at == modes.places.end()) {
    return Error{"there is no place '" + std::string(place) + "'; there are " +
                 joined(modes.places, ", ")};
  }
  const auto column = static_cast<std::size_t>(at - modes.places.begin());
  double most = 0.0;
  for (const PlacedMode& mode : modes.modes) {
    most = std::max(most, std::fabs(mode.displacement[column]));
  }
  std::vector<const PlacedMode*> heard;
  for (const PlacedMode& mode : modes.modes) {
    if (std::fabs(mode.displacement[column]) > faint * most) {
      if (!(mode.frequency_hz > 0.0 && mode.frequency_hz < 0.5 * rate_hz)) {
        return Error{"a mode of " + print_number(mode.frequency_hz) +
                     " Hz cannot be one of masses and springs at 44100 Hz"};
      }
      heard.push_back(&mode);
    }
  }
  if (heard.empty()) {
    return Error{"no mode moves the place '" + std::string(place) + "'"};
  }
  const auto angle = [](const PlacedMode& mode) {
    return 2.0 * std::numbers::pi * mode.frequency_hz / rate_hz;
  };
  std::vector<PolePair> pairs;
  for (const PlacedMode* const mode : heard) {
    const double z = damping_of(mode->t60_s, rate_hz);
    pairs.push_back({stiffness_of(angle(*mode), z), z});
  }
  const PolePair line = nearest_line(pairs);
  // Chooses the stiffness that keeps the frequency with the damper that the chain will have.
  Vector values(heard.size());
  Vector start(heard.size());
  ModalChain chain;
  for (std::size_t i = 0; i < heard.size(); ++i) {
    double z = pairs[i].z;
    double k = pairs[i].k;
    for (int round = 0; round < 100; ++round) {
      z = std::clamp(line.z + line.k * k, 0.0, 0.999);
      k = stiffness_of(angle(*heard[i]), z);
    }
    values[i] = k;
    start[i] = std::fabs(heard[i]->displacement[column]);
    if (std::isfinite(heard[i]->t60_s)) {
      const double t60 = std::log1p(-pairs[i].z) / std::log1p(-z);
      chain.worst_t60_percent = std::max(chain.worst_t60_percent, 100.0 * std::fabs(t60 - 1.0));
    }
  }
  const double square = dot(start, start);
  start /= std::sqrt(square);
  const Tridiagonal t = tridiagonal_of(values, start);
  for (const double beside : t.beside) {
    if (!(beside > 1e-13 * values.max())) {
      return Error{"two modes that move '" + std::string(place) + "' have the same frequency"};
    }
  }
  const std::vector<double> u = solve_first(t);
  const double scale = modes.mass / (square * u[0] * u[0]);
  ChainWriter writer(modes.name);
  for (std::size_t i = 0; i < u.size(); ++i) {
    const double mass = scale * u[i] * u[i];
    // Each row of K sums to u T u, so only the first mass is held by the ground.
    const double held = i == 0 ? scale * u[0] : 0.0;
    writer.add_mass(mass, held, line.z * mass + line.k * held);
  }
  for (std::size_t i = 0; i + 1 < u.size(); ++i) {
    const double k = scale * u[i] * t.beside[i] * u[i + 1];
    writer.add_spring(static_cast<std::uint32_t>(i), k, line.k * k);
  }
  chain.network = writer.take();
  return chain;
}

}  // namespace ressort::analysis
