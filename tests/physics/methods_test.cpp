// Engines with every kernel, played and swept: the same sound as with the direct kernel, and no
// heap calls.
#include <set>

#include "app/realtime/process.h"
#include "tests/support/agreement.h"
#include "tests/support/player.h"

namespace ressort::methods_test {
namespace {

using namespace support;

constexpr std::size_t second = 44100;

// An instrument that rings for a second. It is not chaotic: nonlinear links are soft compared with
// the springs, and their force is continuous.
struct Subject {
  std::string name;
  std::string text;
  std::set<Method> methods;  // Kernels that support some of it, besides the direct one.
  bool is_linear = true;
};

std::vector<Subject> subjects() {
  return {
      {"triangle",
       scenes::poly_triangle() + "@in2 posInput 0.\n@h springDamper @in2 @m_m0 m_K 0.002\n",
       {Method::batch}},
      {"body",
       scenes::string("s", 12, "0.1", "0.002") +
           "@in1 frcInput @s_m3\n@in2 posInput 0.\n"
           "@touch nlContact @s_m8 @in2 0.002 0.05 0.01 0. 0.01\n"
           "@b nlSpring3 @s_m2 @s_m9 0.01 0.05 0.001\n" +
           scenes::output(1, "s_m5") + scenes::output(2, "s_m10"),
       {Method::batch, Method::chains, Method::modal},
       false},
      {"string",
       scenes::string("s", 60, "0.2", "0.005") +
           "@in1 frcInput @s_m7\n@in2 posInput 0.\n"
           "@h springDamper @s_m8 @in2 s_K s_Z\n" +
           scenes::output(1, "s_m40") + scenes::output(2, "s_m55"),
       {Method::chains, Method::modal, Method::grid}},
      {"resonator",
       scenes::resonator() + "@in2 frcInput @str_m8\n",
       {Method::chains, Method::modal, Method::grid}},
      {"mesh",
       scenes::square_mesh("m", 7, 9, "0.1", "0.003") +
           "@in1 frcInput @m_m2_3\n@in2 posInput 0.\n@h springDamper @in2 @m_m5_5 m_K m_Z\n" +
           scenes::output(1, "m_m4_7") + scenes::output(2, "m_m3_1"),
       {Method::modal, Method::grid}},
      {"macros",
       "@k param 0.2\n@l param 0.03\n@u param 0.3\n@s stiffString 40 1. k l 0.004 0.0005 0. 0.\n"
       "@t string 24 1.5 k 0.003 0. 0.\n@in1 frcInput [@s u]\n@in2 posInput 0.\n"
       "@h springDamper @in2 [@t 0.5*u] l 0.002\n@j springDamper [@s 0.8] [@t 1-u] l 0.001\n"
       "@out1 posOutput [@s 0.77]\n@out2 posOutput [@t u]\n",
       {Method::chains}},
      {"a mesh's places",
       "@k param 0.1\n@u param 0.3\n@s cornerMesh 6 9 1. k 0.004 0.0005 0. 0.\n"
       "@in1 frcInput [@s u 0.6]\n@in2 posInput 0.\n"
       "@h springDamper @in2 [@s 0.5 u] 0.2*k 0.002\n@out1 posOutput [@s 0.77 2*u]\n",
       {Method::grid}},
      {"heard at audio rate",
       "@a audioParam @in3\n" + scenes::string("s", 30, "0.15", "0.004") +
           "@g ground 0.\n@v springDamper @g @s_m11 a s_Z\n@in1 frcInput @s_m4\n"
           "@in2 posInput 0.\n@h springDamper @in2 @s_m21 [0.2 * s_K + 0.3 * a] 0.001\n" +
           scenes::output(1, "s_m17"),
       {Method::chains, Method::grid}},
      {"parts",
       scenes::string("s", 30, "0.2", "0.005") + scenes::triangle("0.1", "0.002") +
           scenes::square_mesh("q", 5, 6, "0.08", "0.004") +
           "@in1 frcInput @s_m7\n@in2 posInput 0.\n@h springDamper @in2 @m_m1 0.02 0.001\n"
           "@in3 frcInput @q_m2_2\n" +
           scenes::output(1, "s_m12") + scenes::output(2, "m_m2") + scenes::output(3, "q_m4_1"),
       {Method::chains, Method::batch, Method::modal, Method::grid}}};
}

// Notes strike input 1, audio channels drive every input, and every parameter may be swept.
Preset preset_of(const Network& network, bool bare, int voices) {
  Preset preset;
  preset.voices = voices;
  preset.keyboard = !bare;
  preset.budget.passive = Passivity::never;  // Not every kernel supports passive links.
  preset.controls.push_back(
      {.target = "in1", .gesture = Gesture::impulse, .low = 0.001, .high = 0.01});
  for (const Input& input : network.inputs) {
    preset.controls.push_back({.source = ControlSource::audio,
                               .number = input.number,
                               .target = "in" + std::to_string(input.number),
                               .low = 0.0,
                               .high = input.is_force ? 0.002 : 0.02});
  }
  for (const Parameter& parameter : network.parameters) {
    if (parameter.audio_input == 0) {
      preset.parameters.push_back({.name = parameter.name,
                                   .value = parameter.value,
                                   .minimum = 0.8 * parameter.value,
                                   .maximum = 1.2 * parameter.value});
    }
  }
  return preset;
}

// A second with all kinds of events at once: more notes than voices, continuous bends, parameters
// that change before their ramps end, jumping position inputs, long pushes.
std::vector<Event> gestures(const Network& network, std::uint64_t seed) {
  Random random(seed);
  std::vector<Event> events;
  for (std::uint32_t frame = 0; frame < second - 1000;
       frame += 20 + static_cast<std::uint32_t>(random.below(200))) {
    Event event{.frame = frame, .kind = EventKind::bend, .value = random.uniform(-1.0, 1.0)};
    const std::size_t kind = random.below(12);
    if (kind < 6 && !network.parameters.empty()) {
      const std::size_t i = random.below(network.parameters.size());
      event = parameter(frame, static_cast<int>(i),
                        network.parameters[i].value * random.uniform(0.85, 1.15));
    } else if (kind == 6) {
      event = note_on(frame, 50 + static_cast<int>(random.below(12)), random.uniform(0.1, 1.0));
    } else if (kind == 7) {
      event = note_off(frame, 50 + static_cast<int>(random.below(12)));
    } else if (kind < 10) {
      const Input& input = network.inputs[random.below(network.inputs.size())];
      event.kind = EventKind::gesture;
      event.gesture = input.is_force ? Gesture::force : Gesture::position;
      event.index = static_cast<std::uint16_t>(input.number);
      event.value = random.uniform(-1.0, 1.0) * (input.is_force ? 0.002 : 0.02);
      event.value2 = random.uniform(0.0, 0.01);
    }
    events.push_back(event);
  }
  return events;
}

// Each channel drives one input; the third may be a stiffness and stays positive.
std::vector<std::vector<double>> audio_of(std::uint64_t seed) {
  std::vector<std::vector<double>> audio;
  for (const double low : {0.0, 0.0, 0.03}) {
    const Motion motion(seed + audio.size(), 20.0, 8000.0);
    audio.emplace_back();
    for (std::size_t n = 0; n < second; ++n) {
      audio.back().push_back(low == 0.0 ? motion(n) : low + 0.02 * motion(n));
    }
  }
  return audio;
}

struct Take {
  Plan plan;
  std::vector<std::vector<double>> out;  // [channel]
};

Take play(const std::string& text, const Preset& preset, const CompileOptions& options,
          std::uint64_t seed) {
  const Network network = network_of(text);
  Player player(text, preset, options);
  const auto audio = audio_of(seed);
  const double* const inputs[] = {audio[0].data(), audio[1].data(), audio[2].data()};
  player.run(second, gestures(network, seed), {256, 64, 1, 500, 37}, inputs);
  CHECK(player.heap_calls == 0);
  CHECK(player.engine().meters().resets == 0);
  CHECK((options.bare || player.engine().meters().stolen > 0));
  return {std::move(player.compiled.plan), std::move(player.out)};
}

std::vector<Comparison> compare(const Take& expected, const Take& found) {
  std::vector<Comparison> comparisons(expected.out.size());
  for (std::size_t channel = 0; channel < expected.out.size(); ++channel) {
    for (std::size_t n = 0; n < second; ++n) {
      comparisons[channel].add(expected.out[channel][n], found.out[channel][n]);
    }
  }
  return comparisons;
}

bool has_part(const Plan& plan, Method method) {
  return std::any_of(plan.parts.begin(), plan.parts.end(),
                     [&](const Part& part) { return part.method == method; });
}

void check_methods(const Subject& subject, bool bare, int voices) {
  const Preset preset = preset_of(network_of(subject.text), bare, voices);
  CompileOptions options{.bare = bare, .method = Method::direct};
  const std::uint64_t seed = static_cast<std::uint64_t>(voices) + subject.name.size();
  const Take direct = play(subject.text, preset, options, seed);
  options.precision = Precision::float32;
  const auto direct_in_float = compare(direct, play(subject.text, preset, options, seed));
  for (const Comparison& output : direct_in_float) {
    CHECK(output.peak > 1e-4);
  }
  for (const Method method : subject.methods) {
    INFO("by " << method_name(method));
    options.method = method;
    options.precision = Precision::float64;
    const Take take = play(subject.text, preset, options, seed);
    CHECK(has_part(take.plan, method));
    options.precision = Precision::float32;
    const auto in_float = compare(direct, play(subject.text, preset, options, seed));
    check_double(method, compare(direct, take), in_float, direct_in_float);
    check_float(method, in_float, direct_in_float, subject.is_linear);
  }
}

// A model and the kernel that plays it until the next one replaces it.
struct Turn {
  const Subject* subject = nullptr;
  Method method = Method::direct;
};

// Returns every model with each of its kernels, changing the model every time.
std::vector<Turn> turns_of(const std::vector<Subject>& all) {
  std::vector<Turn> turns;
  for (std::size_t round = 0; round < published_methods().size(); ++round) {
    for (const Subject& subject : all) {
      if (round < subject.methods.size()) {
        turns.push_back({&subject, *std::next(subject.methods.begin(), std::ptrdiff_t(round))});
      }
    }
  }
  return turns;
}

// The output of a process while models follow each other: [channel][frame].
struct Show {
  Process process{44100.0, false};
  std::vector<std::vector<double>> out = std::vector<std::vector<double>>(3);
  std::vector<std::vector<double>> audio;
  std::uint32_t serial = 0;
  std::size_t heap_calls = 0;

