#include "app/session/memory.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>

namespace ressort::session {
namespace {

constexpr auto unknown = std::numeric_limits<std::uint64_t>::max();

// Returns the number in a file that has only one.
std::uint64_t number_in(const char* path) {
  std::ifstream file(path);
  std::uint64_t number = 0;
  return file >> number ? number : unknown;  // "max" means no limit
}

std::uint64_t left_of(std::uint64_t limit, std::uint64_t used) {
  return limit == unknown ? unknown : limit - std::min(limit, used);
}

// Returns the number after a name in a file of such pairs.
std::uint64_t number_at(const char* path, const std::string& wanted) {
  std::ifstream file(path);
  std::string word;
  std::uint64_t number = 0;
  while (file >> word) {
    if (word == wanted && file >> number) {
      return number;
    }
  }
  return unknown;
}

// Memory available without swapping.
std::uint64_t left_by_machine() {
  const std::uint64_t kilobytes = number_at("/proc/meminfo", "MemAvailable:");
  return kilobytes == unknown ? unknown : kilobytes << 10;
}

std::uint64_t left_by_limit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) {
    return unknown;
  }
  const std::uint64_t pages = number_in("/proc/self/statm");
  return left_of(limit.rlim_cur, pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)));
}

// The kernel can drop cached files, so they count as free.
std::uint64_t left_by_group() {
  const std::uint64_t limit = number_in("/sys/fs/cgroup/memory.max");
  const std::uint64_t used = number_in("/sys/fs/cgroup/memory.current");
  const std::uint64_t files = number_at("/sys/fs/cgroup/memory.stat", "file");
  return used == unknown || files == unknown ? unknown
                                             : left_of(limit, used - std::min(used, files));
}

}  // namespace

std::uint64_t free_memory_bytes() {
  return std::min({left_by_machine(), left_by_limit(), left_by_group()});
}

}  // namespace ressort::session
