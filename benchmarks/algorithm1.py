#!/usr/bin/env python3
"""How near Algorithm 1 comes to a known truth: tasks x behaviours x targets x variants of its settings.

  benchmarks/algorithm1.py [--only SUBSTRING ...] [--variants paper transitions] [--seeds 3] [--jobs 1]
  benchmarks/algorithm1.py --table

Logs are five episodes in the target, by a shipped policy (medium, expert) or by one that this script trains with `oted
behavior` and keeps in build/behaviors: sac (80,000 steps of SAC, seed 11) and crossq (40,000 steps of CrossQ, seed 12), both
in the nominal simulator. Targets are (friction, gain, gravity): shifted, its opposite, and one drawn for each task; each
parameter is searched within 0.2 to 2.0. Every cell runs `oted design` and leaves one line of JSON in --out; a cell that is
there is not run again. --variants names settings of the table VARIANTS. Errors are in multiples of the nominal value; start is
the error of q before it learns.
"""

import argparse
import concurrent.futures
import json
import pathlib
import statistics
import subprocess
import tempfile
import time

from study_data import (HIGH, LOW, PARAMETERS, ROOT, TASKS, add_record, collect, commit, drawn, name_of, number,
                        parameter_words, records)

VARIANTS = {
    "paper": ["design.method=paper"],
    "letter": ["design.method=paper", "design.adversarial.starts=initial", "design.adversarial.n_iterations=60"],
    "transitions": ["design.method=transitions"],
}
# CrossQ's settings when its logs were made.
FORMER_CROSSQ = [word for setting in ("critic_hidden=256,256", "batch_size=256", "n_lanes=1", "updates_per_step=1", "average_over=1")
                 for word in ("--set", f"crossq.{setting}")]
TRAINED = {
    "sac": ["--algorithm", "sac", "--seed", "11", "--set", "sac.n_steps=80000", "--set", "sac.n_starts=1", "--set",
            "sac.average_over=1"],
    "crossq": ["--algorithm", "crossq", "--seed", "12", "--set", "crossq.n_steps=40000", "--set", "crossq.hidden=[64,64]", *FORMER_CROSSQ],
}
BEHAVIOURS = ("medium", "expert", *TRAINED)
TARGETS = ("shifted", "opposite", "drawn")


def truth(task, target):
    return {"shifted": (0.6, 1.3, 1.2), "opposite": (1.37, 0.83, 0.91)}.get(target) or drawn(task)


def cells(variants):
    for task in TASKS:
        for behaviour in BEHAVIOURS:
            for target in TARGETS:
                for variant in variants:
                    yield {"task": task, "behaviour": behaviour, "target": target, "variant": variant}


def policy_of(task, behaviour, oted):
    """The policy's path; what is not shipped is trained once."""
    if behaviour not in TRAINED:
        return f"examples/policies/{task}/{behaviour}.npz"
    folder = ROOT / "build/behaviors" / task / behaviour
    if not (folder / "expert.npz").exists():
        command = [str(oted), "behavior", "--task", TASKS[task], "--threads", "1", "--out", str(folder), "--quiet"]
        subprocess.run(command + TRAINED[behaviour], cwd=ROOT, check=True, capture_output=True)
    return str(folder / "expert.npz")


def logs_of(cell, oted):
    """The dataset's path; collected once."""
    made = ROOT / "build/behaviors" / cell["task"] / f"{cell['behaviour']}-{cell['target']}.hdf5"
    if not made.exists():
        made.parent.mkdir(parents=True, exist_ok=True)
        true = dict(zip(PARAMETERS, truth(cell["task"], cell["target"])))
        collect(oted, cell["task"], PARAMETERS, true, 1, made, policy=policy_of(cell["task"], cell["behaviour"], oted))
    return str(made)


