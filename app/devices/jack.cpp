#include <jack/jack.h>
#include <jack/metadata.h>
#include <jack/midiport.h>
#include <jack/thread.h>
#include <jack/transport.h>
#include <jack/uuid.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "app/devices/audio.h"
#include "app/devices/cancellation.h"

namespace ressort::devices {
namespace {

constexpr int most_audio_inputs = 16;
// limit for one block; more than a port's buffer holds
constexpr std::size_t most_midi_packets = 4096;

struct Jack {
  Jack(Process& process_in, const AudioOptions& options_in)
      : process(process_in), options(options_in) {}

  Process& process;
  AudioOptions options;
  jack_client_t* client = nullptr;
  std::vector<jack_port_t*> outputs;
  jack_port_t* midi = nullptr;
  jack_port_t* midi_out = nullptr;  // null: no controller wants messages
  std::array<Published<jack_port_t*>, most_audio_inputs> inputs;  // registered when needed
  std::int64_t clock_offset_ns = 0;                               // monotonic clock minus JACK's
  double rate_hz = 48000.0;
  Flag lost;
  Flag rewired;  // ports or connections have changed since the last update_wiring()

  // Used by JACK's notification thread and the control thread.
  std::mutex mutex;
  std::vector<const jack_port_t*> gone;  // ports unregistered since the last update_wiring()

  // Used by the control thread only.
  Wiring wiring;
  std::map<const jack_port_t*, std::string>
      connected_names;           // ports that were connected to us, by name
  std::int64_t next_try_ns = 0;  // time of the next attempt to restore connections

