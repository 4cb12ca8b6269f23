// app/realtime: every atomic of the program, and nothing else. What passes between the audio thread
// and the others, and the promise that each side makes.
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

// Hands one heap object at a time to the audio thread and takes it back to be destroyed
// elsewhere. One offering thread, one audio thread.
template <class T>
class Slot {
 public:
  // Makes `next` the one to take. What was offered before and not yet taken comes back; it is
  // the caller's to delete. [offering thread] wait-free
  T* offer(T* next) { return offered_.exchange(next, std::memory_order_acq_rel); }

  // The newest offer, once; null if there is none. [audio] wait-free
  T* take() {
    return offered_.load(std::memory_order_relaxed) == nullptr
               ? nullptr
               : offered_.exchange(nullptr, std::memory_order_acq_rel);
  }

  bool is_offered() const {  // [audio] wait-free
    return offered_.load(std::memory_order_relaxed) != nullptr;
  }

  // Whether retire() will succeed: nobody else gives any back. [audio] wait-free
  bool has_room() const { return retired_.load(std::memory_order_acquire) == nullptr; }

  // Gives one back. False when the other side is behind: keep it and try in the next block.
  // [audio] wait-free
  bool retire(T* old) {
    T* empty = nullptr;
    return retired_.compare_exchange_strong(empty, old, std::memory_order_release,
                                            std::memory_order_relaxed);
  }

  // One to delete, or null. [offering thread] wait-free
  T* collect() { return retired_.exchange(nullptr, std::memory_order_acq_rel); }

 private:
  std::atomic<T*> offered_{nullptr};
  std::atomic<T*> retired_{nullptr};
};

// A ring from one thread to one other. A full ring refuses; nobody waits.
template <class T>
class Ring {
 public:
  explicit Ring(std::size_t capacity) : items_(capacity) {}
  bool push(const T& item) { return push_all({&item, 1}); }  // [its one writer] wait-free
  // All or none, and as much as `spare` stays free; the reader finds all of them or none.
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
  alignas(64) std::atomic<std::size_t> begin_{0};  // what has ever been taken...
  alignas(64) std::atomic<std::size_t> end_{0};    // ...and put; apart, as two threads write them
};

// A semaphore that nobody waits at: permits are taken before something is handed over, and given
// back when it is done with; who finds too few knows at once.
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

// A count that any thread adds to and any may read.
class Counter {
 public:
  void add(std::uint64_t amount) { count_.fetch_add(amount, std::memory_order_relaxed); }
  std::uint64_t get() const { return count_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> count_{0};
};

// A flag that any thread may raise and any may look at.
class Flag {
 public:
  void raise() { raised_.store(true, std::memory_order_release); }
  bool is_raised() const { return raised_.load(std::memory_order_acquire); }
  bool lower() { return raised_.exchange(false, std::memory_order_acq_rel); }

 private:
  std::atomic<bool> raised_{false};
};

// Whose a task is: its owner's, who offers it round by round, or for a while a helper's. Every
// offer has a number, so that nobody claims one that has passed.
class Claim {
 public:
  // Whether no helper is in it. [owner] wait-free
  bool is_free() const { return state(word_.load(std::memory_order_acquire)) != left; }
  void offer() {  // [owner, while it is free] wait-free
    offers_ += states;
    word_.store(offers_ | open, std::memory_order_release);
  }
  // The owner does it himself; false if a helper has it. [owner] wait-free
  bool take_back() {
    std::uint64_t word = offers_ | open;
    return word_.compare_exchange_strong(word, offers_ | closed, std::memory_order_acq_rel);
  }
  bool is_done() const {  // [owner]
    return state(word_.load(std::memory_order_acquire)) == done;
  }
  // The helper is late, and keeps it until finish(); false if it is done now. [owner] wait-free
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
  // Done, in time or not; whoever has claimed it leaves it. [helper] wait-free
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

  std::uint64_t offers_ = 0;  // the owner's
  alignas(64) std::atomic<std::uint64_t> word_{closed};
};

// A pointer that is shown for a while. Who uses it says so, and so its owner knows when nobody does
// any more (a hazard pointer).
template <class T>
class Shown {
 public:
  explicit Shown(std::size_t users) : users_(users) {}
  // False where another one is shown. [its owner] wait-free
  bool show(T* value) {
    T* nothing = nullptr;
    return value_.compare_exchange_strong(nothing, value);
  }
  void hide() { value_.store(nullptr); }  // [who has shown it] wait-free
  // What is shown, or null; it stays what it is until leave(). [the user] wait-free
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
  // Once it is hidden. [any thread]
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

// A moment of the monotonic clock, in ns, that one thread writes and others read.
class Moment {
 public:
  void set(std::int64_t time_ns) { time_ns_.store(time_ns, std::memory_order_relaxed); }
  std::int64_t get() const { return time_ns_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::int64_t> time_ns_{0};
};

// A pointer that one thread publishes and the audio thread reads; what it points to outlives both.
template <class T>
class Published {
 public:
  void set(T* value) { value_.store(value, std::memory_order_release); }
  T* get() const { return value_.load(std::memory_order_acquire); }

 private:
  std::atomic<T*> value_{nullptr};
};

// The newest of what one thread writes, for one that reads it when it likes; nobody waits and
// nothing is copied. One of three values is being written, one is being read, one lies between.
template <class T>
class TripleBuffer {
 public:
  explicit TripleBuffer(const T& value) : values_{value, value, value} {}

  T& writing() { return values_[writing_]; }  // [its one writer]
  void publish() {                            // [its one writer] wait-free
    writing_ = between_.exchange(writing_ | fresh, std::memory_order_acq_rel) & ~fresh;
  }
  // Whether there is a newer one, which reading() is from then on. [its one reader] wait-free
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

// Which frame is heard at which moment.
struct ClockReading {
  std::int64_t frame = 0;    // first of the newest block
  std::int64_t time_ns = 0;  // monotonic clock at its start
  double rate_hz = 0.0;      // 0: no block yet
  std::int64_t period = 0;   // frames of the block
};

// A value that one thread writes and any may read, always whole: a sequence lock. The writer never
// waits; a reader tries again while it is being written.
template <class T>
class Board {
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
