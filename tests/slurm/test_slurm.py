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

PATIENCE_S = 300  # on a machine that others use as well
SKIPPED = 77
STUDY = ["--task", "hopper", "--parameters", "gain", "--methods", "bc", "dr", "nominal", "--seeds", "4", "--steps", "4000",
         *program.sets(program.TINY)]


def words_of(pid):
    """A process's command, none where it has ended."""
    try:
        return pathlib.Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return []


def index_of(pid):
    """Which unit of the plan the process makes, None where it has ended."""
    words = words_of(pid)
    return int(words[words.index(b"--index") + 1]) if b"--index" in words else None


def send(pid, what):
    try:
        os.kill(pid, what)
    except ProcessLookupError:
        pass


def is_halted(pid):
    return b"State:\tT" in cluster.read(f"/proc/{pid}/status")


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

    def listed(self):
        return json.loads(self.oted("plan", "status", self.plan, "--json").stdout)["units"]

    def units(self, state):
        """The names of the units that are in it."""
        return [unit["name"] for unit in self.listed() if unit["state"] == state]

    def records(self):
        return {path: path.read_bytes() for path in self.root.glob("units/*/done.json")}

    def failures(self):
        return {path: path.read_bytes() for path in self.root.glob("failed/*.json")}

    def submit(self):
        return self.oted("submit", self.plan, "--engine", "slurm")

    def processes_of_units(self, node):
        return [pid for pid in self.cluster.processes(node) if b"unit" in words_of(pid)]

    def wait_for(self, state):
        self.cluster.wait(lambda: self.units(state), PATIENCE_S, f"no unit is {state}")

    def hold_work(self, node):
        """Waits until the node works, and halts its unit there: however quick the machine is, the node is at work after."""
        def held():
            pids = self.processes_of_units(node)
            for pid in pids:
                send(pid, signal.SIGSTOP)
            return any(is_halted(pid) for pid in pids)
        self.cluster.wait(held, PATIENCE_S, f"{node} has no unit")

    def stop_a_unit(self, node):
        """Kills a unit with good data in its midst. One that is killed before it begins would leave no trace."""
        def stopped():
            begun = {unit["index"]: unit["name"] for unit in self.listed() if unit["state"] == "running"}
            for pid in self.processes_of_units(node):
                if "medium-expert" not in begun.get(index_of(pid), "medium-expert"):
                    send(pid, signal.SIGKILL)
            return any("medium-expert" not in name for name in self.units("stopped"))
        self.cluster.wait(stopped, PATIENCE_S, f"no unit of {node} was caught at work")

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
        self.hold_work("n2")
        self.stop_a_unit("n1")
        self.cluster.kill("n2")
        self.cluster.call("scancel", "--me")
        self.cluster.start("n2")
        self.wait_for_end(PATIENCE_S)
        self.cluster.wait(lambda: self.cluster.states() == {"idle"}, PATIENCE_S, "the node is not back")
        self.assertNotEqual(self.units("stopped"), [])
        before = self.records()
        failed_before = self.failures()
        self.assertGreater(len(before), 0)
        self.assertLess(len(before), 16)

        self.submit()
        self.wait_for_end(PATIENCE_S)
        after = self.records()
        self.assertEqual(len(after), 16)
        self.assertEqual({path: after[path] for path in before}, before, "what was done was done again")
        attempts = [json.loads(record)["attempts"] for record in after.values()]
        self.assertGreater(max(attempts), 1, "nothing went on from where it was stopped")

        # Bad data: failed once, named, and nothing else was stopped by it. A unit that was killed before it met its data
        # has more than one attempt; one that failed is not tried again.
        failed = self.failures()
        self.assertEqual([json.loads(record)["exit_code"] for record in failed.values()], 4 * [program.DATA_OR_MODEL])
        self.assertEqual({path: failed[path] for path in failed_before}, failed_before, "what failed was tried again")
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
        self.assertEqual(self.failures(), failed)

    def test_a_node_that_fails_hands_its_units_to_the_other_by_itself(self):
        study = ["--dataset", "medium", "expert"]
        self.oted("plan", "table1", *STUDY, *study, "--data", self.data, "--to", self.plan, "--memory", "500",
                  "--minutes", "20")
        self.submit()
        self.wait_for("done")
        self.hold_work("n2")
        self.cluster.kill("n2")
        start = time.monotonic()
        self.wait_for_end(3 * PATIENCE_S)
        print(f"the plan ended {time.monotonic() - start:.0f} s after the node", file=sys.stderr)
        self.assertEqual(len(self.units("done")), 16)
        self.assertEqual(self.oted("merge", self.plan).stdout, self.table_of_one_machine(*study))


if __name__ == "__main__":
    program.take_paths(__doc__)
    missing = cluster.why_not()
    if missing:
        print(f"skipped: {missing}")
        sys.exit(SKIPPED)
    unittest.main()
