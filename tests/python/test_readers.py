"""Bags, LeRobot sets, frames and plots, with the packages of the extras: test_readers.py [FOLDER], which holds the package
oted where it is not installed. What is read was written by those projects' own packages."""

import json
import pathlib
import sys
import tempfile
import unittest

if len(sys.argv) > 1:
    sys.path.insert(0, str(pathlib.Path(sys.argv.pop(1)).resolve()))

import numpy as np  # noqa: E402
import pandas  # noqa: E402
import pyarrow  # noqa: E402
import pyarrow.parquet  # noqa: E402
from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

import oted  # noqa: E402
from oted.bags import bag_topics, read_bag  # noqa: E402
from oted.lerobot import read_lerobot  # noqa: E402

START = 1_700_000_000_000_000_000  # [ns]


def elbow(t):
    return np.sin(2 * np.pi * t)


def shoulder(t):
    return 0.3 * t * t - 1


def write_bag(path, plugin, *, unset_stamps=False):
    """Joint states at 500 Hz with jitter and names in changing order, commands at 100 Hz; 2 s. Recorded 12 ms late."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    header, time = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    state, command = types["sensor_msgs/msg/JointState"], types["std_msgs/msg/Float64MultiArray"]
    layout = types["std_msgs/msg/MultiArrayLayout"]
    random = np.random.default_rng(0)
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        states = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        commands = writer.add_connection("/commands", command.__msgtype__, typestore=store)
        for k in range(1000):
            t = 0.002 * k + random.uniform(-2e-4, 2e-4)
            order = random.permutation(2)
            names, values = np.array(["elbow", "panda_1"])[order], np.array([elbow(t), shoulder(t)])[order]
            stamp = START + round(t * 1e9)
            written = 0 if unset_stamps else stamp
            message = state(header(time(written // 10**9, written % 10**9), ""), list(names), values, np.zeros(2), np.zeros(0))
            writer.write(states, stamp + 12_000_000, store.serialize_cdr(message, state.__msgtype__))
        for k in range(200):
            message = command(layout([], 0), np.array([float(k)]))
            writer.write(commands, START + round(0.01 * k * 1e9), store.serialize_cdr(message, command.__msgtype__))


class InFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="oted test ")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)


class Bags(InFolder):
    def check(self, path, late=0.0, **keywords):
        logs = read_bag(path, states=["/joint_states:position"], actions=["/commands:data"], period=0.02,
                        names={"panda_1": "shoulder"}, **keywords)
        self.assertEqual(sorted(logs.observation_names), ["joint/elbow/qpos", "joint/shoulder/qpos"])
        columns = {name: logs.observations[:, i] for i, name in enumerate(logs.observation_names)}
        # The curves are unwrapped by hand: where the grid begins follows from the first row.
        t0 = np.sqrt((columns["joint/shoulder/qpos"][1] + 1) / 0.3) - 0.02
        t = t0 + 0.02 * np.arange(len(logs))
        # Linear interpolation over 2.4 ms: at most h^2 / 8 of the second derivative, 2.9e-5 of the faster one.
        np.testing.assert_allclose(columns["joint/elbow/qpos"], elbow(t), atol=1e-4)
        np.testing.assert_allclose(columns["joint/shoulder/qpos"], shoulder(t), atol=1e-4)
        np.testing.assert_allclose(logs.actions[:, 0], np.floor((t + late) / 0.01), atol=1.01)
        self.assertEqual(logs.period, 0.02)
        return logs

    def test_a_bag_of_either_storage_is_the_motion_that_was_recorded(self):
        for name, plugin in (("sqlite", StoragePlugin.SQLITE3), ("mcap", StoragePlugin.MCAP)):
            write_bag(self.folder / name, plugin)
            self.check(self.folder / name)

    def test_stamps_that_nobody_set_fall_back_to_the_times_of_recording(self):
        write_bag(self.folder / "bag", StoragePlugin.SQLITE3, unset_stamps=True)
        self.check(self.folder / "bag", late=0.012)

    def test_topics_are_listed_with_rates(self):
        write_bag(self.folder / "bag", StoragePlugin.MCAP)
        found = {topic["topic"]: topic for topic in bag_topics(self.folder / "bag")}
        self.assertEqual(found["/joint_states"]["messages"], 1000)
        self.assertAlmostEqual(found["/commands"]["rate"], 100, delta=0.1)

    def test_signs_units_and_clocks_are_corrected_as_said(self):
        write_bag(self.folder / "bag", StoragePlugin.MCAP)
        plain = self.check(self.folder / "bag")
        logs = read_bag(self.folder / "bag", states=["/joint_states:position"], actions=["/commands:data"], period=0.02,
                        scale={"joint/elbow/qpos": -2.0}, offset={"joint/elbow/qpos": 1.0})
        i, j = (names.observation_names.index("joint/elbow/qpos") for names in (logs, plain))
        np.testing.assert_allclose(logs.observations[:, i], 1 - 2 * plain.observations[:, j], atol=1e-12)

    def test_errors_name_topic_and_field(self):
        write_bag(self.folder / "bag", StoragePlugin.MCAP)
        for states, error in ((["/joint_state:position"], "/joint_states"), (["/joint_states:postion"], "position"),
                              (["/joint_states"], "TOPIC:FIELD"), (["/joint_states:effort"], "no numbers")):
            with self.assertRaisesRegex(oted.Error, error):
                read_bag(self.folder / "bag", states=states, actions=["/commands:data"], period=0.02)
        with self.assertRaises(oted.DataError):
            read_bag(self.folder / "none", states=["/a:b"], actions=["/c:d"], period=0.02)

    def test_a_damaged_bag_is_a_data_error(self):
        write_bag(self.folder / "bag", StoragePlugin.MCAP)
        file = next((self.folder / "bag").glob("*.mcap"))
        file.write_bytes(file.read_bytes()[:20_000])
        with self.assertRaises(oted.DataError):
            self.check(self.folder / "bag")


class LeRobot(InFolder):
    EPISODES = [(np.arange(12.0).reshape(6, 2), np.arange(6.0).reshape(6, 1)), (np.ones((4, 2)), np.zeros((4, 1)))]

    def write(self, version):
        (self.folder / "meta").mkdir(parents=True)
        names = ["shoulder", "elbow"]
        (self.folder / "meta/info.json").write_text(json.dumps({
            "codebase_version": version, "fps": 50,
            "features": {"observation.state": {"dtype": "float32", "shape": [2],
                                               "names": {"motors": names} if version == "v2.1" else names},
                         "action": {"dtype": "float32", "shape": [1], "names": ["motor"]}}}))
        tables = []
        for i, (seen, done) in enumerate(self.EPISODES):
            n = len(seen)
            tables.append(pyarrow.table({
                "observation.state": pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(seen.ravel(), pyarrow.float32()), 2),
                "action": pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(done.ravel(), pyarrow.float32()), 1),
                "timestamp": pyarrow.array(np.arange(n) / 50, pyarrow.float32()),
                "frame_index": pyarrow.array(np.arange(n)), "episode_index": pyarrow.array([i] * n)}))
        folder = self.folder / "data/chunk-000"
        folder.mkdir(parents=True)
        if version == "v3.0":  # many episodes in a file
            pyarrow.parquet.write_table(pyarrow.concat_tables(tables), folder / "file-000.parquet")
        else:
            for i, table in enumerate(tables):
                pyarrow.parquet.write_table(table, folder / f"episode_{i:06d}.parquet")

    def check(self, version):
        self.write(version)
        logs = read_lerobot(self.folder)
        self.assertEqual(logs.episodes, [(0, 5, False), (5, 8, False)])
        np.testing.assert_array_equal(logs.observations[:5], self.EPISODES[0][0][:-1])
        np.testing.assert_array_equal(logs.actions[:5], self.EPISODES[0][1][:-1])
        self.assertEqual((logs.observation_names, logs.action_names, logs.period), (["shoulder", "elbow"], ["motor"], 0.02))
        self.assertEqual(len(read_lerobot(self.folder, episodes=[1])), 3)
        with self.assertRaises(oted.UsageError):
            read_lerobot(self.folder, episodes=[7])

    def test_version_2(self):
        self.check("v2.1")

    def test_version_3(self):
        self.check("v3.0")

    def test_a_folder_that_is_none_is_a_data_error(self):
        with self.assertRaises(oted.DataError):
            read_lerobot(self.folder)


class Frames(unittest.TestCase):
    def test_a_frame_with_time_stamps_comes_at_the_period_that_is_asked_for(self):
        t = np.arange(200) * 0.01
        frame = pandas.DataFrame({"when": pandas.to_datetime(START + (t * 1e9).astype(np.int64)), "q": 2 * t, "u": t})
        logs = oted.Logs.from_pandas(frame, observations=["q"], actions=["u"], time="when", period=0.02)
        np.testing.assert_allclose(np.diff(logs.observations[:, 0]), 0.04, atol=1e-9)

    def test_a_table_of_pyarrow_is_a_frame(self):
        table = pyarrow.table({"q": [0.0, 1.0, 2.0], "u": [0.0, 0.0, 0.0]})
        self.assertEqual(len(oted.Logs.from_pandas(table, observations=["q"], actions=["u"], period=0.1)), 2)


if __name__ == "__main__":
    unittest.main()
