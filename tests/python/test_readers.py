"""LeRobot sets and frames, with the packages of the extras: test_readers.py [FOLDER], which holds the package
oted where it is not installed. What is read was written by those projects' own packages."""

import json
import pathlib
import shutil
import sys
import unittest

if len(sys.argv) > 1:
    sys.path.insert(0, str(pathlib.Path(sys.argv.pop(1)).resolve()))

import numpy as np  # noqa: E402
import pandas  # noqa: E402
import pyarrow  # noqa: E402
import pyarrow.parquet  # noqa: E402

import oted  # noqa: E402
from oted.lerobot import read_lerobot  # noqa: E402
from support import InFolder  # noqa: E402

START = 1_700_000_000_000_000_000  # [ns]


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

    def rewrite(self, frames, states=None, episode=None):
        """One episode; the state is the frame's number unless it is given."""
        shutil.rmtree(self.folder / "data", ignore_errors=True)
        (self.folder / "data/chunk-000").mkdir(parents=True)
        states = [[float(k), 0.0] for k in frames] if states is None else states
        pyarrow.parquet.write_table(pyarrow.table({
            "observation.state": states, "action": [[float(k)] for k in frames], "frame_index": list(frames),
            "episode_index": [0] * len(frames) if episode is None else episode}), self.folder / "data/chunk-000/file-000.parquet")

    def test_rows_lie_where_their_frames_say(self):
        self.write("v3.0")
        self.rewrite([4, 3, 2, 1, 0])
        logs = read_lerobot(self.folder)
        np.testing.assert_array_equal(logs.observations[:, 0], [0, 1, 2, 3])
        np.testing.assert_array_equal(logs.actions[:, 0], [0, 1, 2, 3])
        self.rewrite([0, 1, 2, 50, 51, 52])
        logs = read_lerobot(self.folder)
        self.assertEqual(logs.episodes, [(0, 2, False), (2, 4, False)])
        np.testing.assert_array_equal(logs.observations[:, 0], [0, 1, 50, 51])
        self.assertTrue(any("gaps" in remark for remark in logs.remarks), logs.remarks)
        self.rewrite([*range(10), *range(11, 20)])  # a frame that was lost is filled in, as in a table
        np.testing.assert_allclose(read_lerobot(self.folder).observations[:, 0], np.arange(19), atol=1e-9)
        self.rewrite([0, 1, 1, 2])
        with self.assertRaisesRegex(oted.DataError, "episode 0 has frame_index 1 twice"):
            read_lerobot(self.folder)

    def test_a_set_that_is_damaged_says_where(self):
        self.write("v3.0")
        file = self.folder / "meta/info.json"
        whole = json.loads(file.read_text())
        for info, said in (({**whole, "fps": 0}, "got fps 0"), ({**whole, "fps": "x"}, "got fps 'x'"), ([whole], "object of JSON"),
                           ({k: v for k, v in whole.items() if k != "fps"}, "got fps None"),
                           ({**whole, "features": [1]}, "its features should be")):
            file.write_text(json.dumps(info))
            with self.subTest(said), self.assertRaisesRegex(oted.DataError, f"info.json.*{said}"):
                read_lerobot(self.folder)
        file.write_text(json.dumps(whole))
        for rows, said in ((([],), "hold no rows"), (([0, 1], [[0.0, 1.0], [0.0]]), "'observation.state' should hold as many"),
                           (([0, 1], [[0.0, 1.0], None]), "'observation.state'"),
                           (([0, 1], [[0.0, 1.0], [0.0, None]]), "'observation.state'.* in row 1"),
                           (([0, 1], None, [0, None]), "'episode_index' should hold a whole number")):
            self.rewrite(*rows)
            with self.subTest(said), self.assertRaisesRegex(oted.DataError, said) as raised:
                read_lerobot(self.folder)
            self.assertEqual(len(str(raised.exception).splitlines()), 1)
        self.rewrite([0, 1, 2])
        for given, said in (({"episodes": []}, r"episodes: got \[\]"), ({"episodes": 1}, "episodes: got 1"),
                            ({"episodes": [0.5]}, "episodes: got 0.5"), ({"scale": [1, 2, 3]}, r"scale: got \[1, 2, 3\]"),
                            ({"scale": "x"}, "scale: got 'x'"), ({"observation_names": "ab"}, "observation_names: got 'ab'"),
                            ({"state": 3}, "state: got 3")):
            with self.subTest(said), self.assertRaisesRegex(oted.UsageError, said):
                read_lerobot(self.folder, **given)
        for path in (3, None):
            with self.assertRaisesRegex(oted.UsageError, f"path: got {path}, wanted the path of a folder"):
                read_lerobot(path)

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
