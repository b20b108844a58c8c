"""Data, requests and configurations that are wrong: one line that says what, and nothing written.

    test_refusals.py PATH/TO/oted [TestClass.test_name ...]
"""

import pathlib
import shutil
import subprocess
import time
import unittest

import numpy as np

import program
from program import (DATA_OR_MODEL, FLOOR, FRICTION, GRAVITY, TINY, USAGE, HopperTest, oted, read_hdf5, sets,
                     write_hdf5)


class TestData(HopperTest):
    def test_missing_file(self):
        self.assertRefused(self.design(data="no/such.hdf5"), DATA_OR_MODEL, "no/such.hdf5", "check the path")

    def test_folder(self):
        self.assertRefused(self.design(data=self.folder), DATA_OR_MODEL, str(self.folder))
        (self.folder / "folder.hdf5").mkdir()
        self.assertRefused(self.design(data=self.folder / "folder.hdf5"), DATA_OR_MODEL, "folder.hdf5")

    def test_unknown_ending(self):
        path = self.folder / "demos.mat"
        path.write_text("1,2,3\n")
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "demos.mat", ".hdf5")

    def test_csv_without_the_columns(self):
        path = self.folder / "demos.csv"
        path.write_text("q,act0\n2,3\n")
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "demos.csv", "data.observations", "'q', 'act0'")

    def test_truncated_hdf5(self):
        whole = self.demos.read_bytes()
        for keep in (0.05, 0.5, 0.99):
            path = self.folder / "cut.hdf5"
            path.write_bytes(whole[: int(keep * len(whole))])
            self.assertRefused(self.design(data=path), DATA_OR_MODEL, "cut.hdf5")

    def test_empty_file(self):
        path = self.folder / "empty.hdf5"
        path.write_bytes(b"")
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "empty.hdf5", "not an HDF5 file")

    def test_text_named_hdf5(self):
        path = self.folder / "text.hdf5"
        path.write_text("observations: 1 2 3\n" * 100)
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "text.hdf5", "not an HDF5 file")

    def test_text_named_npz(self):
        path = self.folder / "text.npz"
        path.write_text("observations: 1 2 3\n" * 100)
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "text.npz")

    def test_foreign_hdf5(self):
        path = self.folder / "foreign.hdf5"
        write_hdf5(path, {"images": np.zeros((4, 4)), "labels": np.zeros(4)})
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "foreign.hdf5", "'observations'")

    def test_not_finite(self):
        for name, value in (("observations", np.nan), ("actions", np.inf), ("rewards", -np.inf)):
            arrays = read_hdf5(self.demos)
            arrays[name][7] = value
            path = self.folder / "bad.hdf5"
            write_hdf5(path, arrays)
            self.assertRefused(self.design(data=path), DATA_OR_MODEL, "bad.hdf5", f"{name}[7", "repair")

    def test_lengths_that_disagree(self):
        arrays = read_hdf5(self.demos)
        arrays["actions"] = arrays["actions"][:-3]
        path = self.folder / "short.hdf5"
        write_hdf5(path, arrays)
        self.assertRefused(self.design(data=path), DATA_OR_MODEL, "short.hdf5", "actions")

    def test_wrong_dimensions(self):
        result = self.design(task="HalfCheetah-v5")
        self.assertRefused(result, DATA_OR_MODEL, "11", "17", "HalfCheetah-v5", "name the task")

    def test_more_episodes_than_there_are(self):
        self.assertRefused(self.design("--episodes", "6"), DATA_OR_MODEL, "episode 6", "holds 5", "fewer")

    def test_episodes_that_are_no_count(self):
        for text in ("0", "-1", "many", "3x", "99999999999999999999"):
            self.assertRefused(self.design("--episodes", text), USAGE, text, "or all")

    def test_a_name_that_is_no_text(self):
        path = bytes(self.folder) + b"/\xff.hdf5"
        shutil.copyfile(self.demos, path)
        words = ["design", "--task", "Hopper-v5", "--param", FRICTION, "--out", str(self.out), "--data"]
        result = subprocess.run([program.OTED, *words, path], capture_output=True, timeout=120)
        self.assertEqual(result.returncode, USAGE, result.stderr)
        self.assertRegex(result.stderr, rb"\Aoted: [^\n]+UTF-8[^\n]+\n\Z")
        self.assertFalse(self.out.exists())

    def test_no_data_named(self):
        result = oted("design", "--task", "Hopper-v5", "--param", FRICTION, "--out", self.out)
        self.assertRefused(result, USAGE, "--data")


