"""What is not searched and off by the logs is named, and freeing it closes the gap.

    test_suspects.py PATH/TO/oted [TestClass.test_name ...]
"""

import json
import pathlib
import tempfile
import unittest

import jsonschema
import program

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
GAIN, DAMPING = "gain=actuator/*/gainprm[0]:0.2:2.0", "damping=joint/*/damping:0.2:2.0"
QUICK = program.sets(program.TINY + ["design.trajectories.rows=96", "design.trajectories.window=16", "selection.n_seeds=1",
                             "report.motion=false"])


class SuspectsTest(unittest.TestCase):
    """Two episodes of Hopper with 1.2 times the gain and 0.7 times the damping of every joint."""

    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.demos = cls.folder / "demos.npz"
        result = program.oted("collect", "--task", "Hopper-v5", "--policy", ROOT / "examples/policies/hopper/medium.npz",
                          "--episodes", "2", "--seed", "1", "--param", GAIN, "--truth", "gain=1.2", "--param", DAMPING,
                          "--truth", "damping=0.7", "--out", cls.demos)
        assert result.returncode == 0, result.stderr

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def design(self, name, *parameters):
        words = [word for parameter in parameters for word in ("--param", parameter)]
        result = program.oted("design", "--task", "Hopper-v5", "--data", self.demos, "--out", self.folder / name, "--quiet",
                          *words, *QUICK)
        return result, json.loads((self.folder / name / "design.json").read_text())

    def test_the_damping_that_nobody_searches_is_named_with_its_factor(self):
        result, design = self.design("gain", GAIN)
        self.assertEqual(result.returncode, program.NO_SIMULATOR, result.stderr)
        first = design["fit"]["suspects"][0]
        self.assertEqual(first["field"], "joint/*/damping")
        self.assertAlmostEqual(first["factor"], 0.7, delta=0.1)
        self.assertIn("suspect, not among the parameters: joint/*/damping, by the logs about 0.7", result.stdout)
        self.assertIn("method: trajectories, as its answer is outside the family", result.stdout)
        tried = {method["method"]: method["error"] for method in design["method_choices"][0]["tried"]}
        self.assertEqual(set(tried), {"trajectories", "transitions", "least-squares"})
        self.assertIn("joint/*/damping (about 0.7", (self.folder / "gain/report.html").read_text())
        for file, schema in (("design.json", "oted.design.1"), ("design/default/1/q.json", "oted.q.1")):
            jsonschema.validate(json.loads((self.folder / "gain" / file).read_text()),
                                json.loads((ROOT / f"docs/schemas/{schema}.schema.json").read_text()))

    def test_freed_it_is_found_and_nothing_else_is_suspected(self):
        result, design = self.design("both", GAIN, DAMPING)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(design["fit"]["suspects"], [])
        self.assertIn("method: trajectories, as noise alone explains", result.stdout)
        self.assertEqual(design["method_choices"][0]["tried"], [])
        for parameter, truth in zip(design["parameters"], (1.2, 0.7)):
            self.assertAlmostEqual(parameter["mode"], truth, delta=1e-4)
        self.assertNotIn("not searched", result.stdout)


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
