// core/kernels: the cost of shards that wait for each other.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "core/kernels/kernel.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

struct Workload;

// A large network divided into shards (sharded.h), each in a form of its own. An executor steps
// them on several cores at the same time.
struct Shard;
class Executor;
struct Shards {
  std::shared_ptr<const std::vector<Shard>> shards;
  Executor* executor = nullptr;  // outlives the kernels
  std::uint32_t frames = 1;      // number of samples that shards step without synchronisation
};

// The halo is this much deeper than the number of samples: one level for the last sample's forces
// at outputs, and one because a point's force acts on all nodes around it, of which the shard owns
// one.
inline constexpr std::uint32_t spare_levels = 2;
inline constexpr std::uint32_t most_levels = max_block_frames + spare_levels;

// Returns the time of one synchronisation of the shards, and of one shard's copies, in ns.
double exchange_ns(std::size_t copies);

// The first sample of a shard that was evicted from the cache takes this much longer.
inline constexpr double return_share = 1.5;
inline constexpr double copy_ns = 7.0;  // Per node.

// Distributes consecutive shards evenly to workers.
inline std::size_t worker_of(std::size_t shard, std::size_t shards, std::size_t workers) {
  return shard * workers / shards;
}

// The share of a cache that one shard may use, including coefficients and copies, and the size of a
// network for which several shards per worker pay.
struct Cache {
  double shard_bytes;
  double least_bytes;
};
inline constexpr Cache first_cache{48.0 * 1024.0, 128.0 * 1024.0};
inline constexpr Cache second_cache{1024.0 * 1024.0, 4.0 * 1024.0 * 1024.0};

// Returns the number of shards for which each stays in that cache while it is stepped: the same
// number for each worker, at most `most` in all; 1 if the network is too small, or if helpers work
// live.
std::size_t shards_in(const Cache& cache, std::size_t nodes, const Workload& load,
                      std::size_t most);

// The best number of samples between synchronisations, and the time per sample of the slowest
// worker. A longer interval means fewer waits and deeper halos. `at_level`: [shard][level up to
// most_levels] number of nodes at this distance in links; own nodes are at level 0.
struct Meeting {
  std::uint32_t frames = 0;
  double ns = 0.0;
};
Meeting best_meeting(std::span<const std::vector<std::size_t>> at_level, double ns_per_node,
                     std::size_t workers);

// Functions for the registry's row; memory is per voice, in bytes.
double operations(const Program& program, const Shards& form, const Workload& load);
std::string description(const Program& program, const Shards& form);
std::uint64_t voice_bytes(const Program& program, const Shards& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
