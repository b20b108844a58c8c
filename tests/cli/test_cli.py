"""The program as a user meets it: exit codes, one-line errors, nothing half-written, stopping and going on.

    test_cli.py PATH/TO/oted [TestClass.test_name ...]
"""

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import gymnasium
import h5py
import numpy as np

OTED = None  # the program's path, from the command line

USAGE, DATA_OR_MODEL, NO_SIMULATOR, INTERRUPTED = 2, 3, 4, 130
FRICTION = "friction=geom/*/friction[0]:0.2:2.0"
GRAVITY = "gravity=opt/gravity[2]:0.2:2.0"
# Contact friction is the larger of the two geoms', and the foot's is 2: the floor's below that has no effect.
FLOOR = "floor=geom/floor/friction[0]:0.2:1.0"
TINY = [
    "clone.hidden=16", "clone.max_steps=40", "clone.check_interval=20", "design.n_iterations=3", "design.n_sims=4",
    "design.n_steps=20", "design.discriminator_hidden=16", "design.discriminator_steps=5",
    "design.discriminator_batch=32", "design.trajectory_rows=32", "design.trajectory_window=4",
    "design.trajectory_starts=1", "design.trajectory_coarse=4", "selection.n_seeds=2", "selection.n_sims=2", "selection.n_steps=20",
    "selection.judge_steps=20", "agents.n_agents=1", "agents.selection_episodes=2", "agents.target_episodes=2",
    "crossq.n_steps=200", "crossq.learning_starts=100", "crossq.batch_size=32", "crossq.hidden=16",
    "crossq.critic_hidden=16", "crossq.eval_interval=100", "crossq.eval_episodes=1", "report.motion=false",
]


def sets(assignments):
    return [word for assignment in assignments for word in ("--set", assignment)]


def oted(*arguments, cwd=None):
    return subprocess.run([OTED, *map(str, arguments)], capture_output=True, text=True, cwd=cwd, timeout=120)


def log_hopper(path, n_episodes=10):
    """Random actions in Gymnasium's Hopper-v5, in the D4RL layout."""
    env = gymnasium.make("Hopper-v5")
    env.action_space.seed(0)
    rows = {name: [] for name in ("observations", "actions", "rewards", "terminals", "timeouts")}
    for episode in range(n_episodes):
        observation, _ = env.reset(seed=episode)
        done = False
        while not done:
            action = env.action_space.sample()
            following, reward, terminated, truncated, _ = env.step(action)
            for name, value in zip(rows, (observation, action, reward, terminated, truncated)):
                rows[name].append(value)
            observation, done = following, terminated or truncated
    env.close()
    write_hdf5(path, {name: np.array(values) for name, values in rows.items()})


def write_hdf5(path, arrays):
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name] = values


def read_hdf5(path):
    with h5py.File(path, "r") as file:
        return {name: file[name][()] for name in file}


def files_below(folder):
    folder = pathlib.Path(folder)
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


class CliTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.shared = pathlib.Path(tempfile.mkdtemp(prefix="oted-cli-"))
        cls.addClassCleanup(shutil.rmtree, cls.shared)
        cls.demos = cls.shared / "demos.hdf5"
        log_hopper(cls.demos)

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(dir=self.shared))
        self.out = self.folder / "out"

    def design(self, *more, task="Hopper-v5", data=None, parameters=(FRICTION, GRAVITY), settings=TINY, out=None):
        words = ["--task", task, "--data", data or self.demos, "--out", out or self.out, "--threads", "1"]
        for parameter in parameters:
            words += ["--param", parameter]
        return oted("design", *words, *sets(settings), *more)

    def assertOneLine(self, result, code, *needles):
        """One line on stderr that has all of `needles`, nothing on stdout."""
        self.assertEqual(result.returncode, code, result.stderr)
        self.assertEqual(result.stdout, "")
        self.assertRegex(result.stderr, r"\Aoted: [^\n]+\n\Z")
        for needle in needles:
            self.assertIn(needle, result.stderr)

    def assertRefused(self, result, code, *needles):
        self.assertOneLine(result, code, *needles)
        self.assertFalse(self.out.exists(), "something was left in --out")


