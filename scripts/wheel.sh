#!/usr/bin/env bash
# wheel.sh [PYTHON...]: dist/oted-*.whl, one wheel for each interpreter (default: that of .venv). A wheel of Python 3.12
# serves all later ones. It runs on Linux with at least this machine's glibc, without a compiler and without these Debian
# packages: auditwheel copies their libraries into it. MuJoCo's library stays in the package mujoco-core.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/wheel_tools.sh

scripts/setup.sh build
wheel_tools
build_wheels . "${@:-.venv/bin/python}"
ls -l dist/*.whl
