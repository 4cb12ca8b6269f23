// The batch kernel: networks that fit into registers, and voices that move as they do alone.
#include <limits>

#include "core/kernels/batch/batch_form.h"
#include "core/laws/laws.h"
#include "tests/support/passive.h"

namespace ressort::batch_test {
namespace {

using support::Comparison;
using support::isas;
using support::program_of;
using support::Random;
using support::show;

constexpr std::uint32_t none = BatchSpring::none;

Program formed(const std::string& text) {
  Program program = program_of(text);
  auto form = batch_form(program);
  REQUIRE(form.has_value());
  program.form = std::move(*form);
  return program;
}

// Enough kernels for the voices, each voice at its own pitch and with its own inputs.
template <class T>
class ManyVoices {
 public:
  ManyVoices(const Program& program, std::size_t voices, Isa isa)
      : program_(program), voices_(voices) {
    while (kernels_.size() * width_ < voices) {
      kernels_.push_back(make_kernel<T>(program_, voices, isa));
      width_ = kernels_[0]->width();
    }
    value_.resize(max_block_frames * program_.inputs.size() * width_);
    velocity_.resize(value_.size());
    outputs_.resize(max_block_frames * program_.outputs.size() * width_);
    for (std::size_t voice = 0; voice < kernels_.size() * width_; ++voice) {
      turn(voice, program_.parameters, false);
    }
  }

  Kernel<T>& of(std::size_t voice) { return *kernels_[voice / width_]; }
  std::size_t lane(std::size_t voice) const { return voice % width_; }

  // From now on, all voices use the coefficients of the first voice.
  void play_as_one() { is_common_ = true; }

  // From now on, the lanes of later voices are unused.
  void play_only(std::size_t voices) { playing_ = voices; }

  void turn(std::size_t voice, const std::vector<double>& parameters, bool ramped) {
    const double pitch = 1.0 / (1.0 + 0.07 * static_cast<double>(voice));
    auto& coefficients = of(voice).coefficients;
    for (std::uint32_t c = 0; c < program_.coefficients.size(); ++c) {
      coefficients.set(lane(voice), c,
                       coefficient_value(program_, program_.coefficients[c], parameters, pitch),
                       ramped);
    }
    if (ramped) {
      coefficients.ramp(128);
    }
  }

  // Plays hands(frame, voice, input). Returns [voice][frame][output], one voice after the other.
  template <class Hands>
  std::vector<double> play(std::size_t at, std::size_t frames, Hands&& hands) {
    std::vector<double> heard;
    for (std::size_t first = 0; first < voices_; first += width_) {
      each_value(frames, program_.inputs.size(), [&](std::size_t n, std::size_t i, std::size_t k) {
        const double here = hands(at + n, first + k, i);
        const double before =
            at + n == 0 ? hands(0, first + k, i) : hands(at + n - 1, first + k, i);
        value_[place(n, i, k, program_.inputs.size())] = static_cast<T>(here);
        velocity_[place(n, i, k, program_.inputs.size())] = static_cast<T>(here - before);
      });
      of(first).step({.frames = frames,
                      .value = value_.data(),
                      .velocity = velocity_.data(),
                      .is_common = is_common_,
                      .audio = nullptr,
                      .outputs = outputs_.data(),
                      .lanes = playing_ - std::min(playing_, first)});
      const std::size_t count = program_.outputs.size();
      for (std::size_t k = 0; k < std::min(width_, voices_ - first); ++k) {
        for (std::size_t n = 0; n < frames * count; ++n) {
          heard.push_back(static_cast<double>(outputs_[n * width_ + k]));
        }
      }
    }
    return heard;
  }

 private:
  std::size_t place(std::size_t n, std::size_t i, std::size_t k, std::size_t count) const {
    return is_common_ ? n * count + i : (n * count + i) * width_ + k;
  }
  template <class Use>
  void each_value(std::size_t frames, std::size_t count, Use&& use) const {
    for (std::size_t n = 0; n < frames; ++n) {
      for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t k = 0; k < width_; ++k) {
          use(n, i, k);
        }
      }
    }
  }

