// Compares the reported modes of a network with those of its sound: poles and levels estimated from
// the samples of the direct form only. Needs Eigen.
#include <chrono>
#include <numbers>

#include "core/analysis/linear.h"
#include "core/analysis/modes/modes.h"
#include "tests/support/harness.h"
#include "tests/support/poles.h"

namespace ressort::modes_test {

using namespace support;

namespace {

// Chains, meshes, random graphs, strings with places, and strings that share a mass, with unrelated
// masses, springs and dampers, so that damping is not proportional. Every mass is an output, the
// first output is an inner mass, and one input drives another mass.
class RandomText {
 public:
  explicit RandomText(std::uint64_t seed) : random_(seed + 1) {
    text_ = "@g ground 0.\n";
    switch (seed % 5) {
      case 0: {
        const std::size_t count = masses(3 + random_.below(18));
        for (std::size_t i = 0; i + 1 < count; ++i) {
          spring(i, i + 1);
        }
        ground(0);
        break;
      }
      case 1: {
        const std::size_t columns = 2 + random_.below(3);
        const std::size_t count = masses(columns * (2 + random_.below(4)));
        for (std::size_t i = 0; i < count; ++i) {
          if ((i + 1) % columns != 0) {
            spring(i, i + 1);
          }
          if (i + columns < count) {
            spring(i, i + columns);
          }
        }
        ground(random_.below(count));
        ground(random_.below(count));
        break;
      }
      case 2: {
        const std::size_t count = masses(2 + random_.below(18));
        for (std::size_t i = 1; i < count; ++i) {
          spring(i, random_.below(i));
        }
        for (std::size_t i = 0; i < count; ++i) {
          spring(i, random_.below(count));
        }
        ground(0);
        break;
      }
      case 3: {  // A string whose places carry masses.
        const std::size_t nodes = 5 + random_.below(12);
        text_ += "@s string " + std::to_string(nodes) + " " + number(0.6, 2.0) + " " +
                 number(0.03, 0.3) + " " + number(1e-4, 2e-3) + " 0. 0.\n";
        for (std::size_t i = 1; i + 1 < nodes; ++i) {
          ends_.push_back("[@s " + show(static_cast<double>(i) / static_cast<double>(nodes - 1)) +
                          "]");
        }
        const std::size_t strung = ends_.size();
        const std::size_t count = masses(1 + random_.below(4));
        for (std::size_t i = strung; i < count; ++i) {
          link(ends_[i], "[@s " + number(0.1, 0.9) + "]");
          ground(i);
        }
        break;
      }
      default: {  // Two chains that share a mass.
        const std::size_t first = masses(3 + random_.below(8));
        const std::size_t count = masses(2 + random_.below(8));
        for (std::size_t i = 0; i + 1 < first; ++i) {
          spring(i, i + 1);
        }
        spring(random_.below(first), first);
        for (std::size_t i = first; i + 1 < count; ++i) {
          spring(i, i + 1);
        }
        ground(0);
        ground(count - 1);
        break;
      }
    }
    for (std::size_t i = 0; i < ends_.size(); ++i) {
      text_ += "@in" + std::to_string(i + 1) + " frcInput " + ends_[i] + "\n";
      text_ += "@out" + std::to_string(i + 1) + " posOutput " + ends_[i] + "\n";
    }
  }

  const std::string& text() const { return text_; }

 private:
  std::string number(double low, double high) {
    return show(low * std::pow(high / low, random_.uniform(0.0, 1.0)));
  }
  std::size_t masses(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      ends_.push_back("@m" + std::to_string(ends_.size()));
      text_ += ends_.back() +
               (random_.below(4) == 0 ? " osc " + number(0.6, 4.0) + " " + number(1e-3, 0.1) + " " +
                                            number(1e-5, 1e-3)
                                      : " mass " + number(0.6, 4.0)) +
               " 0. 0.\n";
    }
    return ends_.size();
  }
  void link(const std::string& a, const std::string& b) {
    text_ += "@l" + std::to_string(links_++) + " springDamper " + a + " " + b + " " +
             number(0.01, 0.2) + " " + number(1e-5, 4e-3) + "\n";
  }
  void spring(std::size_t a, std::size_t b) {
    if (a != b) {
      link(ends_[a], ends_[b]);
    }
  }
  void ground(std::size_t a) { link(ends_[a], "@g"); }

