#include "app/commands/chart/front.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace ressort::commands {
namespace {

bool counts(const Trade& trade) {
  return std::isfinite(trade.ns) && std::isfinite(trade.db) && trade.ns > 0.0;
}

// The cheapest first; of those that cost the same the best.
std::vector<std::size_t> by_cost(std::span<const Trade> trades) {
  std::vector<std::size_t> order(trades.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return trades[a].ns < trades[b].ns ||
           (trades[a].ns == trades[b].ns && trades[a].db > trades[b].db);
  });
  return order;
}

}  // namespace

std::vector<bool> front_of(std::span<const Trade> trades) {
  std::vector<Trade> able;
  std::vector<std::size_t> which;
  for (std::size_t i = 0; i < trades.size(); ++i) {
    if (counts(trades[i])) {
      able.push_back(trades[i]);
      which.push_back(i);
    }
  }
  std::vector<bool> is_on(trades.size(), false);
  double best = -HUGE_VAL;
  for (const std::size_t i : by_cost(able)) {
    if (able[i].db > best) {
      best = able[i].db;
      is_on[which[i]] = true;
    }
  }
  return is_on;
}

double hypervolume(std::span<const Trade> trades) {
  const std::vector<bool> is_on = front_of(trades);
  double area = 0.0;
  double reached = least_db;
  for (const std::size_t i : by_cost(trades)) {
    if (is_on[i] && trades[i].ns < dearest_ns) {
      const double db = std::clamp(trades[i].db, reached, most_db);
      area += (db - reached) * std::log10(dearest_ns / trades[i].ns);
      reached = db;
    }
  }
  return area;
}

}  // namespace ressort::commands
