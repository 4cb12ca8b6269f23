#include "tests/bench/players.h"

#include <cmath>
#include <vector>

#include "core/analysis/linear.h"
#include "core/compile/accuracy/pitches.h"
#include "tests/support/networks/reference_network.h"

namespace ressort::bench {
namespace {

// ramp length of a parameter, as in the engine at 44,100 Hz
constexpr std::size_t ramp_frames = 882;
static_assert(block_frames <= max_block_frames && ramp_frames > block_frames);

// Returns the stiffness factor of one of several voices.
double pitch(const BenchScene& scene, std::size_t voice) {
  return 1.0 + 0.5 * static_cast<double>(voice) / static_cast<double>(scene.voices);
}

std::size_t index_of(const Network& network, const std::string& parameter) {
  std::size_t i = 0;
  while (network.parameters[i].name != parameter) {
    ++i;
  }
  return i;
}

// --- kernels ------------------------------------------------------------------------------------

template <class T>
class KernelPlayer : public Player {
 public:
  KernelPlayer(const BenchScene& scene, const Program& program, Isa isa)
      : program_(program), inputs_(program.inputs.size()) {
    do {
      kernels_.push_back(make_kernel<T>(program_, scene.voices, isa));
    } while (kernels_.size() * kernels_[0]->width() < scene.voices);
    width_ = kernels_[0]->width();
    for (std::size_t voice = 0; voice < kernels_.size() * width_; ++voice) {
      for (std::uint32_t c = 0; c < program_.coefficients.size(); ++c) {
        kernels_[voice / width_]->coefficients.set(
            voice % width_, c, value_of(c, program_.parameters, pitch(scene, voice)), false);
      }
    }
    drive(scene);
    outputs_.resize(block_frames * program_.outputs.size() * width_);
  }

  // Ramps all coefficients of a moving parameter all the time; they never reach their targets.
  void move(std::vector<std::uint32_t> parameters, const BenchScene& scene) {
    for (const std::uint32_t parameter : parameters) {
      const auto& depending = program_.depending[parameter];
      moving_.insert(moving_.end(), depending.begin(), depending.end());
    }
    std::vector<double> values = program_.parameters;
    for (std::size_t block = 0; block < cycle_blocks; ++block) {
      for (std::size_t i = 0; i < parameters.size(); ++i) {
        values[parameters[i]] = scene.turns[i].at(block * block_frames);
      }
      for (const std::uint32_t c : moving_) {
        moved_.push_back(value_of(c, values, 1.0));
      }
    }
  }

  void play(std::size_t block) override {
    const std::size_t first = block * block_frames * inputs_ * width_;
    for (const auto& kernel : kernels_) {
      for (std::size_t i = 0; i < moving_.size(); ++i) {
        for (std::size_t lane = 0; lane < width_; ++lane) {
          kernel->coefficients.set(lane, moving_[i], moved_[block * moving_.size() + i], true);
        }
      }
      if (!moving_.empty()) {
        kernel->coefficients.ramp(ramp_frames);
      }
      kernel->step({.frames = block_frames,
                    .value = value_.data() + first,
                    .velocity = velocity_.data() + first,
                    .audio = nullptr,
                    .outputs = outputs_.data()});
    }
  }

 private:
  double value_of(std::uint32_t c, const std::vector<double>& parameters, double factor) const {
    return coefficient_value(program_, program_.coefficients[c], parameters, factor);
  }

  void drive(const BenchScene& scene) {
    for (std::size_t n = 0; n < cycle_frames; ++n) {
      for (const InputSlot& input : program_.inputs) {
        const double here = scene.hand(input.input, n);
        const double before = scene.hand(input.input, (n + cycle_frames - 1) % cycle_frames);
        value_.insert(value_.end(), width_, static_cast<T>(here));
        velocity_.insert(velocity_.end(), width_, static_cast<T>(here - before));
      }
    }
  }

