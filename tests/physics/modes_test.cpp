// The modes that are told of a network against those that its sound has: poles and levels found in
// nothing but the samples that the direct form renders. Needs Eigen.
#include <Eigen/Dense>

#include "core/analysis/modes/modes.h"
#include "tests/support/harness.h"
#include "tests/support/poles.h"

using namespace ressort;
using namespace ressort::support;

namespace {

// Chains, meshes, random graphs, strings with places on them and strings that share a mass, of
// masses, springs and dampers that nothing relates: damping is not proportional. Every mass is
// heard, the first output is somewhere within, and one input pushes another mass.
class Scene {
 public:
  explicit Scene(std::uint64_t seed) : random_(seed + 1) {
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
      case 3: {  // a string whose places hold masses
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
      default: {  // two chains that share a mass
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
  std::vector<double> levels;  // [input] at the first output, at the time of the impulse
};

// What is in the sounds of impulses at every mass: the poles of the recurrence that takes two
// samples of every output to the next, by least squares over all samples, and how much of each is
// in the first output.
std::vector<Heard> listen(const Program& program, double rate_hz) {
  constexpr Eigen::Index frames = 1500;
  const auto ends = static_cast<Eigen::Index>(program.outputs.size());
  const double impulse = Network::reference_rate_hz / rate_hz;  // as the engine feeds an input
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
  const Eigen::MatrixXd step = before.householderQr().solve(after);
  const Eigen::VectorXcd poles = step.eigenvalues();
  Eigen::MatrixXcd partials(frames, poles.size());
  for (Eigen::Index n = 0; n < frames; ++n) {
    for (Eigen::Index i = 0; i < poles.size(); ++i) {
      partials(n, i) = std::pow(poles(i), static_cast<double>(n + 1));
    }
  }
  const Eigen::MatrixXcd amplitudes =
      partials.colPivHouseholderQr().solve(sound.cast<std::complex<double>>());
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

// How far the modes told are from those heard, at worst.
struct Off {
  double hertz = 0.0;
  double t60_share = 0.0;
  double level_db = 0.0;
  std::size_t modes = 0;
  std::size_t levels = 0;
};

void compare(std::uint64_t seed, Off& off) {
  const Scene scene(seed);
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
      if (there > 1e-6 * loudest[input]) {  // nobody hears what is 120 dB below
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
