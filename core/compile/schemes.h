// core/compile: which links are computed by a scheme that cannot gain energy, and why.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/analysis/interval.h"
#include "core/compile/machine.h"
#include "core/model/network.h"
#include "core/model/preset/budget.h"
#include "core/model/preset/preset.h"
#include "core/progress.h"

namespace ressort {

struct Schemes {
  std::vector<LinkScheme> links;   // [link] of a network without macros
  std::vector<std::string> notes;  // a sentence for every kind of decision that is not plain
};

// Where a network is played, at its worst.
struct Conditions {
  ParameterBox box;
  double rate_ratio = 1.0;        // 44100 / rate
  double stiffness_factor = 1.0;  // of the highest key
};

// The published scheme wherever it is safe with the parameters anywhere in the box, or by what the
// budget says of passivity; `forced` links (indices) are passive in any case. With g the sum of
// the inverse masses of a link's ends, as small as these masses may be:
//   contacts  plain while K g <= 0.08: at most a percent of speed gained at each touch (K g / 8),
//             and Z g <= 0.5
//   bows      plain while Z g <= 0.3, discrete gradient up to 2.5, above in substeps
//   plucks    plain while 0.9 K g <= 2; else substeps. Where the budget asks for the continuous
//             network, also if a hand of the preset passes 2 scale in less than 20 samples: as
//             published such a pluck is a lottery, but a bounded one
//   springs   that grow stiffer: plain while (dF/dd) g <= 1.5 at the farthest that is known, by
//             where masses start and how hands are driven and struck
// For a network without macros. O(links + masses + controls). [any thread but audio]
Schemes choose_schemes(const Network& network, const Preset& preset, const Conditions& conditions,
                       const Budget& budget, const std::vector<std::uint32_t>& forced,
                       const Progress& progress = {});

// The network without the links that their scheme keeps stable whatever their numbers are: what
// remains is what a proof of stability has to be about. Springs keep their K and Z. Macros are
// written out only where a link goes. O(n). [any thread but audio]
Network without_passive(const Network& network, std::span<const LinkScheme> schemes);

}  // namespace ressort
