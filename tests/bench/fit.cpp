#include "tests/bench/fit.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>

namespace ressort::bench {
namespace {

constexpr double tolerated = 0.2;  // of a prediction

double& price_of(Price& price, bool is_double) {
  return is_double ? price.float64 : price.float32;
}

double predicted(const Prices& prices, const Sample& sample) {
  double ns = 0.0;
  for (const Price& price : prices) {
    ns += sample.work.of(price.item) * (sample.is_double ? price.float64 : price.float32);
  }
  return ns;
}

// Non-negative least squares, one price after the other until none moves.
void fit(Prices& prices, const std::vector<const Sample*>& samples, bool is_double) {
  constexpr int most_rounds = 100'000;
  std::vector<Price*> free;
  for (Price& price : prices) {
    if (std::any_of(samples.begin(), samples.end(),
                    [&](const Sample* one) { return one->work.of(price.item) > 0.0; })) {
      free.push_back(&price);
    }
  }
  std::vector<double> error;  // [sample] relative
  for (const Sample* one : samples) {
    error.push_back(predicted(prices, *one) / one->ns - 1.0);
  }
  const auto slope = [&](std::size_t i, const Price& price) {
    return samples[i]->work.of(price.item) / samples[i]->ns;
  };
  for (int round = 0; round < most_rounds; ++round) {
    double moved = 0.0;
    for (Price* const price : free) {
      double along = 0.0;
      double square = 0.0;
      for (std::size_t i = 0; i < samples.size(); ++i) {
        along += slope(i, *price) * error[i];
        square += slope(i, *price) * slope(i, *price);
      }
      double& ns = price_of(*price, is_double);
      const double better = std::max(0.0, ns - along / square);
      for (std::size_t i = 0; i < samples.size(); ++i) {
        error[i] += slope(i, *price) * (better - ns);
      }
      moved = std::max(moved, std::abs(better - ns) / std::max(better, 1e-3));
      ns = better;
    }
    if (moved < 1e-7) {
      return;
    }
  }
}

template <class Use>
void each_form(const std::vector<Sample>& samples, const Use& use) {
  for (const KernelRow& row : kernel_rows()) {
    for (const bool is_double : {true, false}) {
      std::vector<const Sample*> of_form;
      for (const Sample& one : samples) {
        if (row.work != nullptr && one.method == row.method && one.is_double == is_double) {
          of_form.push_back(&one);
        }
      }
      if (!of_form.empty()) {
        use(row, is_double, of_form);
      }
    }
  }
}

}  // namespace

Prices fitted(Prices prices, const std::vector<Sample>& samples) {
  each_form(samples,
            [&](const KernelRow&, bool is_double, const std::vector<const Sample*>& of_form) {
              fit(prices, of_form, is_double);
            });
  return prices;
}

void print_errors(const Prices& prices, const std::vector<Sample>& samples) {
  each_form(samples,
            [&](const KernelRow& row, bool is_double, const std::vector<const Sample*>& of_form) {
              const char* const precision = is_double ? "double" : "float";
              const std::string form(row.name);
              double squares = 0.0;
              std::size_t within = 0;
              for (const Sample* one : of_form) {
                const double ratio = predicted(prices, *one) / one->ns;
                squares += (ratio - 1.0) * (ratio - 1.0);
                within += std::abs(ratio - 1.0) <= tolerated ? 1 : 0;
                if (std::abs(ratio - 1.0) > tolerated) {
                  std::printf("  %-28s %-6s %-8s %10.4g ns, predicted %.2f of it\n",
                              one->scene.c_str(), precision, form.c_str(), one->ns, ratio);
                }
              }
              std::printf("%s, %s: %zu of %zu within a fifth, %.0f %% off on average\n",
                          form.c_str(), precision, within, of_form.size(),
                          100.0 * std::sqrt(squares / static_cast<double>(of_form.size())));
            });
}

std::filesystem::path path_of(Isa isa) {
  const char* const name = isa == Isa::v4 ? "avx512" : isa == Isa::v3 ? "avx2" : "sse2";
  return std::string("core/kernels/prices/") + name + ".h";
}

bool write(const Prices& prices, Isa isa, const std::string& machine) {
  const std::string name = path_of(isa).stem();
  std::ofstream file(path_of(isa));
  file << "// core/kernels: what things take on a machine with these instructions. Written by\n"
          "// `tests/bench/run --fit`, on\n// " +
              machine +
              "\n#pragma once\n\n#include \"core/kernels/prices/prices.h\"\n\n"
              "namespace ressort::kernels {\n\n// clang-format off\ninline constexpr Prices " +
              name + "_prices{{\n";
  for (const Price& price : prices) {
    char numbers[64];
    std::snprintf(numbers, sizeof numbers, "%.4g, %.4g", price.float64, price.float32);
    file << "    {Item::" << price.name << ", \"" << price.name << "\", " << numbers << "},\n";
  }
  file << "}};\n// clang-format on\n\n}  // namespace ressort::kernels\n";
  file.close();
  return file.good();
}

}  // namespace ressort::bench
