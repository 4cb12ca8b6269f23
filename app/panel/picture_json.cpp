#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>

#include "app/panel/picture.h"
#include "core/analysis/modes/layout.h"
#include "core/analysis/modes/modes.h"
#include "core/compile/instrument.h"
#include "core/laws/law.h"
#include "core/model/topology.h"

namespace ressort::panel {
namespace {

using nlohmann::json;

constexpr std::size_t most_still = 4000;  // Limit on fixed nodes.
constexpr std::size_t most_lines = 12'000;
constexpr std::uint32_t nowhere = 0xffffffffu;

// Returns the group of laws that have the same colour on the page.
const char* kind_of(const LawFacts& law) {
  return law.is_friction      ? "bow"
         : law.is_spring()    ? "spring"
         : law.is_one_sided() ? "contact"
                              : "pluck";
}

class NetworkJsonWriter {
 public:
  explicit NetworkJsonWriter(const Picture& picture)
      : picture_(picture),
        network_(expand_macros(*picture.network)),
        parameters_(parameter_values(network_)),
        node_(network_.masses.size(), nowhere) {}

  std::string write() {
    lay_out();
    add_nodes();
    place_hands();
    json links = json::array();
    for (const Picture::Group& group : picture_.groups) {
      for (const Picture::Waveguide& waveguide : group.waveguides) {
        add_waveguide(waveguide, links);
      }
    }
    for (const Link& link : network_.links) {
      const std::uint32_t a = node_of(link.a);
      const std::uint32_t b = node_of(link.b);
      if (a != nowhere && b != nowhere && a != b && links.size() < most_lines) {
        links.push_back(line_of(link, a, b));
      }
    }
    json laws = json::array();
    for (const LawFacts& facts : law_table()) {
      laws.push_back({facts.one, kind_of(facts)});
    }
    json inputs = json::array();
    for (const Input& input : network_.inputs) {
      inputs.push_back({input.number, shown(node_of(input.mass)), input.is_force});
    }
    json outputs = json::array();
    for (const Output& output : network_.outputs) {
      outputs.push_back({output.number, shown(node_of(output.mass))});
    }
    const json out{{"picture", picture_.number},
                   {"dots", picture_.masses.size()},
                   {"masses", moving_count(network_)},
                   {"plane", is_plane_},
                   {"drawn", is_laid_out_},
                   {"x", x_},
                   {"y", y_},
                   {"start", start_},
                   {"names", names_},
                   {"kinds", kinds_},
                   {"links", std::move(links)},
                   {"laws", std::move(laws)},
                   {"users", users()},
                   {"wide", wide_},
                   {"bodies", bodies()},
                   {"inputs", std::move(inputs)},
                   {"outputs", std::move(outputs)}};
    return out.dump(-1, ' ', false, json::error_handler_t::replace);
  }

 private:
  void lay_out() {
    at_.resize(network_.masses.size());
    const bool has_row_only = picture_.network->macros.empty();
    const MassLayout layout = layout_of(*picture_.network);
    is_plane_ = layout.is_plane;
    for (const auto& row : layout.rows) {
      for (const LayoutPoint& point : row) {
        at_[point.mass] = point;
        wide_ = std::max(wide_, point.x);
      }
    }
    tops_ = layout.tops;
    const std::vector<Mass>& written = picture_.network->masses;
    for (std::uint32_t i = 0; i < written.size(); ++i) {
      if (written[i].kind == MassKind::point) {
        at_[i] = point_of(picture_.network->taps[written[i].tap], i);
      }
    }
    is_laid_out_ = is_plane_ || !has_row_only || is_chain(layout);
  }

  // A place on a string lies on its line. The page knows where the places of a body are.
  std::optional<LayoutPoint> point_of(const Tap& tap, std::uint32_t mass) const {
    const MacroKind kind = picture_.network->macros[tap.macro].kind;
    if (!is_waveguide(kind) && kind != MacroKind::modal_string) {
      return std::nullopt;
    }
    const double u = is_bridge(*picture_.network, tap)
                         ? 1.0
                         : std::clamp(argument_value(network_, tap.u, parameters_), 0.0, 1.0);
    return LayoutPoint{wide_ * u, tops_[tap.macro], mass};
  }

