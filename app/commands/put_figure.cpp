#include "app/commands/put_figure.h"

#include <cstdio>

#include "app/exit_code.h"
#include "app/session/files.h"

namespace ressort::commands {

int put_figure(const std::string& path, const plot::Figure& figure, bool force) {
  const auto svg = plot::to_svg(figure);
  if (!svg) {
    std::fprintf(stderr, "%s: not drawn: %s\n", path.c_str(), svg.error().message.c_str());
    return exit_code::our_failure;
  }
  return write_output(path, *svg, force);
}

}  // namespace ressort::commands