  Program program_;
  std::size_t voices_;
  std::size_t playing_ = std::numeric_limits<std::size_t>::max();
  bool is_common_ = false;
  std::size_t width_ = 1;
  std::vector<std::unique_ptr<Kernel<T>>> kernels_;
  Aligned<T> value_;
  Aligned<T> velocity_;
  Aligned<T> outputs_;
};

struct VoiceTestOptions {
  std::size_t voices = 1;
  std::size_t frames = 2000;
  double reach = 0.02;
  bool turns = false;  // changes the parameters, in one voice at a time
  Isa isa = best_isa();
};

// Returns one Comparison for each voice, against the direct kernel in double.
template <class T>
std::vector<Comparison> compare_voices(const Program& program, const VoiceTestOptions& options) {
  Program plain = program;
  plain.form = Form();
  ManyVoices<double> reference(plain, options.voices, Isa::base);
  ManyVoices<T> found(program, options.voices, options.isa);
  const auto hands = [&](std::size_t n, std::size_t voice, std::size_t input) {
    const InputSlot& slot = program.inputs[input];
    const double t = static_cast<double>(n) / 44100.0 * (slot.is_force ? 3000.0 : 90.0);
    const double wave = std::sin(t * (1.0 + 0.1 * static_cast<double>(voice % 17)));
    return (slot.is_force ? 0.0 : program.position[slot.node]) + options.reach * wave;
  };
  Random random(options.voices);
  std::vector<Comparison> voices(options.voices);
  std::size_t blocks = 0;
  for (std::size_t at = 0; at < options.frames; ++blocks) {
    if (options.turns && blocks % 5 == 4) {
      auto parameters = program.parameters;
      for (double& parameter : parameters) {
        parameter *= random.uniform(0.9, 1.1);
      }
      const std::size_t voice = random.below(options.voices);
      reference.turn(voice, parameters, true);
      found.turn(voice, parameters, true);
    }
    const std::size_t longest = random.below(3) == 0 ? 1 + random.below(64) : 64;
    const std::size_t frames = std::min(longest, options.frames - at);
    const auto expected = reference.play(at, frames, hands);
    const auto heard = found.play(at, frames, hands);
    for (std::size_t i = 0; i < expected.size(); ++i) {
      voices[i / (frames * program.outputs.size())].add(expected[i], heard[i]);
    }
    at += frames;
  }
  return voices;
}

template <class T>
void check(const Program& program, VoiceTestOptions options, double most_relative) {
  for (const Isa isa : isas()) {
    for (const std::size_t voices : {1u, 3u, 5u, 16u, 64u}) {
      options.voices = voices;
      options.isa = isa;
      const auto heard = compare_voices<T>(program, options);
      for (std::size_t voice = 0; voice < voices; ++voice) {
        INFO(isa_name(isa) << ", " << voice << " of " << voices << " voices: residual "
                           << show(heard[voice].relative()));
        CHECK(heard[voice].peak > 0.0);
        CHECK(heard[voice].relative() < most_relative);
      }
    }
  }
}

std::string example(const std::string& name) {
  for (const auto& each : scenes::nine_instruments()) {
    if (each.name == name) {
      return each.text;
    }
  }
  return "";
}

