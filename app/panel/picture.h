// app/panel: what is drawn of an engine, and how what the audio thread gives becomes positions.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "app/realtime/motion.h"
#include "core/engine/engine.h"
#include "core/model/network.h"
#include "core/result.h"

namespace ressort::panel {

inline constexpr std::size_t most_dots = 2000;

// Constant once it is made. Dots are masses that move, hands, places on waveguides and on bodies;
// of more than most_dots every n-th, in the order of the model; and points along waveguides,
// between these places.
struct Picture {
  static constexpr std::uint32_t no_mass = 0xffffffffu;

  // Engine::waveguide_points dots, from the left end to the right one.
  struct Waveguide {
    std::size_t first = 0;    // of the dots
    std::uint32_t macro = 0;  // of the network as it is written
    bool is_open = false;
    struct Place {
      double u = 0.0;  // where it starts
      std::size_t dot = 0;
    };
    std::vector<Place> places;  // from left to right
  };

  // A part of the machine: its dots follow each other.
  struct Group {
    std::size_t first = 0;  // of the dots
    std::size_t count = 0;
    std::vector<Waveguide> waveguides;  // whose dots follow
    // Of modes: position = start + sum over modes of (q - q at the start) * shape.
    bool is_modal = false;
    std::size_t modes = 0;
    std::vector<double> start_q;  // [mode]
    std::vector<float> shapes;    // [mode][dot]

    // As Engine::look() gives.
    std::size_t numbers() const {
      return (is_modal ? modes : count) + waveguides.size() * Engine::waveguide_points;
    }
  };

  std::uint32_t number = 0;
  std::vector<Group> groups;
  std::vector<std::uint32_t> masses;       // [dot] of the network with its macros written out, or
                                           // no_mass between places
  std::vector<double> start;               // [dot] position
  std::shared_ptr<const Network> network;  // as it is written
};

// Chooses the dots of an engine that does not play yet, and has it watch them. O(nodes + dots *
// modes). [any thread but audio]
Picture make_picture(Engine& engine, const Network& network, std::uint32_t number);

// [dot] positions in model units, of a frame of this picture; dots that the frame does not have are
// where they start. O(dots * modes that swing). [any thread but audio]
void find_positions(const Picture& picture, const MotionFrame& frame, std::span<float> positions);

// {"picture", "dots", "plane", "x": [], "y": [], "start": [], "names": [], "kinds": "",
//  "users": {parameter: [name, count]},
//  "links": [[a, b, law, zone, reach]], "laws": [[name, family]], "inputs": [[number, node,
//  force]], "outputs": [[number, node]]}: nodes are the dots and then what stands still. Lays out
//  the
// network: some ms a thousand masses. [any thread but audio]
std::string network_json(const Picture& picture);

// {"modes": [{"hz", "t60_s", "inputs": [[number, dB]], "shape": [dot]}], "linear": true}: the
// lowest, of the network as its parameters are; dB below the mode that this input excites most.
// Blocks. [any thread but audio]
Result<std::string> modes_json(const Picture& picture, std::span<const double> parameters,
                               double rate_hz, std::size_t count, const Progress& progress);

}  // namespace ressort::panel