  Random random_;
  std::string text_;
  std::vector<std::string> ends_;
  std::size_t links_ = 0;
};

struct Heard {
  Pole pole;
  std::vector<double> levels;  // [input] At the first output, at the time of the impulse.
};

// Estimates the modes from the responses to impulses at every mass: the poles of the recurrence
// from two samples of all outputs to the next, by least squares over all samples, and their
// amplitudes at the first output.
std::vector<Heard> listen(const Program& program, double rate_hz) {
  constexpr Eigen::Index frames = 1500;
  const auto ends = static_cast<Eigen::Index>(program.outputs.size());
  // Scaled as the engine scales an input.
  const double impulse = Network::reference_rate_hz / rate_hz;
  Eigen::MatrixXd before(frames * ends, 2 * ends);
  Eigen::MatrixXd after(frames * ends, 2 * ends);
  Eigen::MatrixXd sound(frames, ends);
  for (Eigen::Index input = 0; input < ends; ++input) {
    Bare<double> bare(program);
    std::vector<double> hands(program.inputs.size(), 0.0);
    std::vector<double> last(program.outputs.size(), 0.0);
    hands[static_cast<std::size_t>(input)] = impulse;
    std::vector<double> now = bare.step(hands);
    hands.assign(hands.size(), 0.0);
    for (Eigen::Index n = 0; n < frames; ++n) {
      const std::vector<double> next = bare.step(hands);
      sound(n, input) = now[0];
      for (Eigen::Index i = 0; i < ends; ++i) {
        const auto at = static_cast<std::size_t>(i);
        before(input * frames + n, i) = now[at];
        before(input * frames + n, ends + i) = now[at] - last[at];
        after(input * frames + n, i) = next[at];
        after(input * frames + n, ends + i) = next[at] - now[at];
      }
      last = now;
      now = next;
    }
  }
  const Eigen::MatrixXd step = support::least_squares(before, after);
  const Eigen::VectorXcd poles = support::eigenvalues_of(step);
  Eigen::MatrixXcd partials(frames, poles.size());
  for (Eigen::Index n = 0; n < frames; ++n) {
    for (Eigen::Index i = 0; i < poles.size(); ++i) {
      partials(n, i) = std::pow(poles(i), static_cast<double>(n + 1));
    }
  }
  const Eigen::MatrixXcd amplitudes =
      support::least_squares(partials, sound.cast<std::complex<double>>());
  std::vector<Heard> heard;
  for (Eigen::Index i = 0; i < poles.size(); ++i) {
    if (poles(i).imag() > 1e-9) {
      heard.push_back({pole_of(poles(i), rate_hz), {}});
      for (Eigen::Index input = 0; input < ends; ++input) {
        heard.back().levels.push_back(2.0 * std::abs(amplitudes(i, input)));
      }
    }
  }
  std::sort(heard.begin(), heard.end(),
            [](const Heard& a, const Heard& b) { return a.pole.hertz < b.pole.hertz; });
  return heard;
}

// Worst differences between reported and measured modes.
struct Off {
  double hertz = 0.0;
  double t60_share = 0.0;
  double level_db = 0.0;
  std::size_t modes = 0;
  std::size_t levels = 0;
};

void compare(std::uint64_t seed, Off& off) {
  const RandomText scene(seed);
  const Network network = network_of(scene.text());
  const double rate_hz = seed % 2 == 0 ? 44100.0 : 48000.0;
  INFO("seed " << seed << "\n" << scene.text());
  const auto found = find_modes(network, {}, {.rate_hz = rate_hz});
  REQUIRE(found);
  CHECK(found->is_all);
  CHECK(found->residual < 1e-8);
  const std::vector<Heard> heard = listen(make_program(network, rate_hz, true), rate_hz);
  REQUIRE(found->modes.size() == heard.size());
  std::vector<double> loudest(network.inputs.size(), 0.0);
  for (const Heard& mode : heard) {
    for (std::size_t input = 0; input < loudest.size(); ++input) {
      loudest[input] = std::max(loudest[input], mode.levels[input]);
    }
  }
  for (std::size_t i = 0; i < heard.size(); ++i) {
    const NetworkMode& mode = found->modes[i];
    INFO("mode " << i << ": " << mode.frequency_hz << " Hz, heard " << heard[i].pole.hertz << "; "
                 << mode.t60_s << " s, heard " << heard[i].pole.t60_s);
    off.hertz = std::max(off.hertz, std::fabs(mode.frequency_hz - heard[i].pole.hertz));
    off.t60_share = std::max(off.t60_share, std::fabs(mode.t60_s / heard[i].pole.t60_s - 1.0));
    CHECK(std::fabs(mode.frequency_hz - heard[i].pole.hertz) < 0.01);
    CHECK(std::fabs(mode.t60_s / heard[i].pole.t60_s - 1.0) < 1e-3);
    for (std::size_t input = 0; input < loudest.size(); ++input) {
      const double level = mode.levels[input * found->outputs];
      const double there = heard[i].levels[input];
      if (there > 1e-6 * loudest[input]) {  // Levels 120 dB below the loudest are inaudible.
        const double db = std::fabs(20.0 * std::log10(level / there));
        INFO("from input " << input + 1 << " " << level << ", heard " << there);
        off.level_db = std::max(off.level_db, db);
        CHECK(db < 0.1);
        ++off.levels;
      }
    }
    ++off.modes;
  }
}

}  // namespace

