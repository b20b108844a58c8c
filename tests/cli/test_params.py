"""oted params list and check, presets, and channel parameters through the program.

    test_params.py PATH/TO/oted [TestClass.test_name ...]
"""

import json
import unittest

import h5py
import numpy as np

import program
from program import NO_SIMULATOR, ROOT, TINY_DESIGN, USAGE, ProgramTest, oted

GAIN = "gain=actuator/*/gainprm[0]:0.2:2.0"
DELAY = "delay=action/delay:0:4:absolute"
class ParamsTest(ProgramTest):
    def printed(self, *arguments, code=0):
        return self.succeed(*arguments, code=code).stdout


class TestList(ParamsTest):
    def test_every_offered_value_is_mujocos(self):
        import gymnasium
        model = gymnasium.make("Hopper-v5").unwrapped.model
        offers = json.loads(self.printed("params", "list", "--task", "Hopper-v5", "--json"))
        values = {v["path"]: v["nominal"] for offer in offers["parameters"] for v in offer["values"]}
        for name in ("floor", "foot_geom"):
            self.assertEqual(values[f"geom/{name}/friction[0]"], model.geom(name).friction[0])
        for name in ("torso", "foot"):
            self.assertEqual(values[f"body/{name}/mass"], model.body(name).mass[0])
        self.assertEqual(values["joint/leg_joint/damping"], model.joint("leg_joint").damping[0])
        self.assertEqual(values["opt/gravity[2]"], -9.81)
        self.assertEqual(values["actuator/#1/gear[0]"], model.actuator_gear[1][0])
        self.assertEqual(values["action/delay"], 0)
        self.assertEqual(values["obs/foot_joint_vel/noise_std"], 0)
        for offer in offers["parameters"]:
            self.assertTrue(offer["meaning"], offer["path"])

    def test_text_names_objects_units_and_presets(self):
        text = self.printed("params", "list", "--task", "HalfCheetah-v5")
        for needle in ("geom/NAME/friction[k]", "bthigh", "[kg]", "obs/NAME/noise_std", "preset arm", "preset gym",
                       "tendon_stiffness"):
            self.assertIn(needle, text)
        self.assertNotIn("body/torso/mass", text)
        self.assertIn("body/torso/mass", self.printed("params", "list", "--task", "HalfCheetah-v5", "--values"))

    def test_a_task_is_needed_and_a_verb(self):
        self.assertRefused(oted("params", "list"), USAGE, "--task")
        self.assertRefused(oted("params", "list", "--task", "Hoper-v5"), USAGE, "did you mean 'Hopper-v5'?")
        self.assertEqual(oted("params").returncode, USAGE)


class TestCheck(ParamsTest):
    def check(self, *arguments, code=0):
        return json.loads(self.printed("params", "check", "--task", "Hopper-v5", "--json", *arguments, code=code))

    def test_gain_and_gear_trade_off_and_an_idle_parameter_is_named(self):
        arguments = ["--param", GAIN, "--param", "gear=actuator/*/gear[0]:0.5:2.0", "--param", DELAY,
                     "--param", "idle=geom/floor/friction[1]:0.2:2.0"]
        found = self.check(*arguments)
        self.assertEqual(found["measured_on"]["episodes"], "random_actions")
        gain, gear, delay, idle = found["parameters"]
        self.assertEqual([p["has_effect"] for p in (gain, gear, delay, idle)], [True, True, True, False])
        self.assertEqual(gain["sets"][2], {"path": "actuator/#2/gainprm[0]", "nominal": 1})
        self.assertEqual(delay["unit"], "control steps")
        self.assertEqual(len(gain["change_by_observation"]), len(found["observations"]))
        self.assertEqual([pair["parameters"] for pair in found["trade_offs"]], [["gain", "gear"]])
        self.assertGreater(found["trade_offs"][0]["cosine"], 0.95)
        self.check("--strict", *arguments, code=NO_SIMULATOR)
        text = self.printed("params", "check", "--task", "Hopper-v5", *arguments)
        for needle in ("no effect: 'idle'", "trade-off: 'gain' and 'gear'", "* reacts most", "foot_joint_vel"):
            self.assertIn(needle, text)

    def test_effects_are_measured_on_logs_where_there_are_some(self):
        found = self.check("--data", ROOT / "examples/data/hopper-medium.hdf5", "--param", GAIN)
        self.assertEqual(found["measured_on"]["episodes"], "logged")
        self.assertEqual(found["measured_on"]["n_episodes"], 3)

    def test_the_noise_of_one_sensor_changes_that_sensor_alone(self):
        found = self.check("--param", "noise=obs/leg_joint_pos/noise_std:0:0.1:absolute")
        changes = found["parameters"][0]["change_by_observation"]
        j = found["observations"].index("leg_joint_pos")
        self.assertGreater(changes[j], 0)
        self.assertEqual([c for k, c in enumerate(changes) if k != j], [0] * (len(changes) - 1))

    def test_any_number_of_threads_prints_the_same(self):
        arguments = ["params", "check", "--task", "Hopper-v5", "--preset", "legs", "--threads"]
        self.assertEqual(self.printed(*arguments, 1), self.printed(*arguments, 2))


