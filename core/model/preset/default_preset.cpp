// Chooses the preset of a model that has none.
#include <algorithm>
#include <cmath>
#include <string>

#include "core/laws/law.h"
#include "core/model/preset/preset.h"
#include "core/model/topology.h"

namespace ressort::model {
namespace {

bool never_moves(const Mass& mass) {
  return mass.kind == MassKind::ground || mass.kind == MassKind::position;
}

bool is_pluck(const LawFacts& law) {
  return law.can_detach() && !law.is_one_sided();
}
bool is_bow(const LawFacts& law) {
  return law.is_friction;
}
bool is_contact(const LawFacts& law) {
  return law.is_one_sided();
}

// Returns the first link at a mass with such a law, or null.
const Link* find_link(const Network& network, std::uint32_t mass,
                      bool (*has_law)(const LawFacts&)) {
  const auto at_mass = [&](const Link& link) {
    return has_law(facts_of(link.law)) && (link.a == mass || link.b == mass);
  };
  const auto found = std::ranges::find_if(network.links, at_mass);
  return found == network.links.end() ? nullptr : &*found;
}

double reach_of(const Network& network, const Link& link) {
  return argument_value(network, link.arguments[facts_of(link.law).slot(Role::reach)],
                        parameter_values(network));
}

// Returns the gesture with which a key plays an input, depending on the laws of its links: strike,
// pluck, bow or swing. Returns nothing if none fits. Velocity sets the level, not the force, so
// that every note has the best sound of its law; only blows get brighter with velocity.
std::optional<ControlSetting> played_by_key(const Network& network, const Input& input) {
  constexpr double softest_db = -26.0;
  ControlSetting note{.target = "in" + std::to_string(input.number)};
  if (input.is_force) {
    if (never_moves(network.masses[input.mass])) {
      return std::nullopt;
    }
    note.gesture = Gesture::impulse;
    note.low = 0.005;
    note.high = 0.1;
    note.exponential = true;
    note.longest_ms = 4.0;
    note.shortest_ms = 0.5;
    return note;
  }
  note.has_level = true;
  note.low_db = softest_db;
  if (const Link* const pluck = find_link(network, input.mass, is_pluck)) {
    const double scale = reach_of(network, *pluck);
    note.gesture = Gesture::pluck;
    note.travel = 5.0 * scale;
    // The slower the finger, the further it deflects the string before it slips.
    note.low = 0.15 * scale;
    note.high = 0.05 * scale;
    note.exponential = true;
  } else if (const Link* const bow = find_link(network, input.mass, is_bow)) {
    const double scale = reach_of(network, *bow);
    note.gesture = Gesture::bow;
    note.low = 0.5 * scale;
    note.high = 0.7 * scale;
  } else if (const Link* const contact = find_link(network, input.mass, is_contact)) {
    // The first end is the lower one, so the mallet swings from that side.
    const double side = contact->a == input.mass ? 1.0 : -1.0;
    note.gesture = Gesture::swing;
    note.travel = 0.1 + std::fabs(reach_of(network, *contact));
    note.low = side * 0.1;
    note.high = side * 0.5;
    note.longest_ms = 12.0;
    note.shortest_ms = 4.0;
  } else {
    return std::nullopt;
  }
  return note;
}

// Returns a number of voices of this size that one core can compute.
int usual_voices(const Network& network) {
  constexpr std::size_t most_masses = 2000;
  return std::clamp(static_cast<int>(most_masses / std::max<std::size_t>(1, moving_count(network))),
                    1, 8);
}

// Returns a reference to an element that a force input could strike, or "" if no mass moves.
std::string something_to_strike(const Network& network) {
  for (const Mass& mass : network.masses) {
    if (moves(mass)) {
      return "@" + mass.name.text();
    }
  }
  return network.macros.empty() ? ""
                                : "[@" + network.macros[0].name +
                                      (is_mesh(network.macros[0].kind) ? " 0.3 0.4]" : " 0.3]");
}

}  // namespace

Preset default_preset(const Network& network, bool bare) {
  Preset preset;
  preset.keyboard = !bare;
  preset.voices = bare ? 1 : usual_voices(network);
  preset.damper_s = bare ? 0.0 : 0.3;
  constexpr int first_general_purpose = 16;
  constexpr int last_general_purpose = 19;
  int hand = first_general_purpose;
  bool first = true;
  for (const Input& input : network.inputs) {
    const auto note = played_by_key(network, input);
    const bool is_played = note && (bare ? note->gesture != Gesture::swing : first);
    if (is_played) {
      preset.controls.push_back(*note);
      first = false;
    }
    if (note && note->gesture == Gesture::pluck && !bare) {
      const double middle = network.masses[input.mass].position;
      preset.controls.push_back({.source = ControlSource::controller,
                                 .number = 1,
                                 .target = note->target,
                                 .low = middle - note->travel,
                                 .high = middle + note->travel});
    }
    const bool is_free = note && note->gesture == Gesture::swing && !is_played;
    if (!bare && is_free && hand <= last_general_purpose) {
      preset.controls.push_back({.source = ControlSource::controller,
                                 .number = hand++,
                                 .target = note->target,
                                 .gesture = Gesture::touch,
                                 .low = -2.0,
                                 .high = 1.0,
                                 .in_swings = true});
    } else if (bare || !note || is_free) {
      preset.controls.push_back({.source = ControlSource::audio,
                                 .number = input.number,
                                 .target = "in" + std::to_string(input.number),
                                 .low = 0.0,
                                 .high = 1.0});
    }
  }
  return preset;
}

std::optional<Error> idle_keys(const Network& network, const Preset& preset) {
  constexpr std::size_t most_told = 3;
  const std::string target = something_to_strike(network);
  if (target.empty() || std::ranges::any_of(preset.controls, [](const ControlSetting& control) {
        return control.source == ControlSource::note;
      })) {
    return std::nullopt;
  }
  std::string why;
  for (std::size_t i = 0; i < std::min(most_told, network.inputs.size()); ++i) {
    const Input& input = network.inputs[i];
    why += (i == 0 ? "" : ", ") + ("'@in" + std::to_string(input.number)) +
           (input.is_force ? "' pushes a mass that never moves"
                           : "' moves no pluck, no bow and no contact");
  }
  if (network.inputs.size() > most_told) {
    why += ", nor do " + std::to_string(network.inputs.size() - most_told) + " more";
  }
  int next = input_count(network) + 1;
  for (const Parameter& parameter : network.parameters) {
    next = std::max(next, parameter.audio_input + 1);
  }
  const SourceLocation location =
      network.inputs.empty() ? SourceLocation{1, 1} : network.inputs[0].location;
  return Error{"no key plays this model: " + (why.empty() ? "it has no input" : why) + "; '@in" +
                   std::to_string(next) + " frcInput " + target + "' would let keys strike it",
               location.line, location.column};
}

}  // namespace ressort::model
