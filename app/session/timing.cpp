#include "app/session/timing.h"

#include <time.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "app/realtime/denormals.h"
#include "app/realtime/dsp_load.h"
#include "app/text.h"

namespace ressort::session {

double thread_cpu_ns() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e9 * static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec);
}

double cpu_time_ns(const Program&, const std::function<void()>& play) {
  const DenormalsFlushed flushed;
  const double start = thread_cpu_ns();
  play();
  return thread_cpu_ns() - start;
}

void measure(Plan& plan, const Engine& engine, const CompileOptions& options, int voices,
             const Timings& timings) {
  auto part = plan.parts.begin();
  const Workload load{
      .is_double = plan.precision == Precision::float64, .isa = options.isa, .voices = voices};
  for (const Program& program : engine.machine().parts) {
    if (program.moving > 0 && part != plan.parts.end()) {
      part->measured_ns = known_ns(program, load, timings).value_or(0.0);
      part->voices = voices;
      ++part;
    }
  }
}

std::string overload_warning(const Compiled& compiled, const CompileOptions& options,
                             const Timings& timings) {
  const int voices = compiled.instrument.voices;
  const auto share_of = [&](const Plan& plan) {
    double ns = 0.0;
    for (const Part& part : plan.parts) {
      ns += part.ns();
    }
    return ns * 1e-9 * options.rate_hz;
  };
  double share = share_of(compiled.plan);
  if (share > DspLoad::most && timings.time) {
    Plan measured = compiled.plan;
    measure(measured, *compiled.engine, options, voices, timings);
    share = share_of(measured);
  }
  if (!(share > DspLoad::most)) {
    return {};
  }
  const double each = share / std::max(1, voices);
  const int fitting = static_cast<int>(DspLoad::most / each);
  const auto percent = [](double part) {
    return "about " + std::to_string(std::llround(100.0 * part)) + " % of one core";
  };
  return (voices > 1 ? "all " + std::to_string(voices) + " voices" : std::string("its one voice")) +
         " would take " + percent(share) +
         (fitting > 0  ? ": " + std::to_string(fitting) + " fit"
          : voices > 1 ? ", one alone " + percent(each)
                       : "") +
         "; to lower the load, use " + ways_to_lower_load(fitting, compiled.plan.precision);
}

std::string ways_to_lower_load(int voices, Precision precision) {
  std::vector<std::string> ways;
  if (voices > 0) {
    ways.push_back("-p " + std::to_string(voices));
  } else {
    ways.emplace_back("a smaller model");
  }
  ways.emplace_back("a lower rate");
  if (precision != Precision::float32) {
    ways.emplace_back("--precision float");
  }
  return joined(ways, ", ");
}

}  // namespace ressort::session
