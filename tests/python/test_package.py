"""The Python package as its users meet it: importing, designs, refusals. Logs and environments: test_logs.py, test_envs.py.

    test_package.py FOLDER OTED     FOLDER holds the package oted, "" where it is installed; OTED is the program
"""

import importlib.util
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import unittest

from support import HOPPER, ROOT, InFolder, take_package, take_program

OTED = take_program(__doc__)
FOLDER = take_package(__doc__)

import gymnasium  # noqa: E402
import h5py  # noqa: E402
import numpy as np  # noqa: E402

import oted  # noqa: E402
from oted.streams import Channel, to_logs  # noqa: E402

POLICY = ROOT / "examples/policies/hopper/medium.npz"
FRICTION = {"friction": oted.Param("geom/*/friction[0]", 0.2, 2.0)}
PENDULUM = """<mujoco><option timestep="0.01"/><worldbody><body><joint name="hinge" axis="0 1 0" damping="0.5"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1"/></body></worldbody>
<actuator><motor joint="hinge" ctrlrange="-1 1"/></actuator></mujoco>"""
# A design of seconds: no other method is tried beside it, no suspect.
TINY = {
    "data.episodes": 2, "design.method": "trajectories", "design.trajectories.tried": 0,
    "clone.hidden": "16", "clone.max_steps": 40, "clone.check_interval": 20,
    "design.adversarial.n_iterations": 3,
    "design.adversarial.n_sims": 4, "design.adversarial.n_steps": 20, "design.discriminator.hidden": "16",
    "design.discriminator.steps": 5, "design.discriminator.batch": 32, "design.trajectories.rows": 32,
    "design.trajectories.window": 4, "design.trajectories.starts": 1, "design.trajectories.coarse": 4,
    "selection.n_seeds": 2, "selection.n_sims": 2, "selection.n_steps": 20, "selection.judge_steps": 20,
    "report.motion": "false",
}


def python(code, **keywords):
    """A fresh interpreter with the same package."""
    environment = {**os.environ, "PYTHONPATH": FOLDER}
    return subprocess.Popen([sys.executable, "-c", code], text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            env=environment, **keywords)


def records(folder):
    """What a design leaves, but for times and places."""
    folder = pathlib.Path(folder)
    files = [folder / "design.json", *folder.glob("clone/*"), *folder.glob("design/*/*/*"), *folder.glob("export/*")]
    return {str(file.relative_to(folder)): file.read_bytes() for file in files
            if file.is_file() and not file.name.startswith("events.")}


class Import(unittest.TestCase):
    def test_import_loads_nothing_that_is_only_sometimes_needed(self):
        process = python("import oted, sys; print([m for m in ('mujoco', 'gymnasium', 'pandas', 'h5py', 'matplotlib', "
                         "'torch') if m in sys.modules])")
        self.assertEqual(process.communicate()[0].strip(), "[]")

    def test_the_module_shows_no_symbol_but_its_own(self):
        from oted import _core
        symbols = subprocess.run(["nm", "-D", "--defined-only", _core.__file__], capture_output=True, text=True, check=True)
        self.assertEqual([line.split()[-1] for line in symbols.stdout.splitlines()], ["PyInit__core"])

    @unittest.skipUnless(importlib.util.find_spec("nanobind"), "nanobind's stub generator is not installed")
    def test_the_stub_says_what_the_module_has(self):
        with tempfile.TemporaryDirectory() as folder:
            stub = pathlib.Path(folder) / "_core.pyi"
            subprocess.run([sys.executable, "-m", "nanobind.stubgen", "-q", "-m", "oted._core", "-o", stub], check=True,
                           env={**os.environ, "PYTHONPATH": FOLDER})
            self.assertEqual(stub.read_text(), (ROOT / "python/oted/_core.pyi").read_text(),
                             "make it again: python -m nanobind.stubgen -m oted._core -o python/oted/_core.pyi")

    def test_every_name_that_the_package_promises_is_there(self):
        for name in oted.__all__:
            self.assertIsNotNone(getattr(oted, name))

    def test_the_module_is_the_program(self):
        for words in (["--version"], ["params", "list", "--task", "Hopper-v5"], ["design", "--task", "Hoper-v5", "--out", "x"]):
            ours = python(f"import sys; sys.argv[1:] = {words!r}; import runpy; runpy.run_module('oted', run_name='__main__')")
            out, err = ours.communicate()
            theirs = subprocess.run([OTED, *words], capture_output=True, text=True)
            self.assertEqual((ours.returncode, out, err), (theirs.returncode, theirs.stdout, theirs.stderr))


