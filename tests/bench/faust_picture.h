// bench: how many times faster than FAUST everything is, as a picture.
#pragma once

#include <string>
#include <vector>

#include "tests/bench/report.h"

namespace ressort::bench {

// An SVG: a line for each scene that FAUST played too, with the kernel that the plan takes and the
// engine around it, in double and in float, and a bar from one quartile of the rounds to the other.
// Empty where there is no such scene.
std::string faust_picture(const std::string& machine, const std::vector<Row>& rows);

}  // namespace ressort::bench
