#!/bin/sh
# Checks 64-bit ARM, whose vectors are as wide as those of the base level: the engine compiles without
# warnings. With qemu and the arm64 libraries (see app/packaging/arm64.cmake), the script also builds
# the program and its package, and compares renders of presets with those of this machine's program:
# they agree within -120 dB of the peak. Skipped (77) without the cross compiler.
#
#   tests/arm.sh SOURCE BUILD [PRESET...]
set -eu
cd "$1"
build=$2
shift 2
compiler=aarch64-linux-gnu-g++
command -v $compiler >/dev/null || exit 77
printf '%s\n' $(find core/kernels core/engine -name "*.cpp") |
  xargs -P 2 -I FILE $compiler -std=c++20 -fsyntax-only -Wall -Wextra -Wconversion \
    -Wno-missing-field-initializers -Wno-psabi -Werror -DRESSORT_ISA=base -I. FILE
qemu=$(command -v qemu-aarch64-static || command -v qemu-aarch64 || true)
if [ -z "$qemu" ] || [ ! -e /usr/lib/aarch64-linux-gnu/libjack.so ]; then
  echo "the engine compiles; not built and not run, without qemu or without arm64 libraries"
  exit
fi

arm=$build/arm64
[ -f "$arm/CMakeCache.txt" ] || cmake -G Ninja -S . -B "$arm" -DRESSORT_TESTS=OFF \
  -DCMAKE_TOOLCHAIN_FILE=app/packaging/arm64.cmake \
  -DCMAKE_CXX_COMPILER_LAUNCHER="$(command -v ccache || true)" >/dev/null
cmake --build "$arm" >/dev/null
(cd "$arm" && cpack >/dev/null)
dpkg --info "$arm"/ressort_*_arm64.deb | grep -q 'Depends:.*libjack' || {
  echo "the package has no dependencies"
  exit 1
}

[ $# -gt 0 ] || set -- PolyTriangle Marimba Guitar Violin ChurchBell
place=$(mktemp -d)
trap 'rm -r "$place"' EXIT
for preset; do
  # The contacts of the sitar's bridge multiply rounding errors: on one machine, another last digit of
  # `buzz` changes the sound by -146 dB after 0.5 s and by -82 dB after 1.5 s.
  [ "$preset" = Sitar ] && seconds=0.5 || seconds=1.5
  "$build/ressort" render "$preset" -q --format double --seconds $seconds -o "$place/here.wav"
  "$qemu" "$arm/ressort" render "$preset" -q --format double --seconds $seconds -o "$place/arm.wav"
  python3 - "$preset" "$place/here.wav" "$place/arm.wav" <<'END'
import array, math, sys

def samples(path):
    data = open(path, "rb").read()
    at = data.index(b"data") + 8
    return array.array("d", data[at:at + (len(data) - at) // 8 * 8])

here, arm = samples(sys.argv[2]), samples(sys.argv[3])
peak = max(map(abs, here))
worst = max(abs(a - b) for a, b in zip(here, arm)) if len(here) == len(arm) else peak
db = 20 * math.log10(worst / peak) if worst > 0 else -math.inf
print(f"{sys.argv[1]}: {db:.1f} dB")
sys.exit(not (peak > 1e-4 and db < -120))
END
done
