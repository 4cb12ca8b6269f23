#!/bin/sh
# Checks the dependencies between the rooms (folders) of the code. Prints and fails on every #include
# that the table below does not allow, and on every room whose namespace can use the names of more or
# fewer rooms than the table says. First tests itself on a list of violations.
#
#   rooms.sh [ROOT]      ROOT contains core/ and app/ (default: the folder above this one).
set -eu
root=${1:-$(dirname -- "$0")/..}
cd -- "$root"

# Reads "file:line:#include <what>", "file:line:namespace ressort::room" and, of the directives in
# rooms.h, "file:line:room finds room", and prints the lines that break a rule. With complete=1 the
# input has all directives, and missing ones are printed too.
judge() {
  awk -v complete="${1:-0}" '
    function starts(text, prefix) { return index(text, prefix) == 1 }
    function refuse(reason) { if (why == "") why = reason }
    function may_see(room, target, what,    i, count, rooms) {
      count = split(sees[room], rooms, " ")
      for (i = 1; i <= count; ++i) if (rooms[i] == target || rooms[i] == what) return 1
      return 0
    }
    function folder(room) { return (("core/" room) in sees ? "core/" : "app/") room }
    BEGIN {
      # Standard headers forbidden in core: streams, files, threads, clocks.
      split("iostream fstream ostream istream thread atomic mutex shared_mutex condition_variable " \
            "future stop_token semaphore latch barrier filesystem chrono ctime", words, " ")
      for (i in words) impure[words[i]] = 1
      # Libraries, each with the only place that may include it.
      owner["jack/"] = "app/devices/jack.cpp"
      owner["alsa/"] = "app/devices/alsa.cpp"
      owner["RtMidi.h"] = "app/devices/rtmidi.cpp"
      owner["rtmidi/"] = "app/devices/rtmidi.cpp"
      owner["lo/"] = "app/control/osc/packet.cpp"
      owner["sndfile"] = "app/session/sound_file.cpp"
      owner["histedit.h"] = "app/control/terminal.cpp"
      owner["editline/"] = "app/control/terminal.cpp"
      owner["ebur128.h"] = "app/commands/gallery/sound.cpp"
      owner["httplib.h"] = "app/panel/panel.cpp"
      owner["CLI/"] = "app/command_line/"
      owner["atomic"] = "app/realtime/lockfree.h"
      owner["toml++/"] = "core/model/"
      owner["Eigen/"] = "core/linear_algebra/"
      owner["unsupported/Eigen/"] = "core/linear_algebra/"
      owner["Spectra/"] = "core/linear_algebra/"
      # The rooms that each room may include: the folders of core and app, and "core" and "app" for files
      # outside of them.
      sees["core"] = "core"
      sees["core/laws"] = "core core/laws"
      sees["core/linear_algebra"] = "core core/linear_algebra"
      sees["core/model"] = "core core/laws core/model"
      sees["core/analysis"] = "core core/laws core/linear_algebra core/model core/analysis"
      sees["core/identification"] = "core core/linear_algebra core/kernels/isa.h core/identification"
      sees["core/solids"] = "core core/linear_algebra core/solids"
      sees["core/kernels"] = "core/rooms.h core/lanes.h core/groups.h core/sampled_mode.h core/waveguide_places.h core/formula.h core/progress.h core/model/preset/budget.h " \
                             "core/laws core/linear_algebra core/kernels"
      sees["core/engine"] = "core/rooms.h core/lanes.h core/curve.h core/formula.h core/progress.h core/gesture.h core/stroke.h core/precision.h " \
                            "core/input_driver.h core/random.h core/noise.h core/lfo.h core/midi_number.h core/laws core/kernels core/engine"
      sees["core/compile"] = "core core/laws core/linear_algebra core/model core/analysis core/kernels " \
                             "core/engine core/compile"
      all = sees["core/compile"]
      sees["app/realtime"] = "core/controller.h core/knob_range.h core/midi_number.h core/engine core/kernels app app/realtime"
      sees["app/devices"] = "core/result.h core/engine core/kernels app app/realtime app/devices"
      sees["app/session"] = all " app app/realtime app/session app/control/registry.h"
      sees["app/control"] = all " app app/realtime app/devices app/session app/control"
      sees["app/panel"] = sees["app/control"] " app/panel"
      sees["app/plot"] = "core/result.h core/ranges.h app app/plot"
      sees["app/commands"] = sees["app/panel"] " core/identification core/solids app/plot app/commands"
      sees["app/command_line"] = sees["app/commands"] " app/command_line"
      sees["app"] = sees["app/command_line"]
    }
    {
      line = $0
      why = ""
      colon = index(line, ":")
      file = substr(line, 1, colon - 1)
      what = line
      if (!sub(/^[^#]*#[ \t]*include[ \t]*[<"]/, "", what)) refuse("an include that cannot be read")
      sub(/[>"].*/, "", what)
      ours = line ~ /#[ \t]*include[ \t]*"/
      room = file
      if (!match(room, /^(core|app)\/[^\/]*\//)) match(room, /^[^\/]*\//)
      room = substr(room, 1, RLENGTH - 1)
      if (match(line, /:[a-z_]+ finds [a-z_]+$/)) {
        split(substr(line, RSTART + 1), words, " ")
        finds[folder(words[1]), folder(words[3])] = line
        next
      }
      if (match(line, /:namespace ressort[a-z_:]*/)) {
        target = substr(line, RSTART, RLENGTH)
        if (room ~ /\// && !sub(/^:namespace ressort::/, "", target)) target = "nothing"
        sub(/:.*/, "", target)
        if (room ~ /\// && !may_see(room, folder(target), "")) {
          print line ": " room " is in ressort::" substr(room, index(room, "/") + 1)
        }
        next
      }
      for (prefix in owner) {
        if (!ours && (prefix == "atomic" ? what == prefix : starts(what, prefix)) &&
            !starts(file, owner[prefix])) {
          refuse("only " owner[prefix] " may see <" prefix ">")
        }
      }
      if (ours) {
        target = what
        if (match(target, /^(core|app)\/[^\/]*\//)) {
          target = substr(target, 1, RLENGTH - 1)
        } else if (target ~ /^core\/(rooms|ranges|format|result|formula|progress|groups|lanes|curve|sampled_mode|waveguide_places|raised_cosine|gesture|stroke|precision|input_driver|random|noise|lfo|controller|knob_range|midi_number)[.]h$/) {
          target = "core"
        } else if (target ~ /^app\/[^\/]*$/) {
          target = "app"
        }
        if (!may_see(room, target, what)) refuse(room " may not see " what)
      } else if (starts(file, "core/")) {
        if (what in impure) refuse("core knows no streams, files, threads or clocks")
        if (what !~ /^[a-z_0-9]+$/ && !starts(what, "toml++/") && !starts(what, "Eigen/") &&
            !starts(what, "unsupported/Eigen/") && !starts(what, "Spectra/")) {
          refuse("core knows the standard library only")
        }
      }
      if (file ~ /^app\/realtime\/(process|dsp_load|lockfree|midi|controllers|tick_clock|song_clock)[.]/ && what in impure && what != "atomic") {
        refuse("the audio thread knows no streams, files, locks or clocks")
      }
      if (why != "") print line ": " why
    }
    END {
      # Transitive closure of the names that a room can use.
      do {
        grown = 0
        for (one in finds) {
          split(one, a, SUBSEP)
          for (other in finds) {
            split(other, b, SUBSEP)
            if (b[1] == a[2] && !((a[1], b[2]) in finds)) {
              finds[a[1], b[2]] = finds[one]
              grown = 1
            }
          }
        }
      } while (grown)
      for (one in finds) {
        split(one, a, SUBSEP)
        # A room that may include kernels may include laws.
        if (a[2] != "core/laws" && !may_see(a[1], a[2], "")) {
          print finds[one] ": " a[1] " may not see " a[2]
        }
      }
      for (room in sees) {
        count = complete ? split(sees[room], rooms, " ") : 0
        for (i = 1; i <= count; ++i) {
          if (room ~ /\// && (rooms[i] in sees) && rooms[i] ~ /\// && rooms[i] != room &&
              !((room, rooms[i]) in finds) &&
              !(room == "core/kernels" && rooms[i] == "core/linear_algebra")) {
            print "rooms.h: " room " does not find " rooms[i]
          }
        }
      }
    }'
}

includes() {
  find core app -name '*.h' -o -name '*.cpp' | LC_ALL=C sort |
    xargs grep -n '^[[:space:]]*#[[:space:]]*include' /dev/null
}

# The namespace declarations of files.
namespaces() {
  find core app -name '*.h' -o -name '*.cpp' | LC_ALL=C sort |
    xargs grep -n '^namespace ressort' /dev/null
}

# The using directives of each room.
directives() {
  awk '/^namespace [a-z_]+ \{/ { room = $2 }
    /^using namespace/ { sub(/;/, "", $3); print FILENAME ":" FNR ":" room " finds " $3 }' \
    core/rooms.h app/rooms.h
}

forbidden='core/result.h:1:#include "core/model/network.h"
core/model/language/mdl.cpp:1:#include "core/engine/engine.h"
core/model/language/mdl.cpp:1:#include <iostream>
core/model/language/mdl.cpp:1:#include <Eigen/Dense>
core/model/language/mdl.cpp:1:#include "app/session/files.h"
core/analysis/linear.cpp:1:#include "core/kernels/program.h"
core/solids/surface.cpp:1:#include "core/model/network.h"
core/compile/compile.cpp:1:#include "core/solids/surface.h"
app/session/session.cpp:1:#include "core/solids/surface.h"
core/analysis/linear.cpp:1:#include <toml++/toml.h>
core/analysis/linear.cpp:1:#include <Eigen/Dense>
core/linear_algebra/general.cpp:1:#include "core/model/network.h"
core/engine/engine.cpp:1:#include "core/model/network.h"
core/engine/engine.cpp:1:#include "core/result.h"
core/engine/engine.cpp:1:#include "core/compile/compile.h"
core/kernels/direct/direct.cpp:1:#  include <immintrin.h>
core/engine/engine.cpp:1:#include <atomic>
core/engine/engine.cpp:1:#include <jack/jack.h>
core/compile/compile.cpp:1:#include <Spectra/SymEigsSolver.h>
core/compile/compile.cpp:1:#include <chrono>
core/compile/compile.cpp:1:#include "tests/support/networks/scenes.h"
core/laws/laws.h:1:#include LAWS
core/laws/spring.h:1:#include "core/model/network.h"
core/laws/laws.h:1:#include "core/kernels/program.h"
core/laws/laws.cpp:1:#include "core/compile/cost.h"
core/lanes.h:1:#include "core/laws/law.h"
core/identification/fit.cpp:1:#include "core/model/network.h"
core/identification/poles.cpp:1:#include <Eigen/Dense>
app/session/session.cpp:1:#include "app/commands/chart/ways.h"
app/session/session.cpp:1:#include <atomic>
app/session/session.cpp:1:#include <sndfile.h>
app/realtime/process.h:1:#include "app/session/session.h"
app/realtime/process.cpp:1:#include "core/model/network.h"
app/realtime/process.cpp:1:#include <mutex>
app/devices/jack.cpp:1:#include "core/compile/compile.h"
app/devices/jack.cpp:1:#include <alsa/asoundlib.h>
app/devices/alsa.cpp:1:#include <jack/jack.h>
app/control/terminal.cpp:1:#include <lo/lo.h>
app/control/osc/server.cpp:1:#include <histedit.h>
app/control/registry.cpp:1:#include "app/panel/panel.h"
app/panel/panel.cpp:1:#include "app/commands/commands.h"
app/commands/make.cpp:1:#include "app/command_line/options.h"
app/commands/check.cpp:1:#include <CLI/CLI.hpp>
app/panel/state.cpp:1:#include <httplib.h>
app/realtime/midi.cpp:1:#include <RtMidi.h>
core/model/network.h:1:namespace ressort {
core/model/network.h:1:namespace ressort::analysis {
app/realtime/midi.h:1:namespace ressort::session {
core/rooms.h:1:solids finds model
core/rooms.h:1:identification finds kernels
core/rooms.h:1:engine finds compile
app/rooms.h:1:realtime finds engine'
planted=$(printf '%s\n' "$forbidden" | wc -l)
caught=$(printf '%s\n' "$forbidden" | judge | wc -l)
if [ "$planted" -ne "$caught" ]; then
  echo "rooms.sh finds $caught of $planted planted offences:"
  printf '%s\n' "$forbidden" | judge
  exit 1
fi
for missing in 'core/rooms.h:.*:model finds laws' 'app/rooms.h:.*:session finds realtime'; do
  if ! directives | grep -v "$missing" | judge 1 | grep -q 'does not find'; then
    echo "rooms.sh does not miss $missing"
    exit 1
  fi
done

# Checks the folders beside the rooms. Works in a checkout only, because other copies may contain
# other files.
if git rev-parse --is-inside-work-tree >/dev/null 2>&1; then
  strangers=$(git ls-files | sed 's|/.*||' | sort -u |
    grep -vx -e '\..*' -e CMakeLists.txt -e app -e core -e models -e presets -e tests -e README.md ||
    true)
  if [ -n "$strangers" ]; then
    printf 'does not belong to the top level: %s\n' "$strangers"
    exit 1
  fi
fi

looked_at=$(includes | wc -l)
if [ "$looked_at" -lt 50 ]; then
  echo "rooms.sh: found only $looked_at includes under $(pwd)/core and app"
  exit 1
fi
offences=$(includes | judge && namespaces | judge && directives | judge 1)
if [ -n "$offences" ]; then
  printf '%s\n' "$offences"
  exit 1
fi
echo "$looked_at includes and $(directives | wc -l) namespaces, every one allowed"
