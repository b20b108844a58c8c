"""Environment steps per second of our grid worlds beside the Python package's, interleaved, by CPU time.

usage: minigrid_speed.py [--rounds N] [--program build/bench/benchmarks/bench_minigrid]

Each round runs every case once in our program and once in the package, so that what else the machine does falls on
both alike; medians are printed. Random turns and forward moves, resets included, one core.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import time

os.environ["PYGAME_HIDE_SUPPORT_PROMPT"] = "1"
ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "oracle"))

import numpy as np  # noqa: E402
from minigrid_dump import make  # noqa: E402  the package's environments, as the oracle test makes them

# Our case, and the same settings for the package.
CASES = {
    "Obstacles10x10": "MiniGrid-Obstacles-10x10 density=0.2 obstacle=wall collision=block see_through_walls=false",
    "Obstacles10x10_see_through":
        "MiniGrid-Obstacles-10x10 density=0.2 obstacle=wall collision=block see_through_walls=true",
    "Empty8x8": "MiniGrid-Empty-8x8-v0 see_through_walls=true",
    "FourRooms": "MiniGrid-FourRooms-v0 see_through_walls=false",
    "DynamicObstacles8x8": "MiniGrid-Dynamic-Obstacles-8x8-v0 see_through_walls=true",
}
PACKAGE_STEPS = 3000


def ours(program, case):
    command = [program, f"--benchmark_filter=^Step/{case}/lanes:64$", "--benchmark_format=json",
               "--benchmark_min_time=0.2"]
    result = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return result["benchmarks"][0]["items_per_second"]


def package(text):
    env, _ = make(text)
    env.reset(seed=1)
    actions = np.random.default_rng(1).integers(0, 3, PACKAGE_STEPS).tolist()
    started = time.process_time()
    for action in actions:
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()
    return PACKAGE_STEPS / (time.process_time() - started)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--program", default=str(ROOT / "build/bench/benchmarks/bench_minigrid"))
    args = parser.parse_args()
    rates = {case: ([], []) for case in CASES}
    for _ in range(args.rounds):
        for case, text in CASES.items():
            rates[case][0].append(ours(args.program, case))
            rates[case][1].append(package(text))
    print("| thousand steps per second, one core | ours, 64 lanes | minigrid | ratio |\n|---|---|---|---|")
    for case, (a, b) in rates.items():
        mine, theirs = statistics.median(a), statistics.median(b)
        print(f"| {case} | {mine / 1e3:.0f} | {theirs / 1e3:.1f} | {mine / theirs:.0f} |")


if __name__ == "__main__":
    main()
