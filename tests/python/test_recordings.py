"""One design from the double pendulum's recordings in every form that robots log them: test_recordings.py [FOLDER], which
holds the package oted where it is not installed. Bags are written here by rosbags, and by MCAP's own packages. LeRobot's
sets are written by LeRobot itself (write_lerobot.py) into the folders of the environment variable LEROBOT_SETS, separated
by ':'."""

import csv
import gzip
import os
import pathlib
import sys
import unittest

if len(sys.argv) > 1 and not sys.argv[1].startswith("-"):
    sys.path.insert(0, str(pathlib.Path(sys.argv.pop(1)).resolve()))

import h5py  # noqa: E402
import numpy as np  # noqa: E402
import pandas  # noqa: E402
from rosbags.rosbag2 import StoragePlugin  # noqa: E402

import oted  # noqa: E402
from robot_bag import RobotBag, RobotMcap  # noqa: E402
from support import InFolder  # noqa: E402

REAL = pathlib.Path(__file__).resolve().parents[2] / "examples/real/double_pendulum"
EPISODES, ROWS = 2, 1500  # of the recordings: three seconds of the first two
START = 1_700_000_000_000_000_000  # [ns]
# The friction and the inertia of one link: what two recordings tell in seconds.
PARAMETERS = {"damping1": oted.Param("joint/shoulder/damping", 0.0, 0.3, scale="absolute"),
              "friction2": oted.Param("joint/elbow/frictionloss", 0.0, 0.5, scale="absolute"),
              "com2": oted.Param("body/link2/ipos[2]", 0.3, 2.0)}
SETTINGS = {"design.method": "trajectories", "design.trajectories.rows": 800, "design.trajectories.starts": 1,
            "design.trajectories.coarse": 4, "selection.n_seeds": 1, "selection.judge_steps": 20, "report.motion": "false"}


def recordings():
    """Names, and (rows, numbers) of each: time, two positions, two velocities, two torques."""
    with gzip.open(REAL / "fit.csv.gz", "rt", encoding="utf-8") as file:
        table = list(csv.reader(file))
    labels = np.array([row[0] for row in table[1:]])
    values = np.array([row[1:] for row in table[1:]], dtype=np.float64)
    return table[0], [values[labels == label][:ROWS] for label in list(dict.fromkeys(labels))[:EPISODES]]


NAMES, RECORDINGS = recordings()


def write_bag(open_bag, rows):
    random = np.random.default_rng(0)
    with open_bag as bag:
        for t, *numbers in rows:
            stamp = START + round(t * 1e9)
            q, v, u = (np.array(numbers[i:i + 2]) for i in (0, 2, 4))
            order = random.permutation(2)  # the driver's names are its own, and in any order; its elbow turns the other way
            sign = np.array([1.0, -1.0])
            bag.command(stamp, u)
            bag.state(stamp, stamp + 3_000_000, np.array(["j1", "j2"])[order], (sign * q)[order], (sign * v)[order])


