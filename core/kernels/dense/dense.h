// core/kernels: a small body in one voice, by dense matrices.
//
// Between contacts the body is linear: with its state s (positions and velocities), what is heard
// for the next dense_frames samples is a product of s with rows C A^k, time in the lanes, plus
// impulse responses where a force or a hand acts; then s jumps by A^dense_frames. Links of any
// other law are ports: unless a bound shows that they stay away, their free motion over the block
// is computed first, and if one of them comes into the zone where its law acts, the block ends
// there ("block step"). From there on, and while coefficients move, the body goes sample by sample,
// with the masses in the lanes ("sample steps"). Where the one link of a small body stays on a
// straight piece of its law it is a spring there, and the body linear once more: it goes four
// samples at a time, its state in registers ("strides").
#pragma once

#include <array>

#include "core/kernels/kernel.h"

namespace ressort::kernels {

inline constexpr std::size_t dense_frames = 64;  // of a block step; at most
inline constexpr std::size_t driven_frames =
    32;  // of a block step with forces: their work is quadratic
inline constexpr std::size_t dense_powers = 7;  // of A: 1, 2, 4 ... dense_frames
inline constexpr std::size_t dense_pad = 8;     // numbers beyond a row that a pack may write

inline constexpr std::size_t own_vectors = 4;  // of DenseBody::matrix, before its columns

inline constexpr std::uint32_t no_input = 0xffffffffu;

// Slots are where a node's x and v are in sample steps: masses at [0, stride), others after them.
// A mass has the same number in the state. That of the first port is 0, its other one 1.
struct DenseLink {
  Law law{};
  std::array<std::uint32_t, most_law_arguments> coefficients{};
  std::uint32_t a = 0;  // slots
  std::uint32_t b = 0;
  std::uint32_t input_a = no_input;  // inputs, where such an end is moved by one
  std::uint32_t input_b = no_input;
  bool a_moves = false;  // is a mass
  bool b_moves = false;
};

struct DenseInput {
  std::uint32_t input = 0;
  std::uint32_t slot = 0;
};

// What drives the state besides itself: a force; or one of the two numbers of a hand that pulls a
// spring, which acts a sample later.
struct DenseSignal {
  enum class Kind : std::uint8_t { force, position, velocity };
  Kind kind = Kind::force;
  std::uint32_t input = 0;
  std::uint32_t at = 0;  // the mass, or the index in `sources`
};

// Everything the loops touch. Matrices are of columns: the effect of one number on all masses.
template <class T>
struct DenseBody {
  std::size_t masses = 0;
  std::size_t stride = 0;   // masses, rounded up to the packs of sample steps
  std::size_t columns = 0;  // of the state: x, v of each mass; and 1 if something is constant
  std::size_t rows = 0;     // columns, rounded up to the widest packs
  std::size_t fixed = 0;    // nodes that are no masses
  std::size_t driven_count = 0;
  std::size_t pushes = 0;
  std::size_t outputs = 0;
  std::size_t ports = 0;
  std::size_t signals = 0;
  std::size_t sources = 0;
  std::size_t matrix_vectors = 0;  // in `matrix`

  const DenseLink* port = nullptr;        // [port]
  const DenseSignal* signal = nullptr;    // [signal]
  const std::uint32_t* source = nullptr;  // [source] the slot of a fixed node with springs
  const DenseInput* driven = nullptr;     // [driven_count] an input that moves a slot
  const DenseInput* push = nullptr;       // [push] acts on a mass
  const std::uint32_t* heard = nullptr;   // [output] mass
  const T* unit = nullptr;                // [push or port][stride] what its force is to the masses

  Ramps<T> ramps{};
  // Of sample steps, `stride` numbers in each vector: 1/M; the own stiffness, damping and weight of
  // each mass; then columns: -K of each mass, -(K + Z) of each mass, -K and -Z of each source.
  T* matrix = nullptr;
  T* slope = nullptr;  // per sample, while coefficients move; with -Z instead of -(K + Z)
  bool damping_moves = false;
  double* exact = nullptr;  // the same as `matrix`, for what is made of it
  // While coefficients stand: `exact` over M, the own stiffness and damping being in the columns.
  T* pace = nullptr;
  T* reach = nullptr;  // [push or port][stride] `unit` over M
  T* echo = nullptr;   // [port][stride] what a port's force does to the velocity after the next

