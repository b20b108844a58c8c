#!/usr/bin/env python3
"""Which form finds the better simulator where none of the family is right, and does held-out evidence pick it?

  benchmarks/held_out_replay.py [--cases 1 2 3] [--noise 0 0.02] [--forms auto trajectories transitions least-squares paper]
  benchmarks/held_out_replay.py --table

Every case is a Hopper of which friction, gain and gravity are drawn and searched, and something that is not searched is off.
The shipped medium policy logs five episodes for the designs, and five more without noise that no design sees: the simulator of
each form is set to their states and takes their actions, and its error after 1 and 10 control steps is the truth here. Each case
leaves one line of JSON; forms that it holds are not run again. Needs mujoco and gymnasium (requirements-test.txt).
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
from study_data import HIGH, LOW, PARAMETERS, ROOT, add_record, collect, commit, records

OFF = {1: ("damping", "joint/*/damping", 1.6), 2: ("armature", "joint/*/armature", 0.4), 3: ("torso", "body/torso/mass", 1.6)}
FORMS = ("trajectories", "transitions", "least-squares", "paper")
STEPS = (1, 10)
FRAME_SKIP, CLIP = 4, 10


def truth_of(case):
    rng = random.Random(f"held out {case}")
    return {name: round(rng.uniform(0.6, 1.5), 3) for name in PARAMETERS} | {OFF[case][0]: OFF[case][2]}


def replay_errors(data, z):
    """Per number of steps, over windows: the root mean square over channels, in their spreads, in the simulator at z."""
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


def design_by(oted, form, case, logs, folder):
    config = pathlib.Path(folder) / f"{form}.toml"
    text = f'[task]\nname = "Hopper-v5"\n[data]\npath = "{logs}"\n[run]\nseed = {case}\nthreads = 1\n'
    text += f'[selection]\nn_seeds = 1\n[report]\nmotion = "false"\n[design]\nmethod = "{form}"\n[parameters]\n'
    text += "".join(f'{name} = {{ field = "{field}", range = [{LOW}, {HIGH}] }}\n' for name, field in PARAMETERS.items())
    config.write_text(text)
    command = [str(oted), "design", str(config), "--out", f"{folder}/{form}", "--json", "--quiet"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if result.returncode not in (0, 4):
        raise SystemExit(result.stderr)
    return json.loads(result.stdout)["design"]


def run_case(oted, case, noise, forms, out):
    name = f"hopper-{noise:g}-{case}"
    record = records(out).get(name, {"case": case, "noise": noise, "truth": truth_of(case), "forms": {}})
    missing = [form for form in forms if form not in record["forms"]]
    if not missing:
        return
    with tempfile.TemporaryDirectory(prefix="oted-held-out-") as folder:
        logs, unseen = f"{folder}/logs.npz", f"{folder}/unseen.npz"
        truth = truth_of(case)
        fields = {name: PARAMETERS.get(name) or OFF[case][1] for name in truth}
        collect(oted, "hopper", fields, truth, 1000 + case, logs, noise)
        collect(oted, "hopper", fields, truth, 2000 + case, unseen)
        data = np.load(unseen)
        record["nominal"] = replay_errors(data, [1.0, 1.0, 1.0])
        for form in missing:
            start = time.monotonic()
            design = design_by(oted, form, case, logs, folder)
            z = design["mixture"][0]["mode"]
            result = {"mode": z, "seconds": round(time.monotonic() - start, 1), "verdict": design["verdict"],
                      "commit": commit(), **replay_errors(data, z)}
            if form == "auto":
                # What each form made of four fifths of the logs, as auto saw it and as it is.
                result["choice"] = design["method_choices"][0]
                for tried in result["choice"]["tried"]:
                    tried["truth"] = replay_errors(data, tried["mode"])
            record["forms"][form] = result
            add_record(out, name, record)
            print(name, form, json.dumps(result), flush=True)


def print_table(out):
    print(f"| off, noise | error after 10 steps: {', '.join(FORMS)} | auto: held-out error (its truth) of each form tried | auto "
          "takes |\n|---|---|---|---|")
    for record in records(out).values():
        forms = record["forms"]
        name, _, factor = OFF[record["case"]]
        error = [f"{forms[form]['10']['geometric']:.4f}" for form in FORMS]
        choice = forms.get("auto", {}).get("choice", {"tried": [], "method": ""})
        tried = [f"{t['method']} {t['error']:.3g} ({t['truth']['10']['geometric']:.4f})" for t in choice["tried"]]
        print(f"| {name} {factor}, {record['noise']:g} | {', '.join(error)} | {', '.join(tried)} | {choice['method']} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, nargs="*", default=list(OFF))
    parser.add_argument("--noise", type=float, nargs="*", default=[0, 0.02])
    parser.add_argument("--forms", nargs="*", default=["auto", *FORMS])
    parser.add_argument("--oted", type=pathlib.Path, default=ROOT / "build/release/oted")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "benchmarks/results/held_out_replay.jsonl")
    parser.add_argument("--table", action="store_true")
    args = parser.parse_args()
    if args.table:
        print_table(args.out)
    else:
        for noise in args.noise:
            for case in args.cases:
                run_case(args.oted.resolve(), case, noise, args.forms, args.out)