TEST_CASE("the modes of a network are those of its sound", "[modes]") {
  Off off;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    compare(seed, off);
  }
  CHECK(off.modes > 150);
}

TEST_CASE("the modes of 208 networks are those of their sound", "[.][modes_everywhere]") {
  Off off;
  for (std::uint64_t seed = 0; seed < 208; ++seed) {
    compare(seed, off);
  }
  WARN(off.modes << " modes, " << off.levels << " levels: at most " << off.hertz << " Hz, "
                 << 100.0 * off.t60_share << " % of T60, " << off.level_db << " dB off");
  CHECK(off.modes > 1500);
}

TEST_CASE("position inputs and force outputs have modal levels", "[modes]") {
  const std::string text =
      "@in1 posInput 0.\n@g ground 0.\n@m0 mass 1. 0. 0.\n@m1 osc 2. 0.01 0.0003 0. 0.\n"
      "@m2 mass 1.5 0. 0.\n@a springDamper @in1 @m0 0.05 0.002\n@b springDamper @m0 @m1 0.1 "
      "0.0002\n"
      "@c springDamper @m1 @m2 0.07 0.001\n@d springDamper @m2 @g 0.02 0.003\n"
      "@in2 frcInput @m1\n@out1 posOutput @m2\n@out2 frcOutput @m0\n"
      "@out3 frcOutput @g\n@out4 frcOutput @in1\n";
  for (const double rate_hz : {44100.0, 96000.0}) {
    const Network network = network_of(text);
    const auto found = find_modes(network, {}, {.rate_hz = rate_hz});
    REQUIRE(found);
    REQUIRE(found->modes.size() == 3);
    const Program program = make_program(network, rate_hz, true);
    for (std::size_t input = 0; input < 2; ++input) {
      Bare<double> bare(program);
      std::vector<double> hands(2, 0.0);
      hands[input] = input == 0 ? 1.0 : Network::reference_rate_hz / rate_hz;
      bare.step(hands);
      hands[input] = 0.0;
      constexpr Eigen::Index frames = 3000;
      Eigen::MatrixXd sound(frames, 4);
      Eigen::MatrixXcd partials(frames, 6);
      for (Eigen::Index n = 0; n < frames; ++n) {
        const std::vector<double> now = bare.step(hands);
        for (Eigen::Index o = 0; o < 4; ++o) {
          sound(n, o) = now[static_cast<std::size_t>(o)];
        }
        for (Eigen::Index m = 0; m < 3; ++m) {
          const std::complex<double> z = 1.0 + found->modes[static_cast<std::size_t>(m)].mu;
          // A position input acts after the masses have stepped; a force acts within the step.
          partials(n, m) = std::pow(z, static_cast<double>(n + 1) + static_cast<double>(input));
          partials(n, m + 3) = std::conj(partials(n, m));
        }
      }
      // The first samples contain the input itself.
      const Eigen::Index rest = frames - 4;
      const Eigen::MatrixXcd there = sound.bottomRows(rest).cast<std::complex<double>>();
      const Eigen::MatrixXcd shares = support::least_squares(partials.bottomRows(rest), there);
      CHECK((partials.bottomRows(rest) * shares - there).norm() < 1e-9 * there.norm());
      for (Eigen::Index m = 0; m < 3; ++m) {
        for (Eigen::Index o = 0; o < 4; ++o) {
          const double level = found->modes[static_cast<std::size_t>(m)]
                                   .levels[input * 4 + static_cast<std::size_t>(o)];
          INFO(rate_hz << " Hz, input " << input + 1 << ", output " << o + 1 << ", mode " << m);
          CHECK(std::fabs(2.0 * std::abs(shares(m, o)) / level - 1.0) < 1e-7);
        }
      }
    }
  }
}