class TestMotion(CliTest):
    def test_without_opengl_a_run_ends_well_and_the_page_says_why(self):
        os.environ["MUJOCO_GL"] = "off"
        self.addCleanup(os.environ.pop, "MUJOCO_GL")
        result = self.design("--set", "report.motion=auto", "--set", "report.replay_steps=5")
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        self.assertIn("No pictures of the motion: MUJOCO_GL=off", (self.out / "report.html").read_text())
        shutil.rmtree(self.out)
        self.assertRefused(self.design("--set", "report.motion=true"), USAGE, "report.motion", "MUJOCO_GL=off")


class TestData(CliTest):
    def test_missing_file(self):
        self.assertRefused(self.design(data="no/such.hdf5"), DATA_OR_MODEL, "no/such.hdf5", "check the path")

    def test_folder(self):
        self.assertRefused(self.design(data=self.folder), DATA_OR_MODEL, str(self.folder))
        (self.folder / "folder.hdf5").mkdir()
        self.assertRefused(self.design(data=self.folder / "folder.hdf5"), DATA_OR_MODEL, "folder.hdf5")

    def test_unknown_ending(self):
        path = self.folder / "demos.mat"
        path.write_text("1,2,3\n")
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "demos.mat", ".hdf5")

    def test_csv_without_the_columns(self):
        path = self.folder / "demos.csv"
        path.write_text("q,act0\n2,3\n")
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "demos.csv", "data.observations", "'q', 'act0'")

    def test_truncated_hdf5(self):
        whole = self.demos.read_bytes()
        for keep in (0.05, 0.5, 0.99):
            path = self.folder / "cut.hdf5"
            path.write_bytes(whole[: int(keep * len(whole))])
            self.assertRefused(self.design(data=path), DATA_OR_MODEL, "cut.hdf5")

    def test_empty_file(self):
        path = self.folder / "empty.hdf5"
        path.write_bytes(b"")
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "empty.hdf5", "not an HDF5 file")

    def test_text_named_hdf5(self):
        path = self.folder / "text.hdf5"
        path.write_text("observations: 1 2 3\n" * 100)
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "text.hdf5", "not an HDF5 file")

    def test_text_named_npz(self):
        path = self.folder / "text.npz"
        path.write_text("observations: 1 2 3\n" * 100)
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "text.npz")

    def test_foreign_hdf5(self):
        path = self.folder / "foreign.hdf5"
        write_hdf5(path, {"images": np.zeros((4, 4)), "labels": np.zeros(4)})
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "foreign.hdf5", "'observations'")

    def test_not_finite(self):
        for name, value in (("observations", np.nan), ("actions", np.inf), ("rewards", -np.inf)):
            arrays = read_hdf5(self.demos)
            arrays[name][7] = value
            path = self.folder / "bad.hdf5"
            write_hdf5(path, arrays)
            self.assertRefused(self.design(data=path), DATA_OR_MODEL, "bad.hdf5", f"{name}[7", "repair")

    def test_lengths_that_disagree(self):
        arrays = read_hdf5(self.demos)
        arrays["actions"] = arrays["actions"][:-3]
        path = self.folder / "short.hdf5"
        write_hdf5(path, arrays)
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "short.hdf5", "actions")

    def test_wrong_dimensions(self):
        result = self.design(task="HalfCheetah-v5")
        self.assertRefused(result, DATA_OR_MODEL, "11", "17", "HalfCheetah-v5", "name the task")

    def test_more_episodes_than_there_are(self):
        self.assertRefused(self.design("--episodes", "11"), DATA_OR_MODEL, "11", "10", "fewer")

    def test_episodes_that_are_no_count(self):
        for text in ("0", "-1", "many", "3x", "99999999999999999999"):
            self.assertRefused(self.design("--episodes", text), USAGE, text, "or all")

    def test_a_name_that_is_no_text(self):
        path = bytes(self.folder) + b"/\xff.hdf5"
        shutil.copyfile(self.demos, path)
        words = ["design", "--task", "Hopper-v5", "--param", FRICTION, "--out", str(self.out), "--data"]
        result = subprocess.run([OTED, *words, path], capture_output=True, timeout=120)
        self.assertEqual(result.returncode, USAGE, result.stderr)
        self.assertRegex(result.stderr, rb"\Aoted: [^\n]+UTF-8[^\n]+\n\Z")
        self.assertFalse(self.out.exists())

    def test_no_data_named(self):
        result = oted("design", "--task", "Hopper-v5", "--param", FRICTION, "--out", self.out)
        self.assertRefused(result, USAGE, "--data")


