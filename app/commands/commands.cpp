#include "app/commands/commands.h"
#include "app/commands/output.h"

#include <signal.h>

#include <cmath>
#include <cstdio>
#include <optional>
#include <utility>
#include <vector>

#include "app/commands/flight/flight_player.h"
#include "app/commands/progress_bar.h"
#include "app/session/load_progress.h"
#include "app/session/problem_reports.h"
#include "core/format.h"

namespace ressort::commands {
namespace {

Flag interrupted;  // set by a signal while rendering

std::string db(double factor) {
  if (factor <= 0.0) {
    return "silent";
  }
  const double level = 20.0 * std::log10(factor);
  return formatted("%.1f dBFS", level > -0.05 && level < 0.0 ? 0.0 : level);
}

// Lets a signal stop the render, and a second signal the program.
void watch_signals() {
  struct sigaction once {};
  once.sa_handler = [](int) { interrupted.raise(); };
  once.sa_flags = static_cast<int>(SA_RESETHAND);
  for (const int signal : ending_signals()) {
    sigaction(signal, &once, nullptr);
  }
}

void ignore_signals_no_more() {
  for (const int signal : ending_signals()) {
    ::signal(signal, SIG_DFL);
  }
}

}  // namespace

std::vector<int> ending_signals() {
  std::vector<int> signals = {SIGINT, SIGTERM};
  struct sigaction now {};
  if (sigaction(SIGHUP, nullptr, &now) == 0 && now.sa_handler != SIG_IGN) {
    signals.push_back(SIGHUP);
  }
  return signals;
}

int render_command(const RenderOptions& options, bool is_quiet) {
  std::optional<ProgressBar> bar(!is_quiet);
  RenderOptions watched = options;
  LoadProgress news(options.name, is_quiet ? MessageHandler() : print_error);
  watched.loading = Progress([&](std::string_view stage) {
    news.at(stage);
    return true;  // a signal ends the process
  });
  bool is_watched = false;
  const auto make = is_flight_name(options.name) ? render_flight : render;
  const auto rendered = make(watched, [&](double share) {
    if (!std::exchange(is_watched, true)) {
      watch_signals();
    }
    bar->show(share, options.output);
    return !interrupted.is_raised();
  });
  ignore_signals_no_more();
  bar.reset();
  if (!rendered) {
    const bool was_stopped = interrupted.is_raised();
    print_error(was_stopped ? options.name + ": interrupted before the first sample"
                            : rendered.error().message);
    return was_stopped ? exit_code::our_failure : exit_code::wrong_use;
  }
  if (rendered->failure) {
    print_error(rendered->failure->message);
    return exit_code::our_failure;
  }
  if (!is_quiet) {
    for (const std::string& warning : rendered->warnings) {
      print_error(warning);
    }
    std::printf("%s: %s, %.2f s, %d %s, %g Hz, peak %s, rms %s%s\n", options.output.c_str(),
                rendered->name.c_str(), static_cast<double>(rendered->frames) / rendered->rate_hz,
                rendered->channels, rendered->channels == 1 ? "channel" : "channels",
                rendered->rate_hz, db(rendered->peak).c_str(), db(rendered->rms).c_str(),
                rendered->was_interrupted ? ", interrupted" : "");
    if (rendered->peak > 1.0) {
      print_error("the peak exceeds full scale; pass --limit to avoid clipping");
    }
    const bool was_asked = is_flight_name(options.name) || !options.score.empty() ||
                           !options.input.empty() || !options.midi.empty();
    if (rendered->peak == 0.0 && rendered->frames > 0 && !was_asked) {
      print_error(
          "the output is silent: no motion reaches it; pass --score or --input, or --motion"
          " if a mass should start with a velocity");
    }
  }
  if (rendered->resets > 0) {
    print_error(rendered->name + ": a voice was faded out" +
                (rendered->resets == 1 ? "" : " " + std::to_string(rendered->resets) + " times") +
                ", because " + session::reset_cause(rendered->is_proved) +
                "; the output is not valid");
  }
  return rendered->was_interrupted ? exit_code::our_failure : exit_code::done;
}

int gallery_command(const GalleryOptions& options) {
  watch_signals();
  return gallery(options, [] { return !interrupted.is_raised(); });
}

int describe_command(const DescribeOptions& options) {
  watch_signals();
  return describe(options, [] { return !interrupted.is_raised(); });
}

int shape_command(const ShapeOptions& options) {
  watch_signals();
  return shape_model(options, [] { return !interrupted.is_raised(); });
}

}  // namespace ressort::commands