namespace {

// For a rectangle with a fixed border, k for M = 1 is known in closed form.
void check_mesh(std::size_t rows, std::size_t columns, std::size_t count, double z) {
  constexpr double stiffness = 0.2;
  const Network network =
      network_of("@s closedMesh " + std::to_string(rows) + " " + std::to_string(columns) + " 1. " +
                 show(stiffness) + " " + show(z * stiffness) +
                 " 0. 0.\n@in1 frcInput [@s 0.37 0.41]\n@out1 posOutput [@s 0.23 0.31]\n");
  const auto start = std::chrono::steady_clock::now();
  const auto found = find_modes(network, {}, {.count = count});
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  INFO((found ? "" : found.error().message));
  REQUIRE(found);
  CHECK(found->residual < 1e-8);
  std::vector<double> expected;
  for (std::size_t p = 1; p + 1 < rows; ++p) {
    for (std::size_t q = 1; q + 1 < columns; ++q) {
      const auto part = [](std::size_t i, std::size_t n) {
        const double sine =
            std::sin(0.5 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n - 1));
        return 4.0 * sine * sine;
      };
      const double k = stiffness * (part(p, rows) + part(q, columns));
      expected.push_back(scheme_frequency_hz(k, z * k, Network::reference_rate_hz));
    }
  }
  std::sort(expected.begin(), expected.end());
  REQUIRE(found->modes.size() == std::min(count, expected.size()));
  double off = 0.0;
  for (std::size_t i = 0; i < found->modes.size(); ++i) {
    off = std::max(off, std::fabs(found->modes[i].frequency_hz / expected[i] - 1.0));
  }
  CHECK(off < 1e-8);
  if (rows * columns > 50'000) {
    WARN(network.macros[0].length * network.macros[0].width
         << " masses, " << count << " modes: " << took.count() << " s, residual " << found->residual
         << ", pitch " << off << " off");
  }
}

TEST_CASE("outputs of equal number are summed", "[modes]") {
  const std::string text =
      "@s string 12 1. 0.2 0.001 0. 0.\n@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.9] 0.5\n"
      "@out2 posOutput [@s 0.5]\n";
  const auto found = [](const std::string& model) {
    const Network network = network_of(model);
    auto modes = find_modes(network, parameter_values(network), {});
    REQUIRE(modes);
    return *std::move(modes);
  };
  const NetworkModes both = found(text + "@out1 posOutput [@s 0.2] -2.\n");
  const NetworkModes apart = found(text + "@out3 posOutput [@s 0.2] -2.\n");
  REQUIRE(both.outputs == 2);
  REQUIRE(apart.outputs == 3);
  for (std::size_t m = 0; m < both.modes.size(); ++m) {
    const auto sum = apart.modes[m].residues[0] + apart.modes[m].residues[2];
    CHECK(std::abs(both.modes[m].residues[0] - sum) < 1e-12);
    CHECK(both.modes[m].levels[0] == Approx(std::abs(sum)).margin(1e-12));
    CHECK(std::abs(both.modes[m].residues[1] - apart.modes[m].residues[1]) < 1e-12);
  }
}

}  // namespace

TEST_CASE("the lowest modes of a large mesh include degenerate ones", "[modes]") {
  check_mesh(42, 50, 40, 0.001);
  check_mesh(45, 45, 60, 0.0);  // Every second mode is degenerate.
}

TEST_CASE("a hundred modes of a hundred thousand masses", "[.][modes_everywhere]") {
  check_mesh(316, 318, 100, 0.001);
}

