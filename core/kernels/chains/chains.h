// core/kernels: strings. The masses of a chain lie in lanes so that each one's neighbours are in
// the packs before and after its own, and one pass over memory does it all:
//   y = K x + Z v,  v += (y[i-1] - 2 y[i] + y[i+1])/M,  x += v
// A stiff one has a second y, from two masses before and behind.
// One chain that is short enough stays in registers for a block of samples.
// All other links and masses are stepped number by number; what they do to a chain's mass is added
// after the pass, to v and to x, which is the same as if it had been in the sum.
#pragma once

#include <utility>

#include "core/kernels/nodes.h"

namespace ressort::kernels {

// Where a node's position is among the numbers of ChainsState::bodies; its velocity is one pack
// further. Bodies are pairs of packs, positions and velocities.
using ChainPlace = std::uint32_t;
inline constexpr std::uint32_t nowhere = 0xffffffffu;

// A chain of n masses in `packs` pairs: mass i is in lane i / packs of the pair i % packs.
struct FoldedChain {
  ChainPlace first = 0;
  std::uint32_t packs = 0;
  std::uint32_t last = 0;     // the pair that its last mass is in
  ChainPlace left = nowhere;  // of what holds the ends, nowhere: free
  ChainPlace right = nowhere;
  bool is_stiff = false;
  std::array<ChainPlace, 2> second_left{nowhere, nowhere};  // as in Chain
  std::array<ChainPlace, 2> second_right{nowhere, nowhere};
  std::array<std::uint32_t, 4> springs{};  // coefficients: K and Z, those of the second springs
  MassRun mass;
};

// A mass of a chain that more than its chain acts on.
struct ChainSite {
  ChainPlace pair = 0;
  std::uint32_t unit = 0;          // of ChainsState::units: its lane's pack
  std::uint32_t inverse_mass = 0;  // coefficient
};

// The same in a chain that stays in registers.
struct ShortSite {
  std::uint32_t pack = nowhere;
  std::uint32_t unit = 0;
  std::uint32_t force = 0;  // of ChainsState::force
};

struct LoosePlaces {
  MassRun mass;             // coefficients
  std::uint32_t count = 0;  // of the next of ChainsTables::loose
};

struct PlacedEnds {
  ChainPlace a = 0;
  ChainPlace b = 0;
  std::uint32_t force_a = 0;  // of ChainsState::force
  std::uint32_t force_b = 0;
};

struct PlacedInput {
  ChainPlace place = 0;
  std::uint32_t force = 0;
  std::uint32_t index = 0;  // of Program::inputs
};

// A spring of a chain, seen from a node whose force somebody listens to.
struct Probe {
  ChainPlace neighbour = 0;
  std::uint32_t stiffness = 0;  // coefficients
  std::uint32_t damping = 0;
};

struct HeardPosition {
  ChainPlace place = 0;
  std::uint32_t index = 0;  // of Program::outputs
};

struct HeardForce {
  ChainPlace place = 0;
  std::uint32_t index = 0;
  std::uint32_t force = 0;
  std::uint32_t first = 0;  // of ChainsTables::probes
  std::uint32_t count = 0;
};

// A node under a point: what acts on it is added to a force, or to a chain's mass itself.
struct PlacedNode {
  ChainPlace place = 0;
  std::uint32_t force = nowhere;
  ChainSite site;
};

struct PlacedTap {
  TapSlot slot;
  ChainPlace place = 0;
  std::uint32_t force = 0;
};

// A node, for links whose force is not the plain one.
struct PassiveEnd {
  ChainPlace place = 0;
  std::uint32_t unit = nowhere;          // if it is in a chain, as ChainSite says
  std::uint32_t inverse_mass = nowhere;  // coefficient, if it moves
};

// What a kernel makes of a Program and its lanes, once.
struct ChainsTables {
  std::vector<ChainPlace> place;  // [node]
  std::vector<FoldedChain> chains;
  std::vector<ChainSite> sites;  // [force], the first of them
  std::vector<LoosePlaces> loose_runs;
  std::vector<ChainPlace> loose;  // [force - sites]
  std::vector<LinkRun> link_runs;
  std::vector<PlacedEnds> ends;         // [link]
  std::vector<std::uint32_t> listened;  // forces on what does not move, for outputs
  std::vector<PlacedInput> positions;
  std::vector<PlacedInput> forces;
  std::vector<HeardPosition> heard_positions;
  std::vector<HeardForce> heard_forces;
  std::vector<Probe> probes;
  std::vector<PlacedTap> taps;
  std::vector<PlacedNode> tap_nodes;     // those of the Program
  std::vector<PassiveEnd> passive_ends;  // [node], if there are passive links
  std::size_t force_count = 0;           // sites, loose masses, listened, points, those never read
  std::size_t pairs = 0;
  // If there is one chain that stays in registers:
  std::vector<ShortSite> short_sites;  // pack by pack, and one that is in none
  std::uint32_t short_read = 0;        // its pairs that others read: a bit each
  ChainPlace short_end = nowhere;      // the empty place next to its last mass, if there is one
};

// Everything that one step of ChainsKernel touches.
template <class T>
struct ChainsState {
  Ramps<T> ramps;
  const T* masks;  // [chain][4][lane] 1 or 0: is a mass here, up to the last one's pair; is one
                   // beyond it; is it the last, in its pair; is it the last but one
  const T* units;  // [lane][lane] 1 where both are the same
  T* bodies;       // [pair][position or velocity][lane]
  T* held;         // [chain][4] the springs that forces of the last sample had: 0 at the start
  T* force;        // [force] summed by the links, used by the next sample
  Corners<T>* corners;  // [tap] in this sample
  T* tap_pull;          // [tap] what the links of this sample do to it, for the next one
  const PassiveTables& passive;
  T* memory;  // [passive link][passive_rows]
  T* solver;  // PassiveRoom::numbers
  T* awake;   // 0 in the first sample after set_state(), else 1
};

template <class T>
using ChainsStep = void (*)(const Program& program, const ChainsTables& tables,
                            ChainsState<T>& state, const Block<T>& block);

template <class T>
struct ChainsLoops {
  ChainsStep<T> step;
  // The forces that links exert where all is now, added to those that there are.
  void (*pull)(const ChainsTables& tables, ChainsState<T>& state);
};

// The functions for packs of so many bytes.
template <Isa isa, class T>
ChainsLoops<T> chains_loops(std::size_t bytes);

// How many packs a chain may have that stays in registers, and its step; null where there are too
// few registers for it.
using ShortPacks = std::index_sequence<1, 2, 3, 4, 5, 6, 8, 10, 13>;
template <Isa isa, class T>
ChainsStep<T> short_chain_step(std::size_t bytes, std::size_t packs);

struct FoldedBy;
template <class T>
class ChainsKernel final : public NodeKernel<T> {
 public:
  ChainsKernel(const Program& program, const Chains& form, std::size_t voices, Isa isa);
  bool write_nodes(std::span<const std::uint32_t> nodes, const T* x, const T* v) override;
  bool become(const Kernel<T>& from) override;

 private:
  ChainsKernel(const Program& program, const Chains& form, ChainsTables tables, FoldedBy by,
               Isa isa);
  void clear(std::size_t lane) override;
  void play(const Block<T>& block) override;
  ChainsState<T> state();

  ChainsTables tables_;
  ChainsLoops<T> loops_;
  Aligned<T> masks_;
  Aligned<T> units_;
  Aligned<T> held_;
  Aligned<T> force_;
  Aligned<T> tap_pull_;
};

}  // namespace ressort::kernels
