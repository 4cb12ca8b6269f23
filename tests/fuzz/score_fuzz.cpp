// A libFuzzer target: whatever text comes, it is read as a score or refused with a line and a
// sentence; each of its calls becomes events or is refused, and they are played.
#include "app/control/registry.h"
#include "tests/fuzz/stage.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ressort;
  using fuzz::require;
  const auto lines = parse_score(fuzz::text_of(data, size));
  if (!lines) {
    require(!lines.error().message.empty() && lines.error().line >= 1);
    return 0;
  }
  auto compiled = compile(fuzz::network(), default_preset(fuzz::network(), false),
                          {.rate_hz = fuzz::Stage::rate_hz});
  require(static_cast<bool>(compiled));
  fuzz::Stage stage(*std::move(compiled));
  for (const ScoreLine& line : *lines) {
    require(line.time_s >= 0.0 && line.time_s <= 86400.0);
    const auto events = to_events(line.message, stage.instrument, fuzz::Stage::serial);
    if (!events) {
      require(!events.error().message.empty());
      continue;
    }
    for (const Event& event : *events) {
      describe_limit(line.message, event, stage.instrument);
      const auto frame = static_cast<std::int64_t>(line.time_s * fuzz::Stage::rate_hz);
      stage.process.schedule(frame % 1024, event);
    }
  }
  stage.block(1000);
  stage.block(24);
  stage.block(512);
  return 0;
}
