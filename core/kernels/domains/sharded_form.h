// core/kernels: what shards cost that wait for each other.
#pragma once

#include <span>
#include <vector>

#include "core/kernels/estimates.h"
#include "core/kernels/kernel.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

// So many links farther than samples: the last sample's forces are heard, too, and those at a point
// are those at the nodes around it, of which the shard owns one.
inline constexpr std::uint32_t spare_levels = 2;
inline constexpr std::uint32_t most_levels = max_block_frames + spare_levels;

// Nanoseconds that shards wait for each other once, and one of them for its copies.
double exchange_ns(std::size_t copies);

// The first sample of a shard that others have driven out of the cache takes so many times longer
// than any other.
inline constexpr double return_share = 1.5;
inline constexpr double copy_ns = 7.0;  // of a node's

// Shards are dealt out to threads in a row, as many to each.
inline std::size_t worker_of(std::size_t shard, std::size_t shards, std::size_t workers) {
  return shard * workers / shards;
}

// What a shard may take of a cache, its coefficients and what it copies among it, and what a
// network takes for which it pays to come back to its shards.
struct Cache {
  double shard_bytes;
  double least_bytes;
};
inline constexpr Cache first_cache{48.0 * 1024.0, 128.0 * 1024.0};
inline constexpr Cache second_cache{1024.0 * 1024.0, 4.0 * 1024.0 * 1024.0};

// How many shards of a network of so many nodes stay in that cache, each while it is stepped: as
// many for each worker, and no more than `most` in all; 1 where the network is too small for that,
// or where helpers work live.
std::size_t shards_in(const Cache& cache, std::size_t nodes, const Workload& load,
                      std::size_t most);

// After how many samples shards had best meet, and what a sample of the slowest worker takes then.
// Farther from each other they wait less often, and have more in common to compute. `at_level`:
// [shard][level to most_levels] nodes that are so many links away from its own, which are at 0.
struct Meeting {
  std::uint32_t frames = 0;
  double ns = 0.0;
};
Meeting best_meeting(std::span<const std::vector<std::size_t>> at_level, double ns_per_node,
                     std::size_t workers);

// What the registry's row of it asks, of one voice in bytes.
double predicted_ns(const Program& program, const Shards& form, const Workload& load);
std::string description(const Program& program, const Shards& form);
std::uint64_t voice_bytes(const Program& program, const Shards& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
