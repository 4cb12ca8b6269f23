// The loops over the voices of one kernel. Sums and peaks are compared with scalar results, for
// every instruction set, and for blocks with and without partial packs.
#include "core/engine/mix.h"

#include <limits>

#include "core/kernels/kernel.h"
#include "tests/support/catch.h"
#include "tests/support/comparison.h"
#include "tests/support/random.h"

namespace ressort::mixer_test {
namespace {

using support::Random;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double no_number = std::numeric_limits<double>::quiet_NaN();

template <class T, class Use>
void each_mixer(Use&& use) {
  for (const Isa isa : support::isas()) {
    INFO(isa_name(isa));
    use(with_isa(isa, []<Isa level>() { return make_mixer<level, T>(); }));
  }
}

// Numbers of voices: one, and the lanes of one, two and five packs of 16 bytes.
template <class T>
std::vector<std::size_t> widths() {
  constexpr std::size_t lanes = 16 / sizeof(T);
  return {1, lanes, 2 * lanes, 5 * lanes};
}

template <class T>
std::vector<T> random_rows(Random& random, std::size_t count) {
  std::vector<T> rows(count);
  for (T& y : rows) {
    y = static_cast<T>(random.uniform(-1.0, 1.0));
  }
  return rows;
}

template <class T, class Use>
void each_shape(Use&& use) {
  for (const std::size_t frames : {1u, 3u, 4u, 17u, 63u, 64u}) {
    for (const std::size_t outputs : {1u, 2u, 3u}) {
      for (const std::size_t width : widths<T>()) {
        CAPTURE(frames, outputs, width);
        use(frames, outputs, width);
      }
    }
  }
}

}  // namespace

TEST_CASE("silence contains 0 and -0 only", "[mixer]") {
  each_mixer<double>([](const Mixer<double>& mixer) {
    for (std::size_t frames = 1; frames <= max_block_frames; ++frames) {
      std::vector<double> samples(frames, 0.0);
      samples[frames / 2] = -0.0;
      CHECK(mixer.is_silent(samples.data(), frames));
      for (const double sound : {1.0, -1e-300, 5e-324, infinity, no_number}) {
        for (const std::size_t at : {std::size_t{0}, frames / 2, frames - 1}) {
          std::vector<double> sounding = samples;
          sounding[at] = sound;
          CHECK_FALSE(mixer.is_silent(sounding.data(), frames));
        }
      }
    }
  });
}

TEMPLATE_TEST_CASE("a peak is the largest magnitude of a lane, and infinite beyond its bound",
                   "[mixer]", double, float) {
  using T = TestType;
  Random random(17);
  each_mixer<T>([&](const Mixer<T>& mixer) {
    each_shape<T>([&](std::size_t frames, std::size_t outputs, std::size_t width) {
      const std::size_t rows = frames * outputs;
      std::vector<T> y = random_rows<T>(random, rows * width);
      std::vector<T> wanted(width, T(0));
      for (std::size_t i = 0; i < y.size(); ++i) {
        wanted[i % width] = std::max(wanted[i % width], std::fabs(y[i]));
      }
      std::vector<T> peak(width);
      const std::vector<T> silent(width, T(0));
      std::vector<double> channel(frames, 0.5);
      const std::vector<double*> channels(outputs, channel.data());
      const auto find = [&](double bound) {
        CHECK(mixer.mix({y.data(), frames, outputs, width, width}, bound, silent.data(),
                        channels.data(), peak.data()));
        return peak;
      };
      CHECK(find(2.0) == wanted);
      for (const double bad : {infinity, -infinity, no_number, 3.0, -2.0}) {
        const std::size_t at = (rows * width) / 2;
        const T before = std::exchange(y[at], static_cast<T>(bad));
        std::vector<T> beyond = wanted;
        beyond[at % width] = static_cast<T>(infinity);
        const std::vector<T> found = find(2.0);
        for (std::size_t lane = 0; lane < width; ++lane) {
          CHECK(found[lane] == (lane == at % width ? beyond[lane] : wanted[lane]));
        }
        y[at] = before;
      }
    });
  });
}

TEMPLATE_TEST_CASE("channels receive the sum of all lanes times their gains", "[mixer]", double,
                   float) {
  using T = TestType;
  Random random(18);
  each_mixer<T>([&](const Mixer<T>& mixer) {
    each_shape<T>([&](std::size_t frames, std::size_t outputs, std::size_t width) {
      std::vector<T> y = random_rows<T>(random, frames * outputs * width);
      std::vector<T> gain(width);
      for (std::size_t lane = 0; lane < width; ++lane) {
        gain[lane] = lane % 3 == 1 ? T(0) : static_cast<T>(random.uniform(0.1, 1.0));
        for (std::size_t i = lane; i < y.size() && gain[lane] == T(0); i += width) {
          y[i] = static_cast<T>(i % 2 == 0 ? no_number : infinity);  // ignored by the mix
        }
      }
      std::vector<std::vector<double>> channels(outputs, std::vector<double>(frames, 0.5));
      std::vector<double*> pointers;
      for (std::vector<double>& channel : channels) {
        pointers.push_back(channel.data());
      }
      mixer.add_voices({y.data(), frames, outputs, width, width}, gain.data(), pointers.data());
      // The tolerance is one rounding of half an epsilon per lane.
      constexpr double epsilon = std::numeric_limits<T>::epsilon();
      const double most = static_cast<double>(width * width + 2) * 0.5 * epsilon;
      std::size_t off = 0;
      for (std::size_t n = 0; n < frames; ++n) {
        for (std::size_t output = 0; output < outputs; ++output) {
          long double sum = 0.5L;
          for (std::size_t lane = 0; lane < width; ++lane) {
            const auto here = y[(n * outputs + output) * width + lane];
            sum += gain[lane] == T(0) ? 0.0L : static_cast<long double>(gain[lane]) * here;
          }
          off += std::fabs(channels[output][n] - static_cast<double>(sum)) <= most ? 0 : 1;
        }
      }
      CHECK(off == 0);
    });
  });
}

TEMPLATE_TEST_CASE("no lane is mixed if an audible voice is out of bounds", "[mixer]", double,
                   float) {
  using T = TestType;
  constexpr std::size_t least = 16 / sizeof(T);
  Random random(19);
  each_mixer<T>([&](const Mixer<T>& mixer) {
    each_shape<T>([&](std::size_t frames, std::size_t outputs, std::size_t width) {
      // Unused lanes may hold any values.
      const std::size_t used = width > least ? width - least : width;
      std::vector<T> y = random_rows<T>(random, frames * outputs * width);
      for (std::size_t i = 0; i < y.size(); ++i) {
        y[i] = i % width < used ? y[i] : static_cast<T>(no_number);
      }
      std::vector<T> gain(width, T(0.5));
      std::vector<T> peak(width);
      const auto played = [&](auto&& play) {
        std::vector<std::vector<double>> channels(outputs, std::vector<double>(frames, 0.25));
        std::vector<double*> pointers;
        for (std::vector<double>& channel : channels) {
          pointers.push_back(channel.data());
        }
        play(Heard<T>{y.data(), frames, outputs, width, used}, pointers.data());
        return channels;
      };
      const auto added = played([&](const Heard<T>& heard, double* const* channels) {
        mixer.add_voices(heard, gain.data(), channels);
      });
      CHECK(played([&](const Heard<T>& heard, double* const* channels) {
              CHECK(mixer.mix(heard, 2.0, gain.data(), channels, peak.data()));
            }) == added);
      y[(frames * outputs - 1) * width + used - 1] = T(3);
      const std::vector<std::vector<double>> untouched(outputs, std::vector<double>(frames, 0.25));
      CHECK(played([&](const Heard<T>& heard, double* const* channels) {
              CHECK_FALSE(mixer.mix(heard, 2.0, gain.data(), channels, peak.data()));
            }) == untouched);
      CHECK(peak[used - 1] == static_cast<T>(infinity));
    });
  });
}

}  // namespace ressort::mixer_test