  void perform(const Turn& turn, bool directly, std::size_t frames) {
    const Network network = network_of(turn.subject->text);
    auto made = compile_network(network, preset_of(network, false, 2),
                                {.method = directly ? Method::direct : turn.method});
    REQUIRE(made);
    const PlayingEngine* const refused =
        process.slot.offer(new PlayingEngine{std::move(made->engine), ++serial});
    REQUIRE(refused == nullptr);
    for (Event event : gestures(network, serial)) {
      if (event.frame < frames) {
        event.model = serial;
        REQUIRE(process.schedule(static_cast<std::int64_t>(out[0].size() + event.frame), event));
      }
    }
    audio = audio_of(serial);
    for (std::size_t at = 0; at < frames; at += 300) {
      run(at, std::min<std::size_t>(300, frames - at));
    }
  }

  void run(std::size_t at, std::size_t frames) {
    const double* const inputs[] = {&audio[0][at], &audio[1][at], &audio[2][at]};
    std::vector<double*> outputs;
    for (std::vector<double>& channel : out) {
      channel.resize(channel.size() + frames);
      outputs.push_back(channel.data() + channel.size() - frames);
    }
    {
      const HeapWatch watch;
      process.block(inputs, outputs, frames, {}, 0);
      heap_calls += watch.calls();
    }
    const std::unique_ptr<PlayingEngine> old(process.slot.collect());
  }
};

}  // namespace

TEST_CASE("models with different kernels are swapped", "[methods]") {
  const std::vector<Subject> all = subjects();
  Show plain;
  Show mixed;
  // Some models start before the previous one has faded.
  for (std::size_t i = 0; const Turn& turn : turns_of(all)) {
    const std::size_t frames = i++ % 3 == 0 ? 1000 : 6000;
    plain.perform(turn, true, frames);
    mixed.perform(turn, false, frames);
  }
  CHECK(mixed.process.meters().swaps == plain.process.meters().swaps);
  CHECK(mixed.process.meters().swaps + 1 >= 2 * turns_of(all).size() / 3);
  CHECK(mixed.process.meters().resets == 0);
  CHECK(mixed.heap_calls == 0);
  std::vector<Comparison> outputs(mixed.out.size());
  for (std::size_t channel = 0; channel < outputs.size(); ++channel) {
    for (std::size_t n = 0; n < mixed.out[channel].size(); ++n) {
      outputs[channel].add(plain.out[channel][n], mixed.out[channel][n]);
    }
    CHECK(outputs[channel].peak > 1e-3);
  }
  check_double(Method::modal, outputs, outputs, outputs);
}

TEST_CASE("every kernel plays an instrument like the direct one", "[methods]") {
  for (const Subject& subject : subjects()) {
    INFO(subject.name << "\n" << subject.text);
    check_methods(subject, false, 1);
    check_methods(subject, false, 3);
    check_methods(subject, true, 1);
  }
}

}  // namespace ressort::methods_test
