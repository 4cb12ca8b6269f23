#include "app/session/timbre/timbre_figures.h"

#include <algorithm>
#include <cmath>

#include "app/text.h"

namespace ressort::session {
namespace {

using Maybe = std::optional<double>;

template <double SpectralShape::*member>
Maybe of_shape(const FrameTimbre& timbre) {
  return timbre.shape ? Maybe((*timbre.shape).*member) : std::nullopt;
}

template <Maybe SpectralShape::*member>
Maybe of_shape(const FrameTimbre& timbre) {
  return timbre.shape ? (*timbre.shape).*member : std::nullopt;
}

template <double HarmonicShape::*member>
Maybe of_harmonics(const FrameTimbre& timbre) {
  return timbre.harmonics ? Maybe((*timbre.harmonics).*member) : std::nullopt;
}

template <std::size_t part>
Maybe of_tristimulus(const FrameTimbre& timbre) {
  return timbre.harmonics ? Maybe(timbre.harmonics->tristimulus[part]) : std::nullopt;
}

constexpr TimbreFigure figures[] = {
    {"rms", [](const FrameTimbre& timbre) { return Maybe(timbre.rms); }},
    {"centroid_hz", of_shape<&SpectralShape::centroid_hz>},
    {"spread_hz", of_shape<&SpectralShape::spread_hz>},
    {"skewness", of_shape<&SpectralShape::skewness>},
    {"kurtosis", of_shape<&SpectralShape::kurtosis>},
    {"slope", of_shape<&SpectralShape::slope>},
    {"decrease", of_shape<&SpectralShape::decrease>},
    {"rolloff95_hz", of_shape<&SpectralShape::rolloff95_hz>},
    {"flatness", of_shape<&SpectralShape::flatness>},
    {"crest", of_shape<&SpectralShape::crest>},
    {"flux", [](const FrameTimbre& timbre) { return timbre.flux; }},
    {"entropy", of_shape<&SpectralShape::entropy>},
    {"inharmonicity", of_harmonics<&HarmonicShape::inharmonicity>},
    {"odd_to_even",
     [](const FrameTimbre& timbre) {
       return timbre.harmonics ? timbre.harmonics->odd_to_even : std::nullopt;
     }},
    {"tristimulus", of_tristimulus<0>},
    {"tristimulus", of_tristimulus<1>},
    {"tristimulus", of_tristimulus<2>},
    {"harmonic_deviation", of_harmonics<&HarmonicShape::harmonic_deviation>},
    {"noisiness", [](const FrameTimbre& timbre) { return timbre.noisiness; }},
};

Maybe t60_of(const TemporalShape& shape) {
  return shape.decay_slope && *shape.decay_slope < 0.0
             ? Maybe(-std::log(1000.0) / *shape.decay_slope)
             : std::nullopt;
}

constexpr TemporalFigure of_time[] = {
    {"log_attack_time", [](const TemporalShape& shape) { return Maybe(shape.log_attack_time); }},
    {"temporal_centroid_s",
     [](const TemporalShape& shape) { return Maybe(shape.temporal_centroid_s); }},
    {"effective_duration_s",
     [](const TemporalShape& shape) { return Maybe(shape.effective_duration_s); }},
    {"decay_slope", [](const TemporalShape& shape) { return shape.decay_slope; }},
    {"t60_s", t60_of},
};

// The words for a figure below `low`, up to `high` and above, and for a rise and a fall.
struct Word {
  std::string_view figure;
  double low;
  double high;
  std::string_view below;
  std::string_view between;
  std::string_view above;
  std::string_view shrunk;
  std::string_view grown;
  int digits;
  std::string_view unit;
  std::string_view what;
};

constexpr Word words[] = {
    {"centroid_hz", 600.0, 1500.0, "dark", "neither dark nor bright", "bright", "darker",
     "brighter", 0, " Hz", "the centroid of the spectrum"},
    {"spread_hz", 400.0, 1500.0, "narrow", "neither narrow nor wide", "wide", "narrower", "wider",
     0, " Hz", "the spread of the spectrum"},
    {"inharmonicity", 0.003, 0.03, "harmonic", "stiff", "bell-like", "more harmonic",
     "more bell-like", 4, "", "the inharmonicity"},
    {"odd_to_even", 1.0, 5.0, "full", "neither full nor hollow", "hollow", "fuller", "hollower", 2,
     " times", "the energy of odd partials over that of even ones"},
    {"noisiness", 0.1, 0.5, "pure", "a little noisy", "noisy", "purer", "noisier", 2, "",
     "the share of energy between partials"},
    {"flux", 0.002, 0.05, "steady", "slowly changing", "changing", "steadier", "less steady", 4, "",
     "how much frames differ from the last"},
};

const Word attack{"", 0.01, 0.1, "struck", "soft", "slow", "", "", 1, " ms", "the attack"};
const Word decay{"", 0.3, 2.0, "short", "neither short nor long", "long",
                 "", "",  2,   " s",    "the T60 of its decay"};

std::string figure_text(const Word& word, double value) {
  constexpr double most = 1e5;  // larger numbers are inaudible
  return (value > most ? "over " : "") +
         with_commas(std::min(value, most), value < 1000.0 ? word.digits : 0) +
         std::string(word.unit);
}

std::string sentence(const Word& word, double value, double shown) {
  const std::string_view name = value < word.low    ? word.below
                                : value < word.high ? word.between
                                                    : word.above;
  return std::string(name) + ": " + figure_text(word, shown) + ", " + std::string(word.what);
}

}  // namespace

std::span<const TimbreFigure> timbre_figures() {
  return figures;
}

std::span<const TemporalFigure> temporal_figures() {
  return of_time;
}

FigureValues figures_of(const FrameTimbre& timbre) {
  FigureValues values;
  values.reserve(std::size(figures));
  for (const TimbreFigure& figure : figures) {
    values.push_back(figure.of(timbre));
  }
  return values;
}

std::size_t figure_number(std::string_view name) {
  const auto* const found =
      std::ranges::find_if(figures, [&](const auto& figure) { return figure.name == name; });
  return static_cast<std::size_t>(found - std::begin(figures));
}

std::string with_commas(double number, int digits) {
  std::string text = fixed(number, digits);
  const std::size_t point = std::min(text.find('.'), text.size());
  const std::size_t first = text.starts_with('-') ? 1 : 0;
  for (std::size_t at = point; at > first + 3;) {
    at -= 3;
    text.insert(at, ",");
  }
  return text;
}

std::vector<std::string> timbre_words(const FigureValues& now,
                                      const std::optional<TemporalShape>& temporal,
                                      const FigureValues& before) {
  constexpr double noticed = 0.02;
  std::vector<std::string> lines;
  for (const Word& word : words) {
    const std::size_t figure = figure_number(word.figure);
    if (!now[figure]) {
      continue;
    }
    const Maybe was = figure < before.size() ? before[figure] : std::nullopt;
    const double value = *now[figure];
    if (was && std::fabs(value - *was) > noticed * std::fabs(*was)) {
      lines.push_back(std::string(value < *was ? word.shrunk : word.grown) + ": " +
                      figure_text(word, value) + ", " + std::string(word.what) + "; was " +
                      figure_text(word, *was));
    } else {
      lines.push_back(sentence(word, value, value));
    }
  }
  if (temporal) {
    const double attack_s = std::pow(10.0, temporal->log_attack_time);
    lines.push_back(sentence(attack, attack_s, 1000.0 * attack_s));
    if (const Maybe t60_s = t60_of(*temporal)) {
      lines.push_back(sentence(decay, *t60_s, *t60_s));
    }
  }
  return lines;
}

}  // namespace ressort::session
