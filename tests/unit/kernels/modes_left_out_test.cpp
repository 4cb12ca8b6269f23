// Omitted modes: the error never exceeds the reported bound, and links on the remaining modes
// respond nearly as before.
#include "core/kernels/modal/modal.h"
#include "core/kernels/modal/modal_form.h"
#include "tests/support/comparison.h"
#include "tests/support/networks/random_network.h"

namespace ressort::modes_left_out_test {
namespace {

double factor_at(const ModalShare& share, std::size_t mode) {
  return mode >= share.first && mode < share.first + share.factor.size()
             ? share.factor[mode - share.first]
             : 0.0;
}

using support::KernelRunner;
using support::network_of;
using support::Random;
using support::RandomNetwork;
using support::show;

double value_of(const Program& program, std::uint32_t c) {
  return coefficient_value(program, program.coefficients[c], program.parameters, 1.0);
}

// Upper bounds of the output amplitudes of all modes of a complete form, for a strike through each
// push and for the initial state.
struct Swings {
  std::vector<std::vector<double>> blow;  // [push][output]
  std::vector<double> start;              // [output]
};

Swings swings_of(const Program& program, const Modes& modes) {
  const double w =
      modes.inverse_mass == Modes::own_mass ? 1.0 : value_of(program, modes.inverse_mass);
  Swings swings{std::vector(modes.pushes.size(), std::vector(modes.outputs.size(), 0.0)),
                std::vector(modes.outputs.size(), 0.0)};
  for (std::size_t i = 0; i < modes.modes; ++i) {
    double k = 0.0;
    double z = 0.0;
    for (const ModalShare& share : modes.stiffness) {
      k += w * value_of(program, share.coefficient) * factor_at(share, i);
    }
    for (const ModalShare& share : modes.damping) {
      z += w * value_of(program, share.coefficient) * factor_at(share, i);
    }
    // Angle of the poles a/2 +- i s.
    const double s = std::sqrt(1.0 - z - 0.25 * (2.0 - k - z) * (2.0 - k - z));
    if (!std::isfinite(s) || !(s > 0.0)) {
      continue;
    }
    // Amplitude of the mode, from its position in two successive samples.
    const double before = modes.q[i] - modes.d[i];
    const double along =
        (std::sqrt(1.0 - z) * before - modes.q[i] * (2.0 - k - z) / (2.0 * std::sqrt(1.0 - z))) /
        (s / std::sqrt(1.0 - z));
    const double start = std::sqrt(modes.q[i] * modes.q[i] + along * along);
    for (std::size_t o = 0; o < modes.outputs.size(); ++o) {
      if (!modes.outputs[o].is_place) {
        continue;
      }
      const double heard = std::fabs(modes.outputs[o].place.shape[i]);
      swings.start[o] += heard * start;
      for (std::size_t p = 0; p < modes.pushes.size(); ++p) {
        swings.blow[p][o] +=
            heard * std::fabs(modes.pushes[p].shape[i]) * w * std::sqrt(1.0 - z) / s;
      }
    }
  }
  return swings;
}

// A few random strikes of every kind, followed by silence.
std::vector<std::vector<double>> blows(const Program& program, Random& random, std::size_t frames) {
  std::vector<double> rest;
  for (const InputSlot& input : program.inputs) {
    rest.push_back(input.is_force ? 0.0 : program.position[input.node]);
  }
  std::vector<std::vector<double>> inputs(frames, rest);
  for (std::size_t i = 0; i < program.inputs.size(); ++i) {
    for (std::size_t n = 0; program.inputs[i].is_force && n < frames / 4; ++n) {
      inputs[n][i] = n == 0 || random.below(20) == 0 ? random.uniform(-1.0, 1.0) : 0.0;
    }
  }
  return inputs;
}

// Returns the sums of absolute inputs through each push. Position inputs rest.
std::vector<double> sums_of(const Program& program, const Modes& modes,
                            const std::vector<std::vector<double>>& inputs) {
  std::vector<double> sums;
  for (const ModalPush& push : modes.pushes) {
    double sum = 0.0;
    for (const auto& frame : inputs) {
      sum += push.by == ModalPush::By::force      ? std::fabs(frame[push.input])
             : push.by == ModalPush::By::position ? 0.0
                                                  : std::fabs(value_of(program, push.stiffness));
    }
    sums.push_back(sum);
  }
  return sums;
}

struct Tally {
  std::size_t networks = 0;
  std::size_t shortened = 0;
  std::size_t slept = 0;
  double tightest = 0.0;  // largest ratio of error to bound
};

void check_network(const Program& program, double silence_db, Random& random, Tally& tally) {
  const std::optional<Modes> full = modal_form(program);
  const std::optional<Modes> some = modal_form(program, {.silence_db = silence_db});
  if (!full || !some || full->modes == 0) {
    return;
  }
  if (std::any_of(program.outputs.begin(), program.outputs.end(),
                  [](const OutputSlot& output) { return output.is_force; })) {
    // Force outputs have no such bound.
    CHECK(some->modes == full->modes);
    CHECK(some->silence == 0.0);
    return;
  }
  const double budget = std::pow(10.0, silence_db / 20.0);
  CHECK(some->left_out + some->silence <= budget * (1.0 + 1e-12));
  CHECK(some->of == full->modes);
  ++tally.networks;
  tally.shortened += some->modes < some->of;
  Program whole = program;
  Program part = program;
  whole.form = *full;
  part.form = *some;
  constexpr std::size_t frames = 6000;
  const auto inputs = blows(program, random, frames);
  const Swings swings = swings_of(program, *full);
  const std::vector<double> sums = sums_of(program, *full, inputs);
  KernelRunner<double> one(whole, 1.0, best_isa());
  KernelRunner<double> other(part, 1.0, best_isa());
  const auto& kernel = dynamic_cast<const ModalKernel<double>&>(other.kernel());
  std::vector<double> asleep(full->outputs.size(), 0.0);
  bool has_slept = false;
  // No block is longer than a nap, so the error is largest at the begin or the end of a block.
  for (std::size_t at = 0; at < frames; at += 30) {
    const std::span block = std::span(inputs).subspan(at, 30);
    for (std::size_t o = 0; o < asleep.size(); ++o) {
      asleep[o] = kernel.owed(full->places.size() + o);
    }
    const auto wanted = one.play(block);
    const auto found = other.play(block);
    has_slept |= kernel.awake().modes < kernel.awake().of;
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      const std::size_t o = i % asleep.size();
      double bound = swings.start[o];
      for (std::size_t p = 0; p < sums.size(); ++p) {
        bound += sums[p] * swings.blow[p][o];
      }
      bound = some->left_out * bound + std::max(asleep[o], kernel.owed(full->places.size() + o)) +
              1e-9 * bound + 1e-12;
      const double off = std::fabs(found[i] - wanted[i]);
      tally.tightest = std::max(tally.tightest, off / bound);
      if (off > bound) {
        INFO("output " << o << " is off by " << show(off) << ", bound " << show(bound) << " at "
                       << at + i / asleep.size());
        CHECK(off <= bound);
        return;
      }
    }
  }
  tally.slept += has_slept;
}

TEST_CASE("Omitted modes of random networks stay below the reported bound", "[modes_left_out]") {
  Tally tally;
  for (std::uint64_t seed = 1; tally.networks < 200; ++seed) {
    REQUIRE(seed < 3000);
    const RandomNetwork network = support::random_network(seed);
    if (!network.is_linear || network.text.find("@a audioParam") != std::string::npos) {
      continue;
    }
    Random random(seed);
    const double silence_db = -10.0 * static_cast<double>(1 + random.below(6));
    INFO("seed " << seed << ", " << network.family << ", " << silence_db << " dB:\n"
                 << network.text);
    check_network(make_program(network_of(network.text), 44100.0, true), silence_db, random, tally);
  }
  INFO(tally.shortened << " had modes left out, " << tally.slept << " slept, at most "
                       << show(tally.tightest) << " of the bound was needed");
  CHECK(tally.shortened > 40);
  CHECK(tally.slept > 100);
  CHECK(tally.tightest > 0.1);
}

// Returns a string plucked over a wall, reduced to its lowest modes.
std::string string_over_a_wall(double stiffness) {
  constexpr int count = 50;
  std::string text = "@K param 0.1\n@Z param 0.0005\n@l ground 0.\n@wall ground -0.02\n";
  for (int i = 0; i < count; ++i) {
    const double at = (i + 1) / 51.0;
    const double x = 0.3 * (at < 0.3 ? at / 0.3 : (1.0 - at) / 0.7);
    text += scenes::at("m", i) + " mass 1. " + show(x) + " " + show(x) + "\n";
  }
  text += "@r ground 0.\n";
  for (int i = 0; i <= count; ++i) {
    text += scenes::at("s", i) + " springDamper " + (i == 0 ? "@l" : scenes::at("m", i - 1)) + " " +
            (i == count ? "@r" : scenes::at("m", i)) + " K Z\n";
  }
  return text + "@hit contact @wall @m20 " + show(stiffness) + " 0. 0.\n" +
         scenes::output(1, "m37");
}

// Returns the lowest `count` modes, with or without the static compliance of the others.
Program shortened(const Program& program, std::uint32_t count, bool gives) {
  const Modes full = program.form.get<Modes>();
  const std::vector<double>& factor = full.stiffness[0].factor;
  std::vector<std::uint32_t> order(full.modes);
  for (std::uint32_t i = 0; i < full.modes; ++i) {
    order[i] = i;
  }
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return factor[a] < factor[b]; });
  Modes modes = full;
  const auto shorten = [&](std::vector<double>& row) {
    std::vector<double> some;
    for (std::uint32_t i = 0; i < count; ++i) {
      some.push_back(row[order[i]]);
    }
    row = some;
  };
  double give = 0.0;
  for (std::uint32_t i = count; i < full.modes; ++i) {
    const double shape = full.places[0].shape[order[i]];
    give += shape * shape / factor[order[i]];
  }
  modes.modes = count;
  for (std::vector<double>* row :
       {&modes.q, &modes.d, &modes.stiffness[0].factor, &modes.damping[0].factor,
        &modes.places[0].shape, &modes.outputs[0].place.shape}) {
    shorten(*row);
  }
  modes.basis.clear();
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto first = full.basis.begin() + std::ptrdiff_t(order[i]) * program.moving;
    modes.basis.insert(modes.basis.end(), first, first + program.moving);
  }
  modes.give_by = modes.stiffness[0].coefficient;
  if (gives) {
    modes.holds[0].give = {give};
  }
  Program result = program;
  result.form = modes;
  return result;
}

