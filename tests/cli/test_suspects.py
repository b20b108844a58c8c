"""What is not searched and off by the logs is named, and freeing it closes the gap.

    test_suspects.py PATH/TO/oted [TestClass.test_name ...]
"""

import json
import pathlib
import tempfile
import unittest

import jsonschema
import log_robots
import program

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
GAIN, DAMPING = "gain=actuator/*/gainprm[0]:0.2:2.0", "damping=joint/*/damping:0.2:2.0"
# What tries suspects is as by default; what is tried beside the method, and only where it fails, is small.
SMALL = program.sets([s for s in program.TINY_DESIGN if not s.startswith("design.trajectories.")] +
                     ["selection.n_seeds=1", "design.trajectories.tried=3", "report.motion=false"])
SMALL_WINDOWS = program.sets(["design.trajectories.rows=96", "design.trajectories.window=16", "design.trajectories.starts=1",
                              "design.trajectories.coarse=4"])
MOST_SECONDS = 1800  # of one design of the Hopper
# Two links that hang, each with a motor.
LINKS = """<mujoco model="two links">
  <compiler angle="radian"/>
  <option timestep="0.005" integrator="implicitfast"/>
  <default>
    <joint axis="0 1 0" damping="0.3" armature="0.02"/>
    <geom type="capsule" size="0.03" contype="0" conaffinity="0"/>
  </default>
  <worldbody>
    <body name="upper">
      <joint name="shoulder"/>
      <geom fromto="0 0 0 0 0 -0.4" mass="1.5"/>
      <body name="fore" pos="0 0 -0.4">
        <joint name="elbow"/>
        <geom fromto="0 0 0 0 0 -0.3" mass="0.8"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="shoulder" joint="shoulder" ctrlrange="-1 1" gear="6"/>
    <motor name="elbow" joint="elbow" ctrlrange="-1 1" gear="2"/>
  </actuator>
</mujoco>
"""
# A link with a position servo, whose force has a limit.
SERVO = """<mujoco model="servo link">
  <compiler angle="radian"/>
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody>
    <body name="arm">
      <joint name="hip" axis="0 1 0" damping="0.2" armature="0.02" frictionloss="0.1"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="1" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator><position name="hip" joint="hip" kp="40" kv="1.5" ctrlrange="-1.2 1.2" forcerange="-24 24"/></actuator>
</mujoco>
"""


class RunsTest(unittest.TestCase):
    """Designs in a folder of the class's own."""

    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def design(self, name, logs, *parameters, more=()):
        """@return what the program said, and design.json"""
        words = [word for parameter in parameters for word in ("--param", parameter)]
        result = program.oted("design", *logs, "--out", self.folder / name, "--quiet", *words, *SMALL, *more,
                              timeout=MOST_SECONDS)
        return result, json.loads((self.folder / name / "design.json").read_text())

    def check_schemas(self, name):
        for file, schema in (("design.json", "oted.design.1"), ("design/default/1/q.json", "oted.q.1")):
            jsonschema.validate(json.loads((self.folder / name / file).read_text()),
                                json.loads((ROOT / f"docs/schemas/{schema}.schema.json").read_text()))


class HopperTest(RunsTest):
    """Two episodes of Hopper with 1.2 times the gain and 0.7 times the damping of every joint."""

    def collect(self, name, *more):
        result = program.oted("collect", "--task", "Hopper-v5", "--policy", ROOT / "examples/policies/hopper/medium.npz",
                              "--episodes", "2", "--seed", "1", "--param", GAIN, "--truth", "gain=1.2", "--param", DAMPING,
                              "--truth", "damping=0.7", "--out", self.folder / name, *more)
        self.assertEqual(result.returncode, 0, result.stderr)
        return ["--task", "Hopper-v5", "--data", self.folder / name]

    def test_the_damping_that_nobody_searches_is_the_first_suspect(self):
        result, design = self.design("gain", self.collect("demos.npz"), GAIN, more=SMALL_WINDOWS)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(design["verdict"], "gap_narrowed")
        first = design["fit"]["suspects"][0]
        self.assertEqual(first["field"], "joint/*/damping")
        self.assertTrue(first["freed"]["kept"])
        self.assertAlmostEqual(first["freed"]["value"], 0.7, delta=0.05)

    def test_no_gap_is_closed_where_noise_hides_what_is_off_from_predictions_but_not_from_the_fit(self):
        result, design = self.design("noisy", self.collect("noisy.npz", "--noise", "0.05"), GAIN, more=SMALL_WINDOWS)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(design["verdict"], "gap_narrowed", design["sentence"])
        self.assertFalse(any(channel["disagrees"] for channel in design["fit"]["channels"]), "else it tests nothing")
        self.assertIn("the logs surely ask for something that is not searched", design["sentence"])
        self.assertNotIn("identified", [parameter["verdict"] for parameter in design["parameters"]])
        first = design["fit"]["suspects"][0]
        self.assertEqual(first["field"], "joint/*/damping")
        self.assertAlmostEqual(first["freed"]["value"], 0.7, delta=0.05)
        self.assertIn(f"suspect, not among the parameters: {first['sentence']}; add this line: ", result.stdout)


