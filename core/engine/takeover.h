// core/engine: kernels that continue from the state of another engine's kernels, within one sample.
#pragma once

#include "core/engine/bank.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// Returns false if a kernel of `from` cannot reconstruct the positions of all masses. Overwrites
// the scratch memory of `bank`. [audio] wait-free, O(awake voices * (nodes + modes * masses))
template <class T>
bool can_take_over(Bank<T>& bank, const Bank<T>& from, const Voices& voices);

// Copies the state of all awake voices from `from` to `bank`, whose forms may differ. Called if
// can_take_over(). [audio] wait-free, as above
template <class T>
void take_over(Bank<T>& bank, const Bank<T>& from, const Voices& voices);

}  // namespace ressort::engine
