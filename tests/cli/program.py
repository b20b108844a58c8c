"""What the tests of the program share: how it is called, its exit codes, settings for runs of seconds, demonstrations, and what
a refusal is: one line that says what, and nothing left behind.
"""

import functools
import hashlib
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import tomllib
import unittest

import gymnasium
import h5py
import jsonschema
import numpy as np

OTED = None  # the program's path, from the command line

ROOT = pathlib.Path(__file__).resolve().parents[2]
USAGE, DATA_OR_MODEL, NO_SIMULATOR, INTERRUPTED = 2, 3, 4, 130
FRICTION = "friction=geom/*/friction[0]:0.2:2.0"
GRAVITY = "gravity=opt/gravity[2]:0.2:2.0"
# Contact friction is the larger of the two geoms', and the foot's is 2: the floor's below that has no effect.
FLOOR = "floor=geom/floor/friction[0]:0.2:1.0"
# Suspects are tried in test_suspects.py alone.
TINY_DESIGN = [
    "design.trajectories.tried=0",
    "clone.hidden=16", "clone.max_steps=40", "clone.check_interval=20", "design.adversarial.n_iterations=3", "design.adversarial.n_sims=4",
    "design.adversarial.n_steps=20", "design.discriminator.hidden=16", "design.discriminator.steps=5",
    "design.discriminator.batch=32", "design.trajectories.rows=32", "design.trajectories.window=4",
    "design.trajectories.starts=1", "design.trajectories.coarse=4", "selection.n_seeds=2", "selection.n_sims=2",
    "selection.n_steps=20", "selection.judge_steps=20",
]
TINY = TINY_DESIGN + [
    "agents.n_agents=1", "agents.selection_episodes=2", "agents.target_episodes=2", "sac.n_steps=200",
    "sac.learning_starts=100", "sac.batch_size=32", "sac.hidden=16",
    "sac.eval_interval=100", "sac.eval_episodes=1", "report.motion=false",
]
# Of the baselines that learn from the logs alone.
TINY_OFFLINE = [
    "f_brc.behavior_steps=20", "f_brc.n_steps=20", "f_brc.hidden=8", "f_brc.behavior_hidden=8", "mbop.n_steps=20", "mbop.hidden=8",
    "mbop.batch_size=32", "mbop.trajectories=10", "mbop.horizon=3", "td3_bc.n_steps=20", "td3_bc.hidden=8", "rebrac.n_steps=20",
    "rebrac.hidden=8", "rebrac.batch_size=32",
]


def take_paths(documentation, n_more=0):
    """The program's path and `n_more` others, off the command line. @return the others"""
    global OTED
    if len(sys.argv) < 2 + n_more:
        sys.exit(documentation)
    OTED, *others = (str(pathlib.Path(sys.argv.pop(1)).resolve()) for _ in range(1 + n_more))
    return others


def by_transitions(settings):
    """The settings with the method transitions, and without those that it does not read."""
    return ["design.method=transitions"] + [s for s in settings if not s.startswith("design.trajectories.")]


def sets(assignments):
    return [word for assignment in assignments for word in ("--set", assignment)]


@functools.cache
def task_file_validator():
    schema = json.loads((ROOT / "docs/schemas/oted.task.1.schema.json").read_text())
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


def check_task_files(arguments, cwd):
    """What the program took, the schema for editors takes: task files, and the configuration of a run directory."""
    for argument in arguments:
        path = pathlib.Path(cwd or ".", str(argument))
        for file in (path, path / "run.toml"):
            if file.suffix == ".toml" and file.is_file():
                task_file_validator().validate(tomllib.loads(file.read_text()))


def oted(*arguments, cwd=None, program=None, timeout=300):
    result = subprocess.run([program or OTED, *map(str, arguments)], capture_output=True, text=True, cwd=cwd, timeout=timeout)
    if result.returncode in (0, NO_SIMULATOR):
        check_task_files(arguments, cwd)
    return result


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


def edit_record(path, change):
    """A record with `change` made to it, as one that was written without a seal."""
    record = json.loads(pathlib.Path(path).read_text())
    record.pop("seal", None)
    change(record)
    pathlib.Path(path).write_text(json.dumps(record))


def write_run_toml(path, text):
    """A run directory's own configuration, sealed as the program does it. @param text  with or without its first line"""
    body = text.split("\n", 1)[1] if text.startswith("# sha256 ") else text
    pathlib.Path(path).write_text(f"# sha256 {hashlib.sha256(body.encode()).hexdigest()}\n{body}")


def files_below(folder):
    folder = pathlib.Path(folder)
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


class ProgramTest(unittest.TestCase):
    """A folder of its own for each test."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="oted-test-"))
        self.addCleanup(shutil.rmtree, self.folder)
        self.out = self.folder / "out"

    def succeed(self, *arguments, code=0):
        result = oted(*arguments)
        self.assertEqual(result.returncode, code, result.stderr + result.stdout)
        return result

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


class HopperTest(ProgramTest):
    """With five short episodes of random actions in Hopper."""

    @classmethod
    def setUpClass(cls):
        cls.shared = pathlib.Path(tempfile.mkdtemp(prefix="oted-hopper-"))
        cls.addClassCleanup(shutil.rmtree, cls.shared)
        cls.demos = cls.shared / "demos.hdf5"
        log_hopper(cls.demos, 5)

    def design(self, *more, task="Hopper-v5", data=None, parameters=(FRICTION, GRAVITY), settings=TINY, out=None):
        words = ["--task", task, "--data", data or self.demos, "--out", out or self.out, "--threads", "1"]
        for parameter in parameters:
            words += ["--param", parameter]
        return oted("design", *words, *sets(settings), *more)