TEST_CASE("modes with non-proportional damping are found in small and large networks", "[modes]") {
  // The same string, solved completely and from the lowest mode upwards.
  std::string text =
      "@s string 220 1. 0.2 0.0002 0. 0.\n@o osc 3. 0.01 0.02 0. 0.\n"
      "@l springDamper @o [@s 0.31] 0.05 0.03\n@in1 frcInput [@s 0.1]\n"
      "@out1 posOutput [@s 0.83]\n";
  const Network network = network_of(text);
  const auto all = find_modes(network, {}, {});
  REQUIRE(all);
  CHECK(all->is_all);
  CHECK(!all->is_proportional);
  // Another unconnected string makes it too large for the complete solution.
  const Network large = network_of(text + "@t string 420 1. 0.2 0.0002 0. 0.\n");
  const auto lowest = find_modes(large, {}, {.count = 60});
  INFO((lowest ? "" : lowest.error().message));
  REQUIRE(lowest);
  CHECK(!lowest->is_all);
  CHECK(lowest->residual < 1e-8);
  std::size_t next = 0;
  for (const NetworkMode& mode : lowest->modes) {
    if (mode.levels[0] > 1e-12) {
      INFO("mode " << next << ", " << mode.frequency_hz << " Hz");
      REQUIRE(next < all->modes.size());
      CHECK(std::fabs(mode.frequency_hz / all->modes[next].frequency_hz - 1.0) < 1e-9);
      CHECK(std::fabs(mode.t60_s / all->modes[next].t60_s - 1.0) < 1e-6);
      CHECK(std::fabs(mode.levels[0] / all->modes[next].levels[0] - 1.0) < 1e-5);
      ++next;
    }
  }
  CHECK(next >= 5);
}

TEST_CASE("overdamped motions are not listed as modes", "[modes]") {
  const auto count = [](const std::string& text) {
    const auto found = find_modes(network_of(text), {}, {});
    REQUIRE(found);
    return found->modes.size();
  };
  CHECK(count("@m0 mass 1. 0. 0.\n@out1 posOutput @m0\n") == 0);  // Drifts.
  CHECK(count("@m0 mass 1. 0. 0.\n@m1 mass 1. 0. 0.\n@l springDamper @m0 @m1 0.1 0.001\n"
              "@out1 posOutput @m0\n") == 1);  // Drifts and oscillates.
  CHECK(count("@m0 osc 1. 0.0001 0.5 0. 0.\n@out1 posOutput @m0\n") == 0);  // Overdamped.
  CHECK(count("@g ground 0.\n@out1 posOutput @g\n") == 0);
  CHECK(!find_modes(network_of("@p param 0.\n@m0 mass p 0. 0.\n@out1 posOutput @m0\n"),
                    std::vector<double>{0.0}, {}));
}

TEST_CASE("undamped modes have an infinite T60 despite rounding", "[modes]") {
  constexpr int masses = 58;
  constexpr double stiffness = 0.1;
  std::string text = "@m0 ground 0.\n";
  for (int i = 1; i <= masses + 1; ++i) {
    const std::string mass = "@m" + std::to_string(i);
    text += mass + (i <= masses ? " mass 1. 0. 0.\n" : " ground 0.\n") + "@l" + std::to_string(i) +
            " spring @m" + std::to_string(i - 1) + " " + mass + " 0.1 0.\n";
  }
  const auto found = find_modes(network_of(text + "@out1 posOutput @m7\n"), {}, {});
  REQUIRE(found);
  REQUIRE(found->modes.size() == masses);
  for (int k = 1; k <= masses; ++k) {
    // sin(theta / 2) = sqrt(K/M) sin(k pi / (2 (n + 1)))
    const double angle = 2.0 * std::asin(std::sqrt(stiffness) *
                                         std::sin(k * std::numbers::pi / (2.0 * (masses + 1))));
    const NetworkMode& mode = found->modes[static_cast<std::size_t>(k - 1)];
    const double frequency_hz = angle * Network::reference_rate_hz / (2.0 * std::numbers::pi);
    CHECK(std::fabs(mode.frequency_hz / frequency_hz - 1.0) < 1e-11);
    CHECK(std::isinf(mode.t60_s));
  }
}

}  // namespace ressort::modes_test