class TestRequest(HopperTest):
    def test_unknown_verb_and_flag(self):
        self.assertRefused(oted("desing", "--out", self.out), USAGE, "desing", "did you mean 'design'?", "--help")
        self.assertRefused(self.design("--treads", "2"), USAGE, "--treads", "--help")
        self.assertRefused(oted(), USAGE, "--help")
        self.assertRefused(oted("design", "--task", "Hopper-v5"), USAGE, "--out")

    def test_a_flag_that_is_spelt_wrong_gets_the_nearest(self):
        self.assertRefused(oted("run", "--out", self.out, "--sed", "3"), USAGE, "--sed", "did you mean '--seed'?")
        self.assertRefused(oted("data", "info", "a.csv", "--taks=Hopper-v5"), USAGE, "did you mean '--task'?")

    def test_text_without_quotes_in_toml(self):
        config = self.folder / "hopper.toml"
        config.write_text("[task]\nname = Hopper-v5\n")
        self.assertRefused(oted("run", config, "--out", self.out), USAGE, "hopper.toml:2", "text stands in quotes")

    def test_flag_without_number(self):
        self.assertRefused(self.design("--seed", "one"), USAGE, "--seed")
        self.assertRefused(self.design("--seed=-1"), USAGE, "--seed")
        self.assertRefused(self.design("--seed", 20 * "9"), USAGE, "--seed", "below 9.2e+18")
        self.assertRefused(self.design("--seeds", "0"), USAGE, "--seeds")
        for words, wanted in ((["--seeds", "2000000000"], "[0, 10000]"), (["--set", "agents.n_agents=2000000000"], "[1, 10000]")):
            self.assertRefused(self.design(*words), USAGE, "2000000000", wanted)

    def test_unknown_task_with_the_nearest(self):
        self.assertRefused(self.design(task="Hoper-v5"), USAGE, "Hoper-v5", "did you mean 'Hopper-v5'?")
        self.assertRefused(self.design(task="Ant-v5"), USAGE, "Ant-v5", "Hopper-v5")

    def test_unknown_key_and_section(self):
        self.assertRefused(self.design("--set", "design.adversarial.n_iteratons=3"), USAGE, "did you mean 'n_iterations'?")
        self.assertRefused(self.design("--set", "desing.n_iterations=3"), USAGE, "did you mean 'design'?")
        self.assertRefused(self.design("--set", "design.adversarial.n_iterations=0"), USAGE, "n_iterations is 0", "[1, inf)")

    def test_unknown_parameter_path(self):
        for path, needle in (("geom/*/frction[0]", "friction"), ("gem/*/friction[0]", "geom"),
                             ("geom/foot/friction[0]", "foot_geom"), ("geom/nothing*/friction[0]", "nothing*"),
                             ("geom/*/friction[9]", "wanted 0 to 2"), ("opt/gravity", None), ("friction", "geom/*/friction[0]")):
            if needle is None:
                continue
            result = self.design(parameters=(f"p={path}:0.2:2",))
            self.assertRefused(result, USAGE, path, needle)

    def test_bounds(self):
        for bounds in ("1:1", "2:1", "nan:1", "0:inf", "-inf:1", "a:1", ":1", "1"):
            result = self.design(parameters=(f"mass=body/torso/mass:{bounds}",))
            self.assertRefused(result, USAGE, "mass")
        self.assertRefused(self.design(parameters=("mass=body/torso/mass:0:2:log",)), USAGE, "low > 0")
        self.assertRefused(self.design(parameters=("mass=body/torso/mass:1:2:lin",)), USAGE, "'lin'")

    def test_parameter_named_twice(self):
        result = self.design(parameters=(FRICTION, "friction=opt/gravity[2]:0.5:1"))
        self.assertRefused(result, USAGE, "'friction'", "twice", "rename")

    def test_nominal_zero_needs_absolute(self):
        result = self.design(parameters=("slope=opt/gravity[0]:0.2:2",))
        self.assertRefused(result, USAGE, "'slope'", "absolute")

    def test_no_parameter(self):
        self.assertRefused(self.design(parameters=()), USAGE, "--param")

    def test_truth_for_an_unknown_parameter(self):
        result = self.design("--truth", "fricton=1", "--truth", "gravity=1")
        self.assertRefused(result, USAGE, "fricton", "did you mean 'friction'?")

    def test_truth_outside_its_bounds_or_in_part(self):
        result = self.design("--truth", "friction=2.5", "--truth", "gravity=1")
        self.assertRefused(result, USAGE, "'friction'", "2.5", "[0.2, 2]")
        self.assertRefused(self.design("--truth", "friction=1"), USAGE, "1 of 2")
        self.assertRefused(self.design("--truth", "friction"), USAGE, "name=value")

    def test_device_that_is_not_there(self):
        self.assertRefused(self.design("--set", "agents.device=gpu"), USAGE, "device", "cuda")
        if not pathlib.Path("/dev/nvidia0").exists():
            self.assertRefused(self.design("--set", "agents.device=cuda"), USAGE, "device cuda", "leave agents.device at cpu")

    def test_options_of_what_a_command_does_not_make(self):
        self.assertRefused(self.design("--device", "cpu"), USAGE, "--device", "'oted design --help' explains the command")
        for option in ("--grow", "--seeds", "--device"):
            self.assertRefused(program.oted("clone", option, "--out", "run"), USAGE, option, "'oted clone --help'")

    def test_contradicting_settings(self):
        self.assertRefused(self.design("--set", "design.adversarial.starts=initial"), USAGE, "design.adversarial.actions")

    def test_evaluate_without_truth(self):
        result = oted("evaluate", "--task", "Hopper-v5", "--data", self.demos, "--param", FRICTION, "--out", self.out)
        self.assertOneLine(result, USAGE, "--truth")

    def test_evaluate_without_a_run_or_a_policy(self):
        self.assertRefused(oted("evaluate", "--task", "Hopper-v5"), USAGE, "--out", "--policy")

    def test_strict_refuses_a_parameter_without_effect(self):
        result = self.design("--strict", parameters=(GRAVITY, FLOOR))
        self.assertRefused(result, USAGE, "'floor'", "remove the parameter")


