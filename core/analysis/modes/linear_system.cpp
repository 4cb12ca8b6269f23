#include "core/analysis/modes/linear_system.h"

#include <algorithm>
#include <cmath>

#include "core/analysis/assembly.h"
#include "core/analysis/linear.h"
#include "core/analysis/places.h"
#include "core/sampled_mode.h"

namespace ressort::analysis {
namespace {

class SystemMaker {
 public:
  SystemMaker(const Network& network, double step, bool is_sampled, double key_factor)
      : network_(network),
        step_(step),
        is_sampled_(is_sampled),
        key_factor_(key_factor),
        row_(network.masses.size(), held_row) {}

  LinearSystem make() {
    const Assembly assembly = assemble(network_);
    made_.masses = assembly.masses;
    made_.is_linear = is_linear(network_);
    for (std::uint32_t row = 0; row < made_.masses.size(); ++row) {
      row_[made_.masses[row]] = row;
      const double mass = value(network_.masses[made_.masses[row]].mass);
      made_.is_sound = made_.is_sound && mass > 0.0 && std::isfinite(mass);
      made_.root.push_back(std::sqrt(mass));
    }
    for (const Assembly::Term& term : assembly.terms) {
      if (term.is_passive) {
        continue;
      }
      const auto [k, z] = numbers_of(term);
      made_.is_sound = made_.is_sound && std::isfinite(k) && std::isfinite(z);
      const auto first = static_cast<std::uint32_t>(made_.shares.size());
      for (const Assembly::Entry& entry : assembly.of(term)) {
        made_.shares.emplace_back(entry.row, entry.share * (1.0 / made_.root[entry.row]));
      }
      made_.springs.push_back({.first = first,
                               .count = term.count,
                               .element = term.element,
                               .is_link = term.is_link,
                               .stiffness = k,
                               .damping = z});
    }
    make_ports();
    return std::move(made_);
  }

 private:
  double value(ArgumentId id) const { return argument_value(network_, id, {}); }

  std::pair<double, double> per_step(ArgumentId stiffness, ArgumentId damping,
                                     bool is_fixed) const {
    return {value(stiffness) * (is_fixed ? 1.0 : key_factor_) * step_ * step_,
            value(damping) * step_};
  }

  std::pair<double, double> numbers_of(const Assembly::Term& term) const {
    if (term.is_link) {
      const Link& link = network_.links[term.element];
      const LinearPart part = linear_part(link);
      return per_step(part.stiffness, part.damping, link.is_fixed);
    }
    const Mass& mass = network_.masses[term.element];
    const auto [k, z] = per_step(mass.stiffness, mass.damping, mass.is_fixed);
    if (!mass.is_mode || !is_sampled_) {
      return {k, z};
    }
    const double m = value(mass.mass);
    const SampledMode sampled = sampled_mode(1.0, k / m, z / m);
    return {m * sampled.stiffness / sampled.mass, m * sampled.damping / sampled.mass};
  }

  void add(ModalPort::Shares& shares, std::uint32_t mass, double factor) const {
    each_share(network_, mass, [&](std::uint32_t node, double share) {
      if (row_[node] != held_row) {
        shares.emplace_back(row_[node], factor * share / made_.root[row_[node]]);
      }
    });
  }

  // Returns the weight of a link's end at a node: 1, or the weights of a place.
  double part_of(std::uint32_t end, std::uint32_t node) const {
    double part = 0.0;
    each_share(network_, end,
               [&](std::uint32_t at, double share) { part += at == node ? share : 0.0; });
    return part;
  }

  // Collects the force of every link at a node as a function of the motion of its ends, including
  // the force of a driven input there.
  void collect_forces(ModalPort& port, std::uint32_t node, double weight) const {
    for (const Link& link : network_.links) {
      const double at = link.a == link.b ? 0.0 : part_of(link.a, node) - part_of(link.b, node);
      if (at != 0.0) {
        const LinearPart part = linear_part(link);
        const auto [pull, rub] = per_step(part.stiffness, part.damping, link.is_fixed);
        const double k = -weight * at * pull;
        const double z = -weight * at * rub;
        add(port.stiff, link.a, k);
        add(port.stiff, link.b, -k);
        add(port.damped, link.a, z);
        add(port.damped, link.b, -z);
      }
    }
  }

