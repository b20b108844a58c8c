"""Faults and damage: what the program promises (docs/reliability.md); test_hostile.py has signals and hostile input.

    test_faults.py PATH/TO/oted PATH/TO/liboted_fault_points.so [TestClass.test_name ...]
"""

import hashlib
import importlib.metadata
import json
import os
import pathlib
import re
import resource
import shutil
import subprocess
import tempfile
import time
import unittest

import program
from program import DATA_OR_MODEL, FRICTION, GRAVITY, NO_SIMULATOR, TINY, USAGE, ProgramTest, oted, sets

LIBRARY = None
UNEQUAL = ("events.out.tfevents", "versions.json", "report.json", "report.html")


def flip(path, at=None):
    content = bytearray(path.read_bytes())
    content[len(content) // 2 if at is None else at] ^= 0x10
    path.write_bytes(content)


def write_sealed(path, record):
    """As the program does, of a record without fractions."""
    text = json.dumps(record, sort_keys=True, separators=(",", ":"))
    path.write_text(json.dumps({**record, "seal": hashlib.sha256(text.encode()).hexdigest()}))


class RunTest(ProgramTest):
    """With a finished run of seconds, made once, and a copy of it for each test."""

    @classmethod
    def setUpClass(cls):
        cls.shared = pathlib.Path(tempfile.mkdtemp(prefix="oted-faults-"))
        cls.addClassCleanup(shutil.rmtree, cls.shared)
        cls.demos = cls.shared / "demos.hdf5"
        program.log_hopper(cls.demos, 4)
        cls.finished = cls.shared / "finished"
        result = oted(*cls.words(cls.finished))
        assert result.returncode in (0, NO_SIMULATOR), result.stderr

    @classmethod
    def words(cls, out, *more, verb="run"):
        settings = program.by_transitions(TINY) + ["selection.n_seeds=1"]
        return [verb, "--task", "Hopper-v5", "--data", str(cls.demos), "--param", FRICTION, "--param", GRAVITY, "--truth",
                "friction=0.6", "--truth", "gravity=1.2", "--threads", "1", "--out", str(out), *sets(settings), *more]

    def setUp(self):
        super().setUp()
        shutil.copytree(self.finished, self.out)

    def again(self, *more, verb="run"):
        return oted(*self.words(self.out, *more, verb=verb))

    def results(self, out):
        return {str(p.relative_to(out)): p.read_bytes() for p in out.rglob("*") if p.is_file() and not p.name.startswith(UNEQUAL)
                and p.parent.name != "export"}  # which a command of its own writes

    def assertAsFinished(self):
        wanted, got = self.results(self.finished), self.results(self.out)
        self.assertEqual(sorted(got), sorted(wanted))
        for name, content in wanted.items():
            if name != "run.toml":
                self.assertEqual(got[name], content, name)
        self.assertEqual(oted("verify", self.out).returncode, 0)


class TestStreams(RunTest):
    def run_with(self, redirection, *words):
        command = " ".join(f"'{word}'" for word in [program.OTED, *map(str, words)])
        return subprocess.run(["bash", "-c", f"{command} {redirection}"], capture_output=True, text=True, timeout=300)

    def test_standard_error_that_takes_nothing_or_is_closed_changes_no_result(self):
        for redirection in ("2>/dev/full", "2>&-", "<&- 2>&-"):
            shutil.rmtree(self.out)
            result = self.run_with(redirection, *self.words(self.out))
            self.assertIn(result.returncode, (0, NO_SIMULATOR), redirection)
            self.assertAsFinished()

    def test_standard_output_that_takes_nothing_is_an_error_and_the_results_stay(self):
        for redirection in (">/dev/full", ">&-"):
            for more in ([], ["--json"]):
                result = self.run_with(redirection, *self.words(self.out, *more))
                self.assertEqual(result.returncode, DATA_OR_MODEL, redirection)
                self.assertRegex(result.stderr, r"\A(warning: not exported: [^\n]+\n)?oted: cannot write to standard output: [^\n]+\n\Z")
        self.assertEqual(self.run_with(">/dev/full", "--help").returncode, DATA_OR_MODEL)
        # A reader that has gone is told nothing.
        read_end, write_end = os.pipe()
        os.close(read_end)
        gone = subprocess.run([program.OTED, "--help"], stdout=write_end, stderr=subprocess.PIPE, text=True)
        os.close(write_end)
        self.assertEqual((gone.returncode, gone.stderr), (DATA_OR_MODEL, ""))
        self.assertAsFinished()


class TestDamage(RunTest):
    def test_what_can_be_written_again_is(self):
        for name in ("policy.onnx", "agents/1/policy.onnx"):
            (self.out / name).write_bytes(b"")
        result = self.again()
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        self.assertIn("agents/1/policy.onnx' is damaged and is written again", result.stderr)
        self.assertAsFinished()

    def test_a_stage_with_a_damaged_file_is_made_again_and_proves_to_be_the_same(self):
        for name in ("clone/policy.npz", "design/default/1/discriminator.npz", "agents/1/policy.npz", "clone/clone.json",
                     "design/default/1/prediction.json"):
            flip(self.out / name) if name.endswith("npz") else (self.out / name).write_text('{"schema"')
            self.assertEqual(oted("verify", self.out).returncode, DATA_OR_MODEL)
            result = self.again()
            self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
            self.assertIn(f"{name}' is damaged", result.stderr)
            self.assertAsFinished()

    def test_an_empty_record_in_the_place_of_one_is_damage(self):
        for name in ("design/default/1/q.json", "clone/clone.json"):
            (self.out / name).write_text("{}")
            result = oted("verify", self.out)
            self.assertEqual(result.returncode, DATA_OR_MODEL)
            self.assertRegex(result.stdout, f"damaged +{name}: ")
            shutil.copy(self.finished / name, self.out / name)

    def test_a_record_without_its_seal_is_damage(self):
        for path in sorted(self.out.rglob("*.json")):
            name = str(path.relative_to(self.out))
            if name == "export/q.json":
                continue  # export.json speaks for it
            whole = path.read_text()
            for text in (json.dumps({key: value for key, value in json.loads(whole).items() if key != "seal"}), "null", "[]"):
                path.write_text(text)
                result = oted("verify", self.out)
                self.assertEqual(result.returncode, DATA_OR_MODEL, name)
                self.assertRegex(result.stdout, f"damaged +{name}: ")
            path.write_text(whole)

    def test_a_changed_record_is_refused_with_its_name_by_every_reader(self):
        for name, field in (("design/default/1/q.json", "mean"), ("design.json", "score"), ("agents/1/agent.json", "eval_return")):
            record = json.loads((self.finished / name).read_text())
            record[field] = [0.123, 0.2] if field == "mean" else 0.123
            (self.out / name).write_text(json.dumps(record))
            for command in (self.words(self.out), ["report", self.out], ["export", self.out], ["verify", self.out]):
                if name.startswith("agents") and command[0] == "export":
                    continue  # which does not read it
                result = oted(*command)
                self.assertEqual(result.returncode, DATA_OR_MODEL, command[0])
                self.assertIn(name, result.stderr + result.stdout)
            shutil.copy(self.finished / name, self.out / name)
        self.assertAsFinished()

    def test_a_result_of_another_predecessor_is_refused(self):
        # Whole and sealed, but of another seed: what was made from the first one does not fit it.
        other = self.folder / "other"
        self.assertIn(oted(*self.words(other, "--seed", "2", verb="design")).returncode, (0, NO_SIMULATOR))
        for name in ("q.json", "discriminator.npz", "curves.csv"):
            shutil.copy(other / "design/default/1" / name, self.out / "design/default/1" / name)
        result = oted("verify", self.out)
        self.assertEqual(result.returncode, DATA_OR_MODEL)
        self.assertIn("was made from another 'design/default/1/q.json'", result.stdout)
        self.assertOneLine(oted("report", self.out, "--to", self.folder / "report"), DATA_OR_MODEL, "was made from another")

    def test_data_of_another_run_beside_a_design_are_told(self):
        other = self.folder / "other"
        data = self.folder / "other.hdf5"
        program.log_hopper(data, 3)
        words = [data if word == str(self.demos) else word for word in self.words(other, verb="design")]
        self.assertIn(oted(*words).returncode, (0, NO_SIMULATOR))
        shutil.copy(other / "dataset.json", self.out / "dataset.json")
        result = oted("verify", self.out)
        self.assertEqual(result.returncode, DATA_OR_MODEL)
        self.assertIn("of other data than 'design.json'", result.stdout)
        self.assertOneLine(oted("report", self.out, "--to", self.folder / "report"), DATA_OR_MODEL, "dataset.json")

    def test_what_is_no_file_in_the_place_of_one_is_damage(self):
        for name in ("run.toml", "dataset.json", "export/export.json"):
            for make in (os.mkdir, os.mkfifo, lambda path: os.symlink("/dev/zero", path)):
                path = self.out / name
                path.unlink(missing_ok=True)
                path.parent.mkdir(exist_ok=True)
                make(path)
                result = oted("verify", self.out)
                self.assertEqual(result.returncode, DATA_OR_MODEL, name)
                self.assertRegex(result.stdout, f"damaged +{name}: ")
                path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()
            if (self.finished / name).exists():
                shutil.copy(self.finished / name, path)

    def test_a_changed_run_toml_is_refused_until_it_is_named(self):
        text = (self.out / "run.toml").read_text()
        (self.out / "run.toml").write_text(text.replace("threads = 1", "threads = 2"))
        for command in ("run", "report", "export"):
            self.assertOneLine(oted(command, "--out", self.out), DATA_OR_MODEL, "run.toml")
        result = oted("run", self.out / "run.toml", "--out", self.out, "--data", self.demos)
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        self.assertAsFinished()

    def assertNotReadAlone(self, *needles):
        """What reads the run without making it refuses it, and names the file."""
        for command in (["report", self.out], ["export", self.out], ["validate", self.out, "--data", self.demos]):
            self.assertOneLine(oted(*command), DATA_OR_MODEL, *needles)
        self.assertEqual(oted("verify", self.out).returncode, DATA_OR_MODEL)

    def test_a_record_without_its_seal_is_read_by_nothing(self):
        for name in ("design.json", "design/default/1/q.json", "evaluation.json", "agents/1/agent.json"):
            path = self.out / name
            whole = path.read_text()
            record = json.loads(whole)
            del record["seal"]
            path.write_text(json.dumps(record))
            self.assertNotReadAlone(name, "no seal")
            path.write_text(whole)

    def test_a_run_toml_of_another_run_is_noticed(self):
        head, text = (self.out / "run.toml").read_text().split("\n", 1)
        for old, new in (("seed = 1 ", "seed = 2 "), ("range = [0.2,", "range = [0.3,"), ('episodes = "all"', "episodes = 1")):
            self.assertIn(old, text)
            other = text.replace(old, new, 1)
            new_head = re.sub("[0-9a-f]{64}", hashlib.sha256(other.encode()).hexdigest(), head)
            (self.out / "run.toml").write_text(new_head + "\n" + other)
            self.assertNotReadAlone("run.toml", "another task, seed")

    def test_what_a_design_tells_of_is_missed(self):
        for name in ("run.toml", "dataset.json"):
            whole = (self.out / name).read_bytes()
            (self.out / name).unlink()
            self.assertNotReadAlone(name, "missing")
            (self.out / name).write_bytes(whole)

    def test_a_design_that_is_gone_is_missed_by_what_was_made_from_it(self):
        (self.out / "design.json").unlink()
        for words in (["report", self.out], ["verify", self.out]):
            result = oted(*words)
            self.assertEqual(result.returncode, DATA_OR_MODEL, result.stderr)
            self.assertIn("design.json", result.stdout + result.stderr)
        self.assertOneLine(oted("report", self.folder / "none"), USAGE, "is no folder")

    def test_of_what_does_not_fit_together_the_foreign_record_is_named(self):
        other = self.folder / "other"
        oted(*self.words(other, "--seed", "2"))
        shutil.copyfile(other / "design.json", self.out / "design.json")
        for words in (["report", self.out], ["export", self.out]):
            self.assertOneLine(oted(*words), DATA_OR_MODEL, "'" + str(self.out / "design.json") + "' is damaged")
        told = [line for line in oted("verify", self.out).stdout.splitlines() if line.startswith("damaged")]
        self.assertEqual(len(told), 1, told)
        self.assertIn("design.json", told[0])
        self.assertOneLine(self.again("--quiet"), USAGE, "remove '" + str(self.out / "design.json") + "'")

    def test_the_report_shows_no_file_from_elsewhere(self):
        (self.folder / "secret").write_text("a secret")
        folder = self.out / "motion"
        folder.mkdir(exist_ok=True)
        for name in ("/etc/passwd", "../../secret", "..", ""):
            write_sealed(folder / "motion.json", {"schema": "oted.motion/1", "panels": [{"name": "logged", "file": name}]})
            self.assertOneLine(oted("report", self.out), DATA_OR_MODEL, "motion.json")

    def test_a_record_nested_without_end_is_refused(self):
        for text in ("[" * 60000, "[" * 60000 + "]" * 60000, '{"a":' * 60000):
            (self.out / "design.json").write_text(text)
            for command in (["report", self.out], ["verify", self.out]):
                result = oted(*command)
                self.assertEqual(result.returncode, DATA_OR_MODEL, result.stderr)
                self.assertIn("design.json", result.stderr + result.stdout)

    def test_a_damaged_checkpoint_and_damaged_curves_are_noticed(self):
        shutil.rmtree(self.out)
        words = self.words(self.out)
        words[words.index("sac.n_steps=200")] = "sac.n_steps=600"
        child = subprocess.Popen([program.OTED, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        checkpoint = self.out / "agents/1/checkpoint.npz"
        while child.poll() is None and not checkpoint.exists():
            time.sleep(0.002)
        child.kill()
        child.wait()
        if not checkpoint.exists():
            self.skipTest("the run was over before it could be killed")
        whole = checkpoint.read_bytes()
        for at in (10, len(whole) // 3, len(whole) // 2, len(whole) - 5):
            flip(checkpoint, at)
            self.assertOneLine(oted(*words, "--quiet", "--json"), DATA_OR_MODEL, "checkpoint.npz",
                               f"remove '{checkpoint.parent}' to begin its work anew")
            checkpoint.write_bytes(whole)
        curves = self.out / "agents/1/curves.csv"
        flip(curves)
        self.assertOneLine(oted("report", self.out), DATA_OR_MODEL, "curves.csv")
        result = oted(*words)
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        self.assertIn("curves.csv.damaged", result.stderr)


class TestDirectory(RunTest):
    def test_records_name_the_version_of_mujoco_that_is_loaded(self):
        wanted = importlib.metadata.version("mujoco")
        self.assertEqual(json.loads((self.out / "versions.json").read_text())["mujoco"], wanted)
        self.assertEqual(json.loads((self.out / "design.json").read_text())["versions"]["mujoco"], wanted)

    def test_two_programs_do_not_work_in_one_directory(self):
        shutil.rmtree(self.out)
        words = self.words(self.out)
        words[words.index("sac.n_steps=200")] = "sac.n_steps=100000"
        first = subprocess.Popen([program.OTED, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(first.wait)
        self.addCleanup(first.kill)
        while not (self.out / "dataset.json").exists():
            time.sleep(0.01)
        self.assertOneLine(oted(*words, "--quiet"), USAGE, f"process {first.pid} on ", "choose another --out")
        self.assertIn(oted("report", self.out).returncode, (0, NO_SIMULATOR), "a run can be looked at while it works")
        first.kill()
        first.wait()
        # The lock of a program that died holds nobody up, and what it left half-written goes.
        left = self.out / "clone/policy.npz.oted-tmp-0123abcd-99-5-1"
        left.parent.mkdir(exist_ok=True)
        left.write_text("half")
        self.assertIn(self.again(verb="clone").returncode, (0, NO_SIMULATOR))
        self.assertFalse(left.exists())
        self.assertFalse((self.out / ".lock").exists())

    @unittest.skipIf(os.geteuid() == 0 and not shutil.which("setpriv"), "root may write everywhere")
    def test_a_run_that_cannot_be_written_to_can_be_read(self):
        prefix = []
        if os.geteuid() == 0:  # as somebody who may not write there
            prefix = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
        target = self.folder / "elsewhere"
        target.mkdir()
        target.chmod(0o777)
        self.folder.chmod(0o755)
        for path in [self.out, *self.out.rglob("*")]:
            path.chmod(0o555 if path.is_dir() else 0o444)
        self.addCleanup(lambda: [p.chmod(0o755) for p in [self.out, *self.out.rglob("*")]])
        before = self.results(self.out)
        for command in (["verify", self.out], ["report", self.out, "--to", target],
                        ["export", self.out, "--q", target / "q.json", "--mjcf", target / "m.xml"]):
            result = subprocess.run([*prefix, program.OTED, *map(str, command)], capture_output=True, text=True)
            self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        self.assertEqual(sorted(p.name for p in target.iterdir()), ["m.xml", "q.json", "report.html", "report.json"])
        self.assertEqual(self.results(self.out), before)

    def test_the_curves_of_a_stopped_run_are_those_of_one_that_was_not(self):
        shutil.rmtree(self.out)
        for seconds in (0.5, 0.9, 1.3):
            child = subprocess.Popen([program.OTED, *self.words(self.out)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(seconds)
            child.kill()
            child.wait()
        self.again()
        self.assertAsFinished()

    def test_a_sync_that_fails_and_a_full_disk_are_errors_and_nothing_is_lost(self):
        for fault in ("3 ioerror", "30 nospace", "41 ioerror"):
            shutil.rmtree(self.out)
            environment = {**os.environ, "LD_PRELOAD": LIBRARY, "OTED_FAULT_FOLDER": str(self.out), "OTED_FAULT": fault}
            result = subprocess.run([program.OTED, *self.words(self.out), "--quiet"], capture_output=True, text=True, env=environment)
            self.assertOneLine(result, DATA_OR_MODEL, str(self.out))
            self.again()
            self.assertAsFinished()

    def test_open_files_do_not_grow_with_seeds_and_agents(self):
        shutil.rmtree(self.out)
        words = [{"selection.n_seeds=1": "selection.n_seeds=12", "agents.n_agents=1": "agents.n_agents=8"}.get(w, w)
                 for w in self.words(self.out)]
        result = subprocess.run([program.OTED, *words, "--quiet"], capture_output=True, text=True,
                                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (24, 24)))
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)

    def test_a_lock_that_is_written_in_parts_is_no_error(self):
        shutil.rmtree(self.out)
        for n in range(3, 5):  # the lock is the first file that is written
            environment = {**os.environ, "LD_PRELOAD": LIBRARY, "OTED_FAULT_FOLDER": str(self.out), "OTED_FAULT": f"{n} short"}
            result = subprocess.run([program.OTED, *self.words(self.out, verb="clone"), "--quiet"], capture_output=True, text=True,
                                    env=environment)
            self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)

    def test_limits_of_memory_and_of_file_size_end_in_an_error(self):
        def under(which, most, *words):
            return subprocess.run([program.OTED, *map(str, words)], capture_output=True, text=True,
                                  preexec_fn=lambda: resource.setrlimit(which, (most, most)))
        oted("report", self.out)
        report = (self.out / "report.json").read_bytes()
        self.assertOneLine(under(resource.RLIMIT_FSIZE, 5000, "report", self.out), DATA_OR_MODEL, "report.html", "File too large")
        self.assertEqual((self.out / "report.json").read_bytes(), report)
        shutil.rmtree(self.out)
        self.assertOneLine(under(resource.RLIMIT_FSIZE, 5000, *self.words(self.out, "--quiet")), DATA_OR_MODEL, "File too large")
        self.again()
        self.assertAsFinished()
        shutil.rmtree(self.out)
        self.assertOneLine(under(resource.RLIMIT_NOFILE, 6, *self.words(self.out, "--quiet")), DATA_OR_MODEL, "ulimit -n")
        self.again()
        self.assertAsFinished()
        for name in ("log.hdf5", "log-v0"):  # libhdf5 writes both
            result = under(resource.RLIMIT_FSIZE, 1000, "data", "convert", self.demos, self.folder / name)
            self.assertOneLine(result, DATA_OR_MODEL, name, "File too large")
            self.assertEqual([path.name for path in self.folder.glob("log*")], [])
        path = self.folder / "large.csv"
        path.write_bytes(b"obs_0,action_0\n" + b"0,0\n" * (8 << 20))
        self.assertOneLine(under(resource.RLIMIT_AS, 400 << 20, "data", "info", path), DATA_OR_MODEL, "not enough memory")


if __name__ == "__main__":
    LIBRARY = program.take_paths(__doc__, 1)[0]
    unittest.main()
