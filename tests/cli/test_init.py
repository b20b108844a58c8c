"""oted init: from a model and logs to a task file that runs.

    test_init.py PATH/TO/oted [TestClass.test_name ...]
"""

import csv
import json
import math
import re
import tomllib
import unittest

import mujoco
import numpy as np

import program
from program import DATA_OR_MODEL, USAGE, ProgramTest, oted

ARM = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder_joint" axis="0 1 0" damping="0.05" armature="0.01" range="-3 3" limited="true"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.4" mass="1" contype="0" conaffinity="0"/>
      <body name="lower" pos="0 0 -0.4">
        <joint name="elbow_joint" axis="0 1 0" damping="0.05" armature="0.01"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.3" mass="0.6" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="shoulder" joint="shoulder_joint" ctrlrange="-20 20"/>
    <motor name="elbow" joint="elbow_joint" ctrlrange="-20 20"/>
  </actuator>
</mujoco>
"""
# Servos on an arm that lies on its side: what is late there, a damping and a rotor of each joint would imitate.
SERVOS = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder_joint" axis="0 0 1" damping="0.3" armature="0.05" range="-3 3" limited="true"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0.25 0 0" mass="1" contype="0" conaffinity="0"/>
      <body name="lower" pos="0.25 0 0">
        <joint name="elbow_joint" axis="0 0 1" damping="0.3" armature="0.05"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0.2 0 0" mass="0.6" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder_joint" kp="60" kv="4" ctrlrange="-20 20"/>
    <position name="elbow" joint="elbow_joint" kp="40" kv="2.5" ctrlrange="-20 20"/>
  </actuator>
</mujoco>
"""
NAMES = ["time", "shoulder_pos", "elbow_pos", "shoulder_vel", "elbow_vel", "shoulder_cmd", "elbow_cmd"]


def swing(seed, damping=0.2, n=150, skip=4):
    """Rows of time, positions, velocities and torques of the arm with more damping than its model has."""
    model = mujoco.MjModel.from_xml_string(ARM.replace('damping="0.05"', f'damping="{damping}"'))
    data = mujoco.MjData(model)
    phase = np.random.default_rng(seed).uniform(0, 6, 4)
    rows = []
    for k in range(n):
        t = k * skip * model.opt.timestep
        u = [2 * math.sin(3 * t + phase[0]) + math.sin(9 * t + phase[1]), math.sin(5 * t + phase[2]) + 0.5 * math.sin(14 * t + phase[3])]
        rows.append([t, *data.qpos, *data.qvel, *u])
        data.ctrl[:] = u
        mujoco.mj_step(model, data, skip)
    return np.array(rows)


