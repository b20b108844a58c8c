"""What it costs that results are on the disk and prove themselves: the quickstart with and without syncing and hashing.

usage: durability_cost.py [--rounds N] [--tiny] [--within] [--record]

Rounds of four runs each, one behind the other: as it is, without waiting for the disk (fsync), without hashing (SHA-256), and
with neither, by the library that the fault campaigns preload. --tiny: the fault campaigns' run of a fifth of a second in place
of the quickstart; what it loses is the largest share that there is. Prints the medians over rounds of wall time and processor
time, and the ratios to a run with neither. --within: one run, in which each sync and each hash is timed: what they took on all
threads together, over the run's wall time, is the most that a run without them could be shorter. Other work on the machine moves
that share little, where it moves the difference of two runs by more than it is. --record puts the figures into
benchmarks/results/durability.jsonl. Needs `scripts/build.sh dev`.
"""

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

import study_data

sys.path.insert(0, str(study_data.ROOT / "tests/faults"))
from campaign import Campaign  # noqa: E402

PROGRAM = study_data.ROOT / "build/release/oted"
LIBRARY = study_data.ROOT / "build/release/tests/liboted_fault_points.so"
WITHOUT = {"as it is": "", "no sync": "sync", "no hash": "hash", "neither": "both"}


def seconds(words, out, **more):
    """(wall, processor) of one run into a new folder."""
    shutil.rmtree(out, ignore_errors=True)
    environment = {**os.environ, "LD_PRELOAD": str(LIBRARY), **more}
    before, start = os.times(), time.monotonic()
    result = subprocess.run([str(PROGRAM), *words, "--out", out, "--quiet"], cwd=study_data.ROOT, env=environment, capture_output=True, text=True)
    assert result.returncode in (0, 4), result.stderr
    after = os.times()
    return time.monotonic() - start, after.children_user + after.children_system - before.children_user - before.children_system


def within(words, folder):
    """The share of syncs and hashes in one run."""
    times = os.path.join(folder, "times")
    wall, processor = seconds(words, os.path.join(folder, "run"), OTED_TIMES=times)
    record = {"schema": "oted.durability/1", "wall_s": round(wall, 3), "cpu_s": round(processor, 3)}
    with open(times) as file:
        for name, taken, calls in map(str.split, file):
            record[name] = {"s": float(taken), "calls": int(calls), "of_wall": round(float(taken) / wall, 5)}
            print(f"{name}: {calls} calls, {taken} s, {100 * float(taken) / wall:.3f} % of {wall:.1f} s")
    return record


def compared(words, folder, rounds):
    """Medians over the rounds of a run as it is and without syncs, hashes and both."""
    wall, processor = ({name: [] for name in WITHOUT} for _ in range(2))
    for _ in range(rounds):
        for name, cheap in WITHOUT.items():
            taken = seconds(words, os.path.join(folder, "run"), OTED_CHEAP=cheap)
            wall[name].append(taken[0])
            processor[name].append(taken[1])
    record = {"schema": "oted.durability/1", "rounds": rounds}
    for name in WITHOUT:
        ratio = statistics.median(w / n for w, n in zip(wall[name], wall["neither"]))
        record[name] = {"wall_s": round(statistics.median(wall[name]), 3), "cpu_s": round(statistics.median(processor[name]), 3),
                        "wall_ratio": round(ratio, 4)}
        print(f"{name:10} {record[name]['wall_s']:9.3f} s, {record[name]['cpu_s']:9.3f} s of processor, {ratio:.3f} times neither")
    return record


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--within", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=study_data.ROOT / "build") as folder:  # on the disk, not in memory
        words = Campaign(PROGRAM, folder).run_words if options.tiny else ["run", "examples/quickstart.toml"]
        record = within(words, folder) if options.within else compared(words, folder, options.rounds)
    if options.record:
        cell = ("tiny" if options.tiny else "quickstart") + (", within" if options.within else "")
        study_data.add_record(study_data.ROOT / "benchmarks/results/durability.jsonl", cell, record)
    return 0


if __name__ == "__main__":
    sys.exit(main())
