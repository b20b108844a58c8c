#!/usr/bin/env bash
# fuzz.sh MINUTES SEED: builds tests/fuzz/fuzz_readers.cc with the address and undefined-behaviour sanitizers and runs it.
# Failures are kept in build/fuzz/failures, the counts go to benchmarks/results/fuzz.jsonl, a line for each seed.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly MINUTES=$1 SEED=$2
mkdir -p build/fuzz
if ! { "${CMAKE:-cmake}" --preset asan && "${CMAKE:-cmake}" --build build/asan -j "${JOBS:-$(nproc)}" --target fuzz_readers; } \
  >build/fuzz/build.log 2>&1; then
  tail -n 30 build/fuzz/build.log >&2
  exit 1
fi
# No leak check: libmujoco and libhdf5 keep what they make. The limits stand in for those that the address
# sanitizer's own needs rule out: one allocation of at most 4 GiB, 6 GiB resident.
export ASAN_OPTIONS=detect_leaks=0:max_allocation_size_mb=4096:hard_rss_limit_mb=6144:allocator_may_return_null=0
export UBSAN_OPTIONS=print_stacktrace=1
status=0
build/asan/fuzz_readers --minutes "$MINUTES" --seed "$SEED" --out build/fuzz --summary build/fuzz/summary.json || status=$?
PYTHONPATH=benchmarks .venv/bin/python -c 'import json, sys, study_data as s
s.add_record(s.ROOT / "benchmarks/results/fuzz.jsonl", sys.argv[1], json.load(open("build/fuzz/summary.json")))' "seed$SEED"
exit "$status"