  // Used by the audio thread only.
  std::vector<float*> output_buffers;
  std::array<const float*, most_audio_inputs> input_buffers{};
  std::array<MidiPacket, most_midi_packets> packets;
};

Transport transport_of(const Jack& jack) {
  jack_position_t at;
  const bool rolls = jack_transport_query(jack.client, &at) == JackTransportRolling;
  if ((at.valid & JackPositionBBT) == 0 || at.ticks_per_beat <= 0.0) {
    return {.rolls = rolls, .position = at.frame / jack.rate_hz};
  }
  const double bars = at.bar - 1;
  return {.beats_per_s = at.beats_per_minute / 60.0,
          .rolls = rolls,
          .in_beats = true,
          .position = bars * static_cast<double>(at.beats_per_bar) + at.beat - 1 +
                      at.tick / at.ticks_per_beat};
}

// libjack may cancel the thread of any callback when the server ends, so each callback begins with
// a guard.
int on_process(jack_nframes_t frames, void* self) {
  const CancellationDisabled guard;
  Jack& jack = *static_cast<Jack*>(self);
  const auto buffer = [&](jack_port_t* port) { return jack_port_get_buffer(port, frames); };
  for (std::size_t i = 0; i < jack.outputs.size(); ++i) {
    jack.output_buffers[i] = static_cast<float*>(buffer(jack.outputs[i]));
  }
  std::size_t inputs = 0;
  for (; inputs < jack.inputs.size(); ++inputs) {
    jack_port_t* const port = jack.inputs[inputs].get();
    if (port == nullptr) {
      break;
    }
    jack.input_buffers[inputs] = static_cast<const float*>(buffer(port));
  }
  void* const midi = buffer(jack.midi);
  const std::size_t arrived = jack_midi_get_event_count(midi);
  std::size_t count = 0;
  // The source of a single connection refills this memory even while a late callback reads it, so
  // that an event may be gone.
  for (jack_midi_event_t event; count < std::min(arrived, jack.packets.size()); ++count) {
    if (jack_midi_event_get(&event, midi, static_cast<std::uint32_t>(count)) != 0) {
      break;
    }
    jack.packets[count] = {event.time, {event.buffer, event.size}};
  }
  jack.process.dropped.add(arrived - count + jack_midi_get_lost_event_count(midi));
  jack_nframes_t frame = 0;
  jack_time_t now_us = 0;
  jack_time_t next_us = 0;
  float period_us = 0.0f;
  if (jack_get_cycle_times(jack.client, &frame, &now_us, &next_us, &period_us) != 0) {
    now_us = jack_get_time();
  }
  jack.process.set_transport(transport_of(jack));
  jack.process.block(std::span<const float* const>(jack.input_buffers.data(), inputs),
                     std::span<float* const>(jack.output_buffers), frames,
                     {jack.packets.data(), count},
                     static_cast<std::int64_t>(now_us) * 1000 + jack.clock_offset_ns);
  if (jack.midi_out != nullptr) {
    void* const out = buffer(jack.midi_out);
    jack_midi_clear_buffer(out);
    for (const MidiBytes& message : jack.process.midi_out()) {
      jack_midi_event_write(out, frames - 1, message.data(), message.size());
    }
  }
  return 0;
}

int on_xrun(void* self) {
  const CancellationDisabled guard;
  static_cast<Jack*>(self)->process.xruns.add(1);
  return 0;
}

// The engine accepts any number of frames, so a new period needs no preparation.
int on_buffer_size(jack_nframes_t, void*) {
  return 0;
}

// A new rate needs a new engine: the control thread reopens the client.
int on_sample_rate(jack_nframes_t rate, void* self) {
  const CancellationDisabled guard;
  Jack& jack = *static_cast<Jack*>(self);
  if (static_cast<double>(rate) != jack.rate_hz) {
    jack.lost.raise();
  }
  return 0;
}

// A freewheeling server (a bounce) has no deadline, and every event keeps its frame.
void on_freewheel(int starts, void* self) {
  const CancellationDisabled guard;
  Flag& has_time = static_cast<Jack*>(self)->process.has_time;
  starts != 0 ? has_time.raise() : static_cast<void>(has_time.lower());
}

void on_shutdown(jack_status_t, const char*, void* self) {
  const CancellationDisabled guard;
  static_cast<Jack*>(self)->lost.raise();
}

void on_connect(jack_port_id_t, jack_port_id_t, int, void* self) {
  const CancellationDisabled guard;
  static_cast<Jack*>(self)->rewired.raise();
}

void on_port(jack_port_id_t id, int is_there, void* self) {
  const CancellationDisabled guard;
  Jack& jack = *static_cast<Jack*>(self);
  if (is_there == 0) {
    const std::lock_guard lock(jack.mutex);
    jack.gone.push_back(jack_port_by_id(jack.client, id));
  }
  jack.rewired.raise();
}

void ignore_message(const char*) {}

bool connect_port(Jack& jack, jack_port_t* ours, const char* theirs) {
  const char* const name = jack_port_name(ours);
  const bool is_output = (jack_port_flags(ours) & JackPortIsOutput) != 0;
  return jack_connect(jack.client, is_output ? name : theirs, is_output ? theirs : name) == 0;
}

// Connects ports for -j, unless a person has removed this connection.
void connect_unless_removed(Jack& jack, jack_port_t* ours, const char* theirs) {
  if (!jack.wiring.knows({jack_port_short_name(ours), theirs})) {
    connect_port(jack, ours, theirs);
  }
}

// Returns the names in a list of libjack's, which may be null.
std::vector<std::string> names_of(const char** list) {
  const std::unique_ptr<const char*, decltype(&jack_free)> ports(list, jack_free);
  std::vector<std::string> names;
  for (std::size_t i = 0; ports && ports.get()[i] != nullptr; ++i) {
    names.emplace_back(ports.get()[i]);
  }
  return names;
}

std::vector<std::string> physical_ports(Jack& jack, const char* type, unsigned long direction) {
  return names_of(jack_get_ports(jack.client, nullptr, type, JackPortIsPhysical | direction));
}

// Connects our outputs to the physical outputs in order. Returns false if there are none.
bool connect(Jack& jack) {
  const auto speakers = physical_ports(jack, JACK_DEFAULT_AUDIO_TYPE, JackPortIsInput);
  for (std::size_t i = 0; i < std::min(speakers.size(), jack.outputs.size()); ++i) {
    connect_unless_removed(jack, jack.outputs[i], speakers[i].c_str());
  }
  return !speakers.empty();
}

void connect_midi(Jack& jack) {
  for (const std::string& keyboard :
       physical_ports(jack, JACK_DEFAULT_MIDI_TYPE, JackPortIsOutput)) {
    connect_unless_removed(jack, jack.midi, keyboard.c_str());
  }
}

void connect_inputs(Jack& jack) {
  const auto microphones = physical_ports(jack, JACK_DEFAULT_AUDIO_TYPE, JackPortIsOutput);
  for (std::size_t i = 0; i < std::min(microphones.size(), jack.inputs.size()); ++i) {
    jack_port_t* const port = jack.inputs[i].get();
    if (port != nullptr && jack_port_connected(port) == 0) {
      connect_unless_removed(jack, port, microphones[i].c_str());
    }
  }
}

// Sets the metadata that patchbays show. Servers without metadata ignore it.
void describe(Jack& jack, jack_port_t* port, const std::string& name, const char* group,
              int order) {
  constexpr const char* order_key = "http://jackaudio.org/metadata/order";
  const jack_uuid_t id = jack_port_uuid(port);
  if (jack_uuid_empty(id) != 0) {
    return;
  }
  jack_set_property(jack.client, id, JACK_METADATA_PRETTY_NAME, name.c_str(), "text/plain");
  jack_set_property(jack.client, id, JACK_METADATA_PORT_GROUP, group, "text/plain");
  jack_set_property(jack.client, id, order_key, std::to_string(order).c_str(),
                    "http://www.w3.org/2001/XMLSchema#int");
}

// Adds input ports. They are never removed, so that connections made by hand survive a change of
// model.
void set_audio_inputs(Jack& jack, int wanted) {
  for (int i = 0; i < std::min(wanted, most_audio_inputs); ++i) {
    Published<jack_port_t*>& input = jack.inputs[static_cast<std::size_t>(i)];
    if (input.get() == nullptr) {
      input.set(jack_port_register(jack.client, ("in_" + std::to_string(i + 1)).c_str(),
                                   JACK_DEFAULT_AUDIO_TYPE, JackPortIsInput, 0));
      if (input.get() != nullptr) {
        describe(jack, input.get(), "Input " + std::to_string(i + 1), "Inputs", i);
      }
    }
  }
  jack.rewired.raise();
}

std::vector<jack_port_t*> own_ports(const Jack& jack) {
  std::vector<jack_port_t*> ports = jack.outputs;
  ports.push_back(jack.midi);
  if (jack.midi_out != nullptr) {
    ports.push_back(jack.midi_out);
  }
  for (std::size_t i = 0; i < jack.inputs.size() && jack.inputs[i].get() != nullptr; ++i) {
    ports.push_back(jack.inputs[i].get());
  }
  return ports;
}

// Marks the connections of unregistered ports as lost. JACK may have reused the port objects, so
// their names are the ones seen at the last update.
void mark_lost_ports(Jack& jack) {
  std::vector<const jack_port_t*> gone;
  {
    const std::lock_guard lock(jack.mutex);
    gone = std::exchange(jack.gone, {});
  }
  for (const jack_port_t* const port : gone) {
    if (const auto known = jack.connected_names.find(port); known != jack.connected_names.end()) {
      jack.wiring.mark_missing(known->second);
    }
  }
}

// Reads the current connections and restores the missing ones.
void update_wiring(Jack& jack, bool is_quiet) {
  mark_lost_ports(jack);
  const std::vector<jack_port_t*> ports = own_ports(jack);
  std::vector<Cable> present;
  for (jack_port_t* const port : ports) {
    for (std::string& other : names_of(jack_port_get_all_connections(jack.client, port))) {
      present.push_back({jack_port_short_name(port), std::move(other)});
    }
  }
  const auto exists = [&](const std::string& port) {
    return jack_port_by_name(jack.client, port.c_str()) != nullptr;
  };
  jack.wiring.update(present, exists, is_quiet);
  // Keeps the names while a connection is in doubt: the notification that its port is gone may
  // follow.
  if (!jack.wiring.is_in_doubt()) {
    jack.connected_names.clear();
  }
  for (const Cable& cable : present) {
    jack.connected_names.insert_or_assign(jack_port_by_name(jack.client, cable.theirs.c_str()),
                                          cable.theirs);
  }
  for (const Cable& cable : jack.wiring.missing()) {
    for (jack_port_t* const port : ports) {
      if (jack_port_short_name(port) == cable.ours && exists(cable.theirs)) {
        connect_port(jack, port, cable.theirs.c_str());
      }
    }
  }
  if (jack.options.connect) {
    connect_midi(jack);
    connect_inputs(jack);
  }
}

void tick(Jack& jack) {
  constexpr std::int64_t patience_ns = 1'000'000'000;
  // A busy server reports unregistered ports within this time.
  constexpr std::int64_t doubt_ns = 250'000'000;
  const std::int64_t now_ns = monotonic_ns();
  const bool has_changed = jack.rewired.lower();
  if (has_changed || now_ns >= jack.next_try_ns) {
    update_wiring(jack, !has_changed);
    jack.next_try_ns = now_ns + (jack.wiring.is_in_doubt() ? doubt_ns : patience_ns);
  }
}

void describe_ports(Jack& jack) {
  for (std::size_t i = 0; i < jack.outputs.size(); ++i) {
    const std::string number = std::to_string(i + 1);
    describe(jack, jack.outputs[i],
             jack.outputs.size() > 2 ? "Output " + number
             : i == 0                ? "Left"
                                     : "Right",
             "Outputs", static_cast<int>(i));
  }
  describe(jack, jack.midi, "MIDI", "Control", static_cast<int>(jack.outputs.size()));
  if (jack.midi_out != nullptr) {
    describe(jack, jack.midi_out, "MIDI to controllers", "Control",
             static_cast<int>(jack.outputs.size()) + 1);
  }
}

bool register_ports(Jack& jack) {
  const int count = std::max(2, jack.options.outputs);
  for (int i = 0; i < count; ++i) {
    const std::string name = count > 2 ? "out_" + std::to_string(i + 1)
                             : i == 0  ? "out_left"
                                       : "out_right";
    jack.outputs.push_back(jack_port_register(jack.client, name.c_str(), JACK_DEFAULT_AUDIO_TYPE,
                                              JackPortIsOutput | JackPortIsTerminal, 0));
  }
  jack.output_buffers.resize(jack.outputs.size());
  jack.midi =
      jack_port_register(jack.client, "midi_in", JACK_DEFAULT_MIDI_TYPE, JackPortIsInput, 0);
  if (jack.options.sends_midi) {
    jack.midi_out =
        jack_port_register(jack.client, "midi_out", JACK_DEFAULT_MIDI_TYPE, JackPortIsOutput, 0);
  }
  return jack.midi != nullptr && jack.outputs.back() != nullptr &&
         (jack.midi_out != nullptr || !jack.options.sends_midi);
}

}  // namespace

Result<AudioDevice> open_jack(Process& process, const AudioOptions& options) {
  jack_set_error_function(ignore_message);
  jack_set_info_function(ignore_message);
  auto jack = std::make_shared<Jack>(process, options);
  jack_status_t status{};
  jack->client = jack_client_open(options.client_name.c_str(), JackNoStartServer, &status);
  if (jack->client == nullptr) {
    const char* const server = std::getenv("JACK_DEFAULT_SERVER");
    return Error{std::string("no JACK server answers") +
                 (server != nullptr ? std::string(" to the name '") + server + "'" : "") +
                 "; start one (qjackctl, or jackd -d alsa), or choose another output: -a alsa, "
                 "-a dummy"};
  }
  std::shared_ptr<void> running(jack.get(), [jack](void*) { jack_client_close(jack->client); });
  jack->rate_hz = static_cast<double>(jack_get_sample_rate(jack->client));
  jack->clock_offset_ns = monotonic_ns() - static_cast<std::int64_t>(jack_get_time()) * 1000;
  process.set_rate(jack->rate_hz);
  jack_set_process_callback(jack->client, on_process, jack.get());
  jack_set_xrun_callback(jack->client, on_xrun, jack.get());
  jack_set_buffer_size_callback(jack->client, on_buffer_size, jack.get());
  jack_set_sample_rate_callback(jack->client, on_sample_rate, jack.get());
  jack_set_port_connect_callback(jack->client, on_connect, jack.get());
  jack_set_port_registration_callback(jack->client, on_port, jack.get());
  jack_set_freewheel_callback(jack->client, on_freewheel, jack.get());
  process.has_time.lower();
  jack_on_info_shutdown(jack->client, on_shutdown, jack.get());
  if (!register_ports(*jack) || jack_activate(jack->client) != 0) {
    return Error{"the JACK server registered no ports; there may be too many clients"};
  }
  describe_ports(*jack);
  jack->wiring = options.wiring;
  AudioDevice device;
  if (options.connect && !connect(*jack)) {
    device.note = "--connect found no physical outputs, so nothing is heard; connect '" +
                  std::string(jack_port_name(jack->outputs[0])) + "' by hand";
  }
  update_wiring(*jack, true);
  device.rate_hz = jack->rate_hz;
  device.description = "JACK client '" + std::string(jack_get_client_name(jack->client)) + "', " +
                       std::to_string(static_cast<int>(jack->rate_hz)) + " Hz";
  device.priority = jack_client_real_time_priority(jack->client);
  device.has_midi = true;
  device.running = std::move(running);
  device.is_lost = [jack] { return jack->lost.is_raised(); };
  device.set_audio_inputs = [jack](int wanted) {
    if (!jack->lost.is_raised()) {
      set_audio_inputs(*jack, wanted);
    }
  };
  device.tick = [jack] {
    if (!jack->lost.is_raised()) {
      tick(*jack);
    }
  };
  device.wiring = [jack] {
    Wiring wiring = jack->wiring;
    wiring.mark_all_missing();
    return wiring;
  };
  return device;
}

}  // namespace ressort::devices
