#!/usr/bin/env bash
# setup.sh [build|cuda|test|slurm|fuzz]: sets up what a command needs, and is quick when nothing is missing: "build" what the
# program needs, "cuda" torch beside it, "test" (the default) all that tests and lint need, "slurm" Slurm for its test (3.5 MB),
# "fuzz" clang with libFuzzer (47 MB).
#   Debian packages   through apt when root or passwordless sudo is at hand, otherwise prints the command and fails;
#                     on a bare Debian 12 about 115 MB of downloads for the build, 48 MB where there is a compiler. The tests
#                     need 240 MB more: 150 MB for Chromium and what it draws on, 40 MB for clang-format, 35 MB for Mesa's
#                     software OpenGL
#   .venv             a project-local Python environment. For the build 20 MB: the pinned wheels of requirements.txt without
#                     their dependencies. For the tests requirements-test.txt and, again alone, requirements-models.txt:
#                     400 MB more (1.6 GB on disk) with a CPU build of torch, 2.9 GB (6 GB) with a CUDA build
# PYTHON=... chooses the interpreter (3.11 or newer), CMAKE=... the cmake (3.25 or newer).
# The output of apt and pip goes to build/setup-*.log.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly PURPOSE=${1:-test}
readonly VENV=.venv
readonly STAMP=$VENV/.oted-setup-$PURPOSE
readonly LOGS=build
# A shared environment's settings must not leak into the project's own.
unset PYTHONHOME PYTHONPATH VIRTUAL_ENV

fail() {
  printf 'setup: %s\n' "$*" >&2
  exit 1
}

# run_logged LABEL LOG COMMAND...: one progress line on the terminal, everything else in LOG.
run_logged() {
  local label=$1 log=$2 started=$SECONDS pid status=0
  shift 2
  printf 'setup: %s (log: %s) ...' "$label" "$log"
  "$@" >"$log" 2>&1 </dev/null &
  pid=$!
  trap 'kill "$pid" 2>/dev/null; echo; exit 130' INT TERM
  if [ -t 1 ]; then
    while kill -0 "$pid" 2>/dev/null; do
      printf '\rsetup: %s (log: %s) ... %d s' "$label" "$log" $((SECONDS - started))
      sleep 1
    done
  fi
  wait "$pid" || status=$?
  trap - INT TERM
  if [ "$status" -ne 0 ]; then
    printf ' failed\n'
    tail -n 15 "$log" >&2
    return "$status"
  fi
  [ -t 1 ] && printf '\rsetup: %s (log: %s) ...' "$label" "$log"
  printf ' done in %d s\n' $((SECONDS - started))
}

# --- What is there already?

cmake_is_new_enough() {
  local version
  version=$("${CMAKE:-cmake}" --version 2>/dev/null | sed -n '1s/[^0-9]*\([0-9]*\.[0-9]*\).*/\1/p')
  [ -n "$version" ] && [ "${version%%.*}" -ge 3 ] && { [ "${version%%.*}" -gt 3 ] || [ "${version#*.}" -ge 25 ]; }
}

# A Python counts when it is new enough and can make an environment with pip in it (Debian splits that off).
find_python() {
  local candidate
  for candidate in ${PYTHON:-python3.11 /usr/bin/python3.11 python3 /usr/bin/python3}; do
    if "$candidate" -c 'import sys, ensurepip, ssl, venv; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
      printf '%s\n' "$candidate"
      return 0
    fi
  done
  return 1
}

# What the Python module is compiled with.
has_python_headers() {
  local python
  python=$(find_python) || return 0  # python3-venv is missing, and said so
  "$python" -c 'import os, sys, sysconfig; sys.exit(not os.path.isfile(sysconfig.get_paths()["include"] + "/Python.h"))'
}

# Libraries and programs that only dpkg knows of.
readonly BUILD_PACKAGES=(ca-certificates libhdf5-dev zlib1g-dev libzip-dev libcli11-dev libtomlplusplus-dev
  nlohmann-json3-dev libfmt-dev libeigen3-dev libmuparser-dev libyaml-cpp-dev libprotozero-dev libssl-dev libwebp-dev)
readonly TEST_PACKAGES=(libgtest-dev libgmock-dev libbenchmark-dev libegl1 libgl1-mesa-dri)
readonly SLURM_PACKAGES=(slurm-wlm munge)
readonly FUZZ_PACKAGES=(clang-16 libclang-rt-16-dev)  # Debian 12's newest

