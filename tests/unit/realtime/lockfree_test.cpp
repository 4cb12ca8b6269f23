// Lock-free structures: nothing is lost, duplicated or torn. Run it under ThreadSanitizer too.
#include "app/realtime/lockfree.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "tests/support/harness.h"

namespace ressort::lockfree_test {
namespace {

struct Counted {
  explicit Counted(int number) : serial(number) { ++alive; }
  ~Counted() { --alive; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;
  int serial;
  int touched = 0;  // objects seen by the other thread
  static inline std::atomic<int> alive{0};
};

}  // namespace

TEST_CASE("a slot hands over 100,000 objects without loss or duplicates", "[lockfree]") {
  constexpr int count = 100000;
  Slot<Counted> slot;
  std::atomic<bool> all_offered{false};
  // Number of times that each object came back, unused or replaced.
  std::vector<int> fates(count, 0);
  std::vector<char> was_taken(count, 0);
  bool touched_right = true;

  // The audio thread: takes the newest and returns the one before.
  std::thread audio([&] {
    Counted* current = nullptr;
    Counted* leaving = nullptr;
    int newest = -1;
    while (true) {
      const bool is_last = all_offered.load();
      if (leaving != nullptr && slot.retire(leaving)) {
        leaving = nullptr;
      }
      if (leaving == nullptr) {
        if (Counted* const next = slot.take()) {
          if (next->serial <= newest) {
            touched_right = false;  // whether an older object followed a newer one
          }
          newest = next->serial;
          next->touched += 1;
          leaving = current;
          current = next;
        } else if (is_last) {
          break;
        }
      }
      std::this_thread::yield();
    }
    while (current != nullptr && !slot.retire(current)) {
      std::this_thread::yield();
    }
  });

  const auto bury = [&](Counted* object, bool taken) {
    if (object != nullptr) {
      ++fates[static_cast<std::size_t>(object->serial)];
      was_taken[static_cast<std::size_t>(object->serial)] = taken;
      touched_right = touched_right && object->touched == (taken ? 1 : 0);
      delete object;
    }
  };
  for (int i = 0; i < count; ++i) {
    bury(slot.offer(new Counted(i)), false);
    bury(slot.collect(), true);
    if (i % 16 == 0) {
      std::this_thread::yield();  // the other side runs even on one core
    }
  }
  all_offered.store(true);
  while (Counted::alive.load() > 0) {
    bury(slot.collect(), true);
    std::this_thread::yield();
  }
  audio.join();

  CHECK(Counted::alive.load() == 0);
  CHECK(std::all_of(fates.begin(), fates.end(), [](int fate) { return fate == 1; }));
  CHECK(touched_right);
  CHECK(std::count(was_taken.begin(), was_taken.end(), 1) > 0);
  CHECK(was_taken.back() == 1);  // the newest offer is always taken in the end
}

TEST_CASE("a slot holds one offer and one returned object", "[lockfree]") {
  Slot<int> slot;
  int a = 1;
  int b = 2;
  CHECK(slot.take() == nullptr);
  CHECK(slot.collect() == nullptr);
  CHECK(slot.offer(&a) == nullptr);
  CHECK(slot.offer(&b) == &a);
  CHECK(slot.take() == &b);
  CHECK(slot.take() == nullptr);
  CHECK(slot.retire(&a));
  CHECK_FALSE(slot.retire(&b));
  CHECK(slot.collect() == &a);
  CHECK(slot.retire(&b));
  CHECK(slot.collect() == &b);
}

TEST_CASE("a ring keeps the order, and a push into a full ring fails", "[lockfree]") {
  Ring<int> ring(100);
  int item = 0;
  CHECK_FALSE(ring.pop(item));
  int held = 0;
  while (ring.push(held)) {
    ++held;
    REQUIRE(held < 1000);
  }
  CHECK(held == 100);
  CHECK(ring.size() == static_cast<std::size_t>(held));
  CHECK_FALSE(ring.push(7));
  for (int i = 0; i < held; ++i) {
    REQUIRE(ring.pop(item));
    REQUIRE(item == i);
  }
  CHECK_FALSE(ring.pop(item));
  CHECK(ring.push(8));
}

TEST_CASE("a ring takes all of a bundle or nothing", "[lockfree]") {
  Ring<int> ring(64);
  const std::vector<int> bundle(10, 1);
  std::size_t held = 0;
  while (ring.push_all(bundle)) {
    held += bundle.size();
    REQUIRE(ring.size() == held);
    REQUIRE(held < 1000);
  }
  CHECK(held == 60);
  CHECK(ring.size() == held);  // the rejected one left nothing
  int item = 0;
  for (std::size_t i = 0; i < 10; ++i) {
    CHECK(ring.pop(item));
  }
  CHECK(ring.push_all(bundle));
  CHECK(ring.push_all({}));
  CHECK_FALSE(ring.push_all(std::vector<int>(10000, 1)));
  // 60 of 64 places are used: the reserved places stay free.
  CHECK_FALSE(ring.push_all(std::vector<int>(2, 1), 3));
  CHECK(ring.push_all(std::vector<int>(2, 1), 2));
}

TEST_CASE("a ring between two threads loses nothing and keeps bundles together", "[lockfree]") {
  constexpr int bundles = 20000;
  Ring<int> ring(256);
  std::thread writer([&] {
    for (int i = 0; i < bundles; ++i) {
      const int bundle[] = {i, i, i, i};
      while (!ring.push_all(bundle)) {
        std::this_thread::yield();
      }
    }
  });
  bool in_order = true;
  bool whole = true;
  for (int i = 0; i < bundles * 4;) {
    const std::size_t held = ring.size();
    whole = whole && held % 4 == 0;
    for (std::size_t left = held; left > 0; --left, ++i) {
      int item = -1;
      in_order = ring.pop(item) && in_order && item == i / 4;
    }
    std::this_thread::yield();
  }
  writer.join();
  CHECK(in_order);
  CHECK(whole);
  CHECK(ring.size() == 0);
}

TEST_CASE("permits are never taken twice or lost between two threads", "[lockfree]") {
  Permits permits(100);
  CHECK_FALSE(permits.take(101));
  CHECK(permits.take(60));
  CHECK_FALSE(permits.take(41));
  CHECK(permits.free() == 40);
  permits.give_back(60);

  Ring<int> ring(100);  // with a place for each item, it is never full
  constexpr int count = 100000;
  bool had_room = true;
  std::thread taker([&] {
    for (int i = 0; i < count; ++i) {
      while (!permits.take(1)) {
        std::this_thread::yield();
      }
      had_room = ring.push(i) && had_room;
    }
  });
  Counter done;
  while (done.get() < count) {
    int item = 0;
    if (ring.pop(item)) {
      permits.give_back(1);
      done.add(1);
    } else {
      std::this_thread::yield();
    }
  }
  taker.join();
  CHECK(had_room);
  CHECK(permits.free() == 100);
}

TEST_CASE("a counter adds up the counts of two threads", "[lockfree]") {
  Counter counter;
  const auto add = [&] {
    for (int i = 0; i < 100000; ++i) {
      counter.add(2);
    }
  };
  std::thread other(add);
  add();
  other.join();
  CHECK(counter.get() == 400000);
}

TEST_CASE("a sequence lock is always read as a whole", "[lockfree]") {
  SeqLock<ClockReading> board;
  CHECK(board.read().rate_hz == 0.0);
  std::atomic<bool> done{false};
  std::thread writer([&] {
    for (std::int64_t i = 1; !done.load(); ++i) {
      board.write({i, 3 * i, static_cast<double>(5 * i), 7 * i});
      if (i % 64 == 0) {
        std::this_thread::yield();
      }
    }
  });
  bool whole = true;
  bool forward = true;
  std::int64_t before = 0;
  int seen = 0;
  while (seen < 2000) {
    const ClockReading reading = board.read();
    whole = whole && reading.time_ns == 3 * reading.frame && reading.period == 7 * reading.frame &&
            reading.rate_hz == static_cast<double>(5 * reading.frame);
    forward = forward && reading.frame >= before;
    seen += reading.frame != before ? 1 : 0;
    before = reading.frame;
    std::this_thread::yield();
  }
  done.store(true);
  writer.join();
  CHECK(whole);
  CHECK(forward);
}

TEST_CASE("a triple buffer passes the newest value, whole and once", "[lockfree]") {
  using Numbers = std::array<std::uint64_t, 64>;
  TripleBuffer<Numbers> buffer{Numbers{}};
  CHECK_FALSE(buffer.take());
  std::atomic<bool> done{false};
  std::atomic<std::uint64_t> published{0};
  std::thread writer([&] {
    for (std::uint64_t i = 1; !done.load(); ++i) {
      buffer.writing().fill(i);
      buffer.publish();
      published.store(i);
      if (i % 64 == 0) {
        std::this_thread::yield();
      }
    }
  });
  bool whole = true;
  bool newest = true;
  std::uint64_t last = 0;
  for (int seen = 0; seen < 20000;) {
    const std::uint64_t before = published.load();
    if (!buffer.take()) {
      std::this_thread::yield();
      continue;
    }
    const Numbers& now = buffer.reading();
    whole = whole && std::all_of(now.begin(), now.end(), [&](auto n) { return n == now[0]; });
    newest = newest && now[0] > last && now[0] >= before;
    last = now[0];
    ++seen;
  }
  done.store(true);
  writer.join();
  CHECK(whole);
  CHECK(newest);
  buffer.take();
  CHECK(buffer.reading()[0] == published.load());
  CHECK_FALSE(buffer.take());  // each value only once
}

TEST_CASE("counters and flags", "[lockfree]") {
  Counter counter;
  counter.add(2);
  counter.add(3);
  CHECK(counter.get() == 5);
  Flag flag;
  CHECK_FALSE(flag.lower());
  flag.raise();
  CHECK(flag.is_raised());
  CHECK(flag.lower());
  CHECK_FALSE(flag.is_raised());
  // However many threads raise the flag, only one lowers it.
  for (int i = 0; i < 200; ++i) {
    flag.raise();
    std::atomic<int> lowered{0};
    std::thread other([&] { lowered += flag.lower() ? 1 : 0; });
    lowered += flag.lower() ? 1 : 0;
    other.join();
    REQUIRE(lowered.load() == 1);
  }
}

}  // namespace ressort::lockfree_test
