// core/engine: kernels go on where others of the same model are, in the same sample.
#pragma once

#include "core/engine/mixing/bank.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// All kernels of `bank`, with the voices that are awake in `from`. False, and no kernel is changed,
// if one there does not know where all of its masses are. [audio] wait-free,
// O(awake voices * (nodes + modes * masses))
template <class T>
bool take_over(Bank<T>& bank, const Bank<T>& from, const Voices& voices);

}  // namespace ressort::engine
