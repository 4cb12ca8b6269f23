// app/realtime: denormal numbers in the threads that compute sound.
#pragma once

#include <cstdint>

#if defined(__SSE2__)
#include <immintrin.h>

#include "app/rooms.h"
#endif

namespace ressort::realtime {

// Sets the processor to treat denormal numbers as zero in this thread, as long as this object
// lives. They are inaudible, and one operation on them can cost a hundred times the usual.
class DenormalsFlushed {
 public:
#if defined(__SSE2__)
  DenormalsFlushed() : before_(_mm_getcsr()) {
    _mm_setcsr(before_ | 0x8040u);
  }  // FTZ and DAZ
  ~DenormalsFlushed() {
    _mm_setcsr(before_);
  }

 private:
  unsigned before_;
#elif defined(__aarch64__)
  DenormalsFlushed() {
    asm volatile("mrs %0, fpcr" : "=r"(before_));
    asm volatile("msr fpcr, %0" ::"r"(before_ | (std::uint64_t{1} << 24)));
  }
  ~DenormalsFlushed() {
    asm volatile("msr fpcr, %0" ::"r"(before_));
  }

 private:
  std::uint64_t before_;
#endif
};

}  // namespace ressort::realtime