def run(cell, oted, n_seeds):
    data = logs_of(cell, oted)
    with tempfile.TemporaryDirectory(prefix="oted-algorithm1-") as out:
        command = [str(oted), "design", "--task", TASKS[cell["task"]], "--data", data, "--seed", "1", "--seeds", str(n_seeds),
                   "--threads", "1", "--out", f"{out}/run", "--quiet", "--json", "--set", "report.motion=false"]
        for setting in VARIANTS[cell["variant"]]:
            command += ["--set", setting]
        start = time.monotonic()
        result = subprocess.run(command + parameter_words(PARAMETERS, LOW, HIGH), cwd=ROOT, capture_output=True, text=True,
                                check=False)
        seconds = time.monotonic() - start
    if result.returncode not in (0, 4):
        raise SystemExit(f"{' '.join(command)}\n{result.stderr}")
    design = json.loads(result.stdout)["design"]
    true = truth(cell["task"], cell["target"])
    seeds = []
    for seed in design["settings"][0]["seeds"]:
        errors = [abs(mode - value) for mode, value in zip(seed["mode"], true)]
        seeds.append({"seed": seed["seed"], "mode": seed["mode"], "std": seed["std"], "errors": errors, "c": seed["c"],
                      "common": seed["common"]})
    start_errors = [abs((LOW + HIGH) / 2 - value) for value in true]
    parameters = [{key: p[key] for key in ("name", "mode", "std", "interval90", "verdict")} for p in design["parameters"]]
    return dict(cell, truth=true, seeds=seeds, start=statistics.mean(start_errors), parameters=parameters,
                verdict=design["verdict"], sentence=design["sentence"], n_transitions=design["dataset"]["n_transitions"],
                seconds_per_design=round(seconds / n_seeds, 1), settings=VARIANTS[cell["variant"]], commit=commit())


def selected_errors(record):
    return [abs(p["mode"] - value) for p, value in zip(record["parameters"], record["truth"])]


def print_cells(found):
    print("| task | behaviour | target | transitions | variant | start | friction | gain | gravity | mean over seeds | selected "
          "| verdict |\n|---|---|---|---|---|---|---|---|---|---|---|---|")
    for r in found:
        by_parameter = [statistics.mean(s["errors"][i] for s in r["seeds"]) for i in range(3)]
        print(f"| {TASKS[r['task']]} | {r['behaviour']} | {r['target']} | {r['n_transitions']} | {r['variant']} | "
              f"{number(r['start'])} | {' | '.join(map(number, by_parameter))} | {number(statistics.mean(by_parameter))} | "
              f"**{number(statistics.mean(selected_errors(r)))}** | {r['verdict']} |")


def print_summary(found):
    print("\n| task | variant | cells | start | mean over seeds | selected | without friction | worst | gap closed above .15 | s "
          "|\n|---|---|---|---|---|---|---|---|---|---|")
    for task, variant in dict.fromkeys((r["task"], r["variant"]) for r in found):
        of = [r for r in found if (r["task"], r["variant"]) == (task, variant)]
        selected = [statistics.mean(selected_errors(r)) for r in of]
        every = [statistics.mean(s["errors"]) for r in of for s in r["seeds"]]
        without = statistics.mean(statistics.mean(selected_errors(r)[1:]) for r in of)
        wrong = sum(r["verdict"] == "gap_closed" and error > 0.15 for r, error in zip(of, selected))
        print(f"| {TASKS[task]} | {variant} | {len(of)} | {number(statistics.mean(r['start'] for r in of))} | "
              f"{number(statistics.mean(every))} | **{number(statistics.mean(selected))}** | {number(without)} | "
              f"{number(max(selected))} | {wrong} | {statistics.mean(r['seconds_per_design'] for r in of):.0f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", default=ROOT / "build/release/oted", type=pathlib.Path)
    parser.add_argument("--out", default=ROOT / "benchmarks/results/algorithm1.jsonl", type=pathlib.Path)
    parser.add_argument("--only", default=[""], nargs="+", help="cells whose name contains one of these")
    parser.add_argument("--variants", default=list(VARIANTS), choices=VARIANTS, nargs="+")
    parser.add_argument("--seeds", default=3, type=int, help="of each cell")
    parser.add_argument("--jobs", default=1, type=int)
    parser.add_argument("--table", action="store_true", help="print the tables of what is there; run nothing")
    arguments = parser.parse_args()
    wanted = [cell for cell in cells(arguments.variants) if any(word in name_of(cell) for word in arguments.only)]
    if not arguments.table:
        missing = [cell for cell in wanted if name_of(cell) not in records(arguments.out)]
        with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
            jobs = {pool.submit(run, cell, arguments.oted.resolve(), arguments.seeds): name_of(cell) for cell in missing}
            for job in concurrent.futures.as_completed(jobs):
                add_record(arguments.out, jobs[job], job.result())
                print(f"{jobs[job]}: {statistics.mean(selected_errors(job.result())):.3f}", flush=True)
    there = records(arguments.out)
    found = [there[name_of(cell)] for cell in wanted if name_of(cell) in there]
    print_cells(found)
    print_summary(found)


if __name__ == "__main__":
    main()