class TestCollect(HopperTest):
    def collect(self, *words):
        return oted("collect", "--task", "Hopper-v5", "--out", self.folder / "new.hdf5", *words)

    def assertCollectsNothing(self, result, code, *needles):
        self.assertOneLine(result, code, *needles)
        self.assertFalse((self.folder / "new.hdf5").exists())

    def test_refusals(self):
        self.assertCollectsNothing(self.collect(), USAGE, "--policy")
        self.assertCollectsNothing(self.collect("--policy", "no/such.npz"), DATA_OR_MODEL, "no/such.npz")
        self.assertCollectsNothing(self.collect("--policy", self.demos), DATA_OR_MODEL, "demos.hdf5")
        self.assertCollectsNothing(self.collect("--policy", "run/policy.onnx"), USAGE, "policy.onnx", "name a policy.npz")
        self.assertCollectsNothing(self.collect("--policy", "p.npz", "--episodes", "0"), USAGE, "--episodes")
        result = self.collect("--policy", "p.npz", "--param", FRICTION, "--truth", "fricton=1")
        self.assertCollectsNothing(result, USAGE, "fricton", "--param")

    def test_the_logs_of_its_task_file_are_not_overwritten(self):
        logs = self.folder / "mine.npz"
        logs.write_bytes(b"dear to me")
        study = self.folder / "study.toml"
        study.write_text('[task]\nname = "Hopper-v5"\n[data]\npath = "mine.npz"\n')
        result = oted("collect", "--task", study, "--policy", "random", "--out", logs)
        self.assertOneLine(result, USAGE, "mine.npz", "names as its data", "choose another --out")
        self.assertEqual(logs.read_bytes(), b"dear to me")

    def test_two_trainings_of_behaviour_in_one_folder(self):
        words = ["behavior", "--task", "Hopper-v5", "--out", self.out, "--quiet", "--set", "sac.n_steps=20_000_000"]
        first = subprocess.Popen([program.OTED, *map(str, words)], stderr=subprocess.DEVNULL)
        try:
            deadline = time.monotonic() + 60
            while not (self.out / "behavior.json").exists() and time.monotonic() < deadline:
                time.sleep(0.01)
            self.assertOneLine(oted(*words), USAGE, str(first.pid))
        finally:
            first.terminate()
            first.wait(timeout=60)

    def test_behaviour_takes_the_settings_of_its_tasks_file(self):
        task = self.folder / "task.toml"
        task.write_text('[task]\nname = "Hopper-v5"\n[sac]\nlearning_starts = 1000\nn_steps = 999\n')
        self.assertOneLine(oted("behavior", "--task", task, "--out", self.out), USAGE, "sac.n_steps is 999")

    def test_behaviour_takes_the_settings_of_its_algorithm_alone(self):
        result = oted("behavior", "--task", "Hopper-v5", "--out", self.out, "--set", "crossq.n_steps=100")
        self.assertOneLine(result, USAGE, "--set crossq.n_steps=100", "--algorithm")
        self.assertFalse(self.out.exists())

    def test_a_clones_demonstrations_are_read_again(self):
        words = ["--task", "Hopper-v5", "--param", FRICTION, "--out", self.out, *sets(TINY)]
        self.assertEqual(oted("clone", "--data", self.demos, *words).returncode, 0)
        policy = self.out / "clone/policy.npz"
        result = self.collect("--policy", policy, "--episodes", "3", "--param", FRICTION, "--truth", "friction=0.6")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        arrays = read_hdf5(self.folder / "new.hdf5")
        self.assertEqual(int(np.sum(arrays["terminals"]) + np.sum(arrays["timeouts"])), 3)
        self.assertNotIn(b"friction", (self.folder / "new.hdf5").read_bytes(), "the truth is not in the data")
        self.out = self.folder / "second"
        self.assertEqual(oted("clone", "--data", self.folder / "new.hdf5", *words[:4], "--out", self.out,
                              *sets(TINY)).returncode, 0)


