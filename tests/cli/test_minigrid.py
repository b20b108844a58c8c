"""oted collect in the grid worlds, and what the verbs say that do not take them yet.

    test_minigrid.py PATH/TO/oted [TestMinigrid.test_name ...]
"""

import pathlib
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy as np

OTED = None  # the program's path, from the command line

USAGE = 2
TASK = "MiniGrid-Obstacles-10x10"
DENSITY = "density=env/density:0:0.6:absolute"


class TestMinigrid(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="oted-cli-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.demos = self.folder / "demos.hdf5"

    def oted(self, *words):
        return subprocess.run([OTED, *map(str, words)], capture_output=True, text=True, timeout=120)

    def collect(self, *words):
        return self.oted("collect", "--task", TASK, "--param", DENSITY, "--out", self.demos, *words)

    def assertOneLine(self, result, *needles):
        self.assertEqual((result.returncode, result.stdout), (USAGE, ""), result.stderr)
        self.assertRegex(result.stderr, r"\Aoted: [^\n]+\n\Z")
        for needle in needles:
            self.assertIn(needle, result.stderr)

    def share_of_walls(self, truth):
        result = self.collect("--policy", "medium", "--episodes", "60", "--truth", f"density={truth}")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        with h5py.File(self.demos) as file:
            images = file["observations"][:, :147].reshape(-1, 7, 7, 3)
            self.assertEqual(file["observations"].shape[1], 148)
            self.assertEqual(set(np.unique(file["actions"])), {0, 1, 2})
            self.assertEqual(int(np.sum(file["terminals"])) + int(np.sum(file["timeouts"])), 60)
        # The cells straight ahead, as far as the room's first columns and rows lie there.
        return np.mean(images[:, 3, 3:6, 0] == 2)

    def test_demonstrations_show_the_density_that_was_asked_for(self):
        low, high = self.share_of_walls(0.05), self.share_of_walls(0.4)
        self.assertLess(low + 0.1, high)

    def test_refusals(self):
        self.assertOneLine(self.collect("--policy", "exprt"), "exprt", "did you mean 'expert'")
        self.assertOneLine(self.collect("--policy", "expert", "--truth", "density=0.7"), "density", "0.6")
        self.assertFalse(self.demos.exists())
        out = self.folder / "out"
        self.assertOneLine(self.oted("behavior", "--task", TASK, "--out", out), "oted collect")
        self.assertEqual(self.collect("--policy", "expert").returncode, 0)
        self.assertOneLine(self.oted("design", "--task", TASK, "--param", DENSITY, "--data", self.demos, "--out", out),
                           "discrete actions", "docs/minigrid.md")
        self.assertFalse(out.exists())


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    OTED = str(pathlib.Path(sys.argv.pop(1)).resolve())
    unittest.main()
