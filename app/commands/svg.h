// app/commands: the pieces of which pictures are made, as SVG. Coordinates are pixels, y downwards.
// Pure.
#pragma once

#include <string>

#include "app/rooms.h"

namespace ressort::commands {

inline constexpr const char* ink = "#222";
inline constexpr const char* grid_ink = "#bbb";

// Rounded to a tenth of a pixel.
std::string px(double pixels);

// Text as it stands between tags and in quotes.
std::string escaped(const std::string& text);

std::string label(double x, double y, const std::string& text, const char* anchor = "end");
std::string line(double x1, double y1, double x2, double y2, const char* colour,
                 const char* width = "0.7");
std::string box(double x, double y, double width, double height);

// "500", "2k".
std::string hertz(double frequency_hz);

// The opening tag; "</svg>" ends it.
std::string svg_head(double width, double height, double font_px);

}  // namespace ressort::commands
