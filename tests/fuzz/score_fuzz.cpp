// A libFuzzer target: any text is read as a score or rejected with a line and a message. Each of
// its messages becomes events or is rejected, and the events are played.
#include "app/control/registry.h"
#include "tests/fuzz/player.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ressort;
  using fuzz::require;
  const auto lines = parse_score(fuzz::text_of(data, size));
  if (!lines) {
    require(!lines.error().message.empty() && lines.error().line >= 1);
    return 0;
  }
  auto compiled = compile_network(fuzz::network(), default_preset(fuzz::network(), false),
                                  {.rate_hz = fuzz::Harness::rate_hz});
  require(static_cast<bool>(compiled));
  fuzz::Harness harness(*std::move(compiled));
  for (const ScoreLine& line : *lines) {
    require(line.time_s >= 0.0 && line.time_s <= 86400.0);
    const auto events = to_events(line.message, harness.instrument, fuzz::Harness::serial);
    if (!events) {
      require(!events.error().message.empty());
      continue;
    }
    for (const Event& event : *events) {
      describe_limit(line.message, event, harness.instrument);
      const auto frame = static_cast<std::int64_t>(line.time_s * fuzz::Harness::rate_hz);
      harness.process.schedule(frame % 1024, event);
    }
  }
  harness.block(1000);
  harness.block(24);
  harness.block(512);
  return 0;
}
