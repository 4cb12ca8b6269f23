#include <RtMidi.h>
#include <unistd.h>

#include <algorithm>
#include <map>

#include "app/devices/audio.h"
#include "app/devices/cancellation.h"
#include "app/devices/midi_input.h"

namespace ressort::devices {
namespace {

struct MidiPort {
  MidiPort(RtMidi::Api api, const std::string& client, MidiSink& door_in)
      : door(door_in), input(api, client) {
    input.setCallback(arrived, this);
    // Receives system exclusive messages, for tunings, and the clock, but no active sensing.
    input.ignoreTypes(false, false, true);
  }

  // Passes a packet on with its time of arrival, on the clock that the audio thread reads. RtMidi's
  // own time is relative to the previous message. [RtMidi's thread]
  static void arrived(double, std::vector<unsigned char>* bytes, void* self) {
    const CancellationDisabled guard;  // with -m jack this is a thread of libjack
    MidiPort& port = *static_cast<MidiPort*>(self);
    port.door.arrive(port.reader, *bytes, monotonic_ns());
  }

  MidiSink& door;
  MidiReader reader;
  RtMidiIn input;
};

void ignore_message(RtMidiError::Type, const std::string&, void*) {}

}  // namespace

void MidiSink::arrive(MidiReader& reader, std::span<const std::uint8_t> bytes,
                      std::int64_t time_ns) {
  const std::lock_guard lock(mutex_);
  reader.read(bytes, [&](const Event& event) {
    const TimedEvent timed{event, TimedEvent::When::at_time, time_ns};
    process_.send(process_.from_midi, {&timed, 1});
  });
}

struct MidiInput::Sources {
  RtMidi::Api api;
  std::string client;
  bool connect;
  MidiSink& door;
  Process* sender;                                           // null: nothing is sent
  std::unique_ptr<RtMidiOut> out;                            // the port to controllers
  std::unique_ptr<MidiPort> own;                             // the port that others connect to
  std::map<std::string, std::unique_ptr<MidiPort>> sources;  // ports by name
};

MidiInput::MidiInput(std::unique_ptr<Sources> sources) : sources_(std::move(sources)) {}
MidiInput::~MidiInput() = default;

Result<std::unique_ptr<MidiInput>> MidiInput::open(MidiApi api, const std::string& client_name,
                                                   bool connect, MidiSink& door, Process* sender) {
  const Error missing{api == MidiApi::alsa
                          ? "there is no ALSA sequencer (/dev/snd/seq), so there is no "
                            "MIDI through ALSA; play by OSC or from the console"
                          : "no JACK server answers, so there is no MIDI through JACK"};
  if (api == MidiApi::alsa && access("/dev/snd/seq", R_OK | W_OK) != 0) {
    return missing;  // checked here because RtMidi would print an error
  }
  const RtMidi::Api rt_api = api == MidiApi::alsa ? RtMidi::LINUX_ALSA : RtMidi::UNIX_JACK;
  try {
    auto sources =
        std::make_unique<Sources>(Sources{rt_api, client_name, connect, door, sender, {}, {}, {}});
    if (sender != nullptr) {
      sources->out = std::make_unique<RtMidiOut>(rt_api, client_name);
      sources->out->openVirtualPort("midi_out");
      sources->out->setErrorCallback(ignore_message);
      sender->has_midi_out.raise();
    }
    sources->own = std::make_unique<MidiPort>(rt_api, client_name, door);
    sources->own->input.openVirtualPort("midi_in");
    sources->own->input.setErrorCallback(ignore_message);
    auto input = std::unique_ptr<MidiInput>(new MidiInput(std::move(sources)));
    input->tick();
    return input;
  } catch (const RtMidiError&) {
    return missing;
  }
}

void MidiInput::tick() {
  Sources& s = *sources_;
  if (!s.connect) {
    return;
  }
  try {
    std::vector<std::string> present;
    for (unsigned i = 0; i < s.own->input.getPortCount(); ++i) {
      const std::string name = s.own->input.getPortName(i);
      if (name.find(s.client) != std::string::npos ||
          name.find("Midi Through") != std::string::npos) {
        continue;
      }
      present.push_back(name);
      if (!s.sources.contains(name)) {
        auto source = std::make_unique<MidiPort>(s.api, s.client, s.door);
        source->input.openPort(i, "from " + name);
        s.sources.emplace(name, std::move(source));
      }
    }
    std::erase_if(s.sources, [&](const auto& source) {
      return std::ranges::find(present, source.first) == present.end();
    });
  } catch (const RtMidiError&) {
    return;  // a source vanished meanwhile; the next tick handles it
  }
}

void MidiInput::send() {
  MidiBytes message;
  while (sources_->sender != nullptr && sources_->sender->to_controllers.pop(message)) {
    sources_->out->sendMessage(message.data(), message.size());
  }
}

}  // namespace ressort::devices
