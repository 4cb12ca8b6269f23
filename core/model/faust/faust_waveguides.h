// core/model: the waveguides of a network in FAUST, and the springs that hold them, which are
// solved together in every sample. All text, for faust.cpp.
//
// Of a mass or a place that such a spring holds, o_ is its position a sample ago, u_ and y_ are its
// speed and position if none of them pulled, h_ what they pull with. Of a waveguide, b_ are its
// waves behind the filters and behind each place, d_ where a wave is then, in samples.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/model/network.h"
#include "core/result.h"
#include "core/waveguide_places.h"

namespace ressort {

// How much of a node a point is: its weight as a factor, "0.3*" or "hat(2.0, row_p)*".
struct FaustShare {
  std::uint32_t node = 0;
  std::string factor;
};

// What is known of the network's text already.
struct FaustTerms {
  std::span<const std::string> masses;  // [mass] its name, after x_, v_, n_, to_
  std::span<const std::string> links;   // [link] the same, after f_
  std::function<std::string(ArgumentId)> value;
  std::function<std::vector<FaustShare>(std::uint32_t point)> shares;
  std::function<std::string(std::uint32_t mass)> inverse_mass;
};

// Whether a number follows an audio input.
bool is_driven(const Network& network, ArgumentId argument);

// Why a network's waveguides cannot be written, with the line. The network is expanded.
std::optional<Error> faust_refusal(const Network& network);

class FaustWaveguides {
 public:
  explicit FaustWaveguides(const Network& network);

  bool is_held(std::uint32_t mass) const { return is_held_[mass]; }
  bool holds(std::uint32_t link) const { return holds_[link]; }

  // What is known a sample later: "nx_m" and "tox_m".
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
  // The springs' forces, and what they sum up to at every mass, h_.
  std::string springs(const FaustTerms& terms) const;

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

  std::string give(const FaustTerms& terms, std::uint32_t from, std::uint32_t at) const;
  std::string solution(std::span<const std::string> couplings) const;
  double coordinate(std::uint32_t mass) const;

  const Network& network_;
  std::vector<bool> is_held_;  // [mass] by a spring that is solved; places on waveguides, too
  std::vector<bool> holds_;    // [link]
  std::vector<std::uint32_t> springs_;
  std::vector<Guide> guides_;
  bool damps_ = false;
};

}  // namespace ressort