// Returns masses of every kind. Each pair of them is linked by a random law or not at all.
std::string random_body(std::uint64_t seed, std::size_t masses) {
  Random random(seed);
  std::string text = "@k param 0.02\n@z param 0.001\n@s0 ground 0.\n@s1 ground 0.01\n";
  for (std::size_t i = 0; i < masses; ++i) {
    const std::string name = "@m" + std::to_string(i);
    text += name + (random.below(3) == 0 ? " osc 1.5 0.01 0.001 0. 0.\n" : " mass 1. 0. 0.\n") +
            name + "g springDamper @s" + std::to_string(random.below(2)) + " " + name + " k z\n";
  }
  const char* const laws[] = {"springDamper", "springDamper", "nlSpring3",
                              "nlPluck",      "contact",      "nlBow"};
  const char* const numbers[] = {" k z",         " 0.03 z",           " k 0.1 z",
                                 " 0.001 0.5 z", " 0.01 0.001 0.001", " z 0.1"};
  for (std::size_t i = 0; i < 2 * masses; ++i) {
    const std::size_t a = random.below(masses);
    const std::size_t b = random.below(masses);
    const std::size_t law = random.below(std::size(laws));
    if (a != b) {
      text += "@r" + std::to_string(i) + " " + laws[law] + " @m" + std::to_string(a) + " @m" +
              std::to_string(b) + numbers[law] + "\n";
    }
  }
  return text + "@in1 frcInput @m0\n@in3 frcInput @m0\n@in2 posInput 0.\n@h springDamper @in2 @m" +
         std::to_string(masses - 1) + " k z\n@out1 posOutput @m0\n@out2 posOutput @m" +
         std::to_string(masses / 2) + "\n";
}

}  // namespace

TEST_CASE("the masses of a triangle stay in registers, and its pick is a link", "[batch]") {
  const Program program = formed(example("IPlayTheTriangle"));
  const auto& batch = program.form.get<Batch>();
  const auto is_held = [](const BatchSpring& spring) { return spring.stiffness != none; };
  CHECK(std::count_if(batch.pairs.begin(), batch.pairs.begin() + 3, is_held) == 3);
  CHECK(std::count_if(batch.pairs.begin() + 3, batch.pairs.end(), is_held) == 0);
  CHECK(std::count_if(batch.anchors.begin(), batch.anchors.end(), is_held) == 1);
  REQUIRE(batch.links.size() == 1);
  CHECK(program.link_runs[batch.links[0].run].law == Law::pluck);
}

TEST_CASE("parallel springs and networks of more masses do not stay in registers", "[batch]") {
  const std::string twice = scenes::triangle("0.1", "0.001") +
                            "@a springDamper @m_m0 @m_m1 0.01 0.\n@out1 posOutput @m_m0\n";
  const auto batch = batch_form(program_of(twice));
  REQUIRE(batch.has_value());
  CHECK(batch->links.size() == 1);
  const auto walked =
      batch_form(program_of(scenes::string("s", 5, "0.1", "0.001") + scenes::output(1, "s_m2")));
  REQUIRE(walked.has_value());
  CHECK(walked->links.empty());
  CHECK(walked->pairs[0].stiffness == none);
  CHECK_FALSE(batch_form(program_of(scenes::string("s", 17, "0.1", "0.001"))).has_value());
  CHECK_FALSE(batch_form(program_of(scenes::triangle("0.1", "0.001") + "@out1 frcOutput @m_m0\n"))
                  .has_value());
}

TEST_CASE("voices are distributed evenly over kernels, and no pack is empty", "[batch]") {
  for (const char* const name : {"PolyTriangle", "PhysicalLFO"}) {
    const Program program = formed(example(name));
    for (const Isa isa : isas()) {
      for (const std::size_t voices : {1u, 3u, 9u, 16u, 64u, 68u}) {
        const std::size_t width = make_kernel<double>(program, voices, isa)->width();
        const std::size_t kernels = (voices + width - 1) / width;
        CAPTURE(name, isa_name(isa), voices, width);
        CHECK(kernels * width < voices + kernels * vector_bytes(isa) / sizeof(double));
        CHECK(kernels <= 1 + voices / 12);
      }
    }
  }
}

