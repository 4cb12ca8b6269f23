// What a player asks of the modes of what sounds.
#include <utility>

#include "app/session/files.h"
#include "app/session/modes/tuned_files.h"
#include "app/session/session.h"
#include "core/model/language/print.h"

namespace ressort {
namespace {

const char* const ending = "the program is ending";

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

void Session::find_modes(std::size_t count, ModesAnswer answer) {
  constexpr std::size_t most_waiting = 4;
  const char* reason = "busy: enough modes are looked for, try again";
  {
    const std::lock_guard lock(mutex_);
    if (!stop_ && modes_jobs_.size() < most_waiting) {
      modes_jobs_.push_back({count, std::move(answer)});
      wake_.notify_all();
      return;
    }
    reason = stop_ ? ending : reason;
  }
  answer(Error{reason});
}

void Session::do_modes(const ModesJob& job) {
  const Present now = present();
  if (now.loaded->serial == 0) {
    job.answer(Error{"nothing is loaded"});
    return;
  }
  ModeOptions options{.count = job.count, .progress = Progress([this](std::string_view) {
                                            return !is_outdated(true);
                                          })};
  {
    const std::lock_guard lock(mutex_);
    options.rate_hz = rate_hz_;
  }
  const auto scene = load_scene(now.loaded->path, {.bare = options_.compile.bare,
                                                   .third = options_.third,
                                                   .keys = options_.keys,
                                                   .progress = options.progress});
  if (!scene) {
    job.answer(scene.error());
  } else if (scene->network.parameters.size() != now.values.size()) {
    job.answer(Error{"the model's file was changed since it was loaded; load it again"});
  } else {
    const auto modes = known_modes(*scene, now.values, options);
    job.answer(modes || modes.error().message != stopped
                   ? modes
                   : Result<KnownModes>(Error{"given up for a load; ask again"}));
  }
}

Result<Session::Wish> Session::write_tuned(const TuneTarget& target) {
  const Present now = present();
  if (now.loaded->serial == 0) {
    return Error{"nothing is loaded"};
  }
  const ModeOptions options{
      .rate_hz = options_.compile.rescale ? built_rate_hz_ : Network::reference_rate_hz,
      .progress = Progress([this](std::string_view) { return !is_outdated(true); })};
  const auto scene = load_scene(now.loaded->path, {.bare = options_.compile.bare,
                                                   .third = options_.third,
                                                   .keys = options_.keys,
                                                   .progress = options.progress});
  if (!scene) {
    return scene.error();
  }
  if (scene->network.parameters.size() != now.values.size()) {
    return Error{"the model's file was changed since it was loaded; load it again"};
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

}  // namespace ressort
