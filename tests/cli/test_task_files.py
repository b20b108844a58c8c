"""Tasks that a file describes, from the model to the report, and a program with a task of its own.

    test_task_files.py PATH/TO/oted PATH/TO/custom_task [TestClass.test_name ...]

The models of examples/*.toml come from the dm_control wheel (requirements-models.txt, installed by make setup).
"""

import hashlib
import json
import pathlib
import re
import tomllib
import unittest

import numpy as np

import program
from program import DATA_OR_MODEL, ROOT, TINY, USAGE, ProgramTest, oted, sets

CUSTOM = None  # a program with a task of its own, from the command line
EXAMPLES = ROOT / "examples"
SETTINGS = [*TINY, "sac.n_steps=120", "sac.learning_starts=60", "sac.batch_size=16", "sac.eval_interval=60",
            "report.motion=auto"]
QUICK = sets(SETTINGS)

CART = """<mujoco>
  <option timestep="0.01"/>
  <worldbody>
    <body name="cart"><joint name="slide" type="slide" axis="1 0 0" damping="1"/><geom size="0.1" mass="1"/></body>
  </worldbody>
  <actuator><motor name="push" joint="slide" ctrlrange="-5 5" ctrllimited="true"/></actuator>
</mujoco>
"""
CART_TASK = """[task]
model = "models/cart.xml"
control_period = 0.05
start_noise = 0.1
max_episode_steps = 40
{more}
[parameters]
damping = {{ field = "joint/slide/damping", range = [0.2, 4.0] }}
[truth]
damping = 2.5
"""


