// The test program's main, the same for Catch2 version 2 and 3, and its heap, which counts.
#define CATCH_CONFIG_RUNNER
#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

#include "tests/support/catch.h"
#include "tests/support/heap.h"

namespace ressort::support {
namespace {
thread_local bool is_watched = false;
thread_local std::size_t calls_counted = 0;
std::atomic<std::size_t> bytes_held{0};
}  // namespace

std::size_t heap_bytes() {
  return bytes_held;
}

HeapWatch::HeapWatch() {
  calls_counted = 0;
  is_watched = true;
}
HeapWatch::~HeapWatch() {
  is_watched = false;
}
std::size_t HeapWatch::calls() const {
  return calls_counted;
}

}  // namespace ressort::support

#ifndef RESSORT_OTHER_HEAP
namespace {

void* allocate(std::size_t size, std::size_t alignment) {
  using namespace ressort::support;
  calls_counted += is_watched ? 1 : 0;
  const std::size_t rounded = (std::max<std::size_t>(size, 1) + alignment - 1) / alignment;
  void* const memory = alignment <= alignof(std::max_align_t)
                           ? std::malloc(std::max<std::size_t>(size, 1))
                           : std::aligned_alloc(alignment, rounded * alignment);
  if (memory == nullptr) {
    throw std::bad_alloc();
  }
  bytes_held += malloc_usable_size(memory);
  return memory;
}

void release(void* memory) {
  using namespace ressort::support;
  calls_counted += is_watched && memory != nullptr ? 1 : 0;
  bytes_held -= malloc_usable_size(memory);
  std::free(memory);
}

}  // namespace

// Not inlined: the compiler would warn of every malloc that it sees meet a delete.
#define NOT_INLINED __attribute__((noinline))
NOT_INLINED void* operator new(std::size_t size) {
  return allocate(size, 1);
}
NOT_INLINED void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
NOT_INLINED void operator delete(void* memory) noexcept {
  release(memory);
}
NOT_INLINED void operator delete(void* memory, std::size_t) noexcept {
  release(memory);
}
NOT_INLINED void operator delete(void* memory, std::align_val_t) noexcept {
  release(memory);
}
NOT_INLINED void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  release(memory);
}
#endif  // RESSORT_OTHER_HEAP

int main(int argc, char** argv) {
  return Catch::Session().run(argc, argv);
}