  const Program& program_;
  std::size_t inputs_;
  std::vector<std::unique_ptr<Kernel<T>>> kernels_;
  std::size_t width_ = 1;
  Aligned<T> value_;  // [frame of the cycle][input][lane]
  Aligned<T> velocity_;
  Aligned<T> outputs_;
  std::vector<std::uint32_t> moving_;  // coefficients
  std::vector<double> moved_;          // [block][of moving_]
};

// --- the engine ---------------------------------------------------------------------------------

class EnginePlayer : public Player {
 public:
  EnginePlayer(const BenchScene& scene, const Network& network, const Machine& machine,
               Precision precision, Isa isa)
      : engine_(machine, playing(scene, network, machine), precision, isa) {
    for (std::size_t input = 0; input < machine.inputs.size(); ++input) {
      for (std::size_t n = 0; n < cycle_frames; ++n) {
        inputs_.push_back(scene.hand(input, n) - machine.inputs[input].position);
      }
    }
    outputs_.resize(static_cast<std::size_t>(engine_.output_count()) * block_frames);
    for (std::size_t c = 0; c * block_frames < outputs_.size(); ++c) {
      output_pointers_.push_back(outputs_.data() + c * block_frames);
    }
    input_pointers_.resize(machine.inputs.size());
    for (std::size_t block = 0; block < cycle_blocks; ++block) {
      for (const Turn& turn : scene.turns) {
        events_.push_back({.kind = EventKind::parameter,
                           .index = static_cast<std::uint16_t>(index_of(network, turn.parameter)),
                           .value = turn.at(block * block_frames)});
      }
    }
    hold_keys(scene.voices);
  }

  void play(std::size_t block) override {
    const std::size_t turns = events_.size() / cycle_blocks;
    for (std::size_t i = 0; i < input_pointers_.size(); ++i) {
      input_pointers_[i] = inputs_.data() + i * cycle_frames + block * block_frames;
    }
    engine_.process({events_.data() + block * turns, turns}, input_pointers_, output_pointers_,
                    block_frames);
  }

 private:
  static Playing playing(const BenchScene& scene, const Network& network, const Machine& machine) {
    Playing playing{.voices = static_cast<int>(scene.voices)};
    for (std::uint16_t i = 0; i < machine.inputs.size(); ++i) {
      playing.controls.push_back({.source = Source::audio, .number = i, .target = i});
    }
    if (const auto shapes = scene.voices > 1 ? lowest_shapes(network, machine.parameters)
                                             : std::optional<LowestShapes>()) {
      playing.tuning = Tuning::keyboard;
      playing.pitches =
          make_pitches(*shapes, stepping_of_lowest(machine, *shapes, machine.parameters),
                       machine.rate_hz, machine.rate_ratio);
      playing.highest_factor = 4.0;
    }
    return playing;
  }

  // A held voice never sleeps. The engine's initial voice falls asleep first if it is at rest, so
  // that only the held keys are stepped.
  void hold_keys(std::size_t voices) {
    for (std::size_t block = 0; block < 1000 && engine_.meters().stepped > 0; ++block) {
      engine_.process({}, {}, output_pointers_, block_frames);
    }
    std::vector<Event> keys;
    for (std::size_t voice = 0; voice < voices; ++voice) {
      keys.push_back({.kind = EventKind::note_on,
                      .channel = static_cast<std::uint8_t>(voice / 64),
                      .index = static_cast<std::uint16_t>(24 + voice % 64),
                      .value = 0.8});
    }
    engine_.process(keys, {}, output_pointers_, block_frames);
  }

  Engine engine_;
  std::vector<double> inputs_;  // [input][frame of the cycle]
  std::vector<double> outputs_;
  std::vector<const double*> input_pointers_;
  std::vector<double*> output_pointers_;
  std::vector<Event> events_;  // [block][turn]
};

// --- the reference ------------------------------------------------------------------------------

class ReferencePlayer : public Player {
 public:
  ReferencePlayer(const BenchScene& scene, const Network& network)
      : network_(network),
        turns_(scene.turns),
        parameters_(parameter_values(network)),
        simulation_(reference::make_simulation(network, parameters_)) {
    for (std::size_t n = 0; n < cycle_frames; ++n) {
      for (std::size_t input = 0; input < network.inputs.size(); ++input) {
        inputs_.push_back(scene.hand(input, n));
      }
    }
    for (const Turn& turn : turns_) {
      turned_.push_back(index_of(network, turn.parameter));
    }
  }

