// core/kernels: modal superposition: a Program in the eigenvectors of its linear links, one voice.
//
// Each mode is an independent oscillator, d -= lK q + lZ d, q += d (symplectic Euler). This is the
// published scheme in another basis and not an approximation. Places and outputs are sums of
// shape * q over the modes. A block is computed in one of two ways with the same result:
//   free   no nonlinear link acts: a few samples of every mode at a time, in registers
//   bound  sample by sample, because the links' forces act in the next sample
// A block is free if the energy bounds every place away from all links (modal_bounds.h), or if a
// free motion, once computed, has met none. With Modes::silence, modes that are inaudible sleep
// (modal_sleep.h). The awake modes are the first part of each row.
#pragma once

#include "core/kernels/kernel.h"
#include "core/kernels/modal/modal_form.h"
#include "core/kernels/passive/room.h"

namespace ressort::kernels {

// interval between two checks for modes that may sleep
inline constexpr std::uint32_t check_frames = 256;

// Largest number of passive links that modal_straight.h solves: the lanes of the widest pack.
inline constexpr std::size_t most_straight = widest_bytes / sizeof(float);

// The state of a ModalKernel: one object for each of its jobs. The arrays are the kernel's memory.
// Rows of modes are `stride` apart and padded with zeros to `modes`, whole packs of every kind. An
// end is a place or, numbered on from these, an element of Modes::ends. A listener is a place or,
// numbered on from these, an output.
//
// The numbers that change and are not in arrays stand in a base of their own: copy_from() copies
// them.

// Shapes and factors as the form has them, in T. Constant, except that exact modes scale the
// shapes.
template <class T>
struct ModalShapes {
  std::size_t modes;
  std::size_t stride;
  std::size_t row;      // numbers from one shape to the next; a crossed mode has two parts
  const T* stiffness;   // [share] factors, in the packs where the share has any
  const T* damping;     // the same for damping
  T* pushes;            // [push][mode], followed without a gap by places and outputs
  T* places;            // [place][mode]
  T* outputs;           // [output][mode]
  const T* unscaled;    // [push, place, output][mode] of exact modes, as the form has them
  T* speeds;            // [place][mode] velocity of the place; crossed modes only
  const T* pole;        // [part][mode] pole minus 1; crossed modes only
  const T* push_norm;   // [push] length of its row
  const T* place_norm;  // [place]
};

// The oscillators, d -= k q + z d, q += d, and how their coefficients change.
struct ModalMotionPace {
  bool is_stale = true;            // k, z and compliance do not follow from `used`
  bool may_move = true;            // the coefficients may differ from `used`
  bool is_first = false;           // the first sample of crossed modes
  std::uint32_t fresh_frames = 0;  // since set_state(); up to 2
};
template <class T>
struct ModalMotion : ModalMotionPace {
  T* q;       // [mode] displacement
  T* d;       // [mode] change of q per sample
  T* k;       // [mode] stiffness times inverse mass
  T* z;       // [mode] damping times inverse mass
  T* k_step;  // [mode] change of k per sample, exact modes only
  T* z_step;  // [mode]
  T* root;    // [mode] square root of the gain of the force, exact modes only; else null
  T* used;    // [share of stiffness, share of damping, mass] coefficient in the last sample
};

// The number of awake modes, and bounds on the error by those that sleep (modal_sleep.h).
struct ModalSleepPace {
  std::size_t awake = 0;  // modes [0, awake) are awake
  std::size_t swept = 0;  // the same in whole pairs of packs
  std::uint32_t until_check = check_frames;
};
template <class T>
struct ModalSleep : ModalSleepPace {
  T* spread;      // [mode] square of the amplitude per that of the state; 0: does not ring
  T* decay;       // [mode] decay of an amplitude in check_frames
  T* amplitude;   // [mode]
  T* debt;        // [mode] amplitude of the dropped motion
  T* loudness;    // [listener] recent loudness
  T* room;        // [listener] amplitude that may still be dropped
  T silence;      // share of `loudness` that may be dropped; 0: no mode sleeps
  T lately_kept;  // decay of `loudness` in check_frames
};

// The rows that one pass over all modes uses, and its results.
struct ModalSweepPace {
  std::size_t bundled = 0;  // rows in the bundle
  std::size_t bundled_modes = 0;
};
template <class T>
struct ModalSweep : ModalSweepPace {
  const T** rows;          // [row] wanted
  const T** bundled_rows;  // [row] in the bundle
  T* bundle;               // [pack][row][lane]
  T* load;                 // [mode] sum of all forces, where there are too many rows for a bundle
  T* kick;                 // [sample][row] added to d along a row
  T* speed;                // [row] velocity of the row's place
  T* heard;                // [sample][row] position
  T* seen;                 // [row][frame] position, for a block
};

// Amplitudes of inputs and constant forces.
struct ModalInputsPace {
  std::size_t pushing = 0;  // number of pushes that are not 0 in this block
};
template <class T>
struct ModalInputs : ModalInputsPace {
  bool are_forces;         // all of them; then a block of zeros pushes nothing
  std::uint32_t* push_of;  // [0, pushing) their indices
  T* amplitude;            // [frame][push]
  T* late;                 // [push] amplitude of the sample before, if it acts late
};

// Positions of the ends, forces on them, and bounds on their motion (modal_bounds.h).
template <class T>
struct ModalEndsPace {
  bool has_bounds = false;
  T kick_norm = 0;             // growth of the norm by the links in their last block
  std::size_t soft_modes = 0;  // modes that may drift
};
template <class T>
struct ModalEnds : ModalEndsPace<T> {
  T* x;                 // [end] position
  T* v;                 // [end] change per sample
  T* force;             // [end] summed by the plain links, used by the next sample
  T* exerted;           // [end] by passive links, in this sample
  T* kicked;            // [place] sum of the magnitudes of a block's kicks
  T* compliance;        // [place] largest squared displacement per unit of energy of modes not soft
  std::uint32_t* soft;  // [0, soft_modes) indices of modes
  T* soft_speed;        // [0, soft_modes) largest change per sample in this block
};

// The links that are computed in this block, and the places that they need.
struct ModalHeldPace {
  std::uint32_t places = 0;
  std::size_t links = 0;               // number of computed links, plain and passive
  std::size_t all_links = 0;           // total number of links
  std::uint32_t touched_frames = 0;    // samples until a block is tried as a free one
  std::uint32_t surprised_frames = 0;  // samples until fewer than all links are computed
};
template <class T>
struct ModalHeld : ModalHeldPace {
  std::uint32_t* row_of;    // [place] its row, or nowhere
  std::uint32_t* place_of;  // [row] its place
  std::uint32_t* count_of;  // [hold] number of its links that are computed
  Ends* ends;               // [plain link that is computed]
  T* give;                  // [plain link that is computed]
};

// The links of the holds that are not plain, in their order (modal_passive.h).
struct ModalPassivePace {
  bool pulls = false;         // the links act from the second sample on
  bool is_pushed = false;     // a link exerted a force in the last sample
  bool shoves_later = false;  // the next sweep adds `shove`
  bool is_reply_stale = true;
  bool is_straight_stale = true;
};
template <class T>
struct ModalPassive : ModalPassivePace {
  std::size_t count;
  const PassiveLink* links;  // [link]
  PassiveTables* active;     // the computed links; their ends are {index of the link, nobody}
  T* reply;       // [listener][link] displacement by a unit push between the link's ends, for w = 1
  T* gamma;       // [link][link] change of one distance by a unit push of another link, for w = 1
  T* opening;     // [link] distance of its ends after everything has moved
  T* rush;        // [link] its change per sample
  T* memory;      // [active][passive_rows]
  T* numbers;     // workspace of the solver
  T* straight;    // workspace of modal_straight.h
  T* pushed;      // [link] force
  T* shove;       // [row] displacement of q and d along the row of a place by the forces
  const T* give;  // [link] as ModalHold::give
  T* slack;       // [link] the same for the current coefficients
  T* yield;       // [link] displacement of its ends by the omitted modes
  T* yield_step;  // [link] its change in the last sample
};

// A copy of the state that a block may change, from the start of the block, because a block may
// have to be computed again.
struct ModalSavedPace {
  std::size_t awake = 0;
  bool pulls = false;
};
template <class T>
struct ModalSaved : ModalSavedPace {
  T* q;           // [mode]
  T* d;           // [mode]
  T* x;           // [end]
  T* v;           // [end]
  T* force;       // [place]
  T* yield;       // [passive link]
  T* yield_step;  // [passive link]
};

// Outputs that are forces.
template <class T>
struct ModalForces {
  std::size_t count;
  T* rows;    // [force][row of q, row of d][mode]
  T* still;   // [force] with q and d at 0
  T* damped;  // [force] not 0 if the row of d has an element that is not 0
  T* before;  // [force] sum along the row of d, of q before the block
};

template <class T>
struct ModalState {
  Ramps<T> ramps;
  ModalShapes<T> shapes;
  ModalMotion<T> motion;
  ModalSleep<T> sleep;
  ModalSweep<T> sweep;
  ModalInputs<T> inputs;
  ModalEnds<T> ends;
  ModalHeld<T> held;
  ModalPassive<T> passive;
  ModalSaved<T> saved;
  ModalForces<T> forces;

