#!/usr/bin/env python3
"""How near the design comes to a known truth: tasks x targets x data x forms, five seeds each.

  benchmarks/design_accuracy.py [--oted build/release/oted] [--out benchmarks/results/design_accuracy.jsonl] [--only SUBSTRING]

Data are five episodes of the shipped medium policy: the shipped files, copies with sensor noise of standard deviation 0.02 on
every observation (medium-noisy), and, for the target "drawn", episodes collected in a target drawn at random
(study_data.py). Hopper's positions are also given alone (medium-positions, medium-noisy-positions), as a CSV with a task file
of its own whose model is Gymnasium's. Every cell runs `oted design` and leaves one line of JSON in --out; a cell that is there
is not run again. Prints the table as Markdown. Errors are in multiples of the nominal value, mean over the three parameters.
"""

import argparse
import csv
import json
import pathlib
import resource
import shutil
import statistics
import subprocess
import tempfile
import time

import numpy as np

from study_data import (DATA, HIGH, LOW, PARAMETERS, ROOT, TASKS, cells_of, commit, logs, number, records_of, run_missing,
                        truth)

N_SEEDS = 5
# Two rivals in two ways each, as their users would have to know: that long predictions through contact have local minima, and
# that under noise epsilon must be learned.
FORMS = {
    "trajectories": ["design.method=trajectories"],
    "least-squares": ["design.method=least-squares"],
    "least-squares-5-steps": ["design.method=least-squares", "design.least_squares.horizon=5"],
    "dropo": ["design.method=dropo"],
    "dropo-learned-epsilon": ["design.method=dropo", "design.dropo.learn_epsilon=true"],
    "transitions": ["design.method=transitions"],
    "paper": ["design.method=paper"],
}
ALONE = "-positions"
HOPPER = ("rootz", "rooty", "thigh_joint", "leg_joint", "foot_joint")  # what it observes of qpos, in this order


def cells():
    for cell in cells_of(FORMS):
        if cell["form"] != "paper" or (cell["data"] == "medium" and cell["target"] != "drawn"):
            yield cell
    for target in ("shifted", "drawn"):
        for data in DATA:
            yield {"task": "hopper", "target": target, "data": data + ALONE, "form": "trajectories"}


def positions_alone(data, oted, folder):
    """Hopper's logs without velocities, as a task file of the caller's own would have them. Returns its path."""
    logs_file, rows = f"{folder}/logs.npz", []
    subprocess.run([str(oted), "data", "convert", data, logs_file], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    logged = np.load(logs_file)
    episode = np.concatenate([[0], np.cumsum(logged["terminals"] | logged["timeouts"])])
    for i, e in enumerate(episode[:-1]):
        rows.append([e, *logged["observations"][i, :len(HOPPER)], *logged["actions"][i]])
        if episode[i + 1] != e:
            rows.append([e, *logged["next_observations"][i, :len(HOPPER)], *logged["actions"][i]])
    with open(f"{folder}/logs.csv", "w", newline="", encoding="utf-8") as file:
        head = ["episode", *(f"joint/{joint}/qpos" for joint in HOPPER), *(f"actuator/#{i}" for i in range(3))]
        csv.writer(file).writerows([head, *rows])
    task = pathlib.Path(folder) / "task.toml"
    observations = ", ".join(f'"joint/{joint}/qpos"' for joint in HOPPER)
    task.write_text(f'''[task]
model = "package:gymnasium/envs/mujoco/assets/hopper.xml"
control_period = 0.008
observations = [{observations}]
start = "logs"
[data]
path = "logs.csv"
''')
    return task


def run(cell, oted, n_seeds):
    out = tempfile.mkdtemp(prefix="oted-design-")
    data = logs(cell["task"], cell["target"], cell["data"].removesuffix(ALONE), oted, out)
    alone = cell["data"].endswith(ALONE)
    words = [str(positions_alone(data, oted, out))] if alone else ["--task", TASKS[cell["task"]], "--data", data]
    command = [str(oted), "design", *words, "--seed", "1", "--seeds", str(n_seeds),
               "--out", f"{out}/run", "--quiet", "--json", "--set", "report.motion=false"]
    for setting in FORMS[cell["form"]]:
        command += ["--set", setting]
    for name, field in PARAMETERS.items():
        command += ["--param", f"{name}={field}:{LOW}:{HIGH}"]
    before, start = cpu_seconds(), time.monotonic()
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    seconds = time.monotonic() - start
    cpu = cpu_seconds() - before
    shutil.rmtree(out, ignore_errors=True)
    if result.returncode not in (0, 4):
        raise SystemExit(f"{' '.join(command)}\n{result.stderr}")
    design = json.loads(result.stdout)["design"]
    true = truth(cell["task"], cell["target"])
    seeds = []
    for seed in design["settings"][0]["seeds"]:
        errors = [abs(mode - value) for mode, value in zip(seed["mode"], true)]
        seeds.append({"seed": seed["seed"], "mode": seed["mode"], "std": seed["std"], "errors": errors,
                      "mean_error": statistics.mean(errors), "c": seed.get("c"), "common": seed.get("common")})
    return dict(cell, truth=true, seeds=seeds, mean_error=statistics.mean(s["mean_error"] for s in seeds),
                  worst_error=max(s["mean_error"] for s in seeds), verdict=design["verdict"],
                  nominal_common=design.get("nominal_common"), score=design.get("score"),
                  seconds_per_design_two_cores=seconds / n_seeds, cpu_seconds_per_design=cpu / n_seeds,
                  n_transitions=design["dataset"]["n_transitions"],
                  command=" ".join(command).replace(out, "OUT").replace(str(oted), "oted"), commit=commit())


def cpu_seconds():
    """Of all children that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", default=ROOT / "build/release/oted", type=pathlib.Path)
    parser.add_argument("--out", default=ROOT / "benchmarks/results/design_accuracy.jsonl", type=pathlib.Path)
    parser.add_argument("--only", default="", help="cells whose name contains this")
    parser.add_argument("--seeds", default=N_SEEDS, type=int, help="of each cell")
    parser.add_argument("--table", action="store_true", help="print the table of what is there; run nothing")
    arguments = parser.parse_args()
    if not arguments.table:
        oted = arguments.oted.resolve()
        for name, record in run_missing(cells(), arguments.out, arguments.only,
                                        lambda cell: run(cell, oted, arguments.seeds)):
            print(f"{name}: {record['mean_error']:.3f}", flush=True)
    print("| task | target | data | transitions | method | friction | gain | gravity | mean error | worst seed "
          "| s per design | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    for r in records_of(cells(), arguments.out):
        cpu = f"{r['cpu_seconds_per_design']:.0f}" if "cpu_seconds_per_design" in r else "-"
        by_parameter = [statistics.mean(s["errors"][i] for s in r["seeds"]) for i in range(3)]
        print(f"| {TASKS[r['task']]} | {r['target']} | {r['data']} | {r['n_transitions']} | {r['form']} | "
              + " | ".join(number(e) for e in by_parameter)
              + f" | **{number(r['mean_error'])}** | {number(r['worst_error'])} "
              + f"| {r['seconds_per_design_two_cores']:.0f} | {cpu} |")


if __name__ == "__main__":
    main()