missing_packages() {
  local package status
  local -a packages=("${BUILD_PACKAGES[@]}")
  [ "$PURPOSE" != test ] || packages+=("${TEST_PACKAGES[@]}")
  [ "$PURPOSE" != slurm ] || packages+=("${SLURM_PACKAGES[@]}")
  [ "$PURPOSE" != fuzz ] || packages+=("${FUZZ_PACKAGES[@]}")
  # Tools: any one in PATH that works will do. Asking for the version sees through shims that lead nowhere.
  g++ --version >/dev/null 2>&1 && make --version >/dev/null 2>&1 || echo g++ make
  cmake_is_new_enough || echo cmake
  ninja --version >/dev/null 2>&1 || echo ninja-build
  find_python >/dev/null || echo python3-venv
  if [ "$PURPOSE" = test ]; then
    git --version >/dev/null 2>&1 || echo git
    clang-format --version >/dev/null 2>&1 || echo clang-format
    "${CHROMIUM:-chromium}" --version >/dev/null 2>&1 || echo chromium
    has_python_headers || echo python3-dev
  fi
  # Libraries: only dpkg knows.
  command -v dpkg-query >/dev/null || return 0
  for package in "${packages[@]}"; do
    # shellcheck disable=SC2016  # dpkg-query's own placeholder
    status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null) || status=
    [ "$status" = installed ] || echo "$package"
  done
}

# Of everything that decides what this purpose installs.
requirements_hash() {
  local -a files=(requirements.txt)
  case $PURPOSE in
    cuda) files+=(requirements-torch.txt) ;;
    test) files+=(requirements-torch.txt requirements-test.txt requirements-models.txt) ;;
  esac
  cat "${files[@]}" scripts/setup.sh | sha256sum | cut -d ' ' -f 1
}

# --- Debian packages.

apt_install() {
  local as_root=$1
  shift
  # An index that cannot be refreshed may still be good enough.
  $as_root apt-get update || echo 'apt-get update failed: going on with the index at hand'
  $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
    -o DPkg::Lock::Timeout=300 "$@"
}

install_packages() {
  local -a missing
  local as_root
  mapfile -t missing < <(missing_packages)
  [ "${#missing[@]}" -eq 0 ] && return
  local command="apt-get update && apt-get install -y --no-install-recommends ${missing[*]}"
  if ! command -v apt-get >/dev/null; then
    fail "missing, and there is no apt-get to install them: ${missing[*]} (Debian's names); install them and run this again"
  elif [ "$(id -u)" -eq 0 ]; then
    as_root=
  elif sudo -n true 2>/dev/null; then
    as_root='sudo -n'
  else
    fail "Debian packages are missing; run this as root, then 'make setup' again:
  $command"
  fi
  run_logged "installing ${#missing[@]} Debian packages" "$LOGS/setup-apt.log" apt_install "$as_root" "${missing[@]}" ||
    fail "apt could not install them; run this as root to see why:
  $command"
  hash -r
  mapfile -t missing < <(missing_packages)
  [ "${#missing[@]}" -eq 0 ] && return
  fail "still not usable after installation: ${missing[*]}; an older program of that name may come first in PATH" \
    "($PATH): put /usr/bin before it, or set CMAKE=/usr/bin/cmake, PYTHON=/usr/bin/python3"
}

# --- The Python environment.

# pip_install LABEL LOG ARGUMENTS...
pip_install() {
  local label=$1 log=$LOGS/$2
  shift 2
  run_logged "$label" "$log" env PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_DEFAULT_TIMEOUT="${PIP_DEFAULT_TIMEOUT:-120}" \
    "$VENV/bin/python" -m pip install --no-input --progress-bar off "$@" ||
    fail "pip could not install $*: see $log; run 'make setup' again to go on"
}

install_wheels() {
  local python
  python=$(find_python) || fail "no Python 3.11 or newer with venv and pip found: set PYTHON=/path/to/python3"
  # An environment whose interpreter is gone or too old is made anew; any other is brought up to date in place.
  if ! "$VENV/bin/python" -c 'import sys, pip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
    run_logged "creating $VENV with $("$python" --version)" "$LOGS/setup-venv.log" "$python" -m venv --clear "$VENV" ||
      fail "could not create $VENV: see $LOGS/setup-venv.log"
  fi
  # Libraries, model files and scripts alone: what these packages' code needs stays away.
  pip_install 'installing the wheels that the program needs: 20 MB' setup-pip.log --no-deps -r requirements.txt
  if [ "$PURPOSE" = cuda ]; then
    pip_install 'installing torch: 190 MB, or 2.5 GB where it comes with CUDA' setup-torch.log -r requirements-torch.txt
  elif [ "$PURPOSE" = test ]; then
    pip_install 'installing what the tests compare with: 340 MB, or 2.9 GB where torch comes with CUDA' setup-test.log \
      -r requirements-test.txt
    pip_install 'installing robot models for tests and examples: 57 MB' setup-models.log --no-deps -r requirements-models.txt
  fi
}

case $PURPOSE in
  build | cuda | test | slurm | fuzz) ;;
  *) fail "'$PURPOSE', wanted build, cuda, test, slurm or fuzz" ;;
esac
mkdir -p "$LOGS"
# Two set-ups at once (make test beside make quickstart) would write into the same environment.
exec 9>"$LOGS/setup.lock"
flock 9

install_packages
[ "$PURPOSE" != slurm ] || exit 0
hash=$(requirements_hash)
if [ -x "$VENV/bin/python" ] && [ "$(cat "$STAMP" 2>/dev/null)" = "$hash" ]; then
  exit 0
fi
install_wheels
printf '%s\n' "$hash" >"$STAMP"