  // Copies all numbers that change and are not in arrays.
  void take_pace(const ModalState& from) {
    static_cast<ModalMotionPace&>(motion) = from.motion;
    static_cast<ModalSleepPace&>(sleep) = from.sleep;
    static_cast<ModalSweepPace&>(sweep) = from.sweep;
    static_cast<ModalInputsPace&>(inputs) = from.inputs;
    static_cast<ModalEndsPace<T>&>(ends) = from.ends;
    static_cast<ModalHeldPace&>(held) = from.held;
    static_cast<ModalPassivePace&>(passive) = from.passive;
    static_cast<ModalSavedPace&>(saved) = from.saved;
  }
};

template <class T>
using ModalStep = void (*)(const Program& program, const Modes& modes, ModalState<T>& state,
                           const Block<T>& block);

template <Isa isa, class T>
ModalStep<T> modal_step(bool is_crossed);

template <class T>
class ModalKernel final : public Kernel<T> {
 public:
  ModalKernel(const Program& program, const Modes& modes, std::size_t voices, Isa isa);
  void set_state(std::size_t lane, const double* x, const double* v) override;
  // Returns false: inaudible modes are left out, so the state of the nodes is not known.
  bool save(std::size_t lane, double* x, double* v) const override;
  void strike(std::size_t lane, std::span<const std::uint32_t> nodes,
              std::span<const double> changes) override;
  // Uses the norm of the modes' displacement, which bounds that of every mass. The answer may be
  // false too long, never true too early.
  bool is_near_start(std::size_t lane, double bound) const override;
  std::size_t read_positions(std::size_t lane, std::span<const std::uint32_t> nodes,
                             std::span<double> numbers) const override;
  Awake awake() const override;
  // Returns a bound on the error of a listener (a place or, after these, an output) by modes that
  // sleep or have slept.
  double owed(std::size_t listener) const;
  bool copy_from(const Kernel<T>& from) override;

 private:
  void play(const Block<T>& block) override;
  void wake_all();
  void remember_peaks(const Block<T>& block);
  const Program& program_;
  const Modes& modes_;
  ModalStep<T> step_;
  Aligned<T> numbers_;  // all arrays of state_
  std::vector<const T*> rows_;
  std::vector<const T*> bundled_rows_;
  std::vector<std::uint32_t> indices_;
  std::vector<Ends> held_ends_;
  std::vector<PassiveLink> passive_;
  PassiveTables active_;
  ModalState<T> state_;
};

}  // namespace ressort::kernels