TEST_CASE("each of many voices equals the voice alone", "[batch]") {
  check<double>(formed(example("PolyTriangle")), {}, 1e-12);
  check<float>(formed(example("PolyTriangle")), {}, 1e-5);
  check<double>(formed(example("IPlayTheTriangle")), {}, 1e-12);
  check<double>(formed(example("PhysicalLFO")), {}, 1e-12);
}

TEST_CASE("a parameter ramp in one voice does not affect the others", "[batch]") {
  check<double>(formed(example("PolyTriangle")), {.turns = true}, 1e-12);
  check<double>(formed(example("IPlayTheTriangle")), {.turns = true}, 1e-12);
}

TEST_CASE("bodies of every size with any laws match the direct kernel", "[batch]") {
  for (std::uint64_t seed = 1; seed <= 27; ++seed) {
    const std::string text = random_body(seed, 1 + seed % 9);
    INFO("seed " << seed << "\n" << text);
    const auto heard = compare_voices<double>(formed(text), {.voices = 5, .turns = true});
    for (const Comparison& voice : heard) {
      INFO("residual " << show(voice.relative()));
      CHECK(voice.relative() < 1e-12);
    }
  }
}

TEST_CASE("hard contacts are passive in every voice", "[batch]") {
  // Networks that fit into registers and networks that do not; links of every scheme, some on the
  // same mass; a moving position input.
  for (const int masses : {1, 2, 3, 4, 7, 16}) {
    std::string text = "@w ground -0.01\n@g ground 0.\n@in1 posInput 0.\n@k param 0.1\n";
    const auto at = [&](int i) { return " @m" + std::to_string(i % masses) + " "; };
    for (int i = 0; i < masses; ++i) {
      text += "@m" + std::to_string(i) + (i % 3 == 2 ? " osc 1.5 k 0.01" : " mass 1.") + " 0. 0.\n";
      text += "@s" + std::to_string(i) + " springDamper" + (i == 0 ? " @g " : at(i - 1)) + at(i) +
              "k 0.001\n";
    }
    text += "@in2 frcInput" + at(0) + "\n@out1 posOutput" + at(masses - 1) + "\n";
    text += "@c1 contact @w" + at(0) + "[50 * k] 0.05\n@c2 nlContact @w" + at(1) +
            "0.1 20. 3. 0.01 0.005\n@q nlSpring3 @g" + at(2) + "0.01 5. 0.\n@p nlPluck @in1" +
            at(3) + "0.4 0.01\n@b nlBow @in1" + at(4) + "0.3 0.01\n@d nlSpring @g" + at(5) +
            "0.01 2. 0.001\n";
    Program program = program_of(text, Passivity::always);
    auto form = batch_form(program);
    REQUIRE(form);
    program.form = std::move(*form);
    for (const Isa isa : isas()) {
      for (const std::size_t voices : {1u, 13u}) {
        CAPTURE(masses, isa_name(isa), voices);
        const VoiceTestOptions options{
            .voices = voices, .frames = 300, .reach = 0.03, .turns = true, .isa = isa};
        for (const Comparison& voice : compare_voices<double>(program, options)) {
          CAPTURE(show(voice.relative()));
          CHECK(voice.peak > 1e-3);
          CHECK(voice.relative() < 1e-11);
        }
      }
    }
  }
}

TEST_CASE("a passive pick that comes and goes acts on masses in registers", "[batch]") {
  // It touches for a tenth of the time. The other blocks do not leave the registers.
  Program program = program_of(example("IPlayTheTriangle"), Passivity::always);
  auto form = batch_form(program);
  REQUIRE((form && !is_plain(program)));
  program.form = std::move(*form);
  for (const Isa isa : isas()) {
    for (const std::size_t voices : {1u, 5u, 13u}) {
      CAPTURE(isa_name(isa), voices);
      for (const Comparison& voice : compare_voices<double>(
               program, {.voices = voices, .frames = 6000, .reach = 0.06, .isa = isa})) {
        CAPTURE(show(voice.relative()));
        CHECK(voice.peak > 1e-3);
        CHECK(voice.relative() < 1e-11);
      }
    }
  }
}

