// core/kernels: a regular network (Grid), its slots side by side in the lanes. One voice.
#pragma once

#include "core/kernels/nodes.h"

namespace ressort::kernels {

inline constexpr std::uint32_t grid_fixed = 0xffffffffu;
inline constexpr std::size_t grid_pushes = 8;  // of a tap: its corners before and after it moved

// Everything that one step of GridKernel touches.
template <class T>
struct GridState {
  Ramps<T> ramps;
  T* x;                        // [slot] position
  T* v;                        // [slot] change of position per sample
  T* force;                    // [slot] of what is not the grid's, used by the next sample
  T* y;                        // [slot] K x + Z v, if there are segments
  T* next_y;                   // [slot] the same of the next sample: `shift` below y, or above it
  std::ptrdiff_t shift;        // as far as any offset
  bool is_forward;             // below, and the slots are to be stepped upwards
  T* link_force;               // [row][slot] if there are no segments: a row for each offset
  T* held;                     // [links][5] coefficients with which those are still to be computed
  const std::uint32_t* stamp;  // [pack of the grid] which weights it has
  // [stamp][row][lane] With segments: where a mass is, and what it misses; else where a mass is,
  // and for each offset where a link is.
  const T* weights;
  const std::uint32_t* offset;  // [row] of all links
  std::size_t rows;
  bool is_fresh;                      // no sample yet: nothing pulls
  const std::uint32_t* inverse_mass;  // [slot] coefficient, or grid_fixed
  std::uint32_t* pushed;              // slots that points push in the next sample
  std::size_t pushes;
  Corners<T>* corners;           // [tap] in this sample
  const PassiveTables& passive;  // ends: slots
  T* memory;                     // [passive link][passive_rows]
  T* solver;                     // PassiveRoom::numbers
  T* awake;                      // 0 in the first sample after set_state(), else 1
};

template <class T>
struct GridLoops {
  void (*step)(const Program& program, const Grid& grid, GridState<T>& state,
               const Block<T>& block);
  // The forces that links exert where all is now, added to those that there are.
  void (*pull)(const Program& program, const Grid& grid, GridState<T>& state);
};

// The functions for packs of so many bytes, which the machine works on whole.
template <Isa isa, class T>
GridLoops<T> grid_loops(std::size_t bytes);

template <class T>
class GridKernel final : public NodeKernel<T> {
 public:
  GridKernel(const Program& program, const Grid& grid, std::size_t voices, Isa isa);
  bool write_nodes(std::span<const std::uint32_t> nodes, const T* x, const T* v) override;
  bool become(const Kernel<T>& from) override;

 private:
  void clear(std::size_t lane) override;
  void play(const Block<T>& block) override;
  GridState<T> state();
  void make_stamps(std::size_t lanes);

  const Grid& grid_;
  GridLoops<T> loops_;
  Aligned<T> y_;
  Aligned<T> link_force_;
  Aligned<T> held_;
  std::vector<std::uint32_t> offset_;
  std::vector<std::uint32_t> stamp_;
  Aligned<T> weights_;
  std::uint32_t shift_;
  std::vector<std::uint32_t> inverse_mass_;
  std::vector<std::uint32_t> pushed_;
  std::size_t pushes_ = 0;
  bool is_forward_ = true;
  bool is_fresh_ = true;
};

}  // namespace ressort::kernels
