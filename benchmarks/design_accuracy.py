#!/usr/bin/env python3
"""How near the design comes to a known truth: tasks x targets x forms, five seeds each.

  benchmarks/design_accuracy.py [--oted build/release/oted] [--out benchmarks/results/design_accuracy] [--only SUBSTRING]

Every cell runs `oted design` on a shipped five-episode dataset and leaves one JSON file; a cell whose file exists is not
run again. Prints the table as Markdown. Errors are in multiples of the nominal value, mean over the three parameters.
"""

import argparse
import json
import pathlib
import shutil
import statistics
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
PARAMETERS = {
    "friction": "geom/*/friction[0]",
    "gain": "actuator/*/gainprm[0]",
    "gravity": "opt/gravity[2]",
}
TARGETS = {"nominal": (1.0, 1.0, 1.0), "shifted": (0.6, 1.3, 1.2)}
TASKS = {"hopper": "Hopper-v5", "halfcheetah": "HalfCheetah-v5", "walker2d": "Walker2d-v5"}
N_SEEDS = 5


def cells():
    for task in TASKS:
        for target in TARGETS:
            for form in ("trajectories", "transitions", "paper"):
                yield {"task": task, "target": target, "data": "medium", "form": form}


def name_of(cell):
    return "-".join(cell.values())


def run(cell, oted, file):
    data = f"examples/data/{cell['task']}-{cell['data']}{'-shifted' if cell['target'] == 'shifted' else ''}.hdf5"
    out = tempfile.mkdtemp(prefix="oted-design-")
    command = [str(oted), "design", "--task", TASKS[cell["task"]], "--data", data, "--seed", "1", "--seeds", str(N_SEEDS),
               "--out", out, "--quiet", "--json", "--set", f"design.form={cell['form']}"]
    for name, field in PARAMETERS.items():
        command += ["--param", f"{name}={field}:0.2:2.0"]
    start = time.monotonic()
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    seconds = time.monotonic() - start
    shutil.rmtree(out, ignore_errors=True)
    if result.returncode not in (0, 4):
        raise SystemExit(f"{' '.join(command)}\n{result.stderr}")
    design = json.loads(result.stdout)["design"]
    truth = TARGETS[cell["target"]]
    seeds = []
    for seed in design["settings"][0]["seeds"]:
        errors = [abs(mode - true) for mode, true in zip(seed["mode"], truth)]
        seeds.append({"seed": seed["seed"], "mode": seed["mode"], "std": seed["std"], "errors": errors,
                      "mean_error": statistics.mean(errors), "c": seed["c"], "common": seed["common"]})
    record = dict(cell, truth=truth, seeds=seeds, mean_error=statistics.mean(s["mean_error"] for s in seeds),
                  worst_error=max(s["mean_error"] for s in seeds), verdict=design["verdict"], nominal_common=design["nominal_common"], score=design["score"],
                  seconds_per_design_two_cores=seconds / N_SEEDS, n_transitions=design["dataset"]["n_transitions"],
                  command=" ".join(command).replace(out, "OUT").replace(str(oted), "oted"),
                  commit=subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True,
                                        check=False).stdout.strip())
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(record, indent=1) + "\n")


def number(error):
    return f"{error:.3f}" if error >= 0.001 else f"{error:.0e}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", default=ROOT / "build/release/oted", type=pathlib.Path)
    parser.add_argument("--out", default=ROOT / "benchmarks/results/design_accuracy", type=pathlib.Path)
    parser.add_argument("--only", default="", help="cells whose name contains this")
    parser.add_argument("--table", action="store_true", help="print the table of what is there; run nothing")
    arguments = parser.parse_args()
    for cell in cells():
        file = arguments.out / f"{name_of(cell)}.json"
        if not arguments.table and not file.exists() and arguments.only in name_of(cell):
            run(cell, arguments.oted.resolve(), file)
            print(f"{name_of(cell)}: {json.loads(file.read_text())['mean_error']:.3f}", flush=True)
    print("| task | target | data | transitions | form | friction | gain | gravity | mean error | worst seed "
          "| s per design |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for cell in cells():
        file = arguments.out / f"{name_of(cell)}.json"
        if not file.exists():
            continue
        r = json.loads(file.read_text())
        by_parameter = [statistics.mean(s["errors"][i] for s in r["seeds"]) for i in range(3)]
        print(f"| {TASKS[r['task']]} | {r['target']} | {r['data']} | {r['n_transitions']} | {r['form']} | "
              + " | ".join(number(e) for e in by_parameter)
              + f" | **{number(r['mean_error'])}** | {number(r['worst_error'])} "
              + f"| {r['seconds_per_design_two_cores']:.0f} |")


if __name__ == "__main__":
    main()
