// tests: the heap as main.cpp keeps it, counting.
#pragma once

#include <cstddef>

namespace ressort::rig {

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

}  // namespace ressort::rig
