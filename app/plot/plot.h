// app/plot: figures with axes, drawn by gnuplot as SVG or PNG.
#pragma once

#include <initializer_list>
#include <string>
#include <vector>

#include "app/rooms.h"
#include "core/result.h"

namespace ressort::plot {

inline constexpr const char* ink = "#222222";
inline constexpr const char* accent = "#c8402f";

// Prints six significant digits; "NaN" if the value is not finite.
std::string number(double value);

// Returns one line of a series' data. A value that is not finite is written as NaN, which
// interrupts a curve.
std::string row(std::initializer_list<double> values);
// The same with a text at the end, for the style "labels".
std::string row(std::initializer_list<double> values, const std::string& text);

struct Series {
  std::string style;            // gnuplot's plotting style and its options: "lines lw 2"
  std::string data;             // rows; an empty line starts a new curve
  std::string title;            // title in the key; empty for none
  std::string columns = "1:2";  // columns of the data
  bool is_matrix = false;       // columns 1 and 2 count the columns and rows of the data from 0
};

struct Tick {
  double at = 0.0;
  std::string text;
};

struct Axis {
  std::string title;
  double from = 0.0;  // If `from` equals `to`, gnuplot chooses the range.
  double to = 0.0;
  bool is_logarithmic = false;
  std::vector<Tick> ticks;  // If empty, gnuplot chooses the ticks.
};

// A logarithmic axis with ticks at 1, 2 and 5 of every decade: "500", "1k", "2k".
Axis frequency_axis(double from_hz, double to_hz);

// Colours of the styles "image" and "pm3d".
enum class ColourMap { none, grey, heat };

struct Panel {
  std::string title;
  Axis x;
  Axis y;
  std::vector<Series> series;
  double height = 0.0;       // pixels; 0: as in the figure
  double left_margin = 0.0;  // pixels; 0: room for numbers
  bool has_axes = true;      // false: curves alone, in the whole panel
  bool is_solid = false;     // the data are points in space: x, y, z, and the colour for "pm3d"
  bool is_true = false;      // one unit has the same length in x and y
  std::string note;          // a sentence in the middle, for a panel without data
  ColourMap colours = ColourMap::none;
  double lightest = 0.0;  // the ends of the colour map
  double darkest = 1.0;
  std::string scale_title;          // title of the colour scale at the right; empty: no scale
  bool has_room_for_scale = false;  // beside a panel with a colour scale
};

struct Figure {
  std::string title;
  std::string caption;         // below the panels; '\n' starts a new line
  double panel_width = 420.0;  // pixels
  double panel_height = 260.0;
  std::size_t columns = 1;
  std::vector<Panel> panels;   // row by row
  std::vector<Series> legend;  // styles and titles, in a band below the panels
  std::size_t legend_columns = 3;
};

// PNG is a fifth of the size of SVG for figures of many spectrograms.
enum class Format { svg, png };

// Returns the gnuplot commands that draw the figure to standard output. Pure.
std::string to_script(const Figure& figure, Format format = Format::svg);

// Fails if gnuplot is missing, with advice on what to install. [control]
Result<Done> check_gnuplot();

// Runs gnuplot and returns what it draws. [control] 0.1 s and more
Result<std::string> draw(const Figure& figure, Format format = Format::svg);

// Text between tags or in quotes of HTML and SVG.
std::string escaped(const std::string& text);

}  // namespace ressort::plot
