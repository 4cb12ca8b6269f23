// app/panel: the drawing of an engine, and the conversion of the audio thread's numbers to
// positions.
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

// Immutable. Dots are moving masses, driven inputs, places on waveguides and on bodies, and points
// along waveguides between these places. Above most_dots, every n-th in the order of the model.
struct Picture {
  static constexpr std::uint32_t no_mass = 0xffffffffu;

  // Engine::waveguide_points dots from the left end to the right end.
  struct Waveguide {
    std::size_t first = 0;    // Index of the first dot.
    std::uint32_t macro = 0;  // Index in the network as written.
    bool is_open = false;
    struct Place {
      double u = 0.0;  // Position at the start.
      std::size_t dot = 0;
    };
    std::vector<Place> places;  // From left to right.
  };

  // A part of the machine; its dots are consecutive.
  struct Group {
    std::size_t first = 0;  // Index of the first dot.
    std::size_t count = 0;
    std::vector<Waveguide> waveguides;  // Their dots follow.
    // For modes: position = start + sum over modes of (q - q at the start) * shape.
    bool is_modal = false;
    std::size_t modes = 0;
    std::vector<double> start_q;  // [mode]
    std::vector<float> shapes;    // [mode][dot]

    // Returns how many values Engine::read_positions() writes.
    std::size_t numbers() const {
      return (is_modal ? modes : count) + waveguides.size() * Engine::waveguide_points;
    }
  };

  std::uint32_t number = 0;
  std::vector<Group> groups;
  // [dot] Index in the network with macros expanded; no_mass between places.
  std::vector<std::uint32_t> masses;
  std::vector<double> start;               // [dot] position
  std::shared_ptr<const Network> network;  // The network as written.
};

// Chooses the dots of an engine that is not playing yet, and makes it record them. O(nodes + dots *
// modes). [any thread but audio]
Picture make_picture(Engine& engine, const Network& network, std::uint32_t number);

// Computes [dot] positions in model units from a frame of this picture; dots missing from the frame
// stay at their start. O(dots * oscillating modes). [any thread but audio]
void find_positions(const Picture& picture, const MotionFrame& frame, std::span<float> positions);

// Returns the drawing as JSON:
// {"picture", "dots", "plane", "x": [], "y": [], "start": [], "names": [], "kinds": "",
// "users": {parameter: [name, count]},
// "wide", "bodies": [{"name", "strings", "places": [], "modes": [[displacement at place]]}],
// "links": [[a, b, law, zone, reach]], "laws": [[name, family]], "inputs": [[number, node,
// force]], "outputs": [[number, node]]}
// Nodes are the dots, then the fixed points. The modes of a body are the nodes "BODY:1" and on. A
// modal string has 1 to 4 strings, a length of `wide`, and no places. Computes the layout: some ms
// per thousand masses. [any thread but audio]
std::string network_json(const Picture& picture);

// Returns the lowest modes for the current parameters as JSON:
// {"modes": [{"hz", "t60_s", "inputs": [[number, dB]], "shape": [dot]}], "linear": true}
// dB are relative to the mode that this input excites most. Blocks. [any thread but audio]
Result<std::string> modes_json(const Picture& picture, std::span<const double> parameters,
                               double rate_hz, std::size_t count, const Progress& progress);

}  // namespace ressort::panel
