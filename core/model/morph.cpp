#include "core/model/morph.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/model/language/tokens.h"

namespace ressort::model {
namespace {

// Calls f(argument, is_place) for every number of the network, in an order that depends only on the
// structure.
template <class F>
void each_argument(Network& network, F&& f) {
  for (Mass& mass : network.masses) {
    for (ArgumentId* const id : {&mass.mass, &mass.stiffness, &mass.damping, &mass.gravity}) {
      f(*id, false);
    }
  }
  const auto macros = [&](std::vector<Macro>& all) {
    for (Macro& macro : all) {
      for (ArgumentId* const id : arguments_of(macro)) {
        f(*id, false);
      }
    }
  };
  macros(network.macros);
  macros(network.waveguides);
  for (BodyMode& mode : network.modes) {
    f(mode.frequency_hz, false);
    f(mode.t60_s, false);
  }
  for (Tap& tap : network.taps) {
    f(tap.u, true);
    f(tap.v, true);
  }
  for (Link& link : network.links) {
    for (ArgumentId& id : link.arguments) {
      f(id, false);
    }
  }
}

// Returns the network without its numbers, names and drawings.
Network structure_of(Network network) {
  each_argument(network, [](ArgumentId& id, bool) { id = no_argument; });
  for (Output& output : network.outputs) {
    output.level = no_argument;
  }
  const auto unnamed = [](auto& elements) {
    for (auto& element : elements) {
      element.name = {};
    }
  };
  unnamed(network.masses);
  unnamed(network.macros);
  unnamed(network.waveguides);
  unnamed(network.modes);
  unnamed(network.links);
  for (Mass& mass : network.masses) {
    mass.drawing = 0;
  }
  for (Macro& macro : network.macros) {
    macro.drawing = 0;
  }
  for (BodyMode& mode : network.modes) {
    mode.shape.assign(mode.shape.size(), 0.0);
  }
  for (Macro& macro : network.macros) {
    macro.places.assign(macro.places.size(), "");
  }
  network.parameters.clear();
  network.arguments.clear();
  network.drawings.clear();
  return network;
}

std::optional<Error> differs(const Network& base, const MorphStop& stop) {
  const Network a = structure_of(base);
  const Network b = structure_of(*stop.network);
  if (a == b) {
    return std::nullopt;
  }
  const auto mismatch = [&](const std::string& what, SourceLocation at) {
    return Error{"a morph needs models of the same structure, but " + what + " in " + stop.name +
                     "; put both into one model and change the levels of its outputs, as "
                     "SixStructures does",
                 at.line, at.column};
  };
  for (std::size_t i = 0; i < std::min(a.macros.size(), b.macros.size()); ++i) {
    const Macro& here = base.macros[i];
    const Macro& there = stop.network->macros[i];
    if (here.kind != there.kind) {
      return mismatch(quoted(here.name) + " is of another kind", here.location);
    }
    if (here.length != there.length || here.width != there.width) {
      const auto size = [](const Macro& macro) {
        return std::to_string(macro.length) +
               (macro.width > 1 ? " by " + std::to_string(macro.width) : "");
      };
      return mismatch(
          quoted(here.name) + " has " + size(here) + " nodes, not " + size(there) + ", as",
          here.location);
    }
  }
  const auto counts = [&](const auto& here, const auto& there, const char* what) {
    return here.size() == there.size()
               ? std::nullopt
               : std::optional(mismatch("there are " + std::to_string(here.size()) + " " + what +
                                            ", not " + std::to_string(there.size()) + ", as",
                                        {}));
  };
  for (auto wrong :
       {counts(a.macros, b.macros, "strings, meshes and bodies"),
        counts(a.masses, b.masses, "masses, inputs and places"), counts(a.links, b.links, "links"),
        counts(a.inputs, b.inputs, "inputs"), counts(a.outputs, b.outputs, "outputs")}) {
    if (wrong) {
      return wrong;
    }
  }
  for (std::size_t i = 0; i < a.links.size(); ++i) {
    if (!(a.links[i] == b.links[i])) {
      return mismatch("a link has another law or other ends than", base.links[i].location);
    }
  }
  return mismatch("other elements are fixed, driven or heard, or start elsewhere, than", {});
}

Formula combined(Formula a, const Formula& b, Op op) {
  a.insert(a.end(), b.begin(), b.end());
  a.push_back({op});
  return folded(std::move(a));
}

Formula number(double value) {
  return {{Op::number, 0, value}};
}

class Morphing {
 public:
  Morphing(const Network& base, std::span<const MorphStop> stops, const std::string& parameter,
           std::span<const std::string> knobs)
      : stops_(stops), out_(base) {
    const auto is_kept = [&](const Parameter& one) {
      return one.audio_input > 0 || std::ranges::find(knobs, one.name) != knobs.end();
    };
    std::erase_if(out_.parameters, [&](const Parameter& one) { return !is_kept(one); });
    out_.parameters.push_back({.name = parameter, .value = 1.0});
    values_ = parameter_values(out_);
  }