class Designs(InFolder):
    """On one tiny design of the shipped Hopper logs, made by the program and by the package."""

    @classmethod
    def setUpClass(cls):
        cls.work = tempfile.TemporaryDirectory(prefix="oted designs ")
        cls.cli = pathlib.Path(cls.work.name) / "cli"
        cls.ours = pathlib.Path(cls.work.name) / "ours"
        words = [word for key, value in TINY.items() for word in ("--set", f"{key}={value}")]
        done = subprocess.run([OTED, "design", "--task", "Hopper-v5", "--data", HOPPER, "--param",
                               "friction=geom/*/friction[0]:0.2:2.0", "--seed", "4", "--threads", "2", "--quiet", "--out",
                               str(cls.cli), *words], capture_output=True, text=True)
        assert done.returncode in (0, 4), done.stderr
        cls.events = []
        cls.design = oted.fit("Hopper-v5", HOPPER, FRICTION, seed=4, threads=1, out=cls.ours, settings=TINY,
                              progress=False, callback=cls.events.append)

    @classmethod
    def tearDownClass(cls):
        cls.work.cleanup()

    def test_python_and_the_program_give_the_same_bytes(self):
        self.assertEqual(records(self.ours), records(self.cli))

    def test_each_goes_on_with_the_others_run(self):
        loaded = oted.load(self.cli)
        self.assertEqual(loaded.record, self.design.record)
        before = (self.ours / "design.json").stat().st_mtime_ns
        done = subprocess.run([OTED, "design", "--out", str(self.ours), "--quiet", "--json"], capture_output=True, text=True)
        self.assertEqual(json.loads(done.stdout)["design"]["parameters"], self.design.parameters)
        self.assertEqual((self.ours / "design.json").stat().st_mtime_ns, before)

    def test_every_verdict_of_the_schema_has_its_name(self):
        schema = json.loads((ROOT / "docs" / "schemas" / "oted.design.1.schema.json").read_text())
        self.assertEqual({str(v) for v in oted.Verdict}, set(schema["properties"]["verdict"]["enum"]))

    def test_a_design_tells_what_its_record_holds(self):
        record = json.loads((self.ours / "design.json").read_text())
        parameter = record["parameters"][0]
        self.assertEqual(self.design.mode, {"friction": parameter["mode"]})
        self.assertEqual(self.design.verdict, record["verdict"])
        self.assertIn(record["sentence"], repr(self.design))
        self.assertEqual(self.design.rows()[0]["q05"], parameter["interval90"][0])
        self.assertIn("friction", self.design._repr_html_())
        self.assertTrue(self.design.report.is_file())

    def test_later_recordings_are_predicted_as_the_program_does(self):
        given = next((self.ours / "given").glob("logs.*"), HOPPER)
        told = json.loads(subprocess.run([OTED, "validate", self.ours, "--data", given, "--json"], capture_output=True, text=True,
                                         check=False).stdout)
        for logs in (given, oted.read_logs(given, "Hopper-v5")):
            later = self.design.validate(logs)
            self.assertEqual(later.record, told["validation"])
            self.assertIn(told["sentence"], repr(later))
        self.assertIn(later.rows()[0]["name"], repr(self.design.validation))

    def test_a_record_that_was_edited_or_damaged_is_not_loaded(self):
        for name in ("design.json", "run.toml"):
            (self.folder / name).write_bytes((self.ours / name).read_bytes())
        file = self.folder / "design.json"
        self.assertEqual(oted.load(self.folder).record, self.design.record)
        edited = json.loads(file.read_text())
        edited["parameters"][0]["mode"] *= 1.1
        for text, said in ((json.dumps(edited), "is not as oted wrote it"), ("null", "no JSON object"), ("[]", "no JSON object"),
                           ('{"parameters": [], "verdict": "no_gap"}', "cannot be read")):
            file.write_text(text)
            with self.assertRaisesRegex(oted.DataError, f"design.json'.*{said}"):
                oted.load(self.folder)

    def test_what_a_designs_calls_cannot_take_is_told_by_argument(self):
        (self.folder / "file").write_text("")
        for wanted, call in (
                ("seed: got 1180591620717411303424", lambda: self.design.samples(2, 2**70)),
                ("samples: got 1099511627776", lambda: self.design.samples(2**40)),
                ("path: got None", lambda: self.design.to_mjcf(None)), ("path: got 3", lambda: self.design.to_sysid(3)),
                ("path: got None", lambda: self.design.save(None)), ("out: got 3", lambda: oted.train(self.design, out=3)),
                ("file' is a file; name a folder", lambda: oted.train(self.design, out=self.folder / "file")),
                ("model: got 3", lambda: self.design.validate(HOPPER, model=3))):
            with self.subTest(wanted), self.assertRaisesRegex(oted.UsageError, wanted):
                call()

    @unittest.skipUnless(importlib.util.find_spec("matplotlib"), "Matplotlib is not installed")
    def test_a_plot_goes_into_one_axes(self):
        from matplotlib.figure import Figure
        figure = Figure()
        axes = figure.subplots()
        self.assertIs(self.design.plot(axes), axes)
        self.assertIn("friction", axes.get_yticklabels()[0].get_text())
        for wrong in (3, figure, Figure().subplots(2)):
            with self.assertRaisesRegex(oted.UsageError, f"axes: got {type(wrong).__name__}, wanted one Axes"):
                self.design.plot(wrong)

    def test_samples_are_of_q(self):
        drawn = self.design.samples(2000, seed=1)["friction"]
        np.testing.assert_array_equal(drawn, self.design.samples(2000, seed=1)["friction"])
        parameter = self.design.parameters[0]
        inside = (drawn >= parameter["interval90"][0]) & (drawn <= parameter["interval90"][1])
        # 2,000 draws of probability 0.9: five standard deviations.
        self.assertAlmostEqual(inside.mean(), 0.9, delta=0.034)

    def test_the_designed_model_has_the_designed_values(self):
        spec = self.design.to_spec()
        nominal = gymnasium.make("Hopper-v5").unwrapped.model.geom("foot_geom").friction[0]
        self.assertAlmostEqual(spec.compile().geom("foot_geom").friction[0], nominal * self.design.mode["friction"], places=5)

    def test_episodes_draw_modes_and_samples(self):
        modes = {mode[0] for mode in self.design.modes.tolist()}
        env = oted.make_env(self.design, sample="modes")
        drawn = {env.reset(seed=seed)[1]["parameters"]["friction"] for seed in range(20)}
        self.assertEqual(drawn, modes)
        env = oted.make_env(self.design, sample="samples")
        self.assertEqual(len({env.reset()[1]["parameters"]["friction"] for _ in range(20)}), 20)
        self.assertEqual(oted.make_env(self.design).parameters, self.design.mode)
        self.assertEqual(oted.make_env(self.design, sample="nominal").parameters, {"friction": 1.0})
        with self.assertRaisesRegex(oted.UsageError, "sample='modes' or 'samples'"):
            oted.make_env(self.design, sample="sample")

    def test_registered_ids_make_them(self):
        oted.register(self.design, "OtedTest-v0")
        single, vector = gymnasium.make("OtedTest-v0"), gymnasium.make_vec("OtedTest-v0", num_envs=2)
        self.assertEqual(single.reset(seed=1)[0].shape, (11,))
        self.assertEqual(vector.reset(seed=1)[0].shape, (2, 11))

    def test_events_tell_stages_and_curves(self):
        kinds = {event["kind"] for event in self.events}
        self.assertLessEqual({"progress", "scalar"}, kinds)
        last = [event for event in self.events if event["kind"] == "progress" and event["stage"] == "design"][-1]
        self.assertEqual(last["done"], last["total"])

    def test_logs_in_memory_design_as_their_file_does(self):
        logs = oted.read_logs(HOPPER)
        with h5py.File(HOPPER) as file:
            made = oted.Logs.from_transitions(
                file["observations"], file["actions"], file["next_observations"], terminals=file["terminals"],
                timeouts=file["timeouts"], rewards=file["rewards"])
        np.testing.assert_array_equal(made.observations, logs.observations)
        design = oted.fit("Hopper-v5", made, FRICTION, seed=4, settings=TINY, progress=False)
        self.assertEqual(design.parameters, self.design.parameters)
        saved = design.save(self.folder / "kept")
        self.assertEqual(saved.record, design.record)
        self.assertEqual(subprocess.run([OTED, "verify", str(saved.path)], capture_output=True).returncode, 0)
        self.assertIn('path = "given/logs.npz"', (saved.path / "run.toml").read_text())

    def test_a_task_file_says_what_the_call_does_not(self):
        (self.folder / "task.toml").write_text(
            f'[task]\nname = "Hopper-v5"\n[data]\npath = {json.dumps(HOPPER)}\n[parameters]\n'
            'friction = { field = "geom/*/friction[0]", range = [0.2, 2.0] }\n[run]\nseed = 4\n')
        design = oted.fit(self.folder / "task.toml", out=self.folder / "run", settings=TINY, progress=False)
        self.assertEqual(design.parameters, self.design.parameters)

    def test_policies_of_python_are_judged_as_those_of_files(self):
        still = oted.evaluate(lambda seen: np.zeros((len(seen), 3)), self.design, at="nominal", episodes=3)
        env = gymnasium.make("Hopper-v5")
        self.assertEqual(len(still.returns), 3)
        env.reset(seed=0)
        length = 0
        ended = False
        while not ended:
            _, _, ended, cut, _ = env.step(np.zeros(3))
            ended, length = ended or cut, length + 1
        self.assertAlmostEqual(still.record["mean_length"], length, delta=15)  # other starts
        agent = oted.Agent(POLICY, self.design)
        by_file = oted.evaluate(POLICY, self.design, episodes=3)
        by_call = oted.evaluate(lambda seen: agent.predict(seen)[0], self.design, episodes=3)
        self.assertEqual(by_file.returns, by_call.returns)

        class Theirs:  # as Stable-Baselines3 has it

            def predict(self, seen, deterministic=False):
                return agent.predict(seen)[0], None
        self.assertEqual(oted.evaluate(Theirs(), self.design, episodes=3).returns, by_file.returns)


    def test_the_viewers_ghost_is_the_log_and_the_simulator_moves_by_the_logged_actions(self):
        from oted.viewer import motion
        logs = oted.read_logs(HOPPER, task="Hopper-v5")
        seen = logs.observations[logs.episodes[0][0]:logs.episodes[0][1]]
        logged, designed, period = motion(self.design, 1, seconds=10 * 0.008)
        self.assertEqual((len(logged), period), (len(seen), 0.008))
        clear = np.abs(seen[:, 5:]).max(axis=1) < 10  # Gymnasium clips velocities: other rows show no state
        self.assertTrue(clear[0] and clear.sum() > 20)
        np.testing.assert_array_equal(logged[clear, 1:], seen[clear, :5])
        # The distance walked, which no log shows: the sum of the logged velocities, as far as all of them are shown.
        shown = int(np.argmin(clear)) if not clear.all() else len(clear)
        walked = np.concatenate([[0], np.cumsum((seen[1:shown, 5] + seen[:shown - 1, 5]) / 2 * 0.008)])
        np.testing.assert_allclose(logged[:shown, 0], walked, atol=1e-9)
        # From the start on it is an environment at the same parameters.
        env = oted.make_env(self.design)
        env.reset(options={"qpos": designed[0], "qvel": seen[0, 5:]})
        for row in range(10):
            np.testing.assert_allclose(designed[row], env.unwrapped._sims.lanes.pose(0), atol=1e-12)
            env.step(logs.actions[row])
        start = next(row for row in range(10, len(seen)) if clear[row])
        np.testing.assert_array_equal(designed[start, 1:], logged[start, 1:])
        self.assertAlmostEqual(designed[start, 0], logged[start, 0])
        self.assertGreater(np.abs(designed[:, 1:] - logged[:, 1:]).max(), 1e-9)
        with self.assertRaisesRegex(oted.UsageError, "episode: got 0"):
            motion(self.design, 0)

    def test_without_a_display_the_viewer_says_so_in_a_line(self):
        shown = subprocess.run([sys.executable, "-m", "oted", "view", self.design.path], capture_output=True, text=True,
                               env={k: v for k, v in os.environ.items() if "DISPLAY" not in k} | {"PYTHONPATH": FOLDER})
        self.assertEqual((shown.returncode, shown.stdout), (3, ""))
        self.assertRegex(shown.stderr, r"\Aoted: there is no display [^\n]+\n\Z")