TEST_CASE("a reset of one lane does not affect the others", "[batch]") {
  const Program program = formed(example("PolyTriangle"));
  ManyVoices<double> choir(program, 16, best_isa());
  ManyVoices<double> other(program, 16, best_isa());
  const auto push = [](std::size_t n, std::size_t, std::size_t) { return n < 9 ? 0.1 : 0.0; };
  choir.play(0, 64, push);
  other.play(0, 64, push);
  CHECK_FALSE(choir.of(5).is_near_start(choir.lane(5), 1e-6));
  choir.of(5).reset(choir.lane(5));
  CHECK(choir.of(5).is_near_start(choir.lane(5), 1e-12));
  CHECK_FALSE(choir.of(4).is_near_start(choir.lane(4), 1e-6));
  const auto heard = choir.play(64, 64, push);
  const auto expected = other.play(64, 64, push);
  for (std::size_t i = 0; i < heard.size(); ++i) {
    CHECK(heard[i] == (i / 64 == 5 ? 0.0 : expected[i]));
  }
}

TEST_CASE("a common input row equals the same row in each voice", "[batch]") {
  std::vector<Program> programs;
  for (const char* const name : {"PolyTriangle", "IPlayTheTriangle", "PhysicalLFO"}) {
    programs.push_back(formed(example(name)));
  }
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    programs.push_back(formed(random_body(seed, 2 + seed % 5)));
  }
  for (std::size_t i = 0; i < programs.size(); ++i) {
    for (const Isa isa : isas()) {
      for (const std::size_t voices : {3u, 20u, 68u}) {
        ManyVoices<double> choir(programs[i], voices, isa);
        ManyVoices<double> one(programs[i], voices, isa);
        REQUIRE(one.of(0).takes_common_inputs());
        one.play_as_one();
        const auto hands = [](std::size_t n, std::size_t, std::size_t input) {
          return 0.01 * std::sin(0.02 * static_cast<double>((input + 1) * n));
        };
        std::size_t at = 0;
        for (const std::size_t frames : {64u, 64u, 5u, 64u}) {
          CAPTURE(i, isa_name(isa), voices, at);
          const auto expected = choir.play(at, frames, hands);
          CHECK(one.play(at, frames, hands) == expected);
          CHECK(std::any_of(expected.begin(), expected.end(), [](double y) { return y != 0.0; }));
          at += frames;
        }
      }
    }
  }
}

TEST_CASE("unused lanes do not change the other voices", "[batch]") {
  for (const char* const name : {"PolyTriangle", "IPlayTheTriangle", "PhysicalLFO"}) {
    const Program program = formed(example(name));
    for (const Isa isa : isas()) {
      ManyVoices<double> choir(program, 68, isa);
      ManyVoices<double> other(program, 68, isa);
      const auto push = [](std::size_t n, std::size_t k, std::size_t) {
        return n % 50 < k ? 0.01 : 0.0;
      };
      std::size_t at = 0;
      for (const std::size_t playing : {68u, 64u, 3u, 17u, 68u}) {
        CAPTURE(name, isa_name(isa), playing);
        choir.play_only(playing);
        for (std::size_t voice = playing; voice < 68; ++voice) {
          choir.of(voice).reset(choir.lane(voice));
          other.of(voice).reset(other.lane(voice));
        }
        const auto heard = choir.play(at, 64, push);
        const auto expected = other.play(at, 64, push);
        const auto played = static_cast<std::ptrdiff_t>(heard.size() / 68 * playing);
        CHECK(std::equal(heard.begin(), heard.begin() + played, expected.begin()));
        for (std::size_t voice = playing; voice < 68; ++voice) {
          choir.of(voice).reset(choir.lane(voice));
          other.of(voice).reset(other.lane(voice));
        }
        at += 64;
      }
    }
  }
}

}  // namespace ressort::batch_test
