"""oted data info, check and convert as a user meets them.

    test_data.py PATH/TO/oted [TestClass.test_name ...]
"""

import hashlib
import json
import unittest

import h5py
import mujoco
import numpy as np

import log_robots
import program
from program import DATA_OR_MODEL, GRAVITY, ROOT, USAGE, ProgramTest, oted, write_hdf5

EXAMPLES = ROOT / "examples/data"
# A platform on four rotors, level as the model knows it.
LEVEL = """<mujoco><option timestep="0.002"/>
  <worldbody><body name="hull" pos="0 0 1"><freejoint name="base"/>
    <inertial pos="{x} 0 0" mass="1" diaginertia="0.01 0.01 0.02"/>
    <site name="a" pos="0.15 0.15 0"/><site name="b" pos="-0.15 0.15 0"/>
    <site name="c" pos="-0.15 -0.15 0"/><site name="d" pos="0.15 -0.15 0"/></body></worldbody>
  <actuator><motor name="a" site="a" gear="0 0 1 0 0 0.05" ctrlrange="0 6"/><motor name="b" site="b" gear="0 0 1 0 0 -0.05" ctrlrange="0 6"/>
    <motor name="c" site="c" gear="0 0 1 0 0 0.05" ctrlrange="0 6"/><motor name="d" site="d" gear="0 0 1 0 0 -0.05" ctrlrange="0 6"/></actuator>
</mujoco>"""


def read(path):
    with h5py.File(path, "r") as file:
        arrays = {name: file[name][()] for name in file if name != "infos"}
        if "infos" in file:
            arrays |= {f"infos/{name}": file["infos"][name][()] for name in file["infos"]}
    return arrays


class DataTest(ProgramTest):
    def setUp(self):
        super().setUp()
        self.hopper = EXAMPLES / "hopper-medium.hdf5"

    def check(self, path, *more, code=0):
        """The JSON of `oted data check`, and its findings by name."""
        result = oted("data", "check", path, "--json", *more)
        self.assertEqual(result.returncode, code, result.stderr + result.stdout)
        record = json.loads(result.stdout)
        self.assertEqual(record["schema"], "oted.data_check/1")
        return record, {finding["check"]: finding for finding in record["findings"]}

    def planted(self, change, name="planted.hdf5"):
        """hopper-medium with a defect."""
        arrays = read(self.hopper)
        change(arrays)
        path = self.folder / name
        write_hdf5(path, arrays)
        return path