  void play(std::size_t block) override {
    const std::size_t count = network_.inputs.size();
    for (std::size_t n = block * block_frames; n < (block + 1) * block_frames; ++n) {
      for (std::size_t i = 0; i < turns_.size(); ++i) {
        parameters_[turned_[i]] = turns_[i].at(n);
      }
      if (!turns_.empty()) {
        simulation_.set_parameters(network_, parameters_);
      }
      simulation_.simulator.step({inputs_.data() + n * count, count});
    }
  }

 private:
  const Network& network_;
  std::vector<Turn> turns_;
  std::vector<std::size_t> turned_;
  std::vector<double> parameters_;
  reference::Simulation simulation_;
  std::vector<double> inputs_;  // [frame][input]
};

// --- FAUST --------------------------------------------------------------------------------------

template <class T>
class FaustPlayer : public Player {
 public:
  FaustPlayer(const BenchScene& scene, const Network& network, const FaustLibrary& library)
      : library_(library) {
    for (std::size_t voice = 0; voice < scene.voices; ++voice) {
      instances_.push_back(library.make(44100));
      if (!scene.tuned_by.empty()) {
        const double value = network.parameters[index_of(network, scene.tuned_by)].value;
        library.set(instances_.back(), scene.tuned_by.c_str(), value * pitch(scene, voice));
      }
    }
    const std::size_t hands = network.inputs.size();
    for (std::size_t i = 0; i < hands + scene.turns.size(); ++i) {
      for (std::size_t n = 0; n < cycle_frames; ++n) {
        inputs_.push_back(
            static_cast<T>(i < hands ? scene.hand(i, n) : scene.turns[i - hands].at(n)));
      }
    }
    input_pointers_.resize(inputs_.size() / cycle_frames);
    const auto outputs = static_cast<std::size_t>(library.outputs(instances_[0]));
    outputs_.resize(outputs * block_frames);
    for (std::size_t c = 0; c < outputs; ++c) {
      output_pointers_.push_back(outputs_.data() + c * block_frames);
    }
  }
  ~FaustPlayer() override {
    for (void* const instance : instances_) {
      library_.destroy(instance);
    }
  }

  void play(std::size_t block) override {
    for (std::size_t i = 0; i < input_pointers_.size(); ++i) {
      input_pointers_[i] = inputs_.data() + i * cycle_frames + block * block_frames;
    }
    for (void* const instance : instances_) {
      library_.compute(instance, static_cast<int>(block_frames), input_pointers_.data(),
                       output_pointers_.data());
    }
  }

 private:
  const FaustLibrary& library_;
  std::vector<void*> instances_;
  std::vector<T> inputs_;  // [input][frame of the cycle]
  std::vector<T> outputs_;
  std::vector<T*> input_pointers_;
  std::vector<T*> output_pointers_;
};

}  // namespace

template <class T>
std::unique_ptr<Player> play_kernels(const BenchScene& scene, const Network& network,
                                     const Program& program, Isa isa) {
  auto player = std::make_unique<KernelPlayer<T>>(scene, program, isa);
  std::vector<std::uint32_t> parameters;
  for (const Turn& turn : scene.turns) {
    parameters.push_back(static_cast<std::uint32_t>(index_of(network, turn.parameter)));
  }
  player->move(parameters, scene);
  return player;
}
template std::unique_ptr<Player> play_kernels<float>(const BenchScene&, const Network&,
                                                     const Program&, Isa);
template std::unique_ptr<Player> play_kernels<double>(const BenchScene&, const Network&,
                                                      const Program&, Isa);

std::unique_ptr<Player> play_engine(const BenchScene& scene, const Network& network,
                                    const Machine& machine, Precision precision, Isa isa) {
  return std::make_unique<EnginePlayer>(scene, network, machine, precision, isa);
}

std::unique_ptr<Player> play_reference(const BenchScene& scene, const Network& network) {
  return std::make_unique<ReferencePlayer>(scene, network);
}

std::unique_ptr<Player> play_faust(const BenchScene& scene, const Network& network,
                                   const FaustLibrary& library) {
  if (library.is_double) {
    return std::make_unique<FaustPlayer<double>>(scene, network, library);
  }
  return std::make_unique<FaustPlayer<float>>(scene, network, library);
}

}  // namespace ressort::bench
