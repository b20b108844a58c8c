# Every target does all the set-up it needs. `make help` lists them.
SHELL := /bin/bash
CMAKE ?= cmake
CTEST ?= ctest
JOBS ?= $(shell nproc)
OUT ?= runs/quickstart
MINUTES ?= 10
SEED ?= 1
POINTS ?= all
KILLS ?= 100
DAMAGES ?= 0
# Where the campaigns work: in memory where they can, as it is not the disk that they test.
CAMPAIGNS ?= $(shell test -w /dev/shm && echo /dev/shm/oted$(subst /,-,$(CURDIR)) || echo build)
BENCH_ARGS ?= --benchmark_enable_random_interleaving=true --benchmark_repetitions=15 --benchmark_report_aggregates_only=true
export CMAKE CTEST JOBS

.DEFAULT_GOAL := help
.PHONY: help setup build build-cuda wheel release site test test-python test-long test-sanitized test-slurm quickstart report-picture bench bench-peers fuzz crash corrupt lint format clean

help:  ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-14s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)
	@echo "  JOBS=N limits parallel jobs; OUT=DIR is the run directory of quickstart and report-picture; PYTHON=, CMAKE= choose the tools."
	@echo "  BENCH_ARGS='--benchmark_filter=Hopper' goes to every benchmark program."

setup:  ## Debian packages and .venv (scripts/setup.sh); quick when nothing is missing
	@scripts/setup.sh

build:  ## the program: build/release/oted
	@scripts/setup.sh build
	@scripts/build.sh release

build-cuda:  ## the same with libtorch, for --device cuda; downloads torch
	@scripts/setup.sh cuda
	@scripts/build.sh cuda

wheel:  ## dist/oted-*.whl, the Python package with the libraries that it needs: PYTHONS="python3.11 python3.12"
	@scripts/wheel.sh $(PYTHONS)

release:  ## dist: the source archive and the wheel built from it alone, checked as a stranger would: PYTHON=
	@scripts/release.sh $(PYTHON)

site:  ## the documentation as pages to read offline: build/site/README.html
	@scripts/site.sh

test:  ## set-up, build, all tests but the long ones, lint; ends with "N passed, N failed"
	@scripts/test.sh

test-python:  ## the Python wheel as a stranger meets it: built, installed into fresh environments, tested; PYTHONS="python3.11 python3.12"
	@scripts/test_python.sh $(PYTHONS)

test-long:  ## the tests that take minutes: known parameters recovered, agents trained
	@scripts/test.sh long

test-sanitized:  ## the tests of what reads files and steps simulators, under the address and undefined-behaviour sanitizers
	@scripts/test.sh sanitized

test-slurm:  ## plans on a real Slurm of two nodes on this machine, as root; installs Slurm from Debian's packages
	@scripts/test.sh slurm

quickstart: build  ## the whole pipeline on five Hopper demonstrations, into runs/quickstart
	@build/release/oted run examples/quickstart.toml --out $(OUT)

report-picture: setup  ## docs/report.png from the report of a finished run: OUT=runs/quickstart
	@.venv/bin/python scripts/report_picture.py $(OUT) docs/report.png

bench: setup  ## build and run the benchmark programs (one core each, so give it a quiet machine)
	@scripts/build.sh bench
	@for program in build/bench/benchmarks/bench_*; do "$$program" $(BENCH_ARGS) || exit 1; done
	@$(MAKE) --no-print-directory bench-peers

bench-peers: setup  ## the part of it beside Stable-Baselines3, sbx, RLtools, EnvPool; installs 340 MB into build/bench-peers
	@scripts/build.sh bench
	@.venv/bin/python benchmarks/sac_peers.py

fuzz:  ## hostile files for every reader, guided by coverage, under the sanitizers: MINUTES=10 (of processor time, each) SEED=1 FAMILIES="csv onnx"
	@scripts/setup.sh fuzz
	@scripts/build.sh fuzz
	@.venv/bin/python scripts/fuzz.py build/fuzz/fuzz_readers --minutes $(MINUTES) --seed $(SEED) $(FAMILIES)

crash: setup  ## a fault at each call that changes a file, and kill -9 at random: COMMANDS="run unit" POINTS=all KILLS=100 (run: a quarter of an hour; all: hours; goes on when stopped)
	@scripts/build.sh dev
	@.venv/bin/python tests/faults/crash.py build/release/oted build/release/tests/liboted_fault_points.so $(CAMPAIGNS)/crash \
	  $(if $(COMMANDS),--commands $(COMMANDS)) --points $(POINTS) --kills $(KILLS) --record

corrupt: setup  ## each file of a finished and of two half-finished runs damaged: DAMAGES=0 (all; ten minutes; goes on when stopped), SEED=1
	@scripts/build.sh dev
	@.venv/bin/python tests/faults/corrupt.py build/release/oted $(CAMPAIGNS)/corrupt --damages $(DAMAGES) --seed $(SEED) --record

lint: setup  ## formatting, the rules on who may include whom, sizes of functions, names
	@scripts/check_format.sh
	@.venv/bin/python tests/lint_includes.py
	@.venv/bin/python tests/lint_sizes.py
	@.venv/bin/python tests/lint_names.py

format: setup  ## clang-format every source in place
	@scripts/check_format.sh --fix

clean:  ## remove build/ (keeps .venv and runs/)
	rm -rf build
