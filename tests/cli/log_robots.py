"""Robots whose logs are made by MuJoCo's own Python, and the faults that are planted in them."""

import csv
import dataclasses
import json
import pathlib

import mujoco
import numpy as np

SITE = pathlib.Path(mujoco.__file__).resolve().parents[1]
# Six turning joints in the manner of an industrial arm, driven by torques.
ARM = """<mujoco model="six-axis arm">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <default><joint damping="2" armature="0.05" frictionloss="0.5"/><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="shoulder_link" pos="0 0 0.16">
      <joint name="pan" axis="0 0 1"/><geom type="cylinder" size="0.06 0.07" mass="3.7"/>
      <body name="upper_link" pos="0 0.14 0">
        <joint name="lift" axis="0 1 0"/><geom type="capsule" size="0.05" fromto="0 0 0 0.42 0 0" mass="8.4"/>
        <body name="fore_link" pos="0.42 -0.12 0">
          <joint name="elbow" axis="0 1 0"/><geom type="capsule" size="0.04" fromto="0 0 0 0.39 0 0" mass="2.3"/>
          <body name="wrist1_link" pos="0.39 0 0">
            <joint name="wrist1" axis="0 1 0"/><geom type="capsule" size="0.035" fromto="0 0 0 0 0.09 0" mass="1.2"/>
            <body name="wrist2_link" pos="0 0.09 0">
              <joint name="wrist2" axis="0 0 1"/><geom type="capsule" size="0.035" fromto="0 0 0 0 0 -0.09" mass="1.2"/>
              <body name="wrist3_link" pos="0 0 -0.09">
                <joint name="wrist3" axis="0 1 0"/><geom type="box" size="0.03 0.06 0.04" pos="0.03 0.05 0" mass="0.8"/>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="pan" joint="pan" ctrlrange="-150 150"/><motor name="lift" joint="lift" ctrlrange="-150 150"/>
    <motor name="elbow" joint="elbow" ctrlrange="-150 150"/><motor name="wrist1" joint="wrist1" ctrlrange="-28 28"/>
    <motor name="wrist2" joint="wrist2" ctrlrange="-28 28"/><motor name="wrist3" joint="wrist3" ctrlrange="-28 28"/>
  </actuator>
</mujoco>
"""


# Two light joints with springs, pulled by one tendon: where they stand is where springs and servo balance.
FINGER = """<mujoco model="sprung finger">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <default><joint axis="0 1 0" damping="0.004"/><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="near">
      <joint name="knuckle" stiffness="0.12" springref="-0.2" armature="2e-4"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.05" size="0.008" mass="0.03"/>
      <body name="far" pos="0 0 0.05">
        <joint name="tip" stiffness="0.08" springref="-0.1" armature="1e-4"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.035" size="0.007" mass="0.015"/>
      </body>
    </body>
  </worldbody>
  <tendon><fixed name="flexor"><joint joint="knuckle" coef="0.012"/><joint joint="tip" coef="0.008"/></fixed></tendon>
  <actuator><position name="winch" tendon="flexor" kp="1500" kv="30" ctrlrange="-0.005 0.03" forcerange="-60 60"/></actuator>
</mujoco>
"""


@dataclasses.dataclass
class Robot:
    """model: XML text, or a path below the folder of installed packages. hold: torques are those of a servo (stiffness,
    damping) round a moving target, so that the robot stays about where it starts."""

    model: str
    period: float
    action: float = 1.0  # share of the range that is used
    hold: tuple | None = None
    hidden: tuple = ()  # coordinates that are not logged
    positions_alone: bool = False  # no velocity is logged
    episodes: int = 6
    rows: int = 200


