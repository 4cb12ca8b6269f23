#include "tests/support/networks/reference_network.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/laws/laws.h"

namespace ressort::reference {
namespace {

class Builder {
 public:
  Builder(const Network& network, std::span<const double> parameters) : network_(network) {
    for (std::size_t i = 0; i < network.arguments.size(); ++i) {
      made_.arguments.push_back(&simulator_.number(0));
    }
    made_.set_parameters(network, parameters);
    zero_ = &simulator_.number(0);
  }

  Simulation build() {
    for (const Macro& macro : network_.macros) {
      add_macro(macro);
    }
    for (const Mass& mass : network_.masses) {
      add_mass(mass);
    }
    for (const Link& link : network_.links) {
      add_link(link);
    }
    for (const Input& input : network_.inputs) {
      if (input.is_force) {
        simulator_.add_force_input(*points_[input.mass]);
      } else {
        simulator_.add_position_input(*driven_[input.mass]);
      }
    }
    std::vector<const Output*> channels(static_cast<std::size_t>(output_count(network_)), nullptr);
    for (const Output& output : network_.outputs) {
      channels[static_cast<std::size_t>(output.number - 1)] = &output;
    }
    for (const Output* const output : channels) {
      simulator_.add_output(output == nullptr ? nullptr : points_[output->mass],
                            output != nullptr && output->is_force);
    }
    return std::move(made_);
  }

 private:
  struct Grid {
    std::size_t rows = 1;
    std::size_t columns = 1;
    std::vector<Point*> nodes;  // Row by row.
    std::vector<Real> shapes;   // mode shapes of a body, [place][mode]
  };

  Number number(ArgumentId id) const { return id == no_argument ? zero_ : made_.arguments[id]; }

  // X[-1] of a node that starts at x0.
  Real delayed(double x0, double third) const {
    return network_.third == ThirdArgument::delayed_position ? Real{third}
                                                             : Real{x0} - Real{third} / 44100;
  }

  static bool is_fixed(const Macro& macro, std::size_t i, std::size_t j) {
    const bool outer_row = i == 0 || i == macro.length - 1;
    const bool outer_column = j == 0 || j == macro.width - 1;
    switch (macro.kind) {
      case MacroKind::chain:
      case MacroKind::mesh:
      case MacroKind::body:
      case MacroKind::waveguide:  // The reference simulator has no waveguides or modal strings.
      case MacroKind::modal_string:
      case MacroKind::open_waveguide:
        return false;
      case MacroKind::string:
      case MacroKind::stiff_string:
        return outer_row;
      case MacroKind::closed_mesh:
        return outer_row || outer_column;
      case MacroKind::corner_mesh:
        return outer_row && outer_column;
    }
    return false;
  }

  void add_body(std::size_t index, const Macro& macro) {
    Grid grid{macro.places.size(), 1, {}, {}};
    std::vector<const BodyMode*> modes;
    for (const BodyMode& mode : network_.modes) {
      if (mode.macro == index) {
        modes.push_back(&mode);
        grid.nodes.push_back(&simulator_.add_resonator(
            number(macro.mass), number(mode.frequency_hz), number(mode.t60_s)));
      }
    }
    for (std::size_t place = 0; place < macro.places.size(); ++place) {
      for (const BodyMode* const mode : modes) {
        grid.shapes.push_back(mode->shape[place]);
      }
    }
    grids_.push_back(std::move(grid));
  }

  void add_macro(const Macro& macro) {
    if (macro.kind == MacroKind::body) {
      return add_body(grids_.size(), macro);
    }
    Grid grid{macro.length, macro.width, {}};
    for (std::size_t i = 0; i < grid.rows; ++i) {
      for (std::size_t j = 0; j < grid.columns; ++j) {
        grid.nodes.push_back(
            is_fixed(macro, i, j)
                ? &simulator_.add_ground(macro.position)
                : &simulator_.add_oscillator(number(macro.mass), zero_, number(macro.air_damping),
                                             macro.position, delayed(macro.position, macro.third)));
      }
    }
    const Number k = number(macro.stiffness);
    const Number z = number(macro.damping);
    for (std::size_t node = 0; node < grid.nodes.size(); ++node) {
      if (node % grid.columns + 1 < grid.columns) {
        simulator_.add_spring(*grid.nodes[node], *grid.nodes[node + 1], k, z);
      }
      if (node + grid.columns < grid.nodes.size()) {
        simulator_.add_spring(*grid.nodes[node], *grid.nodes[node + grid.columns], k, z);
      }
    }
    if (macro.kind == MacroKind::stiff_string) {
      // Every second node, from one before the first to one after the last. Both ends repeat the
      // index, so that K2 there acts on the neighbour.
      const auto last = static_cast<std::ptrdiff_t>(grid.rows) - 1;
      for (std::ptrdiff_t middle = 0; middle <= last; ++middle) {
        const auto below = static_cast<std::size_t>(std::max<std::ptrdiff_t>(middle - 1, 0));
        const auto above = static_cast<std::size_t>(std::min(middle + 1, last));
        simulator_.add_spring(*grid.nodes[below], *grid.nodes[above],
                              number(macro.second_stiffness), zero_);
      }
    }
    grids_.push_back(std::move(grid));
  }

