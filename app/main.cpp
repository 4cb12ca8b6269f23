// app: the command line, turned into one of the commands.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "app/commands/body/body_line.h"
#include "app/commands/check.h"
#include "app/commands/command_line.h"
#include "app/commands/commands.h"
#include "app/commands/export.h"
#include "app/commands/make.h"
#include "app/commands/manual/manual.h"
#include "app/commands/modes/modes_line.h"
#include "app/commands/reference.h"
#include "app/commands/smf/midi_file.h"
#include "app/commands/start_chart.h"
#include "app/commands/timbre/describe_line.h"
#include "app/commands/timbre/shape_model.h"
#include "app/program.h"
#include "app/version.h"
#include "core/model/language/expression.h"

namespace {

using namespace ressort;

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

const char* const render_examples =
    "A score is text, a line an event: TIME_SECONDS ADDRESS ARGUMENTS, the addresses being the\n"
    "OSC ones:\n"
    "  0.0  /note/on 69 100\n"
    "  0.5  /param/m_K 0.2\n"
    "A preset without a score plays a short phrase; a bare .mdl is the network alone: no gain, no\n"
    "smoothing, one channel for each output.\n"
    "Examples:\n"
    "  ressort render PolyTriangle -o out.wav\n"
    "  ressort render 20x30mesh --midi song.mid -o song.flac\n"
    "  ressort render my.mdl -o out.wav --input gesture.wav --format double\n"
    "  ressort render --all-presets -o sounds      then look at sounds/index.html\n";

const char* const make_examples =
    "KIND, and the points along each side, the fixed ones included:\n"
    "  string N         a row, both ends fixed    chain N          a row without fixed ends\n"
    "  stiffString N    with K2 to the next but one\n"
    "  mesh N N         a free rectangle          closedMesh N N   its border fixed\n"
    "  cornerMesh N N   its corners fixed\n"
    "  triangle N       N points a side: N(N+1)/2 points, 3N(N-1)/2 links\n"
    "  hexagon N        N rings around a point: 1+3N(N+1) points, 9N^2+3N links\n"
    "Numbers are per sample at 44100 Hz: a mass M on a spring K swings at 7000 sqrt(K/M) Hz. What\n"
    "nothing fixes is held by one more ground, so that a push does not send it away for good.\n"
    "Examples:\n"
    "  ressort make string 50 -o my.mdl            then: ressort play my.mdl\n"
    "  ressort make hexagon 6 --name drum -K 0.2   to be read, or pasted into a model\n"
    "  ressort make closedMesh 150 150 --macro     the same as one line\n";

const char* const check_examples =
    "Every problem is told at once, as FILE:LINE:COLUMN: error|warning: what, and what was\n"
    "expected; then what the model has, how it will be computed, and whether it is stable.\n"
    "Examples:\n"
    "  ressort check my.mdl\n"
    "  ressort check my.mdl --json\n"
    "  ressort check old.mdl --print > new.mdl\n";

const char* const chart_examples =
    "How much computing buys how much accuracy: for each scene every method, precision and "
    "budget,\n"
    "and the direct method at 2, 4 and 8 times the rate, is timed (one core, all in turns, the\n"
    "fastest of several) and held against two reference solutions: the published scheme in long "
    "double, and "
    "the\n"
    "continuous network with the same M, K and Z. A mark nearer to the lower left corner is "
    "better;\n"
    "the grey stairs join what nothing beats; a red cross on the top edge says that this way "
    "blows\n"
    "up or gains energy when the scene is hit hard or its parameters are at their ends.\n"
    "In DIR: chart.csv, whose first lines say what its columns mean; SCENE.svg, SCENE.png and an\n"
    "overview, where gnuplot is installed; chart.gp, to draw them again. Leave the machine alone\n"
    "while it measures. Ctrl-C keeps the scenes that are complete.\n"
    "Without a MODEL the reference scenes: triangle, string50, string150, BowedString,\n"
    "1000massString, 20x30mesh, PhysicalLFO, ball, stiffContact.\n"
    "Examples:\n"
    "  ressort chart -o chart                      some minutes\n"
    "  ressort chart string50 my.mdl -o chart      two scenes\n";

const char* const export_examples =
    "FAUST (faust.grame.fr) makes plugins, web pages and programs for boards of it. A slider for\n"
    "each parameter, the preset's range where there is one; input and output N of the model are\n"
    "channel N. It is the network alone: no notes, no gain. It computes what 'ressort render' of\n"
    "the bare .mdl does, sample by sample, at every rate; give faust -double for long decays.\n"
    "Examples:\n"
    "  ressort export PolyTriangle --to faust -o triangle.dsp\n"
    "  faust2jaqt triangle.dsp && ./triangle\n";

void add_method(CLI::App& command, std::optional<Method>& method) {
  std::map<std::string, Method> methods;
  std::vector<std::string> words = {"auto"};
  for (const auto use : {KernelRow::Use::published, KernelRow::Use::physical}) {
    for (const Method known : methods_for(use)) {
      words.emplace_back(method_name(known));
      methods[words.back()] = known;
    }
  }
  command
      .add_option_function<std::string>(
          "--method",
          [&method, methods](const std::string& word) {
            if (const auto known = methods.find(word); known != methods.end()) {
              method = known->second;
            }
          },
          "how each part is computed, where it can be: auto takes what is fastest, but for a\n"
          "bare model direct, which is the published scheme bit for bit on every machine; fourth\n"
          "is true to the continuous network instead")
      ->check(CLI::IsMember(words))
      ->type_name("WORD");
}

void add_budget(CLI::App& command, std::optional<Budget>& budget) {
  command
      .add_option_function<std::string>(
          "--budget",
          [&budget](const std::string& text) {
            const auto parsed = parse_budget(text);
            if (!parsed) {
              throw CLI::ValidationError("--budget", parsed.error().message);
            }
            budget = *parsed;
          },
          "how far the sound may be from the continuous network, and what may be left out:\n"
          "'cents=3 t60=5 silence=-60 passive=auto'; cents of pitch, % of decay, dB below the\n"
          "peak of the unreduced output over its whole life, and whether contacts may not gain\n"
          "energy: auto, always, never. Without it what the preset says, else the published\n"
          "scheme for all that is linear. Cents and % that cannot be kept are told, with how far\n"
          "off it is")
      ->type_name("TEXT");
}

void add_strict(CLI::App& command, bool& is_strict) {
  command.add_flag(
      "--strict", is_strict,
      "a budget of cents or t60 that is not kept, or of which nobody knows whether it\n"
      "is, and a bow that is too strong for its steps are errors: exit code 2 instead of\n"
      "a warning");
}

// How the network is computed, for every command that computes it.
void add_numbers(CLI::App& command, Precision& precision, bool& rescale) {
  add_choice<Precision>(command, "--precision", precision,
                        {{"double", Precision::float64},
                         {"float", Precision::float32},
                         {"compensated", Precision::compensated32}},
                        "of the computation; compensated is float with twice the digits where\n"
                        "positions are added up, for what moves little and far from 0");
  command.add_flag_callback(
      "--no-rescale", [&rescale] { rescale = false; },
      "take the model's numbers raw at rates other than 44100 Hz");
}

// What is said of keys, instead of what the preset says.
void add_keys(CLI::App& command, KeyOptions& keys) {
  command.add_option("--tuning", keys.scale, "a Scala file, NAME.scl: the steps between keys");
  command.add_option("--keyboard-map", keys.keyboard_map,
                     "a Scala keyboard map, NAME.kbm: which key plays which step, at what pitch");
  command
      .add_option_function<double>(
          "--a4", [&keys](const double& hz) { keys.a4_hz = hz; },
          "the pitch of the A above the middle C, to which all is tuned (440)")
      ->check(within(220.0, 880.0));
}

void add_force(CLI::App& command, bool& force) {
  command.add_flag("--force", force,
                   "play a model that is not stable all the same; what runs away fades out");
}

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
          "the MIDI channels to listen to, divided by commas, whatever the preset says")
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