class Recordings(InFolder):
    @classmethod
    def setUpClass(cls):
        cls.logs = oted.Logs(np.vstack([r[:, 1:5] for r in RECORDINGS]), np.vstack([r[:, 5:] for r in RECORDINGS]),
                             episode_ends=np.cumsum([len(r) for r in RECORDINGS]), period=0.002,
                             observation_names=NAMES[2:6], action_names=NAMES[6:])
        cls.design = cls.fit(cls.logs)

    TASK = oted.Task(model=REAL / "model.xml", control_period=0.002, start="logs", max_episode_steps=10_000)

    @classmethod
    def fit(cls, logs):
        return oted.fit(cls.TASK, logs, PARAMETERS, seed=1, settings=SETTINGS, progress=False)

    def assertSameDesign(self, logs):
        self.assertEqual(len(logs.episodes), EPISODES)
        design = self.fit(logs)
        self.assertEqual(design.verdict, self.design.verdict)
        for here, there in zip(design.parameters, self.design.parameters):
            for mode, (low, high) in ((here["mode"], there["interval90"]), (there["mode"], here["interval90"])):
                self.assertTrue(low <= mode <= high, (here["name"], mode, low, high))
        return design

    def test_a_csv(self):
        path = self.folder / "log.csv"
        with open(path, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(NAMES)
            for e, rows in enumerate(RECORDINGS):
                writer.writerows([e, *map(repr, map(float, row))] for row in rows)
        design = self.assertSameDesign(oted.read_logs(path, task=self.TASK))
        self.assertEqual(design.parameters, self.design.parameters)

    def test_ros_2_bags_of_either_storage(self):
        for name, make in (("sqlite", lambda path: RobotBag(path, StoragePlugin.SQLITE3)),
                           ("mcap", lambda path: RobotBag(path, StoragePlugin.MCAP)), ("alone.mcap", RobotMcap)):
            logs = None
            for e, rows in enumerate(RECORDINGS):
                write_bag(make(self.folder / f"{e}{name}"), rows)
                one = oted.bags.read_bag(
                    self.folder / f"{e}{name}", period=0.002, states=["/joint_states:position", "/joint_states:velocity"],
                    actions=["/commands:data"], names={"j1": "shoulder", "j2": "elbow", "/commands:data[0]": NAMES[6],
                                                       "/commands:data[1]": NAMES[7]},
                    scale={"joint/elbow/qpos": -1, "joint/elbow/qvel": -1})
                logs = one if logs is None else logs + one
            self.assertSameDesign(logs)

    def test_a_data_frame_and_parquet(self):
        frame = pandas.concat([pandas.DataFrame(rows, columns=NAMES[1:]).assign(episode=e) for e, rows in enumerate(RECORDINGS)])
        frame.to_parquet(self.folder / "log.parquet")
        how = {"observations": NAMES[2:6], "actions": NAMES[6:], "episode": "episode", "period": 0.002}
        for source in (frame, pandas.read_parquet(self.folder / "log.parquet")):
            logs = oted.Logs.from_pandas(source, **how)
            np.testing.assert_array_equal(logs.observations, self.logs.observations)
            np.testing.assert_array_equal(logs.next_observations, self.logs.next_observations)

    def test_robomimic(self):
        with h5py.File(self.folder / "demos.hdf5", "w") as file:
            for e, rows in enumerate(RECORDINGS):
                demo = file.create_group(f"data/demo_{e}")
                demo["obs/position"], demo["obs/velocity"], demo["actions"] = rows[:, 1:3], rows[:, 3:5], rows[:, 5:]
        names = {f"{field}[{k}]": NAMES[2 + k + 2 * i] for i, field in enumerate(("position", "velocity")) for k in range(2)}
        logs = oted.robomimic.read_robomimic(
            self.folder / "demos.hdf5", observations=["position", "velocity"], period=0.002,
            names={**names, "actions[0]": NAMES[6], "actions[1]": NAMES[7]})
        np.testing.assert_array_equal(logs.observations, self.logs.observations)
        np.testing.assert_array_equal(logs.actions, self.logs.actions)

    @unittest.skipUnless(os.environ.get("LEROBOT_SETS"), "LEROBOT_SETS names no sets: scripts/test_python.sh writes them")
    def test_lerobots_own_sets(self):
        for folder in os.environ["LEROBOT_SETS"].split(":"):
            logs = oted.lerobot.read_lerobot(folder, episodes=range(EPISODES))
            whole = logs.select(range(EPISODES))
            self.assertEqual((logs.observation_names, logs.action_names), (NAMES[2:6], NAMES[6:]))
            np.testing.assert_allclose(whole.observations[:ROWS - 1], self.logs.observations[:ROWS - 1], rtol=1e-6, atol=1e-7)
            rows = [np.arange(begin, begin + ROWS - 1) for begin, _, _ in logs.episodes]
            parts = [(np.vstack([logs.observations[r], logs.next_observations[r[-1:]]]), logs.actions[r]) for r in rows]
            self.assertSameDesign(oted.Logs.from_episodes(parts, period=logs.period, observation_names=logs.observation_names,
                                                          action_names=logs.action_names))


if __name__ == "__main__":
    unittest.main()
