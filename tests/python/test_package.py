"""The Python package as its users meet it.

    test_package.py FOLDER OTED     FOLDER holds the package oted, "" where it is installed; OTED is the program
"""

import hashlib
import importlib.util
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import unittest
import warnings

if len(sys.argv) < 3:
    sys.exit(__doc__)
OTED = str(pathlib.Path(sys.argv.pop(2)).resolve())
FOLDER = sys.argv.pop(1)
if FOLDER:
    sys.path.insert(0, str(pathlib.Path(FOLDER).resolve()))

import gymnasium  # noqa: E402
import h5py  # noqa: E402
import numpy as np  # noqa: E402

import oted  # noqa: E402
from oted.streams import Channel, to_logs  # noqa: E402
from support import InFolder  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]
HOPPER = str(ROOT / "examples/data/hopper-quickstart.hdf5")
POLICY = ROOT / "examples/policies/hopper/medium.npz"
FRICTION = {"friction": oted.Param("geom/*/friction[0]", 0.2, 2.0)}
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
PENDULUM = """<mujoco><option timestep="0.01"/><worldbody><body><joint name="hinge" type="hinge" axis="0 1 0" damping="0.1"/>
<geom name="rod" type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02"/></body></worldbody>
<actuator><motor name="motor" joint="hinge" ctrlrange="-1 1"/></actuator></mujoco>"""


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


