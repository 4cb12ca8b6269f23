// core/kernels: a regular network (Grid) whose slots lie side by side in the lanes. One voice.
#pragma once

#include "core/kernels/grid/grid_form.h"
#include "core/kernels/nodes.h"

namespace ressort::kernels {

inline constexpr std::uint32_t grid_fixed = 0xffffffffu;
// Slots written per tap: its corners before and after it moved.
inline constexpr std::size_t grid_pushes = 8;

// All data that one step of GridKernel reads and writes.
template <class T>
struct GridState {
  Ramps<T> ramps;
  T* x;                  // [slot] Position.
  T* v;                  // [slot] Change of position per sample.
  T* force;              // [slot] Force of links outside the grid, applied in the next sample.
  T* y;                  // [slot] K x + Z v, if there are segments.
  T* next_y;             // [slot] The same for the next sample, stored `shift` below y or above it.
  std::ptrdiff_t shift;  // At least the largest offset.
  bool is_forward;       // True: below y, and the slots are stepped upwards.
  T* link_force;         // [row][slot] Without segments: one row per offset.
  T* held;               // [links][5] Coefficients for link forces not computed yet.
  const std::uint32_t* stamp;  // [pack of the grid] Index of its weights.
  // [stamp][row][lane] With segments: 1 where a mass is, and the number of missing neighbours.
  // Without: 1 where a mass is, and for each offset 1 where a link is.
  const T* weights;
  const std::uint32_t* offset;  // [row] Of all links.
  std::size_t rows;
  bool is_fresh;                      // True before the first sample: no forces yet.
  const std::uint32_t* inverse_mass;  // [slot] Coefficient, or grid_fixed.
  std::uint32_t* pushed;              // Slots pushed by points in the next sample.
  std::size_t pushes;
  Corners<T>* corners;           // [tap] Of this sample.
  const PassiveTables& passive;  // Their ends are slots.
  T* memory;                     // [passive link][passive_rows]
  T* solver;                     // Size: PassiveRoom::numbers.
  T* awake;                      // 0 in the first sample after set_state(), else 1.
};

template <class T>
using GridStep = void (*)(const Program& program, const Grid& grid, GridState<T>& state,
                          const Block<T>& block);

template <Isa isa, class T>
GridStep<T> grid_step();

template <class T>
class GridKernel final : public NodeKernel<T> {
 public:
  GridKernel(const Program& program, const Grid& grid, std::size_t voices, Isa isa);
  bool copy_from(const Kernel<T>& from) override;

 private:
  void clear(std::size_t lane) override;
  void play(const Block<T>& block) override;
  GridState<T> state();
  void make_stamps(std::size_t lanes);

  const Grid& grid_;
  GridStep<T> step_;
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