class TestRequest(CliTest):
    def test_unknown_verb_and_flag(self):
        self.assertRefused(oted("desing", "--out", self.out), USAGE, "desing", "did you mean 'design'?", "--help")
        self.assertRefused(self.design("--treads", "2"), USAGE, "--treads", "--help")
        self.assertRefused(oted(), USAGE, "--help")
        self.assertRefused(oted("design", "--task", "Hopper-v5"), USAGE, "--out")

    def test_flag_without_number(self):
        self.assertRefused(self.design("--seed", "one"), USAGE, "--seed")
        self.assertRefused(self.design("--seed=-1"), USAGE, "--seed")
        self.assertRefused(self.design("--seeds", "0"), USAGE, "--seeds")

    def test_unknown_task_with_the_nearest(self):
        self.assertRefused(self.design(task="Hoper-v5"), USAGE, "Hoper-v5", "did you mean 'Hopper-v5'?")
        self.assertRefused(self.design(task="Ant-v5"), USAGE, "Ant-v5", "Hopper-v5")

    def test_unknown_key_and_section(self):
        self.assertRefused(self.design("--set", "design.n_iteratons=3"), USAGE, "did you mean 'n_iterations'?")
        self.assertRefused(self.design("--set", "desing.n_iterations=3"), USAGE, "did you mean 'design'?")
        self.assertRefused(self.design("--set", "design.n_iterations=0"), USAGE, "n_iterations is 0", "[1, inf)")

    def test_unknown_parameter_path(self):
        for path, needle in (("geom/*/frction[0]", "friction"), ("gem/*/friction[0]", "geom"),
                             ("geom/foot/friction[0]", "foot_geom"), ("geom/nothing*/friction[0]", "nothing*"),
                             ("geom/*/friction[9]", "wanted 0 to 2"), ("opt/gravity", None), ("friction", "geom/*/friction[0]")):
            if needle is None:
                continue
            result = self.design(parameters=(f"p={path}:0.2:2",))
            self.assertRefused(result, USAGE, path, needle)

    def test_bounds(self):
        for bounds in ("1:1", "2:1", "nan:1", "0:inf", "-inf:1", "a:1", ":1", "1"):
            result = self.design(parameters=(f"mass=body/torso/mass:{bounds}",))
            self.assertRefused(result, USAGE, "mass")
        self.assertRefused(self.design(parameters=("mass=body/torso/mass:0:2:log",)), USAGE, "low > 0")
        self.assertRefused(self.design(parameters=("mass=body/torso/mass:1:2:lin",)), USAGE, "'lin'")

    def test_parameter_named_twice(self):
        result = self.design(parameters=(FRICTION, "friction=opt/gravity[2]:0.5:1"))
        self.assertRefused(result, USAGE, "'friction'", "twice", "rename")

    def test_nominal_zero_needs_absolute(self):
        result = self.design(parameters=("slope=opt/gravity[0]:0.2:2",))
        self.assertRefused(result, USAGE, "'slope'", "absolute")

    def test_no_parameter(self):
        self.assertRefused(self.design(parameters=()), USAGE, "--param")

    def test_truth_for_an_unknown_parameter(self):
        result = self.design("--truth", "fricton=1", "--truth", "gravity=1")
        self.assertRefused(result, USAGE, "fricton", "did you mean 'friction'?")

    def test_truth_outside_its_bounds_or_in_part(self):
        result = self.design("--truth", "friction=2.5", "--truth", "gravity=1")
        self.assertRefused(result, USAGE, "'friction'", "2.5", "[0.2, 2]")
        self.assertRefused(self.design("--truth", "friction=1"), USAGE, "1 of 2")
        self.assertRefused(self.design("--truth", "friction"), USAGE, "name=value")

    def test_contradicting_settings(self):
        self.assertRefused(self.design("--set", "design.starts=initial"), USAGE, "design.actions")

    def test_evaluate_without_truth(self):
        result = oted("evaluate", "--task", "Hopper-v5", "--data", self.demos, "--param", FRICTION, "--out", self.out)
        self.assertOneLine(result, USAGE, "--truth")

    def test_evaluate_without_a_run_or_a_policy(self):
        self.assertRefused(oted("evaluate", "--task", "Hopper-v5"), USAGE, "--out", "--policy")

    def test_strict_refuses_a_parameter_without_effect(self):
        result = self.design("--strict", parameters=(GRAVITY, FLOOR))
        self.assertRefused(result, USAGE, "'floor'", "remove the parameter")