class LinksTest(RunsTest):
    """Two recordings of two links with 1.2 times the gain and 0.7 times the damping of every joint."""

    def setUp(self):
        self.logs = self.log("logs")

    def log(self, name, elbow=1.0, plant=None):
        """elbow: times the elbow's damping. plant(commands): a fault of the logged ones."""
        def target(model):
            model.actuator_gainprm[:, 0] *= 1.2
            model.dof_damping[:] *= 0.7
            model.dof_damping[1] *= elbow

        robot = log_robots.Robot(LINKS, 0.02, episodes=2, rows=150)
        log = log_robots.drive(robot, change=target)
        if plant is not None:
            plant(log.commands)
        folder = self.folder / name
        folder.mkdir(exist_ok=True)
        return [log_robots.write(robot, log, folder)]

    def test_the_damping_that_nobody_searches_is_freed_and_the_line_that_adds_it_is_told(self):
        result, design = self.design("gain", self.logs, GAIN)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(design["verdict"], "gap_narrowed")
        self.assertIn("verdict: gap narrowed by ", result.stdout)
        first = design["fit"]["suspects"][0]
        self.assertEqual(first["field"], "joint/*/damping")
        self.assertTrue(first["freed"]["kept"])
        self.assertAlmostEqual(first["freed"]["value"], 0.7, delta=0.05)
        line = 'damping = { field = "joint/*/damping", range = [0.1, 10], log = true }'
        self.assertIn(f"suspect, not among the parameters: {first['sentence']}; add this line: {line}\n", result.stdout)
        self.assertIn("with joint/*/damping freed (0.7 times the model's value): ", first["sentence"])
        self.assertIn("method: trajectories, as it surely predicts better than the nominal simulator", result.stdout)
        self.assertEqual(design["method_choices"][0]["tried"], [])
        self.assertIn("with joint/*/damping freed", (self.folder / "gain/report.html").read_text())
        self.check_schemas("gain")

    def test_where_one_joint_is_off_it_is_named_beside_what_is_searched_of_all_of_them(self):
        elbow = self.log("elbow_off", elbow=0.5)
        result, design = self.design("elbow", elbow, GAIN, DAMPING)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(design["verdict"], "gap_narrowed", design["sentence"])
        first = design["fit"]["suspects"][0]
        self.assertEqual(first["field"], "joint/elbow/damping")
        self.assertTrue(first["freed"]["kept"])
        self.assertAlmostEqual(first["freed"]["value"], 0.5, delta=0.01)
        self.assertIn("with joint/elbow/damping freed (0.5 times what 'damping' gives): ", first["sentence"])
        result, design = self.design("elbow_added", elbow, GAIN, DAMPING, "elbow_damping=joint/elbow/damping:0.1:10:log")
        self.assertEqual([p["unit"] for p in design["parameters"]], ["x nominal", "x nominal", "x damping"])
        for parameter, truth in zip(design["parameters"], (1.2, 0.7, 0.5)):
            self.assertAlmostEqual(parameter["mode"], truth, delta=1e-3)

    def test_a_range_that_ends_before_the_truth_is_told_beside_the_suspects(self):
        result, design = self.design("narrow", self.logs, "gain=actuator/*/gainprm[0]:0.2:1.1")
        self.assertTrue(any(suspect["freed"]["kept"] for suspect in design["fit"]["suspects"]), design["fit"]["suspects"])
        self.assertIn("\n'gain' is at the end of its range [0.2, 1.1]: that range is too narrow, or a suspect is off", result.stdout)
        self.assertTrue(any("'gain'" in warning and "widen the range" in warning for warning in design["warnings"]),
                        design["warnings"])

    def test_freed_it_is_found_and_nothing_else_is_suspected(self):
        result, design = self.design("both", self.logs, GAIN, DAMPING)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(design["fit"]["suspects"], [])
        self.assertIn("method: trajectories, as its predictions are as near to the logs as the sensors let them", result.stdout)
        self.assertEqual(design["method_choices"][0]["tried"], [])
        for parameter, truth in zip(design["parameters"], (1.2, 0.7)):
            self.assertAlmostEqual(parameter["mode"], truth, delta=1e-4)
        self.assertNotIn("not searched", result.stdout)

    def test_growing_adds_it_and_the_run_goes_on_with_it(self):
        result, design = self.design("grown", self.logs, GAIN, more=["--grow", "--set", "design.trajectories.tried=1"])
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual([p["name"] for p in design["parameters"]], ["gain", "damping"])
        self.assertFalse(design["columns_seem_wrong"])
        for parameter, truth in zip(design["parameters"], (1.2, 0.7)):
            self.assertAlmostEqual(parameter["mode"], truth, delta=1e-3)
        self.assertEqual([grown["field"] for grown in design["grown"]], ["joint/*/damping"])
        self.assertIn("added to the parameters: damping = ", result.stdout)
        self.check_schemas("grown")
        run = self.folder / "grown"
        self.assertNotIn("damping", (run / "run.toml").read_text().partition("[parameters]")[2].partition("[clone]")[0])
        # Again, by the directory's own settings: all of it is there. Then without the last record: the rounds are not made again.
        before = {path: path.read_bytes() for path in run.rglob("*.json") if path.parent.name != "motion"}
        for _ in range(2):
            again = program.oted("design", "--out", run, "--quiet")
            self.assertEqual(again.returncode, 0, again.stderr)
            for name in ("design.json", "growth/1/growth.json", "design/default/1/q.json"):
                self.assertEqual((run / name).read_bytes(), before[run / name])
            (run / "design.json").unlink()
        # Damage is mended, and what a program left that died behind a round's record goes.
        for name in ("growth/2/design/q.json", "growth/1/growth.json"):
            (run / name).write_bytes(before[run / name][:100])
        (run / "growth/1/design/trial_1.json").write_text("{}")
        again = program.oted("design", "--out", run, "--quiet")
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertIn("growth.json' is damaged: its stage is made again", again.stderr)
        kept = [path for path in before if {"growth", "design"} & set(path.relative_to(run).parts)] + [run / "design.json"]
        self.assertEqual([path for path in kept if path.read_bytes() != before[path]], [])
        self.assertFalse((run / "growth/1/design/trial_1.json").exists())
        self.assertEqual(program.oted("verify", run).returncode, 0)
        (run / "design.json").unlink()
        self.assertEqual(program.oted("export", run, "--mjcf", self.folder / "grown.xml").returncode, program.DATA_OR_MODEL)
        # The last round added nothing: its design is the run's, and what a run of the grown parameters finds.
        result, plain = self.design("grown_by_hand", self.logs, GAIN, "damping=joint/*/damping:0.1:10:log",
                                    more=["--set", "design.trajectories.tried=1"])
        self.assertEqual([p["mode"] for p in design["parameters"]], [p["mode"] for p in plain["parameters"]])
        for key in ("validation", "sentence"):
            self.assertEqual(design[key], plain[key])
        curves = [(folder / "curves.csv").read_bytes() for folder in
                  (run / "growth/2/design", run / "design/default/1", self.folder / "grown_by_hand/design/default/1")]
        self.assertEqual(curves[0], curves[1])
        self.assertEqual(curves[0], curves[2])

    def test_where_a_value_ends_at_its_bound_nothing_is_added_and_it_says_why(self):
        result, design = self.design("bound", self.logs, GAIN.replace(":2.0", ":1.1"), DAMPING, more=["--grow", "--episodes", "1", "--set",
                                                                                       "design.trajectories.tried=0"])
        self.assertNotIn("grown", design)
        self.assertIn("nothing was added: 'gain' ends at a bound of its range; widen it first", result.stderr)

    def test_an_action_of_the_other_sign_is_told_and_the_remedy_with_it_and_nothing_grows(self):
        def turn(commands):
            commands[:, :, 1] *= -1

        result, design = self.design("flipped", self.log("turned", plant=turn), GAIN, more=["--grow", "--episodes", "1", "--set",
                                     "design.method=trajectories", "--set", "design.trajectories.tried=0"])
        self.assertIn(design["verdict"], ("gap_narrowed", "outside_family"))
        [warning] = [warning for warning in design["warnings"] if warning.startswith("data, ")]
        self.assertIn("action_sign", warning)
        self.assertIn("turn round the sign of", warning)
        self.assertIn(warning, result.stdout + result.stderr)
        self.assertTrue(design["columns_seem_wrong"])
        self.assertNotIn("grown", design)
        self.assertIn("nothing was added: columns of the logs seem wrong", result.stderr)

    def test_what_cannot_grow_is_refused_before_anything_is_written(self):
        for setting, words in (("design.method=paper", "method trajectories alone finds"),
                               ("design.prior=elsewhere", "no such path")):
            result = program.oted("design", *self.logs, "--out", self.folder / "refused",
                                  "--quiet", "--param", GAIN, "--grow", "--set", setting)
            self.assertEqual(result.returncode, 2)
            self.assertIn(words, result.stderr)
            self.assertFalse((self.folder / "refused").exists())


