// app/session: names of timbre figures in files and messages, and musicians' words for them. Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/rooms.h"
#include "core/analysis/timbre/descriptors.h"
#include "core/analysis/timbre/frame_analysis.h"

namespace ressort::session {

// A figure of one frame. The three tristimulus figures follow each other.
struct TimbreFigure {
  std::string_view name;  // name with its unit
  std::optional<double> (*of)(const FrameTimbre& timbre);
};
std::span<const TimbreFigure> timbre_figures();

// [figure] An absent figure is not printed.
using FigureValues = std::vector<std::optional<double>>;
FigureValues figures_of(const FrameTimbre& timbre);

// Returns the index of the first figure of this name.
std::size_t figure_number(std::string_view name);

// A figure of a whole sound.
struct TemporalFigure {
  std::string_view name;
  std::optional<double> (*of)(const TemporalShape& shape);
};
std::span<const TemporalFigure> temporal_figures();

// Returns "1,812", with this number of decimals.
std::string with_commas(double number, int digits);

// Returns a line for each figure that musicians have a word for: "bright: 1,812 Hz, the centroid of
// the spectrum". If `before` differs by at least 2 %, the line shows the change: "brighter: 1,812
// Hz, the centroid of the spectrum; was 1,204 Hz". The limits between words are a matter of taste;
// the figures are not.
std::vector<std::string> timbre_words(const FigureValues& now,
                                      const std::optional<TemporalShape>& temporal = {},
                                      const FigureValues& before = {});

}  // namespace ressort::session
