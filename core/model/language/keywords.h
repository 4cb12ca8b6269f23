// core/model: the keywords of the .mdl language.
#pragma once

#include <span>
#include <string_view>

#include "core/model/network.h"

namespace ressort::model {

enum class Element {
  parameter,
  audio_parameter,
  ground,
  mass,
  oscillator,
  macro,
  body_mode,
  position_input,
  force_input,
  position_output,
  force_output,
  link,
};

inline bool is_mass(Element element) {
  return element == Element::ground || element == Element::mass || element == Element::oscillator ||
         element == Element::position_input;
}
inline bool is_parameter(Element element) {
  return element == Element::parameter || element == Element::audio_parameter;
}

inline constexpr int most_body_places = 256;
inline constexpr std::string_view bridge_name = "bridge";  // a place on every modal string

// The description of a keyword. The reader, its messages and its suggestions use this list only.
struct Keyword {
  std::string_view word;
  Element element;
  int references;              // number of masses before the arguments
  int least;                   // fewest arguments
  int most;                    // most arguments, without a drawing
  bool drawable;               // may be followed by GROUP X Y
  std::string_view arguments;  // description for messages
  MacroKind macro{};           // macro of Element::macro
  Law law{};                   // law of Element::link
  const LawWord* link{};       // keyword of Element::link
};

// Returns all keywords, including those of the laws. [any thread]
std::span<const Keyword> keywords();

}  // namespace ressort::model
