#include "core/model/faust/faust_waveguides.h"

#include <algorithm>
#include <cmath>

#include "core/laws/law.h"
#include "core/model/faust/faust_words.h"

namespace ressort::model {
namespace {

constexpr double highest_rate_hz = 192000.0;  // that delays have room for
constexpr double lowest_hz = 15.0;

const Macro& guide_of(const Network& network, std::uint32_t junction) {
  return network.waveguides[network.taps[network.masses[junction].tap].macro];
}

bool is_turned(const Network& network, ArgumentId argument) {
  return argument != no_argument && !is_constant(network.arguments[argument]);
}

Error refused(const std::string& why, SourceLocation at) {
  return {why, at.line, at.column};
}

}  // namespace

bool is_driven(const Network& network, ArgumentId argument) {
  return argument != no_argument &&
         std::any_of(network.arguments[argument].begin(), network.arguments[argument].end(),
                     [&](const Step& step) {
                       return step.op == Op::parameter &&
                              network.parameters[step.index].audio_input > 0;
                     });
}

bool drives_itself(const Network& network, const Mass& mass) {
  return !mass.is_mode && (is_driven(network, mass.mass) || is_driven(network, mass.stiffness) ||
                           is_driven(network, mass.damping));
}

std::optional<Error> faust_refusal(const Network& network) {
  for (const Macro& guide : network.waveguides) {
    for (const ArgumentId argument : {guide.frequency_hz, guide.t60_s, guide.brightness}) {
      if (is_driven(network, argument)) {
        return refused(
            "the waveguide '" + guide.name +
                "' is tuned or damped by an audio input, which is not written in FAUST: let a "
                "parameter do it",
            guide.location);
      }
    }
  }
  for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
    const Mass& mass = network.masses[i];
    if (is_junction(network, i) && is_turned(network, network.taps[mass.tap].u)) {
      const Macro& guide = guide_of(network, i);
      return refused(
          "a place on the waveguide '" + guide.name +
              "' moves with a parameter, which is not written in FAUST: give it a number",
          guide.location);
    }
  }
  return FaustJoint(network).refusal();
}

FaustWaveguides::FaustWaveguides(const Network& network, const FaustJoint& joint)
    : network_(network), joint_(joint) {
  std::vector<std::vector<double>> held(network.waveguides.size());
  for (const Link& link : network.links) {
    for (const std::uint32_t end : {link.a, link.b}) {
      if (is_junction(network, end) && facts_of(link.law).contains_spring) {
        held[network.taps[network.masses[end].tap].macro].push_back(coordinate(end));
      }
    }
  }
  FaustNames names;
  for (std::uint32_t g = 0; g < network.waveguides.size(); ++g) {
    guides_.push_back({.name = names.add(network.waveguides[g].name),
                       .macro = &network.waveguides[g],
                       .filters = filters_between(held[g]),
                       .passes = {}});
  }
  for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
    if (is_junction(network, i)) {
      auto& passes = guides_[network.taps[network.masses[i].tap].macro].passes;
      passes.push_back({i, false});
      passes.push_back({i, true});
    }
  }
  std::erase_if(guides_, [](const Guide& guide) { return guide.passes.empty(); });
  for (Guide& guide : guides_) {
    const auto rank = [&](const Pass& pass) {
      return order_from_filters(guide.filters, coordinate(pass.mass), pass.runs_right);
    };
    std::stable_sort(guide.passes.begin(), guide.passes.end(),
                     [&](const Pass& a, const Pass& b) { return rank(a) < rank(b); });
  }
}

double FaustWaveguides::coordinate(std::uint32_t mass) const {
  const ArgumentId u = network_.taps[network_.masses[mass].tap].u;
  return u == no_argument ? 0.0 : evaluate(network_.arguments[u], {});
}

std::vector<std::string> FaustWaveguides::later(const FaustTerms& terms,
                                                const std::string& prefix) const {
  std::vector<std::string> words;
  for (std::uint32_t i = 0; i < network_.masses.size(); ++i) {
    if (is_junction(network_, i)) {
      words.push_back(prefix + "_" + terms.masses[i]);
    }
    if (joint_.is_held(i) && (moves(network_.masses[i]) || is_junction(network_, i))) {
      words.push_back(prefix + "x_" + terms.masses[i]);
    }
    if (joint_.is_held(i) && moves(network_.masses[i]) &&
        drives_itself(network_, network_.masses[i])) {
      words.push_back(prefix + "v_" + terms.masses[i]);
    }
  }
  for (const Guide& guide : guides_) {
    for (std::size_t k = 0; k <= guide.passes.size(); ++k) {
      words.push_back(prefix + "b_" + guide.name + "_" + std::to_string(k));
    }
  }
  return words;
}

std::vector<std::string> FaustWaveguides::numbers() const {
  std::vector<std::string> words;
  for (const Guide& guide : guides_) {
    for (const char* what : {"samples_", "allpass_", "pole_", "gain_"}) {
      words.push_back(what + guide.name);
    }
    for (std::size_t k = 0; k < guide.passes.size(); ++k) {
      words.push_back("d_" + guide.name + "_" + std::to_string(k + 1));
    }
  }
  return words;
}

