"""The program as a user meets it: exit codes, nothing half-written, stopping and going on.

    test_cli.py PATH/TO/oted [TestClass.test_name ...]
"""

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import time
import unittest

import numpy as np

import program
from program import (DATA_OR_MODEL, FLOOR, FRICTION, GRAVITY, INTERRUPTED, NO_SIMULATOR, TINY, USAGE, HopperTest,
                     files_below, oted, sets)


class TestMotion(HopperTest):
    def test_without_opengl_a_run_ends_well_and_the_page_says_why(self):
        os.environ["MUJOCO_GL"] = "off"
        self.addCleanup(os.environ.pop, "MUJOCO_GL")
        result = self.design("--set", "report.motion=auto", "--set", "report.replay_steps=5")
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        self.assertIn("No pictures of the motion: MUJOCO_GL=off", (self.out / "report.html").read_text())
        shutil.rmtree(self.out)
        self.assertRefused(self.design("--set", "report.motion=true"), USAGE, "report.motion", "MUJOCO_GL=off")


class TestOutput(HopperTest):
    def test_a_file_in_the_way(self):
        self.out.write_text("mine")
        self.assertOneLine(self.design(), DATA_OR_MODEL, str(self.out), "choose another place")
        self.assertEqual(self.out.read_text(), "mine")
        self.assertOneLine(self.design(out=self.out / "below"), DATA_OR_MODEL, str(self.out))

    def test_an_error_stays_a_line_that_can_be_read(self):
        result = oted("data", "info", "é" * 50_000)
        self.assertRegex(result.stderr, r"\Aoted: [^\n]+\n\Z")
        self.assertLess(len(result.stderr), 3000)
        self.assertIn("check the path", result.stderr)

    def test_a_folder_where_a_file_belongs(self):
        (self.out / "run.toml").mkdir(parents=True)
        result = oted("run", "--task", "Hopper-v5", "--data", self.demos, "--param", FRICTION, "--out", self.out)
        self.assertOneLine(result, DATA_OR_MODEL, "run.toml")

    def test_no_name(self):
        result = oted("design", "--task", "Hopper-v5", "--data", self.demos, "--param", FRICTION, "--out", "",
                      cwd=self.folder)
        self.assertOneLine(result, USAGE, "--out")
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_report_of_nothing(self):
        result = oted("report", "--out", self.folder / "nothing")
        self.assertIn(result.returncode, (USAGE, DATA_OR_MODEL))
        self.assertRegex(result.stderr, r"\Aoted: [^\n]+\n\Z")
        self.assertFalse((self.folder / "nothing").exists())

    def test_other_settings_leave_the_directory_as_it_was(self):
        self.assertEqual(oted("clone", *self.words()).returncode, 0)
        before = files_below(self.out)
        self.assertOneLine(oted("clone", *self.words(), "--seed", "2"), USAGE, "clone.json", "choose another --out")
        self.assertEqual(files_below(self.out), before)

    def words(self):
        return ["--task", "Hopper-v5", "--data", self.demos, "--param", FRICTION, "--out", self.out, *sets(TINY)]

    def test_the_clone_by_valuedice_is_recorded_and_equal_at_any_number_of_threads(self):
        settings = ["clone.method=valuedice", "clone.valuedice_updates=30", "clone.valuedice_batch=16",
                    "clone.valuedice_hidden=16"]
        self.assertEqual(oted("clone", *self.words(), *sets(settings), "--threads", "1").returncode, 0)
        record = json.loads((self.out / "clone/clone.json").read_text())
        self.assertEqual(record["method"], "valuedice")
        self.assertNotIn("choice", record)
        self.assertIn("ValueDICE", (self.out / "report.html").read_text())
        first = (self.out / "clone/policy.npz").read_bytes()
        shutil.rmtree(self.out)
        self.assertEqual(oted("clone", *self.words(), *sets(settings), "--threads", "2").returncode, 0)
        self.assertEqual((self.out / "clone/policy.npz").read_bytes(), first)

    def test_auto_says_which_clone_it_took_and_why(self):
        settings = ["clone.method=auto", "clone.valuedice_updates=10", "clone.valuedice_batch=16",
                    "clone.valuedice_hidden=16", "clone.valuedice_start=random"]
        self.assertEqual(oted("clone", *self.words(), *sets(settings)).returncode, 0)
        record = json.loads((self.out / "clone/clone.json").read_text())
        self.assertIn(record["method"], ("bc", "valuedice"))
        for method in ("bc", "valuedice"):
            self.assertGreater(record["choice"][method]["closeness"], 0)
        self.assertIn("nominal simulator", record["choice"]["reason"])
        self.assertIn("Chosen by evidence", (self.out / "report.html").read_text())

    def test_a_prior_by_beliefs_and_by_an_earlier_run_enters_q_and_the_fingerprint(self):
        words = self.words()
        words[words.index(FRICTION)] = FRICTION + ":prior=0.5,0.05"
        self.assertOneLine(oted("design", *words), USAGE, "friction", "design.prior")
        self.assertFalse(self.out.exists())
        self.assertIn(oted("design", *words, "--set", "design.prior=gaussian").returncode, (0, NO_SIMULATOR))
        q = json.loads((self.out / "design/default/1/q.json").read_text())
        self.assertAlmostEqual(q["prior"]["mean"][0], np.log((0.5 - 0.2) / (2.0 - 0.5)), places=9)
        self.assertIn("prior = { mean = 0.5, std = 0.05 }", (self.out / "run.toml").read_text())
        # The same run directory goes on from its own run.toml.
        before = (self.out / "design/default/1/q.json").stat().st_mtime_ns
        self.assertIn(oted("design", "--out", self.out).returncode, (0, NO_SIMULATOR))
        self.assertEqual((self.out / "design/default/1/q.json").stat().st_mtime_ns, before)

        first = self.folder / "first"
        self.out.rename(first)
        words = self.words() + ["--set", f"design.prior={first}"]
        self.assertIn(oted("design", *words).returncode, (0, NO_SIMULATOR))
        again = json.loads((self.out / "design/default/1/q.json").read_text())
        modes = [json.loads((first / f"design/default/{seed}/q.json").read_text())["mean"][0] for seed in (1, 2)]
        self.assertAlmostEqual(again["prior"]["mean"][0], np.mean(modes), places=9)
        self.assertIn(oted("design", "--out", self.out).returncode, (0, NO_SIMULATOR))
        # Another content of the same path is another design.
        changed = first / "design/default/1/q.json"
        content = changed.read_text()
        changed.write_text(json.dumps({**json.loads(content), "mean": [0.123]}))
        self.assertOneLine(oted("design", "--out", self.out), DATA_OR_MODEL, str(changed))
        program.edit_record(changed, lambda record: record.update(mean=[0.123]))
        self.assertOneLine(oted("design", "--out", self.out), USAGE, "design/default/1", "design.json")

    def test_joint_training_leaves_a_clone_of_each_seed(self):
        words = self.words() + sets(["design.method=paper", "design.adversarial.horizon=20", "design.adversarial.n_steps=20",
                                     "design.adversarial.clone_updates=2"])
        self.assertIn(oted("design", *words).returncode, (0, NO_SIMULATOR))
        common = (self.out / "clone/policy.npz").read_bytes()
        clones = [(self.out / f"design/default/{seed}/policy.npz").read_bytes() for seed in (1, 2)]
        self.assertEqual(len({common, *clones}), 3)
        self.assertOneLine(oted("design", *words, "--set", "design.method=trajectories"), USAGE, "clone_updates")

    def test_valuedice_of_discrete_actions_is_a_usage_error(self):
        data = pathlib.Path(__file__).resolve().parents[2] / "examples/data/minigrid-expert.hdf5"
        result = oted("clone", pathlib.Path(__file__).resolve().parents[2] / "examples/minigrid.toml", "--data", data, "--out",
                      self.out, "--set", "clone.method=valuedice")
        self.assertOneLine(result, USAGE, "clone.method", "bc")