class TestCollect(CliTest):
    def collect(self, *words):
        return oted("collect", "--task", "Hopper-v5", "--out", self.folder / "new.hdf5", *words)

    def assertCollectsNothing(self, result, code, *needles):
        self.assertOneLine(result, code, *needles)
        self.assertFalse((self.folder / "new.hdf5").exists())

    def test_refusals(self):
        self.assertCollectsNothing(self.collect(), USAGE, "--policy")
        self.assertCollectsNothing(self.collect("--policy", "no/such.npz"), DATA_OR_MODEL, "no/such.npz")
        self.assertCollectsNothing(self.collect("--policy", self.demos), DATA_OR_MODEL, "demos.hdf5")
        self.assertCollectsNothing(self.collect("--policy", "p.npz", "--episodes", "0"), USAGE, "--episodes")
        result = self.collect("--policy", "p.npz", "--param", FRICTION, "--truth", "fricton=1")
        self.assertCollectsNothing(result, USAGE, "fricton", "--param")

    def test_a_clones_demonstrations_are_read_again(self):
        words = ["--task", "Hopper-v5", "--param", FRICTION, "--out", self.out, *sets(TINY)]
        self.assertEqual(oted("clone", "--data", self.demos, *words).returncode, 0)
        policy = self.out / "clone/policy.npz"
        result = self.collect("--policy", policy, "--episodes", "3", "--param", FRICTION, "--truth", "friction=0.6")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        arrays = read_hdf5(self.folder / "new.hdf5")
        self.assertEqual(int(np.sum(arrays["terminals"]) + np.sum(arrays["timeouts"])), 3)
        self.assertNotIn(b"friction", (self.folder / "new.hdf5").read_bytes(), "the truth is not in the data")
        self.out = self.folder / "second"
        self.assertEqual(oted("clone", "--data", self.folder / "new.hdf5", *words[:4], "--out", self.out,
                              *sets(TINY)).returncode, 0)


class TestConfiguration(CliTest):
    def write(self, text):
        path = self.folder / "config.toml"
        path.write_text(text)
        return path

    def run_config(self, text):
        return oted("run", self.write(text), "--out", self.out)

    def test_missing_file(self):
        self.assertRefused(oted("run", "no/such.toml", "--out", self.out), DATA_OR_MODEL, "no/such.toml")

    def test_broken_toml(self):
        self.assertRefused(self.run_config('[task]\nname = "Hopper\n'), USAGE, "config.toml:2")
        self.assertRefused(self.run_config("\n\n[task\n"), USAGE, "config.toml:3")

    def test_unknown_names(self):
        self.assertRefused(self.run_config('[task]\nnam = "x"\n'), USAGE, "config.toml:2", "did you mean 'name'?")
        self.assertRefused(self.run_config("[tsk]\n"), USAGE, "config.toml:1", "did you mean 'task'?")

    def test_bounds(self):
        self.assertRefused(self.run_config('[parameters]\nm = { field = "body/torso/mass", range = [2, 1] }\n'), USAGE,
                           "config.toml:2", "low < high")

    def test_data_lie_beside_the_file(self):
        result = self.run_config('[task]\nname = "Hopper-v5"\n[data]\npath = "gone.hdf5"\n'
                                 '[parameters]\nm = { field = "body/torso/mass" }\n')
        self.assertRefused(result, DATA_OR_MODEL, str(self.folder / "gone.hdf5"))


