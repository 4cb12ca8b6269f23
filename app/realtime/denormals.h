// app/realtime: what a thread that computes sound does about numbers too small to hear.
#pragma once

#include <cstdint>

#if defined(__SSE2__)
#include <immintrin.h>

#include "app/rooms.h"
#endif

namespace ressort::realtime {

// Numbers too small to hear can cost a hundred times what others cost; they are taken for 0 while
// this lives, in this thread.
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
