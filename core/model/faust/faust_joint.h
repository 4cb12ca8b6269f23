// core/model: what holds waveguides, in FAUST: links that are solved in every sample, together
// where they move each other. All text, for faust.cpp.
//
// Of a mass or a place that such a link holds, o_ is its position a sample ago, u_ and y_ are its
// speed and position if none of them pulled, h_ what they pull with.
#pragma once

#include <functional>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/model/faust/faust_places.h"
#include "core/model/network.h"
#include "core/result.h"

namespace ressort::model {

// What is known of the network's text already.
struct FaustTerms {
  std::span<const std::string> masses;  // [mass] its name, after x_, v_, n_, to_
  std::span<const std::string> links;   // [link] the same, after f_
  std::function<std::string(ArgumentId)> value;
  std::function<std::vector<FaustShare>(std::uint32_t point)> shares;
  std::function<std::string(std::uint32_t mass)> inverse_mass;
};

bool is_junction(const Network& network, std::uint32_t mass);

// Calls `use(mass)` for the masses that a link's end moves.
template <class Use>
void each_behind(const Network& network, std::uint32_t end, Use&& use) {
  const Mass& mass = network.masses[end];
  if (mass.kind != MassKind::point) {
    return use(end);
  }
  const Tap& tap = network.taps[mass.tap];
  for (std::uint32_t i = 0; i < tap.length * tap.width; ++i) {
    use(tap.first + i);
  }
}

// Of an expanded network.
class FaustJoint {
 public:
  explicit FaustJoint(const Network& network);

  bool is_held(std::uint32_t mass) const { return is_held_[mass]; }  // or is on a waveguide
  bool holds(std::uint32_t link) const { return holds_[link]; }

  // Why they cannot be written, with the line.
  std::optional<Error> refusal() const;
  // Which definitions they need.
  std::set<std::string> definitions() const;
  // Their forces, f_, and what these sum up to at every mass, h_.
  std::string text(const FaustTerms& terms) const;

 private:
  struct Cluster {                     // links that move each other, and no others
    std::vector<std::uint32_t> links;  // springs first
    std::size_t springs = 0;
    bool sets_out = false;  // it would pull as it starts

    bool sets_out_alone() const { return sets_out && links.size() == 1; }
  };

  std::string known(const FaustTerms& terms, std::uint32_t link) const;
  std::string speed_before(const FaustTerms& terms, std::uint32_t end) const;
  std::string give(const FaustTerms& terms, std::uint32_t from, std::uint32_t at) const;

  const Network& network_;
  std::vector<bool> is_held_;  // [mass]
  std::vector<bool> holds_;    // [link]
  std::vector<Cluster> clusters_;
};

}  // namespace ressort::model