class TestInfo(DataTest):
    def test_counts_returns_scores_and_hash_are_those_of_the_file(self):
        result = oted("data", "info", self.hopper, "--task", "Hopper-v5", "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        info, arrays = json.loads(result.stdout), read(self.hopper)
        self.assertEqual(info["schema"], "oted.data_info/1")
        self.assertEqual(info["dataset"]["sha256"], hashlib.sha256(self.hopper.read_bytes()).hexdigest())
        self.assertEqual(info["dataset"]["n_transitions"], len(arrays["observations"]))
        ends = np.flatnonzero(arrays["terminals"].ravel() | arrays["timeouts"].ravel())
        lengths = np.diff(np.concatenate([[-1], ends]))
        self.assertEqual(info["episode_length"],
                         {"min": lengths.min(), "median": np.median(lengths), "max": lengths.max()})
        returns = [r.sum() for r in np.split(arrays["rewards"].astype(float).ravel(), ends + 1)[:-1]]
        np.testing.assert_allclose(info["returns"], returns, rtol=1e-12)
        # D4RL's references for Hopper.
        np.testing.assert_allclose(info["scores"], 100 * (np.array(returns) + 20.272305) / (3234.3 + 20.272305))
        self.assertEqual(info["observations"][0]["name"], "rootz_pos")
        np.testing.assert_allclose([c["low"] for c in info["observations"]], arrays["observations"].min(0))
        np.testing.assert_allclose([c["high"] for c in info["actions"]], arrays["actions"].max(0))

    def test_the_table_names_what_is_there(self):
        result = oted("data", "info", self.hopper, "--episodes", "2-3")
        self.assertEqual(result.returncode, 0, result.stderr)
        for text in ("sha256", "2 episodes", "observations[10]", "actions[2]", "returns"):
            self.assertIn(text, result.stdout)

    def test_a_file_with_nan_is_described_and_a_missing_one_is_an_error(self):
        def spoil(arrays):
            arrays["observations"][5, 2] = np.nan
        path = self.planted(spoil)
        self.assertEqual(oted("data", "info", path).returncode, 0)
        result = oted("data", "info", self.folder / "none.hdf5")
        self.assertEqual(result.returncode, DATA_OR_MODEL)
        self.assertRegex(result.stderr, r"\Aoted: [^\n]*none.hdf5[^\n]*\n\Z")


class TestCheck(DataTest):
    def test_data_of_the_nominal_simulator_show_no_gap(self):
        record, findings = self.check(self.hopper, "--task", "Hopper-v5")
        self.assertEqual((record["errors"], record["warnings"]), (0, 0), findings)
        self.assertEqual(record["gap"]["verdict"], "none")
        self.assertAlmostEqual(record["gap"]["auc"], 0.5, delta=0.02)
        self.assertLess(record["one_step"]["median_ratio"], 1e-4)
        self.assertIn("1403 logged transitions", findings["gap"]["what"])

    def test_data_of_another_target_show_one(self):
        record, findings = self.check(EXAMPLES / "hopper-medium-shifted.hdf5", "--task", "Hopper-v5", "--param", GRAVITY)
        self.assertEqual(record["gap"]["verdict"], "clear")
        self.assertGreater(record["gap"]["auc"], 0.8)
        self.assertGreater(record["one_step"]["median_ratio"], 0.05)
        self.assertEqual(findings["parameter_effect"]["severity"], "note")

    def test_the_same_bytes_at_any_number_of_threads(self):
        def check(threads):
            return oted("data", "check", self.hopper, "--task", "Hopper-v5", "--json", "--threads", threads).stdout
        self.assertEqual(check(1), check(3))

    def test_every_shipped_dataset_is_sound(self):
        for path in sorted(EXAMPLES.glob("*.hdf5")):
            # Without its task nothing tells a picture's kinds from a sensor's readings.
            task = ("--task", "MiniGrid-Obstacles-10x10") if path.name.startswith("minigrid") else ()
            record, findings = self.check(path, "--strict", *task)
            self.assertEqual(record["warnings"], 0, (path, findings))

    def test_nan_is_reported_with_its_row_and_is_exit_code_3(self):
        def spoil(arrays):
            arrays["observations"][300, 4] = np.nan
            arrays["actions"][7, 1] = np.inf
        record, findings = self.check(self.planted(spoil), "--task", "Hopper-v5", code=DATA_OR_MODEL)
        self.assertEqual(record["errors"], 2)
        self.assertEqual((record["findings"][0]["row"], record["findings"][0]["episode"]), (300, 2))
        self.assertEqual(record["findings"][1]["row"], 7)

    def test_a_missed_boundary_is_an_error(self):
        def join(arrays):
            arrays["terminals"][np.flatnonzero(arrays["terminals"].ravel())[0]] = 0
        _, findings = self.check(self.planted(join), code=DATA_OR_MODEL)
        self.assertEqual(findings["missed_boundary"]["severity"], "error")
        self.assertEqual(findings["missed_boundary"]["count"], 1)

    def test_episodes_that_run_together_without_timeouts_and_next_observations(self):
        def strip(arrays):
            arrays["terminals"][:] = 0
            del arrays["timeouts"], arrays["next_observations"]
        _, findings = self.check(self.planted(strip))
        self.assertEqual(findings["state_jumps"]["severity"], "warning")

    def test_strict_makes_a_warning_exit_code_3(self):
        def freeze(arrays):
            for name in ("observations", "next_observations"):
                arrays[name][:, 3] = 0.25
        path = self.planted(freeze)
        _, findings = self.check(path)
        self.assertEqual(findings["constant_channels"]["severity"], "warning")
        self.check(path, "--strict", code=DATA_OR_MODEL)

    def test_noise_on_the_sensors_is_measured(self):
        sigma = 0.01

        def measure(arrays):
            rng = np.random.default_rng(1)
            ends = np.flatnonzero(arrays["terminals"].ravel() | arrays["timeouts"].ravel()) + 1
            for begin, end in zip([0, *ends[:-1]], ends):
                noise = sigma * rng.normal(size=end - begin + 1)
                arrays["observations"][begin:end, 0] += noise[:-1]
                arrays["next_observations"][begin:end, 0] += noise[1:]
        record, findings = self.check(self.planted(measure), "--task", "Hopper-v5")
        self.assertAlmostEqual(record["noise"][0]["sigma"], sigma, delta=0.2 * sigma)
        self.assertEqual([c["visible"] for c in record["noise"]].count(True), 1)
        self.assertEqual(findings["measurement_noise"]["severity"], "warning")
        self.assertIn("rootz_pos", findings["measurement_noise"]["what"])

    def test_terminals_that_the_task_does_not_explain(self):
        def mark(arrays):
            arrays["terminals"][100] = 1
        _, findings = self.check(self.planted(mark), "--task", "Hopper-v5")
        self.assertEqual((findings["unexplained_terminals"]["row"], findings["unexplained_terminals"]["count"]),
                         (100, 1))

    def test_states_beside_the_observations(self):
        def add_states(arrays):
            n = len(arrays["observations"])
            arrays["infos/qpos"] = np.hstack([np.zeros((n, 1)), arrays["observations"][:, :5]])
            arrays["infos/qvel"] = arrays["observations"][:, 5:].copy()
        _, findings = self.check(self.planted(add_states))
        self.assertNotIn("states_disagree", findings)

        def shift(arrays):
            add_states(arrays)
            arrays["infos/qpos"][200:, 1] += 0.1
        _, findings = self.check(self.planted(shift, "shifted.hdf5"), "--task", "Hopper-v5")
        self.assertEqual((findings["states_disagree"]["row"], findings["states_disagree"]["channels"]),
                         (200, ["rootz_pos"]))

    def test_an_action_of_the_other_sign_is_named_where_positions_alone_were_logged(self):
        robot = log_robots.dataclasses.replace(log_robots.ROBOTS["finger"], episodes=3, rows=150, positions_alone=True)
        clean = log_robots.drive(robot, noise=1e-3)
        turned, _ = log_robots.plant("action sign", robot, clean, log_robots.hinges_of(robot))
        degrees = log_robots.dataclasses.replace(clean, commands=clean.commands * 180 / np.pi)
        unit = ("action_unit", 'multiply actuator/proximal and actuator/distal by 0.0174533 (data.scale = { "actuator/proximal" = 0.0174533, "actuator/distal" = 0.0174533 })')
        for log, expected in ((clean, []), (turned, [("action_sign", 'turn round the sign of actuator/proximal (data.scale = { "actuator/proximal" = -1 })')]),
                              (degrees, [unit])):
            record = json.loads(self.succeed("data", "check", log_robots.write(robot, log, self.folder), "--json").stdout)
            self.assertEqual([(f["check"], f["remedy"]) for f in record["findings"]
                              if f["severity"] != "note" and f["check"] not in ("actions_outside_bounds", "clipped_actions")],
                             expected)

    def test_another_tasks_data_are_an_error(self):
        record, findings = self.check(self.hopper, "--task", "HalfCheetah-v5", code=DATA_OR_MODEL)
        self.assertIn("HalfCheetah-v5", findings["wrong_dimensions"]["what"])
        self.assertIsNone(record["gap"])

    def test_the_report_says_what_it_means_and_what_to_do(self):
        def spoil(arrays):
            arrays["actions"][:, 0] *= 3
        result = oted("data", "check", self.planted(spoil))
        self.assertEqual(result.returncode, 0, result.stderr)
        result = oted("data", "check", self.planted(spoil), "--task", "Hopper-v5")
        for text in ("warnings", "actions_outside_bounds", "found", "means", "do ", "first in row", "one-step error",
                     "area under the curve"):
            self.assertIn(text, result.stdout)
        self.assertLessEqual(max(map(len, result.stdout.splitlines())), 120)

    def test_refusals(self):
        for words in (["data"], ["data", "look", self.hopper], ["data", "check"],
                      ["data", "check", self.hopper, "--param", GRAVITY],
                      ["data", "check", self.hopper, "--episodes", "many"],
                      ["data", "check", self.hopper, "--task", "Hoper-v5"]):
            result = oted(*words)
            self.assertEqual(result.returncode, USAGE, words)
            self.assertRegex(result.stderr, r"\Aoted: [^\n]+\n\Z")

    def test_a_load_aside_is_no_swap_of_the_rotors_that_balance_it(self):
        """With the rotors at the load's side in the others' places the level model would not turn, either."""
        model = mujoco.MjModel.from_xml_string(LEVEL.format(x=0.02))
        data, random = mujoco.MjData(model), np.random.default_rng(5)
        names, _ = log_robots.names_of(model)
        rows, commands = [], []
        for _ in range(4):
            mujoco.mj_resetData(model, data)
            data.qvel[:] = random.normal(0, 0.2, 6)
            rows.append([])
            commands.append([])
            for _ in range(81):
                hover = 9.81 / 4 * (1 + 0.02 / 0.15 * np.array([1, -1, -1, 1]))
                data.ctrl[:] = hover * (1 + 0.05 * random.normal(size=4))
                rows[-1].append(np.concatenate([data.qpos, data.qvel]))
                commands[-1].append(data.ctrl.copy())
                mujoco.mj_step(model, data, 10)
        robot = log_robots.Robot(LEVEL.format(x=0), 0.02)
        log = log_robots.Log(names, log_robots.actions_of(model), np.array(rows), np.array(commands))
        task = log_robots.write(robot, log, self.folder)
        record = json.loads(self.succeed("data", "check", task, "--json").stdout)
        of_swap = [f for f in record["findings"] if f["check"] == "swapped_actions"]
        self.assertEqual([f["severity"] for f in of_swap], ["note"])
        self.assertIn("body/hull/ipos[0] at 0.0", of_swap[0]["meaning"])


class TestRun(DataTest):
    def test_findings_are_told_once_before_long_work_starts_and_change_nothing(self):
        def double(arrays):
            arrays["actions"][:, 0] *= 1.5
        path, out = self.planted(double), self.folder / "run"
        words = ["clone", "--task", "Hopper-v5", "--data", path, "--param", GRAVITY, "--out", out,
                 "--set", "clone.hidden=16", "--set", "clone.max_steps=20", "--set", "clone.check_interval=20"]
        first = oted(*words)
        self.assertEqual(first.returncode, 0, first.stderr)
        self.assertRegex(first.stderr, r"warning: data, actions_outside_bounds: [^\n]*oted data check[^\n]*\n")
        # What is complete is not made again, and not complained of again.
        self.assertNotIn("warning", oted(*words).stderr)
        sound = oted(*words[:4], self.hopper, *words[5:8], self.folder / "sound", *words[9:])
        self.assertEqual(sound.returncode, 0, sound.stderr)
        self.assertNotIn("warning", sound.stderr)


class TestConvert(DataTest):
    def test_there_and_back_loses_nothing(self):
        middle, back = self.folder / "logs.npz", self.folder / "back.hdf5"
        for source, target in ((self.hopper, middle), (middle, back)):
            result = oted("data", "convert", source, target, "--task", "Hopper-v5")
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn("nothing was lost", result.stdout)
        wanted, got = read(self.hopper), read(back)
        self.assertEqual(wanted.keys(), got.keys())
        for name in wanted:
            np.testing.assert_array_equal(wanted[name].ravel(), got[name].ravel())

    def test_some_episodes(self):
        out = self.folder / "two.npz"
        self.assertEqual(oted("data", "convert", self.hopper, out, "--episodes", "2-3").returncode, 0)
        arrays, ends = read(self.hopper), None
        ends = np.flatnonzero(arrays["terminals"].ravel() | arrays["timeouts"].ravel()) + 1
        np.testing.assert_array_equal(np.load(out)["observations"], arrays["observations"][ends[0]:ends[2]])

    def test_refusals_leave_nothing(self):
        out = self.folder / "out.npz"

        def spoil(arrays):
            arrays["observations"][5, 2] = np.nan
        for words, code in (([self.planted(spoil), out], DATA_OR_MODEL),
                            ([self.hopper, out, "--task", "HalfCheetah-v5"], DATA_OR_MODEL),
                            ([self.hopper, out, "--episodes", "9"], DATA_OR_MODEL),
                            ([self.hopper, self.folder / "out.xyz"], DATA_OR_MODEL)):
            result = oted("data", "convert", *words)
            self.assertEqual(result.returncode, code, result.stderr)
            self.assertRegex(result.stderr, r"\Aoted: [^\n]+\n\Z")
            self.assertFalse(out.exists())
        same = self.planted(lambda arrays: None)
        before = same.read_bytes()
        self.assertEqual(oted("data", "convert", same, same).returncode, USAGE)
        self.assertEqual(same.read_bytes(), before)


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