class TestPresets(ParamsTest):
    def names(self, *arguments):
        found = json.loads(self.printed("params", "check", "--json", *arguments))
        return {p["name"]: p for p in found["parameters"]}, found["skipped"]

    def test_gym_is_friction_gain_and_gravity(self):
        found, skipped = self.names("--task", "Hopper-v5", "--preset", "gym")
        self.assertEqual(list(found), ["friction", "gain", "gravity"])
        self.assertEqual(skipped, [])

    def test_a_parameter_of_the_same_name_replaces_the_entry(self):
        found, _ = self.names("--task", "Hopper-v5", "--preset", "arm", "--param", "mass=body/torso/mass:0.9:1.1")
        self.assertEqual(found["mass"]["bounds"], [0.9, 1.1])
        self.assertEqual(found["frictionloss"]["scale"], "absolute", "Hopper's joints have none")

    def test_what_the_model_lacks_is_left_out_with_a_note(self):
        text = self.printed("params", "check", "--task", "Hopper-v5", "--preset", "gripper")
        self.assertRegex(text, r"left out: tendon_stiffness of preset gripper .*the model has none")

    def test_unknown_preset(self):
        self.assertRefused(oted("params", "check", "--task", "Hopper-v5", "--preset", "leg"), USAGE, "did you mean 'legs'?")

    def test_a_configuration_with_a_preset_runs_and_its_record_names_the_parameters(self):
        out, toml = self.folder / "run", self.folder / "run.toml"
        toml.write_text('[task]\nname = "Hopper-v5"\n[data]\npath = "%s"\nepisodes = 1\n[parameters]\npreset = "gym"\n'
                        % (ROOT / "examples/data/hopper-medium.hdf5"))
        words = ["design", toml, "--out", out, "--threads", 1]
        for assignment in [*TINY_DESIGN, "selection.n_seeds=1"]:
            words += ["--set", assignment]
        result = oted(*words)
        self.assertIn(result.returncode, (0, NO_SIMULATOR), result.stderr)
        design = json.loads((out / "design.json").read_text())
        self.assertEqual([p["name"] for p in design["parameters"]], ["friction", "gain", "gravity"])
        record = (out / "run.toml").read_text()
        self.assertIn("geom/*/friction[0]", record)
        self.assertNotIn("preset", record)
        # The record alone goes on with the same design.
        again = oted("select-simulator", "--out", out, "--threads", 1)
        self.assertEqual(again.returncode, result.returncode, again.stderr)


class TestChannels(ParamsTest):
    def collect(self, name, *arguments):
        path = self.folder / name
        self.printed("collect", "--task", "Hopper-v5", "--policy", ROOT / "examples/policies/hopper/medium.npz",
                    "--episodes", 1, "--threads", 1, "--out", path, *arguments)
        with h5py.File(path, "r") as file:
            return {key: file[key][()] for key in ("observations", "actions", "rewards")}

    def test_collect_delays_actions_and_biases_sensors(self):
        plain = self.collect("plain.hdf5")
        delayed = self.collect("delayed.hdf5", "--param", DELAY, "--truth", "delay=2")
        zero = self.collect("zero.hdf5", "--param", DELAY, "--truth", "delay=0")
        bias = self.collect("bias.hdf5", "--param", "b=obs/foot_joint_pos/bias:-1:1:absolute", "--truth", "b=0.25")
        np.testing.assert_array_equal(zero["observations"], plain["observations"])
        np.testing.assert_array_equal(delayed["observations"][0], plain["observations"][0])
        self.assertGreater(np.abs(delayed["observations"][1] - plain["observations"][1]).max(), 1e-3)
        difference = bias["observations"][0] - plain["observations"][0]
        np.testing.assert_allclose(difference, [0.25 if k == 4 else 0 for k in range(11)], atol=1e-6)

    def test_mistakes_are_named(self):
        def collect(parameter):
            return oted("collect", "--task", "Hopper-v5", "--policy", ROOT / "examples/policies/hopper/medium.npz",
                        "--param", parameter, "--out", self.folder / "never.hdf5")
        self.assertRefused(collect("d=action/delay:0:4"), USAGE, "absolute")
        self.assertRefused(collect("n=obs/foot_join_vel/noise_std:0:1:absolute"), USAGE, "did you mean 'foot_joint_vel'?")
        self.assertRefused(collect("n=obs/*/noise_std:0.01:1:absolute:log"), USAGE, "drop 'log'")
        self.assertFalse((self.folder / "never.hdf5").exists())


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