class Refusals(InFolder):
    def test_errors_have_classes_and_leave_nothing(self):
        out = self.folder / "run"
        for error, call in (
                (oted.UsageError, lambda: oted.fit("Hoper-v5", HOPPER, FRICTION, out=out)),
                (oted.UsageError, lambda: oted.fit("Hopper-v5", HOPPER, {"f": oted.Param("geom/*/fraction[0]", 0, 1)}, out=out)),
                (oted.UsageError, lambda: oted.fit("Hopper-v5", HOPPER, FRICTION, out=out, settings={"design.metod": "x"})),
                (oted.DataError, lambda: oted.fit("Hopper-v5", self.folder / "none.npz", FRICTION, out=out)),
                (oted.UsageError, lambda: oted.load(self.folder)),
                (oted.UsageError, lambda: oted.make_env("Hopper-v5", sample="modes"))):
            with self.assertRaises(error) as raised:
                call()
            self.assertEqual(len(str(raised.exception).splitlines()), 1)
            self.assertFalse(out.exists())
        self.assertTrue(issubclass(oted.UsageError, ValueError))

    def test_what_a_call_cannot_take_is_told_in_a_line_with_what_it_takes(self):
        array, env, vector = np.zeros((10, 2)), oted.make_env("Hopper-v5"), oted.make_vec_env("Hopper-v5", 2)
        env.reset()
        channel = Channel("q", [0, 1], [0, 1])
        (self.folder / "meta").mkdir()
        (self.folder / "meta/info.json").write_text("{}")
        for wanted, call in (
                ("oted.Logs\\(observations, actions\\)", lambda: oted.fit("Hopper-v5", array, FRICTION)),
                ("join several by \\+", lambda: oted.fit("Hopper-v5", [HOPPER, HOPPER], FRICTION)),
                ("wanted oted.Logs or a file", lambda: oted.check({"q": [1]}, "Hopper-v5")),
                ("logs: wanted", lambda: oted.fit("Hopper-v5", parameters=FRICTION)),
                ("describe", lambda: oted.fit("Hopper-v5", HOPPER)),
                ("oted.bags.read_bag", lambda: oted.read_logs("run.mcap")),
                ("from_pandas", lambda: oted.fit("Hopper-v5", "run.parquet", FRICTION)),
                ("read_lerobot", lambda: oted.read_logs(self.folder)),
                ("episodes: got 0", lambda: oted.read_logs(HOPPER, episodes=0)),
                ("low: got 'a', wanted a number",
                 lambda: oted.fit("Hopper-v5", HOPPER, {"f": oted.Param("geom/*/friction[0]", "a", 2)})),
                ("prior: got 'a', wanted a number",
                 lambda: oted.describe("Hopper-v5", {"f": oted.Param("geom/*/size", 1, 2, prior=("a", "b"))})),
                ("log: got 'no', wanted True or False",
                 lambda: oted.describe("Hopper-v5", {"f": oted.Param("geom/*/size", 1, 2, log="no")})),
                ("quantities: got \\['x'\\]",
                 lambda: oted.describe(oted.Task(model="arm.xml", control_period=0.02, quantities=["x"]))),
                ("model: got '/.*udc80'", lambda: oted.describe(oted.Task(model="\udc80", control_period=0.02))),
                ("task: got None", lambda: oted.make_env(None)),
                ("task: got None", lambda: oted.describe(None)),
                ("task: got None", lambda: oted.evaluate(POLICY, None)),
                ("mean, standard", lambda: oted.fit("Hopper-v5", HOPPER, {"f": oted.Param("geom/*/size", 1, 2, prior=1.0)})),
                ("settings: got", lambda: oted.fit("Hopper-v5", HOPPER, FRICTION, settings="design.method=paper")),
                ("callback: got int", lambda: oted.fit("Hopper-v5", HOPPER, FRICTION, callback=3)),
                ("episode 0: wanted", lambda: oted.Logs.from_episodes([array])),
                ("episode 1: got 1 obs", lambda: oted.Logs.from_episodes([(array, array), (array[:, :1], array)])),
                ("episode 'a'", lambda: oted.Logs(array, array).select("a")),
                ("constant 'load': got nan", lambda: oted.Logs(array, array).with_constants(load=float("nan"))),
                ("MjSpec.from_string", lambda: oted.describe(oted.Task(model=PENDULUM, control_period=0.02))),
                ("task: got None", lambda: oted.fit(None, HOPPER, FRICTION)),
                ("out: got ''", lambda: oted.fit("Hopper-v5", HOPPER, FRICTION, out="")),
                ("out: got 3", lambda: oted.fit("Hopper-v5", HOPPER, FRICTION, out=3)),
                ("which is its nominal value", lambda: oted.fit(
                    "Hopper-v5", HOPPER, {"f": oted.Param("geom/*/friction[0]", 2, 3)}, out=self.folder / "run")),
                ("constant 'load'", lambda: oted.Logs(array, array).with_constants(load="x")),
                ("run directory", lambda: oted.load(3)),
                ("num_envs: got '8'", lambda: oted.make_vec_env("Hopper-v5", "8")),
                ("autoreset_mode", lambda: oted.make_vec_env("Hopper-v5", 2, autoreset_mode="x")),
                ("options: got", lambda: env.reset(options={"qpos": [0]})),
                ("options: got 3", lambda: env.reset(options=3)),
                ("options: got {'qpos'", lambda: vector.reset(options={"qpos": [0]})),
                ("seed: got 1.5", lambda: vector.reset(seed=1.5)),
                ("action: got 'a'", lambda: env.step("a")),
                ("of shape \\(3, 3\\)", lambda: vector.step(np.zeros((3, 3)))),
                ("reset_mask", lambda: vector.reset(options={"reset_mask": [True]})),
                ("policy: got int", lambda: oted.evaluate(3, "Hopper-v5")),
                ("'friction': got 'x', wanted a number",
                 lambda: oted.make_env("Hopper-v5", parameters=FRICTION, sample={"friction": "x"})),
                ("'friction': got None", lambda: oted.make_env("Hopper-v5", parameters=FRICTION, sample={"friction": None})),
                ("'friction': got \\[1, 2\\]",
                 lambda: oted.evaluate(POLICY, "Hopper-v5", parameters=FRICTION, at={"friction": [1, 2]})),
                ("got \\[0.7\\] for parameters", lambda: oted.make_env("Hopper-v5", parameters=FRICTION, sample=[0.7])),
                ("episodes: got 'x'", lambda: oted.evaluate(POLICY, "Hopper-v5", episodes="x")),
                ("seed: got -1", lambda: oted.evaluate(POLICY, "Hopper-v5", seed=-1)),
                ("seed: got 'x'", lambda: oted.check(HOPPER, "Hopper-v5", seed="x")),
                ("width: got 'x'", lambda: oted.make_env("Hopper-v5", render_mode="rgb_array", width="x")),
                ("settings: got 3", lambda: oted.fit("Hopper-v5", HOPPER, FRICTION, settings={3: 4})),
                ("complex", lambda: oted.Logs(array * 1j, array)),
                ("terminated: got 5", lambda: oted.Logs(array, array, terminated=5)),
                ("observation_names: got 'ab'", lambda: oted.Logs(array, array, observation_names="ab")),
                ("observation_names: got \\[1, 2\\]", lambda: oted.Logs(array, array, observation_names=[1, 2])),
                ("episodes: got 3", lambda: oted.Logs.from_episodes(3)),
                ("observations: got 3", lambda: oted.Logs.from_pandas({"q": [1]}, observations=3, actions=["q"])),
                ("column 't'", lambda: oted.Logs.from_pandas({"q": [1, 2], "t": ["x", "y"]}, observations=["q"], actions=["q"],
                                                             reward="t")),
                ("design: got str", lambda: oted.train("Hopper-v5")),
                ("seed: got 1180591620717411303424", lambda: oted.check(HOPPER, "Hopper-v5", seed=2**70)),
                ("seed: got 1180591620717411303424", lambda: oted.evaluate(POLICY, "Hopper-v5", seed=2**70)),
                ("threads: got 1099511627776", lambda: oted.make_vec_env("Hopper-v5", 2, threads=2**40)),
                ("out: got '.udc80'", lambda: oted.fit("Hopper-v5", HOPPER, FRICTION, out="\udc80")),
                ("f: got '.udc80'", lambda: oted.describe("Hopper-v5", {"f": oted.Param("geom/*/size", 1, 2, scale="\udc80")})),
                ("parameters: got '.udc80'", lambda: oted.describe("Hopper-v5", {"\udc80": oted.Param("geom/*/size", 1, 2)})),
                ("model: got 3", lambda: oted.init(3, "log.csv")),
                ("out: got None", lambda: oted.init("arm.xml", "log.csv", None)),
                ("period: got nan", lambda: oted.init("arm.xml", "log.csv", period=float("nan"))),
                ("path: got None, wanted the path of a run directory", lambda: oted.load(None)),
                ("Logs.save", lambda: oted.init("arm.xml", oted.Logs(array, array))),
                ("period: got 'x'", lambda: to_logs([channel], [channel], "x")),
                ("wanted oted.streams.Channel", lambda: to_logs([("q", [0, 1], [0, 1])], [channel], 0.1)),
                ("wanted numbers", lambda: to_logs([Channel("q", [0, 1], ["x", 1])], [channel], 0.1)),
                ("make_env: got str", lambda: oted.GymSimulator("Pendulum-v1", name="p", version="1"))):
            with self.subTest(wanted), self.assertRaisesRegex(oted.UsageError, wanted) as raised:
                call()
            self.assertEqual(len(str(raised.exception).splitlines()), 1)

    def test_a_design_knows_its_model_and_holds_a_copy(self):
        here = self.folder / "pendulum.xml"
        here.write_text(PENDULUM)
        rng = np.random.default_rng(1)
        episodes = [(0.1 * rng.normal(size=(60, 2)), 0.1 * rng.normal(size=(60, 1))) for _ in range(2)]
        given = {"parameters": {"d": oted.Param("joint/*/damping", 0.5, 3)}, "settings": {**TINY, "design.method": "transitions"},
                 "progress": False}
        logs = oted.Logs.from_episodes(episodes, period=0.02)
        design = oted.fit(oted.Task(model=here, control_period=0.02, reward="-sum2_action"), logs, out=self.folder / "run", **given)
        stay = lambda seen: np.zeros((len(seen), 1))  # noqa: E731
        makes = {"an environment": oted.make_env, "several": lambda d: oted.make_vec_env(d, 2),
                 "an evaluation": lambda d: oted.evaluate(stay, d, episodes=1),
                 "a model": lambda d: d.to_mjcf(self.folder / "designed.xml")}
        here.write_text(PENDULUM.replace('mass="1"', 'mass="9"'))
        for name, make in makes.items():
            with self.subTest(name, model="changed"), self.assertRaisesRegex(oted.DataError, "no longer the one"):
                make(design)
        here.unlink()
        (self.folder / "deep" / "er").mkdir(parents=True)
        (self.folder / "run").rename(self.folder / "deep" / "er" / "run")
        for name, make in makes.items():
            with self.subTest(name, model="gone"):
                make(oted.load(self.folder / "deep" / "er" / "run"))
        # A model of Python's lies in the run directory, which is a temporary one until it is saved.
        import mujoco

        spec = mujoco.MjSpec.from_string(PENDULUM)
        oted.fit(oted.Task(model=spec, control_period=0.02, reward="-sum2_action"), logs, **given).save(self.folder / "kept")
        oted.make_env(oted.load(self.folder / "kept"))

    def test_what_cannot_be_pickled_says_what_to_do(self):
        import copy
        import pickle

        array = np.zeros((10, 2))
        for thing, remedy in ((oted.Logs(array, array), "save"), (oted.make_env("Hopper-v5"), "design"),
                              (oted.make_vec_env("Hopper-v5", 2), "design")):
            for attempt in (pickle.dumps, copy.deepcopy):
                with self.assertRaisesRegex(TypeError, remedy):
                    attempt(thing)

    def test_what_cannot_be_written_is_an_error_of_ours(self):
        (self.folder / "file").write_text("")
        for make in (lambda: oted.fit("Hopper-v5", oted.read_logs(HOPPER), FRICTION, out=self.folder / "file" / "run"),
                     lambda: oted.fit("Hopper-v5", HOPPER, FRICTION, out=self.folder / "file" / "run")):
            with self.assertRaises(oted.Error):
                make()

    def test_errors_name_arguments_and_not_the_programs_options(self):
        for said, wanted in (
                ("no data are named; add --data demos.hdf5", "no data are named; add data demos.hdf5"),
                ("use --set design.method=paper", 'use settings={"design.method": "paper"}'),
                ("--set a.b_c=0.5: wanted a number", 'settings={"a.b_c": 0.5}: wanted a number'),
                ("choose another --out, or remove 'x--y'", "choose another out, or remove 'x--y'"),
                ("edited; name it: oted run a --out b", "edited; name it: oted run a --out b")):
            self.assertEqual(oted.errors._in_python(said), wanted)
        with self.assertRaisesRegex(oted.UsageError, 'settings={"design.trajectories.window": "x"}'):
            oted.fit("Hopper-v5", HOPPER, FRICTION, settings={"design.trajectories.window": "x"})

    def test_ctrl_c_stops_and_the_same_call_goes_on(self):
        code = """
import oted, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
def tell(event):
    if event["kind"] == "progress" and event["stage"] == "design": print("designing", flush=True)
try:
    oted.fit("Hopper-v5", {hopper!r}, {{"friction": oted.Param("geom/*/friction[0]", 0.2, 2.0)}}, seed=4, threads=1,
             out={out!r}, settings={settings!r}, progress=False, callback=tell)
except KeyboardInterrupt:
    print("stopped")
"""
        settings = {**TINY, "design.method": "paper", "design.adversarial.n_iterations": 4000}
        process = python(code.format(hopper=HOPPER, out=str(self.folder / "run"), settings=settings))
        self.assertEqual(process.stdout.readline().strip(), "designing")
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=120)
        self.assertEqual((out.split()[-1], process.returncode), ("stopped", 0), err)
        self.assertFalse((self.folder / "run/design.json").exists())
        self.assertTrue(list((self.folder / "run").glob("design/*/*/checkpoint.npz")))

    def test_an_error_in_a_callback_stops_the_run_and_comes_out(self):
        def tell(event):
            raise RuntimeError("mine")
        with self.assertRaisesRegex(RuntimeError, "mine"):
            oted.fit("Hopper-v5", HOPPER, FRICTION, out=self.folder / "run", settings=TINY, progress=False, callback=tell)

    def test_a_missing_package_names_the_pip_line(self):
        process = python("import sys; sys.modules['h5py'] = None; import oted\n"
                         f"try: oted.read_logs({HOPPER!r})\nexcept oted.UsageError as e: print(e)")
        self.assertIn("pip install h5py", process.communicate()[0])


if __name__ == "__main__":
    unittest.main()
