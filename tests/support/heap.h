// tests: the heap as main.cpp keeps it, counting.
#pragma once

#include <cstddef>

// The sanitizers bring a heap of their own, which tells more than a count would.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define RESSORT_OTHER_HEAP 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define RESSORT_OTHER_HEAP 1
#endif
#endif

namespace ressort::support {

#ifdef RESSORT_OTHER_HEAP
inline constexpr bool heap_is_counted = false;
#else
inline constexpr bool heap_is_counted = true;
#endif

// Counts this thread's calls of operator new and delete from its making on; at most one lives.
// main.cpp keeps the heap.
class HeapWatch {
 public:
  HeapWatch();
  ~HeapWatch();
  HeapWatch(const HeapWatch&) = delete;
  HeapWatch& operator=(const HeapWatch&) = delete;
  std::size_t calls() const;
};

// What all threads hold of operator new, in bytes; 0 where the heap is not counted. The C library's
// own figure counts what it keeps for each thread's next use as well.
std::size_t heap_bytes();

}  // namespace ressort::support
