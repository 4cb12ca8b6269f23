// core/engine: kernels that continue from the state of another engine's kernels, within one sample.
#pragma once

#include "core/engine/bank.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// Copies the state of all awake voices from `from` to `bank`, whose forms may differ. Returns
// false, and changes nothing, if a kernel there cannot reconstruct the positions of all masses.
// [audio] wait-free, O(awake voices * (nodes + modes * masses))
template <class T>
bool take_over(Bank<T>& bank, const Bank<T>& from, const Voices& voices);

}  // namespace ressort::engine