class TestConfiguration(HopperTest):
    def write(self, text):
        path = self.folder / "config.toml"
        path.write_text(text)
        return path

    def run_config(self, text):
        return oted("run", self.write(text), "--out", self.out)

    def test_missing_file(self):
        self.assertRefused(oted("run", "no/such.toml", "--out", self.out), DATA_OR_MODEL, "no/such.toml")

    def test_broken_toml(self):
        self.assertRefused(self.run_config('[task]\nname = "Hopper\n'), USAGE, "config.toml:2")
        self.assertRefused(self.run_config("\n\n[task\n"), USAGE, "config.toml:3")

    def test_unknown_names(self):
        self.assertRefused(self.run_config('[task]\nnam = "x"\n'), USAGE, "config.toml:2", "did you mean 'name'?")
        self.assertRefused(self.run_config("[tsk]\n"), USAGE, "config.toml:1", "did you mean 'task'?")

    def test_bounds(self):
        self.assertRefused(self.run_config('[parameters]\nm = { field = "body/torso/mass", range = [2, 1] }\n'), USAGE,
                           "config.toml:2", "low < high")

    def test_numbers_that_are_none_are_shown_as_written(self):
        text = '[task]\nmodel = "m.xml"\ncontrol_period = {}\nstart_qpos = [1, {}]\n'
        self.assertRefused(self.run_config(text.format("nan", "1")), USAGE, "config.toml:3", "control_period is nan")
        self.assertRefused(self.run_config(text.format("0.02", "nan")), USAGE, "config.toml:4", "[1,nan]")

    def test_data_lie_beside_the_file(self):
        result = self.run_config('[task]\nname = "Hopper-v5"\n[data]\npath = "gone.hdf5"\n'
                                 '[parameters]\nm = { field = "body/torso/mass" }\n')
        self.assertRefused(result, DATA_OR_MODEL, str(self.folder / "gone.hdf5"))


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
