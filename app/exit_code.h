// app: the program's exit codes.
#pragma once

namespace ressort::exit_code {

inline constexpr int done = 0;
inline constexpr int our_failure = 1;
inline constexpr int wrong_use = 2;    // wrong arguments or unreadable input
inline constexpr int audio_lost = 75;  // no audio device, or it was lost

}  // namespace ressort::exit_code