class LogsTest(InFolder):
    def test_hdf5_is_read_as_the_file_has_it(self):
        logs = oted.read_logs(HOPPER)
        with h5py.File(HOPPER) as file:
            np.testing.assert_array_equal(logs.observations, file["observations"][()])
            np.testing.assert_array_equal(logs.actions, file["actions"][()])
            n_ends = int((file["terminals"][()].astype(bool) | file["timeouts"][()].astype(bool)).sum())
        self.assertEqual(len(logs.episodes), n_ends)
        some = oted.read_logs(HOPPER, episodes=2)
        self.assertEqual(some.episodes, logs.episodes[:2])

    def test_what_is_saved_reads_back_the_same(self):
        logs = oted.read_logs(HOPPER)
        for name in ("a.hdf5", "b.npz", "c-v0"):
            logs.save(self.folder / name)
            back = oted.read_logs(self.folder / name)
            np.testing.assert_array_equal(back.observations, logs.observations)
            np.testing.assert_array_equal(back.next_observations, logs.next_observations)
            self.assertEqual(back.episodes, logs.episodes)

    def test_links_to_other_files_are_refused(self):
        with h5py.File(self.folder / "x.hdf5", "w") as file:
            file["observations"] = h5py.ExternalLink(HOPPER, "observations")
        with self.assertRaisesRegex(oted.DataError, "link to another file"):
            oted.read_logs(self.folder / "x.hdf5")

    def test_arrays_episodes_and_columns_give_the_same_logs(self):
        random = np.random.default_rng(0)
        episodes = [(random.normal(size=(n + 1, 2)), random.normal(size=(n, 1))) for n in (5, 3)]
        a = oted.Logs.from_episodes(episodes, period=0.1)
        rows = np.vstack([seen for seen, _ in episodes])
        done = np.vstack([np.vstack([act, [[9.0]]]) for _, act in episodes])
        b = oted.Logs(rows, done, episode_ends=[6, 10], period=0.1)
        columns = {"q": rows[:, 0], "v": rows[:, 1], "u": done[:, 0], "episode": np.array(["a"] * 6 + ["b"] * 4)}
        c = oted.Logs.from_pandas(columns, observations=["q", "v"], actions=["u"], episode="episode", period=0.1)
        for logs in (a, b, c):
            self.assertEqual(logs.episodes, [(0, 5, False), (5, 8, False)])
            np.testing.assert_array_equal(logs.observations, np.vstack([seen[:-1] for seen, _ in episodes]))
            np.testing.assert_array_equal(logs.next_observations, np.vstack([seen[1:] for seen, _ in episodes]))
            np.testing.assert_array_equal(logs.actions, np.vstack([act for _, act in episodes]))
            self.assertEqual(logs.period, 0.1)

    def test_times_are_brought_to_the_period_and_gaps_end_episodes(self):
        t = np.concatenate([np.arange(0, 1, 0.005), np.arange(3, 4, 0.005)])
        logs = oted.Logs(np.column_stack([2 * t]), np.column_stack([np.floor(t / 0.02 + 1e-9)]), times=t, period=0.02)
        self.assertEqual(len(logs.episodes), 2)
        self.assertTrue(any("gaps" in remark for remark in logs.remarks), logs.remarks)
        np.testing.assert_allclose(logs.next_observations - logs.observations, 0.04, atol=1e-9)
        np.testing.assert_allclose(logs.actions[:, 0], np.floor(logs.observations[:, 0] / 2 / 0.02 + 1e-6))
        with self.assertRaisesRegex(oted.UsageError, "rise"):
            oted.Logs(np.zeros((3, 1)), np.zeros((3, 1)), times=[0.0, 0.2, 0.1])

    def test_the_rows_of_tables_are_to_the_last_bit_those_of_the_first_version(self):
        (self.folder / "pendulum.xml").write_text(PENDULUM)
        task = oted.Task(model=self.folder / "pendulum.xml", control_period=0.02)
        digest = hashlib.sha256()
        for step, jitter, gap in ((20_000, 0, 0), (20_000, 7_000, 60_000), (5_000, 2_000, 15_000), (1_000, 0, 7_000),
                                  (8_000, 3_000, 900_000), (19_900, 900, 0)):  # [us]
            state, time, lines = 1, 0, ["time,joint/hinge/qpos,joint/hinge/qvel,actuator/motor,reward"]
            for i in range(300):
                state = state * 1103515245 % 2**31  # no generator of a library that may change
                shifted = time + (state >> 8) % (jitter + 1)
                lines.append(f"{shifted / 1e6},{i * i % 97 / 64},{i % 31 / 32},{shifted // 24_000 % 7 / 8},1")
                time += step + (gap if i % 90 == 50 else 0)
            (self.folder / "log.csv").write_text("\n".join(lines) + "\n")
            logs = oted.read_logs(self.folder / "log.csv", task=task)
            for array in (logs.observations, logs.actions, logs.next_observations, logs.rewards):
                digest.update(array.tobytes())
            digest.update(repr((logs.episodes, logs.period)).encode())
        self.assertEqual(digest.hexdigest()[:16], "e156f721123d113e")

    def test_wrapped_angles_go_on_from_every_source(self):
        t = 0.02 * np.arange(300)
        angle, wrapped = 7 * t + 0.1, np.remainder(7 * t + 0.1, 2 * np.pi)
        seen, done, names = np.column_stack([wrapped, t]), np.zeros((300, 1)), ["q", "v"]
        np.savetxt(self.folder / "log.csv", np.column_stack([t, seen, done]), delimiter=",", header="time,obs.q,obs.v,act.u",
                   comments="")
        for logs in (oted.Logs(seen, done, period=0.02, observation_names=names, unwrap=["q"]),
                     oted.Logs.from_pandas({"q": wrapped, "v": t, "u": done[:, 0]}, observations=names, actions=["u"],
                                           unwrap=["q"]),
                     oted.Logs.from_transitions(seen[:-1], done[:-1], seen[1:], observation_names=names, unwrap=["q"]),
                     oted.read_logs(self.folder / "log.csv", unwrap=["q"])):
            np.testing.assert_allclose(logs.observations[:, 0], angle[:len(logs)], atol=1e-12)
            np.testing.assert_allclose(logs.next_observations[:, 0], angle[1:len(logs) + 1], atol=1e-12)
            np.testing.assert_array_equal(logs.observations[:, 1], t[:len(logs)])
            self.assertIsNone(logs.path)
        with self.assertRaisesRegex(oted.UsageError, "no names"):
            oted.Logs(seen, done, unwrap=["q"])

    def test_logs_join_and_part(self):
        logs = oted.read_logs(HOPPER)
        again = logs.select([1, 0]) + logs.select([2])
        self.assertEqual(len(again.episodes), 3)
        begin, end, _ = logs.episodes[1]
        np.testing.assert_array_equal(again.observations[:end - begin], logs.observations[begin:end])
        self.assertIsNone(again.path)

    def test_constants_go_with_their_recordings_and_only_with_a_task_that_has_them(self):
        (self.folder / "pendulum.xml").write_text(PENDULUM)
        constants = {"load": {"field": "body/*/mass"}}
        task = oted.Task(model=self.folder / "pendulum.xml", control_period=0.02, constants=constants)
        t = np.arange(0, 4, 0.02)
        one = oted.Logs(np.column_stack([np.sin(t), np.cos(t)]), np.sin(3 * t)[:, None], period=0.02)
        both = one.with_constants(load=1.5) + one
        np.testing.assert_array_equal(both.constants["load"][:len(one)], 1.5)
        self.assertTrue(np.isnan(both.constants["load"][len(one):]).all())
        both.save(self.folder / "log.csv", task)
        back = oted.read_logs(self.folder / "log.csv", task)
        np.testing.assert_array_equal(back.constants["load"], both.constants["load"])
        self.assertEqual(oted.check(both, task).errors, [])
        with self.assertRaisesRegex(oted.UsageError, "constant 'lode'"):
            oted.check(one.with_constants(lode=1.0), task)

    def test_bad_arrays_are_usage_errors(self):
        for call in (lambda: oted.Logs(np.zeros((4, 2)), np.zeros((3, 1))),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1)), episode_ends=[2, 5]),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1)), episode_ends=["x"]),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1)), period=-1.0),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1)), period="x"),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1))) + oted.Logs(np.zeros((4, 3)), np.zeros((4, 1))),
                     lambda: oted.Logs([["x"]], [[0.0]]),
                     lambda: oted.Logs.from_pandas({"q": np.zeros(3)}, observations=["p"], actions=["q"])):
            with self.assertRaises(oted.UsageError):
                call()
        with self.assertRaises(oted.DataError):
            oted.Logs(np.full((4, 2), np.nan), np.zeros((4, 1)))


