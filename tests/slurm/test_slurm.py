"""Plans on a real Slurm of two nodes: units and a node die, and the table is that of one machine, byte for byte.

    test_slurm.py PATH/TO/oted [TestClass.test_name ...]

Exits with 77 where there is no Slurm.
"""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import cluster

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "cli"))
import program  # noqa: E402

SKIPPED = 77
STUDY = ["--task", "hopper", "--parameters", "gain", "--methods", "bc", "dr", "nominal", "--seeds", "4", "--steps", "4000",
         *program.sets(program.TINY)]


class SlurmTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="oted-slurm-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.cluster = cluster.Cluster(self.folder / "slurm")
        self.addCleanup(self.cluster.close)
        self.data = self.folder / "data"
        self.data.mkdir()
        for name in ("hopper-medium", "hopper-expert"):
            shutil.copyfile(program.ROOT / f"examples/data/{name}.hdf5", self.data / f"{name}.hdf5")
        self.plan = self.folder / "table1.jsonl"
        self.root = self.folder / "table1"

    def oted(self, *words, code=0):
        result = subprocess.run([program.OTED, *map(str, words)], capture_output=True, text=True, timeout=300,
                                env=self.cluster.environment)
        self.assertEqual(result.returncode, code, result.stderr + result.stdout)
        return result

    def table_of_one_machine(self, *study):
        words = ("reproduce", "table1", *STUDY, "--data", self.data, "--out", self.folder / "single")
        self.oted(*words, "--dataset", "medium", "expert", "--threads", "2", "--quiet")
        return self.oted(*words, *study, "--table").stdout

    def states(self):
        return {unit["index"]: unit["state"]
                for unit in json.loads(self.oted("plan", "status", self.plan, "--json").stdout)["units"]}

    def records(self):
        return {path: path.read_bytes() for path in self.root.glob("units/*/done.json")}

    def submit(self):
        return self.oted("submit", self.plan, "--engine", "slurm")

    def wait_for(self, state, node=None):
        def there():
            busy = node is None or any(b"unit" in pathlib.Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
                                       for pid in self.cluster.processes(node) if pathlib.Path(f"/proc/{pid}").exists())
            return busy and state in self.states().values()
        self.cluster.wait(there, 60, f"no unit is {state}")

    def wait_for_end(self, seconds):
        self.cluster.wait(lambda: not self.cluster.queue(), seconds, "jobs are still there")

    def test_killed_units_and_a_lost_node_change_no_byte_of_the_table(self):
        (self.data / "hopper-medium-expert.hdf5").write_bytes(b"no HDF5" * 100)
        study = ["--dataset", "medium", "expert", "medium-expert"]
        planned = self.oted("plan", "table1", *STUDY, *study, "--data", self.data, "--to", self.plan, "--memory", "500",
                            "--minutes", "20")
        self.assertIn("20 units", planned.stdout)
        # Indices of one array end at 15 here: the plan needs two.
        self.assertIn("array jobs", self.submit().stdout)
        refused = self.oted("submit", self.plan, "--engine", "slurm", code=program.USAGE)
        self.assertIn("wait or run already", refused.stderr)

        # A unit's processes, then the whole of a node.
        self.wait_for("done")
        self.wait_for("running", "n1")
        for pid in self.cluster.processes("n1"):
            if b"unit" in pathlib.Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0"):
                os.kill(pid, signal.SIGKILL)
        self.wait_for("running", "n2")
        self.cluster.kill("n2")
        self.cluster.call("scancel", "--me")
        self.cluster.start("n2")
        self.wait_for_end(60)
        self.cluster.wait(lambda: self.cluster.states() == {"idle"}, 60, "the node is not back")
        states = self.states()
        self.assertIn("stopped", states.values())
        before = self.records()
        self.assertGreater(len(before), 0)
        self.assertLess(len(before), 16)

        self.submit()
        self.wait_for_end(120)
        after = self.records()
        self.assertEqual(len(after), 16)
        self.assertEqual({path: after[path] for path in before}, before, "what was done was done again")
        attempts = [json.loads(record)["attempts"] for record in after.values()]
        self.assertGreater(max(attempts), 1, "nothing went on from where it was stopped")

        # Bad data: failed once, named, and nothing else was stopped by it.
        failed = [json.loads(path.read_text()) for path in self.root.glob("failed/*.json")]
        self.assertEqual([(unit["exit_code"], unit["attempts"]) for unit in failed], 4 * [(program.DATA_OR_MODEL, 1)])
        merged = self.oted("merge", self.plan, code=program.DATA_OR_MODEL)
        self.assertIn("failed: hopper-medium-expert-bc seed 1: exit code 3", merged.stderr)
        self.assertEqual(merged.stdout, self.table_of_one_machine(*study))
        log = "".join(path.read_text() for path in self.root.glob("logs/after_*.log"))
        self.assertIn(merged.stdout, log, "the job behind the arrays merged")

        # Again: nothing to run, the same table, no job.
        again = self.oted("submit", self.plan, "--engine", "slurm", code=program.DATA_OR_MODEL)
        self.assertEqual(again.stdout, merged.stdout)
        self.assertEqual(self.cluster.queue(), set())
        self.assertEqual(self.records(), after)

    def test_a_node_that_fails_hands_its_units_to_the_other_by_itself(self):
        study = ["--dataset", "medium", "expert"]
        self.oted("plan", "table1", *STUDY, *study, "--data", self.data, "--to", self.plan, "--memory", "500",
                  "--minutes", "20")
        self.submit()
        self.wait_for("running", "n2")
        self.cluster.kill("n2")
        start = time.monotonic()
        self.wait_for_end(420)
        print(f"the plan ended {time.monotonic() - start:.0f} s after the node", file=sys.stderr)
        self.assertEqual(set(self.states().values()), {"done"})
        self.assertEqual(self.oted("merge", self.plan).stdout, self.table_of_one_machine(*study))


if __name__ == "__main__":
    program.take_paths(__doc__)
    missing = cluster.why_not()
    if missing:
        print(f"skipped: {missing}")
        sys.exit(SKIPPED)
    unittest.main()