  // A single row is a chain only if neighbours are linked; otherwise the positions are unknown.
  bool is_chain(const MassLayout& layout) const {
    if (layout.rows.size() != 1) {
      return false;
    }
    std::vector<std::size_t> place(network_.masses.size(), 0);
    for (std::size_t i = 0; i < layout.rows[0].size(); ++i) {
      place[layout.rows[0][i].mass] = i;
    }
    const auto masses = layout.rows[0].size();
    std::size_t neighbours = 0;
    for (const Link& link : network_.links) {
      const std::size_t a = place[link.a];
      const std::size_t b = place[link.b];
      neighbours += a + 1 == b || b + 1 == a ? 1 : 0;
    }
    return 10 * neighbours >= 9 * (masses - 1);
  }

  void add_node(std::uint32_t mass, double start) {
    const Mass& of = network_.masses[mass];
    node_[mass] = static_cast<std::uint32_t>(x_.size());
    add_node(at_[mass], start, struck_name(*picture_.network, mass),
             of.kind == MassKind::ground     ? 'g'
             : of.kind == MassKind::position ? 'h'
             : of.is_mode                    ? 'o'
                                             : 'm');
    if (of.kind == MassKind::point) {
      place_on_body_.emplace(names_.back(), node_[mass]);
    }
  }
  void add_node(const std::optional<LayoutPoint>& point, double start, const std::string& name,
                char kind) {
    x_.push_back(point ? json(rounded(point->x)) : json());
    y_.push_back(point ? json(rounded(point->y)) : json());
    start_.push_back(start);
    names_.push_back(name);
    kinds_ += kind;
  }

  // Returns the line of a waveguide through its points and places.
  void add_waveguide(const Picture::Waveguide& waveguide, json& lines) const {
    std::vector<std::pair<double, std::size_t>> line;  // Pairs of u and node.
    for (std::size_t i = 0; i < Engine::waveguide_points; ++i) {
      line.emplace_back(static_cast<double>(i) / (Engine::waveguide_points - 1.0),
                        waveguide.first + i);
    }
    for (const Picture::Waveguide::Place& place : waveguide.places) {
      line.emplace_back(place.u, place.dot);
    }
    std::ranges::sort(line);
    for (std::size_t i = 1; i < line.size(); ++i) {
      lines.push_back({line[i - 1].second, line[i].second, static_cast<int>(linear_law)});
    }
  }

  // Returns what consists of modes: bodies and modal strings.
  json bodies() const {
    const Network& network = *picture_.network;
    json found = json::array();
    for (std::uint32_t i = 0; i < network.macros.size(); ++i) {
      const Macro& macro = network.macros[i];
      json modes = json::array();
      for (const BodyMode& mode : network.modes) {
        if (mode.macro == i) {
          modes.push_back(mode.shape);
        }
      }
      if (consists_of_modes(macro.kind)) {
        found.push_back({{"name", macro.name},
                         {"strings", macro.kind == MacroKind::modal_string ? macro.width : 0},
                         {"places", macro.places},
                         {"modes", modes}});
      }
    }
    return found;
  }

  // Returns for each parameter the first link or macro that uses it, and the number of users.
  json users() const {
    const Network& network = *picture_.network;
    std::vector<std::pair<std::string, std::size_t>> users(network.parameters.size());
    const auto count = [&](const std::string& name, std::span<const ArgumentId> arguments) {
      std::set<std::size_t> seen;
      for (const ArgumentId argument : arguments) {
        for (const Step& step : argument != no_argument ? network.arguments[argument] : Formula()) {
          if (step.op == Op::parameter && seen.insert(step.index).second) {
            auto& [first, uses] = users[step.index];
            first = uses++ == 0 ? name : first;
          }
        }
      }
    };
    for (const Link& link : network.links) {
      count(link.name.text(), link.arguments);
    }
    for (const Macro& macro : network.macros) {
      std::vector<ArgumentId> arguments;
      for (const ArgumentId* const argument : arguments_of(macro)) {
        arguments.push_back(*argument);
      }
      count(macro.name, arguments);
    }
    json out = json::object();
    for (std::size_t i = 0; i < users.size(); ++i) {
      if (users[i].second > 0) {
        out[network.parameters[i].name] = {users[i].first, users[i].second};
      }
    }
    return out;
  }

