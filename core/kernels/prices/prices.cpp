#include "core/kernels/prices/prices.h"

#include "core/kernels/prices/avx2.h"
#include "core/kernels/prices/avx512.h"
#include "core/kernels/prices/sse2.h"

namespace ressort::kernels {
namespace {

constexpr bool is_in_order(const Prices& prices) {
  for (std::size_t i = 0; i < item_count; ++i) {
    if (prices[i].item != static_cast<Item>(i)) {
      return false;
    }
  }
  return true;
}
static_assert(is_in_order(sse2_prices) && is_in_order(avx2_prices) && is_in_order(avx512_prices));

}  // namespace

const Prices& prices_of(Isa isa) {
  return isa == Isa::v4 ? avx512_prices : isa == Isa::v3 ? avx2_prices : sse2_prices;
}

double Work::cost(Isa isa, bool is_double) const {
  const Prices& prices = prices_of(isa);
  double ns = 0.0;
  for (std::size_t i = 0; i < item_count; ++i) {
    ns += times_[i] * (is_double ? prices[i].float64 : prices[i].float32);
  }
  return ns;
}

}  // namespace ressort::kernels
