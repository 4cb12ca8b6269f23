// Values, table and figure of a sweep compared with the closed form of a string.
#include "app/commands/timbre/sweep.h"

#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>

#include "tests/support/app/data_folder.h"
#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::sweep_test {
namespace {

std::string told(const std::string& text) {
  const auto swept = parse_swept(text);
  return swept ? "" : swept.error().message;
}

std::string text_of(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream all;
  all << file.rdbuf();
  return all.str();
}

}  // namespace

TEST_CASE("Swept parameters are parsed; wide ranges are logarithmic", "[sweep]") {
  const auto wide = parse_swept("M=0.1:30:60");
  REQUIRE(wide);
  CHECK(wide->name == "M");
  CHECK(wide->first == 0.1);
  CHECK(wide->last == 30.0);
  CHECK(wide->steps == 60);
  CHECK(wide->by_ratios);
  CHECK(!parse_swept("t=1:6")->by_ratios);
  CHECK(parse_swept("t=1:6:log")->by_ratios);
  CHECK(!parse_swept("M=30:0.1:5:linear")->by_ratios);
  CHECK(parse_swept("M=30:0.1")->by_ratios);
  CHECK(parse_swept("M=1:2")->steps == 25);
  CHECK(told("M").find("the name of the parameter is missing") == 0);
  CHECK(told("=1:2").find("the name of the parameter is missing") == 0);
  CHECK(told("M=1").find("the range is missing") == 0);
  CHECK(told("M=1:x").find("the range is missing") == 0);
  CHECK(told("M=1:2:1").find("'1' is neither") == 0);
  CHECK(told("M=1:2:3.5").find("'3.5' is neither") == 0);
  CHECK(told("M=1:2:log:3").find("'3' is neither") == 0);
  CHECK(told("M=0:2:3:log").find("log needs numbers above 0") == 0);
  CHECK(!parse_law("f0_hz"));
  CHECK(parse_law("f0_hz=2*M")->formula == "2*M");
}

TEST_CASE("Pitch and T60 of a sweep follow the closed form of the string", "[sweep]") {
  const Folder folder;
  const std::string model = folder.file("string.mdl");
  std::ofstream(model) << "@M param 1.\n@Z param 0.02\n@s string 50 M 0.06349 Z 0. 0.\n"
                          "@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.95]\n";
  const std::string table = folder.file("out.csv");
  const std::string picture = folder.file("out.svg");
  DescribeOptions options{.name = model, .outputs = {table, picture}};
  options.swept = {*parse_swept("M=0.1:30:7"), *parse_swept("Z=0.01:0.02:2")};
  options.laws = {*parse_law("f0_hz=113.4*pow(M,-0.4982)")};
  options.how.at = 0;
  REQUIRE(sweep(options, [] { return true; }) == 0);
  std::istringstream rows(text_of(table));
  std::string row;
  std::getline(rows, row);
  CHECK(row.find("M,Z,f0_hz,rms,centroid_hz,spread_hz,") == 0);
  CHECK(row.substr(row.rfind(',') + 1) == "t60_s");
  int count = 0;
  const double lambda = std::pow(2.0 * std::sin(std::numbers::pi / 98.0), 2.0);
  for (; std::getline(rows, row); ++count) {
    std::istringstream cells(row);
    std::vector<double> values;
    for (std::string cell; std::getline(cells, cell, ',');) {
      values.push_back(cell.empty() ? -1.0 : std::stod(cell));
    }
    const double m = values[0];
    CHECK(m == Approx(0.1 * std::pow(300.0, (count / 2) / 6.0)).epsilon(1e-12));
    const double zeta = values[1] / m * lambda;
    const double k = 0.06349 / m * lambda;
    const double theta = std::acos((2.0 - k - zeta) / (2.0 * std::sqrt(1.0 - zeta)));
    CHECK(values[2] == Approx(44100.0 * theta / (2.0 * std::numbers::pi)).epsilon(1e-9));
    CHECK(values.back() ==
          Approx(-6.0 * std::numbers::ln10 / (44100.0 * std::log1p(-zeta))).epsilon(1e-9));
  }
  CHECK(count == 14);
  const std::string svg = text_of(picture);
  CHECK(svg.find("f0 in Hz") != std::string::npos);
  CHECK(svg.find("stroke-dasharray") != std::string::npos);
  CHECK(svg.find("</svg>") != std::string::npos);
}

TEST_CASE("An invalid or interrupted sweep writes nothing", "[sweep]") {
  const Folder folder;
  const std::string model = folder.file("string.mdl");
  std::ofstream(model) << "@M param 1.\n@s string 12 M 0.1 0.02 0. 0.\n"
                          "@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.9]\n";
  DescribeOptions options{.name = model, .outputs = {folder.file("out.csv")}};
  options.swept = {*parse_swept("Q=1:2:3")};
  CHECK(sweep(options, [] { return true; }) == 2);
  options.swept = {*parse_swept("M=1:2:3")};
  CHECK(sweep(options, [] { return false; }) == 1);
  options.outputs = {folder.file("out.svg")};
  options.figures = {"brightness"};
  CHECK(sweep(options, [] { return true; }) == 2);
  CHECK(text_of(folder.file("out.csv")).empty());
  CHECK(text_of(folder.file("out.svg")).empty());
}

}  // namespace ressort::sweep_test
