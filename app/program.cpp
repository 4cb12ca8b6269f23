#include "app/program.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <exception>
#include <initializer_list>
#include <new>

#include "app/exit_code.h"

namespace ressort {
namespace {

// Turns an output error into a failure, even if everything else succeeded.
int check_output(int code) {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) {
    return code;
  }
  std::fputs("the output is incomplete; the disk may be full\n", stderr);
  return code == exit_code::done ? exit_code::our_failure : code;
}

}  // namespace

int run_program(int (*work)(int argc, char** argv), int argc, char** argv) {
  // A closed standard descriptor would be reused by the next opened file, and messages would be
  // written into that file. A read-only descriptor makes such writes fail.
  for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(descriptor, F_GETFD) < 0) {
      static_cast<void>(open("/dev/null", O_RDONLY));
    }
  }
  signal(SIGXFSZ, SIG_IGN);  // so that a file size limit is an error like a full disk
  try {
    return check_output(work(argc, argv));
  } catch (const std::bad_alloc&) {
    std::fputs("not enough memory; use a smaller model or fewer voices\n", stderr);
    return exit_code::wrong_use;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
  } catch (...) {
    std::fputs("unknown error\n", stderr);
  }
  return exit_code::our_failure;
}

}  // namespace ressort
