#!/usr/bin/env python3
"""Whether designs find what is known of robots of other makers, from logs as such robots give them.

    benchmarks/known_robots.py [--cases finger-positions ...] [--seeds 1 2 3] [--table]

The logs are made by MuJoCo's own Python and nothing of oted: smooth random commands at 100 Hz, encoders with noise and steps of
2 pi / 4096, velocities that are differences of the readings. Each case draws the truth of its parameters anew for each seed (but
for those that have a fixed one), designs with `oted design` and no other settings, and leaves one line of JSON; a case that is
there is not run again.

  finger-positions  dm_control's finger, positions alone: damping and gear
  finger            the same with velocities
  arm-positions     six joints with position servos, positions alone: friction, damping, a payload, a delay of the commands
  arm-late          the same with velocities that are 20 ms late and commands that are 1.6 rows late (16 ms)
  arm-stiffness     the servos' stiffness is 15 % off and not searched: no parameter may be identified, and no gap closed
  arm-rest          the commands stand still: what a robot at rest does not show must not be identified
  ant-noisy         Gymnasium's Ant with a free base, noise of 0.01 on the whole state: friction, gain, gravity
"""

import argparse
import json
import pathlib
import random
import resource
import subprocess
import tempfile
import time

import gymnasium.envs.mujoco
import mujoco
import numpy as np

from study_data import ROOT, add_record, commit, records

STUDY = ROOT / "benchmarks/results/known_robots.jsonl"
STEP = 2 * np.pi / 4096  # of an encoder [rad]
NOISE = 0.0005  # of one [rad]
ARM = """<mujoco model="servo arm">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <default><joint damping="2" armature="0.1" frictionloss="0.5"/><geom contype="0" conaffinity="0"/>
    <position kp="400" kv="20" forcerange="-120 120" ctrlrange="-3 3"/></default>
  <worldbody>
    <body name="shoulder" pos="0 0 0.3"><joint name="pan" axis="0 0 1"/><geom type="capsule" size="0.06 0.1" mass="4"/>
      <body name="upper" pos="0 0 0.1"><joint name="lift" axis="0 1 0"/>
        <geom type="capsule" size="0.05" fromto="0 0 0 0.35 0 0" mass="4"/>
        <body name="fore" pos="0.35 0 0"><joint name="elbow" axis="0 1 0"/>
          <geom type="capsule" size="0.04" fromto="0 0 0 0.3 0 0" mass="2.5"/>
          <body name="wrist" pos="0.3 0 0"><joint name="roll" axis="1 0 0"/>
            <geom type="capsule" size="0.035" fromto="0 0 0 0.1 0 0" mass="1.2"/>
            <body name="hand" pos="0.1 0 0"><joint name="pitch" axis="0 1 0"/>
              <geom type="capsule" size="0.035" fromto="0 0 0 0.1 0 0" mass="1"/>
              <body name="payload" pos="0.15 0 0"><joint name="turn" axis="1 0 0" armature="0.02"/>
                <geom type="box" size="0.04 0.03 0.05" mass="0.5"/>
              </body></body></body></body></body></body>
  </worldbody>
  <actuator>
    <position name="pan" joint="pan"/><position name="lift" joint="lift"/><position name="elbow" joint="elbow"/>
    <position name="roll" joint="roll" kp="80" kv="4" forcerange="-30 30"/>
    <position name="pitch" joint="pitch" kp="80" kv="4" forcerange="-30 30"/>
    <position name="turn" joint="turn" kp="80" kv="4" forcerange="-30 30"/>
  </actuator>
</mujoco>
"""
POSITIONS, VELOCITIES = '"joint/*/qpos"', '"joint/*/qpos", "joint/*/qvel"'
ARM_PARAMETERS = {
    "friction": ("joint/*/frictionloss", 0.2, 5.0, "log = true"),
    "damping": ("joint/*/damping", 0.2, 5.0, "log = true"),
    "payload": (["body/payload/mass", "body/payload/inertia"], 0.2, 5.0, "log = true"),
}
DELAY = {"delay": ("action/delay", 0.0, 4.0, 'scale = "absolute"')}
# model, control period [s], observations, parameters, truths that are fixed, quantities that are off and not searched
CASES = {
    "finger-positions": ("finger", 0.02, POSITIONS, {}, {}),
    "finger": ("finger", 0.02, VELOCITIES, {}, {}),
    "arm-positions": ("arm", 0.01, POSITIONS, ARM_PARAMETERS | DELAY, {}),
    "arm-late": ("arm", 0.01, VELOCITIES, ARM_PARAMETERS | DELAY, {"delay": 1.6}),
    "arm-stiffness": ("arm", 0.01, VELOCITIES, ARM_PARAMETERS, {"delay": 0.0, "stiffness": 1.15}),
    "arm-rest": ("arm", 0.01, VELOCITIES, ARM_PARAMETERS, {"delay": 0.0}),
    "ant-noisy": ("ant", 0.05, VELOCITIES, {}, {}),
}
LATE = {"arm-late": 2}  # rows
OTHERS = {
    "finger": {"damping": (["joint/proximal/damping", "joint/distal/damping"], 0.2, 3.0, "log = true"),
               "gear": ("actuator/*/gear[0]", 0.3, 3.0, "log = true")},
    "ant": {"friction": ("geom/*/friction[0]", 0.2, 2.0, "log = false"), "gain": ("actuator/*/gear[0]", 0.2, 2.0, "log = false"),
            "gravity": ("opt/gravity[2]", 0.2, 2.0, "log = false")},
}