struct RenderChoice {
  RenderOptions options;
  bool all_presets = false;
  double seconds = 0.0;
  long long frames = 0;
  bool is_quiet = false;
};

void add_render(CLI::App& app, RenderChoice& choice, int& code) {
  RenderOptions& options = choice.options;
  CLI::App* command = app.add_subcommand("render", "renders a model or a preset to a sound file");
  command->footer(render_examples);
  CLI::Option* model = command->add_option(
      "MODEL", options.name,
      "a preset's or a model's name, or a file; or a .ressort flight, of which\n"
      "the last 30 s are rendered, or the last --seconds");
  std::string endings;
  for (const std::string_view ending : sound_endings()) {
    endings += (endings.empty() ? "" : " ") + std::string(ending);
  }
  command
      ->add_option("-o,--output", options.output,
                   "the sound file, written over if it is there; its ending says which: " + endings)
      ->required();
  CLI::Option* seconds =
      command->add_option("-s,--seconds", choice.seconds, "how long")->check(within(0.0, 86400.0));
  CLI::Option* frames = command->add_option("--frames", choice.frames, "how long, in samples")
                            ->check(within(0.0, 1e10))
                            ->excludes(seconds);
  command->add_option("-r,--rate", options.rate_hz, "Hz")
      ->check(within(1000.0, 768000.0))
      ->capture_default_str();
  command->add_option("--input", options.input, "a sound file; its channel n drives input n");
  command->add_option("--score", options.score, "a file of events");
  command->add_option("--midi", options.midi,
                      "a Standard MIDI File, type 0 or 1; it ends when it has fallen silent");
  add_settings(*command, options.parameters);
  command
      ->add_option_function<std::string>(
          "--format",
          [&options](const std::string& word) {
            options.format = word == "float"    ? SampleFormat::float32
                             : word == "double" ? SampleFormat::float64
                                                : SampleFormat::pcm24;
          },
          "of the file's samples; without it float, or pcm24 in a .flac")
      ->check(CLI::IsMember({"float", "double", "pcm24"}))
      ->type_name("WORD");
  add_numbers(*command, options.precision, options.rescale);
  add_method(*command, options.method);
  add_budget(*command, options.budget);
  add_strict(*command, options.is_strict);
  add_motion(*command, options.third);
  add_force(*command, options.force);
  command->add_option("-p,--voices", options.voices, "how many notes sound at once")
      ->check(within(1, max_voices));
  add_keys(*command, options.keys);
  command->add_option("--threads", options.threads, "for large networks; without it, all cores")
      ->check(within(1, 1024));
  command->add_flag("--limit", options.limit, "keep below full scale, 1 ms late");
  command->add_flag(
      "--all-presets", choice.all_presets,
      "every preset, a phrase and a note of each, into the folder -o; index.html there\n"
      "shows their envelopes, spectrograms and figures, spectra.svg is a picture of\n"
      "all; of the other options it takes -r and -q");
  command->add_flag("-q,--quiet", choice.is_quiet, "say nothing unless something is wrong");
  command->callback([&choice, command, model, seconds, frames, &code] {
    if (choice.all_presets) {
      const std::set<std::string> taken = {"all-presets", "output", "rate", "quiet"};
      for (const CLI::Option* option : command->get_options()) {
        if (option->count() > 0 && !taken.contains(option->get_single_name())) {
          throw CLI::ExcludesError("--all-presets", option->get_name());
        }
      }
      code = gallery_command({choice.options.output, choice.options.rate_hz, choice.is_quiet});
      return;
    }
    if (model->count() == 0) {
      throw CLI::RequiredError("MODEL");
    }
    if (seconds->count() > 0) {
      choice.options.seconds = choice.seconds;
    }
    if (frames->count() > 0) {
      choice.options.frames = choice.frames;
    }
    code = render_command(choice.options, choice.is_quiet);
  });
}

