// app: what the program's end says to who started it.
#pragma once

namespace ressort::exit_code {

inline constexpr int done = 0;
inline constexpr int our_failure = 1;
inline constexpr int wrong_use = 2;    // or input that cannot be read
inline constexpr int audio_lost = 75;  // there is no audio, or none any more

}  // namespace ressort::exit_code
