#!/usr/bin/env python3
"""Which form finds the better simulator where none of the family is right, and does held-out evidence pick it?

  benchmarks/held_out_replay.py [--cases 1 2 3 4] [--noise 0 0.02] [--forms trajectories transitions paper]
  benchmarks/held_out_replay.py --table

Every case is a Hopper of which friction, gain and gravity are drawn and searched, and something that is not searched is off.
The shipped medium policy logs five episodes for the designs, and five more without noise that no design sees: the simulator of
each form is set to their states, takes their actions, and its error after 1 and 10 control steps is the truth here. Needs
mujoco and gymnasium (requirements-test.txt).
"""

import argparse
import importlib.util
import json
import math
import pathlib
import random
import subprocess
import tempfile
import time

import numpy as np
from study_data import HIGH, LOW, PARAMETERS, ROOT, commit, write_record

OFF = {1: ("damping", "joint/*/damping", 1.6), 2: ("armature", "joint/*/armature", 0.4), 3: ("torso", "body/torso/mass", 1.6),
       4: ("damping", "joint/*/damping", 0.5), 5: ("density", "opt/density", None)}
STEPS = (1, 10)
FRAME_SKIP, CLIP = 4, 10
SETTINGS = {"squares10": {"form": "least-squares", "least_squares_horizon": 10},
            "short": {"form": "trajectories", "trajectory_window": 2}}


def truth_of(case):
    rng = random.Random(f"held out {case}")
    return {name: round(rng.uniform(0.6, 1.5), 3) for name in PARAMETERS} | {OFF[case][0]: OFF[case][2]}


def collect(oted, case, noise, seed, file):
    command = [oted, "collect", "--task", "Hopper-v5", "--policy", "examples/policies/hopper/medium.npz", "--episodes", "5",
               "--seed", seed, "--threads", "1", "--out", file]
    for name, value in truth_of(case).items():
        field = PARAMETERS.get(name) or OFF[case][1]
        command += ["--param", f"{name}={field}:0.2:3.0", "--truth", f"{name}={value}"]
    if noise:
        command += ["--noise", noise]
    subprocess.run([str(word) for word in command], cwd=ROOT, check=True, capture_output=True)


def replay_errors(data, z):
    """{steps: median over all windows of the root mean square over channels, in their spreads} in the simulator at z."""
    import mujoco

    folder = pathlib.Path(importlib.util.find_spec("gymnasium").origin).parent
    model = mujoco.MjModel.from_xml_path(str(folder / "envs/mujoco/assets/hopper.xml"))
    model.geom_friction[:, 0] *= z[0]
    model.actuator_gainprm[:, 0] *= z[1]
    model.opt.gravity[2] *= z[2]
    state = mujoco.MjData(model)
    logged, after, actions = data["observations"], data["next_observations"], data["actions"]
    spread = logged.std(axis=0)
    ends = np.flatnonzero(np.ravel(data["terminals"]) + np.ravel(data["timeouts"]) > 0)
    errors = {steps: [] for steps in STEPS}
    begin = 0
    for end in ends:
        for row in range(begin, end + 1 - max(STEPS), 5):
            if np.abs(logged[row, 5:]).max() >= CLIP:
                continue
            mujoco.mj_resetData(model, state)
            state.qpos[1:], state.qvel[:] = logged[row, :5], logged[row, 5:]
            for step in range(1, max(STEPS) + 1):
                state.ctrl[:] = actions[row + step - 1]
                mujoco.mj_step(model, state, FRAME_SKIP)
                if step in errors:
                    shown = np.hstack([state.qpos[1:], np.clip(state.qvel, -CLIP, CLIP)])
                    errors[step].append(math.sqrt(np.mean(((shown - after[row + step - 1]) / spread) ** 2)))
        begin = end + 1
    return {str(steps): {"median": float(np.median(of)), "rms": math.sqrt(np.mean(np.square(of))),
                         "geometric": float(np.exp(np.mean(np.log(of))))} for steps, of in errors.items()}


def run_case(oted, case, noise, forms, threads, file):
    with tempfile.TemporaryDirectory(prefix="oted-held-out-") as folder:
        logs, unseen = f"{folder}/logs.npz", f"{folder}/unseen.npz"
        collect(oted, case, noise, 1000 + case, logs)
        collect(oted, case, 0, 2000 + case, unseen)
        text = f'[task]\nname = "Hopper-v5"\n[data]\npath = "{logs}"\n[run]\nseed = {case}\nthreads = {threads}\n'
        text += '[selection]\nn_seeds = 1\n[report]\nmotion = "false"\n[parameters]\n'
        text += "".join(f'{name} = {{ field = "{field}", range = [{LOW}, {HIGH}] }}\n' for name, field in PARAMETERS.items())
        data = np.load(unseen)
        record = {"case": case, "noise": noise, "truth": truth_of(case), "forms": {}, "commit": commit()}
        for form in forms:
            config = pathlib.Path(folder) / f"{form}.toml"
            setting = SETTINGS.get(form, {"form": form})
            lines = "".join(f"{key} = {json.dumps(value)}\n" for key, value in setting.items())
            config.write_text(text + f"[design]\n{lines}")
            start = time.monotonic()
            result = subprocess.run([str(oted), "design", str(config), "--out", f"{folder}/{form}", "--json", "--quiet"], cwd=ROOT,
                                    capture_output=True, text=True, check=False)
            if result.returncode not in (0, 4):
                raise SystemExit(result.stderr)
            design = json.loads(result.stdout)["design"]
            z = design["mixture"][0]["mode"]
            record["forms"][form] = {"mode": z, "seconds": round(time.monotonic() - start, 1), "verdict": design["verdict"],
                                     "common": design["settings"][0]["common"], **replay_errors(data, z)}
            record["nominal_common"] = design["nominal_common"]
        record["nominal"] = replay_errors(data, [1.0, 1.0, 1.0])
    write_record(file, record)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, nargs="*", default=[1, 2, 3, 4])
    parser.add_argument("--noise", type=float, nargs="*", default=[0, 0.02])
    parser.add_argument("--forms", nargs="*", default=["trajectories", "transitions", "paper"])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--oted", type=pathlib.Path, default=ROOT / "build/release/oted")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "benchmarks/results/held_out_replay")
    args = parser.parse_args()
    for noise in args.noise:
        for case in args.cases:
            file = args.out / f"hopper-{noise:g}-{case}.json"
            if not file.exists():
                run_case(args.oted.resolve(), case, noise, args.forms, args.threads, file)
                print(file.name, json.dumps(json.loads(file.read_text())["forms"]), flush=True)
