#include "core/kernels/domains/sharded_form.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/kernels/domains/executor.h"
#include "core/kernels/domains/sharded.h"
#include "core/kernels/estimates.h"
#include "core/kernels/registry.h"

namespace ressort::kernels {

double exchange_ns(std::size_t copies) {
  return 3000.0 + copy_ns * static_cast<double>(copies);
}

std::size_t shards_in(const Cache& cache, std::size_t nodes, const Workload& load,
                      std::size_t most) {
  const std::size_t workers = load.executor != nullptr ? load.executor->size() : 1;
  const double bytes =
      4.0 * bytes_of_number(load) * static_cast<double>(nodes) / static_cast<double>(workers);
  if ((workers > 1 && load.executor->is_live()) || bytes < cache.least_bytes) {
    return 1;
  }
  const auto wanted = static_cast<std::size_t>(std::ceil(bytes / cache.shard_bytes));
  return workers * std::clamp<std::size_t>(most / workers, 1, wanted);
}

namespace {

// Returns the time of the slowest worker if each works through its shards; `own(shard)` is the time
// of one, without waiting.
template <class Own>
double slowest_worker_ns(std::size_t shards, std::size_t workers, double frames, Own&& own) {
  std::vector<double> sums(workers);
  for (std::size_t i = 0; i < shards; ++i) {
    sums[worker_of(i, shards, workers)] += own(i);
  }
  return *std::max_element(sums.begin(), sums.end()) +
         (workers > 1 ? exchange_ns(0) / frames : 0.0);
}

}  // namespace

Meeting best_meeting(std::span<const std::vector<std::size_t>> at_level, double ns_per_node,
                     std::size_t workers) {
  const double first_share = at_level.size() > workers ? return_share : 1.0;
  Meeting best{.ns = std::numeric_limits<double>::infinity()};
  for (std::uint32_t frames = 4; frames <= max_block_frames; frames *= 2) {
    const double ns = slowest_worker_ns(at_level.size(), workers, frames, [&](std::size_t i) {
      const auto end = at_level[i].begin() + frames + spare_levels + 1;
      const auto nodes = std::accumulate(at_level[i].begin(), end, std::size_t{0});
      return ns_per_node * static_cast<double>(nodes) * (1.0 + first_share / frames) +
             copy_ns * static_cast<double>(nodes - at_level[i][0]) / frames;
    });
    if (ns < best.ns) {
      best = {frames, ns};
    }
  }
  return best;
}

// Returns the operations of the slowest worker. A worker with several shards also fetches each of
// them from memory again.
double operations(const Program&, const Shards& form, const Workload& load) {
  const std::vector<Shard>& shards = *form.shards;
  const std::size_t workers = std::min(form.executor->size(), shards.size());
  const double first_share = shards.size() > workers ? return_share : 0.0;
  const auto own_ns = [&](std::size_t i) {
    return (1.0 + first_share / form.frames) * estimated_ns(shards[i].program, load) +
           copy_ns * static_cast<double>(shards[i].copies.size()) / form.frames;
  };
  return slowest_worker_ns(shards.size(), workers, form.frames, own_ns) / nominal_ns;
}

std::string description(const Program&, const Shards& form) {
  const std::size_t workers = form.executor->size();
  const std::size_t shards = form.shards->size();
  return "in " + std::to_string(shards) +
         (workers == 1       ? " shards one after the other"
          : workers < shards ? " shards, " + std::to_string(workers) + " at once"
                             : " shards at once") +
         ", synchronised every " + count_of(form.frames, "sample", "samples");
}

std::uint64_t voice_bytes(const Program&, const Shards& form, std::uint64_t number_bytes) {
  std::uint64_t bytes = 0;
  for (const Shard& shard : *form.shards) {
    bytes += voice_bytes(shard.program, number_bytes);
  }
  return bytes;
}

}  // namespace ressort::kernels
