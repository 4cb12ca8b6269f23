#include "app/commands/chart/scenes.h"

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>

#include "core/analysis/continuous.h"
#include "core/analysis/linear.h"
#include "core/laws/law.h"
#include "core/model/generate.h"
#include "core/model/language/mdl.h"
#include "core/model/topology.h"

namespace ressort::commands {
namespace {

constexpr double velocity = 0.8;      // velocity of the note
constexpr double blow = 0.01;         // per sample: x[-1] = x[0] - blow
constexpr double bow_start_s = 0.01;  // time constant of a bow that gets up to speed
constexpr double reach_s = 0.005;     // time constant of an input that moves to a position
constexpr double harder = 10.0;

Network parsed(const std::string& text) {
  return parse_network(text).network;
}

std::uint32_t mass_called(const Network& network, const std::string& name) {
  for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
    if (std::string(network.masses[i].name) == name) {
      return i;
    }
  }
  return 0;
}

// A string between two grounds. `in` and `out` count the masses from 0.
Network string_of(std::uint32_t masses, double k, double z, std::uint32_t in, std::uint32_t out) {
  Network network = *generate({.kind = ShapeKind::string,
                               .length = masses + 2,
                               .stiffness = k,
                               .damping = z,
                               .with_io = false});
  network.inputs = {
      {.number = 1, .is_force = true, .mass = mass_called(network, "s_m" + std::to_string(in))}};
  network.outputs = {{.number = 1, .mass = mass_called(network, "s_m" + std::to_string(out))}};
  return network;
}

Network triangle() {
  return parsed(
      "@m_K param 0.1\n@m_Z param 0.001\n@m_s0 ground 0.\n@m_m0 mass 1. 0. 0.\n"
      "@m_m1 mass 1. 0. 0.\n@m_m2 mass 1. 0. 0.\n@m_r0 springDamper @m_s0 @m_m0 0.05 0.01\n"
      "@m_r1 springDamper @m_m0 @m_m1 m_K m_Z\n@m_r2 springDamper @m_m1 @m_m2 m_K m_Z\n"
      "@m_r3 springDamper @m_m2 @m_m0 m_K m_Z\n@in1 frcInput @m_m1\n@out1 posOutput @m_m2\n");
}

Network ball() {
  return parsed(
      "@floor ground 0.\n@ball massG 1. 0.00001 0.01 0.01\n"
      "@touch contact @floor @ball 0.5 0. 0.\n@out1 posOutput @ball\n");
}

// A string plucked at 0.3 of its length, its 21st mass above a stiff stop.
Network string_on_stop() {
  constexpr std::uint32_t masses = 50;
  constexpr double height = 0.3;
  const double top = 0.3 * (masses + 1);
  Network network = string_of(masses, 0.1, 0.0005, 13, 37);
  for (std::uint32_t i = 0; i < masses; ++i) {
    const double at = i + 1.0;
    const double x = height * (at < top ? at / top : (masses + 1 - at) / (masses + 1 - top));
    Mass& mass = network.masses[mass_called(network, "s_m" + std::to_string(i))];
    mass.position = x;
    mass.third = x;
  }
  network.third = ThirdArgument::delayed_position;
  network.inputs.clear();
  Mass stop{.kind = MassKind::ground, .position = -0.02, .third = -0.02};
  network.masses.push_back(stop);
  Link touch{.law = law_named("contact"),
             .a = static_cast<std::uint32_t>(network.masses.size() - 1),
             .b = mass_called(network, "s_m20")};
  touch.arguments = {network.add(10.0), network.add(0.0), network.add(0.0), no_argument,
                     no_argument};
  network.links.push_back(touch);
  return canonical(std::move(network));
}

bool has_contacts(const Network& network) {
  return std::ranges::any_of(network.links,
                             [](const Link& link) { return facts_of(link.law).is_one_sided(); });
}

double value_of(const ControlSetting& control) {
  return control.exponential ? control.low * std::pow(control.high / control.low, velocity)
                             : control.low + velocity * (control.high - control.low);
}

// The motion by which a note plays an input that rests at `middle`.
InputMotion motion_of(const ControlSetting& control, double middle) {
  const double value = value_of(control);
  switch (control.gesture) {
    case Gesture::pluck:
      return [=, travel = control.travel, speed = std::fabs(value) * scene_rate_hz](double t) {
        return middle - travel + std::min(2.0 * travel, speed * t);
      };
    case Gesture::bow:
      return [=](double t) {
        return middle + value * scene_rate_hz * (t + bow_start_s * std::expm1(-t / bow_start_s));
      };
    default: {
      const double there = control.gesture == Gesture::hold ? control.high : value;
      return [=](double t) { return middle - (there - middle) * std::expm1(-t / reach_s); };
    }
  }
}

std::string word_of(Gesture gesture) {
  switch (gesture) {
    case Gesture::pluck:
      return "plucked";
    case Gesture::bow:
      return "bowed";
    default:
      return "moved";
  }
}

void strike(ChartScene& scene, std::uint32_t mass) {
  Mass& struck = scene.network.masses[mass];
  struck.third = scene.network.third == ThirdArgument::delayed_position
                     ? struck.position - blow
                     : struck.third + blow * scene_rate_hz;
  scene.about = "an impulse at one mass";
}

// Returns the mass that an input drives: its own, or the one that the first link ties to it.
std::uint32_t struck_by(const Network& network, const Input& input) {
  if (input.is_force) {
    return input.mass;
  }
  for (const Link& link : network.links) {
    for (const auto& [end, other] : {std::pair(link.a, link.b), std::pair(link.b, link.a)}) {
      if (end == input.mass && moves(network.masses[other])) {
        return other;
      }
    }
  }
  return input.mass;
}

bool is_still(const Network& network) {
  return std::ranges::none_of(network.masses, [&](const Mass& mass) {
    return moves(mass) && (mass.position != 0.0 || initial_velocity(network, mass) != 0.0 ||
                           mass.gravity != no_argument);
  });
}

// Returns the moving masses that the inputs drive, or else the first mass that moves.
std::vector<std::uint32_t> struck_masses(const Network& network) {
  std::vector<std::uint32_t> masses;
  for (const Input& input : network.inputs) {
    const std::uint32_t mass = struck_by(network, input);
    if (moves(network.masses[mass]) && std::ranges::find(masses, mass) == masses.end()) {
      masses.push_back(mass);
    }
  }
  for (std::uint32_t i = 0; i < network.masses.size() && masses.empty(); ++i) {
    if (moves(network.masses[i])) {
      masses.push_back(i);
    }
  }
  return masses;
}

void strike_first_mass(ChartScene& scene) {
  if (const auto masses = struck_masses(scene.network); !masses.empty()) {
    strike(scene, masses[0]);
  }
}

void play_note(ChartScene& scene, const Preset& preset) {
  for (const ControlSetting& control : preset.controls) {
    if (control.source != ControlSource::note || control.gesture == Gesture::noise) {
      continue;
    }
    for (std::size_t i = 0; i < scene.network.inputs.size(); ++i) {
      const Input& input = scene.network.inputs[i];
      if (control.target != "in" + std::to_string(input.number)) {
        continue;
      }
      if (input.is_force) {
        strike(scene, struck_by(scene.network, input));
      } else if (control.gesture != Gesture::parameter) {
        scene.motions[i] = motion_of(control, scene.network.masses[input.mass].position);
        scene.about = word_of(control.gesture) + ", a note of velocity 0.8";
      }
    }
  }
}

void excite(ChartScene& scene, const Preset& preset) {
  scene.motions.resize(scene.network.inputs.size());
  scene.is_linear = is_linear(scene.network);
  scene.has_contacts = has_contacts(scene.network);
  if (!is_still(scene.network)) {
    scene.about = "released from its initial state";
  } else if (scene.is_linear) {
    strike_first_mass(scene);
  } else {
    play_note(scene, preset);
    if (scene.about.empty()) {
      strike_first_mass(scene);
    }
  }
}

// Replaces characters that a file name should not have.
std::string plain(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0 && c != '-'; },
      '_');
  return name;
}