  Result<Network> run() {
    out_.arguments.clear();
    std::vector<std::vector<ArgumentId>> theirs;  // [stop] [number]
    for (const MorphStop& stop : stops_) {
      Network network = *stop.network;
      auto& ids = theirs.emplace_back();
      each_argument(network, [&](ArgumentId id, bool) { ids.push_back(id); });
    }
    std::size_t at = 0;
    each_argument(out_, [&](ArgumentId& id, bool is_place) {
      std::vector<Formula> formulas;
      bool is_there = false;
      for (std::size_t s = 0; s < stops_.size(); ++s) {
        is_there |= theirs[s][at] != no_argument;
        formulas.push_back(of_stop(s, theirs[s][at], 0.0));
      }
      id = is_there ? add(between(formulas, is_place)) : no_argument;
      ++at;
    });
    const bool has_gains =
        std::ranges::any_of(stops_, [](const MorphStop& stop) { return stop.gain != 1.0; });
    for (std::size_t o = 0; o < out_.outputs.size(); ++o) {
      std::vector<Formula> formulas;
      bool has_level = has_gains;
      for (std::size_t s = 0; s < stops_.size(); ++s) {
        const ArgumentId level = stops_[s].network->outputs[o].level;
        has_level |= level != no_argument;
        formulas.push_back(combined(of_stop(s, level, 1.0), number(stops_[s].gain), Op::multiply));
      }
      out_.outputs[o].level = has_level ? add(between(formulas, false)) : no_argument;
    }
    for (std::uint32_t body = 0; body < out_.macros.size(); ++body) {
      if (has_shapes_of_its_own(body)) {
        morph_shapes(body);
      }
    }
    return error_ ? Result<Network>(*error_) : canonical(std::move(out_));
  }

 private:
  bool has_shapes_of_its_own(std::uint32_t body) const {
    for (std::size_t m = 0; m < out_.modes.size(); ++m) {
      for (const MorphStop& stop : stops_) {
        if (out_.modes[m].macro == body &&
            stop.network->modes[m].shape != stops_[0].network->modes[m].shape) {
          return true;
        }
      }
    }
    return false;
  }

  // Returns the index of the body's place at a point, or nothing between two places.
  static std::optional<std::size_t> place_of(const MorphStop& stop, std::uint32_t tap) {
    const Network& network = *stop.network;
    const std::size_t places = network.macros[network.taps[tap].macro].places.size();
    const double at =
        argument_value(network, network.taps[tap].u, stop.values) * static_cast<double>(places - 1);
    return is_constant(network.arguments[network.taps[tap].u]) &&
                   std::fabs(at - std::rint(at)) < 1e-6
               ? std::optional(static_cast<std::size_t>(std::rint(at)))
               : std::nullopt;
  }

