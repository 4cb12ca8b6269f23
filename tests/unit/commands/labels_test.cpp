// Words beside marks: none lies on another, on a mark or outside of its frame.
#include "app/commands/chart/picture/labels.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/rooms.h"

namespace ressort::labels_test {

namespace {

constexpr Box frame{.left = 10.0, .right = 410.0, .bottom = 20.0, .top = 270.0};

Box around(const LabelRequest& mark) {
  return {mark.x - 3.0, mark.x + 3.0, mark.y - 3.0, mark.y + 3.0};
}

TEST_CASE("A lone label stands to the right of its mark", "[labels]") {
  const std::vector<LabelRequest> marks = {{200.0, 100.0, "2x"}};
  const auto placed = place_labels(marks, marks, frame);
  REQUIRE(placed.size() == 1);
  CHECK(placed[0].text == "2x");
  CHECK(placed[0].box.left > 200.0);
  CHECK_FALSE(placed[0].is_apart);
}

TEST_CASE("Labels of crowded marks touch nothing", "[labels]") {
  support::Random random(7);
  for (int round = 0; round < 50; ++round) {
    std::vector<LabelRequest> marks;
    for (int i = 0; i < 30; ++i) {
      marks.push_back({random.uniform(150.0, 250.0), random.uniform(100.0, 160.0), "-120"});
    }
    const auto placed = place_labels(marks, marks, frame);
    CHECK(placed.size() >= 10);
    for (std::size_t i = 0; i < placed.size(); ++i) {
      CHECK(frame.holds(placed[i].box));
      for (const LabelRequest& mark : marks) {
        CHECK_FALSE(placed[i].box.overlaps(around(mark)));
      }
      for (std::size_t j = 0; j < i; ++j) {
        CHECK_FALSE(placed[i].box.overlaps(placed[j].box));
      }
    }
  }
}

TEST_CASE("In a corner a label turns inwards", "[labels]") {
  const std::vector<LabelRequest> marks = {{408.0, 268.0, "cents=1"}};
  const auto placed = place_labels(marks, marks, frame);
  REQUIRE(placed.size() == 1);
  CHECK(frame.holds(placed[0].box));
}

}  // namespace

}  // namespace ressort::labels_test
