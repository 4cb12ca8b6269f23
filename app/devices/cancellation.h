// app/devices: protection of callbacks from libraries that cancel their threads.
#pragma once

#include <pthread.h>

#include "app/rooms.h"

namespace ressort::devices {

// Disables the cancellation of the calling thread as long as this object lives. libjack cancels its
// threads asynchronously (pthread_cancel) when a server dies or a client is closed. glibc then
// unwinds the stack from an arbitrary instruction, calls std::terminate at the first noexcept
// function, and leaves locks held. Makes no system call.
//
// No other library cancels a thread that runs our code: of libjack, libasound, RtMidi, liblo and
// cpp-httplib only libjack calls pthread_cancel. liblo's and cpp-httplib's functions run on threads
// of our own, which end by a flag and are joined, and so do the ALSA and the silent backend.
// RtMidi's ALSA thread ends by a flag too; its JACK callback runs on a thread of libjack.
class CancellationDisabled {
 public:
  CancellationDisabled() { pthread_setcancelstate(PTHREAD_CANCEL_DISABLE, &before_); }
  // A cancellation that was requested meanwhile unwinds the thread from here, so it must be allowed
  // to leave the destructor.
  ~CancellationDisabled() noexcept(false) { pthread_setcancelstate(before_, nullptr); }
  CancellationDisabled(const CancellationDisabled&) = delete;
  CancellationDisabled& operator=(const CancellationDisabled&) = delete;

 private:
  int before_ = PTHREAD_CANCEL_ENABLE;
};

}  // namespace ressort::devices
