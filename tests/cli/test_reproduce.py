"""oted reproduce: the paper's studies, cell by cell.

    test_reproduce.py PATH/TO/oted [TestClass.test_name ...]
"""

import json
import pathlib
import shutil
import unittest

import program

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


def finished_cell(error):
    pick = {"setting": "h", "error": error, "error_std": 0.01, "regret": 0.0}
    return {"schema": "oted.cell/1", "task": "hopper", "dataset": "medium", "parameters": "all", "counts": True,
            "names": ["friction", "gain", "gravity"], "best_error": error, "worst_error": 4 * error,
            "settings": [{"name": "h", "modes": [[1 + error, 1, 1]]}],
            "picks": {key: pick for key in ("random", "design_deviation", "learning_progress", "c", "common")}}


class ReproduceTest(program.HopperTest):
    def test_a_finished_cell_is_not_run_again_and_its_table_is_printed(self):
        out = self.folder / "table2"
        file = self.folder / "table2.jsonl"
        file.write_text(json.dumps({"cell": "hopper-medium-all"} | finished_cell(0.123)) + "\n")
        result = program.oted("reproduce", "table2", "--task", "hopper", "--dataset", "medium", "--out", out, "--quiet")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("| hopper-medium | 0.100 | 0.123, 0.492 |", result.stdout)
        self.assertIn("0.235 (0.034)", result.stdout, "the paper's own figure stands beside it")
        self.assertFalse(out.exists())

    def test_a_cell_runs_from_the_demonstrations_of_its_name_to_a_file(self):
        # The nominal simulator's logs: with trajectories, one seed and one parameter a design takes seconds. Their gain is
        # 0.3 off the target that is named.
        data = self.folder / "data"
        data.mkdir()
        shutil.copyfile(ROOT / "examples/data/hopper-medium.hdf5", data / "hopper-expert.hdf5")
        out = self.folder / "figure2"
        result = program.oted("reproduce", "figure2", "--task", "hopper", "--dataset", "expert", "--parameters", "gain",
                          "--seeds", "1", "--design-method", "trajectories", "--target", "gain=1.3", "--data", data, "--out", out, "--quiet",
                          *program.sets([s for s in program.TINY if "design." not in s and "n_seeds" not in s]),
                          *program.sets(["design.discriminator.steps=1", "design.trajectories.rows=128", "design.trajectories.coarse=8",
                                      "design.trajectories.starts=1"]))
        self.assertEqual(result.returncode, 0, result.stderr)
        (record,) = map(json.loads, (self.folder / "figure2.jsonl").read_text().splitlines())
        self.assertEqual(record["cell"], "hopper-expert-gain")
        self.assertAlmostEqual(record["settings"][0]["error"], 0.3, places=5)
        self.assertAlmostEqual(record["middle_error"], 0.2)
        self.assertEqual(record["target"]["gain"], 1.3)
        self.assertEqual(record["names"], ["gain"])
        self.assertIn("reproduce figure2", record["command"])
        self.assertIn("| hopper-expert |  | 0.300 |", result.stdout)
        self.assertTrue((out / "runs/hopper-expert-gain/report.html").exists())
        other = program.oted("reproduce", "figure2", "--task", "hopper", "--dataset", "expert", "--parameters", "gain",
                             "--data", data, "--out", out, "--quiet")
        self.assertOneLine(other, program.USAGE, "take another --out")

    def test_a_table_of_a_study_that_was_not_run_is_an_error(self):
        for study in ("table1", "table2", "figure3"):
            result = program.oted("reproduce", study, "--out", self.folder / "none", "--table")
            self.assertOneLine(result, program.DATA_OR_MODEL, "none.jsonl' does not exist")

    def test_unknown_names_are_usage_errors(self):
        for words, named in ((["tabel2"], "'table2'"), (["table2", "--task", "hoper"], "'hopper'"),
                             (["table2", "--dataset", "poor"], "medium-expert"),
                             (["figure2", "--parameters", "mass"], "gravity")):
            result = program.oted("reproduce", *words, "--out", self.folder / "none", "--quiet")
            self.assertOneLine(result, program.USAGE, named)
        self.assertFalse((self.folder / "none").exists())

    def test_missing_demonstrations_are_a_data_error(self):
        result = program.oted("reproduce", "table2", "--task", "hopper", "--dataset", "medium", "--data", self.folder,
                          "--out", self.folder / "t", "--quiet")
        self.assertOneLine(result, program.DATA_OR_MODEL, "hopper-medium.hdf5")


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
