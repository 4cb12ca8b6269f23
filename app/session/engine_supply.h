// app/session: offers engines to the audio thread and deletes the ones that have played.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>

#include "app/realtime/process.h"
#include "app/session/flight/flight_recorder.h"

namespace ressort::session {

// All functions: [worker], unless they say otherwise.
class EngineSupply {
 public:
  // Chooses what the panel draws of an engine. Returns PlayingEngine::picture.
  using PictureOf = std::function<std::uint32_t(Engine& engine, const Network& network)>;

  EngineSupply(Process& process, FlightRecorder& flights) : process_(process), flights_(flights) {}

  // Sets the functions that are called before an engine is offered. [any thread but audio]
  void on_engine(PictureOf picture_of);
  void on_audio_inputs(std::function<void(int)> prepare);
  void prepare_audio_inputs(int count);

  // Serial of the newest engine; its events carry it.
  std::uint32_t serial() const { return serial_; }
  void begin_new_serial() { ++serial_; }

  // The engine that was offered last, or null. It lives until the next one is offered.
  const Engine* newest() const { return newest_; }
  // Offers an engine with the current serial.
  void offer(std::unique_ptr<Engine> engine, const Network& network, FlightEngine made_of,
             bool has_audio_inputs);
  // Deletes an engine that the audio thread has returned.
  void collect() { delete process_.slot.collect(); }

 private:
  Process& process_;
  FlightRecorder& flights_;
  std::mutex mutex_;  // guards the functions
  PictureOf picture_of_;
  std::function<void(int)> prepare_inputs_;
  std::uint32_t serial_ = 0;
  std::uint32_t count_ = 0;  // number of engines so far
  const Engine* newest_ = nullptr;
};

}  // namespace ressort::session
