// app/realtime: all atomics of the program, and nothing else: the objects that pass data between
// the audio thread and the others. Each function names the thread that may call it.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

#include "app/rooms.h"

namespace ressort::realtime {

// Hands one heap object at a time to the audio thread and takes it back, so that another thread
// deletes it. One offering thread, one audio thread.
template <class T>
class Slot {
 public:
  // Offers `next`. Returns the previous offer if the audio thread has not taken it; the caller
  // deletes it. [offering thread] wait-free
  T* offer(T* next) { return offered_.exchange(next, std::memory_order_acq_rel); }

  // Returns the newest offer, once; null if there is none. [audio] wait-free
  T* take() {
    return offered_.load(std::memory_order_relaxed) == nullptr
               ? nullptr
               : offered_.exchange(nullptr, std::memory_order_acq_rel);
  }

  bool is_offered() const {  // [audio] wait-free
    return offered_.load(std::memory_order_relaxed) != nullptr;
  }

  // Returns true if retire() will succeed. [audio] wait-free
  bool has_room() const { return retired_.load(std::memory_order_acquire) == nullptr; }

  // Returns an object to the offering thread. False if the previous one was not collected yet: try
  // again in the next block. [audio] wait-free
  bool retire(T* old) {
    T* empty = nullptr;
    return retired_.compare_exchange_strong(empty, old, std::memory_order_release,
                                            std::memory_order_relaxed);
  }

  // Returns an object to delete, or null. [offering thread] wait-free
  T* collect() { return retired_.exchange(nullptr, std::memory_order_acq_rel); }

 private:
  std::atomic<T*> offered_{nullptr};
  std::atomic<T*> retired_{nullptr};
};

// A ring buffer with one writer and one reader. A push into a full ring fails; neither side waits.
template <class T>
class Ring {
 public:
  explicit Ring(std::size_t capacity) : items_(capacity) {}
  bool push(const T& item) { return push_all({&item, 1}); }  // [its one writer] wait-free
  // Pushes all items, or none if fewer than `spare` places would stay free. The reader sees all of
  // them at once.
  bool push_all(std::span<const T> items, std::size_t spare = 0) {  // [its one writer] wait-free
    const std::size_t end = end_.load(std::memory_order_relaxed);
    const std::size_t held = end - begin_.load(std::memory_order_acquire);
    if (held + items.size() + spare > items_.size()) {
      return false;
    }
    for (std::size_t i = 0; i < items.size(); ++i) {
      items_[(end + i) % items_.size()] = items[i];
    }
    end_.store(end + items.size(), std::memory_order_release);
    return true;
  }
  bool pop(T& item) {  // [its one reader] wait-free
    const std::size_t begin = begin_.load(std::memory_order_relaxed);
    if (begin == end_.load(std::memory_order_acquire)) {
      return false;
    }
    item = items_[begin % items_.size()];
    begin_.store(begin + 1, std::memory_order_release);
    return true;
  }
  std::size_t size() const {  // [its writer or its reader]
    return end_.load(std::memory_order_acquire) - begin_.load(std::memory_order_acquire);
  }
  std::size_t capacity() const { return items_.size(); }

 private:
  std::vector<T> items_;
  alignas(64) std::atomic<std::size_t> begin_{0};  // items ever popped
  alignas(64) std::atomic<std::size_t> end_{0};    // items ever pushed; on a cache line of its own
};

// A semaphore without waiting. A thread takes permits before it hands over items and gives them
// back when the items are done; take() fails if there are too few.
class Permits {
 public:
  explicit Permits(std::size_t count) : free_(count) {}
  bool take(std::size_t count) {  // [its one taker] wait-free
    if (count > free_.load(std::memory_order_acquire)) {
      return false;
    }
    free_.fetch_sub(count, std::memory_order_relaxed);
    return true;
  }
  void give_back(std::size_t count) {  // [any thread] wait-free
    free_.fetch_add(count, std::memory_order_release);
  }
  std::size_t free() const { return free_.load(std::memory_order_acquire); }

 private:
  std::atomic<std::size_t> free_;
};

// A counter that any thread may increase and read.
class Counter {
 public:
  void add(std::uint64_t amount) { count_.fetch_add(amount, std::memory_order_relaxed); }
  std::uint64_t get() const { return count_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> count_{0};
};

// A flag that any thread may raise and read.
class Flag {
 public:
  void raise() { raised_.store(true, std::memory_order_release); }
  bool is_raised() const { return raised_.load(std::memory_order_acquire); }
  bool lower() { return raised_.exchange(false, std::memory_order_acq_rel); }

 private:
  std::atomic<bool> raised_{false};
};

// The ownership of a task that a helper may perform in the owner's place. The owner offers the task
// once a round. Every offer has a number (ABA counter), so that a helper cannot claim an old one.
class Claim {
 public:
  // Returns true if no late helper holds the task. [owner] wait-free
  bool is_free() const { return state(word_.load(std::memory_order_acquire)) != left; }
  void offer() {  // [owner, while it is free] wait-free
    offers_ += states;
    word_.store(offers_ | open, std::memory_order_release);
  }
  // Takes the task back to perform it. False if a helper has claimed it. [owner] wait-free
  bool take_back() {
    std::uint64_t word = offers_ | open;
    return word_.compare_exchange_strong(word, offers_ | closed, std::memory_order_acq_rel);
  }
  bool is_done() const {  // [owner]
    return state(word_.load(std::memory_order_acquire)) == done;
  }
  // Gives up on a late helper, which keeps its data until finish(). False if the helper is done by
  // now. [owner] wait-free
  bool leave() {
    std::uint64_t word = offers_ | helped;
    return word_.compare_exchange_strong(word, offers_ | left, std::memory_order_acq_rel);
  }
  bool claim() {  // [helper] wait-free
    std::uint64_t word = word_.load(std::memory_order_relaxed);
    return state(word) == open &&
           word_.compare_exchange_strong(word, word - open + helped, std::memory_order_acq_rel,
                                         std::memory_order_relaxed);
  }
  // Ends the helper's work, in time or late. [helper] wait-free
  void finish() {
    std::uint64_t word = word_.load(std::memory_order_relaxed);
    while (!word_.compare_exchange_weak(word,
                                        word - state(word) + (state(word) == left ? closed : done),
                                        std::memory_order_acq_rel)) {
    }
  }

