"""oted plan, unit, submit, merge and sweep, on this machine. tests/slurm has the same on a cluster.

    test_plan.py PATH/TO/oted [TestClass.test_name ...]
"""

import csv
import json
import pathlib
import shlex
import shutil
import signal
import subprocess
import time
import unittest

import program

WINDOW = "design.trajectories.window="
DESIGN = [s for s in program.TINY_DESIGN if "n_seeds" not in s] + ["selection.n_seeds=1", "report.motion=false"]


class PlanTest(program.HopperTest):
    def setUp(self):
        super().setUp()
        self.plan = self.folder / "plan.jsonl"
        self.root = self.folder / "plan"

    def sweep(self, *words, to=None, settings=DESIGN):
        return program.oted("sweep", "--task", "Hopper-v5", "--param", program.FRICTION, "--to", to or self.plan,
                            *program.sets(settings), *words)

    def lines(self, plan=None):
        return [json.loads(line) for line in (plan or self.plan).read_text().splitlines()][1:]

    def states(self):
        units = json.loads(self.succeed("plan", "status", self.plan, "--json").stdout)["units"]
        return [unit["state"] for unit in units]

    def records(self):
        return {path: path.read_bytes() for path in self.root.glob("units/*/done.json")}

    def test_a_sweep_comes_back_as_one_table_and_bad_data_stops_nothing_else(self):
        bad = self.folder / "bad.hdf5"
        bad.write_bytes(b"no HDF5" * 100)
        words = ("--data", bad, self.demos, "--vary", WINDOW + "4", WINDOW + "6", "--seed", "2", "--engine", "local",
                 "--quiet")
        result = self.sweep(*words)
        self.assertEqual(result.returncode, program.DATA_OR_MODEL, result.stderr)
        failed = [line for line in result.stderr.splitlines() if line.startswith("failed: ")]
        self.assertEqual(len(failed), 2, result.stderr)
        self.assertIn("bad.hdf5", failed[0])
        self.assertEqual(self.states(), ["failed", "failed", "done", "done"])
        with open(self.root / "merged.csv") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([(row["data"], row[WINDOW[:-1]], row["seed"]) for row in rows],
                         [(str(self.demos), window, "2") for window in ("4", "6")])
        self.assertEqual(result.stdout.count("\n| "), 1 + 2)
        # A row is what the same design gives by itself.
        alone = program.oted("design", "--task", "Hopper-v5", "--param", program.FRICTION, "--data", self.demos, "--out", self.out,
                             "--seed", "2", "--quiet", *program.sets(DESIGN + [WINDOW + "6"]))
        self.assertIn(alone.returncode, (0, program.NO_SIMULATOR), alone.stderr)
        design = json.loads((self.out / "design.json").read_text())
        self.assertEqual(float(rows[1]["friction"]), design["parameters"][0]["mode"])
        self.assertEqual(rows[1]["verdict"], design["verdict"])
        # Again: nothing runs, and the table is the same. A failed unit is begun anew on request alone.
        before, log = self.records(), (self.root / "merged.csv").read_bytes()
        again = self.sweep(*words)
        self.assertEqual((again.returncode, again.stdout), (program.DATA_OR_MODEL, result.stdout))
        self.assertEqual((self.records(), (self.root / "merged.csv").read_bytes()), (before, log))
        # A result in the place of another is told from it.
        first, second = (unit / "result/design.json" for unit in sorted(self.root.glob("units/*")))
        kept = first.read_bytes()
        shutil.copyfile(second, first)
        self.assertOneLine(program.oted("merge", self.plan), program.DATA_OR_MODEL, "is another than the one that")
        # Nor is one that is damaged or gone taken for a file to repair: the unit is made again.
        first.write_bytes(kept + b"x")
        self.assertOneLine(program.oted("merge", self.plan), program.DATA_OR_MODEL, f"remove '{first.parent.parent}'")
        first.unlink()
        self.assertOneLine(program.oted("merge", self.plan), program.DATA_OR_MODEL, "is missing", f"remove '{first.parent.parent}'")
        first.write_bytes(kept)
        shutil.copyfile(self.demos, bad)
        retried = program.oted("submit", self.plan, "--engine", "local", "--retry-failed", "--quiet")
        self.assertIn("not what it was when the plan was written", retried.stderr)

    def test_a_key_names_what_determines_a_result_and_nothing_else(self):
        elsewhere = self.folder / "elsewhere"
        elsewhere.mkdir()
        shutil.copyfile(self.demos, elsewhere / "renamed.hdf5")

        def keys(name, *words, **more):
            self.assertEqual(self.sweep(*words, to=self.folder / name, **more).returncode, 0)
            return [line["key"] for line in self.lines(self.folder / name)]

        first = keys("a.jsonl", "--data", self.demos, "--seed", "1")
        self.assertEqual(keys("b.jsonl", "--data", elsewhere / "renamed.hdf5", "--threads", "2", "--minutes", "9"), first,
                         "place of the data, threads and needs; the seed's default is 1")
        for words in (("--seed", "2"), ("--command", "run"), ("--truth", "friction=1"), ("--set", WINDOW + "5")):
            self.assertNotEqual(keys("c.jsonl", "--data", self.demos, *words), first, words)
        same = self.sweep("--data", self.demos, elsewhere / "renamed.hdf5")
        self.assertOneLine(same, program.USAGE, "are the same work")

    def test_files_that_a_model_or_the_parameters_are_made_of_are_inputs_too(self):
        joint, parts = self.folder / "joint.xml", self.folder / "parts.yaml"
        joint.write_text('<mujoco><default><joint damping="1"/></default></mujoco>')
        (self.folder / "cart.xml").write_text(
            '<mujoco><include file="joint.xml"/><worldbody><body name="cart"><joint name="x" type="slide" axis="1 0 0"/>'
            '<geom size="0.1" mass="1"/></body></worldbody><actuator><motor joint="x" ctrlrange="-1 1"/></actuator></mujoco>')
        parts.write_text("mass:\n  name: mass\n  nominal: [1.0]\n  min_value: [0.5]\n  max_value: [2.0]\n  value: [1.0]\n  frozen: false\n")
        task = self.folder / "cart.toml"
        task.write_text('[task]\nmodel = "cart.xml"\ncontrol_period = 0.02\nstart_noise = 0.1\nmax_episode_steps = 30\n'
                        '[parameters]\nsysid = "parts.yaml"\nmass = { field = "body/cart/mass", scale = "absolute" }\n')
        data = self.folder / "logs.npz"
        self.succeed("collect", "--task", task, "--policy", "sine", "--episodes", "2", "--threads", "1", "--out", data)
        self.succeed("sweep", task, "--data", data, "--to", self.plan, *program.sets(DESIGN))
        inputs = [pathlib.Path(entry["path"]).name for entry in self.lines()[0]["inputs"]]
        self.assertEqual(sorted(inputs), ["cart.toml", "cart.xml", "joint.xml", "logs.npz", "parts.yaml"])
        for file in (joint, parts):
            kept = file.read_text()
            file.write_text(kept + "\n")
            result = program.oted("unit", self.plan, "--index", "0")
            self.assertNotEqual(result.returncode, 0)
            self.assertIn(f"{file.name}' is not what it was when the plan was written", result.stderr)
            file.write_text(kept)
            shutil.rmtree(self.root / "failed")
        self.succeed("submit", self.plan, "--engine", "local", "--quiet")

    def test_a_stopped_or_killed_unit_goes_on_to_the_bytes_of_one_that_was_not(self):
        slow = [s for s in DESIGN if "n_iterations" not in s] + ["design.method=transitions",
                                                                           "design.adversarial.n_iterations=100"]
        self.assertEqual(self.sweep("--data", self.demos, settings=slow).returncode, 0)
        words = [program.OTED, "unit", str(self.plan), "--index", "0"]
        for sent, ends in ((signal.SIGTERM, program.INTERRUPTED), (signal.SIGKILL, -signal.SIGKILL)):
            start = time.time()
            unit = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
            self.wait_for_checkpoint(unit, start)
            unit.send_signal(sent)
            unit.communicate(timeout=20)
            self.assertEqual(unit.returncode, ends)
            self.assertEqual(self.states(), ["stopped"], "its command ended with it")
        self.succeed("unit", self.plan, "--index", "0")
        (record,) = map(json.loads, self.records().values())
        self.assertEqual((record["attempts"], record["exit_code"] in (0, 4)), (3, True))
        alone = program.oted("design", "--task", "Hopper-v5", "--param", program.FRICTION, "--data", self.demos, "--out", self.out,
                             "--quiet", *program.sets(slow))
        self.assertIn(alone.returncode, (0, program.NO_SIMULATOR), alone.stderr)
        (result,) = self.root.glob("units/*/result/design.json")
        self.assertEqual(result.read_bytes(), (self.out / "design.json").read_bytes())
        self.assertIn("was done", self.succeed("unit", self.plan, "--index", "0").stderr)

    def test_a_caller_that_ignores_the_ends_of_children_holds_no_unit_up(self):
        self.assertEqual(self.sweep("--data", self.demos, settings=DESIGN).returncode, 0)
        for words in (["unit", self.plan, "--index", "0"], ["submit", self.plan, "--engine", "local", "--quiet"]):
            result = subprocess.run([program.OTED, *map(str, words)], capture_output=True, text=True, timeout=120,
                                    preexec_fn=lambda: signal.signal(signal.SIGCHLD, signal.SIG_IGN))
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertEqual(self.states(), ["done"])
            for path in self.root.glob("units/*"):
                shutil.rmtree(path)

    def wait_for_checkpoint(self, unit, start):
        """Until it has something that it made itself to go on with."""
        while time.time() - start < 60 and unit.poll() is None:
            for found in self.root.glob("runs/*/*/result/design/**/checkpoint.npz"):
                if found.exists() and found.stat().st_mtime > start:
                    return
            time.sleep(0.005)
        self.fail(f"no checkpoint: {unit.poll()}")

    def test_a_study_is_that_of_one_machine_and_a_part_of_it_has_gaps(self):
        data = self.folder / "data"
        data.mkdir()
        shutil.copyfile(program.ROOT / "examples/data/hopper-medium.hdf5", data / "hopper-medium.hdf5")
        study = ["--task", "hopper", "--dataset", "medium", "--parameters", "gain", "--methods", "bc", "bc_dr", "td3_bc", "--steps",
                 "200", "--seeds", "2", "--data", data, *program.sets(program.TINY + program.TINY_OFFLINE)]
        made = subprocess.run([program.OTED, "plan", "table1", *map(str, study), "--to", self.plan], cwd=self.folder)
        self.assertEqual(made.returncode, 0)
        names = [line["name"] for line in self.lines()]
        self.assertEqual(names, [f"{name} seed {seed}" for seed in (1, 2)
                                 for name in ("hopper-medium-bc", "hopper-gain-dr and bc_dr", "hopper-medium-td3_bc")])
        single = self.succeed("reproduce", "table1", *study, "--out", self.folder / "single", "--quiet").stdout
        for index in (0, 1, 3):
            self.succeed("unit", self.plan, "--index", index)
        self.assertEqual(self.succeed("plan", "status", self.plan, "--missing").stdout, "2,4-5\n")
        self.assertEqual(self.succeed("plan", "status", self.plan, "--missing", "--lines").stdout, "2\n4\n5\n")
        part = program.oted("merge", self.plan)
        self.assertEqual(part.returncode, program.DATA_OR_MODEL)
        self.assertIn("missing: hopper-medium-td3_bc seed 1\n", part.stderr)
        self.assertIn("of 6 units are done; 'oted submit", part.stderr)
        self.assertIn(f"merged into {self.root}/merged.jsonl\n", part.stderr)
        self.assertIn("| hopper-medium | gain |", part.stdout)
        self.assertEqual(self.succeed("submit", self.plan, "--engine", "local", "--quiet").stdout, single)
        # What each cell says it was made with makes it again, from where the plan was made.
        merged = [json.loads(line) for line in (self.root / "merged.jsonl").read_text().splitlines()]
        (command,) = {record["command"] for record in merged}
        words = shlex.split(command)
        self.assertEqual((words[:3], words[-4:]), (["oted", "reproduce", "table1"], ["--data", "data", "--out", "merged"]))
        (self.folder / "merged.jsonl").write_text((self.root / "merged.jsonl").read_text())
        again = subprocess.run([program.OTED, *words[1:]], capture_output=True, text=True, cwd=self.folder)
        self.assertEqual((again.returncode, again.stdout), (0, single), again.stderr)
        # What is on the disk already and differs is not merged into.
        record = self.folder / "foreign.jsonl"
        shutil.copyfile(self.root / "merged.jsonl", record)
        record.write_text(record.read_text().replace('"mean_return":', '"mean_return":1'))
        self.assertOneLine(program.oted("merge", self.plan, "--merge-to", self.folder / "foreign"), program.DATA_OR_MODEL,
                           "do not belong together")

    def test_the_merged_result_gets_the_name_that_was_given(self):
        self.sweep("--data", self.demos, "--engine", "local", "--quiet")
        for name in ("a", "b.csv"):
            self.succeed("merge", self.plan, "--merge-to", self.folder / name)
            self.assertTrue((self.folder / name).with_suffix(".csv").is_file(), name)
        # Before a unit is begun, too.
        self.sweep("--data", self.demos, "--seed", "5")
        for name in ("c.jsonl", "c.csv.gz", "folder/"):
            for command in (("merge",), ("submit", "--engine", "local", "--quiet")):
                refused = program.oted(command[0], self.plan, *command[1:], "--merge-to", f"{self.folder}/{name}")
                self.assertOneLine(refused, program.USAGE, "the result of a sweep is a .csv file; wanted a name with that ending, or with none")
        self.assertEqual(self.states(), ["missing"])
        self.assertEqual(sorted(self.folder.glob("c*")), [])

    def test_the_other_studies_are_planned_too(self):
        words = ("--task", "hopper", "--dataset", "medium", "expert", "--data", program.ROOT / "examples/data", "--to", self.plan)
        for name, units in (("table2", 2), ("figure2", 8)):
            self.assertIn(f"{units} units", self.succeed("plan", name, *words, "--parameters",
                                                       *(["all"] if units == 2 else ["all", "gain", "friction", "gravity"])).stdout)
        self.assertIn("4 units", self.succeed("plan", "figure3", "--density", "0.1", "0.26", "--demonstrations", "5", "--designer",
                                              "gaussian", "--seeds", "2", "--to", self.plan).stdout)
        self.assertEqual({line["words"][1] for line in self.lines()}, {"figure3"})

    def test_the_page_and_the_terminal_name_what_failed(self):
        bad = self.folder / "bad.hdf5"
        bad.write_bytes(b"<b>")
        self.sweep("--data", bad, "--engine", "local", "--quiet")
        page = self.folder / "status.html"
        text = self.succeed("plan", "status", self.plan, "--page", page).stdout
        self.assertIn("0 of 1 done, 0 running, 0 stopped, 1 failed, 0 missing", text)
        self.assertIn("exit code 3", text)
        html = page.read_text()
        self.assertIn('http-equiv="refresh"', html)
        self.assertIn("0 of 1 done", html)
        self.assertNotIn("http:", html.replace("http-equiv", ""))

    def test_wrong_requests_are_one_line(self):
        self.assertEqual(self.sweep("--data", self.demos).returncode, 0)
        text = self.plan.read_text()
        (self.folder / "way").mkdir()
        (self.folder / "way/units").write_text("")
        self.assertOneLine(program.oted("submit", self.plan, "--engine", "local", "--quiet", "--out", self.folder / "way"),
                           program.DATA_OR_MODEL, "way/units' is no folder")
        (self.folder / "edited.jsonl").write_text(text.replace("Hopper-v5", "Hopper-v4"))
        (self.folder / "other.jsonl").write_text(text.replace('"version":"', '"version":"0.0.'))
        for words, code, named in ((("unit", self.plan, "--index", "1"), program.USAGE, "units 0 to 0"),
                                   (("unit", self.folder / "edited.jsonl", "--index", "0"), program.DATA_OR_MODEL, "as it was written"),
                                   (("plan", "status", self.folder / "other.jsonl"), program.USAGE, "was written by oted"),
                                   (("merge", self.folder / "none.jsonl"), program.DATA_OR_MODEL, "none.jsonl"),
                                   (("submit", self.plan, "--engine", "pbs"), program.USAGE, "slurm"),
                                   (("plan", "table1", "--to", self.folder / "x.jsonl", "--data", self.folder), program.DATA_OR_MODEL,
                                    "does not exist")):
            self.assertRefused(program.oted(*words), code, named)
        for words, named in ((("--vary", "window"), "wanted section.key=value"), (("--vary", "design.windows=4"), "windows"),
                             (("--data", self.folder / "none.hdf5"), "none.hdf5")):
            code = program.DATA_OR_MODEL if words[0] == "--data" else program.USAGE
            data = () if words[0] == "--data" else ("--data", self.demos)
            self.assertRefused(self.sweep(*words, *data, to=self.folder / "y.jsonl"), code, named)
        self.assertRefused(self.sweep(to=self.folder / "y.jsonl"), program.USAGE, "no data are named")


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
