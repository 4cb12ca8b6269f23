#include "core/kernels/domains/halos.h"

#include <algorithm>

namespace ressort::kernels {

void join_halos(std::span<Shard> shards, std::span<const std::uint32_t> owner_of) {
  std::vector<std::vector<std::uint32_t>> owners(shards.size());  // [shard][copy]
  std::vector<std::vector<std::uint32_t>> wanted(shards.size());  // [owner] Nodes, ascending.
  for (std::uint32_t s = 0; s < shards.size(); ++s) {
    for (std::uint32_t i = 0; i < shards[s].nodes.size(); ++i) {
      const std::uint32_t owner = owner_of[shards[s].nodes[i]];
      if (owner != s && owner != nobody) {
        shards[s].copies.push_back(i);
        owners[s].push_back(owner);
        wanted[owner].push_back(shards[s].nodes[i]);
      }
    }
  }
  const auto place = [](const std::vector<std::uint32_t>& nodes, std::uint32_t node) {
    return static_cast<std::uint32_t>(std::lower_bound(nodes.begin(), nodes.end(), node) -
                                      nodes.begin());
  };
  for (std::uint32_t s = 0; s < shards.size(); ++s) {
    std::sort(wanted[s].begin(), wanted[s].end());
    wanted[s].erase(std::unique(wanted[s].begin(), wanted[s].end()), wanted[s].end());
    shards[s].given.resize(wanted[s].size());
    for (std::uint32_t i = 0; !wanted[s].empty() && i < shards[s].nodes.size(); ++i) {
      const std::uint32_t node = shards[s].nodes[i];
      const std::uint32_t at = place(wanted[s], node);
      if (at < wanted[s].size() && wanted[s][at] == node) {
        shards[s].given[at] = i;
      }
    }
  }
  for (std::uint32_t s = 0; s < shards.size(); ++s) {
    auto& sources = shards[s].sources;
    for (std::size_t i = 0; i < shards[s].copies.size(); ++i) {
      const std::uint32_t owner = owners[s][i];
      const std::uint32_t at = place(wanted[owner], shards[s].nodes[shards[s].copies[i]]);
      if (sources.empty() || sources.back().shard != owner ||
          sources.back().first + sources.back().count != at) {
        sources.push_back({owner, at, 0});
      }
      ++sources.back().count;
    }
  }
}

}  // namespace ressort::kernels
