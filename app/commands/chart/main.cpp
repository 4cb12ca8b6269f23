// app: the program ressort-chart, which `ressort chart` starts. Its arguments are those of
// start_chart(): FOLDER SECONDS [MODEL...].
#include <cstdio>

#include "app/commands/chart/chart.h"
#include "app/exit_code.h"
#include "app/program.h"

namespace {

int run(int argc, char** argv) {
  if (argc < 3) {
    std::fputs("this is a part of ressort: start it as `ressort chart`\n", stderr);
    return ressort::exit_code::wrong_use;
  }
  return ressort::commands::chart(ressort::commands::chart_options({argv + 1, argv + argc}));
}

}  // namespace

int main(int argc, char** argv) {
  return ressort::run_program(run, argc, argv);
}
