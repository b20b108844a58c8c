#!/usr/bin/env python3
"""Does an agent trained in the designed simulators beat one trained in the nominal simulator, and the clone?

  benchmarks/agent_comparison.py [--study quickstart|tasks] [--seeds 10] [--parallel 2] [--oted build/release/oted]

quickstart  examples/quickstart.toml, whole pipeline, one run per seed.
tasks       the same comparison on every task, one agent each at equal steps: the target has half the friction, 0.7 of the
            gain and 1.3 of the gravity of the nominal simulator; demonstrations by the shipped medium policy.
Every run leaves one line in benchmarks/results/agents.jsonl; a run that is there is not made again. Prints the table.
"""

import argparse
import concurrent.futures
import json
import math
import pathlib
import shutil
import statistics
import subprocess
import tempfile
import time

from study_data import PARAMETERS, ROOT, TASKS, add_record, collect, commit, parameter_words, records

TRUTH = {"friction": 0.5, "gain": 0.7, "gravity": 1.3}
# Of the agents of the study 'tasks', as it was run: one lane and mid-sized networks.
FORMER = ("sac.hidden=128,128", "sac.learning_rate=0.001", "sac.batch_size=128", "sac.n_lanes=1", "sac.multi_step=1",
          "sac.normalize_observations=false", "sac.average_over=1", "sac.n_starts=1")
# Two-sided 95 % quantiles of Student's t by degrees of freedom, for the paired interval.
T95 = {1: 12.71, 2: 4.303, 3: 3.182, 4: 2.776, 5: 2.571, 6: 2.447, 7: 2.365, 8: 2.306, 9: 2.262}


def command_of(study, seed, oted, out, steps):
    if study == "quickstart":
        return [str(oted), "run", "examples/quickstart.toml", "--seed", str(seed), "--threads", "1", "--quiet", "--out", out]
    data = f"{out}/demonstrations.hdf5"
    collect(oted, study, PARAMETERS, TRUTH, seed, data)
    target = parameter_words(PARAMETERS) + [word for n, value in TRUTH.items() for word in ("--truth", f"{n}={value}")]
    return [str(oted), "run", "--task", TASKS[study], "--data", data, *target, "--seed", str(seed), "--threads", "1", "--quiet",
            "--out", f"{out}/run", "--set", "agents.n_agents=1", "--set", "agents.algorithm=sac", "--set", f"sac.n_steps={steps}",
            *(word for setting in FORMER for word in ("--set", setting))]


def run(study, seed, oted, steps):
    out = tempfile.mkdtemp(prefix="oted-agents-")
    start = time.monotonic()
    command = command_of(study, seed, oted, out, steps)
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    folder = pathlib.Path(out) if study == "quickstart" else pathlib.Path(out) / "run"
    if result.returncode not in (0, 4):
        raise SystemExit(f"{' '.join(command)}\n{result.stderr}")
    evaluation = json.loads((folder / "evaluation.json").read_text())
    design = json.loads((folder / "design.json").read_text())
    record = {"study": study, "seed": seed, "core_seconds": round(time.monotonic() - start, 1),
              "returns": {p["name"]: p["mean_return"] for p in evaluation["policies"]},
              "errors": {p["name"]: p["absolute_error"] for p in evaluation["parameters"]},
              "selected": design["selected"], "verdict": design["verdict"],
              "command": " ".join(command).replace(out, "OUT").replace(str(oted), "oted"),
              "commit": commit()}
    shutil.rmtree(out, ignore_errors=True)
    return record


def table(study, found):
    print(f"\n### {study}\n\n| seed | clone | SAC, nominal | OTED-SAC | mean parameter error |\n|---|---|---|---|---|")
    for r in found:
        v = r["returns"]
        print(f"| {r['seed']} | {v['clone']:.0f} | {v['sac_nominal']:.0f} | **{v['oted_sac']:.0f}** | "
              f"{statistics.mean(r['errors'].values()):.3f} |")
    for other in ("sac_nominal", "clone"):
        differences = [r["returns"]["oted_sac"] - r["returns"][other] for r in found]
        mean, n = statistics.mean(differences), len(differences)
        wins = sum(d > 0 for d in differences)
        interval = f" +- {T95[n - 1] * statistics.stdev(differences) / math.sqrt(n):.0f} (95 %, paired)" if 1 < n <= 10 else ""
        print(f"\nOTED-SAC - {other}: {mean:.0f}{interval}; higher in {wins} of {n} seeds.")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", choices=["quickstart", "tasks"], default="quickstart")
    parser.add_argument("--task", choices=list(TASKS), help="of the study 'tasks': only this one")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--steps", type=int, default=100_000, help="of the study 'tasks': control steps per agent")
    parser.add_argument("--parallel", type=int, default=2)
    parser.add_argument("--oted", default=ROOT / "build/release/oted", type=pathlib.Path)
    parser.add_argument("--out", default=ROOT / "benchmarks/results/agents.jsonl", type=pathlib.Path)
    parser.add_argument("--table", action="store_true", help="print the table of what is there; run nothing")
    arguments = parser.parse_args()
    studies = ["quickstart"] if arguments.study == "quickstart" else [arguments.task] if arguments.task else list(TASKS)
    jobs = [(s, seed) for s in studies for seed in range(1, arguments.seeds + 1)]
    if not arguments.table:
        with concurrent.futures.ThreadPoolExecutor(arguments.parallel) as pool:
            there = records(arguments.out)
            futures = [pool.submit(run, s, seed, arguments.oted.resolve(), arguments.steps) for s, seed in jobs
                       if f"{s}-{seed}" not in there]
            for future in concurrent.futures.as_completed(futures):
                r = future.result()
                add_record(arguments.out, f"{r['study']}-{r['seed']}", r)
                print(r["study"], r["seed"], {k: round(v) for k, v in r["returns"].items()}, flush=True)
    there = records(arguments.out)
    for study in studies:
        found = [there[f"{s}-{seed}"] for s, seed in jobs if s == study and f"{s}-{seed}" in there]
        if found:
            table(study, found)


if __name__ == "__main__":
    main()
