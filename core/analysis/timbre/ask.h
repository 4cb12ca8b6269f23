// core/analysis/timbre: parameters with which a model has the timbre that somebody asks for.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/analysis/timbre/struck.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::analysis {

struct TimbreTarget {
  AskedFigure figure = AskedFigure::centroid;
  double value = 0.0;  // as wrong_with() says
};

// A parameter that may be turned; where its range is wide (is_wide()) by equal ratios.
struct FreeParameter {
  std::size_t index = 0;  // [parameter]
  double minimum = 0.0;
  double maximum = 0.0;
};

// What a model is like with these parameters. An error: it cannot be told there.
using FiguresAt = std::function<Result<AskedValues>(std::span<const double> parameters)>;

// The same, where that is near a place, to first order in how far it is from there.
using FiguresNear = std::function<Result<AskedValues>(std::span<const double> place,
                                                      std::span<const double> parameters)>;

struct AskedModel {
  FiguresAt figures;
  FiguresNear near = {};  // for slopes; without it `figures`
};

// Of a struck model, which has to stay where it is.
AskedModel asked_model(StruckModel& model, StruckAs how);

struct AskOptions {
  int starts = 8;                     // the first where the parameters are, the others at random
  std::optional<AskedModel> exactly;  // what the best is brought nearer by, and judged by
  std::uint64_t seed = 1;             // of these
  std::function<void(double share)> tell = {};  // 0..1, as starts are done
  Progress progress = {};
};

struct AskedTimbre {
  std::vector<double> values;  // [parameter]
  AskedValues before;          // where the parameters were
  AskedValues reached;
  std::vector<double> noticed;  // [target] just noticeable differences, above 0: more than asked
  // Those of the free parameters that a bound holds where more of them would come nearer.
  struct Held {
    std::size_t index = 0;  // [parameter]
    bool is_highest = false;
  };
  std::vector<Held> held;
  bool is_reached = false;    // each to a hundredth of what is noticed
  bool has_influence = true;  // of any free parameter on any target
  int starts = 0;             // that were needed
  std::size_t trials = 0;     // evaluations of the model, those for slopes too
};

// Least squares of just noticeable differences by Levenberg and Marquardt, in parameters from 0 to
// 1 that stay there, until a start gets there; else the best of all, from where `exactly` goes on.
// `values` are where the parameters are. Fails where nothing may be turned, a target is none, the
// model has no such figure where it is, or a search is stopped (`stopped`). O(starts * steps *
// parameters) trials
Result<AskedTimbre> ask_timbre(const AskedModel& model, std::span<const double> values,
                               std::span<const FreeParameter> free,
                               std::span<const TimbreTarget> targets, const AskOptions& options);

}  // namespace ressort::analysis
