#!/usr/bin/env python3
"""What verdicts short logs get, of a pendulum with a motor that MuJoCo's own Python logs.

    benchmarks/short_logs.py [--oted PATH] [--seeds 1 2 ...] [--table]

One recording of 0.6, 1.2, 3 or 6 s at 50 Hz, noise of 3 mrad and 0.05 rad/s. Mass, damping and friction are drawn and searched.
Off beside them and not searched: nothing (family), the floor's slope, or a spring. Each case is designed once by `oted design`
with its defaults, but for suspects, which are not tried. Off, a gap that is called closed, or none, is a false word; in family it
is right. One line of JSON for each case; a case that is there is not run again.
"""

import argparse
import collections
import json
import pathlib
import random
import subprocess
import tempfile

import mujoco
import numpy as np

from study_data import ROOT, add_record, commit, records

STUDY = ROOT / "benchmarks/results/short_logs.jsonl"
PERIOD, NOISE = 0.02, (0.003, 0.05)
SECONDS = (0.6, 1.2, 3.0, 6.0)
SLOPE, STIFFNESS = 0.12, 0.3  # [rad], [N m/rad]
MODEL = """<mujoco model="pendulum">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody><body name="rod"><joint name="hinge" axis="0 1 0" damping="0.1" frictionloss="0.08"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.7" contype="0" conaffinity="0"/></body></worldbody>
  <actuator><motor name="motor" joint="hinge" ctrlrange="-5 5"/></actuator>
</mujoco>
"""
TASK = """[task]
model = "pendulum.xml"
control_period = 0.02
observations = ["joint/hinge/qpos", "joint/hinge/qvel"]
[data]
path = "logs.csv"
[parameters]
mass = { field = ["body/rod/mass", "body/rod/inertia"], range = [0.4, 2.5], log = true }
damping = { field = "joint/hinge/damping", range = [0.2, 5.0], log = true }
friction = { field = "joint/hinge/frictionloss", range = [0.2, 5.0], log = true }
"""
OFF = ("family", "slope", "spring")
FALSE_WORDS = ("gap_closed", "no_gap")


def robot(off, truth):
    """The model as the robot is."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    rod = model.body("rod").id
    model.body_mass[rod] *= truth["mass"]
    model.body_inertia[rod] *= truth["mass"]
    model.dof_damping[:] *= truth["damping"]
    model.dof_frictionloss[:] *= truth["friction"]
    if off == "slope":
        model.opt.gravity[:] = [9.81 * np.sin(SLOPE), 0, -9.81 * np.cos(SLOPE)]
    if off == "spring":
        model.jnt_stiffness[:] = STIFFNESS
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def log(model, seconds, seed, path):
    generator = np.random.default_rng(seed)
    data, substeps = mujoco.MjData(model), round(PERIOD / model.opt.timestep)
    paces, phases = generator.uniform(0.2, 1.5, 4), generator.uniform(0, 2 * np.pi, 4)
    lines = ["time,joint/hinge/qpos,joint/hinge/qvel,actuator/motor"]
    for k in range(round(seconds / PERIOD) + 1):
        data.ctrl[0] = 0.8 * np.sin(2 * np.pi * paces * k * PERIOD + phases).sum()
        reading = generator.normal([data.qpos[0], data.qvel[0]], NOISE)
        lines.append(f"{k * PERIOD:.2f},{reading[0]:.9g},{reading[1]:.9g},{data.ctrl[0]:.9g}")
        for _ in range(substeps):
            mujoco.mj_step(model, data)
    path.write_text("\n".join(lines) + "\n")


def run(off, seconds, seed, oted):
    draw = random.Random(f"{off}-{seconds}-{seed}")
    truth = {name: round(float(np.exp(draw.uniform(np.log(0.5), np.log(2)))), 3) for name in ("mass", "damping", "friction")}
    with tempfile.TemporaryDirectory(prefix="oted-short-") as name:
        folder = pathlib.Path(name)
        (folder / "pendulum.xml").write_text(MODEL)
        (folder / "task.toml").write_text(TASK)
        log(robot(off, truth), seconds, seed, folder / "logs.csv")
        done = subprocess.run([str(oted), "design", str(folder / "task.toml"), "--out", str(folder / "run"), "--quiet", "--json",
                               "--set", "design.trajectories.tried=0", "--set", "report.motion=false"],
                              capture_output=True, text=True, check=False)
        if done.returncode not in (0, 4):
            raise SystemExit(f"{off} {seconds} {seed}: exit {done.returncode}: {done.stderr}")
        design = json.loads(done.stdout)["design"]
    return {"off": off, "seconds": seconds, "seed": seed, "truth": truth, "verdict": design["verdict"],
            "parameters": [{key: p[key] for key in ("name", "mode", "interval90", "verdict")} for p in design["parameters"]],
            "commit": commit()}


def table(found):
    print("| off | seconds | verdicts | closed or none | values within | identified |\n|---|---|---|---|---|---|")
    for off in OFF:
        for seconds in SECONDS:
            here = [r for r in found if (r["off"], r["seconds"]) == (off, seconds)]
            if not here:
                continue
            verdicts = collections.Counter(r["verdict"] for r in here)
            values = [(r["truth"][p["name"]], p) for r in here for p in r["parameters"]]
            within = sum(p["interval90"][0] <= truth <= p["interval90"][1] for truth, p in values)
            print(f"| {off} | {seconds} | {', '.join(f'{n} {verdict}' for verdict, n in sorted(verdicts.items()))} "
                  f"| {sum(verdicts[word] for word in FALSE_WORDS)} of {len(here)} | {within} of {len(values)} "
                  f"| {sum(p['verdict'] == 'identified' for _, p in values)} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", type=pathlib.Path, default=ROOT / "build/release/oted")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5, 6, 7, 8])
    parser.add_argument("--table", action="store_true", help="print what is there and run nothing")
    arguments = parser.parse_args()
    for seed in arguments.seeds:
        for off in OFF:
            for seconds in SECONDS:
                cell = f"{off}-{seconds}-{seed}"
                if not arguments.table and cell not in records(STUDY):
                    add_record(STUDY, cell, run(off, seconds, seed, arguments.oted))
    table(list(records(STUDY).values()))


if __name__ == "__main__":
    main()