std::vector<double> heard_of(const Program& program, std::size_t frames) {
  KernelRunner<double> fighter(program, 1.0, best_isa());
  std::vector<double> heard;
  for (std::size_t at = 0; at < frames; at += 44) {
    const auto some = fighter.play(std::vector<std::vector<double>>(44));
    heard.insert(heard.end(), some.begin(), some.end());
  }
  return heard;
}

TEST_CASE("A contact includes the compliance of omitted modes", "[modes_left_out]") {
  Program full = make_program(network_of(string_over_a_wall(2.0)), 44100.0, true);
  full.form = *modal_form(full);
  REQUIRE(full.form.get<Modes>().modes == 50);
  const auto wanted = heard_of(full, 220);
  const auto snr = [&](std::uint32_t count, bool gives) {
    const auto found = heard_of(shortened(full, count, gives), 220);
    return support::compare(1, wanted, found)[0].snr_db();
  };
  for (const std::uint32_t count : {10u, 25u}) {
    INFO(count << " of 50 modes: " << snr(count, false) << " dB, giving way " << snr(count, true)
               << " dB");
    CHECK(snr(count, true) > snr(count, false) + 5.0);
  }
}

TEST_CASE("Without a budget all audible modes are kept", "[modes_left_out]") {
  const Program program = make_program(network_of(scenes::mesh_20x30()), 44100.0, true);
  const Modes all = *modal_form(program);
  const Modes some = *modal_form(program, {.silence_db = -30.0});
  CHECK(all.left_out == 0.0);
  CHECK(all.silence == 0.0);
  CHECK(some.of == all.modes);
  CHECK(some.modes < all.modes);
  CHECK(some.left_out > 0.0);
  CHECK(some.left_out <= 0.02 * std::pow(10.0, -1.5));
}

}  // namespace
}  // namespace ressort::modes_left_out_test