  void add_mass(const Mass& mass) {
    const Real x0 = mass.position;
    const Real x1 = delayed(mass.position, mass.third);
    PositionInput* hand = nullptr;
    switch (mass.kind) {
      case MassKind::mass:
        points_.push_back(&simulator_.add_mass(number(mass.mass), x0, x1));
        break;
      case MassKind::oscillator:
        points_.push_back(&simulator_.add_oscillator(number(mass.mass), number(mass.stiffness),
                                                     number(mass.damping), x0, x1));
        break;
      case MassKind::ground:
        points_.push_back(&simulator_.add_ground(x0));
        break;
      case MassKind::position:
        hand = &simulator_.add_position_point(x0);
        points_.push_back(hand);
        break;
      case MassKind::junction:  // Only in expanded networks.
        break;
      case MassKind::point: {
        const Tap& tap = network_.taps[mass.tap];
        const Grid& grid = grids_[tap.macro];
        points_.push_back(&simulator_.add_macro_point(grid.nodes, grid.rows, grid.columns,
                                                      number(tap.u), number(tap.v), grid.shapes));
        break;
      }
    }
    driven_.push_back(hand);
    if (mass.gravity != no_argument) {
      simulator_.add_gravity(*points_.back(), number(mass.gravity),
                             mass.gravity_per_rate ? Real{44100} : Real{1});
    }
  }

  void add_link(const Link& link) {
    Point& a = *points_[link.a];
    Point& b = *points_[link.b];
    std::array<Number, most_law_arguments> n;
    std::transform(link.arguments.begin(), link.arguments.end(), n.begin(),
                   [&](ArgumentId id) { return number(id); });
    switch (link.law) {
      case Law::spring:
        return simulator_.add_spring(a, b, n[0], n[1]);
      case Law::quadratic_spring:
        return simulator_.add_nonlinear_spring(a, b, n[0], n[1], n[2], false);
      case Law::cubic_spring:
        return simulator_.add_nonlinear_spring(a, b, n[0], n[1], n[2], true);
      case Law::clipped_spring:
        return simulator_.add_clipped_spring(a, b, n[0], n[1], n[2], n[3]);
      case Law::pluck:
        return simulator_.add_pluck(a, b, n[0], n[1], n[2]);
      case Law::bow:
        return simulator_.add_bow(a, b, n[0], n[1]);
      case Law::smooth_bow:
        return simulator_.add_smooth_bow(a, b, n[0], n[1]);
      case Law::either_bow:
        return simulator_.add_either_bow(a, b, n[0], n[1], n[2]);
      case Law::contact:
        return simulator_.add_contact(a, b, n[0], n[1], n[2]);
      case Law::clipped_contact:
        return simulator_.add_clipped_contact(a, b, n[0], n[1], n[2], n[3], n[4]);
      case Law::power_contact:
        return simulator_.add_power_contact(a, b, n[0], n[1], n[2], n[3]);
    }
  }

  const Network& network_;
  Simulation made_;
  Simulator& simulator_ = made_.simulator;
  Number zero_ = nullptr;
  std::vector<Grid> grids_;             // [macro]
  std::vector<Point*> points_;          // [mass]
  std::vector<PositionInput*> driven_;  // [mass] Null if it is not driven.
};

}  // namespace

void Simulation::set_parameters(const Network& network, std::span<const double> values) {
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    *arguments[i] = argument_value(network, static_cast<ArgumentId>(i), values);
  }
}

Simulation make_simulation(const Network& network, std::span<const double> parameters) {
  return Builder(network, parameters).build();
}

}  // namespace ressort::reference