Result<ChartScene> scene_of(const std::string& name, Network network, const Preset& preset) {
  ChartScene scene{.name = plain(name), .network = expand_macros(network)};
  const auto heard = std::ranges::any_of(scene.network.parameters,
                                         [](const Parameter& p) { return p.audio_input > 0; });
  if (heard) {
    return Error{name + ": the chart cannot play audio inputs of parameters"};
  }
  if (scene.network.outputs.empty()) {
    return Error{name + ": the model has no output"};
  }
  for (Parameter& parameter : scene.network.parameters) {
    for (const ParameterSetting& setting : preset.parameters) {
      parameter.value = setting.name == parameter.name ? setting.value : parameter.value;
    }
  }
  excite(scene, preset);
  return scene;
}

}  // namespace

bool ChartScene::is_driven() const {
  return std::ranges::any_of(motions, [](const InputMotion& motion) { return motion != nullptr; });
}

const std::vector<std::string>& reference_scenes() {
  static const std::vector<std::string> names = {"triangle",    "string50",       "string150",
                                                 "BowedString", "1000massString", "20x30mesh",
                                                 "PhysicalLFO", "ball",           "stiffContact"};
  return names;
}

Result<ChartScene> chart_scene(const std::string& name) {
  if (name == "triangle") {
    return scene_of(name, triangle(), {});
  }
  if (name == "string50") {
    return scene_of(name, string_of(50, 0.1, 0.001, 13, 37), {});
  }
  if (name == "string150") {
    return scene_of(name, string_of(150, 0.3, 0.001, 133, 30), {});
  }
  if (name == "ball") {
    return scene_of(name, ball(), {});
  }
  if (name == "stiffContact") {
    return scene_of(name, string_on_stop(), {});
  }
  auto scene = load_scene(name, {});
  if (!scene) {
    return scene.error();
  }
  return scene_of(scene->name, std::move(scene->network), scene->preset);
}

