#!/usr/bin/env python3
"""Error and time of the default design over 1, 3, 10 and 20 parameters of HalfCheetah, on one and two threads.

  benchmarks/parameter_count.py [--oted build/release/oted] [--out benchmarks/results/parameter_count.jsonl] [--noise 0.02]

Five episodes of the shipped medium policy in a target whose parameters are drawn from [0.6, 1.5]; bounds 0.2 and 2.0. One run is
`oted design` with its defaults (three seeds), clone, discriminators, selection and report included. A run that
is in --out is not made again; --table prints what is there. Errors are in multiples of the nominal value.
"""

import argparse
import json
import pathlib
import random
import statistics
import subprocess
import tempfile
import time

from study_data import PARAMETERS, ROOT, TASKS, add_record, collect, commit, parameter_words, records

TASK = "halfcheetah"
LIMBS = [f"{side}{part}" for side in "bf" for part in ("thigh", "shin", "foot")]
MASSES = {f"mass_{body}": f"body/{body}/mass" for body in LIMBS}
JOINTS = {f"gear_{joint}": f"actuator/{joint}/gear[0]" for joint in LIMBS} | {
    f"damping_{joint}": f"joint/{joint}/damping" for joint in LIMBS}
SETS = {
    1: {"friction": PARAMETERS["friction"]},
    3: PARAMETERS,
    10: PARAMETERS | {"mass_torso": "body/torso/mass"} | MASSES,
    20: {name: PARAMETERS[name] for name in ("friction", "gravity")} | MASSES | JOINTS,
}


def run(count, threads, noise, oted):
    rng = random.Random(f"{count} parameters")
    truth = {name: round(rng.uniform(0.6, 1.5), 3) for name in SETS[count]}
    with tempfile.TemporaryDirectory(prefix="oted-count-") as folder:
        collect(oted, TASK, SETS[count], truth, 1, f"{folder}/demos.npz", noise)
        start = time.monotonic()
        result = subprocess.run([oted, "design", "--task", TASKS[TASK], "--data", f"{folder}/demos.npz", "--seed", "1", "--threads",
                                 str(threads), "--out", f"{folder}/run", "--quiet", "--json", *parameter_words(SETS[count])],
                                cwd=ROOT, capture_output=True, text=True, check=False)
        seconds = time.monotonic() - start
    if result.returncode not in (0, 4):
        raise SystemExit(result.stderr)
    design = json.loads(result.stdout)["design"]
    return {
        "task": TASKS[TASK], "parameters": count, "threads": threads, "noise": noise, "truth": truth, "seconds": round(seconds, 1),
        "designed": {p["name"]: {key: p[key] for key in ("mode", "interval90", "verdict")} for p in design["parameters"]},
        "verdict": design["verdict"], "commit": commit()}


def print_table(found):
    print("| parameters | noise | threads | mean error | largest | 90 % intervals hold | verdict | s |\n|---|---|---|---|---|---|---|---|")
    for r in sorted(found, key=lambda r: (r["noise"], r["parameters"], r["threads"])):
        errors = [abs(p["mode"] - r["truth"][name]) for name, p in r["designed"].items()]
        held = sum(p["interval90"][0] <= r["truth"][name] <= p["interval90"][1] for name, p in r["designed"].items())
        print(f"| {r['parameters']} | {r['noise']:g} | {r['threads']} | {statistics.mean(errors):.1g} | {max(errors):.1g} | "
              f"{held} | {r['verdict']} | {r['seconds']:.0f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", default=ROOT / "build/release/oted", type=pathlib.Path)
    parser.add_argument("--out", default=ROOT / "benchmarks/results/parameter_count.jsonl", type=pathlib.Path)
    parser.add_argument("--noise", default=0.0, type=float)
    parser.add_argument("--counts", default=list(SETS), choices=SETS, type=int, nargs="+")
    parser.add_argument("--threads", default=[2, 1], type=int, nargs="+")
    parser.add_argument("--table", action="store_true", help="print the table of what is there; run nothing")
    arguments = parser.parse_args()
    if not arguments.table:
        for threads in arguments.threads:
            for count in arguments.counts:
                name = f"{count}-parameters-{arguments.noise:g}-noise-{threads}-threads"
                if name not in records(arguments.out):
                    add_record(arguments.out, name, run(count, threads, arguments.noise, arguments.oted.resolve()))
    print_table(records(arguments.out).values())


if __name__ == "__main__":
    main()