  T* state = nullptr;       // [rows]
  T* force = nullptr;       // [stride] for the next sample, if has_force
  T* port_force = nullptr;  // [port] the last one
  bool has_force = false;   // else it is the springs' by `matrix`, and the ports' last ones
  T* x = nullptr;           // [slot], of masses only in sample steps
  T* v = nullptr;
  bool touches = false;  // a port's force waits for the next sample, or begins there

  // Of a block step. The responses have zeros in front of them, as many as they are long.
  T* heard_table = nullptr;      // [column][frame * outputs + output]
  T* port_table = nullptr;       // [port][column][frame] of the difference that the law asks for
  T* port_bound = nullptr;       // [port][row] no less than any frame of a column is
  T* jump = nullptr;             // [power][column][row] A^(2^power) - 1
  T* injection = nullptr;        // [signal][driven_frames - 1 - frame][row] the state so much later
  const T** sounding = nullptr;  // [signal] over the present block step, or null
  T* heard_response = nullptr;   // [signal][2 * driven_frames * outputs]
  T* port_response = nullptr;    // [signal][port][2 * driven_frames]
  T* scratch = nullptr;          // dense_scratch_size()
  double* build = nullptr;       // for making the tables
};

// A block's inputs one after the other, and where its outputs go.
template <class T>
struct DenseDrive {
  const T* value = nullptr;     // [input][max_block_frames]
  const T* velocity = nullptr;  // [input][max_block_frames]
  T* outputs = nullptr;         // [frame][output]
};

// How many numbers a block step needs besides: outputs, a port's motion, the state, shifted
// signals.
template <class T>
std::size_t dense_scratch_size(const DenseBody<T>& body) {
  return dense_frames * body.outputs + dense_frames + body.rows + body.signals * dense_frames;
}

// How many doubles build() needs.
template <class T>
std::size_t dense_build_size(const DenseBody<T>& body) {
  const std::size_t observed = body.outputs + body.ports;
  return 2 * body.columns * body.rows + observed * body.columns * (dense_frames + dense_pad) +
         body.signals * driven_frames * body.rows;
}

inline constexpr std::size_t stride_frames = 4;
inline constexpr std::size_t stride_state = 8;    // numbers of a state that strides, at most
inline constexpr std::size_t stride_outputs = 3;  // at most

// Numbers that a stride makes: the change of the state; where the port's mass is in each frame, and
// then the outputs; both in whole packs of eight.
constexpr std::size_t stride_row(std::size_t outputs) {
  return stride_state +
         (stride_frames * (1 + outputs) + stride_state - 1) / stride_state * stride_state;
}
constexpr std::size_t stride_columns(std::size_t columns) {
  return columns <= 6 ? 6 : stride_state;
}

// A body on one piece of its port's law, of stiffness K and damping Z.
template <class T>
struct DenseStride {
  bool is_known = false;
  T stiffness = T(0);
  T damping = T(0);
  // [column of the state][stride_row()], and the same of a force of 1 on the port's mass in each
  // of the frames.
  Aligned<T> table;
};

// The piece and the port's other end, as strides see them: by the mass that moves.
template <class T>
struct DenseHold {
  T stiffness;
  T damping;
  T force;  // beside what these two make
  T low;    // between these distances of the mass from the other end
  T high;
  T start;  // where the other end is, and how fast, a frame before
  T start_speed;
  const T* position;  // [frame], or null where it stays
  const T* velocity;
};

template <class T>
struct DenseSteps {
  // Frames [at, at + count) sample by sample; `moves`: coefficients are on their way.
  void (*samples)(DenseBody<T>& body, const DenseDrive<T>& drive, std::size_t at, std::size_t count,
                  bool moves);
  // The forces of the last sample, where there are none.
  void (*pull)(DenseBody<T>& body);
  // At most `count` <= dense_frames frames from `at` on, up to the first contact, which makes the
  // body touch; fewer if forces act. Gives how many.
  std::size_t (*block)(DenseBody<T>& body, const DenseDrive<T>& drive, std::size_t at,
                       std::size_t count);
  // Strides of at most `count` frames, as long as the port stays on its piece. Gives how many.
  std::size_t (*stride)(DenseBody<T>& body, const T* table, const DenseHold<T>& hold, T* outputs,
                        std::size_t count);
  // The tables of a block step from `exact`. Of the order of (2 masses)^3 dense_powers operations.
  void (*build)(DenseBody<T>& body);
};

template <Isa isa, class T>
DenseSteps<T> dense_steps(std::size_t masses);
template <Isa isa, class T>
std::size_t dense_block_step(DenseBody<T>& body, const DenseDrive<T>& drive, std::size_t at,
                             std::size_t count);
template <Isa isa, class T>
std::size_t dense_stride(DenseBody<T>& body, const T* table, const DenseHold<T>& hold, T* outputs,
                         std::size_t count);
template <Isa isa, class T>
void build_dense(DenseBody<T>& body);

inline constexpr std::size_t most_dense_masses = 16;

// The packs that hold a body's masses in sample steps: the narrowest pack that holds them all, or
// as many of the widest as it takes; above 4, as many as the largest body takes.
struct DensePacks {
  std::size_t bytes = 16;  // of one
  std::size_t count = 1;
};
constexpr DensePacks dense_packs(std::size_t masses, std::size_t number_bytes, Isa isa) {
  DensePacks packs;
  while (packs.bytes < vector_bytes(isa) && packs.bytes < masses * number_bytes) {
    packs.bytes *= 2;
  }
  packs.count = (masses * number_bytes + packs.bytes - 1) / packs.bytes;
  if (packs.count > 4) {
    packs.count = most_dense_masses * number_bytes / packs.bytes;
  }
  return packs;
}

// At most most_dense_masses masses; no taps, force outputs or audio coefficients; outputs are of
// masses. One voice.
template <class T>
class DenseKernel final : public Kernel<T> {
 public:
  DenseKernel(const Program& program, const Dense& form, std::size_t voices, Isa isa);
  void set_state(std::size_t lane, const double* x, const double* v) override;
  bool save(std::size_t lane, double* x, double* v) const override;
  void strike(std::size_t lane, std::span<const std::uint32_t> nodes,
              std::span<const double> changes) override;
  bool is_near_start(std::size_t lane, double bound) const override;
  std::size_t look(std::size_t lane, std::span<const std::uint32_t> nodes,
                   std::span<double> numbers) const override;