class TestResult(HopperTest):
    def test_json_on_stdout_and_progress_on_stderr(self):
        result = self.design("--json")
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        printed = json.loads(result.stdout)
        self.assertEqual(printed["design"], json.loads((self.out / "design.json").read_text()))
        self.assertEqual(printed["design"]["schema"], "oted.design/1")
        self.assertEqual([p["name"] for p in printed["design"]["parameters"]], ["friction", "gravity"])
        self.assertIn("design", result.stderr)
        self.assertIn("100%", result.stderr)

        again = self.design("--json")
        self.assertEqual(json.loads(again.stdout), printed)
        self.assertEqual(again.stderr, "", "nothing is left to do, so there is no progress")

    def test_table_and_quiet(self):
        result = self.design("--quiet")
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        self.assertEqual(result.stderr, "")
        self.assertIn("friction", result.stdout)
        self.assertIn("verdict:", result.stdout)
        self.assertIn(str(self.out / "report.html"), result.stdout)
        self.assertNotIn("█", result.stdout)

    def test_the_whole_run(self):
        config = self.folder / "tiny.toml"
        config.write_text(f'[task]\nname = "Hopper-v5"\n[data]\npath = "{self.demos}"\nepisodes = 4\n[parameters]\n'
                          'friction = { field = "geom/*/friction[0]", range = [0.2, 2.0] }\n[truth]\nfriction = 0.6\n')
        result = oted("run", config, "--out", self.out, *sets(TINY))
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        for name in ("run.toml", "versions.json", "dataset.json", "clone/policy.npz", "clone/clone.json",
                     "clone/curves.csv", "design/default/1/q.json", "design/default/2/q.json",
                     "design/default/1/curves.csv", "design.json", "agents/1/policy.npz", "agents/1/agent.json",
                     "agents/1/curves.csv", "agents/1/policy.onnx", "nominal/1/policy.npz", "nominal/1/policy.onnx",
                     "policy.onnx", "policy_selection.json", "evaluation.json",
                     "report.html", "report.json"):
            self.assertTrue((self.out / name).is_file(), name)
        self.assertTrue(list(self.out.glob("design/default/1/events.out.tfevents.*")))
        leftovers = [n for n in files_below(self.out) if ".oted-tmp-" in n or "checkpoint" in n]
        self.assertEqual(leftovers, [])
        for word in ("random actions", "clone of the logs", "nominal simulator", "OTED-SAC"):
            self.assertIn(word, result.stdout)
        self.assertEqual(json.loads((self.out / "dataset.json").read_text())["n_episodes"], 4)
        versions = json.loads((self.out / "versions.json").read_text())
        self.assertEqual(set(versions), {"oted", "mujoco", "cpu", "command", "started", "seal"})

        # Whatever can be set is explained.
        described = oted("run", "--help").stdout
        for section in set(re.findall(r"(?m)^\[(\w+)", (self.out / "run.toml").read_text())) - {"parameters", "truth"}:
            self.assertIn(f"\n[{section}]\n", described)

        # A later verb needs nothing but the directory, and finds nothing to do.
        before = files_below(self.out)
        again = oted("select-policy", "--out", self.out)
        self.assertIn(again.returncode, (0, NO_SIMULATOR), again.stderr)
        self.assertEqual(again.stderr, "")
        after = files_below(self.out)
        changed = {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
        self.assertLessEqual(changed, {"versions.json", "report.html", "report.json"})

    def test_an_algorithm_on_the_command_line_takes_the_place_of_the_files_and_of_its_settings(self):
        config = self.folder / "sac.toml"
        config.write_text("[sac]\nn_starts = 1\n[agents]\nalgorithm = 'sac'\n")
        words = ["--config", config, *sets(program.TINY_DESIGN), "--set", "agents.algorithm=crossq"]
        result = self.design(*words, settings=[])
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        self.assertIn('algorithm = "crossq"', (self.out / "run.toml").read_text())
        self.assertOneLine(self.design(*words, "--set", "sac.tau=0.1", settings=[], out=self.folder / "other"), USAGE,
                           "sac.tau is set")

    def test_without_strict_a_parameter_without_effect_is_a_warning_and_not_identified(self):
        result = self.design("--json", "--set", "design.adversarial.n_iterations=1", parameters=(GRAVITY, FLOOR))
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        warnings = [line for line in result.stderr.splitlines() if line.startswith("warning:")]
        self.assertEqual(len(warnings), 1, result.stderr)
        self.assertIn("'floor'", warnings[0])
        design = json.loads(result.stdout)["design"]
        verdicts = {p["name"]: p["verdict"] for p in design["parameters"]}
        self.assertEqual(verdicts["floor"], "not_identified")
        self.assertEqual(result.returncode, NO_SIMULATOR if design["verdict"] in ("outside_family", "undecided") else 0)
        required = self.design("--require-identified", "--set", "design.adversarial.n_iterations=1", parameters=(GRAVITY, FLOOR))
        self.assertEqual(required.returncode, NO_SIMULATOR, required.stderr)

    def test_help_has_units_and_defaults(self):
        top = oted("--help")
        self.assertEqual(top.returncode, 0)
        for verb in ("run", "clone", "design", "select-simulator", "train", "select-policy", "evaluate", "report",
                     "collect"):
            self.assertRegex(top.stdout, rf"(?m)^\s+{verb}\b")
            text = oted(verb, "--help")
            self.assertEqual((text.returncode, text.stderr), (0, ""), verb)
            self.assertIn("--out", text.stdout)
        self.assertIn("[default:", oted("design", "--help").stdout)
        for section in ("agents", "crossq", "sac", "ppo"):
            self.assertIn(f"\n[{section}]\n", oted("train", "--help").stdout)
        self.assertRegex(oted("--version").stdout, r"\Aoted \d+\.\d+\.\d+\n\Z")


class TestStopping(HopperTest):
    LONG = program.by_transitions(TINY) + ["design.adversarial.n_iterations=120", "design.adversarial.n_sims=16"]

    def test_ctrl_c_and_the_same_command_again(self):
        command = [program.OTED, "design", "--task", "Hopper-v5", "--data", self.demos, "--param", FRICTION, "--param", GRAVITY,
                   "--threads", "2", *sets(self.LONG), "--out"]
        whole = oted(*command[1:], self.folder / "whole")
        self.assertIn(whole.returncode, (0, NO_SIMULATOR), whole.stderr)

        process = subprocess.Popen([*command, self.out], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + 60
        while not list(self.out.glob("design/*/*/checkpoint.npz")) and time.monotonic() < deadline:
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGINT)  # as `timeout` does, to the program and to its group
        printed, told = process.communicate(timeout=60)
        self.assertEqual(process.returncode, INTERRUPTED, told)
        self.assertEqual(printed, "")
        self.assertRegex(told.splitlines()[-1], r"^oted: interrupted; .*same command")
        self.assertFalse((self.out / "design.json").exists())
        self.assertTrue(list(self.out.glob("design/*/*/checkpoint.npz")))
        self.assertEqual([n for n in files_below(self.out) if ".oted-tmp-" in n], [])

        # Other settings would mix two designs.
        before = files_below(self.out)
        mixed = oted(*command[1:], self.out, "--set", "design.adversarial.lambda=0.5")
        self.assertOneLine(mixed, USAGE, "choose another --out")
        self.assertEqual(files_below(self.out), before)

        again = oted(*command[1:], self.out)
        self.assertEqual(again.returncode, whole.returncode, again.stderr)
        self.assertEqual((self.out / "design.json").read_text(), (self.folder / "whole" / "design.json").read_text())
        self.assertEqual([n for n in files_below(self.out) if "checkpoint" in n], [])
        for seed in ("1", "2"):
            curves = [(f / "design" / "default" / seed / "curves.csv").read_text()
                      for f in (self.out, self.folder / "whole")]
            self.assertEqual(curves[0], curves[1], "the curve has each iteration once")


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
