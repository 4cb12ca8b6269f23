// core/kernels: a Program in the eigenvectors of its linear links, one voice.
//
// Each mode is an oscillator of its own: d -= lK q + lZ d, q += d, which is the published scheme in
// another basis, not an approximation. Two ways through a block give the same:
//   free   nothing nonlinear acts: mode by mode, a few packs in registers for the whole block
//   bound  sample by sample, so that what links do in one is felt in the next
// A block is free if the energy cannot bring any mass to where a link acts, or if a free motion
// turns out not to have met one. With Modes::silence only those modes take part that are not asleep
// (modal_sleep.h), a first part of the rows.
#pragma once

#include "core/kernels/kernel.h"
#include "core/kernels/modal/modal_form.h"
#include "core/kernels/passive/room.h"

namespace ressort::kernels {

inline constexpr std::uint32_t check_frames = 32;  // from one look at what may sleep to the next...
inline constexpr std::uint32_t long_check_frames = 128;  // ...while few are awake

// So many passive links may be solved as modal_straight.h does: a pack of any kind.
inline constexpr std::size_t most_straight = widest_bytes / sizeof(float);

// Where a ModalKernel is, beside the numbers in its arrays.
template <class T>
struct ModalPace {
  std::size_t awake = 0;  // the first so many modes are
  std::size_t swept = 0;  // the same in whole pairs of packs
  std::size_t saved_awake = 0;
  std::size_t bundled = 0;
  std::size_t bundled_modes = 0;
  std::size_t pushing = 0;
  std::uint32_t held_places = 0;
  std::size_t held_links = 0;  // of both kinds
  std::size_t links = 0;
  bool is_first = false;  // the first sample of crossed modes
  bool pulls = false;     // passive links do so from the second sample on
  bool saved_pulls = false;
  bool is_pushed = false;     // a passive link has pushed in the last sample
  bool shoves_later = false;  // the next sweep adds `shove`
  bool is_reply_stale = true;
  bool is_straight_stale = true;
  std::uint32_t touched_frames = 0;    // so long no block is tried as a free one
  std::uint32_t surprised_frames = 0;  // so long all links are computed
  T kick_norm = 0;                     // what the links added to the norm in their last block
  bool is_stale = true;                // k, z and compliance are not those of `used`
  std::uint32_t until_check = check_frames;
  std::uint32_t fresh_frames = 0;  // since they were placed; up to 2
  bool is_long_check = false;
  bool has_bounds = false;  // the energy limits the motion
};

// Everything that one step of ModalKernel touches. Rows of modes are `stride` apart and filled up
// with zeros to `modes`, whole packs of every kind. Ends: the places, then Modes::ends. Listeners:
// the places, then the outputs.
template <class T>
struct ModalState : ModalPace<T> {
  Ramps<T> ramps;
  std::size_t modes;
  std::size_t stride;
  std::size_t row;      // numbers from one shape to the next: crossed modes have two parts of each
  const T* stiffness;   // factors, of each share in the packs where it has any
  const T* damping;     // the same
  T* pushes;            // [push][mode] shapes, and without a gap
  T* places;            // [place][mode]
  T* speeds;            // [place][mode] of crossed modes: how fast it is
  const T* pole;        // [part][mode] of crossed modes, less 1
  T* outputs;           // [output][mode]
  std::size_t forces;   // outputs that are
  T* felt;              // [output that is a force][row of q, row of d][mode]
  T* felt_still;        // [output that is a force] with q and d at 0
  T* exerted;           // [end] by passive links, in this sample
  const T* push_norm;   // [push] length of the shape
  const T* place_norm;  // [place]
  T* q;                 // [mode]
  T* d;                 // [mode] change of q per sample
  T* saved_q;           // [mode] at the start of a block
  T* saved_d;           // [mode]
  T* k;                 // [mode] lK
  T* z;                 // [mode] lZ
  T* load;              // [mode] sum of all forces of a sample
  T* bundle;            // [pack][row][lane] the rows that a sweep needs
  T* used;              // [share of stiffness, share of damping, mass] coefficient when last used
  T* late;              // [push] from the tick before, if it acts late
  T* amplitude;         // [frame][push]
  T* compliance;        // [place] greatest square of its displacement per energy
  T* x;                 // [end] position
  T* v;                 // [end] change per sample
  T* force;             // [end] summed by the links, used by the next sample
  T* saved_force;       // [place] at the start of a block
  T* kicked;            // [place] sum of the sizes of a block's kicks
  T* kick;              // [sample][row] what a sweep adds to d along a row
  T* speed;             // [row] how fast the row's place moves after it
  T* heard;             // [sample][row] where it is
  T* seen;              // [row][frame] the same for a block
  const T** rows;       // [row] that a sweep shall have
  const T** bundled_rows;   // [row] that are in the bundle
  std::uint32_t* push_of;   // [row] the pushes that push
  std::uint32_t* row_of;    // [place] where it is among the rows, if it is
  std::uint32_t* place_of;  // [row] its inverse
  std::uint32_t* held;      // [hold] how many of its links are computed
  Ends* held_ends;          // [link that is computed]
  T* held_give;             // [link that is computed]
  T* saved_x;               // [end] at the start of a block
  T* saved_v;               // [end]
  // Passive links: those of the holds that are not plain, in their order, and which of them are
  // computed (`active`, whose ends are {which passive link, nobody}).
  std::size_t passives;
  const PassiveLink* passive;  // [passive link]
  PassiveTables* active;       // never more than there are passive links
  T* reply;        // [listener][passive link] how far a push of 1 between its ends moves it, by w
  T* gamma;        // [passive link][passive link] how far a push of 1 closes another, by w
  T* opening;      // [passive link] the distance of its ends, once all has moved
  T* rush;         // [passive link] and its change per sample
  T* memory;       // [active][passive_rows]
  T* numbers;      // that solving them needs
  T* pushed;       // [passive link] what it exerts
  const T* give;   // [passive link] as ModalHold::give
  T* slack;        // [passive link] the same, by the coefficients of now
  T* yield;        // [passive link] how far it has given way by what is left out
  T* yield_step;   // [passive link] and in the last sample
  T* saved_yield;  // [passive link]
  T* saved_yield_step;  // [passive link]
  T* straight;          // what modal_straight.h keeps
  T* shove;             // [row] what passive links add to q and d along the row of a place
  const T* shape;       // [push, place, output][mode] as they are written, if is_exact
  T* root;              // [mode] of the gain that all of these have, if is_exact
  T* k_step;            // [mode] per sample, if is_exact
  T* z_step;            // [mode]
  T* spread;            // [mode] square of the amplitude per that of the state; 0: does not ring
  T* decay;             // [mode] of an amplitude in check_frames
  T* swing;             // [mode] amplitude
  T* debt;              // [mode] amplitude of what was dropped
  T* loudness;          // [listener] as modal_sleep.h says, now or lately
  T* room;              // [listener] what may still be dropped
  T silence;            // share of `loudness` that may be dropped; 0: nothing sleeps
  T lately_kept;        // of `loudness` in check_frames
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
  // Modes that nobody hears are left out: false.
  bool save(std::size_t lane, double* x, double* v) const override;
  void strike(std::size_t lane, std::span<const std::uint32_t> nodes,
              std::span<const double> changes) override;
  // By the length of the modes' displacement, which no mass exceeds: it may be late, never early.
  bool is_near_start(std::size_t lane, double bound) const override;
  std::size_t look(std::size_t lane, std::span<const std::uint32_t> nodes,
                   std::span<double> numbers) const override;
  Awake awake() const override;
  // The most that a listener, a place or then an output, may be off by what sleeps or has slept.
  double owed(std::size_t listener) const;
  bool become(const Kernel<T>& from) override;

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