 private:
  void play(const Block<T>& block) override;
  T& position_of(std::uint32_t node) const;
  T& velocity_of(std::uint32_t node) const;
  void place_nodes();
  void place_links();
  void place_signals();
  void allocate();
  DenseDrive<T> arrange(const Block<T>& block);
  void ramp(const DenseDrive<T>& drive, std::size_t frames);
  void follow_coefficients();
  void make_pace();
  void play(const DenseDrive<T>& drive, std::size_t at, std::size_t end);
  void refresh_force();
  // Strides: whether the body has any; so many frames of at most `count`, 0 where the port lies on
  // no straight piece; and the table of one.
  bool has_strides() const;
  std::size_t stride(const DenseDrive<T>& drive, std::size_t at, std::size_t count);
  const T* stride_table(T stiffness, T damping);
  void build_stride(DenseStride<T>& stride) const;

  const Program& program_;
  const Dense& form_;
  DenseSteps<T> steps_;
  DenseBody<T> body_;
  std::vector<DenseLink> ports_;
  std::vector<DenseSignal> signals_;
  std::vector<const T*> sounding_;
  std::vector<std::uint32_t> sources_;
  std::vector<DenseInput> driven_;
  std::vector<DenseInput> pushes_;
  std::vector<std::uint32_t> slots_;  // [node]
  std::vector<std::uint32_t> heard_;
  Aligned<T> numbers_;                     // all that body_ points to
  Aligned<double> exact_;                  // and these
  Aligned<T> known_;                       // [coefficient] what the matrices were made of
  Aligned<T> arranged_;                    // [input][value, velocity][max_block_frames]
  std::array<DenseStride<T>, 2> strides_;  // those of the last pieces
  std::size_t next_stride_ = 0;            // to be made anew
  std::size_t blocks_alone_ = 0;           // until strides are tried again
  bool can_step_blocks_ = true;            // no port's law acts everywhere
  bool has_tables_ = false;
  bool is_current_ = false;  // the next sample's forces are by the coefficients of now
};

}  // namespace ressort::kernels
