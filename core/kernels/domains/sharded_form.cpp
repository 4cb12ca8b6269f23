#include "core/kernels/domains/sharded_form.h"

#include <algorithm>

#include "core/kernels/domains/sharded.h"
#include "core/kernels/registry.h"

namespace ressort::kernels {

double exchange_ns(std::size_t copies) {
  return 3000.0 + copy_ns * static_cast<double>(copies);
}

// Of the slowest shard, and what it waits; on one core of all, and what it takes to come back to
// each.
double predicted_ns(const Program&, const Shards& form, const Workload& load) {
  if (form.executor->size() == 1) {
    double sum = 0.0;
    for (const Shard& shard : *form.shards) {
      sum += (1.0 + return_share / form.frames) * predicted_ns(shard.program, load) +
             copy_ns * static_cast<double>(shard.copies.size()) / form.frames;
    }
    return sum;
  }
  double slowest = 0.0;
  for (const Shard& shard : *form.shards) {
    slowest = std::max(slowest, predicted_ns(shard.program, load) +
                                    exchange_ns(shard.copies.size()) / form.frames);
  }
  return slowest;
}

std::string description(const Program&, const Shards& form) {
  return "in " + std::to_string(form.shards->size()) +
         (form.executor->size() > 1 ? " shards at once" : " shards one after the other") +
         ", which meet every " + count_of(form.frames, "sample", "samples");
}

std::uint64_t voice_bytes(const Program&, const Shards& form, std::uint64_t number_bytes) {
  std::uint64_t bytes = 0;
  for (const Shard& shard : *form.shards) {
    bytes += voice_bytes(shard.program, number_bytes);
  }
  return bytes;
}

}  // namespace ressort::kernels
