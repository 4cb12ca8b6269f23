#include "app/control/osc/answers.h"

#include <cmath>
#include <set>

#include "app/control/console_commands.h"
#include "app/control/osc/client.h"
#include "app/control/osc/subscribers.h"
#include "app/control/status.h"
#include "app/devices/audio.h"
#include "app/session/files.h"
#include "app/session/loader.h"
#include "app/session/session.h"
#include "core/model/language/expression.h"

namespace ressort::control {
namespace {

// Adds a row, or none, for every parameter whose name matches.
template <class MakeRow>
void answer_parameters(const Query& query, MakeRow&& make_row) {
  const std::string& address = query.message.address;
  if (!query.client.may_have_rows(address)) {
    return;
  }
  const auto loaded = query.session.current();
  std::vector<Reply> rows;
  bool has_any = false;
  for (const ParameterInfo& info : loaded->instrument.parameters) {
    if (fits(query.name, info.name)) {
      has_any = true;
      make_row(info, rows);
    }
  }
  query.client.answer_rows(rows);
  if (!has_any) {
    query.client.error(address, "the model has no such parameter; /param/* lists its parameters");
  }
}

// Returns the client at the PORT in this argument, or the sender if there is none; sends an error
// and returns nothing if it is not a port.
std::optional<OscClient> receiver(const Query& query, std::size_t argument) {
  if (query.message.arguments.size() <= argument) {
    return query.client;
  }
  const double* const port = std::get_if<double>(&query.message.arguments[argument]);
  if (port == nullptr || !(*port >= 1.0 && *port <= 65535.0) || *port != std::floor(*port)) {
    query.client.error(query.message.address, "expected PORT, a whole number from 1 to 65535");
    return std::nullopt;
  }
  return query.client.at_port(static_cast<std::uint16_t>(*port));
}

// Returns the length of a subscription in seconds, from now; sends an error and returns nothing if
// it is invalid.
std::optional<double> lease(const Query& query, Subscribers::News news, std::string_view reply) {
  constexpr double usual_s = 10.0;
  const auto& arguments = query.message.arguments;
  const double* const asked = arguments.empty() ? &usual_s : std::get_if<double>(arguments.data());
  if (asked == nullptr || arguments.size() > 2 ||
      !(*asked > 0.0 && *asked <= Subscribers::longest_lease_s)) {
    query.client.error(query.message.address, "expected SECONDS, above 0 and at most " +
                                                  print_number(Subscribers::longest_lease_s) +
                                                  ", and a PORT or nothing");
    return std::nullopt;
  }
  const auto client = receiver(query, 1);
  if (!client) {
    return std::nullopt;
  }
  if (auto added = query.subscribers.add(*client, news, *asked, monotonic_ns()); !added) {
    query.client.error(query.message.address, added.error().message);
    return std::nullopt;
  }
  client->answer(Reply(reply).real(*asked));
  return *asked;
}

// Loads a scene and replies /done or /fail with the address and `told`.
void load_named(const Query& query, const std::string& name, std::optional<Argument> told) {
  const OscClient& client = query.client;
  const std::string& address = query.message.address;
  if (!client.outlet().begin_load()) {
    client.error(address, "busy: too many loads are waiting; try again");
    return;
  }
  const auto answer = [address, client, told](const Result<std::shared_ptr<const Loaded>>& result) {
    client.outlet().end_load();
    Reply reply(result ? "/done" : "/fail");
    reply.text(address);
    if (told) {
      reply.argument(*told);
    }
    if (!result) {
      const std::string& full = result.error().message;
      const std::string reason = without_source(full);
      reply.text(reason);
      if (reason != full) {
        client.outlet().log_failure("OSC could not load it:\n" + full);
      }
    }
    client.answer(reply);
  };
  query.session.load(name, answer, false, Reach::own_folders);
}

// Returns the only argument, a text; sends an error and returns null if there is another one.
const std::string* only_text(const Query& query, const std::string& word) {
  const auto& arguments = query.message.arguments;
  const auto* const text =
      arguments.size() == 1 ? std::get_if<std::string>(arguments.data()) : nullptr;
  if (text == nullptr) {
    query.client.error(query.message.address, query.message.address + ": expected " + word);
  }
  return text;
}

// Replies /done with the name, or /fail with the reason.
template <class Value>
void answer_named(const Query& query, const std::string& name, const Result<Value>& result) {
  query.client.answer(Reply(result ? "/done" : "/fail")
                          .text(query.message.address)
                          .text(result ? name : result.error().message));
}

void answer_saved(const Query& query, const std::string& name, const Result<std::string>& path) {
  answer_named(query, name, path);
  query.client.outlet().log(path ? "OSC saved " + *path
                                 : "OSC could not save '" + name + "': " + path.error().message);
}

void load_beside(const Query& query, int step) {
  const std::string name = query.session.preset_beside(step);
  if (name.empty()) {
    query.client.error(query.message.address, "there are no presets");
    return;
  }
  load_named(query, name, Argument(name));
}

}  // namespace

void answer::parameters(const Query& query) {
  answer_parameters(query, [&](const ParameterInfo& info, std::vector<Reply>& rows) {
    // Empty if another model was loaded in between.
    if (const auto value = query.session.parameter(info.name)) {
      rows.push_back(Reply("/param/" + info.name).real(*value));
    }
  });
}

void answer::knobs(const Query& query) {
  if (!query.client.may_have_rows(query.message.address)) {
    return;
  }
  const Session::Present now = query.session.present();
  std::vector<Reply> rows;
  for (std::size_t i = 0; i < now.knobs.size(); ++i) {
    const KnobInfo& knob = now.loaded->instrument.knobs[i];
    if (fits(query.name, knob.word)) {
      rows.push_back(Reply(knob.address()).real(now.knobs[i]));
    }
  }
  query.client.answer_rows(rows);
  if (rows.empty()) {
    query.client.error(query.message.address,
                       "the preset has no such control; /control/* lists its controls");
  }
}

void answer::ranges(const Query& query) {
  answer_parameters(query, [](const ParameterInfo& info, std::vector<Reply>& rows) {
    rows.push_back(Reply("/param/" + info.name + "/range")
                       .real(info.minimum)
                       .real(info.maximum)
                       .real(info.safe.lowest)
                       .real(info.safe.highest));
  });
}

void answer::load(const Query& query) {
  const Message& message = query.message;
  if (message.arguments.empty() || message.arguments.size() > 2 ||
      !std::holds_alternative<std::string>(message.arguments[0])) {
    query.client.error(message.address, message.address + ": expected NAME [ID]");
    return;
  }
  load_named(query, std::get<std::string>(message.arguments[0]),
             message.arguments.size() > 1 ? std::optional(message.arguments[1]) : std::nullopt);
}

void answer::next_preset(const Query& query) {
  load_beside(query, 1);
}

void answer::previous_preset(const Query& query) {
  load_beside(query, -1);
}

// Never overwrites: the sender of a packet has not seen what is there.
void answer::save(const Query& query) {
  if (const auto* const name = only_text(query, "NAME")) {
    answer_saved(query, *name, query.session.save(*name, Existing::refuse));
  }
}

void answer::flight(const Query& query) {
  if (const auto* const name = only_text(query, "NAME")) {
    answer_saved(query, *name, query.session.save_flight(*name));
  }
}

void answer::learn(const Query& query) {
  if (const auto* const target = only_text(query, "TARGET")) {
    answer_named(query, *target, query.session.learn(*target));
  }
}

void answer::unlearn(const Query& query) {
  if (const auto* const target = only_text(query, "TARGET")) {
    const bool waits = query.session.waiting_target() == *target;
    auto count = query.session.unlearn(*target);
    if (count && *count == 0 && !waits) {
      count = Error{"no controller is assigned to '" + *target + "'"};
    }
    answer_named(query, *target, count);
  }
}

void answer::status(const Query& query) {
  query.client.answer(status_reply(query.session.status(MeterReader::osc)));
}

void answer::describe(const Query& query) {
  if (!query.client.may_have_rows(query.message.address)) {
    return;
  }
  const auto loaded = query.session.current();
  std::vector<Reply> rows;
  const auto row = [&](std::string_view address, std::string_view arguments,
                       std::string_view meaning) {
    rows.push_back(Reply("/describe.reply").text(address).text(arguments).text(meaning));
  };
  for (const Row* const known : addresses()) {
    row(known->address, known->arguments_text(), known->does);
  }
  for (const ParameterInfo& info : loaded->instrument.parameters) {
    row("/param/" + info.name, "f", "parameter of the model");
    rows.back()
        .real(query.session.parameter(info.name).value_or(info.value))
        .real(info.minimum)
        .real(info.maximum)
        .real(info.safe.lowest)
        .real(info.safe.highest);
  }
  const Session::Present now = query.session.present();
  for (std::size_t i = 0; i < now.knobs.size(); ++i) {
    const KnobInfo& knob = now.loaded->instrument.knobs[i];
    row(knob.address(), "f", knob.help.empty() ? knob.name : knob.help);
    rows.back().real(now.knobs[i]).real(0.0).real(1.0);
  }
  std::set<std::string_view> customs;  // One address may control several targets.
  for (const CustomInfo& custom : loaded->instrument.custom) {
    if (customs.insert(custom.address).second) {
      row(custom.address, "f", "control of the preset, 0-1");
    }
  }
  rows.push_back(Reply("/describe.end").whole(rows.size()));
  query.client.answer_rows(rows);
}

void answer::models(const Query& query) {
  if (!query.client.may_have_rows(query.message.address)) {
    return;
  }
  std::vector<Reply> rows;
  for (const std::string& name : known_models()) {
    rows.push_back(Reply("/models.reply").text(name));
  }
  rows.push_back(Reply("/models.end").whole(rows.size()));
  query.client.answer_rows(rows);
}

void answer::presets(const Query& query) {
  if (!query.client.may_have_rows(query.message.address)) {
    return;
  }
  std::vector<Reply> rows;
  for (const std::string& name : known_presets()) {
    rows.push_back(Reply("/presets.reply").text(name).text(preset_description(name)));
  }
  rows.push_back(Reply("/presets.end").whole(rows.size()));
  query.client.answer_rows(rows);
}

void answer::modes(const Query& query) {
  const Message& message = query.message;
  const OscClient& client = query.client;
  const auto count = mode_count(message.arguments.empty() ? Argument(32.0) : message.arguments[0]);
  if (!count || message.arguments.size() > 1) {
    client.error(message.address, "expected the number of modes, 1 to 10000");
    return;
  }
  if (!client.may_have_rows(message.address)) {
    return;
  }
  query.session.find_modes(*count, [message, client](const Result<KnownModes>& modes) {
    if (!modes) {
      client.error(message.address, without_source(modes.error().message));
      return;
    }
    std::vector<Reply> rows;
    for (const KnownMode& mode : modes->modes) {
      Reply& row = rows.emplace_back("/modes.reply");
      row.whole(rows.size()).real(mode.frequency_hz).real(mode.t60_s);
      for (const auto& levels : mode.levels) {
        for (const double level : levels) {
          row.real(level);
        }
      }
    }
    rows.push_back(Reply("/modes.end").whole(rows.size()));
    client.answer_rows(rows);
  });
}

void answer::tune(const Query& query) {
  const Message& message = query.message;
  const OscClient& client = query.client;
  const auto target = tune_target(message.arguments);
  if (!target) {
    client.error(message.address, target.error().message);
    return;
  }
  if (!client.outlet().begin_load()) {
    client.error(message.address, "busy: too many loads are waiting; try again");
    return;
  }
  query.session.tune(*target,
                     [message, client](const Result<std::shared_ptr<const Loaded>>& result) {
                       client.outlet().end_load();
                       Reply reply(result ? "/done" : "/fail");
                       reply.text(message.address);
                       if (!result) {
                         reply.text(without_source(result.error().message));
                       }
                       client.answer(reply);
                     });
}

void answer::shape(const Query& query) {
  const Message& message = query.message;
  const OscClient& client = query.client;
  const auto targets = timbre_targets(message.arguments);
  if (!targets) {
    client.error(message.address, targets.error().message);
    return;
  }
  query.session.shape(*targets, [message, client](const Result<Shaped>& shaped) {
    Reply reply(shaped ? "/done" : "/fail");
    reply.text(message.address);
    if (!shaped) {
      client.answer(reply.text(without_source(shaped.error().message)));
      return;
    }
    for (std::size_t t = 0; t < shaped->targets.size(); ++t) {
      const TargetFigure figure = shaped->targets[t].figure;
      reply.text(short_name(figure))
          .real(*shaped->found.reached[static_cast<std::size_t>(figure)])
          .real(shaped->found.noticed[t]);
    }
    for (const std::string& why : missed(*shaped)) {
      reply.text(why);
    }
    client.answer(reply);
  });
}

void answer::subscribe(const Query& query) {
  lease(query, Subscribers::News::changes, "/subscribe.reply");
}

void answer::timbre(const Query& query) {
  if (const auto lent_s = lease(query, Subscribers::News::timbre, "/timbre.reply")) {
    query.session.timbre().listen(std::chrono::duration<double>(*lent_s));
  }
}

void answer::song(const Query& query) {
  const std::string& address = query.message.address;
  const auto done =
      control_song(query.session, address.substr(address.rfind('/') + 1), query.message.arguments);
  answer_named(query, query.session.song().description(), done);
}

void answer::unsubscribe(const Query& query) {
  const auto client = receiver(query, 0);
  if (!client) {
    return;
  }
  if (query.subscribers.remove(*client)) {
    client->answer(Reply("/done").text(query.message.address));
  } else {
    query.client.error(query.message.address, "there was no subscription");
  }
}

}  // namespace ressort::control
