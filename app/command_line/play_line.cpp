#include <string>
#include <vector>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"
#include "app/commands/smf/midi_file.h"
#include "core/model/language/expression.h"

namespace ressort::command_line {
namespace {

const char* const play_examples =
    "Examples:\n"
    "  ressort play                              the triangle, on JACK, else ALSA, else silent\n"
    "  ressort play PolyTriangle -j              connected to the speakers and every keyboard\n"
    "  ressort play Resonator --midi song.mid    or, by the triangle: ressort play song.mid\n"
    "  ressort play my.mdl -a alsa -d hw:1       a model of your own on one sound card\n"
    "  ressort play -B 0.0.0.0 --osc-allow 192.168.1.23   played by OSC from a tablet, say\n"
    "  ressort play Gong --web 9788              seen and played in a browser, at the address it "
    "prints\n"
    "  oscsend localhost 9777 /note/on ii 69 100 a note by OSC, from another terminal\n";

}  // namespace

void add_play(CLI::App& app, PlayOptions& options, int& code) {
  CLI::App* command = app.add_subcommand("play", "plays a model or a preset");
  command->footer(play_examples);
  command
      ->add_option(
          "MODEL", options.name,
          "a preset's or a model's name, or a file; or a .mid file, or a .ressort flight,\n"
          "which is played")
      ->capture_default_str();
  command->add_option("-a,--audio", options.audio, "where the sound goes")
      ->check(CLI::IsMember({"auto", "jack", "alsa", "dummy"}))
      ->capture_default_str();
  command->add_option("-d,--device", options.device.device, "the ALSA device")
      ->capture_default_str();
  command
      ->add_option("-m,--midi", options.midi,
                   "where keyboards come from: auto, jack, alsa or none; or a .mid file, which is\n"
                   "played beside them. With -i the program ends when that has fallen silent")
      ->check(CLI::Validator(
          [](std::string& word) {
            const bool is_known =
                word == "auto" || word == "jack" || word == "alsa" || word == "none";
            return is_known || names_midi_file(word)
                       ? std::string()
                       : "must be auto, jack, alsa, none or a .mid file, found " + word;
          },
          "WORD"))
      ->capture_default_str();
  command->add_flag("-j,--connect", options.device.connect,
                    "connect to the speakers and to every keyboard (JACK)");
  command->add_option("-n,--name", options.device.client_name, "the name of our JACK client")
      ->check(CLI::Validator(
          [](std::string& name) {
            return name.empty() || name.size() > 60 || name.find(':') != std::string::npos
                       ? std::string("must have 1 to 60 characters, and no ':' among them")
                       : std::string();
          },
          "NAME"))
      ->capture_default_str();
  command->add_option("-g,--gain", options.gain_db, "dB on top of the preset's gain")
      ->check(within(-120.0, 60.0));
  command->add_option("-p,--voices", options.voices, "how many notes sound at once")
      ->check(within(1, max_voices));
  command
      ->add_option("--threads", options.threads,
                   "for voices and large networks: others help the audio thread, which never\n"
                   "waits for them")
      ->check(within(1, 64))
      ->capture_default_str();
  command
      ->add_option_function<std::string>(
          "--share",
          [&options](const std::string& text) {
            const std::size_t slash = text.find('/');
            double number = 0.0;
            double of = 0.0;
            const bool is_share = slash != std::string::npos &&
                                  parse_number(text.substr(0, slash), number) &&
                                  parse_number(text.substr(slash + 1), of);
            if (!is_share || number != std::floor(number) || of != std::floor(of) || number < 1.0 ||
                number > of || of > NoteShare::most_parts) {
              throw CLI::ValidationError(
                  "--share", "must be 1/2, the first of two, up to 64/64; found '" + text + "'");
            }
            options.share = {static_cast<int>(number), static_cast<int>(of)};
          },
          "which of the notes, of several programs that hear the same: 1/2 and 2/2 take keys\n"
          "in turn, on two cores. All are started before the first note")
      ->type_name("N/OF");
  add_keys(*command, options.keys);
  command
      ->add_option_function<std::vector<int>>(
          "--channel",
          [&options](const std::vector<int>& channels) {
            unsigned mask = 0;
            for (const int channel : channels) {
              mask |= 1U << (channel - 1);
            }
            options.keys.channels = mask;
          },
          "the MIDI channels to listen to, separated by commas, whatever the preset says")
      ->delimiter(',')
      ->check(within(1, 16));
  command->add_option("-r,--rate", options.device.rate_hz, "Hz; JACK has its own")
      ->check(within(8000.0, 384000.0))
      ->capture_default_str();
  command->add_option("-z,--period", options.device.period_frames, "frames; JACK has its own")
      ->check(within(16, 8192))
      ->capture_default_str();
  add_numbers(*command, options.precision, options.rescale);
  add_method(*command, options.method);
  add_budget(*command, options.budget);
  add_motion(*command, options.third);
  add_force(*command, options.force);
  command->add_flag("-i,--no-console", options.no_console, "do not read commands");
  command->add_option("-e,--execute", options.script, "a file of console commands, run first");
  command->add_option_function<std::string>(
      "-u,--osc-port",
      [&options](const std::string& text) {
        double port = 0.0;
        if (text != "off" && (!parse_number(text, port) || port < 1.0 || port > 65535.0)) {
          throw CLI::ValidationError("--osc-port", "must be 1 to 65535, or off");
        }
        options.osc.port = static_cast<int>(port);
      },
      "the UDP port for OSC, or off (9777)");
  command->add_option("-B,--osc-bind", options.osc.bind_address, "the address that OSC listens at")
      ->capture_default_str();
  command->add_option("--osc-allow", options.osc.allow,
                      "who may send OSC from elsewhere: addresses or networks, divided by commas,\n"
                      "192.168.1.23,10.0.0.0/24; needed with any -B but this machine's");
  command
      ->add_option("--web", options.panel.port,
                   "show and play it in a browser: the port of its page, " +
                       std::to_string(WebPanel::usual_port) + " without a number")
      ->expected(0, 1)
      ->default_str(std::to_string(WebPanel::usual_port))
      ->check(within(1, 65535));
  command
      ->add_option("--web-bind", options.panel.bind_address,
                   "the address that the page is at; beyond this machine only with its token")
      ->capture_default_str();
  command->add_flag("--exit-on-loss", options.exit_on_loss,
                    "end with 75 when the audio server dies, instead of waiting for it");
  command->add_flag("--watch", options.watch,
                    "read the model and the preset again when their files change; numbers go to\n"
                    "the voices that sound");
  command->callback([&options, &code] { code = play(options); });
}

}  // namespace ressort::command_line
