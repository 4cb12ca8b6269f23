// core/model: a hash table of what there may be millions of.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/rooms.h"

namespace ressort::model {

// Of the elements of somebody else's array it keeps the indices only.
class IndexTable {
 public:
  static constexpr std::uint32_t none = 0xffffffffu;

  explicit IndexTable(std::size_t most_indices = 0)
      : places_(std::bit_ceil(most_indices + most_indices / 2 + 1), none) {}

  // The place of the index that is the one looked for, or, holding `none`, where it belongs.
  template <class IsIt>
  std::uint32_t& find(std::size_t hash, IsIt&& is_it) {
    while (true) {
      std::uint32_t& place = places_[hash++ & (places_.size() - 1)];
      if (place == none || is_it(place)) {
        return place;
      }
    }
  }

 private:
  std::vector<std::uint32_t> places_;
};

}  // namespace ressort::model
