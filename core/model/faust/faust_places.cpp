#include "core/model/faust/faust_places.h"

#include <algorithm>
#include <cmath>

#include "core/model/faust/faust_words.h"

namespace ressort::model {
namespace {

using Words = std::vector<std::string>;

// The nodes along one side of a macro that a coordinate is between; all of them where it varies.
Words side(const Network& network, ArgumentId coordinate, std::uint32_t nodes,
           const std::string& place) {
  Words factors(nodes);
  static const Formula nowhere = {{Op::number, 0, 0.0}};
  const Formula& formula = coordinate == no_argument ? nowhere : network.arguments[coordinate];
  if (!is_constant(formula)) {
    for (std::uint32_t i = 0; i < nodes; ++i) {
      factors[i] = "hat(" + faust_number(i) + ", " + place + ")*";
    }
    return factors;
  }
  const double p = std::clamp(evaluate(formula, {}), 0.0, 1.0) * (nodes - 1);
  for (std::uint32_t i = 0; i < nodes; ++i) {
    const double weight = std::max(0.0, 1.0 - std::fabs(p - i));
    factors[i] = weight == 0.0 ? "0" : weight == 1.0 ? "" : faust_number(weight) + "*";
  }
  return factors;
}

// By a body's shapes at its places.
std::vector<FaustShare> shares_of_modes(const Network& network, const Tap& tap,
                                        const std::string& name) {
  const Words places = side(network, tap.u, tap.places, "row_" + name);
  std::vector<FaustShare> all;
  for (std::uint32_t mode = 0; mode < tap.length; ++mode) {
    Words terms;
    double sum = 0.0;  // where the place stays
    for (std::uint32_t place = 0; place < tap.places; ++place) {
      const double shape = network.shapes[tap.shape + place * tap.length + mode];
      if (places[place] == "0" || shape == 0.0) {
        continue;
      }
      terms.push_back("+ " + places[place] + faust_number(shape));
      if (faust_is_fixed(network, tap.u)) {
        sum += shape * (places[place].empty() ? 1.0 : std::stod(places[place]));
      }
    }
    if (!terms.empty() && (!faust_is_fixed(network, tap.u) || sum != 0.0)) {
      all.push_back(
          {tap.first + mode,
           (faust_is_fixed(network, tap.u) ? faust_number(sum) : "(" + faust_sum(terms) + ")") +
               "*"});
    }
  }
  return all;
}

}  // namespace

bool faust_is_fixed(const Network& network, ArgumentId coordinate) {
  return coordinate == no_argument || is_constant(network.arguments[coordinate]);
}

std::vector<FaustShare> faust_shares(const Network& network, std::uint32_t point,
                                     const std::string& name) {
  const Tap& tap = network.taps[network.masses[point].tap];
  if (tap.places > 0) {
    return shares_of_modes(network, tap, name);
  }
  const Words rows = side(network, tap.u, tap.length, "row_" + name);
  const Words columns = side(network, tap.v, tap.width, "column_" + name);
  std::vector<FaustShare> all;
  for (std::uint32_t i = 0; i < tap.length; ++i) {
    for (std::uint32_t j = 0; j < tap.width; ++j) {
      if (rows[i] != "0" && columns[j] != "0") {
        all.push_back({tap.first + i * tap.width + j, rows[i] + columns[j]});
      }
    }
  }
  return all;
}

}  // namespace ressort::model
