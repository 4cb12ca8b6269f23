// A libFuzzer target: any bytes as a scale and, after the first 0, as a keyboard map. They are read
// or rejected with a position, and every key gets a frequency.
#include <cmath>

#include "core/model/tuning/scala.h"
#include "tests/fuzz/player.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ressort;
  using fuzz::require;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const std::size_t end = std::min(text.find('\0'), size);
  const auto scale = parse_scale(text.substr(0, end));
  require(scale || (scale.error().line >= 1 && scale.error().column >= 1));
  const auto map = parse_keyboard_map(text.substr(std::min(size, end + 1)));
  require(map || (map.error().line >= 1 && map.error().column >= 1));
  if (scale && map) {
    if (const auto keys = key_frequencies(*scale, *map)) {
      require(keys->size() == 128);
      for (const double hz : *keys) {
        require(std::isfinite(hz) && hz >= 0.0);
      }
    }
  }
  return 0;
}