std::string FaustWaveguides::feed(int inputs) const {
  std::string text;
  for (const Guide& guide : guides_) {
    text += (text.empty() ? "guide_" : ", guide_") + guide.name;
  }
  if (!text.empty() && inputs > 0) {
    text += ", par(i, " + std::to_string(inputs) + ", _)";
  }
  return text.empty() ? "" : text + " : ";
}

std::string FaustWaveguides::guides(const FaustTerms& terms) const {
  std::string text;
  for (const Guide& guide : guides_) {
    const std::string& name = guide.name;
    const std::size_t count = guide.passes.size();
    std::vector<std::string> places;
    for (std::size_t k = 0; k < count; ++k) {
      places.push_back("d" + std::to_string(k + 1));
    }
    places.insert(places.begin(), {"samples", "allpass", "pole", "gain"});
    text += "\nguide_" + name + " = guide(" + faust_number(static_cast<double>(count + 2)) + ", " +
            terms.value(guide.macro->frequency_hz) + ", " + terms.value(guide.macro->t60_s) + ", " +
            terms.value(guide.macro->brightness) + ") : places\nwith {\n" +
            "  places(samples, period, allpass, pole, gain) =\n    " + flow(places, ", ", 4) +
            "\n  with {\n";
    // Every place is at the nearest sample that is its own: from the first on, then from the last.
    for (std::size_t k = 0; k < count; ++k) {
      const Pass& pass = guide.passes[k];
      text += "    n" + std::to_string(k + 1) + " = max(" +
              (k == 0 ? "1.0" : "n" + std::to_string(k) + " + 1.0") + ", nearest(" +
              faust_number(guide.filters.share) + ", " + faust_number(guide.filters.to_held) +
              ", " + faust_number(coordinate(pass.mass)) + ", " + (pass.runs_right ? "1" : "0") +
              ", period));\n";
    }
    for (std::size_t k = count; k-- > 0;) {
      const std::string n = std::to_string(k + 1);
      text += "    d" + n + " = min(n" + n + ", " +
              (k + 1 == count ? "samples" : "d" + std::to_string(k + 2) + " - 1.0") + ");\n";
    }
    text += "  };\n};\n";
  }
  return text;
}

std::string FaustWaveguides::place(const FaustTerms& terms, std::uint32_t mass,
                                   const std::string& outside) const {
  const std::string& name = terms.masses[mass];
  const Guide& guide = *std::find_if(guides_.begin(), guides_.end(), [&](const Guide& any) {
    return any.macro == &guide_of(network_, mass);
  });
  const std::string sign = guide.macro->kind == MacroKind::open_waveguide ? " + " : " - ";
  std::string left;
  std::string right;
  for (std::size_t k = 0; k < guide.passes.size(); ++k) {
    if (guide.passes[k].mass == mass) {
      (guide.passes[k].runs_right ? right : left) =
          "in_" + guide.name + "_" + std::to_string(k + 1);
    }
  }
  const std::string give = terms.inverse_mass(mass);
  return "u_" + name + " = 2.0*(" + right + sign + left + ") - n_" + name +
         (outside == "0.0" ? "" : " + (" + outside + ")*" + give) + ";  o_" + name + " = nx_" +
         name + " + first(" + faust_number(network_.masses[mass].position) + ");  y_" + name +
         " = o_" + name + " + u_" + name + ";  v_" + name + " = u_" + name + " + h_" + name + "*" +
         give + ";  x_" + name + " = o_" + name + " + v_" + name + ";  w_" + name + " = 0.5*(v_" +
         name + " + n_" + name + ") - " + right + (sign == " + " ? " - " : " + ") + left +
         ";  to_" + name + " = v_" + name + ";  tox_" + name + " = x_" + name + ";";
}

std::string FaustWaveguides::waves(const FaustTerms& terms) const {
  std::string text;
  for (const Guide& guide : guides_) {
    const std::string& name = guide.name;
    const std::size_t count = guide.passes.size();
    const Formula& hz = network_.arguments[guide.macro->frequency_hz];
    const double lowest = is_constant(hz) ? std::max(evaluate(hz, {}), lowest_hz) : lowest_hz;
    const std::string most = faust_number(std::ceil(highest_rate_hz / lowest) + 2.0);
    for (std::size_t k = 0; k < count; ++k) {
      const std::string here = name + "_" + std::to_string(k + 1);
      const std::string before = name + "_" + std::to_string(k);
      const bool turns =
          !guide.passes[k].runs_right && guide.macro->kind != MacroKind::open_waveguide;
      text += "  in_" + here + " = late(" + most + ", d_" + here +
              (k == 0 ? "" : " - d_" + before) + " - 1.0, nb_" + before + ");  tob_" + here +
              " = in_" + here + (turns ? " - w_" : " + w_") + terms.masses[guide.passes[k].mass] +
              ";\n";
    }
    const std::string last = name + "_" + std::to_string(count);
    text += "  tob_" + name + "_0 = filtered(allpass_" + name + ", pole_" + name + ", gain_" +
            name + ", late(" + most + ", samples_" + name + " - d_" + last + ", tob_" + last +
            "));\n";
  }
  return text;
}

}  // namespace ressort::model