def model_file(robot, folder):
    if robot == "arm":
        (folder / "arm.xml").write_text(ARM)
        return folder / "arm.xml"
    if robot == "ant":
        return pathlib.Path(gymnasium.envs.mujoco.__file__).parent / "assets/ant.xml"
    import dm_control  # pylint: disable=import-outside-toplevel

    return pathlib.Path(dm_control.__file__).parent / "suite/finger.xml"


def change(robot, model, truth):
    """The model as the robot is."""
    if robot == "finger":
        for joint in ("proximal", "distal"):
            model.dof_damping[model.joint(joint).dofadr] *= truth["damping"]
        model.actuator_gear[:, 0] *= truth["gear"]
    elif robot == "ant":
        model.geom_friction[:, 0] *= truth["friction"]
        model.actuator_gear[:, 0] *= truth["gain"]
        model.opt.gravity[2] *= truth["gravity"]
    else:
        model.dof_frictionloss[:] *= truth["friction"]
        model.dof_damping[:] *= truth["damping"]
        payload = model.body("payload").id
        model.body_mass[payload] *= truth["payload"]
        model.body_inertia[payload] *= truth["payload"]
        model.actuator_gainprm[:, 0] *= truth.get("stiffness", 1.0)
        model.actuator_biasprm[:, 1] *= truth.get("stiffness", 1.0)
    mujoco.mj_setConst(model, mujoco.MjData(model))


