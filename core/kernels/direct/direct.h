// core/kernels: the published scheme, mass by mass and link by link, one voice in each lane. It
// runs every Program and is the reference for all other kernels.
//
// The scheme is symplectic Euler. The published form is Störmer-Verlet, x[n+1] = 2 x[n] - x[n-1] +
// F/M, which is the same method with x[n] - x[n-1] in place of a velocity (Hairer, Lubich and
// Wanner, Acta Numerica 12, 2003). Position and velocity are kept instead: the velocity is a small
// number of its own instead of the difference of two large ones, which is worth 10 to 80 dB in
// single precision.
#pragma once

#include "core/kernels/direct/direct_form.h"
#include "core/kernels/nodes.h"
#include "core/kernels/waveguides/rails.h"

namespace ressort::kernels {

// Pointers to the state of a kernel, for its loops. Rows are [node][lane].
template <class T>
struct DirectState {
  DirectState(Ramps<T> ramps_in, Nodes<T>& nodes)
      : ramps(ramps_in),
        x(nodes.row(0)),
        v(nodes.row(1)),
        force(nodes.row(2)),
        corners(nodes.corners.data()),
        placed(nodes.places.placed.data()),
        place_weights(nodes.places.weights.data()),
        place_nodes(nodes.places.nodes.data()),
        first_of_place(nodes.places.first.data()),
        count_of_place(nodes.places.count.data()),
        nodes(nodes.layout.node.size()),
        passive(nodes.passive.tables),
        inverse_mass(nodes.passive.inverse_mass.data()),
        memory(nodes.passive.memory.data()),
        solver(nodes.passive.numbers.data()),
        awake(nodes.passive.awake.data()),
        felt(nodes.passive.felt_or_null()) {}

  Ramps<T> ramps;
  T* x;                 // position
  T* v;                 // change of position per sample
  T* force;             // sum over the links, for the next sample
  Corners<T>* corners;  // [tap][lane] of this sample
  T* placed;            // PlaceRoom
  T* place_weights;
  std::uint32_t* place_nodes;
  const std::size_t* first_of_place;
  std::uint32_t* count_of_place;
  std::size_t nodes;
  const PassiveTables& passive;
  const std::uint32_t* inverse_mass;  // [moving node] coefficient, if there are passive links
  T* memory;                          // [passive link][passive_rows][lane]
  T* solver;                          // PassiveRoom::numbers
  T* awake;                           // [lane] 0 in the sample after set_state(), else 1
  T* felt;                    // [node][lane] forces of passive links; null if no output needs them
  Rails<T>* rails = nullptr;  // null if there are no waveguides
};

template <class T>
struct DirectLoops {
  void (*step)(const Program& program, DirectState<T>& state, const Block<T>& block);
};

// Returns the loops for lanes that fill `bytes` bytes.
template <Isa isa, class T>
DirectLoops<T> direct_loops(std::size_t bytes);

template <class T>
class DirectKernel final : public NodeKernel<T> {
 public:
  DirectKernel(const Program& program, const Direct& form, std::size_t voices, Isa isa);
  bool copy_from(const Kernel<T>& from) override {
    this->copy_nodes(from);
    return rails_.is_empty();
  }
  std::size_t read_waveguide(std::size_t lane, std::size_t guide,
                             std::span<double> numbers) const override {
    return rails_.read_positions(lane, guide, numbers);
  }
  // For tests, which add up the energy of the waves.
  const Rails<T>& rails() const { return rails_; }

 private:
  void play(const Block<T>& block) override;
  bool keeps_forces() const override { return true; }
  void clear(std::size_t lane) override { rails_.clear(lane); }
  bool is_quiet(std::size_t lane, double bound) const override {
    return rails_.is_quiet(lane, bound);
  }
  DirectState<T> state();

  DirectLoops<T> loops_;
  Rails<T> rails_;
};

}  // namespace ressort::kernels
