// Compares the 88 keys of a waveguide at three rates with those of the Synthesis ToolKit's plucked
// strings, both measured from their renders by tests/support/partial.h. Built by `cmake --build
// build --target ressort_stk` if libstk is installed.
#include <stk/Plucked.h>
#include <stk/Stk.h>
#include <stk/Twang.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <string>

#include "core/compile/machine.h"
#include "core/kernels/kernel.h"
#include "core/model/language/mdl.h"
#include "core/model/topology.h"
#include "tests/support/partial.h"
#include "tests/support/rooms.h"

namespace {

using namespace ressort;
using namespace ressort::support;

constexpr double t60_s = 2.0;  // decay time requested from the waveguide

using Sound = std::vector<double>;

Sound ours(double hz, double rate_hz, std::size_t frames) {
  char text[200];
  std::snprintf(text, sizeof text,
                "@s waveguide 1. %.17g %.17g 0.5 0.\n@in1 frcInput [@s 0.37]\n"
                "@out1 posOutput [@s 0.23]\n",
                hz, t60_s);
  const Program program = make_program(expand_macros(parse_network(text).network), rate_hz, true);
  const auto kernel = make_kernel<double>(program, 1, Isa::RESSORT_LEAST_ISA);
  const std::size_t lanes = kernel->width();
  for (std::uint32_t c = 0; c < program.coefficients.size(); ++c) {
    const double number =
        coefficient_value(program, program.coefficients[c], program.parameters, 1.0);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      kernel->coefficients.set(lane, c, number, false);
    }
  }
  Aligned<double> force(lanes, 1.0);
  const Aligned<double> speed(lanes);
  Aligned<double> output(lanes);
  Sound sound;
  while (sound.size() < frames) {
    kernel->step(
        {.frames = 1, .value = force.data(), .velocity = speed.data(), .outputs = output.data()});
    sound.push_back(output[0]);
    std::fill(force.begin(), force.end(), 0.0);
  }
  return sound;
}

Sound plucked(double hz, double, std::size_t frames) {
  stk::Plucked string(20.0);
  string.noteOn(hz, 1.0);
  Sound sound;
  while (sound.size() < frames) {
    sound.push_back(string.tick());
  }
  return sound;
}

Sound twang(double hz, double, std::size_t frames) {
  stk::Twang string(20.0);
  string.setPluckPosition(0.37);
  string.setFrequency(hz);
  Sound sound;
  while (sound.size() < frames) {
    sound.push_back(string.tick(sound.empty() ? 1.0 : 0.0));
  }
  return sound;
}

struct String {
  const char* name;
  std::function<Sound(double hz, double rate_hz, std::size_t frames)> play;
};

// Widens the distance between the windows step by step, so that no turn of the phase is missed.
HeardPartial heard(const Sound& sound, double rate_hz, double hz, double window_s, double apart_s) {
  HeardPartial found{.hz = hz};
  for (double apart = 1.0 / hz; apart < apart_s; apart *= 2.0) {
    found = partial_of(sound, rate_hz, found.hz, 0.0, window_s, apart);
  }
  return partial_of(sound, rate_hz, found.hz, 0.0, window_s, apart_s);
}

void judge(const String& string, double rate_hz) {
  std::vector<double> off;
  std::string t60;
  for (int key = 21; key <= 108; ++key) {
    const double hz = 440.0 * std::exp2((key - 69) / 12.0);
    const double window_s = 28.0 / hz;  // short, because the highest notes of STK end soon
    const double apart_s = 16.0 / hz;
    const auto frames = static_cast<std::size_t>(rate_hz * (window_s + apart_s)) + 2;
    const HeardPartial found =
        heard(string.play(hz, rate_hz, frames), rate_hz, hz, window_s, apart_s);
    off.push_back(std::fabs(cents(found.hz, hz)));
    if (key == 21 || key == 60 || key == 108) {
      char seconds[32];
      std::snprintf(seconds, sizeof seconds, "%s%.3g", t60.empty() ? "" : ", ", found.t60_s);
      t60 += seconds;
    }
  }
  std::sort(off.begin(), off.end());
  const auto within = [&](double most) {
    return static_cast<int>(std::upper_bound(off.begin(), off.end(), most) - off.begin());
  };
  std::printf("| %s | %.0f | %.2g | %.2g | %d | %d | %s |\n", string.name, rate_hz,
              off[off.size() / 2], off.back(), within(0.02), within(1.0), t60.c_str());
}

}  // namespace

int main() {
  const String strings[] = {
      {"ressort, `waveguide`", ours}, {"STK, `Twang`", twang}, {"STK, `Plucked`", plucked}};
  std::printf(
      "| string | rate, Hz | cents off, median | worst | keys within 0.02 | within 1 | T60 of A0, "
      "C4, "
      "C8, s |\n| --- | --- | --- | --- | --- | --- | --- |\n");
  for (const String& string : strings) {
    for (const double rate_hz : {44100.0, 48000.0, 96000.0}) {
      stk::Stk::setSampleRate(rate_hz);
      judge(string, rate_hz);
    }
  }
}
