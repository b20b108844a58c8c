#!/usr/bin/env bash
# wheel.sh [PYTHON...]: dist/oted-*.whl, one wheel for each interpreter (default: that of .venv). A wheel of Python 3.12
# serves all later ones. It runs on Linux with at least this machine's glibc, without a compiler and without these Debian
# packages: auditwheel copies their libraries into it. MuJoCo's library stays in the package mujoco-core.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly TOOLS=build/wheel-tools
readonly RAW=build/wheel-raw
scripts/setup.sh build
[ -x "$TOOLS/bin/auditwheel" ] || {
  .venv/bin/python -m venv "$TOOLS"
  "$TOOLS/bin/python" -m pip install --quiet --no-input -r requirements-wheel.txt
}
rm -rf "$RAW"
for python in "${@:-.venv/bin/python}"; do
  echo "wheel: building with $("$python" --version) (log: build/wheel.log)"
  # The compiler by the name that CMake gives it: ccache then knows what `make build` compiled.
  CXX=${CXX:-c++} "$python" -m pip wheel . --no-deps --no-input -w "$RAW" >build/wheel.log 2>&1 || {
    tail -n 30 build/wheel.log >&2
    exit 1
  }
done
mkdir -p dist
for wheel in "$RAW"/*.whl; do
  PATH="$PWD/$TOOLS/bin:$PATH" "$TOOLS/bin/auditwheel" repair --strip --exclude 'libmujoco.so.*' -w dist "$wheel" \
    >>build/wheel.log 2>&1 || {
    tail -n 30 build/wheel.log >&2
    exit 1
  }
done
ls -l dist/*.whl
