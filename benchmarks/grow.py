#!/usr/bin/env python3
"""Whether a design finds what its parameters lack: targets of which one thing is off that nobody searches, and `oted design
--grow`.

  benchmarks/grow.py [--tasks hopper halfcheetah arm]
    [--classes contact inertia delay damping friction_loss tilt force_limit] [--cases 2]
  benchmarks/grow.py --table

Every case draws the searched parameters and the culprit's size, logs some episodes with noise, grows a design with one seed
and leaves one line of JSON; a case that is there is not run again. Hopper and HalfCheetah search friction, gain and gravity
under the shipped medium policies; `arm` is a two-link arm with position servos, which searches their stiffness and a mass.
"""

import argparse
import json
import math
import pathlib
import random
import subprocess
import tempfile
import time

from study_data import HIGH, LOW, MATCHING_ALONE, PARAMETERS, ROOT, TASKS, add_record, commit, records

CULPRITS = {"contact": "geom/*/solref[0]", "inertia": "body/*/inertia", "delay": "action/delay", "damping": "joint/*/damping",
            "friction_loss": "joint/@actuated/frictionloss", "tilt": "opt/gravity[0]",
            "force_limit": "actuator/shoulder/force_limit"}  # which the model lacks; the arm's alone
ARM = """<mujoco><compiler autolimits="true"/><option timestep="0.002"/>
  <default><joint type="hinge" axis="0 1 0" damping="0.5" armature="0.02"/><geom type="capsule" size="0.03"/></default>
  <worldbody><body name="upper" pos="0 0 1"><joint name="shoulder"/><geom fromto="0 0 0 0.4 0 0" mass="2"/>
    <body name="fore" pos="0.4 0 0"><joint name="elbow"/><geom fromto="0 0 0 0.3 0 0" mass="1"/></body></body></worldbody>
  <actuator><position name="shoulder" joint="shoulder" kp="60" kv="3" ctrlrange="-1.5 1.5"/>
    <position name="elbow" joint="elbow" kp="30" kv="1.5" ctrlrange="-1.5 1.5"/></actuator></mujoco>"""
ARM_TASK = """[task]
model = "arm.xml"
control_period = 0.02
observations = ["joint/*/qpos", "joint/*/qvel"]
max_episode_steps = 150
"""
SEARCHED = {"hopper": PARAMETERS, "halfcheetah": PARAMETERS,
            "arm": {"stiffness": "actuator/*/kp", "payload": "body/fore/mass"}}
NOISE = {"hopper": 0.005, "halfcheetah": 0.005, "arm": 0.001}
FRICTION_LOSS = {"hopper": (0.5, 3.0), "halfcheetah": (0.5, 3.0), "arm": (0.2, 0.8)}  # [N m]


def draw(task, kind, rng):
    """The culprit's z, and the searched parameters' ones."""
    truth = {name: round(rng.uniform(0.6, 1.5), 3) for name in SEARCHED[task]}
    if kind == "delay":
        return round(rng.uniform(0.5, 2.5), 2), truth
    if kind == "friction_loss":
        return round(rng.uniform(*FRICTION_LOSS[task]), 2), truth
    if kind == "tilt":  # [m/s^2]: two to six degrees
        return round(rng.choice([-1, 1]) * rng.uniform(0.35, 1.0), 3), truth
    if kind == "force_limit":  # [N m]: 9 hold the arm when it is stretched out
        return round(rng.uniform(7, 14), 2), truth
    return round(math.exp(rng.choice([-1, 1]) * rng.uniform(math.log(1.6), math.log(3))), 3), truth


def applies(kind, task):
    """The arm touches nothing, and the drive that saturates is its own."""
    return kind != ("contact" if task == "arm" else "force_limit")


def task_words(task, folder):
    """--task words; the arm's files are written into `folder`."""
    if task in TASKS:
        return ["--task", TASKS[task]]
    (folder / "arm.xml").write_text(ARM)
    (folder / "task.toml").write_text(ARM_TASK)
    return ["--task", str(folder / "task.toml")]


def policy_of(task):
    return f"examples/policies/{task}/medium.npz" if task in TASKS else "sine:0.5"