  void add_nodes() {
    std::map<std::size_t, const Picture::Waveguide*> waveguides;  // Keyed by their first dot.
    for (const Picture::Group& group : picture_.groups) {
      for (const Picture::Waveguide& waveguide : group.waveguides) {
        waveguides.emplace(waveguide.first, &waveguide);
      }
    }
    for (std::size_t i = 0; i < picture_.masses.size(); ++i) {
      if (picture_.masses[i] != Picture::no_mass) {
        add_node(picture_.masses[i], picture_.start[i]);
        continue;
      }
      const auto& [first, waveguide] = *std::prev(waveguides.upper_bound(i));
      const double u = static_cast<double>(i - first) / (Engine::waveguide_points - 1.0);
      add_node(LayoutPoint{wide_ * u, tops_[waveguide->macro], Picture::no_mass}, picture_.start[i],
               "", 'w');
    }
    std::vector<bool> is_tied(network_.masses.size(), false);
    for (const Link& link : network_.links) {
      is_tied[link.a] = is_tied[link.b] = true;
    }
    const bool has_all = picture_.masses.size() + most_still >= network_.masses.size();
    for (std::uint32_t mass = 0; has_all && mass < network_.masses.size(); ++mass) {
      const Mass& of = network_.masses[mass];
      if (node_[mass] == nowhere && of.kind != MassKind::point && of.kind != MassKind::junction &&
          is_tied[mass] && (at_[mass] || mass < picture_.network->masses.size())) {
        add_node(mass, of.position);
      }
    }
  }

  // Places a driven input in the middle of the nodes that it is linked to.
  void place_hands() {
    std::map<std::uint32_t, std::vector<std::uint32_t>> touched;
    for (const Link& link : network_.links) {
      const std::uint32_t a = node_of(link.a);
      const std::uint32_t b = node_of(link.b);
      if (a != nowhere && b != nowhere) {
        (x_[a].is_null() ? touched[a] : touched[b]).push_back(x_[a].is_null() ? b : a);
      }
    }
    for (const auto& [hand, nodes] : touched) {
      double x = 0.0;
      double y = 0.0;
      double count = 0.0;
      for (const std::uint32_t node : nodes) {
        if (!x_[node].is_null()) {
          x += x_[node].get<double>();
          y += y_[node].get<double>();
          ++count;
        }
      }
      if (x_[hand].is_null() && count > 0.0) {
        x_[hand] = x / count;
        y_[hand] = y / count;
      }
    }
  }

  // Returns the node nearest to a place on a macro.
  std::uint32_t node_of(std::uint32_t mass) const {
    if (network_.masses[mass].kind != MassKind::point) {
      return node_[mass];
    }
    const Tap& tap = network_.taps[network_.masses[mass].tap];
    if (tap.places > 0 || tap.length == 0 || tap.width == 0) {
      const auto place = place_on_body_.find(struck_name(*picture_.network, mass));
      return place != place_on_body_.end() ? place->second : nowhere;
    }
    const auto nearest = [&](ArgumentId argument, std::uint32_t count) {
      const double at = std::clamp(argument_value(network_, argument, parameters_), 0.0, 1.0);
      return static_cast<std::uint32_t>(std::lround(at * (count - 1)));
    };
    // Only drawn nodes count; of a large network that is every n-th.
    const std::uint32_t place = nearest(tap.u, tap.length) * tap.width + nearest(tap.v, tap.width);
    constexpr std::uint32_t widest_gap = 64;
    for (std::uint32_t away = 0; away < widest_gap; ++away) {
      if (away <= place && node_[tap.first + place - away] != nowhere) {
        return node_[tap.first + place - away];
      }
      if (place + away < tap.length * tap.width && node_[tap.first + place + away] != nowhere) {
        return node_[tap.first + place + away];
      }
    }
    return nowhere;
  }