void add_make(CLI::App& app, MakeOptions& options, std::vector<std::uint32_t>& sizes, int& code) {
  Shape& shape = options.shape;
  CLI::App* command = app.add_subcommand("make", "writes a model: a string, a mesh, a triangle...");
  command->footer(make_examples);
  add_choice<ShapeKind>(*command, "KIND", shape.kind,
                        {{"string", ShapeKind::string},
                         {"stiffString", ShapeKind::stiff_string},
                         {"chain", ShapeKind::chain},
                         {"mesh", ShapeKind::mesh},
                         {"closedMesh", ShapeKind::closed_mesh},
                         {"cornerMesh", ShapeKind::corner_mesh},
                         {"triangle", ShapeKind::triangle},
                         {"hexagon", ShapeKind::hexagon}},
                        "of shape")
      ->required();
  command->add_option("N", sizes, "one size, or a mesh's two")->required()->expected(1, 2);
  command->add_option("--name", shape.name, "stands before every label: NAME_m0, NAME_K")
      ->capture_default_str();
  command->add_option("-M,--mass", shape.mass, "of every point, above 0")->capture_default_str();
  command->add_option("-K,--stiffness", shape.stiffness, "of every link, force per position")
      ->capture_default_str();
  command->add_option("--K2", shape.second_stiffness, "of a stiffString's second links")
      ->capture_default_str();
  command->add_option("-Z,--damping", shape.damping, "of every link, force per position a sample")
      ->capture_default_str();
  command->add_option("--Zo", shape.air_damping, "damping of every point against the air")
      ->capture_default_str();
  command->add_option("--position", shape.position, "where every point rests")
      ->capture_default_str();
  add_choice<FixedPoints>(*command, "--fixed", shape.fixed,
                          {{"corners", FixedPoints::corners},
                           {"border", FixedPoints::border},
                           {"none", FixedPoints::none}},
                          "what holds a triangle or hexagon");
  command->add_flag("--macro", shape.as_macro, "one line instead of every mass and link");
  command->add_flag_callback(
      "--bare", [&shape] { shape.with_io = false; },
      "without @in1, a force, and @out1, a position");
  command->add_option("-o,--output", options.output, "the file; without it, the screen");
  add_overwrite(*command, options.force);
  command->callback([&options, &sizes, &code] {
    options.shape.length = sizes[0];
    options.shape.width = sizes.size() > 1 ? sizes[1] : 0;
    code = make(options);
  });
}