class TestOutput(CliTest):
    def test_a_file_in_the_way(self):
        self.out.write_text("mine")
        self.assertOneLine(self.design(), DATA_OR_MODEL, str(self.out), "choose another place")
        self.assertEqual(self.out.read_text(), "mine")
        self.assertOneLine(self.design(out=self.out / "below"), DATA_OR_MODEL, str(self.out))

    def test_a_folder_where_a_file_belongs(self):
        (self.out / "run.toml").mkdir(parents=True)
        result = oted("run", "--task", "Hopper-v5", "--data", self.demos, "--param", FRICTION, "--out", self.out)
        self.assertOneLine(result, DATA_OR_MODEL, "run.toml")

    def test_no_name(self):
        result = oted("design", "--task", "Hopper-v5", "--data", self.demos, "--param", FRICTION, "--out", "",
                      cwd=self.folder)
        self.assertOneLine(result, USAGE, "--out")
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_report_of_nothing(self):
        result = oted("report", "--out", self.folder / "nothing")
        self.assertIn(result.returncode, (USAGE, DATA_OR_MODEL))
        self.assertRegex(result.stderr, r"\Aoted: [^\n]+\n\Z")
        self.assertFalse((self.folder / "nothing").exists())

    def test_other_settings_leave_the_directory_as_it_was(self):
        self.assertEqual(oted("clone", *self.words()).returncode, 0)
        before = files_below(self.out)
        self.assertOneLine(oted("clone", *self.words(), "--seed", "2"), USAGE, "clone.json", "choose another --out")
        self.assertEqual(files_below(self.out), before)

    def words(self):
        return ["--task", "Hopper-v5", "--data", self.demos, "--param", FRICTION, "--out", self.out, *sets(TINY)]

    def test_the_clone_by_valuedice_is_recorded_and_equal_at_any_number_of_threads(self):
        settings = ["clone.method=valuedice", "clone.valuedice_updates=30", "clone.valuedice_batch=16",
                    "clone.valuedice_hidden=16"]
        self.assertEqual(oted("clone", *self.words(), *sets(settings), "--threads", "1").returncode, 0)
        record = json.loads((self.out / "clone/clone.json").read_text())
        self.assertEqual(record["method"], "valuedice")
        self.assertNotIn("choice", record)
        self.assertIn("ValueDICE", (self.out / "report.html").read_text())
        first = (self.out / "clone/policy.npz").read_bytes()
        shutil.rmtree(self.out)
        self.assertEqual(oted("clone", *self.words(), *sets(settings), "--threads", "2").returncode, 0)
        self.assertEqual((self.out / "clone/policy.npz").read_bytes(), first)

    def test_auto_says_which_clone_it_took_and_why(self):
        settings = ["clone.method=auto", "clone.valuedice_updates=10", "clone.valuedice_batch=16",
                    "clone.valuedice_hidden=16", "clone.valuedice_start=random"]
        self.assertEqual(oted("clone", *self.words(), *sets(settings)).returncode, 0)
        record = json.loads((self.out / "clone/clone.json").read_text())
        self.assertIn(record["method"], ("bc", "valuedice"))
        for method in ("bc", "valuedice"):
            self.assertGreater(record["choice"][method]["closeness"], 0)
        self.assertIn("nominal simulator", record["choice"]["reason"])
        self.assertIn("Chosen by evidence", (self.out / "report.html").read_text())

    def test_a_prior_by_beliefs_and_by_an_earlier_run_enters_q_and_the_fingerprint(self):
        words = self.words()
        words[words.index(FRICTION)] = FRICTION + ":prior=0.5,0.05"
        self.assertOneLine(oted("design", *words), USAGE, "friction", "design.prior")
        self.assertFalse(self.out.exists())
        self.assertIn(oted("design", *words, "--set", "design.prior=gaussian").returncode, (0, NO_SIMULATOR))
        q = json.loads((self.out / "design/default/1/q.json").read_text())
        self.assertAlmostEqual(q["prior"]["mean"][0], np.log((0.5 - 0.2) / (2.0 - 0.5)), places=9)
        self.assertIn("prior = { mean = 0.5, std = 0.05 }", (self.out / "run.toml").read_text())
        # The same run directory goes on from its own run.toml.
        before = (self.out / "design/default/1/q.json").stat().st_mtime_ns
        self.assertIn(oted("design", "--out", self.out).returncode, (0, NO_SIMULATOR))
        self.assertEqual((self.out / "design/default/1/q.json").stat().st_mtime_ns, before)

        first = self.folder / "first"
        self.out.rename(first)
        words = self.words() + ["--set", f"design.prior={first}"]
        self.assertIn(oted("design", *words).returncode, (0, NO_SIMULATOR))
        again = json.loads((self.out / "design/default/1/q.json").read_text())
        modes = [json.loads((first / f"design/default/{seed}/q.json").read_text())["mean"][0] for seed in (1, 2)]
        self.assertAlmostEqual(again["prior"]["mean"][0], np.mean(modes), places=9)
        self.assertIn(oted("design", "--out", self.out).returncode, (0, NO_SIMULATOR))
        # Another content of the same path is another design.
        changed = first / "design/default/1/q.json"
        changed.write_text(json.dumps({**json.loads(changed.read_text()), "mean": [0.123]}))
        self.assertOneLine(oted("design", "--out", self.out), USAGE, "q.json")

    def test_joint_training_leaves_a_clone_of_each_seed(self):
        words = self.words() + sets(["design.form=paper", "design.horizon=20", "design.n_steps=20",
                                     "design.clone_updates=2"])
        self.assertIn(oted("design", *words).returncode, (0, NO_SIMULATOR))
        common = (self.out / "clone/policy.npz").read_bytes()
        clones = [(self.out / f"design/default/{seed}/policy.npz").read_bytes() for seed in (1, 2)]
        self.assertEqual(len({common, *clones}), 3)
        self.assertOneLine(oted("design", *words, "--set", "design.form=trajectories"), USAGE, "design.clone_updates")

    def test_valuedice_of_discrete_actions_is_a_usage_error(self):
        data = pathlib.Path(__file__).resolve().parents[2] / "examples/data/minigrid-expert.hdf5"
        result = oted("clone", pathlib.Path(__file__).resolve().parents[2] / "examples/minigrid.toml", "--data", data, "--out",
                      self.out, "--set", "clone.method=valuedice")
        self.assertOneLine(result, USAGE, "clone.method", "bc")


