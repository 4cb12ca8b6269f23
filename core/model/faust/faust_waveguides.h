// core/model: the waveguides of a network in FAUST. All text, for faust.cpp; what holds them is in
// faust_joint.h.
//
// Of a waveguide, b_ are its waves behind the filters and behind each place, d_ where a wave is
// then, in samples.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/model/faust/faust_joint.h"
#include "core/model/network.h"
#include "core/result.h"
#include "core/waveguide_places.h"

namespace ressort::model {

// Whether a number follows an audio input.
bool is_driven(const Network& network, ArgumentId argument);
// Whether a mass's own M, K or Z do.
bool drives_itself(const Network& network, const Mass& mass);

// Why a network's waveguides, or what holds them, cannot be written, with the line. The network is
// expanded.
std::optional<Error> faust_refusal(const Network& network);

class FaustWaveguides {
 public:
  FaustWaveguides(const Network& network, const FaustJoint& joint);

  // What is known a sample later: "nx_m" and "tox_m", of driven masses their speeds too, nv_.
  std::vector<std::string> later(const FaustTerms& terms, const std::string& prefix) const;
  // Each waveguide's filters and where its places are, as guide_s and by their names in the model.
  // They come in as signals: where they are written out, FAUST evaluates them wherever they are
  // named, and is never done.
  std::vector<std::string> numbers() const;
  // What brings them to the model, before its inputs.
  std::string feed(int inputs) const;
  std::string guides(const FaustTerms& terms) const;
  // A place, whatever pulls at it from outside being `outside`.
  std::string place(const FaustTerms& terms, std::uint32_t mass, const std::string& outside) const;
  // What the waves do behind the places.
  std::string waves(const FaustTerms& terms) const;

 private:
  struct Pass {  // of a wave by a place
    std::uint32_t mass = 0;
    bool runs_right = false;
  };
  struct Guide {
    std::string name;  // after g_, b_, d_
    const Macro* macro = nullptr;
    FiltersAt filters;
    std::vector<Pass> passes;  // in the order of a wave that leaves the filters
  };

  double coordinate(std::uint32_t mass) const;

  const Network& network_;
  const FaustJoint& joint_;
  std::vector<Guide> guides_;
};

}  // namespace ressort::model
