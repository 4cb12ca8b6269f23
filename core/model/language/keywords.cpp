#include "core/model/language/keywords.h"

#include <algorithm>
#include <iterator>
#include <vector>

namespace ressort::model {
namespace {

// clang-format off
constexpr Keyword fixed[] = {
    {"param",              Element::parameter,       0, 1, 1, false, "VALUE"},
    {"audioParam",         Element::audio_parameter, 0, 1, 1, false, "@inN"},
    {"ground",             Element::ground,          0, 1, 1, true,  "POSITION"},
    {"mass",               Element::mass,            0, 3, 4, true,  "M [G] POSITION MOTION"},
    {"massG",              Element::mass,            0, 4, 4, true,  "M G POSITION MOTION"},
    {"osc",                Element::oscillator,      0, 5, 6, true,  "M K Z [G] POSITION MOTION"},
    {"cel",                Element::oscillator,      0, 5, 6, true,  "M K Z [G] POSITION MOTION"},
    {"string",             Element::macro,           0, 5, 7, false, "N M K Z [ZO] POSITION [MOTION]", MacroKind::string},
    {"chain",              Element::macro,           0, 5, 7, false, "N M K Z [ZO] POSITION [MOTION]", MacroKind::chain},
    {"stiffString",        Element::macro,           0, 6, 8, false, "N M K K2 Z [ZO] POSITION [MOTION]", MacroKind::stiff_string},
    {"mesh",               Element::macro,           0, 6, 8, false, "LENGTH WIDTH M K Z [ZO] POSITION [MOTION]", MacroKind::mesh},
    {"closedMesh",         Element::macro,           0, 6, 8, false, "LENGTH WIDTH M K Z [ZO] POSITION [MOTION]", MacroKind::closed_mesh},
    {"cornerMesh",         Element::macro,           0, 6, 8, false, "LENGTH WIDTH M K Z [ZO] POSITION [MOTION]", MacroKind::corner_mesh},
    {"body",               Element::macro,           0, 2, 1 + most_body_places, false, "M PLACE...", MacroKind::body},
    {"mode",               Element::body_mode,       0, 4, 3 + most_body_places, false, "@BODY HZ T60 DISPLACEMENT..."},
    {"waveguide",          Element::macro,           0, 5, 5, false, "R HZ T60 BRIGHTNESS POSITION", MacroKind::waveguide},
    {"openWaveguide",      Element::macro,           0, 5, 5, false, "R HZ T60 BRIGHTNESS POSITION", MacroKind::open_waveguide},
    {"modalString",        Element::macro,           0, 7, 10, false, "PARTIALS M HZ B S0 S1 S3 [STRINGS CENTS BRIDGE]", MacroKind::modal_string},
    {"posInput",           Element::position_input,  0, 1, 1, true,  "POSITION"},
    {"frcInput",           Element::force_input,     1, 0, 0, false, "@MASS"},
    {"forceInput",         Element::force_input,     1, 0, 0, false, "@MASS"},
    {"posOutput",          Element::position_output, 1, 0, 1, false, "@MASS [LEVEL]"},
    {"velOutput",          Element::position_output, 1, 0, 1, false, "@MASS [LEVEL]"},
    {"accOutput",          Element::position_output, 1, 0, 1, false, "@MASS [LEVEL]"},
    {"frcOutput",          Element::force_output,    1, 0, 1, false, "@MASS [LEVEL]"},
};
// clang-format on

std::vector<Keyword> all_keywords() {
  std::vector<Keyword> all(std::begin(fixed), std::end(fixed));
  for (std::size_t law = 0; law < law_table().size(); ++law) {
    for (const LawWord& word : law_table()[law].words) {
      // Several laws may share a word; the reader takes the first of them.
      const bool is_known =
          std::ranges::any_of(all, [&](const Keyword& known) { return known.word == word.word; });
      if (!word.word.empty() && !is_known) {
        all.push_back({.word = word.word,
                       .element = Element::link,
                       .references = 2,
                       .least = word.least,
                       .most = word.most,
                       .drawable = false,
                       .arguments = word.arguments,
                       .law = static_cast<Law>(law),
                       .link = &word});
      }
    }
  }
  return all;
}

}  // namespace

std::span<const Keyword> keywords() {
  static const std::vector<Keyword> all = all_keywords();
  return all;
}

}  // namespace ressort::model