class TaskFiles(ProgramTest):
    def cart(self, more=""):
        """A task file whose model lies below its own folder."""
        (self.folder / "models").mkdir(exist_ok=True)
        (self.folder / "models/cart.xml").write_text(CART)
        path = self.folder / "cart.toml"
        path.write_text(CART_TASK.format(more=more))
        return path

    def log(self, task, *more, policy="sine", episodes=3):
        data = self.folder / "logs.npz"
        result = oted("collect", "--task", task, "--policy", policy, "--episodes", episodes, "--threads", 1, "--out",
                      data, *more)
        self.assertEqual(result.returncode, 0, result.stderr)
        return data

    # --- the examples: models that this repository has never held

    def test_examples_are_short(self):
        for path in (EXAMPLES / "arm.toml", EXAMPLES / "walker.toml"):
            self.assertLess(len(path.read_text().splitlines()), 30, path)

    def run_example(self, name, episodes, has_assets=False):
        data = self.log(EXAMPLES / f"{name}.toml", episodes=episodes)
        result = oted("run", EXAMPLES / f"{name}.toml", "--data", data, "--out", self.out, "--threads", 1, *QUICK)
        self.assertIn(result.returncode, (0, 4), result.stderr)
        self.assertTrue((self.out / "report.html").exists())
        design = json.loads((self.out / "design.json").read_text())
        evaluation = json.loads((self.out / "evaluation.json").read_text())
        task = tomllib.loads((EXAMPLES / f"{name}.toml").read_text())
        self.assertEqual([p["name"] for p in design["parameters"]], list(task["parameters"]))
        self.assertEqual([p["truth"] for p in evaluation["parameters"]], list(task["truth"].values()))
        self.assertEqual({p["name"] for p in evaluation["policies"]}, {"random", "clone", "sac_nominal", "oted_sac"})
        self.assertEqual(design["task"], task["task"]["name"])
        # What was simulated lies beside what came of it.
        compiled = (self.out / "model/compiled.mjb").read_bytes()
        if not has_assets:  # whose paths the file holds, too
            self.assertEqual(hashlib.sha256(compiled).hexdigest(), design["model"]["sha256"])
        self.assertTrue((self.out / "model" / pathlib.Path(task["task"]["model"]).name).exists())

    def test_a_walker_from_nothing_to_the_report(self):
        self.run_example("walker", episodes=6)

    def test_an_arm_from_nothing_to_the_report(self):
        self.run_example("arm", episodes=2, has_assets=True)

    def test_a_csv_and_a_model_never_seen_before_give_the_truth(self):
        # As docs/your_own_robot.md has it: one short file, two checks, one command, one export.
        task = self.cart()
        self.assertEqual(oted("collect", "--task", task, "--policy", "sine", "--episodes", 3, "--threads", 1, "--out",
                              self.folder / "logs.csv").returncode, 0)
        header = (self.folder / "logs.csv").read_text().splitlines()[0]
        self.assertIn("joint/slide/qpos", header)
        robot = self.folder / "robot.toml"
        robot.write_text(task.read_text().split("[truth]")[0] + '[data]\npath = "logs.csv"\n')
        self.assertLess(len(robot.read_text().splitlines()), 30)

        check = oted("data", "check", robot, "--json")
        self.assertEqual(check.returncode, 0, check.stderr)
        self.assertNotEqual(json.loads(check.stdout)["gap"]["verdict"], "none")
        effects = oted("params", "check", robot, "--json")
        self.assertEqual(effects.returncode, 0, effects.stderr)
        result = oted("design", robot, "--out", self.out, "--threads", 1, "--quiet", *sets(
            [s for s in SETTINGS if not s.startswith("design.trajectories")]))
        self.assertEqual(result.returncode, 0, result.stderr)
        design = json.loads((self.out / "design.json").read_text())
        self.assertAlmostEqual(design["parameters"][0]["mode"], 2.5, delta=0.01)
        self.assertEqual(design["parameters"][0]["verdict"], "identified")
        self.assertEqual(design["verdict"], "gap_closed")
        self.assertIn("2.5", (self.out / "export/designed.xml").read_text())
        self.assertTrue((self.out / "report.html").exists())

    # --- where things are found, and what is kept

    def test_the_model_is_found_beside_its_task_file_and_the_run_goes_on_from_elsewhere(self):
        task = self.cart('reward = "-abs(x)"\n[task.quantities]\nx = "joint/slide/qpos"')
        data = self.log(task)
        words = ["--data", data, "--out", "runs/cart", "--threads", 1, *QUICK]
        self.assertEqual(oted("design", "cart.toml", *words, cwd=self.folder).returncode, 0)
        # From another folder, without the file: the run directory's own run.toml is enough.
        (self.folder / "other").mkdir()
        result = oted("train", "--out", self.folder / "runs/cart", "--threads", 1, cwd=self.folder / "runs")
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_a_model_with_a_mesh_may_be_used_in_its_own_folder_and_named_in_any_way(self):
        (self.folder / "wedge.obj").write_text("v -1 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
        geom = '<geom size="0.1" mass="1"/>'
        mesh = '<asset><mesh name="wedge" file="wedge.obj"/></asset>'
        (self.folder / "cart.xml").write_text(
            CART.replace("<worldbody>", mesh + "<worldbody>").replace(geom, geom.replace("size=", 'type="mesh" mesh="wedge" size=')))
        task = self.folder / "cart.toml"
        task.write_text(CART_TASK.format(more='reward = "-abs(x)"\n[task.quantities]\nx = "joint/slide/qpos"')
                        .replace("models/", ""))
        data = self.log(task)
        result = oted("design", "cart.toml", "--data", data, "--out", "run", "--threads", 1, *QUICK, cwd=self.folder)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertNotIn("not exported", result.stderr)
        for words in (["train", task, "--data", data, *QUICK], ["train"]):
            result = oted(*words, "--out", self.folder / "run", "--threads", 1, cwd="/")
            self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(oted("export", "run", "--mjcf", "again.xml", cwd=self.folder).returncode, 0)

    def test_the_kept_task_is_a_task_again(self):
        task = self.cart()
        data = self.log(task)
        self.assertEqual(
            oted("design", task, "--data", data, "--out", self.out, "--threads", 1, *QUICK).returncode, 0)
        again = self.folder / "again.npz"
        result = oted("collect", "--task", self.out / "model/task.toml", "--policy", "sine", "--episodes", 3, "--threads",
                      1, "--out", again, "--param", "damping=joint/slide/damping:0.2:4", "--truth", "damping=2.5")
        self.assertEqual(result.returncode, 0, result.stderr)
        np.testing.assert_array_equal(np.load(again)["observations"], np.load(data)["observations"])

    def test_another_model_or_task_is_not_mixed_with_what_is_there(self):
        task = self.cart()
        data = self.log(task)
        words = ["design", task, "--data", data, "--out", self.out, "--threads", 1, *QUICK]
        self.assertEqual(oted(*words).returncode, 0)
        model = self.folder / "models/cart.xml"
        model.write_text(CART.replace('mass="1"', 'mass="1.1"'))
        self.assertOneLine(oted(*words), USAGE, str(self.out))
        model.write_text(CART)
        self.assertEqual(oted(*words).returncode, 0)
        task.write_text(task.read_text().replace("max_episode_steps = 40", "max_episode_steps = 41"))
        self.assertOneLine(oted(*words), USAGE, str(self.out))

    # --- forms that follow from the task

    def test_a_task_without_reward_is_designed_and_no_agent_trained(self):
        task = self.cart()
        data = self.log(task)
        self.assertNotIn("rewards", np.load(data).files)
        result = oted("run", task, "--data", data, "--out", self.out, "--threads", 1, *QUICK)
        self.assertIn(result.returncode, (0, 4), result.stderr)
        self.assertIn("has no reward", result.stderr)
        self.assertTrue((self.out / "design.json").exists())
        self.assertTrue((self.out / "report.html").exists())
        self.assertFalse((self.out / "agents").exists())
        self.assertOneLine(oted("train", "--out", self.out), USAGE, "task.reward")
        self.assertOneLine(oted("behavior", "--task", task, "--out", self.folder / "b"), USAGE, "task.reward")
        # With a reward the run goes on: the simulator that was designed is the same.
        designed = {path: path.stat().st_mtime_ns for path in self.out.glob("design/**/q.json")}
        self.assertTrue(designed)
        task = self.cart('reward = "-abs(x)"\n[task.quantities]\nx = "joint/slide/qpos"')
        result = oted("run", task, "--data", data, "--out", self.out, "--threads", 1, *QUICK)
        self.assertIn(result.returncode, (0, 4), result.stderr)
        self.assertTrue((self.out / "agents").exists())
        self.assertEqual({path: path.stat().st_mtime_ns for path in designed}, designed)

    def test_velocities_that_nobody_logged_are_inferred_by_the_default_method(self):
        task = self.cart('observations = ["joint/slide/qpos"]')
        data = self.log(task)
        result = oted("design", task, "--data", data, "--out", self.out, "--threads", 1, *QUICK)
        self.assertIn(result.returncode, (0, 4), result.stderr)
        self.assertNotIn("actions = clone", result.stderr)
        design = json.loads((self.out / "design.json").read_text())
        self.assertEqual([setting["method"] for setting in design["settings"]], ["trajectories"])
        self.assertEqual(tomllib.loads((self.out / "run.toml").read_text())["design"]["method"], "auto")
        self.assertIn(oted("select-simulator", "--out", self.out, "--threads", 1).returncode, (0, 4))

    def test_episodes_may_start_where_the_logs_did(self):
        data = self.log(self.cart())
        task = self.cart('start = "logs"')
        result = oted("design", task, "--data", data, "--out", self.out, "--threads", 1, *QUICK)
        self.assertIn(result.returncode, (0, 4), result.stderr)
        collect = "collect", "--task", task, "--policy", "sine", "--episodes", 3, "--out", self.folder / "x.npz"
        self.assertOneLine(oted(*collect), USAGE, "task.start", "data.path")
        # A task file that names its logs is enough, as it is for a design.
        exact = re.sub("start_noise = .*", "start_noise = 0", task.read_text())
        task.write_text(exact + f'[data]\npath = "{data}"\n')
        self.assertEqual(oted(*collect).returncode, 0)
        starts, logged = (np.load(path)["observations"] for path in (self.folder / "x.npz", data))
        ends = np.flatnonzero(np.load(data)["timeouts"] | np.load(data)["terminals"])
        begins = logged[[0, *(ends[:-1] + 1)]]
        self.assertLess(np.abs(begins - starts[0]).max(axis=1).min(), 1e-12)
        # A preset asks the model what it has, which these logs start as well.
        task.write_text(re.sub(r"\[truth\][^\[]*", "", task.read_text()))
        checked = oted("params", "check", task, "--preset", "arm")
        self.assertEqual(checked.returncode, 0, checked.stderr)

    # --- logging

    def test_collect_takes_the_target_from_the_file_and_lets_flags_replace_it(self):
        task = self.cart()
        first = np.load(self.log(task))["observations"]
        np.testing.assert_array_equal(np.load(self.log(task))["observations"], first)
        other = self.log(task, "--param", "damping=joint/slide/damping:0.2:4", "--truth", "damping=0.5")
        self.assertFalse(np.array_equal(np.load(other)["observations"], first))

    def test_logged_excitation_obeys_the_equation_of_motion(self):
        arrays = np.load(self.log(self.cart(), policy="noise:0.4"))
        # m dv = (u - damping v) dt, five implicit steps of 0.01 s with damping 2.5 N s/m and 1 kg.
        v, u = arrays["observations"][:, 1], arrays["actions"][:, 0]
        for _ in range(5):
            v = (v + 0.01 * u) / (1 + 0.01 * 2.5)
        np.testing.assert_allclose(arrays["next_observations"][:, 1], v, atol=1e-6)
        self.assertLessEqual(abs(u).max(), 5)
        self.assertGreater(abs(u).max(), 1)

    # --- mistakes

    def test_mistakes_are_one_line_before_anything_is_written(self):
        data = self.log(self.cart())
        for more, needles in (
            ('observations = ["sensor/imu"]', ("task.observations 'sensor/imu'", "cart.xml", "there are none")),
            ('reward = "-abs(x)"', ("task.reward", "unknown name 'x'", "sum2_action")),
            ('terminate = "1 <"', ("task.terminate",)),
            ('actions = ["actuator/pull"]', ("task.actions", "push")),
            ('observation = ["joint/*/qpos"]', ("cart.toml:6", "did you mean 'observations'?")),
        ):
            result = oted("design", self.cart(more), "--data", data, "--out", self.out, *QUICK)
            self.assertOneLine(result, USAGE, *needles)
            self.assertFalse(self.out.exists())
        path = self.cart()
        path.write_text(path.read_text().replace("0.05", "0.055"))
        self.assertOneLine(oted("design", path, "--data", data, "--out", self.out), USAGE, "nearest is 0.06 s")
        path.write_text(path.read_text().replace("cart.xml", "card.xml"))
        self.assertOneLine(oted("design", path, "--data", data, "--out", self.out), DATA_OR_MODEL, "card.xml")

    # --- a task in C++

    def test_a_program_with_its_own_task_has_all_verbs(self):
        parameters = ["--param", "loss=env/loss:0.2:2.0"]
        data = self.folder / "room.npz"
        result = oted("collect", "--task", "Thermostat-v0", "--policy", "noise:0.5:600", *parameters, "--truth",
                      "loss=1.5", "--episodes", 4, "--out", data, program=CUSTOM)
        self.assertEqual(result.returncode, 0, result.stderr)
        result = oted("run", "--task", "Thermostat-v0", "--data", data, *parameters, "--truth", "loss=1.5", "--out",
                      self.out, "--threads", 1, *QUICK, program=CUSTOM)
        self.assertIn(result.returncode, (0, 4), result.stderr)
        self.assertTrue((self.out / "evaluation.json").exists())
        wrong = oted("collect", "--task", "Thermostat-v0", "--policy", "random", "--param", "x=env/los:0.2:2", "--out",
                     data, program=CUSTOM)
        self.assertOneLine(wrong, USAGE, "did you mean 'env/loss'?")


if __name__ == "__main__":
    [CUSTOM] = program.take_paths(__doc__, 1)
    unittest.main()
