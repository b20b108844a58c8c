#!/usr/bin/env python3
"""How agents share cores: seconds of `oted train` for one, two and four agents on one and two threads, interleaved.

  benchmarks/agent_scaling.py [--task hopper] [--steps 10000] [--rounds 3]
  benchmarks/agent_scaling.py --agents 1 --lanes 16 --updates-per-step 0.02 --steps 100000
  benchmarks/agent_scaling.py --table

One short design, which every run copies; then stage 4 alone: CrossQ from one start, networks of 2x256, batches of 256, one update
a step unless told otherwise.
Rounds go through all cases in turn, so that what else the machine does falls on each alike. The policies of a case are the
same bytes whatever the number of threads, or the script ends with an error.
"""

import argparse
import hashlib
import os
import pathlib
import shutil
import statistics
import subprocess
import tempfile
import time

from sac_peers import processor
from study_data import MATCHING_ALONE, PARAMETERS, ROOT, TASKS, add_record, commit, parameter_words, records

OUT = ROOT / "benchmarks/results/agent_scaling.jsonl"


def oted(program, verb, *words):
    result = subprocess.run([str(program), verb, *words], cwd=ROOT, capture_output=True, text=True, check=False)
    if result.returncode not in (0, 4):
        raise SystemExit(result.stderr)


def train(arguments, designed, folder, agents, threads):
    """(seconds, digest of the policies)"""
    shutil.copytree(designed, folder)
    # Short runs learn too: the default waits longer for its first gradient step than some of them last.
    settings = {"agents.n_agents": agents, "agents.algorithm": "crossq", "crossq.n_steps": arguments.steps, "crossq.learning_starts": 1000,
                "crossq.n_lanes": arguments.lanes, "crossq.updates_per_step": arguments.updates_per_step, "crossq.n_starts": 1,
                "crossq.hidden": "256,256", "crossq.critic_hidden": "256,256", "crossq.batch_size": 256, "crossq.average_over": 1}
    start = time.monotonic()
    oted(arguments.oted, "train", "--out", str(folder), "--threads", str(threads), "--quiet",
         *(word for name, value in settings.items() for word in ("--set", f"{name}={value}")))
    seconds = time.monotonic() - start
    digest = hashlib.sha256(b"".join((folder / f"agents/{j}/policy.npz").read_bytes() for j in range(1, agents + 1)))
    shutil.rmtree(folder)
    return seconds, digest.hexdigest()


def run(arguments):
    cases = [(agents, threads) for agents in arguments.agents for threads in (1, 2)]
    seconds, digests = {case: [] for case in cases}, {}
    with tempfile.TemporaryDirectory(prefix="oted-scaling-") as folder:
        designed = pathlib.Path(folder) / "designed"
        settings = [word for setting in MATCHING_ALONE for word in ("--set", setting)]
        oted(arguments.oted, "design", "--task", TASKS[arguments.task], "--data", f"examples/data/{arguments.task}-medium.hdf5",
             "--seeds", "1", "--quiet", "--out", str(designed), *parameter_words(PARAMETERS), *settings)
        for _ in range(arguments.rounds):
            for agents, threads in cases:
                took, digest = train(arguments, designed, pathlib.Path(folder) / "run", agents, threads)
                seconds[agents, threads].append(round(took, 2))
                if digests.setdefault(agents, digest) != digest:
                    raise SystemExit(f"{agents} agents on {threads} threads: other bytes than before")
                print(f"{agents} agents, {threads} threads: {took:.1f} s", flush=True)
    name = arguments.task
    if arguments.lanes > 1 or arguments.updates_per_step != 1:
        name += f"-{arguments.lanes}-lanes-{arguments.updates_per_step:g}-updates"
    add_record(OUT, name, {
        "task": arguments.task, "n_steps": arguments.steps, "n_lanes": arguments.lanes,
        "updates_per_step": arguments.updates_per_step, "n_cores": os.cpu_count(), "processor": processor(),
        "cases": [{"agents": agents, "threads": threads, "seconds": of} for (agents, threads), of in seconds.items()],
        "commit": commit()})


def table():
    print("| task | agents | lanes, updates per step | s, one thread | two threads | steps per second of all, two threads "
          "| faster, by rounds |\n|" + "---|" * 7)
    for record in records(OUT).values():
        seconds = {(case["agents"], case["threads"]): case["seconds"] for case in record["cases"]}
        for agents in sorted({agents for agents, _ in seconds}):
            one, two = seconds[agents, 1], seconds[agents, 2]
            ratios = [a / b for a, b in zip(one, two)]
            print(f"| {record['task']} | {agents} | {record.get('n_lanes', 1)}, {record.get('updates_per_step', 1):g} | "
                  f"{statistics.median(one):.1f} | {statistics.median(two):.1f} | "
                  f"{agents * record['n_steps'] / statistics.median(two):.0f} | "
                  f"{statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f}) |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", type=pathlib.Path, default=ROOT / "build/release/oted")
    parser.add_argument("--task", choices=TASKS, default="hopper")
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--agents", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--lanes", type=int, default=1)
    parser.add_argument("--updates-per-step", type=float, default=1)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--table", action="store_true", help="print the table of what is there; run nothing")
    arguments = parser.parse_args()
    if not arguments.table:
        run(arguments)
    table()


if __name__ == "__main__":
    main()
