#include "app/session/engine_supply.h"

#include <utility>

namespace ressort::session {

void EngineSupply::on_engine(PictureOf picture_of) {
  const std::lock_guard lock(mutex_);
  picture_of_ = std::move(picture_of);
}

void EngineSupply::on_audio_inputs(std::function<void(int)> prepare) {
  const std::lock_guard lock(mutex_);
  prepare_inputs_ = std::move(prepare);
}

void EngineSupply::prepare_audio_inputs(int count) {
  std::function<void(int)> prepare;
  {
    const std::lock_guard lock(mutex_);
    prepare = prepare_inputs_;
  }
  if (prepare) {
    prepare(count);
  }
}

void EngineSupply::offer(std::unique_ptr<Engine> engine, const Network& network,
                         FlightEngine made_of, bool has_audio_inputs) {
  PictureOf picture_of;
  {
    const std::lock_guard lock(mutex_);
    picture_of = picture_of_;
  }
  newest_ = engine.get();
  made_of.number = ++count_;
  made_of.serial = serial_;
  auto next = std::make_unique<PlayingEngine>();
  next->picture = picture_of ? picture_of(*engine, network) : 0;
  next->engine = std::move(engine);
  next->serial = serial_;
  next->lets_ring = made_of.lets_ring;
  next->has_new_numbers = made_of.has_new_numbers;
  next->number = made_of.number;
  flights_.add(std::move(made_of), has_audio_inputs);
  delete process_.slot.offer(next.release());
}

}  // namespace ressort::session