ROBOTS = {
    "ant": Robot("gymnasium/envs/mujoco/assets/ant.xml", 0.05, hidden=("joint/root/qpos[0]", "joint/root/qpos[1]")),
    "arm": Robot(ARM, 0.02, hold=(60.0, 4.0)),
    "finger": Robot("dm_control/suite/finger.xml", 0.02),
    "sprung finger": Robot(FINGER, 0.01, action=0.5),
    "walker": Robot("dm_control/suite/walker.xml", 0.025),
    "cheetah": Robot("dm_control/suite/cheetah.xml", 0.01),
    "reacher": Robot("dm_control/suite/reacher.xml", 0.02),
    "acrobot": Robot("dm_control/suite/acrobot.xml", 0.01),
    "fish": Robot("dm_control/suite/fish.xml", 0.04, hidden=("joint/root/qpos[0]", "joint/root/qpos[1]")),
}
WIDTH = {mujoco.mjtJoint.mjJNT_FREE: (7, 6), mujoco.mjtJoint.mjJNT_BALL: (4, 3)}


def model_of(robot):
    if robot.model.startswith("<"):
        return mujoco.MjModel.from_xml_string(robot.model)
    return mujoco.MjModel.from_xml_path(str(SITE / robot.model))


def names_of(model):
    """Channels as tasks call them, positions first, and the joint of each."""
    names, joints = [], []
    for field, which in (("qpos", 0), ("qvel", 1)):
        for j in range(model.njnt):
            width = WIDTH.get(mujoco.mjtJoint(model.jnt_type[j]), (1, 1))[which]
            name = model.joint(j).name or f"#{j}"
            names += [f"joint/{name}/{field}" + (f"[{k}]" if width > 1 else "") for k in range(width)]
            joints += [name] * width
    return names, joints


def actions_of(model):
    return [f"actuator/{model.actuator(i).name or f'#{i}'}" for i in range(model.nu)]


@dataclasses.dataclass
class Log:
    """Rows of all episodes; each episode has one row more than actions."""

    names: list
    actions: list
    rows: np.ndarray  # (episodes, rows + 1, channels)
    commands: np.ndarray  # (episodes, rows + 1, actions); the last of each is not used

    def at(self, *names):
        return [self.names.index(name) for name in names]


def drive(robot, seed=0, change=None, noise=0.0, substeps_seen=None):
    """Made by smooth random actions. change(model): what the robot has and its model has not."""
    model = model_of(robot)
    if change is not None:
        change(model)
        mujoco.mj_setConst(model, mujoco.MjData(model))
    names, _ = names_of(model)
    random = np.random.default_rng(seed)
    skip = round(robot.period / model.opt.timestep)
    all_rows, all_commands = [], []
    for _ in range(robot.episodes):
        data = mujoco.MjData(model)
        mujoco.mj_resetData(model, data)
        start = data.qpos.copy()
        for j in range(model.njnt):
            if mujoco.mjtJoint(model.jnt_type[j]) in WIDTH:
                continue
            data.qpos[model.jnt_qposadr[j]] += random.uniform(-0.3, 0.3) if model.jnt_type[j] == 3 else random.uniform(0, 0.02)
        data.qvel[:] = random.normal(0, 0.3, model.nv)
        target = data.qpos.copy()
        low, high = (np.where(model.actuator_ctrllimited, model.actuator_ctrlrange[:, k], (-1, 1)[k]) for k in (0, 1))
        phase, pace = random.uniform(0, 6, (2, model.nu)), random.uniform(0.5, 2.5, (2, model.nu))
        rows, commands = [], []
        del start
        for k in range(robot.rows + 1):
            t = k * robot.period
            wave = 0.5 * sum(np.sin(2 * np.pi * pace[i] * t + phase[i]) for i in range(2))
            if robot.hold is None:
                u = (low + high) / 2 + robot.action * (high - low) / 2 * np.clip(wave + random.normal(0, 0.2, model.nu), -1, 1)
            else:
                # Beside the servo some torque of its own, that no state tells.
                goal = target[:model.nu] + 0.6 * wave
                free = data.qfrc_bias[:model.nu] + robot.hold[0] * (goal - data.qpos[:model.nu]) * high / 150
                u = np.clip(free - robot.hold[1] * data.qvel[:model.nu] * high / 150 + random.normal(0, 0.02, model.nu) * high,
                            low, high)
            rows.append(np.concatenate([data.qpos, data.qvel]))
            commands.append(u)
            data.ctrl[:] = u
            for _ in range(skip):
                mujoco.mj_step(model, data)
        all_rows.append(rows)
        all_commands.append(commands)
    rows = np.array(all_rows)
    rows += noise * np.random.default_rng(seed + 1).normal(size=rows.shape)
    return Log(names, actions_of(model), rows, np.array(all_commands))


