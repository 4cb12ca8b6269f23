// app/mpi: the command line of ressort-mpi, a `render` whose large networks are divided among
// processes.
#include <cstdio>
#include <exception>

#include "app/command_line/options.h"
#include "app/commands/offline.h"
#include "app/exit_code.h"
#include "app/mpi/ranks.h"

namespace ressort::mpi {
namespace {

int render_by(Ranks& ranks, int argc, char** argv) {
  RenderOptions options{.executor = &ranks};
  options.is_silent = ranks.number() > 0;
  double seconds = 0.0;
  CLI::App app("renders a model, a large network's domains on as many processes as mpirun starts");
  app.footer("Example:\n  mpirun -n 4 ressort-mpi mesh.mdl --seconds 10 -o out.wav");
  app.add_option("MODEL", options.name, "a model's or a preset's name, or a file")->required();
  app.add_option("-o,--output", options.output, "the sound file, written over if it is there")
      ->required();
  app.add_option("-s,--seconds", seconds, "how long")->required()->check(within(0.0, 86400.0));
  app.add_option("-r,--rate", options.rate_hz, "Hz")
      ->check(within(1000.0, 768000.0))
      ->capture_default_str();
  app.add_option("--score", options.score, "a file of events");
  app.add_option("--input", options.input, "a sound file; its channel n drives input n");
  app.add_option("--midi", options.midi, "a Standard MIDI File");
  bool is_quiet = false;
  app.add_flag("-q,--quiet", is_quiet, "say nothing unless something is wrong");
  const bool speaks = ranks.number() == 0;
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // Every process reads the same line and comes to the same end.
    return speaks ? app.exit(error) : error.get_exit_code();
  }
  options.seconds = seconds;
  const auto rendered = render(options, {});
  if (!rendered || rendered->failure) {
    const Error& error = rendered ? *rendered->failure : rendered.error();
    std::fprintf(stderr, "%s\n", error.message.c_str());
    ranks.abort(rendered ? exit_code::our_failure : exit_code::wrong_use);
  }
  if (speaks && !is_quiet) {
    for (const std::string& warning : rendered->warnings) {
      std::fprintf(stderr, "%s\n", warning.c_str());
    }
    std::printf("%s: %s, %.2f s, on %zu %s\n", options.output.c_str(), rendered->name.c_str(),
                static_cast<double>(rendered->frames) / rendered->rate_hz, ranks.size(),
                ranks.size() == 1 ? "process" : "processes");
  }
  return exit_code::done;
}

}  // namespace
}  // namespace ressort::mpi

int main(int argc, char** argv) try {
  ressort::mpi::Ranks ranks(argc, argv);
  try {
    return ressort::mpi::render_by(ranks, argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "ressort-mpi: %s\n", error.what());
    ranks.abort(ressort::exit_code::our_failure);
  }
} catch (...) {
  std::fputs("ressort-mpi: MPI does not begin\n", stderr);
  return ressort::exit_code::our_failure;
}
