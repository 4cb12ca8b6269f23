#include "app/commands/chart/picture/labels.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ressort::commands {
namespace {

constexpr double letter_width = 5.6;  // of an 8 point sans, as gnuplot draws it
constexpr double letter_height = 11.0;
constexpr double half_mark = 5.0;
constexpr double distances[] = {9.0, 13.0, 18.0, 25.0, 34.0, 45.0, 60.0};
constexpr double leads_from = 20.0;
constexpr int directions = 16;

// A box of this size whose nearest point is so far from a point in that direction.
Box box_beside(double x, double y, double width, double height, double distance, double angle) {
  const double middle_x = x + (distance + 0.5 * width) * std::cos(angle);
  const double middle_y = y + (distance + 0.5 * height) * std::sin(angle);
  return {middle_x - 0.5 * width, middle_x + 0.5 * width, middle_y - 0.5 * height,
          middle_y + 0.5 * height};
}

}  // namespace

std::vector<PlacedLabel> place_labels(const std::vector<LabelRequest>& requests,
                                      const std::vector<LabelRequest>& marks, const Box& frame) {
  std::vector<Box> taken;
  for (const LabelRequest& mark : marks) {
    taken.push_back(
        {mark.x - half_mark, mark.x + half_mark, mark.y - half_mark, mark.y + half_mark});
  }
  std::vector<PlacedLabel> placed;
  for (const LabelRequest& request : requests) {
    const double width = letter_width * static_cast<double>(request.text.size()) + 2.0;
    const auto try_at = [&](double distance, double angle) {
      const Box box = box_beside(request.x, request.y, width, letter_height, distance, angle);
      const bool is_free =
          frame.holds(box) && std::none_of(taken.begin(), taken.end(),
                                           [&](const Box& other) { return box.overlaps(other); });
      if (is_free) {
        taken.push_back(box);
        placed.push_back({.text = request.text,
                          .box = box,
                          .from_x = request.x,
                          .from_y = request.y,
                          .is_apart = distance >= leads_from});
      }
      return is_free;
    };
    // To the right and upwards first, then all around, ever farther.
    bool is_placed = false;
    for (const double distance : distances) {
      for (int i = 0; i < directions && !is_placed; ++i) {
        const int turn = i % 2 == 0 ? i / 2 : -(i + 1) / 2;
        is_placed = try_at(distance, 0.5 + turn * 2.0 * std::numbers::pi / directions);
      }
      if (is_placed) {
        break;
      }
    }
  }
  return placed;
}

}  // namespace ressort::commands
