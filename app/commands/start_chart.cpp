#include "app/commands/start_chart.h"

#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include "app/exit_code.h"
#include "core/model/language/expression.h"

namespace ressort::commands {
namespace {

namespace fs = std::filesystem;

// Returns only where the program cannot be started.
void become(std::vector<std::string> words) {
  std::vector<char*> arguments;
  for (std::string& word : words) {
    arguments.push_back(word.data());
  }
  arguments.push_back(nullptr);
  execvp(arguments[0], arguments.data());
  const std::string why = std::error_code(errno, std::generic_category()).message();
  std::fprintf(stderr, "%s cannot be started: %s\n", arguments[0], why.c_str());
}

// What it says goes where progress belongs.
bool build(const fs::path& folder) {
  std::fputs("building ressort-chart, for the first time; this takes a minute\n", stderr);
  const pid_t child = fork();
  if (child == 0) {
    dup2(STDERR_FILENO, STDOUT_FILENO);
    become({"cmake", "--build", folder.string(), "--target", "ressort-chart", "--parallel",
            std::to_string(sysconf(_SC_NPROCESSORS_ONLN))});
    _exit(127);
  }
  int status = -1;
  while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return child > 0 && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace

int start_chart(const ChartOptions& options) {
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  const fs::path program = folder / "ressort-chart";
  if (!fs::exists(program, error) && fs::exists(folder / "CMakeCache.txt", error) &&
      !build(folder)) {
    std::fputs("ressort-chart could not be built\n", stderr);
    return exit_code::our_failure;
  }
  std::vector<std::string> words = {program.string(), options.folder,
                                    print_number(options.patience_s)};
  words.insert(words.end(), options.scenes.begin(), options.scenes.end());
  std::fflush(stdout);
  become(std::move(words));
  return exit_code::our_failure;
}

ChartOptions chart_options(const std::vector<std::string>& arguments) {
  ChartOptions options;
  if (arguments.size() >= 2) {
    options.folder = arguments[0];
    parse_number(arguments[1], options.patience_s);
    options.scenes.assign(arguments.begin() + 2, arguments.end());
  }
  return options;
}

}  // namespace ressort::commands