ChartScene struck(const ChartScene& scene) {
  ChartScene other = scene;
  for (const std::uint32_t mass : struck_masses(scene.network)) {
    strike(other, mass);
  }
  const bool has_inputs = std::ranges::any_of(scene.network.inputs, [&](const Input& input) {
    return moves(scene.network.masses[struck_by(scene.network, input)]);
  });
  other.about = std::string("an impulse at ") + (has_inputs ? "its inputs" : "the first mass");
  return other;
}

ChartScene struck_harder(const ChartScene& scene) {
  ChartScene hard = scene;
  for (Mass& mass : hard.network.masses) {
    if (moves(mass)) {
      const double speed = initial_velocity(scene.network, mass);
      mass.position *= harder;
      mass.third = scene.network.third == ThirdArgument::delayed_position
                       ? mass.position - harder * speed
                       : harder * mass.third;
    }
  }
  for (InputMotion& motion : hard.motions) {
    if (motion) {
      motion = [slow = motion](double t) { return slow(harder * t); };
    }
  }
  return hard;
}

Starts::Starts(const ChartScene& scene) {
  scenes_.fill(scene);
  if (!scene.is_linear) {
    return;
  }
  Network heard = scene.network;  // has an output at every moving mass
  heard.outputs.clear();
  for (std::uint32_t i = 0; i < heard.masses.size(); ++i) {
    if (moves(heard.masses[i])) {
      heard.outputs.push_back({.number = static_cast<int>(heard.outputs.size()) + 1, .mass = i});
    }
  }
  const auto outputs = solve_continuous(heard, parameter_values(heard));
  for (unsigned i = 0; i < scenes_.size() && outputs; ++i) {
    const double steps = 1U << i;
    Network& network = scenes_[i].network;
    for (std::size_t o = 0; o < heard.outputs.size(); ++o) {
      Mass& mass = network.masses[heard.outputs[o].mass];
      // No link exerts a force in the first step. The initial velocity makes this step end at the
      // position of the continuous network.
      const double way = steps * ((*outputs)[o].play(1, 1.0 / steps)[0] - mass.position);
      mass.third = network.third == ThirdArgument::delayed_position
                       ? mass.position - way
                       : way * Network::reference_rate_hz;
    }
  }
}

const ChartScene& Starts::at(unsigned steps_a_sample) const {
  return scenes_[static_cast<std::size_t>(std::countr_zero(steps_a_sample))];
}

}  // namespace ressort::commands