 private:
  static constexpr std::uint64_t states = 8;
  static constexpr std::uint64_t closed = 0;
  static constexpr std::uint64_t open = 1;
  static constexpr std::uint64_t helped = 2;
  static constexpr std::uint64_t done = 3;
  static constexpr std::uint64_t left = 4;
  static std::uint64_t state(std::uint64_t word) { return word % states; }

  std::uint64_t offers_ = 0;  // owner only
  alignas(64) std::atomic<std::uint64_t> word_{closed};
};

// A hazard pointer (Michael, 2004): a pointer that its owner shows for a while. Each user announces
// that it uses the pointer, so the owner knows when it may delete the object.
template <class T>
class HazardPointer {
 public:
  explicit HazardPointer(std::size_t users) : users_(users) {}
  // Returns false if another pointer is shown. [its owner] wait-free
  bool show(T* value) {
    T* nothing = nullptr;
    return value_.compare_exchange_strong(nothing, value);
  }
  void hide() { value_.store(nullptr); }  // [the thread that showed it] wait-free
  // Returns the shown pointer or null. It stays valid until leave(). [the user] wait-free
  T* enter(std::size_t user) {
    T* const value = value_.load(std::memory_order_relaxed);
    if (value == nullptr) {
      return nullptr;
    }
    users_[user].value.store(value);
    if (value_.load() == value) {
      return value;
    }
    leave(user);
    return nullptr;
  }
  void leave(std::size_t user) { users_[user].value.store(nullptr, std::memory_order_release); }
  // Returns true if a user still uses `value`. Call it after hide(). [any thread]
  bool is_used(const T* value) const {
    for (const User& user : users_) {
      if (user.value.load() == value) {
        return true;
      }
    }
    return false;
  }

 private:
  struct User {
    alignas(64) std::atomic<T*> value{nullptr};
  };
  alignas(64) std::atomic<T*> value_{nullptr};
  std::vector<User> users_;
};

// A number, or a pointer to an object that outlives both threads, that one thread sets and others
// read.
template <class T>
class Published {
 public:
  void set(T value) { value_.store(value, std::memory_order_release); }
  T get() const { return value_.load(std::memory_order_acquire); }

 private:
  std::atomic<T> value_{};
};

// A triple buffer: the newest value of one writer for one reader, without waiting or copying. One
// of the three values is written, one is read, and one lies between.
template <class T>
class TripleBuffer {
 public:
  explicit TripleBuffer(const T& value) : values_{value, value, value} {}

  T& writing() { return values_[writing_]; }  // [its one writer]
  void publish() {                            // [its one writer] wait-free
    writing_ = between_.exchange(writing_ | fresh, std::memory_order_acq_rel) & ~fresh;
  }
  // Switches reading() to a newer value; false if there is none. [its one reader] wait-free
  bool take() {
    if ((between_.load(std::memory_order_relaxed) & fresh) == 0) {
      return false;
    }
    reading_ = between_.exchange(reading_, std::memory_order_acq_rel) & ~fresh;
    return true;
  }
  const T& reading() const { return values_[reading_]; }  // [its one reader]

 private:
  static constexpr std::uint32_t fresh = 4;
  std::array<T, 3> values_;
  alignas(64) std::atomic<std::uint32_t> between_{1};
  alignas(64) std::uint32_t writing_ = 0;
  alignas(64) std::uint32_t reading_ = 2;
};

// The relation between the frame count and the monotonic clock.
struct ClockReading {
  std::int64_t frame = 0;    // first frame of the newest block
  std::int64_t time_ns = 0;  // monotonic clock at that frame
  double rate_hz = 0.0;      // 0: no block was played yet
  std::int64_t period = 0;   // frames of the block
};

// A sequence lock: a value that one thread writes and any thread reads as a whole. The writer never
// waits; a reader retries while the value is being written.
template <class T>
class SeqLock {
 public:
  static_assert(std::is_trivially_copyable_v<T>);

  void write(const T& value) {  // [its one writer] wait-free
    Words words{};
    std::memcpy(words.data(), &value, sizeof value);
    version_.fetch_add(1, std::memory_order_acq_rel);
    for (std::size_t i = 0; i < words.size(); ++i) {
      words_[i].store(words[i], std::memory_order_release);
    }
    version_.fetch_add(1, std::memory_order_release);
  }
  T read() const {  // [any other thread] lock-free
    while (true) {
      const std::uint32_t before = version_.load(std::memory_order_acquire);
      Words words;
      for (std::size_t i = 0; i < words.size(); ++i) {
        words[i] = words_[i].load(std::memory_order_acquire);
      }
      if (before % 2 == 0 && version_.load(std::memory_order_acquire) == before) {
        T value;
        std::memcpy(static_cast<void*>(&value), words.data(), sizeof value);
        return value;
      }
    }
  }

 private:
  using Words = std::array<std::uint64_t, (sizeof(T) + 7) / 8>;
  std::atomic<std::uint32_t> version_{0};
  std::array<std::atomic<std::uint64_t>, std::tuple_size_v<Words>> words_{};
};

}  // namespace ressort::realtime
