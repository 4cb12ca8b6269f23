// The console's command about what the sound is like.
#include "app/control/console_commands.h"
#include "app/text.h"

namespace ressort {

Result<Done> command::timbre(ConsoleContext& console, Words) {
  constexpr std::chrono::milliseconds patience{20};
  constexpr int rounds = 60;  // a second and a bit: what is listened to takes 0.2 s
  if (!loaded(console)) {
    return nothing_loaded;
  }
  TimbreWatch& watch = console.session.timbre();
  watch.listen(std::chrono::seconds(10));  // whoever asks once asks again
  auto moment = watch.now();
  for (int round = 0; !moment && round < rounds && console.session.wait(patience); ++round) {
    moment = watch.now();
  }
  if (!moment) {
    return Error{"nothing plays, so nothing is heard"};
  }
  if (!moment->figures[figure_number("centroid_hz")]) {
    return Error{"it is silent; play a note, and ask while it sounds"};
  }
  console.print(joined(timbre_words(moment->figures, {}, console.timbre), "\n") +
                (moment->f0_hz ? "\nf0: " + with_commas(*moment->f0_hz, 2) + " Hz" : ""));
  console.timbre = std::move(moment->figures);
  return Done{};
}

}  // namespace ressort