def run_case(task, kind, case, oted, extra):
    culprit, truth = draw(task, kind, random.Random(f"grow-{task}-{kind}-{case}"))
    with tempfile.TemporaryDirectory(prefix="oted-grow-") as name:
        folder = pathlib.Path(name)
        words, policy = task_words(task, folder), policy_of(task)
        searched = [word for key, path in SEARCHED[task].items() for word in ("--param", f"{key}={path}:{LOW}:{HIGH}")]
        scale = {"delay": ":0:9:absolute", "friction_loss": ":0:9:absolute", "tilt": ":-2:2:absolute",
                 "force_limit": ":1:500:log:absolute"}.get(kind, ":0.2:5")
        target = [*searched, "--param", f"culprit={CULPRITS[kind]}{scale}", "--truth", f"culprit={culprit}"]
        for key, value in truth.items():
            target += ["--truth", f"{key}={value}"]
        run(oted, "collect", *words, "--policy", policy, "--episodes", 5, "--seed", 100 + case, "--noise", NOISE[task], *target,
            "--out", folder / "demos.npz")
        start = time.monotonic()
        run(oted, "design", *words, "--data", folder / "demos.npz", "--seed", case, "--seeds", 1, "--threads", 1, "--grow",
            *searched, "--set", "report.motion=false", *extra, "--out", folder / "run", "--quiet")
        seconds = time.monotonic() - start
        design = json.loads((folder / "run/design.json").read_text())
        first = json.loads((folder / "run/growth/1/growth.json").read_text())
    return {"task": task, "class": kind, "case": case, "culprit": culprit, "truth": truth, "seconds": round(seconds, 1),
            "suspects": first["suspects"], "grown": [grown["field"] for grown in design.get("grown", [])],
            "parameters": [{key: p[key] for key in ("name", "field", "mode", "std")} for p in design["parameters"]],
            "verdict": design["verdict"], "sentence": design["sentence"], "commit": commit()}


def run(*words):
    result = subprocess.run([str(word) for word in words], cwd=ROOT, capture_output=True, text=True, check=False)
    if result.returncode not in (0, 4):
        raise SystemExit(f"{' '.join(map(str, words))}\n{result.stderr}")


def print_table(found):
    print("| task | class | cases | tried first | named | joined the parameters | within 10 % | floor reached |")
    print("|---|---|---|---|---|---|---|---|")
    groups = sorted({(r["task"], r["class"]) for r in found})
    for task, kind in [*groups, ("all", "all")]:
        of = [r for r in found if (r["task"], r["class"]) == (task, kind) or task == "all"]
        count = [0] * 5
        for r in of:
            path = CULPRITS[r["class"]]
            fields = [suspect["field"] for suspect in r["suspects"]]
            mode = next((p["mode"] for p in r["parameters"] if p["field"] == path), None)
            for i, holds in enumerate((fields[:1] == [path], path in fields, path in r["grown"],
                                       mode is not None and abs(mode / r["culprit"] - 1) < 0.1,
                                       r["verdict"] in ("no_gap", "gap_closed"))):
                count[i] += holds
        print(f"| {task} | {kind} | {len(of)} | {' | '.join(map(str, count))} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", default=ROOT / "build/release/oted", type=pathlib.Path)
    parser.add_argument("--out", default=ROOT / "benchmarks/results/grow.jsonl", type=pathlib.Path)
    parser.add_argument("--tasks", default=list(SEARCHED), choices=SEARCHED, nargs="+")
    parser.add_argument("--classes", default=list(CULPRITS), choices=CULPRITS, nargs="+")
    parser.add_argument("--cases", default=2, type=int)
    parser.add_argument("--set", default=[], action="append", help="passed on to oted design")
    parser.add_argument("--table", action="store_true", help="print the table of what is there; run nothing")
    arguments = parser.parse_args()
    if not arguments.table:
        extra = [word for setting in (*MATCHING_ALONE, *arguments.set) for word in ("--set", setting)]
        for case in range(1, arguments.cases + 1):
            for task in arguments.tasks:
                for kind in arguments.classes:
                    name = f"{task}-{kind}-{case}"
                    if name in records(arguments.out) or not applies(kind, task):
                        continue
                    add_record(arguments.out, name, run_case(task, kind, case, arguments.oted.resolve(), extra))
    print_table(list(records(arguments.out).values()))


if __name__ == "__main__":
    main()