def write(robot, log, folder):
    """task.toml and log.csv."""
    folder = pathlib.Path(folder)
    seen = [i for i, name in enumerate(log.names)
            if name not in robot.hidden and not (robot.positions_alone and "/qvel" in name)]
    if robot.model.startswith("<"):
        (folder / "model.xml").write_text(robot.model)
    model = "model.xml" if robot.model.startswith("<") else f"package:{robot.model}"
    (folder / "task.toml").write_text(
        f'[task]\nmodel = "{model}"\ncontrol_period = {robot.period}\nmax_episode_steps = 10000\n'
        f"observations = {json.dumps([log.names[i] for i in seen])}\nunobserved = {json.dumps(list(robot.hidden))}\n"
        f"action_range = [-1, 1]\n"
        f'[data]\npath = "log.csv"\n')
    with open(folder / "log.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["episode", "time", *(log.names[i] for i in seen), *log.actions])
        for e in range(len(log.rows)):
            for k in range(log.rows.shape[1]):
                writer.writerow([e, repr(k * robot.period), *map(repr, map(float, log.rows[e, k, seen])),
                                 *map(repr, map(float, log.commands[e, k]))])
    return folder / "task.toml"


def rotation(quaternion):
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def plant(fault, robot, log, joints, unit=None):
    """The log with a fault, what finds it, and words of the correction that must be named. joints: two hinges."""
    rows, commands = log.rows.copy(), log.commands.copy()
    a, b = joints
    pa, va, pb, vb = log.at(*(f"joint/{j}/{field}" for j in (a, b) for field in ("qpos", "qvel")))
    root = next((n.split("/")[1] for n in log.names if n.endswith("/qpos[6]")), None)
    free = root is not None
    if fault == "sign":
        rows[:, :, [pa, va]] *= -1
        found = "joint_sign", [f"joint/{a}/qpos"]
    elif fault == "position sign":
        rows[:, :, pa] *= -1
        found = "rate_sign", [f"joint/{a}/qpos"]
    elif fault == "swapped joints":
        rows[:, :, [pa, va, pb, vb]] = rows[:, :, [pb, vb, pa, va]]
        found = "swapped_joints", [f"joint/{a}/qpos", f"joint/{b}/qpos"]
    elif fault == "swapped columns":
        rows[:, :, [pa, pb]] = rows[:, :, [pb, pa]]
        found = "swapped_columns", [f"joint/{a}/qpos", f"joint/{b}/qpos"]
    elif fault == "quaternion xyzw":
        quaternion = log.at(*(f"joint/{root}/qpos[{k}]" for k in range(3, 7)))
        rows[:, :, quaternion] = rows[:, :, [*quaternion[1:], quaternion[0]]]
        found = "quaternion_order", [f"joint/{root}/qpos[6]"]
    elif fault == "encoder offset":
        # Of the second: the first may turn about the vertical, where a model has no zero.
        rows[:, :, pb] += 0.1
        found = "joint_zero", [f"joint/{b}/qpos"]
    elif fault == "frozen rows":
        # Not at the very beginning, where little moves.
        rows[1, 60:70] = rows[1, 60]
        found = "frozen_channels", [f"joint/{a}/qpos", f"joint/{b}/qvel"]
    elif fault == "frozen channel":
        rows[1, 60:70, pa] = rows[1, 60, pa]
        found = "frozen_channels", [f"joint/{a}/qpos"]
    elif fault == "body-frame velocity":
        quaternion = log.at(*(f"joint/{root}/qpos[{k}]" for k in range(3, 7)))
        velocity = log.at(*(f"joint/{root}/qvel[{k}]" for k in range(3)))
        for e in range(rows.shape[0]):
            for k in range(rows.shape[1]):
                rows[e, k, velocity] = rotation(log.rows[e, k, quaternion]).T @ log.rows[e, k, velocity]
        found = "velocity_frame", [f"joint/{root}/qvel[0]"]
    elif fault == "velocities lag":
        late = 2 if robot.period < 0.04 else 1
        velocities = [i for i, name in enumerate(log.names) if "/qvel" in name]
        rows[:, late:, velocities] = log.rows[:, :-late, velocities]
        found = "velocity_lag", [f"joint/{a}/qvel"]
    elif fault == "degrees":
        rows[:, :, [pa, va]] *= 180 / np.pi
        found = "joint_unit", [f"joint/{a}/qpos"]
    elif fault == "position in degrees":
        rows[:, :, pa] *= 180 / np.pi
        found = "rate_unit", [f"joint/{a}/qpos"]
    elif fault == "actions a row late":
        commands[:, :-1] = log.commands[:, 1:]
        found = "shifted_actions", []
    elif fault == "action sign":
        commands[:, :, 0] *= -1
        found = "action_sign", [log.actions[0]]
    elif fault == "swapped actions":
        commands[:, :, [0, 1]] = commands[:, :, [1, 0]]
        found = "swapped_actions", log.actions[:2]
    elif fault == "command as position":
        rows[:, 1:, pa] = log.commands[:, :-1, 0]
        found = "copied_channels", [f"joint/{a}/qpos", log.actions[0]]
    elif fault == "mirrored joint":
        # Of the second: a mirrored first one may be the mirror image of all the others.
        rows[:, :, [pb, vb]] *= -1
        model = model_of(robot)
        own = model.actuator_trnid[:, 0].tolist().index(model.joint(b).id)
        commands[:, :, own] *= -1
        found = "mirrored_joint", [f"joint/{b}/qpos", f"joint/{b}/qvel", log.actions[own]]
        if free:  # the Ant's leg is thrown so far that the action makes no difference before the sign is right
            found = "joint_sign", found[1][:2]
    elif fault == "turn sign":
        column, = log.at(f"joint/{root}/qvel[5]")
        rows[:, :, column] *= -1
        found = "rate_sign", [f"joint/{root}/qvel[5]"]
    elif fault == "turn swapped":
        x, y = log.at(*(f"joint/{root}/qvel[{k}]" for k in (3, 4)))
        rows[:, :, [x, y]] = rows[:, :, [y, x]]
        found = "swapped_columns", [f"joint/{root}/qvel[3]", f"joint/{root}/qvel[4]"]
    elif fault == "rows missing":
        # The times do not tell: they are numbered anew when the log is written.
        kept = [k for k in range(rows.shape[1]) if k % 40 != 25]
        rows, commands = rows[:, kept], commands[:, kept]
        found = "missing_rows", []
    elif fault == "half the rate":
        rows, commands = rows[:, ::2], commands[:, ::2]
        found = "control_rate", []
    else:
        raise ValueError(fault)
    return Log(log.names, log.actions, rows, commands), found


FAULTS = ["sign", "position sign", "swapped joints", "swapped columns", "quaternion xyzw", "encoder offset", "frozen rows",
          "frozen channel", "body-frame velocity", "velocities lag", "degrees", "position in degrees", "actions a row late",
          "action sign", "swapped actions", "half the rate", "command as position", "mirrored joint", "turn sign", "turn swapped",
          "rows missing"]


def hinges_of(robot):
    """Two hinges with an encoder each, in the model's order."""
    model = model_of(robot)
    hinges = [model.joint(j).name for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE]
    driven = [model.joint(model.actuator_trnid[i, 0]).name for i in range(model.nu)
              if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT]
    chosen = [name for name in hinges if name in driven] or hinges
    return chosen[:2] if len(chosen) > 1 else hinges[:2]


def is_there(fault, robot):
    names, _ = names_of(model_of(robot))
    free = any(n.endswith("/qpos[6]") for n in names)
    if fault in ("quaternion xyzw", "body-frame velocity", "turn sign", "turn swapped"):
        return free
    if fault == "rows missing":
        return robot.hold is not None  # not where velocities change within a row, as the Ant's at its contacts
    return fault != "swapped actions" or model_of(robot).nu > 1
