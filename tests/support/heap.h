// tests: the counting heap of main.cpp.
#pragma once

#include <cstddef>

// The sanitizers replace the heap by their own, which detects more than a count.
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

// Counts this thread's calls of operator new and delete during its lifetime; one instance at a
// time. main.cpp implements the heap.
class HeapWatch {
 public:
  HeapWatch();
  ~HeapWatch();
  HeapWatch(const HeapWatch&) = delete;
  HeapWatch& operator=(const HeapWatch&) = delete;
  std::size_t calls() const;
};

// Returns the bytes allocated by operator new on all threads; 0 if the heap is not counted. The C
// library's own figure includes per-thread caches.
std::size_t heap_bytes();

}  // namespace ressort::support
