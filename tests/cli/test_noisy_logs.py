"""Noisy logs as a user makes them, read back by h5py, and the forms of the design that replay logs, on such logs.

    test_noisy_logs.py PATH/TO/oted [TestClass.test_name ...]
"""

import json
import shutil
import unittest

import h5py
import numpy as np

import program
from program import ROOT, USAGE, ProgramTest, oted

NOISE = 0.02


def read(path):
    with h5py.File(path, "r") as file:
        return {name: file[name][()] for name in file if name != "infos"}, "infos" in file


class NoisyTest(ProgramTest):
    def setUp(self):
        super().setUp()
        self.hopper = ROOT / "examples/data/hopper-medium.hdf5"

    def assertOneReadingPerState(self, arrays):
        ends = (arrays["terminals"].ravel() | arrays["timeouts"].ravel()).astype(bool)
        goes_on = ~ends[:-1]
        self.assertGreater(goes_on.sum(), 100)
        np.testing.assert_array_equal(arrays["next_observations"][:-1][goes_on], arrays["observations"][1:][goes_on])


class TestConvertNoise(NoisyTest):
    def convert(self, name, *more, source=None):
        out = self.folder / name
        result = self.succeed("data", "convert", source or self.hopper, out, "--noise", NOISE, *more)
        return out, result

    def test_noise_of_the_given_deviation_one_reading_per_state_and_no_states(self):
        clean, _ = read(self.hopper)
        noisy, has_infos = read(self.convert("noisy.hdf5")[0])
        self.assertFalse(has_infos)
        self.assertOneReadingPerState(noisy)
        difference = noisy["next_observations"] - clean["next_observations"]
        n = len(difference)
        # Five standard errors of a standard deviation, in every channel.
        np.testing.assert_allclose(difference.std(axis=0), NOISE, rtol=5 / np.sqrt(2 * n))
        np.testing.assert_allclose(difference.mean(axis=0), 0, atol=5 * NOISE / np.sqrt(n))
        for name in ("actions", "rewards", "terminals", "timeouts"):
            np.testing.assert_array_equal(noisy[name], clean[name])

    def test_states_are_left_out_and_the_loss_is_said(self):
        source = self.folder / "with_states.hdf5"
        shutil.copy(self.hopper, source)
        with h5py.File(source, "a") as file:
            for name in ("qpos", "qvel"):
                if f"infos/{name}" not in file:
                    file[f"infos/{name}"] = np.zeros((len(file["actions"]), 6))
        out, result = self.convert("noisy.hdf5", source=source)
        self.assertFalse(read(out)[1])
        self.assertIn("lost: infos/qpos", result.stdout)

    def test_equal_seeds_give_equal_files_and_others_other_noise(self):
        one, again, other = (self.convert(name, "--seed", seed)[0].read_bytes()
                             for name, seed in (("a.hdf5", 3), ("b.hdf5", 3), ("c.hdf5", 4)))
        self.assertEqual(one, again)
        self.assertNotEqual(one, other)

    def test_a_deviation_must_be_positive(self):
        for noise in ("0", "-1", "much"):
            self.succeed("data", "convert", self.hopper, self.folder / "out.hdf5", "--noise", noise, code=USAGE)


class TestCollectNoise(NoisyTest):
    def collect(self, name, *more):
        out = self.folder / name
        self.succeed("collect", "--task", "Hopper-v5", "--policy", "random", "--episodes", "40", "--seed", "5", "--out", out,
                      *more)
        return read(out)

    def test_the_sensors_alone_are_noisy(self):
        clean, _ = self.collect("clean.hdf5")
        noisy, has_infos = self.collect("noisy.hdf5", "--noise", NOISE)
        self.assertFalse(has_infos)
        self.assertOneReadingPerState(noisy)
        # Random actions do not depend on what is seen: both targets went through the same states.
        np.testing.assert_array_equal(noisy["actions"], clean["actions"])
        np.testing.assert_array_equal(noisy["rewards"], clean["rewards"])
        difference = noisy["observations"] - clean["observations"]
        np.testing.assert_allclose(difference.std(axis=0), NOISE, rtol=5 / np.sqrt(2 * len(difference)))

    def test_beside_parameters_of_the_target(self):
        target = ("--param", "gravity=opt/gravity[2]:0.2:2.0", "--truth", "gravity=1.3")
        clean, _ = self.collect("clean.hdf5", *target)
        noisy, _ = self.collect("noisy.hdf5", *target, "--noise", NOISE)
        np.testing.assert_array_equal(noisy["rewards"], clean["rewards"])

    def test_numbers_below_zero_are_refused(self):
        for word in ("--seed=-7", "--threads=-7"):
            self.assertOneLine(oted("collect", "--task", "Hopper-v5", "--policy", "random", word, "--out", self.folder / "no.csv"),
                               USAGE, word[:6], "0 or more")

    def test_noise_that_is_a_parameter_already_is_refused(self):
        result = oted("collect", "--task", "Hopper-v5", "--policy", "random", "--noise", "0.1", "--out",
                      self.folder / "out.hdf5", "--param", "n=obs/*/noise_std:0:1:absolute", "--truth", "n=0.5")
        self.assertEqual(result.returncode, USAGE)
        self.assertIn("set the same channel", result.stderr)


class TestFormsSideBySide(NoisyTest):
    """One run, a setting for each form, one table."""

    STUDY = """
[task]
name = "Hopper-v5"
[data]
path = "noisy.hdf5"
episodes = "2"
[parameters]
gain = { field = "actuator/*/gainprm[0]", range = [0.2, 2.0] }
[run]
threads = 1
[report]
motion = "false"
[clone]
max_steps = 20
[selection]
n_seeds = 1
n_sims = 4
n_steps = 20
judge_steps = 10
[design.adversarial]
n_sims = 4
n_steps = 20
[design.discriminator]
steps = 2
hidden = [8]
[design.settings.matching]
method = "trajectories"
trajectories = { rows = 64, coarse = 4, starts = 1, tried = 0 }
[design.settings.squares]
method = "least-squares"
least_squares = { rows = 100, starts = 1 }
[design.settings.likelihood]
method = "dropo"
dropo = { transitions = 20, samples = 4, budget = 60 }
"""

    def test_every_form_leaves_a_q_in_the_same_record(self):
        self.succeed("data", "convert", self.hopper, self.folder / "noisy.hdf5", "--noise", NOISE)
        (self.folder / "study.toml").write_text(self.STUDY)
        out = self.folder / "run"
        result = oted("design", self.folder / "study.toml", "--out", out, "--quiet")
        self.assertIn(result.returncode, (0, 4), result.stderr)
        design = json.loads((out / "design.json").read_text())
        self.assertEqual({s["name"] for s in design["settings"]}, {"matching", "squares", "likelihood"})
        for setting in design["settings"]:
            (seed,) = setting["seeds"]
            self.assertTrue(0.2 < seed["mode"][0] < 2.0, setting["name"])
            self.assertTrue((out / "design" / setting["name"] / "1" / "q.json").is_file())
        # Complete settings are not made again.
        before = {p: p.stat().st_mtime_ns for p in out.glob("design/*/1/q.json")}
        self.assertIn(oted("design", self.folder / "study.toml", "--out", out, "--quiet").returncode, (0, 4))
        self.assertEqual(before, {p: p.stat().st_mtime_ns for p in out.glob("design/*/1/q.json")})


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
