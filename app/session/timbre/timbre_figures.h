// app/session: the figures of timbre by the names that files, messages and people know them by, and
// the words that musicians have for them. Pure.
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

// Of a frame. Three figures are called tristimulus, one after the other.
struct TimbreFigure {
  std::string_view name;  // with its unit
  std::optional<double> (*of)(const FrameTimbre& timbre);
};
std::span<const TimbreFigure> timbre_figures();

// [figure] Where one is absent, there is nothing to tell.
using FigureValues = std::vector<std::optional<double>>;
FigureValues figures_of(const FrameTimbre& timbre);

// The index of the figure of this name, the first of several.
std::size_t figure_number(std::string_view name);

// Of a whole sound.
struct TemporalFigure {
  std::string_view name;
  std::optional<double> (*of)(const TemporalShape& shape);
};
std::span<const TemporalFigure> temporal_figures();

// "1,812", with so many digits after the point.
std::string with_commas(double number, int digits);

// A line for each figure that musicians have a word for, the word first: "bright: 1,812 Hz, the
// centroid of the spectrum". Where `before` has another value, by 2 % at least, it says what it has
// become: "brighter: 1,812 Hz, the centroid of the spectrum; was 1,204 Hz". Where a word begins is
// a matter of taste, the figure is not.
std::vector<std::string> timbre_words(const FigureValues& now,
                                      const std::optional<TemporalShape>& temporal = {},
                                      const FigureValues& before = {});

}  // namespace ressort::session
