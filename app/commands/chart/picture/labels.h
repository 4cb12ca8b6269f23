// app/commands: where the words beside marks stand in a picture, so that none lies on another.
#pragma once

#include <string>
#include <vector>

#include "app/rooms.h"

namespace ressort::commands {

// In pixels, y upwards.
struct Box {
  double left = 0.0;
  double right = 0.0;
  double bottom = 0.0;
  double top = 0.0;

  bool overlaps(const Box& other) const {
    return left < other.right && other.left < right && bottom < other.top && other.bottom < top;
  }
  bool holds(const Box& other) const {
    return left <= other.left && other.right <= right && bottom <= other.bottom && other.top <= top;
  }
};

struct LabelRequest {
  double x = 0.0;  // of the mark, pixels
  double y = 0.0;
  std::string text;
};

struct PlacedLabel {
  std::string text;
  Box box;
  double from_x = 0.0;  // the mark
  double from_y = 0.0;
  bool is_apart = false;  // so far off that a line has to lead to it
};

// Places labels one after the other, each as near to its mark as it can be without touching a mark,
// another label or the edge of `frame`; one for which there is no place is left out. `marks`: the
// centres of everything that shall stay visible.
std::vector<PlacedLabel> place_labels(const std::vector<LabelRequest>& requests,
                                      const std::vector<LabelRequest>& marks, const Box& frame);

}  // namespace ressort::commands