  void make_ports() {
    for (const Input& input : network_.inputs) {
      ModalPort& port = made_.inputs.emplace_back();
      if (input.is_force) {
        add(port.direct, input.mass, step_);  // Gives the same momentum at every rate.
      } else {
        collect_forces(port, input.mass,
                       1.0);  // K between the driven input and the rows is symmetric.
      }
    }
    const Output* before = nullptr;
    for (const Output& output : network_.outputs) {
      if (before == nullptr || output.number != before->number) {
        made_.outputs.emplace_back();
      }
      before = &output;
      ModalPort& port = made_.outputs.back();
      const double level = level_value(network_, output, {});
      if (output.is_force) {
        each_share(network_, output.mass, [&](std::uint32_t node, double share) {
          collect_forces(port, node, level * share / (step_ * step_));
        });
      } else {
        add(port.direct, output.mass, level);
      }
    }
  }

  const Network& network_;
  double step_;
  bool is_sampled_;
  double key_factor_;
  std::vector<std::uint32_t> row_;  // [mass]
  LinearSystem made_;
};

SparseMatrix matrix_of(const LinearSystem& system, double ModalSpring::*number,
                       std::span<const double> factors) {
  std::vector<SparseMatrix::Element> elements;
  elements.reserve(2 * system.springs.size() + system.size());
  std::vector<double> diagonal(system.size());
  for (std::size_t s = 0; s < system.springs.size(); ++s) {
    const ModalSpring& spring = system.springs[s];
    const double w = spring.*number * (factors.empty() ? 1.0 : factors[s]);
    const auto shares = system.of(spring);
    for (std::size_t p = 0; p < shares.size(); ++p) {
      diagonal[shares[p].first] += w * shares[p].second * shares[p].second;
      for (std::size_t q = 0; q < p; ++q) {
        if (w == 0.0) {
          continue;
        }
        const auto i = static_cast<int>(shares[p].first);
        const auto j = static_cast<int>(shares[q].first);
        elements.push_back(
            {std::max(i, j), std::min(i, j), w * shares[p].second * shares[q].second});
      }
    }
  }
  for (std::size_t i = 0; i < diagonal.size(); ++i) {
    elements.push_back({static_cast<int>(i), static_cast<int>(i), diagonal[i]});
  }
  return {static_cast<int>(system.size()), elements};
}

}  // namespace

SparseMatrix LinearSystem::stiffness(std::span<const double> factors) const {
  return matrix_of(*this, &ModalSpring::stiffness, factors);
}

SparseMatrix LinearSystem::damping(std::span<const double> factors) const {
  return matrix_of(*this, &ModalSpring::damping, factors);
}

Network evaluated(const Network& network, std::span<const double> parameters) {
  Network out = network;
  for (Formula& formula : out.arguments) {
    formula = {{.op = Op::number, .value = evaluate(formula, parameters)}};
  }
  return out;
}

LinearSystem make_linear_system(const Network& network, double step, bool is_sampled,
                                double key_factor) {
  return SystemMaker(network, step, is_sampled, key_factor).make();
}

Vector product(const SparseMatrix& lower, const Vector& x) {
  Vector y(x.size());
  multiply(lower, std::begin(x), std::begin(y));
  return y;
}

void multiply(const SparseMatrix& lower, const double* x, double* y) {
  std::fill_n(y, lower.size(), 0.0);
  for (std::size_t column = 0; column + 1 < lower.first.size(); ++column) {
    auto i = static_cast<std::size_t>(lower.first[column]);
    const auto end = static_cast<std::size_t>(lower.first[column + 1]);
    double sum = lower.value[i] * x[column];  // The diagonal element comes first.
    for (++i; i < end; ++i) {
      const auto row = static_cast<std::size_t>(lower.row[i]);
      y[row] += lower.value[i] * x[column];
      sum += lower.value[i] * x[row];
    }
    y[column] += sum;
  }
}

}  // namespace ressort::analysis