  // A mode transfers a blow from one place to another by the product of its shapes at both. So the
  // shapes at the driven place are the same for all stops, the shapes at the outputs are scaled to
  // keep each stop's product, and each output is split into one for each stop, which are
  // crossfaded.
  void morph_shapes(std::uint32_t body) {
    const auto is_on_body = [&](std::uint32_t mass) {
      return out_.masses[mass].kind == MassKind::point &&
             out_.taps[out_.masses[mass].tap].macro == body;
    };
    const auto refuse = [&](const std::string& why) {
      error_ = {quoted(out_.macros[body].name) +
                    " has modes of different shapes and cannot be morphed: " + why,
                out_.macros[body].location.line, out_.macros[body].location.column};
    };
    std::optional<std::uint32_t> driven;  // the driven point
    for (const Input& input : out_.inputs) {
      if (is_on_body(input.mass) && (!input.is_force || driven)) {
        return refuse("more than one input drives it");
      }
      driven = is_on_body(input.mass) ? std::optional(input.mass) : driven;
    }
    const bool has_links = std::ranges::any_of(
        out_.links, [&](const Link& link) { return is_on_body(link.a) || is_on_body(link.b); });
    if (!driven || has_links) {
      return refuse(has_links ? "links are attached to it" : "no input drives it");
    }
    const auto in = places_of(out_.masses[*driven].tap);
    std::vector<std::string> names = {"driven"};
    std::vector<std::vector<double>> shapes(1);  // [place] [mode]
    std::vector<std::size_t> modes;
    for (std::size_t m = 0; m < out_.modes.size() && in; ++m) {
      if (out_.modes[m].macro == body) {
        modes.push_back(m);
        double sum = 0.0;
        for (std::size_t s = 0; s < stops_.size(); ++s) {
          sum += std::pow(shape(s, m, (*in)[s]), 2.0);
        }
        shapes[0].push_back(std::sqrt(sum / static_cast<double>(stops_.size())));
      }
    }
    std::vector<Output> outputs;
    std::vector<std::pair<std::uint32_t, std::size_t>> taps;  // points and the places that they get
    taps.emplace_back(out_.masses[*driven].tap, 0);
    for (const Output& output : out_.outputs) {
      if (!is_on_body(output.mass)) {
        outputs.push_back(output);
        continue;
      }
      const auto there = places_of(out_.masses[output.mass].tap);
      if (!there || !in || output.is_force) {
        return refuse("it is driven or heard between places");
      }
      for (std::size_t s = 0; s < stops_.size(); ++s) {
        names.push_back("out" + std::to_string(outputs.size() + 1));
        std::vector<double>& to = shapes.emplace_back();
        for (std::size_t i = 0; i < modes.size(); ++i) {
          const double product = shape(s, modes[i], (*there)[s]) * shape(s, modes[i], (*in)[s]);
          to.push_back(shapes[0][i] > 0.0 ? product / shapes[0][i] : 0.0);
        }
        outputs.push_back(faded(output, s));
        taps.emplace_back(out_.masses[outputs.back().mass].tap, shapes.size() - 1);
      }
    }
    out_.outputs = std::move(outputs);
    for (const auto& [tap, place] : taps) {
      out_.taps[tap].u =
          add(number(static_cast<double>(place) / static_cast<double>(shapes.size() - 1)));
    }
    for (std::size_t i = 0; i < modes.size(); ++i) {
      out_.modes[modes[i]].shape.clear();
      for (const std::vector<double>& at : shapes) {
        out_.modes[modes[i]].shape.push_back(at[i]);
      }
    }
    out_.macros[body].places = std::move(names);
  }

  double shape(std::size_t stop, std::size_t mode, std::size_t place) const {
    return stops_[stop].network->modes[mode].shape[place];
  }

  // Returns the place for each stop, or nothing if a stop has the point between two places.
  std::optional<std::vector<std::size_t>> places_of(std::uint32_t tap) const {
    std::vector<std::size_t> places;
    for (const MorphStop& stop : stops_) {
      const auto place = place_of(stop, tap);
      if (!place) {
        return std::nullopt;
      }
      places.push_back(*place);
    }
    return places;
  }

