#include <string>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"
#include "app/commands/commands.h"
#include "app/commands/smf/midi_file.h"
#include "core/model/language/expression.h"

namespace ressort::command_line {
namespace {

const char* const play_examples =
    "Examples:\n"
    "  ressort play                             the triangle, on JACK, ALSA or silently\n"
    "  ressort play PolyTriangle -j             connected to the speakers and all keyboards\n"
    "  ressort play Resonator --midi song.mid   a MIDI file; with the triangle: ressort play "
    "song.mid\n"
    "  ressort play my.mdl -a alsa -d hw:1      a model of your own on one sound card\n"
    "  ressort play -B 0.0.0.0 --osc-allow 192.168.1.23   OSC from a tablet\n"
    "  ressort play Gong --web 9788             in a browser, at the address that it prints\n"
    "  oscsend localhost 9777 /note/on ii 69 100   a note by OSC, from another terminal\n";

}  // namespace

void add_play(CLI::App& app, int& code) {
  CLI::App* command = app.add_subcommand("play", "plays a preset or a model live");
  command->footer(play_examples);
  PlayOptions& options = run_with<PlayOptions>(*command, code, play);
  add_model(*command, options.name, "preset or model, by name or file; a .mid or .ressort file")
      ->capture_default_str();
  command->add_option("-a,--audio", options.audio, "audio backend: auto, jack, alsa or dummy")
      ->type_name("WORD")
      ->check(CLI::IsMember({"auto", "jack", "alsa", "dummy"}).description(""))
      ->capture_default_str();
  command->add_option("-d,--device", options.device.device, "ALSA device")
      ->type_name("NAME")
      ->capture_default_str();
  command
      ->add_option("-m,--midi", options.midi,
                   "MIDI backend: auto, jack, alsa or none; or a .mid file to play")
      ->check(CLI::Validator(
          [](std::string& word) {
            const bool is_known =
                word == "auto" || word == "jack" || word == "alsa" || word == "none";
            return is_known || is_midi_file_name(word)
                       ? std::string()
                       : "must be auto, jack, alsa, none or a .mid file, found " + word;
          },
          ""))
      ->type_name("WORD")
      ->capture_default_str();
  command->add_flag("-j,--connect", options.device.connect,
                    "connect to the speakers and to all keyboards (JACK)");
  command->add_option("-n,--name", options.device.client_name, "JACK client name")
      ->check(CLI::Validator(
          [](std::string& name) {
            return name.empty() || name.size() > 60 || name.find(':') != std::string::npos
                       ? std::string("must have 1 to 60 characters and no ':'")
                       : std::string();
          },
          ""))
      ->type_name("NAME")
      ->capture_default_str();
  command->add_option("-g,--gain", options.gain_db, "gain in addition to the preset's")
      ->type_name("DB")
      ->check(within(-120.0, 60.0));
  command->add_option("-p,--voices", options.voices, "number of voices (default: the preset's)")
      ->check(within(1, max_voices));
  command->add_option("--threads", options.threads, "threads for voices")
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
                  "--share", "must be N/OF, such as 1/2, at most 64/64; found '" + text + "'");
            }
            options.share = {static_cast<int>(number), static_cast<int>(of)};
          },
          "play every OF-th note only; start one program for each N")
      ->type_name("N/OF");
  add_keys(*command, options.keys);
  command->add_option("-r,--rate", options.device.rate_hz, "sample rate, unless JACK sets it")
      ->type_name("HZ")
      ->check(within(8000.0, 384000.0))
      ->capture_default_str();
  command
      ->add_option("-z,--period", options.device.period_frames,
                   "period in frames, unless JACK sets it")
      ->check(within(16, 8192))
      ->capture_default_str();
  add_numbers(*command, options.precision, options.rescale);
  add_method(*command, options.method);
  add_budget(*command, options.budget);
  add_motion(*command, options.third);
  add_force(*command, options.force);
  command->add_flag("--paused", options.is_paused,
                    "let the MIDI file wait for 'song play' or /song/play");
  command->add_flag("-i,--no-console", options.no_console, "do not read console commands");
  command->add_option("-e,--execute", options.script, "file of console commands to run first")
      ->type_name("FILE");
  command
      ->add_option("--controllers", options.controllers,
                   "mapping of controllers (default: controllers.toml in ~/.config/ressort)")
      ->type_name("FILE");
  command
      ->add_option_function<std::string>(
          "-u,--osc-port",
          [&options](const std::string& text) {
            double port = 0.0;
            if (text != "off" && (!parse_number(text, port) || port < 1.0 || port > 65535.0)) {
              throw CLI::ValidationError("--osc-port", "must be 1 to 65535, or off");
            }
            options.osc.port = static_cast<int>(port);
          },
          "OSC port, or off (default 9777)")
      ->type_name("PORT");
  command
      ->add_option("--osc-reply", options.osc.reply_port,
                   "port that gets the replies to OSC, for tablets (default: the sender's)")
      ->type_name("PORT")
      ->check(within(1, 65535));
  command->add_option("-B,--osc-bind", options.osc.bind_address, "address for OSC to listen at")
      ->type_name("ADDRESS")
      ->capture_default_str();
  command
      ->add_option("--osc-allow", options.osc.allow,
                   "senders of OSC to accept: 192.168.1.23,10.0.0.0/24; required with -B")
      ->type_name("ADDRESS,...");
  command
      ->add_option("--web", options.panel.port,
                   "port of the web page that shows and plays the model")
      ->type_name("PORT")
      ->expected(0, 1)
      ->default_str(std::to_string(WebPanel::usual_port))
      ->check(within(1, 65535));
  command
      ->add_option("--web-bind", options.panel.bind_address,
                   "address of the web page; other machines need its token")
      ->type_name("ADDRESS")
      ->needs(command->get_option("--web"))
      ->capture_default_str();
  command->add_flag("--exit-on-loss", options.exit_on_loss,
                    "exit with 75 when the audio server ends, instead of waiting");
  command->add_flag("--watch", options.watch,
                    "reload the model and the preset when their files change");
}

}  // namespace ressort::command_line
