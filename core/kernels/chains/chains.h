// core/kernels: strings and chains. The masses of a chain are folded into lanes, such that each
// mass's neighbours lie in the packs before and after its own. One pass over memory then computes
//  y = K x + Z v,  v += (y[i-1] - 2 y[i] + y[i+1])/M,  x += v
// (symplectic Euler, the 1-D wave equation). A stiff chain has a second y over the masses two
// places away. One chain that is short enough stays in registers for a block of samples. All other
// links and masses are stepped one by one. Their forces on a chain's mass are added to v and x
// after the pass, which is equivalent to adding them to the sum.
#pragma once

#include <utility>

#include "core/kernels/chains/chains_form.h"
#include "core/kernels/nodes.h"

namespace ressort::kernels {

// Index of a node's position in ChainsState::bodies; its velocity is one pack further. Bodies are
// pairs of packs: positions and velocities.
using ChainPlace = std::uint32_t;
inline constexpr std::uint32_t nowhere = 0xffffffffu;

// A chain of n masses in `packs` pairs: mass i is in lane i / packs of the pair i % packs.
struct FoldedChain {
  ChainPlace first = 0;
  std::uint32_t packs = 0;
  std::uint32_t last = 0;     // Pair of its last mass.
  ChainPlace left = nowhere;  // Place of the node that holds the end; nowhere: free.
  ChainPlace right = nowhere;
  bool is_stiff = false;
  std::array<ChainPlace, 2> second_left{nowhere, nowhere};  // Same meaning as in Chain.
  std::array<ChainPlace, 2> second_right{nowhere, nowhere};
  // Coefficients K and Z, then those of the second springs.
  std::array<std::uint32_t, 4> springs{};
  MassRun mass;
};

// A mass of a chain with other links or inputs.
struct ChainSite {
  ChainPlace pair = 0;
  std::uint32_t unit = 0;          // Pack of ChainsState::units for its lane.
  std::uint32_t inverse_mass = 0;  // Coefficient.
};

// The same for a chain in registers.
struct ShortSite {
  std::uint32_t pack = nowhere;
  std::uint32_t unit = 0;
  std::uint32_t force = 0;  // Index into ChainsState::force.
};

struct LoosePlaces {
  MassRun mass;             // Coefficients.
  std::uint32_t count = 0;  // Length of the run in ChainsTables::loose.
};

struct PlacedEnds {
  ChainPlace a = 0;
  ChainPlace b = 0;
  std::uint32_t force_a = 0;  // Index into ChainsState::force.
  std::uint32_t force_b = 0;
};

struct PlacedInput {
  ChainPlace place = 0;
  std::uint32_t force = 0;
  std::uint32_t index = 0;  // Index into Program::inputs.
};

// A spring of a chain at a node whose force is an output.
struct Probe {
  ChainPlace neighbour = 0;
  std::uint32_t stiffness = 0;  // Coefficients.
  std::uint32_t damping = 0;
};

struct HeardPosition {
  ChainPlace place = 0;
  std::uint32_t index = 0;  // Index into Program::outputs.
};

struct HeardForce {
  ChainPlace place = 0;
  std::uint32_t index = 0;
  std::uint32_t force = 0;
  std::uint32_t first = 0;  // First of ChainsTables::probes.
  std::uint32_t count = 0;
};

// A node under a point: its forces go to a force slot, or directly to a chain's mass.
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

// A node, for passive links.
struct PassiveEnd {
  ChainPlace place = 0;
  std::uint32_t unit = nowhere;          // Same meaning as in ChainSite, if the node is in a chain.
  std::uint32_t inverse_mass = nowhere;  // Coefficient, if the node moves.
};

// Tables derived once from a Program and the number of lanes.
struct ChainsTables {
  std::vector<ChainPlace> place;  // [node]
  std::vector<FoldedChain> chains;
  std::vector<ChainSite> sites;  // [force] The first force slots.
  std::vector<LoosePlaces> loose_runs;
  std::vector<ChainPlace> loose;  // [force - sites]
  std::vector<LinkRun> link_runs;
  std::vector<PlacedEnds> ends;         // [link]
  std::vector<std::uint32_t> listened;  // Force slots of fixed nodes, for outputs.
  std::vector<PlacedInput> positions;
  std::vector<PlacedInput> forces;
  std::vector<HeardPosition> heard_positions;
  std::vector<HeardForce> heard_forces;
  std::vector<Probe> probes;
  std::vector<PlacedTap> taps;
  std::vector<PlacedNode> tap_nodes;     // Parallel to those of the Program.
  std::vector<PassiveEnd> passive_ends;  // [node] Only with passive links.
  // Slots of sites, loose masses, listened nodes and points, then those that are never read.
  std::size_t force_count = 0;
  std::size_t pairs = 0;
  // Used if one chain stays in registers:
  std::vector<ShortSite> short_sites;  // Sorted by pack; the last one is in none.
  std::uint32_t short_read = 0;        // Bit mask of its pairs that others read.
  ChainPlace short_end = nowhere;      // The empty place after its last mass, if there is one.
};

// All data that one step of ChainsKernel reads and writes.
template <class T>
struct ChainsState {
  Ramps<T> ramps;
  // [chain][4][lane] 1 or 0: the place holds a mass, in the last mass's pair; the place is beyond
  // it; the place is the last mass, in its pair; the place is the last mass but one.
  const T* masks;
  const T* units;       // [lane][lane] Identity matrix.
  T* bodies;            // [pair][position or velocity][lane]
  T* held;              // [chain][4] Spring coefficients of the last sample: 0 at the start.
  T* force;             // [force] Summed by the links, applied in the next sample.
  Corners<T>* corners;  // [tap] Of this sample.
  T* tap_pull;          // [tap] Force of this sample's links, applied in the next one.
  const PassiveTables& passive;
  T* memory;  // [passive link][passive_rows]
  T* solver;  // Size: PassiveRoom::numbers.
  T* awake;   // 0 in the first sample after set_state(), else 1.
};

template <class T>
using ChainsStep = void (*)(const Program& program, const ChainsTables& tables,
                            ChainsState<T>& state, const Block<T>& block);

template <class T>
struct ChainsLoops {
  ChainsStep<T> step;
};

// Returns the functions for packs of this size.
template <Isa isa, class T>
ChainsLoops<T> chains_loops(std::size_t bytes);

// Numbers of packs for which a step in registers exists, and that step; null if the instruction set
// has too few registers.
using ShortPacks = std::index_sequence<1, 2, 3, 4, 5, 6, 8, 10, 13>;
template <Isa isa, class T>
ChainsStep<T> short_chain_step(std::size_t bytes, std::size_t packs);

struct FoldedBy;
template <class T>
class ChainsKernel final : public NodeKernel<T> {
 public:
  ChainsKernel(const Program& program, const Chains& form, std::size_t voices, Isa isa);
  bool copy_from(const Kernel<T>& from) override;

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
