// What a player asks of the modes and the timbre of what sounds.
#include <utility>

#include "app/session/files.h"
#include "app/session/load_news.h"
#include "app/session/modes/tuned_files.h"
#include "app/session/session.h"
#include "core/model/language/print.h"

namespace ressort::session {
namespace {

const char* const ending = "the program is ending";

// What was stopped was stopped for a load.
template <class T>
Result<T> told(Result<T> result) {
  return result || result.error().message != stopped
             ? std::move(result)
             : Result<T>(Error{"given up for a load; ask again"});
}

}  // namespace

void Session::tune(TuneTarget target, Answer answer) {
  {
    const std::lock_guard lock(mutex_);
    if (!stop_) {
      jobs_.push_back(
          {Wish{.name = current_->name, .target = std::move(target)}, std::move(answer)});
      wake_.notify_all();
      return;
    }
  }
  answer(Error{ending});
}

void Session::inquire(Inquiry inquiry) {
  constexpr std::size_t most_waiting = 4;
  const char* reason = "busy: enough is asked of what sounds, try again";
  {
    const std::lock_guard lock(mutex_);
    if (!stop_ && inquiries_.size() < most_waiting) {
      inquiries_.push_back(std::move(inquiry));
      wake_.notify_all();
      return;
    }
    reason = stop_ ? ending : reason;
  }
  inquiry.refuse(Error{reason});
}

// Whatever happens, who asked is told.
void Session::answer(const Inquiry& inquiry) {
  try {
    inquiry.work();
  } catch (const std::exception& error) {
    inquiry.refuse(Error{describe(error)});
  }
}

void Session::find_modes(std::size_t count, ModesAnswer answer) {
  inquire({[this, count, answer] { answer(told(modes_now(count))); },
           [answer](const Error& error) { answer(error); }});
}

void Session::shape(std::vector<TimbreTarget> targets, ShapeAnswer answer) {
  inquire({[this, targets = std::move(targets), answer] { answer(told(shape_now(targets))); },
           [answer](const Error& error) { answer(error); }});
}

Result<Scene> Session::scene_now(const Present& now, const Progress& progress) const {
  if (now.loaded->serial == 0) {
    return Error{"nothing is loaded"};
  }
  auto scene = load_scene(now.loaded->path, {.bare = options_.compile.bare,
                                             .third = options_.third,
                                             .keys = options_.keys,
                                             .progress = progress});
  if (scene && scene->network.parameters.size() != now.values.size()) {
    return Error{"the model's file was changed since it was loaded; load it again"};
  }
  return scene;
}

Result<KnownModes> Session::modes_now(std::size_t count) {
  const Present now = present();
  ModeOptions options{.count = count, .progress = Progress([this](std::string_view) {
                                        return !is_outdated(true);
                                      })};
  {
    const std::lock_guard lock(mutex_);
    options.rate_hz = rate_hz_;
  }
  const auto scene = scene_now(now, options.progress);
  return scene ? known_modes(*scene, now.values, options) : scene.error();
}

Result<Shaped> Session::shape_now(const std::vector<TimbreTarget>& targets) {
  constexpr int usual_key = 57;
  const Present now = present();
  const Progress progress([this](std::string_view) { return !is_outdated(true); });
  const auto scene = scene_now(now, progress);
  if (!scene) {
    return scene.error();
  }
  const Instrument& instrument = now.loaded->instrument;
  const Meters meters = process_.meters();
  const ShapeRequest request{
      .scene = *scene,
      .parameters = instrument.parameters,
      .values = now.values,
      .has_keys = scene->has_preset && instrument.mode.has_value(),
      .key = meters.notes == 0
                 ? usual_key
                 : meters.last_notes[(meters.notes - 1) % meters.last_notes.size()].key,
      .rate_hz = options_.compile.rescale ? built_rate_hz_ : Network::reference_rate_hz,
      .progress = progress};
  auto shaped = shape_timbre(request, targets);
  if (!shaped) {
    return shaped;
  }
  if (request.has_keys) {
    std::vector<Setting> values;
    for (std::size_t i = 0; i < now.values.size(); ++i) {
      if (instrument.parameters[i].audio_input == 0) {
        values.push_back({instrument.parameters[i].name, shaped->found.values[i]});
      }
    }
    const auto done = retune(std::move(values), progress);
    return done ? std::move(shaped) : Result<Shaped>(done.error());
  }
  std::vector<TimedEvent> events;
  for (std::size_t i = 0; i < now.values.size(); ++i) {
    if (shaped->found.values[i] != now.values[i]) {
      events.push_back({.event = {.kind = EventKind::parameter,
                                  .index = static_cast<std::uint16_t>(i),
                                  .model = now.loaded->serial,
                                  .value = shaped->found.values[i]}});
    }
  }
  if (!process_.send(process_.from_session, events)) {
    return Error{"the audio thread is busy and accepted no events; try again"};
  }
  remember(events);
  return shaped;
}

Result<Session::Wish> Session::write_tuned(const TuneTarget& target) {
  const Present now = present();
  const ModeOptions options{
      .rate_hz = options_.compile.rescale ? built_rate_hz_ : Network::reference_rate_hz,
      .progress = Progress([this](std::string_view) { return !is_outdated(true); })};
  const auto scene = scene_now(now, options.progress);
  if (!scene) {
    return scene.error();
  }
  const auto tuned = tune_mode(scene->network, now.values, target, options);
  if (!tuned) {
    return tuned.error();
  }
  const std::string model = print_network(tuned->network);
  const auto files = tuned_files(now.loaded->name, model);
  if (!files) {
    return files.error();
  }
  const auto preset = preset_text(files->model);
  if (!preset) {
    return preset.error();
  }
  for (const auto& [path, text] :
       {std::pair(files->model, model), std::pair(files->preset, *preset)}) {
    if (auto written = write_text(path, text, Existing::replace); !written) {
      return written.error();
    }
  }
  return Wish{.name = files->preset};
}

}  // namespace ressort::session