  json line_of(const Link& link, std::uint32_t a, std::uint32_t b) const {
    const LawFacts& facts = facts_of(link.law);
    json line = {a, b, static_cast<int>(link.law)};
    if (facts.can_detach()) {
      line.push_back(facts.zone == Zone::below ? 1 : 2);
      line.push_back(
          argument_value(network_, link.arguments[facts.slot(Role::reach)], parameters_));
    }
    return line;
  }

  static json shown(std::uint32_t node) { return node == nowhere ? json() : json(node); }
  static double rounded(double x) { return std::round(x * 1e3) / 1e3; }

  const Picture& picture_;
  const Network network_;
  const std::vector<double> parameters_;
  std::vector<std::uint32_t> node_;                     // [mass] Node, or nowhere.
  std::map<std::string, std::uint32_t> place_on_body_;  // Node by name.
  std::vector<std::optional<LayoutPoint>> at_;          // [mass]
  std::vector<double> tops_;                            // [macro]
  double wide_ = 20.0;  // Width of a waveguide: that of the longest row.
  bool is_plane_ = false;
  bool is_laid_out_ = true;
  std::vector<json> x_;  // [node]
  std::vector<json> y_;
  std::vector<double> start_;
  std::vector<std::string> names_;
  std::string kinds_;
};

}  // namespace

std::string network_json(const Picture& picture) {
  return NetworkJsonWriter(picture).write();
}

Result<std::string> modes_json(const Picture& picture, std::span<const double> parameters,
                               double rate_hz, std::size_t count, const Progress& progress) {
  const auto found = find_modes(*picture.network, parameters,
                                {.rate_hz = rate_hz, .count = count, .progress = progress});
  if (!found) {
    return found.error();
  }
  std::map<std::uint32_t, std::size_t> dot;  // Dot of a mass.
  for (std::size_t i = 0; i < picture.masses.size(); ++i) {
    dot[picture.masses[i]] = i;
  }
  // Returns the level of a mode at the output where it is loudest, for one input.
  const auto level = [&](const NetworkMode& mode, std::size_t input) {
    double most = 0.0;
    for (std::size_t output = 0; output < found->outputs; ++output) {
      most = std::max(most, std::fabs(mode.levels[input * found->outputs + output]));
    }
    return most;
  };
  std::vector<double> loudest(found->inputs, 0.0);
  for (const NetworkMode& mode : found->modes) {
    for (std::size_t input = 0; input < found->inputs; ++input) {
      loudest[input] = std::max(loudest[input], level(mode, input));
    }
  }
  std::set<int> numbers;
  for (const Input& input : found->network.inputs) {
    numbers.insert(input.number);
  }
  const auto inputs_json = [&](const NetworkMode& mode) {
    json inputs = json::array();
    std::size_t input = 0;
    for (const int number : numbers) {
      const double share = loudest[input] > 0.0 ? level(mode, input) / loudest[input] : 0.0;
      inputs.push_back(
          {number, share > 1e-6 ? json(std::round(200.0 * std::log10(share)) / 10.0) : json()});
      ++input;
    }
    return inputs;
  };
  json modes = json::array();
  for (std::size_t m = 0; m < std::min(count, found->modes.size()); ++m) {
    std::vector<double> shape(picture.masses.size(), 0.0);
    double most = 0.0;
    for (std::uint32_t row = 0; row < found->system.masses.size(); ++row) {
      if (const auto at = dot.find(found->system.masses[row]); at != dot.end()) {
        shape[at->second] = found->displacement(m, row);
        most = std::max(most, std::fabs(shape[at->second]));
      }
    }
    for (double& x : shape) {
      x = most > 0.0 ? std::round(1e3 * x / most) / 1e3 : 0.0;
    }
    const NetworkMode& mode = found->modes[m];
    modes.push_back({{"hz", mode.frequency_hz},
                     {"t60_s", std::isfinite(mode.t60_s) ? json(mode.t60_s) : json()},
                     {"inputs", inputs_json(mode)},
                     {"shape", shape}});
  }
  return json{{"modes", modes}, {"linear", found->is_linear()}}.dump();
}

}  // namespace ressort::panel
