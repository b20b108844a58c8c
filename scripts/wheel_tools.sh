# shellcheck shell=bash
# What wheel.sh and release.sh share: sourced from the repository's root.

readonly TOOLS=build/wheel-tools
readonly RAW=build/wheel-raw

# An environment of its own for the tools, anew where requirements-wheel.txt has changed.
wheel_tools() {
  cmp -s requirements-wheel.txt "$TOOLS/requirements-wheel.txt" && return
  rm -rf "$TOOLS"
  .venv/bin/python -m venv "$TOOLS"
  "$TOOLS/bin/python" -m pip install --quiet --no-input -r requirements-wheel.txt
  cp requirements-wheel.txt "$TOOLS/"
}

# build_wheels SOURCE PYTHON...: a wheel of the folder or archive SOURCE for each interpreter, into dist.
build_wheels() {
  local source=$1 python wheel
  shift
  rm -rf "$RAW"
  for python in "$@"; do
    echo "wheel: building with $("$python" --version) (log: build/wheel.log)"
    # The compiler by the name that CMake gives it: ccache then knows what `make build` compiled.
    CXX=${CXX:-c++} "$python" -m pip wheel "$source" --no-deps --no-input -w "$RAW" >build/wheel.log 2>&1 || {
      tail -n 30 build/wheel.log >&2
      return 1
    }
  done
  mkdir -p dist
  for wheel in "$RAW"/*.whl; do
    PATH="$PWD/$TOOLS/bin:$PATH" "$TOOLS/bin/auditwheel" repair --strip --exclude 'libmujoco.so.*' -w dist "$wheel" \
      >>build/wheel.log 2>&1 || {
      tail -n 30 build/wheel.log >&2
      return 1
    }
  done
}
