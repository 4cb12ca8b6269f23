// core/model: the words of the .mdl language, in one table.
#pragma once

#include <string_view>

#include "core/model/network.h"

namespace ressort {

enum class Element {
  parameter,
  audio_parameter,
  ground,
  mass,
  oscillator,
  macro,
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

// Everything that tells one keyword from another. The reader, its messages and its suggestions
// have no other list.
struct Keyword {
  std::string_view word;
  Element element;
  LinkKind link;               // of Element::link
  int references;              // of masses, before the arguments
  int least;                   // arguments
  int most;                    // arguments, without a drawing
  int first;                   // links: which of Link::arguments the first argument is
  bool drawable;               // may be followed by GROUP X Y
  std::string_view arguments;  // as a person writes them
  MacroKind macro{};           // of Element::macro
};

// clang-format off
inline constexpr Keyword keywords[] = {
    {"param",              Element::parameter,       {},                  0, 1, 1, 0, false, "VALUE"},
    {"audioParam",         Element::audio_parameter, {},                  0, 1, 1, 0, false, "@inN"},
    {"ground",             Element::ground,          {},                  0, 1, 1, 0, true,  "POSITION"},
    {"mass",               Element::mass,            {},                  0, 3, 4, 0, true,  "M [G] POSITION MOTION"},
    {"massG",              Element::mass,            {},                  0, 4, 4, 0, true,  "M G POSITION MOTION"},
    {"osc",                Element::oscillator,      {},                  0, 5, 6, 0, true,  "M K Z [G] POSITION MOTION"},
    {"cel",                Element::oscillator,      {},                  0, 5, 6, 0, true,  "M K Z [G] POSITION MOTION"},
    {"string",             Element::macro,           {},                  0, 5, 7, 0, false, "N M K Z [ZO] POSITION [MOTION]", MacroKind::string},
    {"chain",              Element::macro,           {},                  0, 5, 7, 0, false, "N M K Z [ZO] POSITION [MOTION]", MacroKind::chain},
    {"stiffString",        Element::macro,           {},                  0, 6, 8, 0, false, "N M K K2 Z [ZO] POSITION [MOTION]", MacroKind::stiff_string},
    {"mesh",               Element::macro,           {},                  0, 6, 8, 0, false, "LENGTH WIDTH M K Z [ZO] POSITION [MOTION]", MacroKind::mesh},
    {"closedMesh",         Element::macro,           {},                  0, 6, 8, 0, false, "LENGTH WIDTH M K Z [ZO] POSITION [MOTION]", MacroKind::closed_mesh},
    {"cornerMesh",         Element::macro,           {},                  0, 6, 8, 0, false, "LENGTH WIDTH M K Z [ZO] POSITION [MOTION]", MacroKind::corner_mesh},
    {"posInput",           Element::position_input,  {},                  0, 1, 1, 0, true,  "POSITION"},
    {"frcInput",           Element::force_input,     {},                  1, 0, 0, 0, false, "@MASS"},
    {"forceInput",         Element::force_input,     {},                  1, 0, 0, 0, false, "@MASS"},
    {"posOutput",          Element::position_output, {},                  1, 0, 0, 0, false, "@MASS"},
    {"frcOutput",          Element::force_output,    {},                  1, 0, 0, 0, false, "@MASS"},
    {"spring",             Element::link,            LinkKind::spring,           2, 1, 2, 0, false, "@A @B K [Z]"},
    {"springDamper",       Element::link,            LinkKind::spring,           2, 1, 2, 0, false, "@A @B K [Z]"},
    {"springDamperDamper", Element::link,            LinkKind::spring,           2, 1, 2, 0, false, "@A @B K [Z]"},
    {"damper",             Element::link,            LinkKind::spring,           2, 1, 1, 1, false, "@A @B Z"},
    {"nlSpring",           Element::link,            LinkKind::quadratic_spring, 2, 3, 3, 0, false, "@A @B K Q Z"},
    {"nlSpring2",          Element::link,            LinkKind::quadratic_spring, 2, 3, 3, 0, false, "@A @B K Q Z"},
    {"nlSpring3",          Element::link,            LinkKind::cubic_spring,     2, 3, 3, 0, false, "@A @B K Q Z"},
    {"nlSpringDamper",     Element::link,            LinkKind::clipped_spring,   2, 4, 4, 0, false, "@A @B S C K Z"},
    {"nlPluck",            Element::link,            LinkKind::pluck,            2, 2, 3, 0, false, "@A @B K SCALE [Z]"},
    {"nlBow",              Element::link,            LinkKind::bow,              2, 2, 3, 0, false, "@A @B Z SCALE [PROFILE]"},
    {"contact",            Element::link,            LinkKind::contact,          2, 2, 3, 0, false, "@A @B K Z [THRESHOLD]"},
    {"detent",             Element::link,            LinkKind::contact,          2, 2, 3, 0, false, "@A @B K Z [THRESHOLD]"},
    {"nlContact",          Element::link,            LinkKind::clipped_contact,  2, 4, 5, 0, false, "@A @B S C K Z [THRESHOLD]"},
};
// clang-format on

}  // namespace ressort