class Starting(InFolder):
    def test_a_first_task_file_is_the_programs(self):
        (self.folder / "pendulum.xml").write_text(PENDULUM)
        t = np.arange(200) * 0.01
        rows = np.stack([t, np.sin(3 * t), 3 * np.cos(3 * t), 0.1 * np.sin(5 * t)], axis=1)
        np.savetxt(self.folder / "log.csv", rows, delimiter=",", header="time,hinge_pos,hinge_vel,motor_cmd", comments="")
        names = [str(self.folder / name) for name in ("pendulum.xml", "log.csv", "python.toml", "program.toml")]
        proposal = oted.init(names[0], names[1], names[2])
        self.assertEqual(proposal.columns, {"hinge_pos": "joint/hinge/qpos", "hinge_vel": "joint/hinge/qvel",
                                            "motor_cmd": "actuator/motor"})
        subprocess.run([OTED, "init", *names[:2], "--out", names[3]], check=True, capture_output=True)
        text = (self.folder / "program.toml").read_text()
        self.assertEqual(repr(proposal), text.replace("program.toml", "python.toml"))
        self.assertEqual(oted.check(names[1], names[2]).errors, [])
        with self.assertRaisesRegex(oted.UsageError, "is there already"):
            oted.init(names[0], names[1], names[2])


class Streams(unittest.TestCase):
    """The rule of oted.streams, on signals whose values between the samples are known."""

    def test_states_are_interpolated_and_actions_held(self):
        q = np.arange(0, 1.0, 0.013)
        u = np.arange(-0.05, 1.0, 0.1)
        logs = to_logs([Channel("q", q, 3 * q)], [Channel("u", u, np.arange(len(u)))], 0.02)
        t = np.arange(len(logs)) * 0.02
        np.testing.assert_allclose(logs.observations[:, 0], 3 * t, atol=1e-12)
        np.testing.assert_array_equal(logs.actions[:, 0], np.floor((t + 0.05 + 1e-12) / 0.1))

    def test_a_gap_parts_episodes_and_nothing_lies_in_it(self):
        q = np.concatenate([np.arange(0, 0.5, 0.01), np.arange(0.7, 1.2, 0.01)])
        logs = to_logs([Channel("q", q, q)], [Channel("u", [0.0, 1.0], [0.0, 0.0])], 0.02)
        self.assertEqual(len(logs.episodes), 2)
        seen = np.concatenate([logs.observations, logs.next_observations])
        self.assertFalse(((seen > 0.4901) & (seen < 0.6999)).any())

    def test_times_since_1970_lose_nothing_that_matters(self):
        t = 1.7e9 + np.arange(0, 1, 0.01)
        logs = to_logs([Channel("q", t, t - 1.7e9)], [Channel("u", [1.7e9, 1.7e9 + 1], [0.0, 0.0])], 0.02)
        np.testing.assert_allclose(logs.observations[:, 0], np.arange(len(logs)) * 0.02, atol=1e-6)

    def test_clocks_that_do_not_meet_and_stamps_that_fall_are_errors(self):
        q = np.arange(0, 1, 0.01)
        with self.assertRaisesRegex(oted.DataError, "clocks"):
            to_logs([Channel("q", q, q)], [Channel("u", q + 50, q)], 0.02)
        with self.assertRaisesRegex(oted.DataError, "do not rise"):
            to_logs([Channel("q", np.repeat(q, 2), np.repeat(q, 2))], [Channel("u", q, q)], 0.02)