class OwnRobotTest(unittest.TestCase):
    """A link with a position servo, logged by MuJoCo's own Python; its joint's damping is 1.6 times the model's."""

    def design(self, plant=None, change=None, more=()):
        """What design.json has, what was said, and the report."""
        def target(model):
            model.dof_damping[:] *= 1.6
            if change is not None:
                change(model)

        robot = log_robots.Robot(SERVO, 0.02)
        log = log_robots.drive(robot, change=target, noise=1e-3)
        if plant is not None:
            plant(log.rows)
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            result = program.oted("design", log_robots.write(robot, log, folder), "--out", folder / "run", "--quiet",
                                  "--param", "damping=joint/hip/damping:0.2:5:log", "--param",
                                  "stiffness=actuator/hip/kp:0.3:3:log", "--set", "report.motion=false", *more)
            self.assertEqual(result.returncode, 0, result.stderr)
            design = json.loads((folder / "run/design.json").read_text())
            return design, result.stdout, (folder / "run/report.html").read_text()

    @staticmethod
    def delay(rows):
        rows[:, 1:, 0] = rows[:, :-1, 0].copy()

    def test_a_force_limit_that_the_model_does_not_reach_is_the_first_suspect(self):
        def weaken(model):
            model.actuator_forcerange[:] /= 6  # the model's own drive never comes near 24 N m

        design, said, _ = self.design(change=weaken)
        self.assertEqual(design["verdict"], "gap_narrowed", design["sentence"])
        first = design["fit"]["suspects"][0]
        self.assertEqual(first["field"], "actuator/*/forcerange", said)
        self.assertTrue(first["freed"]["kept"])
        self.assertAlmostEqual(first["freed"]["value"], 1 / 6, delta=0.01)

    def test_a_position_that_comes_a_row_late_beside_a_prompt_velocity_is_the_first_suspect(self):
        design, said, _ = self.design(plant=self.delay)
        self.assertEqual(design["verdict"], "gap_narrowed", design["sentence"])
        first = design["fit"]["suspects"][0]
        self.assertEqual(first["field"], "obs/joint/hip/qpos/delay", said)
        self.assertTrue(first["freed"]["kept"])
        self.assertAlmostEqual(first["freed"]["value"], 1, delta=0.1)

    def test_what_the_exported_model_cannot_hold_is_told_by_the_output_and_by_the_report(self):
        _, said, report = self.design(plant=self.delay, more=["--param", "lag=obs/joint/hip/qpos/delay:0:3:absolute"])
        lacks = "without lag, which this file cannot hold"
        self.assertIn(f"run/export/designed.xml\n  {lacks}", said)
        self.assertIn(f"The file export/designed.xml is {lacks}", report)

    def test_with_neither_nothing_is_suspected(self):
        design, said, _ = self.design()
        self.assertEqual(design["verdict"], "gap_closed", design["sentence"])
        self.assertEqual(design["fit"]["suspects"], [], said)


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
