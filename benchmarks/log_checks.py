#!/usr/bin/env python3
"""How often `oted data check` proposes a change of the columns: of sound logs of robots that differ from their model, and of the
same logs with one fault planted.

    benchmarks/log_checks.py [--robots arm ant ...] [--seeds 1 2 3] [--faults sign ...] [--table]

The robots are those of tests/cli/log_robots.py. Each case draws one to three differences (masses, centres of mass, springs,
damping, dry friction, gains) that the model does not know, noise, and whether velocities are logged, from its robot and seed
alone. A case is one line of JSON; one that is there is not run again.
"""

import argparse
import json
import pathlib
import random
import re
import subprocess
import sys
import tempfile

import mujoco

from study_data import ROOT, add_record, commit, records

sys.path.insert(0, str(ROOT / "tests/cli"))
import log_robots  # noqa: E402

STUDY = ROOT / "benchmarks/results/log_checks.jsonl"
# What changes the meaning of columns: oted/checks/correction.cc.
CORRECTIONS = ("joint_sign", "mirrored_joint", "swapped_joints", "joint_zero", "joint_unit", "action_sign", "swapped_actions",
               "action_unit")
FAULTS = ("sign", "swapped joints", "encoder offset", "degrees", "action sign", "swapped actions", "mirrored joint")
ROBOTS = log_robots.ROBOTS


def differ(model, draw):
    """Makes the robot another than its model. @return what differs, in words"""
    def drawn_factor(low, high):
        return round(draw.uniform(low, high) ** draw.choice((-1, 1)), 3)

    def scale(values, low, high):
        there = [i for i, value in enumerate(values) if value > 0]
        if not there:
            return None
        index = draw.choice(there)
        factor = drawn_factor(low, high)
        values[index] *= factor
        return f"{index} x {factor}"

    def mass():
        index = draw.randrange(1, model.nbody)
        factor = drawn_factor(1.2, 2)
        model.body_mass[index] *= factor
        model.body_inertia[index] *= factor
        return f"{index} x {factor}"

    def centre():
        index, axis = draw.randrange(1, model.nbody), draw.randrange(3)
        shift = round(draw.uniform(-0.03, 0.03), 4)
        model.body_ipos[index, axis] += shift
        return f"{index}[{axis}] + {shift}"

    def gain():
        index = draw.randrange(model.nu)
        factor = drawn_factor(1.15, 1.7)
        model.actuator_gear[index] *= factor
        return f"{index} x {factor}"

    def dry_friction():
        index = draw.randrange(model.nv)
        limit = max(abs(model.actuator_gear[:, 0]).max() * 0.05, model.dof_frictionloss[index])
        model.dof_frictionloss[index] = limit
        return f"{index} = {limit:.3g}"

    ways = {"mass": mass, "centre": centre, "gain": gain, "dry friction": dry_friction,
            "damping": lambda: scale(model.dof_damping, 1.3, 3), "stiffness": lambda: scale(model.jnt_stiffness, 1.2, 2)}
    found = {way: ways[way]() for way in draw.sample(list(ways), draw.randint(1, 3))}
    return {way: what for way, what in found.items() if what is not None}


def check(oted, robot, log, folder):
    task = log_robots.write(robot, log, folder)
    result = subprocess.run([oted, "data", "check", task, "--json", "--threads", "1"], capture_output=True, text=True, check=False)
    return json.loads(result.stdout)["findings"]


def said(finding):
    """What the correction leaves and what there was, in shares of the channels' change."""
    numbers = re.search(r"misses .*? by (\S+) of the change, as logged by (\S+) \(", finding["what"])
    return {"check": finding["check"], "channels": finding["channels"], "remedy": finding["remedy"],
            "left": float(numbers[1]), "before": float(numbers[2])} if numbers else None


def run_case(oted, name, seed, fault):
    draw = random.Random(f"log of {name} {seed}")
    robot = log_robots.dataclasses.replace(ROBOTS[name], episodes=4, positions_alone=draw.random() < 0.5)
    noise = draw.choice((0.0, 3e-4, 1e-3, 3e-3))
    differences = {}
    log = log_robots.drive(robot, seed, lambda model: differences.update(differ(model, draw)), noise)
    wanted = None
    if fault != "none":
        log, (kind, channels) = log_robots.plant(fault, robot, log, log_robots.hinges_of(robot))
        wanted = {"check": kind, "channels": [c for c in channels if not (robot.positions_alone and "/qvel" in c)]}
    with tempfile.TemporaryDirectory() as folder:
        findings = check(oted, robot, log, folder)
    return {"robot": name, "seed": seed, "fault": fault, "differences": differences, "noise": noise,
            "positions_alone": robot.positions_alone, "wanted": wanted,
            "found": [s for f in findings if f["check"] in CORRECTIONS and f["severity"] != "note" and (s := said(f))]}


def is_found(record):
    return any(f["check"] == record["wanted"]["check"] and set(record["wanted"]["channels"]) <= set(f["channels"])
               for f in record["found"])


def table(rows):
    print("| fault | cases | told | another change told |\n|---|---|---|---|")
    for fault in ("none", *FAULTS):
        of_fault = [r for r in rows if r["fault"] == fault]
        if not of_fault:
            continue
        if fault == "none":
            print(f"| none | {len(of_fault)} | | {sum(bool(r['found']) for r in of_fault)} |")
            continue
        n_told, n_found = (sum(map(of, of_fault)) for of in (lambda r: bool(r["found"]), is_found))
        print(f"| {fault} | {len(of_fault)} | {n_found} | {n_told - n_found} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", type=pathlib.Path, default=ROOT / "build/release/oted")
    parser.add_argument("--out", type=pathlib.Path, default=STUDY)
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS), choices=list(ROBOTS))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--faults", nargs="+", default=["none", *FAULTS], choices=["none", *FAULTS])
    parser.add_argument("--table", action="store_true", help="run nothing: print the counts")
    args = parser.parse_args()
    if args.table:
        table(list(records(args.out).values()))
        return
    done = records(args.out)
    for seed in args.seeds:
        for name in args.robots:
            for fault in args.faults:
                joints = len(log_robots.hinges_of(ROBOTS[name]))
                if fault != "none" and (joints < 2 or not log_robots.is_there(fault, ROBOTS[name])):
                    continue
                cell = f"{name}-{seed}-{fault.replace(' ', '_')}"
                if cell not in done:
                    add_record(args.out, cell, run_case(args.oted, name, seed, fault) | {"commit": commit()})


if __name__ == "__main__":
    main()