  // Returns an output on a new point, with the crossfade level of this stop.
  Output faded(const Output& output, std::size_t stop) {
    Output one = output;
    Mass point = out_.masses[output.mass];
    const Tap tap = out_.taps[point.tap];
    point.tap = static_cast<std::uint32_t>(out_.taps.size());
    out_.taps.push_back(tap);
    one.mass = static_cast<std::uint32_t>(out_.masses.size());
    out_.masses.push_back(std::move(point));
    Formula level = stop > 0 ? share(stop) : number(1.0);
    if (stop + 1 < stops_.size()) {
      level = combined(std::move(level), share(stop + 1), Op::subtract);
    }
    if (output.level != no_argument) {
      level = combined(std::move(level), out_.arguments[output.level], Op::multiply);
    }
    one.level = add(std::move(level));
    return one;
  }

  std::uint32_t position() const { return static_cast<std::uint32_t>(out_.parameters.size() - 1); }

  // Returns the formula of a stop; its parameters become numbers or parameters of the morph.
  Formula of_stop(std::size_t s, ArgumentId id, double without) {
    if (id == no_argument) {
      return number(without);
    }
    Formula formula = stops_[s].network->arguments[id];
    for (Step& step : formula) {
      if (step.op != Op::parameter) {
        continue;
      }
      const std::string& name = stops_[s].network->parameters[step.index].name;
      const auto knob = std::ranges::find(out_.parameters, name, &Parameter::name);
      step = knob == out_.parameters.end()
                 ? Step{Op::number, 0, stops_[s].values[step.index]}
                 : Step{Op::parameter, static_cast<std::uint32_t>(knob - out_.parameters.begin())};
    }
    return folded(std::move(formula));
  }

  Formula between(const std::vector<Formula>& formulas, bool is_place) const {
    const bool by_ratios = !is_place && std::ranges::all_of(formulas, [&](const Formula& formula) {
      return evaluate(formula, values_) > 0.0;
    });
    Formula all = formulas.front();
    for (std::size_t s = 1; s < formulas.size(); ++s) {
      if (formulas[s] == formulas[s - 1]) {
        continue;
      }
      Formula way = combined(formulas[s], formulas[s - 1], by_ratios ? Op::divide : Op::subtract);
      way = combined(std::move(way), share(s), by_ratios ? Op::power : Op::multiply);
      all = combined(std::move(all), way, by_ratios ? Op::multiply : Op::add);
    }
    return all;
  }

  // Returns the position between this stop and the one before, 0 to 1.
  Formula share(std::size_t stop) const {
    return {{Op::parameter, position()},
            {Op::number, 0, static_cast<double>(stop)},
            {Op::subtract},
            {Op::number, 0, 0.0},
            {Op::number, 0, 1.0},
            {Op::clamp}};
  }

  ArgumentId add(Formula formula) {
    if (!error_ &&
        (stack_depth(formula) > max_formula_depth || formula.size() > max_formula_steps)) {
      error_ = Error{"a formula of the model is too long for the morph"};
    }
    return out_.add(std::move(formula));
  }

  std::span<const MorphStop> stops_;
  Network out_;
  std::vector<double> values_;  // [parameter] initial value
  std::optional<Error> error_;
};

}  // namespace

Result<Network> morphed(const Network& base, std::span<const MorphStop> stops,
                        const std::string& parameter, std::span<const std::string> knobs) {
  for (const Parameter& one : base.parameters) {
    if (one.name == parameter) {
      return Error{"the model has a parameter " + quoted(parameter) +
                   "; a morph needs a name of its own"};
    }
  }
  for (const MorphStop& stop : stops) {
    if (auto error = differs(base, stop)) {
      return *std::move(error);
    }
    for (const Parameter& one : stop.network->parameters) {
      if (one.audio_input > 0 && std::ranges::none_of(base.parameters, [&](const Parameter& other) {
            return other.name == one.name;
          })) {
        return Error{"an audio input sets the parameter " + quoted(one.name) + " of " + stop.name +
                     ", which the model of the morph does not have"};
      }
    }
  }
  return Morphing(base, stops, parameter, knobs).run();
}

}  // namespace ressort::model