class TestResult(CliTest):
    def test_json_on_stdout_and_progress_on_stderr(self):
        result = self.design("--json")
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        printed = json.loads(result.stdout)
        self.assertEqual(printed["design"], json.loads((self.out / "design.json").read_text()))
        self.assertEqual(printed["design"]["schema"], "oted.design/1")
        self.assertEqual([p["name"] for p in printed["design"]["parameters"]], ["friction", "gravity"])
        self.assertIn("design", result.stderr)
        self.assertIn("100%", result.stderr)

        again = self.design("--json")
        self.assertEqual(json.loads(again.stdout), printed)
        self.assertEqual(again.stderr, "", "nothing is left to do, so there is no progress")

    def test_table_and_quiet(self):
        result = self.design("--quiet")
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        self.assertEqual(result.stderr, "")
        self.assertIn("friction", result.stdout)
        self.assertIn("verdict:", result.stdout)
        self.assertIn(str(self.out / "report.html"), result.stdout)
        self.assertNotIn("█", result.stdout)

    def test_the_whole_run(self):
        config = self.folder / "tiny.toml"
        config.write_text(f'[task]\nname = "Hopper-v5"\n[data]\npath = "{self.demos}"\nepisodes = 8\n[parameters]\n'
                          'friction = { field = "geom/*/friction[0]", range = [0.2, 2.0] }\n[truth]\nfriction = 0.6\n')
        result = oted("run", config, "--out", self.out, *sets(TINY))
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        for name in ("run.toml", "versions.json", "dataset.json", "clone/policy.npz", "clone/clone.json",
                     "clone/curves.csv", "design/default/1/q.json", "design/default/2/q.json",
                     "design/default/1/curves.csv", "design.json", "agents/1/policy.npz", "agents/1/agent.json",
                     "agents/1/curves.csv", "agents/1/policy.onnx", "undesigned/1/policy.npz", "undesigned/1/policy.onnx",
                     "policy.onnx", "policy_selection.json", "evaluation.json",
                     "report.html", "report.json"):
            self.assertTrue((self.out / name).is_file(), name)
        self.assertTrue(list(self.out.glob("design/default/1/events.out.tfevents.*")))
        leftovers = [n for n in files_below(self.out) if ".tmp-" in n or "checkpoint" in n]
        self.assertEqual(leftovers, [])
        for word in ("random actions", "clone of the logs", "un-designed simulator", "OTED-CrossQ"):
            self.assertIn(word, result.stdout)
        self.assertEqual(json.loads((self.out / "dataset.json").read_text())["n_episodes"], 8)
        versions = json.loads((self.out / "versions.json").read_text())
        self.assertEqual(set(versions), {"oted", "mujoco", "cpu", "command", "started"})

        # A later verb needs nothing but the directory, and finds nothing to do.
        before = files_below(self.out)
        again = oted("select-policy", "--out", self.out)
        self.assertIn(again.returncode, (0, NO_SIMULATOR), again.stderr)
        self.assertEqual(again.stderr, "")
        after = files_below(self.out)
        changed = {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
        self.assertLessEqual(changed, {"versions.json", "report.html", "report.json"})

    def test_without_strict_a_parameter_without_effect_is_a_warning_and_not_identified(self):
        result = self.design("--json", "--set", "design.n_iterations=1", parameters=(GRAVITY, FLOOR))
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        warnings = [line for line in result.stderr.splitlines() if line.startswith("warning:")]
        self.assertEqual(len(warnings), 1, result.stderr)
        self.assertIn("'floor'", warnings[0])
        design = json.loads(result.stdout)["design"]
        verdicts = {p["name"]: p["verdict"] for p in design["parameters"]}
        self.assertEqual(verdicts["floor"], "not_identified")
        self.assertEqual(result.returncode, NO_SIMULATOR if design["verdict"] == "outside_family" else 0)
        required = self.design("--require-identified", "--set", "design.n_iterations=1", parameters=(GRAVITY, FLOOR))
        self.assertEqual(required.returncode, NO_SIMULATOR, required.stderr)

    def test_help_has_units_and_defaults(self):
        top = oted("--help")
        self.assertEqual(top.returncode, 0)
        for verb in ("run", "clone", "design", "select-simulator", "train", "select-policy", "evaluate", "report",
                     "collect"):
            self.assertRegex(top.stdout, rf"(?m)^\s+{verb}\b")
            text = oted(verb, "--help")
            self.assertEqual((text.returncode, text.stderr), (0, ""), verb)
            self.assertIn("--out", text.stdout)
        self.assertIn("[default:", oted("design", "--help").stdout)
        self.assertRegex(oted("--version").stdout, r"\Aoted \d+\.\d+\.\d+\n\Z")


class TestStopping(CliTest):
    LONG = ["design.form=transitions"] + [
        s for s in TINY if not s.startswith(("design.n_iterations", "design.n_sims"))] + [
        "design.n_iterations=120", "design.n_sims=16"]

    def test_ctrl_c_and_the_same_command_again(self):
        command = [OTED, "design", "--task", "Hopper-v5", "--data", self.demos, "--param", FRICTION, "--param", GRAVITY,
                   "--threads", "2", *sets(self.LONG), "--out"]
        whole = oted(*command[1:], self.folder / "whole")
        self.assertIn(whole.returncode, (0, NO_SIMULATOR), whole.stderr)

        process = subprocess.Popen([*command, self.out], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + 60
        while not list(self.out.glob("design/*/*/checkpoint.npz")) and time.monotonic() < deadline:
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
        printed, told = process.communicate(timeout=60)
        self.assertEqual(process.returncode, INTERRUPTED, told)
        self.assertEqual(printed, "")
        self.assertRegex(told.splitlines()[-1], r"^oted: interrupted; .*same command")
        self.assertFalse((self.out / "design.json").exists())
        self.assertTrue(list(self.out.glob("design/*/*/checkpoint.npz")))
        self.assertEqual([n for n in files_below(self.out) if ".tmp-" in n], [])

        # Other settings would mix two designs.
        before = files_below(self.out)
        mixed = oted(*command[1:], self.out, "--set", "design.lambda=0.5")
        self.assertOneLine(mixed, USAGE, "choose another --out")
        self.assertEqual(files_below(self.out), before)

        again = oted(*command[1:], self.out)
        self.assertEqual(again.returncode, whole.returncode, again.stderr)
        self.assertEqual((self.out / "design.json").read_text(), (self.folder / "whole" / "design.json").read_text())
        self.assertEqual([n for n in files_below(self.out) if "checkpoint" in n], [])
        for seed in ("1", "2"):
            curves = [(f / "design" / "default" / seed / "curves.csv").read_text()
                      for f in (self.out, self.folder / "whole")]
            self.assertEqual(curves[0], curves[1], "the curve has each iteration once")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    OTED = str(pathlib.Path(sys.argv.pop(1)).resolve())
    unittest.main()
