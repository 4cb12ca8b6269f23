#!/bin/sh
# Checks that the engine compiles for 64-bit ARM, whose vectors are as wide as those of the base level. It
# is not run. Skipped (77) without the cross compiler.
#
#   tests/arm.sh SOURCE
set -eu
cd "$1"
compiler=aarch64-linux-gnu-g++
command -v $compiler >/dev/null || exit 77
printf '%s\n' $(find core/kernels core/engine -name "*.cpp") |
  xargs -P 2 -I FILE $compiler -std=c++20 -fsyntax-only -Wall -Wextra -Wconversion \
    -Wno-missing-field-initializers -Wno-psabi -Werror -DRESSORT_ISA=base -I. FILE