void add_check(CLI::App& app, CheckOptions& options, int& code) {
  CLI::App* command =
      app.add_subcommand("check", "reads a model or a preset and says what it found");
  command->footer(check_examples);
  command->add_option("FILE", options.name, "a file, or a preset's or model's name")->required();
  CLI::Option* json = command->add_flag_callback(
      "--json", [&options] { options.as = CheckAs::json; }, "for machines, errors included");
  command
      ->add_flag_callback(
          "--print", [&options] { options.as = CheckAs::model; },
          "nothing but the model, as text in one clean dialect")
      ->excludes(json);
  add_motion(*command, options.third);
  add_method(*command, options.method);
  add_budget(*command, options.budget);
  add_strict(*command, options.is_strict);
  command->callback([&options, &code] { code = check(options); });
}

void add_chart(CLI::App& app, ChartOptions& options, int& code) {
  CLI::App* command =
      app.add_subcommand("chart", "draws what every way of computing costs and how right it is");
  command->footer(chart_examples);
  command->add_option("MODEL", options.scenes, "reference scenes, presets, models, or files");
  command->add_option("-o,--output", options.folder, "the folder for it all")->required();
  command->add_option("-t,--time", options.patience_s, "seconds to time each scene for")
      ->check(within(0.1, 3600.0))
      ->capture_default_str();
  command->callback([&options, &code] { code = start_chart(options); });
}

void add_export(CLI::App& app, ExportOptions& options, int& code) {
  CLI::App* command = app.add_subcommand("export", "writes a model in another language");
  command->footer(export_examples);
  command->add_option("MODEL", options.name, "a preset's or a model's name, or a file")->required();
  command
      ->add_option_function<std::string>(
          "--to", [](const std::string&) {}, "the language")
      ->check(CLI::IsMember({"faust"}))
      ->required();
  command->add_option("-o,--output", options.output, "the file; without it, the screen");
  add_overwrite(*command, options.force);
  command->add_flag_callback(
      "--no-rescale", [&options] { options.rescale = false; },
      "take the model's numbers raw at rates other than 44100 Hz");
  add_motion(*command, options.third);
  command->callback([&options, &code] { code = export_to_faust(options); });
}

void add_reference(CLI::App& app, std::string& part, int& code) {
  CLI::App* command = app.add_subcommand("reference", "prints a table of the manual");
  std::vector<std::string> names;
  std::string footer = "PART:";
  for (const ReferencePart& known : reference_parts()) {
    names.emplace_back(known.name);
    footer += "\n  " + names.back() + std::string(10 - names.back().size(), ' ') +
              std::string(known.lists);
  }
  command->footer(footer);
  // For who installs the program.
  names.insert(names.end(), {"man", "completion", "names"});
  command->add_option("PART", part, "which")->required()->check(CLI::IsMember(names));
  command->callback([&app, &part, &code] {
    code = part == "man"          ? print_man(app)
           : part == "completion" ? print_completion(app)
           : part == "names"      ? print_names()
                                  : reference(part);
  });
}

int run(int argc, char** argv) {
  CLI::App app{"ressort plays networks of masses and springs, read from .mdl files."};
  app.footer(
      "Start with 'ressort play', then type 'help' at its prompt.\n"
      "'ressort COMMAND --help' tells more of each command.\n"
      "Exit codes: 0 done, 1 our failure, 2 wrong use or unreadable input, 75 no audio.");
  app.set_version_flag("-V,--version", std::string("ressort ") + version + ", commit " + commit);
  app.name("ressort");
  app.require_subcommand(0, 1);
  int code = exit_code::done;
  PlayOptions play_options;
  RenderChoice render_choice;
  CheckOptions check_options;
  ExportOptions export_options;
  BodyRequest body_request;
  ModesOptions modes_options;
  DescribeOptions describe_options;
  ShapeOptions shape_options;
  MakeOptions make_options;
  ChartOptions chart_options;
  std::vector<std::uint32_t> make_sizes;
  std::string reference_part;
  add_play(app, play_options, code);
  add_render(app, render_choice, code);
  add_check(app, check_options, code);
  add_make(app, make_options, make_sizes, code);
  add_export(app, export_options, code);
  add_modes(app, modes_options, code);
  add_describe(app, describe_options, describe_command, code);
  add_shape(app, shape_options, shape_command, code);
  add_body(app, body_request, code);
  add_chart(app, chart_options, code);
  add_reference(app, reference_part, code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? exit_code::done : exit_code::wrong_use;
  }
  if (app.get_subcommands().empty() && std::getenv("NSM_URL") != nullptr) {
    return play(play_options);  // a session manager starts programs by their names alone
  }
  if (app.get_subcommands().empty()) {
    std::fprintf(stderr, "%s", app.help().c_str());
    return exit_code::wrong_use;
  }
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  return run_program(run, argc, argv);
}
