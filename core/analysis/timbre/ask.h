// core/analysis/timbre: finds parameters with which a model has a target timbre.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/analysis/timbre/struck.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::analysis {

struct TimbreTarget {
  TargetFigure figure = TargetFigure::centroid;
  double value = 0.0;  // target_error() defines the valid values.
};

// A parameter that may change; by equal ratios if its range is wide (is_wide()).
struct FreeParameter {
  std::size_t index = 0;  // [parameter]
  double minimum = 0.0;
  double maximum = 0.0;
};

// Computes the figures of a model for these parameters, or an error.
using FiguresAt = std::function<Result<TargetValues>(std::span<const double> parameters)>;

// Wraps a struck model, which must outlive the result.
FiguresAt timbre_model(StruckModel& model, StruckAs how);

struct TimbreSearchOptions {
  int starts = 8;  // The first start is the current parameters, the others are random.
  std::optional<FiguresAt> exactly;  // Refines and judges the best result, if given.
  std::uint64_t seed = 1;            // Seed of the random starts.
  std::function<void(double share)> on_progress =
      {};  // Reports progress from 0 to 1 as starts finish.
  Progress progress = {};
};

struct FoundTimbre {
  std::vector<double> values;  // [parameter]
  TargetValues before;         // Figures at the original parameters.
  TargetValues reached;
  std::vector<double> noticed;  // [target] Error in JND; above 0: more than the target.
  // Free parameters held by a bound although a value beyond it would be nearer to the target.
  struct Held {
    std::size_t index = 0;  // [parameter]
    bool is_highest = false;
  };
  std::vector<Held> held;
  bool is_reached = false;    // All targets are met to a hundredth of a JND.
  bool has_influence = true;  // Some free parameter influences some target.
  int starts = 0;             // Number of starts used.
  std::size_t trials = 0;     // Evaluations of the model, including those for slopes.
};

// Minimises the sum of squared errors in JND by Levenberg-Marquardt, in parameters scaled to 0..1
// and kept there, until a start reaches the target; otherwise refines the best end point with
// `exactly`. `values` are the current parameters. Fails if nothing is free, a target is invalid,
// the model lacks a figure at its current parameters, or the search is stopped (`stopped`).
// O(starts * steps * parameters) evaluations.
Result<FoundTimbre> find_timbre(const FiguresAt& model, std::span<const double> values,
                                std::span<const FreeParameter> free,
                                std::span<const TimbreTarget> targets,
                                const TimbreSearchOptions& options);

}  // namespace ressort::analysis
