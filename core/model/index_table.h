// core/model: a compact hash table for millions of elements.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/rooms.h"

namespace ressort::model {

// A table of indices into an array that the caller owns; open addressing with linear probing.
class IndexTable {
 public:
  static constexpr std::uint32_t none = 0xffffffffu;

  explicit IndexTable(std::size_t most_indices = 0)
      : places_(std::bit_ceil(most_indices + most_indices / 2 + 1), none) {}

  // Returns the slot of the matching index, or the free slot for it, which holds `none`.
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