class Environments(InFolder):
    def test_at_nominal_parameters_an_environment_is_gymnasiums_to_the_last_bit(self):
        for name in ("Hopper-v5", "HalfCheetah-v5", "Walker2d-v5"):
            ours, theirs = oted.make_env(name), gymnasium.make(name)
            self.assertEqual(ours.action_space, theirs.action_space)
            self.assertEqual(ours.observation_space, theirs.observation_space)
            random = np.random.default_rng(0)
            for seed in (3, None):  # the second start goes on with the stream of the first
                np.testing.assert_array_equal(ours.reset(seed=seed)[0], theirs.reset(seed=seed)[0])
                for _ in range(1000):
                    action = random.uniform(-1, 1, theirs.action_space.shape)
                    a, b = ours.step(action), theirs.step(action)
                    np.testing.assert_array_equal(a[0], b[0])
                    self.assertEqual(a[1:4], (b[1], b[2], b[3]))
                    if b[2] or b[3]:
                        break

    def test_a_changed_parameter_is_gymnasiums_with_a_changed_model(self):
        parameters = {"gravity": oted.Param("opt/gravity[2]", 0.2, 2.0)}
        ours = oted.make_env("Hopper-v5", parameters=parameters, sample={"gravity": 1.3})
        theirs = gymnasium.make("Hopper-v5")
        theirs.unwrapped.model.opt.gravity[2] *= 1.3
        self.assertEqual(ours.reset(seed=1)[1]["parameters"], {"gravity": 1.3})
        theirs.reset(seed=1)
        for _ in range(20):
            np.testing.assert_array_equal(ours.step(np.zeros(3))[0], theirs.step(np.zeros(3))[0])

    def test_gymnasiums_checker_passes(self):
        from gymnasium.utils.env_checker import check_env
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            check_env(oted.make_env("Walker2d-v5"), skip_render_check=True)

    def test_a_vector_environment_is_its_single_ones_at_any_number_of_threads(self):
        n, seen = 3, []
        for threads in (1, 2):
            vector = oted.make_vec_env("Hopper-v5", n, threads=threads)
            theirs = gymnasium.vector.SyncVectorEnv([lambda: oted.make_env("Hopper-v5")] * n)
            np.testing.assert_array_equal(vector.reset(seed=5)[0], theirs.reset(seed=5)[0])
            random = np.random.default_rng(1)
            for _ in range(120):  # past the ends of episodes
                actions = random.uniform(-1, 1, (n, 3))
                a, b = vector.step(actions), theirs.step(actions)
                for x, y in zip(a[:4], b[:4]):
                    np.testing.assert_array_equal(x, y)
            seen.append(a[0])
        np.testing.assert_array_equal(*seen)

    def test_same_step_resets_hand_over_the_last_observation(self):
        mode = gymnasium.vector.AutoresetMode.SAME_STEP
        vector = oted.make_vec_env("Hopper-v5", 2, autoreset_mode=mode)
        theirs = gymnasium.vector.SyncVectorEnv([lambda: oted.make_env("Hopper-v5")] * 2, autoreset_mode=mode)
        vector.reset(seed=5)
        theirs.reset(seed=5)
        random = np.random.default_rng(1)
        n_ends = 0
        for _ in range(100):
            actions = random.uniform(-1, 1, (2, 3))
            a, b = vector.step(actions), theirs.step(actions)
            np.testing.assert_array_equal(a[0], b[0])
            for i in np.flatnonzero(a[2] | a[3]):
                n_ends += 1
                np.testing.assert_array_equal(a[4]["final_obs"][i], b[4]["final_obs"][i])
        self.assertGreater(n_ends, 0)

    def test_an_action_delay_is_felt_a_step_later(self):
        delay = {"delay": oted.Param("action/delay", 0, 2, scale="absolute")}
        late = oted.make_env("Hopper-v5", parameters=delay, sample={"delay": 1})
        prompt = oted.make_env("Hopper-v5")
        late.reset(seed=1)
        prompt.reset(seed=1)
        actions = np.random.default_rng(0).uniform(-1, 1, (10, 3))
        for t in range(10):
            seen = late.step(actions[t])[0]
            np.testing.assert_array_equal(seen, prompt.step(actions[t - 1] if t else np.zeros(3))[0])

    def test_an_episode_begins_where_options_say(self):
        env = oted.make_env("Hopper-v5")
        observation, _ = env.reset(options={"qpos": [0, 1.3, 0.01, 0, 0, 0], "qvel": [0.5, 0, 0, 0, 0, 0]})
        np.testing.assert_array_equal(observation, [1.3, 0.01, 0, 0, 0, 0.5, 0, 0, 0, 0, 0])
        with self.assertRaises(oted.UsageError):
            env.reset(options={"qpos": [0.0], "qvel": [0.0]})

    def test_a_task_without_a_reward_says_so(self):
        (self.folder / "pendulum.xml").write_text(PENDULUM)
        task = {"model": self.folder / "pendulum.xml", "control_period": 0.02}
        with self.assertWarnsRegex(UserWarning, "has no reward: every step gives 0") as told:
            oted.make_vec_env(oted.Task(**task), 2)
        self.assertEqual(told.filename, __file__)  # the line that called
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            oted.make_env(oted.Task(**task, reward="1"))

    def test_a_model_of_mujocos_python_is_the_model_of_its_file(self):
        import mujoco
        spec = mujoco.MjSpec.from_string(PENDULUM)
        (self.folder / "pendulum.xml").write_text(PENDULUM)
        a, b = (oted.make_env(oted.Task(model=model, control_period=0.02, start_noise=0.1))
                for model in (spec, self.folder / "pendulum.xml"))
        np.testing.assert_array_equal(a.reset(seed=1)[0], b.reset(seed=1)[0])
        for _ in range(50):
            np.testing.assert_array_equal(a.step([0.5])[0], b.step([0.5])[0])
        with self.assertRaisesRegex(oted.UsageError, "MjModel"):
            oted.make_env(oted.Task(model=spec.compile(), control_period=0.02))


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
                ("wanted numbers", lambda: oted.fit("Hopper-v5", HOPPER, {"f": oted.Param("geom/*/friction[0]", "a", 2)})),
                ("mean, standard", lambda: oted.fit("Hopper-v5", HOPPER, {"f": oted.Param("geom/*/size", 1, 2, prior=1.0)})),
                ("settings: got", lambda: oted.fit("Hopper-v5", HOPPER, FRICTION, settings="design.method=paper")),
                ("callback: got int", lambda: oted.fit("Hopper-v5", HOPPER, FRICTION, callback=3)),
                ("episode 0: wanted", lambda: oted.Logs.from_episodes([array])),
                ("episode 1: got 1 obs", lambda: oted.Logs.from_episodes([(array, array), (array[:, :1], array)])),
                ("episode 'a'", lambda: oted.Logs(array, array).select("a")),
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
                ("Logs.save", lambda: oted.init("arm.xml", oted.Logs(array, array))),
                ("period: got 'x'", lambda: to_logs([channel], [channel], "x")),
                ("wanted oted.streams.Channel", lambda: to_logs([("q", [0, 1], [0, 1])], [channel], 0.1)),
                ("wanted numbers", lambda: to_logs([Channel("q", [0, 1], ["x", 1])], [channel], 0.1)),
                ("make_env: got str", lambda: oted.GymSimulator("Pendulum-v1", name="p", version="1"))):
            with self.subTest(wanted), self.assertRaisesRegex(oted.UsageError, wanted) as raised:
                call()
            self.assertEqual(len(str(raised.exception).splitlines()), 1)

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
