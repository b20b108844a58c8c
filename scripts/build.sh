#!/usr/bin/env bash
# build.sh PRESET: configures when needed and builds one preset of CMakePresets.json. Prints its output only when it fails
# or when stdout is a terminal.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly PRESET=$1
readonly LOG=build/build-$PRESET.log
mkdir -p build

configure=("${CMAKE:-cmake}" --preset "$PRESET")
build=("${CMAKE:-cmake}" --build --preset "$PRESET" -j "${JOBS:-$(nproc)}")

if ! "${configure[@]}" >"$LOG" 2>&1; then
  # A cache written by another cmake, generator or checkout cannot be repaired by configuring again.
  if ! "${configure[@]}" --fresh >"$LOG" 2>&1; then
    cat "$LOG" >&2
    exit 1
  fi
fi
if [ -t 1 ]; then
  exec "${build[@]}"
fi
echo "build: preset $PRESET (log: $LOG)"
if ! "${build[@]}" >>"$LOG" 2>&1; then
  # ninja's own progress lines carry no news here.
  grep -v '^\[[0-9]*/[0-9]*\] \(Building\|Linking\)' "$LOG" >&2 || true
  exit 1
fi
