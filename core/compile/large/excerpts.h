// core/compile: networks that are too large to be written out at once.
//
// In a macro all nodes are alike. So what is decided once, of forms, coefficients, stability, is
// decided by an excerpt of the network, in which macros have the nodes around their places and a
// few more; and each shard of it is made from an excerpt of its own, by who steps it, so that no
// process ever has all of the network, and none has more of it as names and formulas than a shard.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/compile/machine.h"
#include "core/kernels/estimates.h"
#include "core/kernels/program.h"
#include "core/model/network.h"
#include "core/model/topology.h"
#include "core/progress.h"

namespace ressort::compile {

class Excerpts {
 public:
  // Of a network that is worth it: large macros, held together by places that stay and by few
  // elements more, of which nothing is left out, and which the edge bound says is stable as it
  // starts. `start`: [parameter]. [any thread but audio]
  static std::optional<Excerpts> of(const Network& written, std::span<const double> start,
                                    double rate_ratio);

  const Network& network() const { return network_; }  // the excerpt that stands for the whole
  std::uint64_t masses() const { return masses_; }     // of the whole
  std::uint64_t links() const { return links_; }

  // The whole's shards in the direct form, of which other processes' lack all but what they give
  // and what is heard of them. `excerpt`: the only part of network() as tabulate() makes it.
  // [any thread but audio]
  Shards share_out(const Program& excerpt, const Workload& load, bool rescale,
                   const Progress& progress) const;

 private:
  Excerpts() = default;

  const Network* written_ = nullptr;
  std::vector<std::vector<NodeRange>> ranges_;  // [macro] what the excerpt has of it
  Network network_;
  Share share_;  // what is played of that
  std::uint64_t masses_ = 0;
  std::uint64_t links_ = 0;
};

}  // namespace ressort::compile
