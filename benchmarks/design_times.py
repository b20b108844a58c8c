#!/usr/bin/env python3
"""Seconds from the command to the table: `oted design` beside mujoco.sysid on the same clean logs, in turn.

  .venv-bench/bin/python benchmarks/design_times.py [--oted build/release/oted] [--repeats 3] [--tasks hopper halfcheetah]
  .venv-bench/bin/python benchmarks/design_times.py --table

The environment is that of requirements-sysid.txt. The logs are the shipped five episodes with friction, gain and gravity off
(study_data.py). `oted design` has its defaults: what is timed ends with the line of its verdict, behind which only films and the
report follow. mujoco.sysid is called in both ways of rival_sysid.py, each from its nominal start and two draws. One repeat runs
all of them one after the other, so that other work on the machine slows them alike; the ratio is the median of the repeats'
ratios.
"""

import argparse
import json
import os
import pathlib
import resource
import statistics
import subprocess
import tempfile
import time

import rival_sysid
from study_data import PARAMETERS, ROOT, TASKS, add_record, commit, logs, parameter_words, records, truth

STUDY = ROOT / "benchmarks/results/design_times.jsonl"
TARGET, DATA = "shifted", "medium"


def processor_time():
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime


def design(task, oted):
    """Seconds to the verdict, and to the end; processor seconds of all of it; mean error."""
    with tempfile.TemporaryDirectory() as folder:
        command = [str(oted), "design", "--task", TASKS[task], "--data", logs(task, TARGET, DATA, oted, folder), "--out",
                   f"{folder}/run", "--quiet", *parameter_words(PARAMETERS)]
        start, cpu = time.monotonic(), processor_time()
        at_verdict = None
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as program:
            for line in program.stdout:
                if line.startswith("verdict: "):
                    at_verdict = time.monotonic() - start
        if program.returncode != 0 or at_verdict is None:
            raise SystemExit(f"{' '.join(command)}: exit code {program.returncode}, no verdict")
        seed = json.loads(pathlib.Path(folder, "run/design.json").read_text())["settings"][0]["seeds"][0]
        errors = [abs(mode - value) for mode, value in zip(seed["mode"], truth(task, TARGET))]
        return {"seconds": at_verdict, "to_the_end": time.monotonic() - start, "cpu_seconds": processor_time() - cpu,
                "mean_error": statistics.mean(errors)}


def sysid(task, way, oted):
    record = rival_sysid.run({"task": task, "target": TARGET, "data": DATA, "form": f"sysid-{way}"}, oted)
    return {key: record.get(key) for key in ("seconds", "cpu_seconds", "mean_error")}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", default=ROOT / "build/release/oted", type=pathlib.Path)
    parser.add_argument("--repeats", default=3, type=int)
    parser.add_argument("--tasks", nargs="+", default=["hopper", "halfcheetah"], choices=list(TASKS))
    parser.add_argument("--methods", nargs="+", help="some of those that are compared [all]")
    parser.add_argument("--table", action="store_true", help="print what is there and run nothing")
    arguments = parser.parse_args()
    oted = arguments.oted.resolve()
    methods = {"oted": lambda task: design(task, oted)} | {
        f"sysid-{way}": lambda task, way=way: sysid(task, way, oted) for way in rival_sysid.WAYS}
    for repeat in range(0 if arguments.table else arguments.repeats):
        for task in arguments.tasks:
            for name in arguments.methods or methods:
                cell = f"{task}-{name}-{repeat + 1}"
                if cell not in records(STUDY):
                    add_record(STUDY, cell, {"task": task, "method": name, "repeat": repeat + 1, "processors": os.cpu_count(),
                                             **methods[name](task), "commit": commit()})
    print("| task | method | seconds, each repeat | processor seconds | mean error | times oted's seconds |\n|---|---|---|---|---|---|")
    for task in TASKS:
        for name in methods:
            of = [r for r in records(STUDY).values() if (r["task"], r["method"]) == (task, name)]
            if not of:
                continue
            own = {r["repeat"]: r["seconds"] for r in records(STUDY).values() if (r["task"], r["method"]) == (task, "oted")}
            ratios = [r["seconds"] / own[r["repeat"]] for r in of if r["repeat"] in own]
            errors = [r["mean_error"] for r in of if r["mean_error"] is not None]
            seconds = " ".join(f"{r['seconds']:.1f}" for r in of)
            error = f"{statistics.median(errors):.1g}" if errors else "no result"
            print(f"| {TASKS[task]} | {name} | {seconds} | {statistics.median(r['cpu_seconds'] for r in of):.0f} | {error} | "
                  f"{statistics.median(ratios):.1f} |")


if __name__ == "__main__":
    main()
