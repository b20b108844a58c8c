#!/usr/bin/env bash
# test.sh [long|slurm|sanitized]: set-up, a build with warnings as errors, the tests and the lint checks. With "long" or
# "slurm": the tests of that label and nothing else; for "slurm" Slurm is installed where it is missing. With "sanitized":
# the tests that can bear it under the address and undefined-behaviour sanitizers, in a build of their own.
# With CI=true all but the long ones come. The test on Slurm is skipped, and says so, where Slurm cannot be installed or run.
# Ends with one line, "N passed, N failed", and fails when anything failed. A step that could not run counts as failed. What a
# test skips itself is named, and counts as neither.
set -uo pipefail
cd "$(dirname "$0")/.."

passed=0
failed=0

close() {
  [ "${#skips[@]}" -eq 0 ] || printf 'skipped: %s\n' "${skips[@]}"
  [ "$failed" -eq 0 ] || printf 'failed: %s\n' "${failures[@]}"
  printf '%d passed, %d failed\n' "$passed" "$failed"
  [ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
  exit
}

failures=()
skips=()
count_failure() {
  failed=$((failed + 1))
  failures+=("$1")
}

# check NAME COMMAND...: one check that either passes or fails.
check() {
  local name=$1
  shift
  echo "== $name"
  if "$@"; then
    passed=$((passed + 1))
  else
    count_failure "$name"
    return 1
  fi
}

# run_tests NAME FOLDER CTEST_ARGUMENTS...: adds ctest's own counts, from its JUnit record.
run_tests() {
  local name=$1 folder=build/$2 record=$PWD/build/$2/junit.xml status=0 total bad skipped
  shift 2
  echo "== $name"
  rm -f "$record"
  "${CTEST:-ctest}" --test-dir "$folder" --output-on-failure -j "${JOBS:-2}" --no-tests=error --output-junit "$record" "$@" ||
    status=$?
  attribute() { grep -o -m 1 "[[:space:]]$1=\"[0-9]*\"" "$record" 2>/dev/null | head -n 1 | tr -dc 0-9; }
  total=$(attribute tests)
  bad=$(attribute failures)
  if [ -z "$total" ] || { [ "$status" -ne 0 ] && [ "${bad:-0}" -eq 0 ]; }; then
    count_failure "$name (ctest status $status)"
    return
  fi
  skipped=$(($(attribute skipped) + $(attribute disabled)))
  passed=$((passed + total - bad - skipped))
  failed=$((failed + bad))
  [ "$skipped" -eq 0 ] || skips+=("$skipped of $total in: $name")
  [ "$bad" -eq 0 ] || failures+=("$bad of $total in: $name")
}

run_sanitized() {
  check 'build with sanitizers' scripts/build.sh asan || return
  # libmujoco and the interpreter that some tests start are not instrumented: what they keep until exit is not ours.
  UBSAN_OPTIONS=print_stacktrace=1 ASAN_OPTIONS=detect_leaks=1 \
    run_tests 'tests under sanitizers' asan -L sanitize -LE long --timeout 900
}

check 'set-up' scripts/setup.sh || close
if [ "${1:-}" = sanitized ]; then
  run_sanitized
  close
fi
check 'build, warnings are errors' scripts/build.sh dev || close

if [ "${1:-}" = slurm ]; then
  check 'set-up of Slurm' scripts/setup.sh slurm || close
  run_tests 'tests on Slurm' release -L slurm --timeout 600
  close
fi
if [ "${1:-}" = long ]; then
  run_tests 'long tests' release -L long --timeout 3600
  close
fi

check 'formatting' scripts/check_format.sh
run_tests 'tests' release -LE 'long|slurm' --timeout 900
if [ "${CI:-}" = true ]; then
  scripts/setup.sh slurm || true  # the test says what it lacks
  run_tests 'tests on Slurm' release -L slurm --timeout 600
  run_sanitized
fi
close