class InitTest(ProgramTest):
    def setUp(self):
        super().setUp()
        self.model = self.folder / "arm.xml"
        self.model.write_text(ARM)
        self.task = self.folder / "arm.toml"

    def csv(self, rows, names=NAMES, file="log.csv"):
        path = self.folder / file
        with open(path, "w", newline="", encoding="utf-8") as out:
            writer = csv.writer(out)
            writer.writerow(names)
            writer.writerows([list(map(repr, map(float, row))) for row in rows])
        return path

    def init(self, *logs, more=()):
        result = self.succeed("init", self.model, *logs, "--out", self.task, *more)
        return result.stdout, tomllib.loads(self.task.read_text())

    def assertNothingLeft(self, result, code, *needles):
        self.assertRefused(result, code, *needles)
        self.assertEqual(sorted(p.suffix for p in self.folder.iterdir() if p.suffix in (".toml", ".gz")), [])

    def test_a_late_command_is_freed_and_found_though_dampings_and_rotors_together_act_nearly_as_it_does(self):
        self.model.write_text(SERVOS)
        model = mujoco.MjModel.from_xml_string(SERVOS)
        random = np.random.default_rng(0)
        logs = []
        for log in range(3):
            data, late = mujoco.MjData(model), np.zeros(2)
            phase, pace = random.uniform(0, 6, (2, 2)), random.uniform(0.4, 0.8, (2, 2))
            rows = []
            for k in range(400):
                u = 0.4 * min(1, k / 100) * sum(np.sin(2 * np.pi * pace[i] * k / 100 + phase[i]) for i in range(2))
                rows.append([k / 100, *data.qpos + 2e-4 * random.normal(size=2), *u])
                data.ctrl[:], late = late, u
                mujoco.mj_step(model, data, 2)
            logs.append(self.csv(rows, [*NAMES[:3], *NAMES[5:]], f"log{log}.csv"))
        _, task = self.init(*logs)
        self.assertLess(task["parameters"]["delay"]["range"][0], 1)
        # What gave way has a line of its own behind a #, which is the line of a parameter.
        hidden = [line[2:] for line in self.task.read_text().splitlines() if line.startswith("# ") and "= {" in line]
        self.assertTrue(any("actuator/elbow/kp" in line for line in hidden), hidden)
        for line in hidden:
            (freed,) = tomllib.loads(line).values()
            self.assertEqual(len(freed["range"]), 2)
        self.succeed("design", self.task, "--out", self.folder / "run", "--quiet", "--set", "report.motion=false")
        design = json.loads((self.folder / "run/design.json").read_text())
        low, high = next(p["interval90"] for p in design["parameters"] if p["name"] == "delay")
        self.assertTrue(0.5 < low < 1 < high < 1.5, (low, high))

    # --- what it writes runs

    def test_control_characters_in_names_stay_out_of_the_comments(self):
        log = self.csv(swing(1, n=60), [*NAMES[:-1], "elbow_cmd\x07"])
        task = self.folder / "two\nlines.toml"
        self.succeed("init", self.model, log, "--out", task)
        self.assertEqual(tomllib.loads(task.read_text())["data"]["actions"][-1], "elbow_cmd\x07")

    def test_the_task_file_says_what_the_logs_are_and_runs(self):
        text, task = self.init(self.csv(swing(1)))
        self.assertAlmostEqual(task["task"]["control_period"], 0.02)
        self.assertEqual(task["task"]["model"], "arm.xml")
        self.assertEqual(task["data"]["observations"], NAMES[1:5])
        self.assertEqual(task["data"]["actions"], NAMES[5:])
        self.assertIn("damping_elbow_joint", task["parameters"])
        # The model has no dry friction, and no contact that the logs could show.
        self.assertEqual(task["parameters"]["frictionloss_elbow_joint"]["scale"], "absolute")
        self.assertNotIn("friction", task["parameters"])
        self.assertIn("friction (geom/*/friction[0]): the logs do not show it", text)
        check = json.loads(self.succeed("data", "check", self.task, "--json").stdout)
        self.assertEqual((check["errors"], check["dataset"]["n_episodes"]), (0, 1))

    def test_with_schema_an_editor_finds_the_programs_own_beside_the_task_file(self):
        self.init(self.csv(swing(1)), more=["--schema"])
        named = self.task.read_text().splitlines()[0].removeprefix("#:schema ")
        self.assertEqual((self.folder / named).read_text(), self.succeed("schema").stdout)
        # A second task file shares it.
        self.task = self.folder / "second.toml"
        self.init(self.folder / "log.csv", more=["--schema"])

    def test_its_parameters_hold_the_truth(self):
        self.init(self.csv(swing(1)))
        self.succeed("design", self.task, "--out", self.out, "--quiet", "--set", "selection.n_seeds=1",
                     "--set", "design.method=trajectories", "--set", "report.motion=false", "--threads", 2)
        found = {p["name"]: p["mode"] for p in json.loads((self.out / "design.json").read_text())["parameters"]}
        self.assertAlmostEqual(found["damping_elbow_joint"], 4.0, delta=0.1)  # 0.2 / 0.05
        self.assertAlmostEqual(found["damping_shoulder_joint"], 4.0, delta=0.1)
        # All drives, masses, damping and friction times two move as before: one of them must stay.
        self.assertNotIn("mass_upper", found)
        self.assertAlmostEqual(found["gain_elbow"], 1.0, delta=0.05)

    def test_a_rotor_behind_gears_weighs_more_than_its_link_and_lies_within_the_range(self):
        bare = ARM.replace('damping="0.05" armature="0.01"', "")
        self.model.write_text(bare)
        model = mujoco.MjModel.from_xml_string(bare)
        model.dof_armature[:], model.dof_frictionloss[:], model.dof_damping[:] = (0.4, 0.2), 0.3, 0.2
        data, rows = mujoco.MjData(model), []
        for k in range(400):
            t = 0.02 * k
            u = [4 * math.sin(3 * t) + 3 * math.sin(8 * t + 1), 3 * math.sin(4 * t + 2) + 3 * math.sin(11 * t)]
            rows.append([t, *data.qpos, *data.qvel, *u])
            data.ctrl[:] = u
            mujoco.mj_step(model, data, 4)
        _, task = self.init(self.csv(np.array(rows)))
        for joint, rotor in (("shoulder", 0.4), ("elbow", 0.2)):  # the forearm's own inertia is 0.02
            self.assertGreater(task["parameters"][f"armature_{joint}_joint"]["range"][1], rotor)
            self.assertGreater(task["parameters"][f"frictionloss_{joint}_joint"]["range"][1], 0.3)

    def test_each_of_few_servos_gets_a_stiffness_and_a_hand_its_load(self):
        servos = ARM.replace('<motor name="shoulder" joint="shoulder_joint" ctrlrange="-20 20"/>',
                             '<position name="shoulder" joint="shoulder_joint" kp="40" kv="2" ctrlrange="-3 3"/>')
        servos = servos.replace('<motor name="elbow" joint="elbow_joint" ctrlrange="-20 20"/>',
                                '<position name="elbow" joint="elbow_joint" kp="20" kv="1" ctrlrange="-3 3"/>')
        hand = '<body name="hand" pos="0 0 -0.3"><geom size="0.03" mass="0.1" contype="0" conaffinity="0"/></body>'
        servos = servos.replace('mass="0.6" contype="0" conaffinity="0"/>', 'mass="0.6" contype="0" conaffinity="0"/>' + hand)
        self.model.write_text(servos)
        model = mujoco.MjModel.from_xml_string(servos)
        data, rows = mujoco.MjData(model), []
        for k in range(300):
            u = [math.sin(0.1 * k) + 0.3 * math.sin(0.31 * k), 0.8 * math.sin(0.17 * k + 1) + 0.3 * math.sin(0.4 * k)]
            rows.append([0.02 * k, *data.qpos, *data.qvel, *u])
            data.ctrl[:] = u
            mujoco.mj_step(model, data, 4)
        text, task = self.init(self.csv(np.array(rows)))
        fields = {name: parameter["field"] for name, parameter in task["parameters"].items()}
        self.assertIn("damping of servos (actuator/*/kv)", text)
        self.assertEqual(fields["servo_stiffness_shoulder"], "actuator/shoulder/kp")
        self.assertEqual(fields["servo_stiffness_elbow"], "actuator/elbow/kp")
        self.assertEqual(fields["mass_hand"], ["body/hand/mass", "body/hand/inertia"])
        self.assertEqual(task["parameters"]["mass_hand"]["range"], [0.5, 5])

    def test_fingers_on_a_tendon_are_among_the_driven_joints_of_an_arm(self):
        bodies, ends = "", ""
        for k, (mass, length) in enumerate([(1.5, 0.2), (1.2, 0.25), (0.8, 0.2), (0.3, 0.1), (0.06, 0.05), (0.04, 0.04)]):
            bodies += (f'<body name="link{k}" pos="{(0, 0.2, 0.25, 0.2, 0.1, 0.05)[k]} 0 0">'
                       f'<joint name="j{k}" axis="0 1 0" damping="{0.3 * mass}" armature="{0.01 * mass}" stiffness="{0.1 if k > 3 else 0}"/>'
                       f'<geom type="capsule" fromto="0 0 0 {length} 0 0" size="0.01" mass="{mass}" contype="0" conaffinity="0"/>')
            ends += "</body>"
        motors = "".join(f'<motor name="m{k}" joint="j{k}" ctrlrange="-20 20"/>' for k in range(4))
        hand = f"""<mujoco><option timestep="0.004" integrator="implicitfast"/><worldbody>{bodies}{ends}</worldbody>
          <tendon><fixed name="cable"><joint joint="j4" coef="1"/><joint joint="j5" coef="0.7"/></fixed></tendon>
          <actuator>{motors}<motor name="grip" tendon="cable" ctrlrange="-1 1"/></actuator></mujoco>"""
        self.model.write_text(hand)
        model = mujoco.MjModel.from_xml_string(hand)
        data, rows = mujoco.MjData(model), []
        for k in range(120):
            u = [size * math.sin(0.1 * pace * k + phase)
                 for size, pace, phase in ((8, 1, 0), (6, 1.7, 1), (3, 2.3, 2), (0.5, 3.1, 3), (0.3, 2.9, 4))]
            rows.append([0.02 * k, *data.qpos, *data.qvel, *u])
            data.ctrl[:] = u
            mujoco.mj_step(model, data, 5)
        names = ["time", *(f"j{k}_pos" for k in range(6)), *(f"j{k}_vel" for k in range(6)), *(f"m{k}" for k in range(4)), "grip"]
        _, task = self.init(self.csv(np.array(rows), names))
        fields = [parameter["field"] for parameter in task["parameters"].values()]
        self.assertIn("joint/@actuated/damping", fields)
        self.assertEqual([field for field in fields if "j4/damping" in field or "j5/damping" in field], [])

    def test_of_a_hopping_leg_not_all_that_is_a_force_is_freed(self):
        leg = """<mujoco>
          <option timestep="0.002" integrator="implicitfast"/>
          <worldbody><geom type="plane" size="3 3 0.1"/>
            <body name="trunk" pos="0 0 0.55"><joint name="rail" type="slide" axis="0 0 1" damping="0.5"/>
              <geom type="box" size="0.06 0.06 0.04" mass="2"/>
              <body name="thigh"><joint name="hip" axis="0 1 0" damping="0.2" armature="0.01" frictionloss="0.1"/>
                <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.02" mass="0.4" contype="0" conaffinity="0"/>
                <body name="shin" pos="0 0 -0.25"><joint name="knee" axis="0 1 0" damping="0.2" armature="0.01" frictionloss="0.1"/>
                  <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.02" mass="0.3"/></body></body></body>
          </worldbody>
          <actuator><motor name="hip" joint="hip" ctrlrange="-30 30"/><motor name="knee" joint="knee" ctrlrange="-30 30"/></actuator>
        </mujoco>"""
        self.model.write_text(leg)
        model = mujoco.MjModel.from_xml_string(leg)
        model.body("trunk").mass[:] *= 1.3
        model.dof_damping[2] *= 2.2
        model.actuator_gainprm[1, 0] *= 0.85
        model.geom_friction[:, 0] *= 0.5
        mujoco.mj_setConst(model, mujoco.MjData(model))
        data, rows, random = mujoco.MjData(model), [], np.random.default_rng(1)
        data.qpos[:] = [-0.1, 0.7, -1.4]
        for k in range(500):
            bend = 0.35 * math.sin(0.1 * k) + 0.2 * math.sin(0.037 * k) + random.normal(0, 0.01)
            u = np.clip(50 * (np.array([0.7 + bend, -1.4 - 2 * bend]) - data.qpos[1:]) - 1.5 * data.qvel[1:], -30, 30)
            rows.append([0.01 * k, *(data.qpos + random.normal(0, 1e-3, 3)), *(data.qvel + random.normal(0, 0.02, 3)), *u])
            data.ctrl[:] = u
            mujoco.mj_step(model, data, 5)
        names = ["time", "rail_pos", "hip_pos", "knee_pos", "rail_vel", "hip_vel", "knee_vel", "hip_cmd", "knee_cmd"]
        text, task = self.init(self.csv(np.array(rows), names))
        # Twice the masses, drives and damping hop as before.
        masses = [name for name in task["parameters"] if name.startswith("mass")]
        self.assertEqual(masses, ["mass_shin", "mass_thigh"], text)
        self.assertIn("mass_trunk (body/trunk/mass + body/trunk/inertia): it acts nearly as the other masses, drives, damping and friction", text)

    def test_a_joint_that_nothing_drives_gets_no_rotor(self):
        bare = ARM.replace('damping="0.05" armature="0.01"', 'damping="0.05"')
        elbow = '<motor name="elbow" joint="elbow_joint" ctrlrange="-20 20"/>'
        self.assertIn(elbow, bare)
        self.model.write_text(bare.replace(elbow, ""))
        rows = swing(1)
        model = mujoco.MjModel.from_xml_string(bare.replace(elbow, ""))
        model.dof_armature[:] = (0.2, 0)
        data = mujoco.MjData(model)
        for row in rows:
            row[1:5] = [*data.qpos, *data.qvel]
            data.ctrl[:] = row[5]
            mujoco.mj_step(model, data, 4)
        text, task = self.init(self.csv(rows[:, :6], NAMES[:6]))
        self.assertIn("armature_shoulder_joint", task["parameters"])
        self.assertNotIn("elbow_joint/armature", text)

    def test_of_many_joints_what_nothing_drives_has_a_mass_of_its_own(self):
        hand = """<body name="hand" pos="0 0 -0.3"><joint name="wrist_joint" axis="0 1 0" damping="0.05" armature="0.01"/>
          <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.1" mass="0.3" contype="0" conaffinity="0"/></body>"""
        cart = """<body name="cart" pos="0 0 1"><joint name="rail" type="slide" axis="1 0 0" damping="1" stiffness="30"/>
          <geom size="0.1" mass="3" contype="0" conaffinity="0"/><body name="upper">"""
        robot = ARM.replace('<body name="upper" pos="0 0 1">', cart)
        robot = robot.replace('mass="0.6" contype="0" conaffinity="0"/>', 'mass="0.6" contype="0" conaffinity="0"/>' + hand)
        robot = robot.replace("</worldbody>", "</body></worldbody>").replace(
            "</actuator>", '<motor name="wrist" joint="wrist_joint" ctrlrange="-20 20"/></actuator>')
        self.model.write_text(robot)
        model = mujoco.MjModel.from_xml_string(robot)
        data, rows = mujoco.MjData(model), []
        for k in range(400):
            t = 0.02 * k
            u = [4 * math.sin(3 * t) + 3 * math.sin(8 * t), 2 * math.sin(5 * t + 1), 0.4 * math.sin(7 * t + 2)]
            rows.append([t, *data.qpos, *data.qvel, *u])
            data.ctrl[:] = u
            mujoco.mj_step(model, data, 4)
        joints = [model.joint(j).name for j in range(model.njnt)]
        names = ["time", *(f"{j}_pos" for j in joints), *(f"{j}_vel" for j in joints), "shoulder_cmd", "elbow_cmd", "wrist_cmd"]
        text, task = self.init(self.csv(np.array(rows), names))
        # Of the arm's own masses one multiple is enough; the cart is no part of it.
        self.assertIn("body/@actuated/mass", text)
        self.assertIn("body/cart/mass", text)
        self.assertIn("@actuated: what an actuator drives", text)

    def test_where_a_spring_rests_is_told_in_place_of_a_zero(self):
        sprung = ARM.replace('name="elbow_joint"', 'name="elbow_joint" stiffness="3"')
        self.model.write_text(sprung)
        rows, model = swing(1), mujoco.MjModel.from_xml_string(sprung)
        model.qpos_spring[model.joint("elbow_joint").qposadr] = 0.3
        data = mujoco.MjData(model)
        for row in rows:
            row[1:5] = [*data.qpos, *data.qvel]
            data.ctrl[:] = row[5:]
            mujoco.mj_step(model, data, 4)
        text, task = self.init(self.csv(rows))
        self.assertEqual(task["parameters"]["springref"]["field"], "joint/elbow_joint/springref", text)
        self.assertIn("joint/elbow_joint/stiffness", text)  # of few springs each by itself
        self.assertNotIn("joint/*/stiffness", text)

    def test_a_motor_with_back_emf_gets_a_gain_and_the_back_emf_is_told(self):
        motors = "".join(f'<general name="{name}" joint="{name}_joint" gainprm="8" biastype="affine" biasprm="0 0 -0.4" '
                         'ctrlrange="-1 1"/>' for name in ("shoulder", "elbow"))
        arm = re.sub("<actuator>.*</actuator>", f"<actuator>{motors}</actuator>", ARM, flags=re.DOTALL)
        self.model.write_text(arm)
        model = mujoco.MjModel.from_xml_string(arm)
        model.actuator_gainprm[:, 0] *= 0.8
        data, rows = mujoco.MjData(model), []
        for k in range(300):
            u = [0.6 * math.sin(0.1 * k) + 0.3 * math.sin(0.31 * k), 0.4 * math.sin(0.17 * k + 1) + 0.3 * math.sin(0.4 * k)]
            rows.append([0.02 * k, *data.qpos, *data.qvel, *u])
            data.ctrl[:] = u
            mujoco.mj_step(model, data, 4)
        text, task = self.init(self.csv(np.array(rows)))
        gains = [p for p in task["parameters"].values() if "gainprm[0]" in p["field"]]
        self.assertTrue(gains, text)
        self.assertIn("back-EMF of motors (actuator/*/kv)", text)
        self.assertNotIn("neither a motor nor a servo", text)

    def test_a_stiffness_at_the_end_of_its_range_widens_it(self):
        servos = ARM.replace('<motor name="shoulder" joint="shoulder_joint" ctrlrange="-20 20"/>',
                             '<position name="shoulder" joint="shoulder_joint" kp="40" kv="2" ctrlrange="-3 3"/>')
        self.model.write_text(servos)
        model = mujoco.MjModel.from_xml_string(servos)
        servo = model.actuator("shoulder").id
        model.actuator_gainprm[servo, 0], model.actuator_biasprm[servo, 1] = 14, -14  # 0.35 times the model's
        data, rows = mujoco.MjData(model), []
        for k in range(300):
            u = [math.sin(0.1 * k) + 0.3 * math.sin(0.31 * k), 2 * math.sin(0.17 * k + 1) + math.sin(0.4 * k)]
            rows.append([0.02 * k, *data.qpos, *data.qvel, *u])
            data.ctrl[:] = u
            mujoco.mj_step(model, data, 4)
        _, task = self.init(self.csv(np.array(rows)))
        self.assertLessEqual(task["parameters"]["servo_stiffness"]["range"][0], 0.25)

    def test_what_is_known_of_each_recording_may_be_a_constant(self):
        rows = np.vstack([np.column_stack([swing(seed), np.full(150, seed), np.full(150, load)])
                          for seed, load in ((1, 0.25), (2, 0.5))])
        said, _ = self.init(self.csv(rows, [*NAMES, "episode", "firmware_gain"]))
        self.assertIn("'firmware_gain': nothing in the model has such a name; it differs between recordings", said)
        rows[:, -1] = np.sin(np.arange(300))
        self.task.unlink()
        self.assertNotIn("differs between", self.init(self.csv(rows, [*NAMES, "episode", "firmware_gain"]))[0])

    def test_any_number_of_threads_writes_the_same_bytes(self):
        log = self.csv(swing(1))
        written = set()
        for threads in (1, 2):
            self.init(log, more=["--threads", threads])
            written.add(self.task.read_bytes())
            self.task.unlink()
        self.assertEqual(len(written), 1)

    def test_several_logs_are_the_recordings_of_one_task(self):
        first, second = self.csv(swing(1), file="a.csv"), self.csv(swing(2), file="b.csv")
        _, task = self.init(first, second)
        self.assertEqual(task["data"]["recordings"], [{"path": "a.csv"}, {"path": "b.csv"}])
        info = json.loads(self.succeed("data", "info", self.task, "--json").stdout)
        self.assertEqual(info["dataset"]["n_episodes"], 2)

    def test_a_later_recording_is_read_as_the_first_ones_were(self):
        self.init(self.csv(swing(1), file="a.csv"), self.csv(swing(2), file="b.csv"))
        run = self.folder / "run"
        self.succeed("design", self.task, "--out", run, "--quiet", *program.sets(program.TINY + ["selection.n_seeds=1"]))
        later = self.succeed("validate", run, "--data", self.csv(swing(3), file="later.csv"))
        self.assertIn("these recordings", later.stdout)
        self.assertNotIn("learned from", later.stdout + later.stderr)
        both = json.loads(self.succeed("validate", run, "--data", self.folder / "later.csv", self.csv(swing(4), file="last.csv"),
                                       "--json").stdout)
        self.assertEqual(both["dataset"]["n_transitions"], 2 * 149)
        self.assertOneLine(program.oted("validate", run), program.USAGE, "--data FILE")
        known = self.succeed("validate", run, "--data", self.folder / "b.csv")
        self.assertIn("the design learned from", known.stdout + known.stderr)
        joint = self.model.read_text().split('joint name="')[1].split('"')[0]
        other = self.folder / "other.xml"  # the same robot, but for a name
        other.write_text(self.model.read_text().replace(f'"{joint}"', '"another"'))
        self.assertOneLine(program.oted("validate", run, "--data", self.folder / "later.csv", "--model", other), program.USAGE,
                           "joint/another/qpos", f"joint/{joint}/qpos")
        nominal = self.succeed("validate", run, "--data", self.folder / "later.csv", "--model", self.model).stdout
        self.assertIn("its error is about the nominal simulator's (smaller in 0 of 4 channels)", nominal)  # its own errors

    def test_a_log_without_times_has_the_rate_of_the_others(self):
        first = self.csv(swing(1), file="a.csv")
        untimed = self.csv(swing(2)[:, 1:], NAMES[1:], file="b.csv")
        text, task = self.init(first, untimed)
        self.assertIn("b.csv' has no times: its rows count as 0.02 s apart", text)
        self.assertEqual(len(task["data"]["recordings"]), 2)

    def test_the_range_of_actions_holds_those_of_all_logs(self):
        self.model.write_text(ARM.replace(' ctrlrange="-20 20"', ""))
        small, large = swing(1), swing(2)
        small[:, 5:] *= 0.1
        _, task = self.init(self.csv(small, file="a.csv"), self.csv(large, file="b.csv"))
        low, high = task["task"]["action_range"]
        self.assertGreaterEqual(high, np.abs(large[:-1, 5:]).max())
        self.assertEqual((low, high), (-high, round(high)), "in few digits")

    def test_what_the_reader_made_even_is_told(self):
        rows = swing(1)
        text, _ = self.init(self.csv(np.delete(rows, 50, axis=0), file="a.csv"), self.csv(swing(2), file="b.csv"))
        self.assertIn("a.csv': rows made even", text)
        self.assertIn("1 missing rows filled in", text)
        self.assertNotIn("b.csv': rows made even", text)

    def test_arrays_tell_their_period_by_their_velocities(self):
        rows = swing(1)
        ends = np.zeros(len(rows) - 1)
        np.savez(self.folder / "log.npz", observations=rows[:-1, 1:5], actions=rows[:-1, 5:], next_observations=rows[1:, 1:5],
                 terminals=ends, timeouts=ends)
        text, task = self.init(self.folder / "log.npz")
        self.assertAlmostEqual(task["task"]["control_period"], 0.02)
        self.assertIn("as positions and velocities say", text)

    def test_an_angle_that_the_log_keeps_within_a_turn_is_unwrapped(self):
        rows = swing(1)
        cut = np.median(rows[:, 2])
        rows[:, 2] = cut + (rows[:, 2] - cut) % (2 * math.pi)
        for columns in (range(7), (0, 1, 2, 5, 6)):  # with velocities and without
            text, task = self.init(self.csv(rows[:, columns], [NAMES[i] for i in columns]))
            self.assertEqual(task["data"]["unwrap"], ["joint/elbow_joint/qpos"])
            self.assertRegex(text, r"joint/elbow_joint/qpos jumps by a whole turn in \d+ rows, which data.unwrap takes out")
            check = json.loads(self.succeed("data", "check", self.task, "--json").stdout)
            self.assertNotIn("wrapped_angle", [f["check"] for f in check["findings"]])
            self.task.unlink()

    def test_positions_alone_are_enough(self):
        _, task = self.init(self.csv(swing(1)[:, [0, 1, 2, 5, 6]], [NAMES[i] for i in (0, 1, 2, 5, 6)]))
        self.assertEqual(task["task"]["observations"], ["joint/*/qpos"])
        self.assertEqual(task["task"]["start"], "logs")
        self.assertIn("damping_elbow_joint", task["parameters"])
        self.succeed("data", "check", self.task)

    def test_a_urdf_gets_motors(self):
        self.model = self.folder / "arm.urdf"
        link = "<link name='{}'><inertial><mass value='1'/><origin xyz='0 0 -0.2'/><inertia ixx='.02' iyy='.02' izz='.01' ixy='0' ixz='0' iyz='0'/></inertial></link>"
        joint = "<joint name='hinge' type='continuous'><parent link='base'/><child link='upper'/><axis xyz='0 1 0'/>{}</joint>"
        robot = "<robot name='arm'>" + "".join(map(link.format, ("base", "upper"))) + joint + "</robot>"
        rows = swing(1)[:, [0, 1, 3, 5]]
        log = self.csv(rows, ["time", "hinge_pos", "hinge_vel", "hinge_effort"])
        self.model.write_text(robot.format(""))
        _, task = self.init(log)
        self.assertEqual(task["task"]["motors"], ["joint/hinge"])
        self.assertGreaterEqual(task["task"]["action_range"][1], abs(rows[:, 3]).max())
        self.model.write_text(robot.format("<limit effort='10' velocity='5'/>"))
        self.task.unlink()
        _, task = self.init(log)
        self.assertNotIn("action_range", task["task"], "the joint's limit is the motor's range")

    # --- what does not fit is told

    def test_degrees_are_told(self):
        rows = swing(1)
        rows[:, 1] *= 180 / math.pi
        self.assertRegex(self.init(self.csv(rows))[0], r"joint/shoulder_joint/qpos changes 57\.\d times as fast as")

    def test_a_unit_that_the_task_file_corrects_is_the_models(self):
        rows = swing(1)
        rows[:, [1, 3]] *= 180 / math.pi
        text, _ = self.init(self.csv(rows))
        self.assertIn("multiply joint/shoulder_joint/qpos and joint/shoulder_joint/qvel by 0.0174533", text)
        scale = 'scale = { "joint/shoulder_joint/*" = 0.017453292519943295 }'
        self.task.write_text(self.task.read_text().replace("[data]", f"[data]\n{scale}"))
        record = json.loads(self.succeed("data", "check", self.task, "--json").stdout)
        self.assertEqual([f["check"] for f in record["findings"] if f["severity"] != "note"], [])

    def test_a_velocity_of_the_other_sign_is_told(self):
        rows = swing(1)
        rows[:, 4] *= -1
        text, _ = self.init(self.csv(rows))
        self.assertIn("joint/elbow_joint/qpos changes -1 times as fast as joint/elbow_joint/qvel says", text)
        # The model says which of the two it is, and blames nothing else.
        self.assertIn("turn round the sign of joint/elbow_joint/qvel", text)
        self.assertNotIn("actuator/elbow turned round", text)

    def test_velocities_that_show_late_need_no_look_and_the_check_tells_them(self):
        """The default method finds velocities from positions."""
        rows = swing(1)
        rows[2:, 3] = rows[:-2, 3].copy()  # the shoulder's, by two rows
        text, _ = self.init(self.csv(rows))
        late = r"later than their positions move: joint/shoulder_joint/qvel by (1\.75|2|2\.25) rows"
        self.assertNotRegex(text, late)
        self.assertRegex(self.succeed("data", "check", self.task).stdout.replace("\n            ", " "), late)

    def test_a_velocity_that_is_not_zero_at_rest_is_told(self):
        rows = swing(1)
        rows[:, 3] += 0.3
        text, _ = self.init(self.csv(rows))
        self.assertRegex(text, r"joint/shoulder_joint/qvel is 0\.(29|3|31) more than joint/shoulder_joint/qpos moves")
        self.task.unlink()
        self.assertNotIn("velocity_zero", self.init(self.csv(swing(2)))[0])

    def test_an_action_of_the_other_sign_is_told(self):
        rows = swing(1)
        rows[:, 6] *= -1
        text, _ = self.init(self.csv(rows))
        self.assertIn("turn round the sign of actuator/elbow", text)
        self.assertNotIn("turn round the sign of actuator/shoulder", text)

    def test_an_offset_beyond_the_limits_is_told(self):
        rows = swing(1)
        rows[:, 1] += 4
        self.assertIn("another zero, sign or unit", self.init(self.csv(rows))[0])

    def test_right_logs_raise_no_suspicion(self):
        self.assertNotIn("look at this before a design", self.init(self.csv(swing(1, damping=0.05)))[0])

    def test_a_column_of_text_is_told_and_a_joints_own_name_comes_before_its_motors(self):
        rows = swing(1)
        log = self.csv(rows)
        lines = [line.split(",") for line in log.read_text().splitlines()]
        for line in lines[1:]:
            line[3] = "late"
        log.write_text("\n".join(",".join(line) for line in lines))
        text, _ = self.init(log)
        self.assertRegex(text, "'shoulder_vel': it holds text \\('late' in line 2\\), wanted numbers")
        self.task.unlink()
        names = ["time", "shoulder_joint", "elbow_joint", "shoulder_vel", "elbow_vel", "shoulder_cmd", "elbow_cmd", "shoulder_pos"]
        text, task = self.init(self.csv(np.column_stack([rows, rows[:, 1]]), names))
        self.assertRegex(text, r"shoulder_joint +joint/shoulder_joint/qpos")
        self.assertIn("shoulder_joint", str(task["data"]))

    def test_times_are_read_in_the_unit_of_their_name(self):
        rows = swing(1)
        rows[:, 0] *= 1000
        gap = np.delete(rows, slice(40, 50), axis=0)
        for name, setting in (("time_ms", None), ("stampMs", "stampMs")):
            with self.subTest(name):
                _, task = self.init(self.csv(gap, [name, *NAMES[1:]]))
                self.assertAlmostEqual(task["task"]["control_period"], 0.02)
                self.assertEqual(task["data"].get("time"), setting)
                check = program.oted("data", "check", self.task, "--json")
                self.task.unlink()
                self.assertEqual(json.loads(check.stdout)["dataset"]["n_episodes"], 2, "ten rows are missing")

    def test_what_it_cannot_tell_is_refused_with_nothing_left(self):
        rows = swing(1)
        scaled = rows * ([1000] + [1] * 6)
        for log, code, needles in [
                (self.csv(scaled, file="0.csv"), DATA_OR_MODEL, ["goes up by 20 per row, wanted seconds"]),
                (self.csv(rows[:, 1:], NAMES[1:], file="1.csv"), USAGE, ["--period"]),
                (self.csv(rows, ["time", *"abcdef"], file="2.csv"), DATA_OR_MODEL, ["no column is a position", "shoulder_joint"]),
                (self.csv(rows[:, :5], NAMES[:5], file="3.csv"), DATA_OR_MODEL, ["no column is a command"]),
                (self.csv(rows[:1], file="4.csv"), DATA_OR_MODEL, ["has 1 rows"]),
                (self.folder / "missing.csv", DATA_OR_MODEL, ["missing.csv"])]:
            with self.subTest(needles):
                self.assertNothingLeft(oted("init", self.model, log, "--out", self.task), code, *needles)
        good, other = self.csv(rows, file="a.csv"), self.csv(rows[::2], file="b.csv")
        self.assertNothingLeft(oted("init", self.model, good, other, "--out", self.task), DATA_OR_MODEL, "0.04 s apart", "0.02 s",
                               "--period 0.04")
        self.assertNothingLeft(oted("init", self.folder / "no.xml", good, "--out", self.task), DATA_OR_MODEL, "no.xml")
        self.assertNothingLeft(oted("init", self.model, good, "--out", self.folder / "task.txt"), USAGE, ".toml")

    def test_logs_of_different_rates_are_read_at_the_period_that_is_asked_for(self):
        good, other = self.csv(swing(1), file="a.csv"), self.csv(swing(2)[::2], file="b.csv")
        _, task = self.init(good, other, more=["--period", "0.04"])
        self.assertEqual(task["task"]["control_period"], 0.04)
        self.succeed("data", "info", self.task)

    def test_a_table_in_another_form_is_refused_by_file_and_line(self):
        text = self.csv(swing(1), file="good.csv").read_text()
        lines = text.splitlines()

        def with_field(line, column, value):
            fields = lines[line - 1].split(",")
            fields[NAMES.index(column)] = value
            return "\n".join([*lines[:line - 1], ",".join(fields), *lines[line:]])

        for name, content, needles in [
                ("semicolons", text.replace(",", ";"), ["line 1", "semicolons", "save it with commas"]),
                ("tabs", text.replace(",", "\t"), ["line 1", "tabs", "save it with commas"]),
                ("decimal commas", text.replace(",", ";").replace(".", ","), ["line 1", "semicolons", "points in numbers"]),
                ("quoted commas", with_field(5, "elbow_pos", '"0,5"'), ["line 5", "elbow_pos", "'0,5'", "repair"]),
                ("word in a command", "\n".join(",".join(line.split(",")[:5]) + ",off,off" if i else line for i, line in enumerate(lines)),
                 ["line 2", "shoulder_cmd", "'off' is no number"]),
                ("large action", with_field(7, "elbow_cmd", "1e308"), ["line 7", "elbow_cmd", "1e308", "repair"]),
                ("action nan", with_field(7, "elbow_cmd", "nan"), ["line 7", "elbow_cmd", "nan", "repair"]),
                ("reversed", "\n".join(lines[:1] + lines[:0:-1]), ["column 'time' goes up in 0 rows and down in", "sort the rows"]),
                ("header alone", lines[0] + "\n", ["has 0 rows"]),
                ("empty", "", ["is empty"]),
                ("open quote", with_field(5, "time", '"0'), ["line 5", "quote"])]:
            with self.subTest(name):
                log = self.folder / "log.csv"
                log.write_text(content)
                self.assertNothingLeft(oted("init", self.model, log, "--out", self.task), DATA_OR_MODEL, "log.csv", *needles)

    def test_the_marks_of_other_programs_change_nothing(self):
        good = self.csv(swing(1), file="log.csv")
        first = self.init(good)
        for content in (b"\xef\xbb\xbf" + good.read_bytes(), good.read_bytes().replace(b"\n", b"\r\n"),
                        b"\n".join(b",".join(b'"%s"' % field for field in line.split(b",")) for line in good.read_bytes().split())):
            self.task.unlink()
            good.write_bytes(content)
            self.assertEqual(self.init(good), first)

    def test_a_period_that_is_none_is_refused(self):
        log = self.csv(swing(1)[:, 1:], NAMES[1:])
        for period in ("nan", "inf", "-1", "0", "1e18", "1e308", "1e999", "soon"):
            with self.subTest(period):
                result = oted("init", self.model, log, "--period", period, "--out", self.task)
                self.assertNothingLeft(result, USAGE, f"{float(period):g} s" if period in ("1e18", "1e308") else f"got '{period}', wanted a positive number")

    def test_a_file_that_is_there_stays(self):
        self.task.write_text("# mine\n")
        result = oted("init", self.model, self.csv(swing(1)), "--out", self.task)
        self.assertOneLine(result, USAGE, "is there already")
        self.assertEqual(self.task.read_text(), "# mine\n")


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
