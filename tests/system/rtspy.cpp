// tests: a library to interpose (LD_PRELOAD) that counts forbidden operations in the JACK process
// callback: memory, locks, files, waiting. It wraps the callback that the program registers, so
// that it knows when it is inside. The counts go to the file named by RTSPY_OUT at the end. With
// RTSPY_VANISHES, every count of MIDI events includes one that cannot be read.
#include <dlfcn.h>
#include <errno.h>
#include <jack/jack.h>
#include <jack/midiport.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <atomic>

namespace {

enum Kind { allocations, releases, locks, reads, writes, waits, others, kinds };
const char* const names[kinds] = {"allocations", "releases", "locks", "reads",
                                  "writes",      "waits",    "others"};
std::atomic<unsigned long> counts[kinds];
std::atomic<unsigned long> callbacks;
__thread int inside = 0;

void count(Kind kind) {
  if (inside > 0) {
    counts[kind].fetch_add(1, std::memory_order_relaxed);
  }
}

template <class Function>
Function real(Function, const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

JackProcessCallback wrapped;

int watched(jack_nframes_t frames, void* argument) {
  callbacks.fetch_add(1, std::memory_order_relaxed);
  ++inside;
  if (getenv("RTSPY_PROVOKE") != nullptr) {
    free(malloc(16));  // shows that the spy works
  }
  const int result = wrapped(frames, argument);
  --inside;
  return result;
}

__attribute__((destructor)) void report() {
  const char* path = getenv("RTSPY_OUT");
  FILE* file = path != nullptr ? fopen(path, "w") : nullptr;
  if (file == nullptr) {
    return;
  }
  fprintf(file, "callbacks %lu\n", callbacks.load());
  for (int kind = 0; kind < kinds; ++kind) {
    fprintf(file, "%s %lu\n", names[kind], counts[kind].load());
  }
  fclose(file);
}

}  // namespace

// glibc's internal names, because dlsym allocates.
extern "C" {
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);
void __libc_free(void*);

void* malloc(size_t size) {
  count(allocations);
  return __libc_malloc(size);
}
void* calloc(size_t n, size_t size) {
  count(allocations);
  return __libc_calloc(n, size);
}
void* realloc(void* old, size_t size) {
  count(allocations);
  return __libc_realloc(old, size);
}
void* memalign(size_t align, size_t size) {
  count(allocations);
  return __libc_memalign(align, size);
}
void* aligned_alloc(size_t align, size_t size) {
  count(allocations);
  return __libc_memalign(align, size);
}
int posix_memalign(void** out, size_t align, size_t size) {
  count(allocations);
  *out = __libc_memalign(align, size);
  return *out == nullptr ? ENOMEM : 0;
}
void free(void* memory) {
  if (memory != nullptr) {
    count(releases);
  }
  __libc_free(memory);
}

#define PASS(kind, name, declared, passed)       \
  int name declared {                            \
    static const auto next = real(&name, #name); \
    count(kind);                                 \
    return next passed;                          \
  }
PASS(locks, pthread_mutex_lock, (pthread_mutex_t * m), (m))
PASS(locks, pthread_mutex_trylock, (pthread_mutex_t * m), (m))
PASS(locks, pthread_rwlock_rdlock, (pthread_rwlock_t * l), (l))
PASS(locks, pthread_rwlock_wrlock, (pthread_rwlock_t * l), (l))
PASS(locks, pthread_spin_lock, (pthread_spinlock_t * l), (l))
PASS(waits, pthread_cond_wait, (pthread_cond_t * c, pthread_mutex_t* m), (c, m))
PASS(waits, pthread_cond_signal, (pthread_cond_t * c), (c))
PASS(waits, pthread_cond_broadcast, (pthread_cond_t * c), (c))
PASS(waits, sem_wait, (sem_t * s), (s))
PASS(waits, sem_post, (sem_t * s), (s))
PASS(waits, poll, (struct pollfd * p, nfds_t n, int t), (p, n, t))
PASS(waits, nanosleep, (const struct timespec* a, struct timespec* b), (a, b))
PASS(waits, clock_nanosleep, (clockid_t c, int f, const struct timespec* a, struct timespec* b),
     (c, f, a, b))
PASS(waits, usleep, (useconds_t u), (u))
PASS(waits, sched_yield, (), ())

ssize_t read(int file, void* data, size_t size) {
  static const auto next = real(&read, "read");
  count(reads);
  return next(file, data, size);
}
ssize_t write(int file, const void* data, size_t size) {
  static const auto next = real(&write, "write");
  count(writes);
  return next(file, data, size);
}
size_t fwrite(const void* data, size_t size, size_t n, FILE* file) {
  static const auto next = real(&fwrite, "fwrite");
  count(writes);
  return next(data, size, n, file);
}
long syscall(long number, ...) noexcept {
  static const auto next = real(&syscall, "syscall");
  count(others);
  va_list list;
  va_start(list, number);
  long a[6];
  for (long& argument : a) {
    argument = va_arg(list, long);
  }
  va_end(list);
  return next(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}

int jack_set_process_callback(jack_client_t* client, JackProcessCallback callback, void* argument) {
  static const auto next = real(&jack_set_process_callback, "jack_set_process_callback");
  wrapped = callback;
  return next(client, watched, argument);
}

uint32_t jack_midi_get_event_count(void* buffer) {
  static const auto next = real(&jack_midi_get_event_count, "jack_midi_get_event_count");
  return next(buffer) + (getenv("RTSPY_VANISHES") != nullptr ? 1 : 0);
}
}
