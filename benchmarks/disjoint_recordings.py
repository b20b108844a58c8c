#!/usr/bin/env python3
"""Whether disjoint recordings of one robot give the same parameters, within the intervals that the designs report.

    benchmarks/disjoint_recordings.py [--sets double_pendulum simple_pendulum simulated hopper] [--table]

Each part is one `oted design` (one seed, one thread) on recordings that no other part has: of the real robots in
examples/real, of the double pendulum's nominal model simulated with noisy sensors under five sines, and of Hopper under the
shipped policy. Two parts agree in a parameter if they differ by less than 1.645 standard deviations of the difference: the
root of the sum of both variances, each told by its part's 90 % interval. Nine pairs in ten agree where intervals are right. A
part that is in results/disjoint_recordings.jsonl is not designed again.
"""

import argparse
import csv
import gzip
import itertools
import json
import math
import pathlib
import statistics
import subprocess
import tempfile
import time

from study_data import HIGH, LOW, PARAMETERS, ROOT, add_record, collect, commit, drawn, number, parameter_words, records

STUDY = ROOT / "benchmarks/results/disjoint_recordings.jsonl"
QUANTILE = 1.645  # of a normal: 90 % lie within
NOISE = 0.005  # [rad], [rad/s] of the simulated pendulum's sensors
N_SIMULATED = 6
PARTS = {  # names of recordings in fit.csv.gz and held_out.csv.gz
    "double_pendulum": {"sine 1": ("143339", "143524"), "sine 2": ("143601", "143704"), "sine 3": ("143747", "143906"),
                        "sine 4": ("144003", "144115"), "swing-up 1": ("154220",), "swing-up 2": ("154548",)},
    "simple_pendulum": {"energy": ("energy",), "pd": ("pd1nm",), "ilqr": ("ilqr",), "sac": ("sac",),
                        "ddp and dircol": ("ddp", "dircol")},
    "simulated": {f"sine {i + 1}": (i,) for i in range(N_SIMULATED)},
    "hopper": {f"demonstrations {i + 1}": (i,) for i in range(N_SIMULATED)},
}


def write_part(folder, wanted, out):
    """The wanted recordings of a real set, as a CSV."""
    rows = []
    for name in ("fit.csv.gz", "held_out.csv.gz"):
        with gzip.open(folder / name, "rt") as file:
            head, *these = list(csv.reader(file))
        rows += [row for row in these if row[0] in wanted]
    with out.open("w", newline="") as file:
        csv.writer(file).writerows([head, *rows])


def prepare(oted, name, which, folder):
    """Words of `oted design` that name task, parameters and logs; the logs are written into `folder`."""
    if name == "hopper":
        data = folder / "logs.npz"
        collect(oted, "hopper", PARAMETERS, dict(zip(PARAMETERS, drawn("hopper"))), 100 + which[0], data, 0.02)
        return ["--task", "Hopper-v5", "--data", data, *parameter_words(PARAMETERS, LOW, HIGH)]
    real = ROOT / "examples/real" / ("double_pendulum" if name == "simulated" else name)
    if name != "simulated":
        write_part(real, which, folder / "logs.csv")
        return [real / "task.toml", "--data", folder / "logs.csv"]
    task = (real / "task.toml").read_text().replace('start = "logs"', "start_noise = 0.5")
    task = task.replace('"model.xml"', f'"{real / "model.xml"}"').replace("max_episode_steps = 6000", "max_episode_steps = 2500")
    (folder / "task.toml").write_text(task)
    run([oted, "collect", "--task", folder / "task.toml", "--policy", "sine:0.1", "--episodes", 2, "--seed", 100 + which[0],
         "--threads", 1, "--noise", NOISE, "--out", folder / "logs.csv"])
    return [folder / "task.toml", "--data", folder / "logs.csv"]


def run(command, allowed=(0,)):
    done = subprocess.run([str(word) for word in command], cwd=ROOT, check=False, capture_output=True, text=True)
    if done.returncode not in allowed:
        raise SystemExit(f"{' '.join(map(str, command))}\n{done.stderr}")
    return done.stdout


def design(oted, name, which):
    with tempfile.TemporaryDirectory(prefix="oted-disjoint-") as out:
        folder = pathlib.Path(out)
        words = prepare(oted, name, which, folder)
        begin = time.monotonic()
        answer = json.loads(run([oted, "design", *words, "--out", folder / "run", "--seeds", 1, "--threads", 1, "--quiet",
                                 "--json"], (0, 4)))["design"]
        seconds = time.monotonic() - begin
    return {"set": name, "seconds": round(seconds), "verdict": answer["verdict"], "commit": commit(),
            "window": answer.get("fit", {}).get("window"),
            "parameters": {p["name"]: {"mode": p["mode"], "interval90": p["interval90"], "verdict": p["verdict"]}
                           for p in answer["parameters"]}}


def std(parameter):
    low, high = parameter["interval90"]
    return (high - low) / 2 / QUANTILE


def distances(name, parameter, found):
    """Of all pairs of parts, the difference in standard deviations of the difference."""
    parts = [found[part]["parameters"][parameter] for part in found if found[part]["set"] == name]
    return [abs(a["mode"] - b["mode"]) / max(math.hypot(std(a), std(b)), 1e-12) for a, b in itertools.combinations(parts, 2)]


def print_tables(sets, found):
    print("| set | parameter | parts' values | median half-width | pairs that agree | median distance |\n|---|---|---|---|---|---|")
    for name in sets:
        of = {cell: record for cell, record in found.items() if record["set"] == name}
        if len(of) < 2:
            continue
        n_agree = n_pairs = 0
        for parameter in next(iter(of.values()))["parameters"]:
            apart = distances(name, parameter, of)
            agree = sum(distance < QUANTILE for distance in apart)
            values = [record["parameters"][parameter]["mode"] for record in of.values()]
            half = statistics.median(QUANTILE * std(record["parameters"][parameter]) for record in of.values())
            print(f"| {name} | {parameter} | {min(values):.4g} to {max(values):.4g} | {number(half)} | {agree} of {len(apart)} "
                  f"| {statistics.median(apart):.1f} |")
            n_agree, n_pairs = n_agree + agree, n_pairs + len(apart)
        print(f"| {name} | **all** | {len(of)} parts | | **{n_agree} of {n_pairs}, {100 * n_agree / n_pairs:.0f} %** | |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", nargs="*", default=list(PARTS), choices=list(PARTS))
    parser.add_argument("--oted", default=ROOT / "build/release/oted", type=pathlib.Path)
    parser.add_argument("--table", action="store_true", help="print what is there and run nothing")
    arguments = parser.parse_args()
    for name in arguments.sets:
        for part, which in PARTS[name].items():
            cell = f"{name}-{part}"
            if not arguments.table and cell not in records(STUDY):
                add_record(STUDY, cell, design(arguments.oted.resolve(), name, which))
                print(cell, flush=True)
    print_tables(arguments.sets, records(STUDY))


if __name__ == "__main__":
    main()