def record(case, path, truth, seed, folder):
    """Six recordings of the robot, as CSV."""
    robot, period = CASES[case][:2]
    model = mujoco.MjModel.from_xml_path(str(model_file(robot, folder)))
    change(robot, model, truth)
    generator = np.random.default_rng(seed)
    n_rows, substeps = (150, 200)[robot == "ant"] if robot != "arm" else 500, round(period / model.opt.timestep)
    late = round(truth.get("delay", 0.0) * substeps)  # physics steps
    low, high = np.where(model.actuator_ctrllimited, model.actuator_ctrlrange.T, np.array([[-1.0], [1.0]]))
    hinges = [j for j in range(model.njnt) if model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE]
    lines = []
    for episode in range(6):
        data = mujoco.MjData(model)
        if robot == "ant":
            data.qpos[2] = 0.6
        phase, pace = generator.uniform(0, 6, (2, model.nu)), generator.uniform(0.3, 1.5 if robot == "arm" else 3.0, (2, model.nu))
        offset = generator.uniform(-0.5, 0.5, model.nu) if robot == "arm" else np.zeros(model.nu)
        size = (0 if case == "arm-rest" else 0.4) if robot == "arm" else 0.5
        commands = np.array([offset + size * np.sin(2 * np.pi * pace * k * period + phase).sum(axis=0) for k in range(n_rows + 1)])
        if robot != "arm":
            commands = np.clip(commands + generator.normal(0, 0.2, commands.shape), low, high)
        if robot == "arm":
            data.qpos[:] = commands[0]
        positions, velocities = [], []
        for step in range(n_rows * substeps + 1):
            if step % substeps == 0:
                positions.append(data.qpos.copy())
                velocities.append(data.qvel.copy())
            data.ctrl[:] = commands[max(0, step - late) // substeps]
            mujoco.mj_step(model, data)
        positions, velocities = np.array(positions), np.array(velocities)
        if robot == "ant":
            positions += generator.normal(0, 0.01, positions.shape)
            velocities += generator.normal(0, 0.01, velocities.shape)
        else:
            positions = STEP * np.round((positions + generator.normal(0, NOISE, positions.shape)) / STEP)
            velocities = np.gradient(positions, period, axis=0)
            shift = LATE.get(case, 0)
            velocities = np.vstack([np.repeat(velocities[:1], shift, axis=0), velocities[:len(velocities) - shift]])
        lines += [[episode, f"{k * period:.4f}", *positions[k], *velocities[k], *commands[k]] for k in range(n_rows + 1)]
    joints = [model.joint(j).name or f"#{j}" for j in range(model.njnt)]
    if robot == "ant":
        joints = [model.joint(j).name for j in hinges]
        base = [f"joint/root/qpos[{i}]" for i in range(7)], [f"joint/root/qvel[{i}]" for i in range(6)]
    else:
        base = [], []
    head = ["episode", "time", *base[0], *(f"joint/{j}/qpos" for j in joints), *base[1], *(f"joint/{j}/qvel" for j in joints),
            *(f"actuator/{model.actuator(i).name or f'#{i}'}" for i in range(model.nu))]
    keep = [i for i, name in enumerate(head) if CASES[case][2] != POSITIONS or not name.endswith("/qvel")]
    with open(path, "w", encoding="utf-8") as file:
        for row in [head, *lines]:
            file.write(",".join(str(row[i]) if isinstance(row[i], str) else f"{row[i]:.9g}" for i in keep) + "\n")


def task_file(case, folder, parameters):
    robot, period, observations = CASES[case][:3]
    lines = ["[task]", f'model = "{model_file(robot, folder)}"', f"control_period = {period}", f"observations = [{observations}]",
             "[data]", 'path = "logs.csv"', "[parameters]"]
    for name, (field, low, high, more) in parameters.items():
        lines.append(f"{name} = {{ field = {json.dumps(field)}, range = [{low}, {high}], {more} }}")
    (folder / "task.toml").write_text("\n".join(lines) + "\n")


def run(case, seed, oted):
    robot, _, _, parameters, fixed = CASES[case]
    parameters = parameters or OTHERS[robot]
    draw = random.Random(f"{case}-{seed}")
    truth = {name: draw.randint(0, 15) / 5 if name == "delay" else round(float(np.exp(draw.uniform(np.log(0.5), np.log(1.9)))), 3)
             for name in parameters} | fixed
    with tempfile.TemporaryDirectory(prefix="oted-robots-") as name:
        folder = pathlib.Path(name)
        record(case, folder / "logs.csv", truth, seed, folder)
        task_file(case, folder, parameters)
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        done = subprocess.run([str(oted), "design", str(folder / "task.toml"), "--out", str(folder / "run"), "--quiet", "--json"],
                              capture_output=True, text=True, check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode not in (0, 4):
            raise SystemExit(f"{case} {seed}: exit {done.returncode}: {done.stderr}")
        design = json.loads(done.stdout)["design"]
    return {
        "case": case, "seed": seed, "truth": truth, "exit_code": done.returncode, "verdict": design["verdict"],
        "sentence": design["sentence"], "suspects": [s["sentence"] for s in design.get("fit", {}).get("suspects", [])],
        "parameters": [{key: p[key] for key in ("name", "mode", "interval90", "verdict")} for p in design["parameters"]],
        "seconds": round(time.monotonic() - begin), "cpu_seconds": round(after.ru_utime - before.ru_utime), "commit": commit()}


def table(found):
    print("| case | seed | verdict | parameter | truth | designed | 90 % interval | | CPU s |\n|---|---|---|---|---|---|---|---|---|")
    for r in found:
        for i, p in enumerate(r["parameters"]):
            truth, (low, high) = r["truth"].get(p["name"], 1.0), p["interval90"]
            print("|", " | ".join([r["case"], str(r["seed"]), r["verdict"]] if i == 0 else [" "] * 3), "|",
                  f"{p['name']} | {truth:.3f} | {p['mode']:.3f} | [{low:.3f}, {high:.3f}]{'' if low <= truth <= high else ' misses'} |",
                  f"{p['verdict']} | {r['cpu_seconds'] if i == 0 else ''} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", type=pathlib.Path, default=ROOT / "build/release/oted")
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--table", action="store_true", help="print what is there and run nothing")
    arguments = parser.parse_args()
    for seed in arguments.seeds:
        for case in arguments.cases:
            if not arguments.table and f"{case}-{seed}" not in records(STUDY):
                add_record(STUDY, f"{case}-{seed}", run(case, seed, arguments.oted))
                print(case, seed, flush=True)
    table(records(STUDY).values())


if __name__ == "__main__":
    main()
