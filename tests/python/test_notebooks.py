"""The notebooks run from top to bottom, in the environment that this runs in, with settings of seconds.

    test_notebooks.py OUT [NAME...]      OUT: a folder for what they look like (HTML), where nbconvert is there;
                                         NAME: "quickstart" and so on; without, all of them
"""

import pathlib
import shutil
import sys
import tempfile
import unittest

import nbclient
import nbformat

OUT = pathlib.Path(sys.argv[1])
NAMES = sys.argv[2:]
ROOT = pathlib.Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "examples/notebooks").glob("*.ipynb"))
MOST_SECONDS = 1800  # of a cell: no measure of it, but the end of one that hangs
SETTINGS = """settings = {
    "design.method": "trajectories", "design.trajectories.rows": 64, "design.trajectories.starts": 1,
    "design.trajectories.coarse": 4, "design.trajectories.tried": 0, "selection.n_seeds": 1, "selection.n_sims": 2,
    "selection.n_steps": 20, "selection.judge_steps": 20, "report.motion": "false",
}
rows, n_steps, n_episodes = 600, 4096, 2
"""


class Notebooks(unittest.TestCase):
    def test_they_are_kept_without_outputs(self):
        self.assertGreaterEqual(len(NOTEBOOKS), 3)
        for path in NOTEBOOKS:
            notebook = nbformat.read(path, as_version=4)
            nbformat.validate(notebook)
            for cell in notebook.cells:
                self.assertFalse(cell.get("outputs"), path.name)
                self.assertIsNone(cell.get("execution_count"), path.name)

    def test_they_run(self):
        with tempfile.TemporaryDirectory() as folder:
            # What they write stays out of the repository; what they read lies beside them.
            place = pathlib.Path(folder) / "notebooks"
            place.mkdir()
            for name in ("data", "real"):
                (pathlib.Path(folder) / name).symlink_to(ROOT / "examples" / name)
            chosen = [path for path in NOTEBOOKS if not NAMES or path.stem in NAMES]
            self.assertTrue(chosen, NAMES)
            for path in chosen:
                with self.subTest(path.name):
                    self.run_one(path, place)

    def run_one(self, path, place):
        notebook = nbformat.read(path, as_version=4)
        tagged = [cell for cell in notebook.cells if "settings" in cell.metadata.get("tags", [])]
        self.assertEqual(len(tagged), 1, "one cell has the tag 'settings'")
        tagged[0].source = SETTINGS
        nbclient.NotebookClient(notebook, timeout=MOST_SECONDS, kernel_name="python3",
                                resources={"metadata": {"path": str(place)}}).execute()
        text = "".join(output.get("text", "") for cell in notebook.cells for output in cell.get("outputs", ()))
        self.assertNotIn("Traceback", text)
        if shutil.which("jupyter-nbconvert", path=str(pathlib.Path(sys.executable).parent)):
            from nbconvert import HTMLExporter
            OUT.mkdir(parents=True, exist_ok=True)
            (OUT / f"{path.stem}.html").write_text(HTMLExporter().from_notebook_node(notebook)[0], encoding="utf-8")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
