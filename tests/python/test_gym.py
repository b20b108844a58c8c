"""A Gymnasium environment as the simulator: test_gym.py FOLDER, which holds the package oted, "" where it is installed.

The truth is Gymnasium: its steps, and logs of its environments at known parameters."""

import os
import pathlib
import signal
import subprocess
import sys
import time
import unittest

from support import HOPPER, InFolder, take_package

FOLDER = take_package(__doc__)

import gymnasium  # noqa: E402
import mujoco  # noqa: E402
import numpy as np  # noqa: E402

import oted  # noqa: E402
from oted import _engine  # noqa: E402
from oted.task import study  # noqa: E402

# A design of seconds.
TINY = {
    "design.method": "trajectories", "design.trajectories.rows": 32, "design.trajectories.window": 4,
    "design.trajectories.starts": 1, "design.trajectories.coarse": 4, "design.trajectories.tried": 0, "selection.n_seeds": 1,
    "report.motion": "false",
}
QUICK = {"progress": False, "threads": 2}
GEARS = {"length": oted.Param("env/length", 0.5, 2.0)}


class Hopper:
    """Gymnasium's own, with friction as a number that can be set."""

    facts = oted.describe("Hopper-v5")
    friction = gymnasium.make("Hopper-v5").unwrapped.model.geom_friction[:, 0].copy()

    @classmethod
    def set_friction(cls, env, values):
        env.unwrapped.model.geom_friction[:, 0] = cls.friction * values["friction"]

    @staticmethod
    def set_state(env, observation):
        if (np.abs(observation[5:]) >= 10).any():
            return False  # Gymnasium clips velocities there
        inside = env.unwrapped
        mujoco.mj_resetData(inside.model, inside.data)  # the solver begins where it last was
        inside.set_state(np.concatenate([[0.0], observation[:5]]), observation[5:])
        return True

    @classmethod
    def make(cls, **keywords):
        names = cls.facts["observation_names"]
        given = {"nominal": {"friction": 1.0}, "set_parameters": cls.set_friction, "set_state": cls.set_state,
                 "observation_names": names, "action_names": cls.facts["action_names"],
                 "rates": dict(zip(names[6:], names[:5])), **keywords}
        return oted.GymSimulator(lambda: gymnasium.make("Hopper-v5"), name="Hopper", version="5", **given)


def set_length(env, values):
    env.unwrapped.l = values["length"]


def set_pendulum(env, observation):
    env.unwrapped.state = np.array([np.arctan2(observation[1], observation[0]), observation[2]])


def make_pendulum():
    return gymnasium.make("Pendulum-v1", disable_env_checker=True)


def pendulum(**keywords):
    given = {"nominal": {"length": 1.0}, "set_parameters": set_length, "set_state": set_pendulum,
             "observation_names": ["cos", "sin", "rate"], "action_names": ["torque"], **keywords}
    return oted.GymSimulator(make_pendulum, name="Pendulum", version=given.pop("version", "1"), **given)


def pendulum_logs(length=1.3, n_episodes=4, n_steps=60):
    """What the environment shows at this length under random torques that last five steps each."""
    env = make_pendulum()
    set_length(env, {"length": length})
    random = np.random.default_rng(0)
    episodes = []
    for episode in range(n_episodes):
        seen, done = [env.reset(seed=episode)[0]], []
        for k in range(n_steps):
            if k % 5 == 0:
                torque = random.uniform(-2, 2, 1)
            done.append(torque)
            seen.append(env.step(torque)[0])
        episodes.append((np.array(seen), np.array(done)))
    return oted.Logs.from_episodes(episodes, period=0.05, observation_names=["cos", "sin", "rate"],
                                   action_names=["torque"])


def lanes_of(task, parameters=None, n=1):
    return _engine.core.Lanes(study(task, parameters), n, 2)


class Stepping(unittest.TestCase):
    def test_steps_are_gymnasiums_to_the_last_bit(self):
        logs = oted.read_logs(HOPPER)
        friction = {"friction": oted.Param("env/friction", 0.2, 2.0)}
        theirs = gymnasium.make("Hopper-v5")
        lanes = lanes_of(Hopper.make(), friction)
        random = np.random.default_rng(0)
        for factor, row in ((1.0, 0), (1.6, 200)):
            lanes.set_parameters(0, np.array([factor]))
            start = np.ascontiguousarray(logs.observations[row])
            self.assertTrue(lanes.set_to_row(0, logs._data, row))
            theirs.reset(seed=1)
            Hopper.set_friction(theirs, {"friction": factor})
            Hopper.set_state(theirs, start)
            for _ in range(100):
                action = random.uniform(-1, 1, 3)
                lanes.step([0], action[None])
                seen, reward, terminated, truncated, _ = theirs.step(action)
                np.testing.assert_array_equal(lanes.observations()[0], seen)
                self.assertEqual(lanes.rewards()[0], reward)
                self.assertEqual(lanes.status()[0], _engine.core.TERMINATED if terminated else 0)
                if terminated or truncated:
                    break

    def test_the_wrapped_hopper_is_the_built_in_one(self):
        ours, built_in = lanes_of(Hopper.make()), lanes_of("Hopper-v5")
        logs = oted.read_logs(HOPPER)
        for row in range(0, 400, 40):
            for lanes in (ours, built_in):
                self.assertTrue(lanes.set_to_row(0, logs._data, row))
                lanes.step([0], np.ascontiguousarray(logs.actions[row])[None])
            np.testing.assert_allclose(ours.observations(), built_in.observations(), rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(ours.rewards(), built_in.rewards(), rtol=1e-9)

    def test_a_lane_depends_on_its_own_parameters_start_and_actions_alone(self):
        random = np.random.default_rng(0)
        actions = random.uniform(-2, 2, (4, 50))

        def rollout(ids, before=()):
            lanes = lanes_of(sim, GEARS, len(ids))
            for lane, own in enumerate(ids):
                for length in (*before, 0.6 + 0.3 * own):
                    lanes.set_parameters(lane, np.array([length]))
                lanes.reset(lane, own)
            seen = [lanes.observations()]
            for k in range(50):
                lanes.step(list(range(len(ids))), np.array([[actions[own, k]] for own in ids]))
                seen.append(np.column_stack([lanes.observations(), lanes.rewards()]))
            return [np.concatenate([step[lane] for step in seen]) for lane in range(len(ids))]

        sim = pendulum()
        alone = rollout([2])[0]
        np.testing.assert_array_equal(rollout([0, 1, 2, 3])[2], alone)
        np.testing.assert_array_equal(rollout([3, 2])[1], alone)
        np.testing.assert_array_equal(rollout([2], before=(0.7, 1.9, 1.2))[0], alone)  # and twice is once
        self.assertFalse(np.array_equal(rollout([1])[0], alone))

    def test_lanes_that_are_not_listed_stay_and_clocks_and_broken_physics_are_told(self):
        class Broken(gymnasium.Wrapper):
            def step(self, action):
                seen, *rest = super().step(action)
                return (seen * np.nan if action[0] > 1.9 else seen, *rest)

        sim = oted.GymSimulator(lambda: Broken(make_pendulum()), name="Broken", version="1", max_episode_steps=3)
        lanes = lanes_of(sim, n=2)
        for lane in (0, 1):
            lanes.reset(lane, 1)
        before = lanes.observations()[1]
        for status in (0, 0, _engine.core.TRUNCATED):
            lanes.step([0], np.zeros((2, 1)))
            self.assertEqual(lanes.status()[0], status)
        np.testing.assert_array_equal(lanes.observations()[1], before)
        lanes.step([1], np.full((2, 1), 2.0))
        self.assertEqual(lanes.status()[1], _engine.core.DIVERGED)

    def test_delays_and_vectors_of_environments_are_there_as_for_every_task(self):
        late = oted.make_env(pendulum(), parameters={"delay": oted.Param("action/delay", 0, 2, scale="absolute")},
                             sample={"delay": 1})
        prompt = oted.make_env(pendulum())
        vector = oted.make_vec_env(pendulum(), 2, threads=2)
        late.reset(seed=1)
        prompt.reset(seed=1)
        vector.reset(seed=1)
        actions = np.random.default_rng(0).uniform(-2, 2, (10, 1))
        for t in range(10):
            seen = prompt.step(actions[t - 1] if t else np.zeros(1))[0]
            np.testing.assert_array_equal(late.step(actions[t])[0], seen)
            np.testing.assert_array_equal(vector.step(np.array([actions[t - 1] if t else [0.0]] * 2))[0][0], seen)

    def test_discrete_actions_are_indices(self):
        sim = oted.GymSimulator(lambda: gymnasium.make("CartPole-v1"), name="CartPole", version="1", control_period=0.02)
        env, theirs = oted.make_env(sim), gymnasium.make("CartPole-v1")
        self.assertEqual(env.action_space, theirs.action_space)
        start = env.reset(seed=3)[0]
        theirs.reset(seed=3)
        theirs.unwrapped.state = start.copy()
        for k in range(5):
            # Its observations are float32, its state is not: the starts differ by a rounding error.
            np.testing.assert_allclose(env.step(k % 2)[0], theirs.step(k % 2)[0], atol=1e-6)


class Designs(InFolder):
    def test_a_length_is_recovered_where_actions_are_indices(self):
        def set_pole(env, values):
            env.unwrapped.length = values["length"]
            env.unwrapped.polemass_length = env.unwrapped.masspole * values["length"]

        def set_state(env, observation):
            env.unwrapped.state = observation

        sim = oted.GymSimulator(lambda: gymnasium.make("CartPole-v1"), name="Pole", version="1", control_period=0.02,
                                nominal={"length": 0.5}, set_parameters=set_pole, set_state=set_state)
        target, rng, episodes = gymnasium.make("CartPole-v1"), np.random.default_rng(0), []
        set_pole(target, {"length": 0.8})
        for seed in range(8):
            seen, actions = [target.reset(seed=seed)[0]], []
            while len(seen) < 15:
                actions.append([int(rng.integers(2))])
                observation, _, ended, _, _ = target.step(actions[-1][0])
                seen.append(observation)
                if ended:
                    break
            episodes.append((np.array(seen), np.array(actions)))
        design = oted.fit(sim, oted.Logs.from_episodes(episodes), {"length": oted.Param("env/length", 0.3, 3)},
                          out=self.folder / "run", settings={**TINY, "data.episodes": "all"}, **QUICK)
        self.assertAlmostEqual(design.mode["length"], 1.6, delta=1e-3)

    def test_a_length_is_recovered_from_logs_at_a_known_one(self):
        design = oted.fit(pendulum(), pendulum_logs(), GEARS, out=self.folder / "run", settings={"selection.n_seeds": 1}, **QUICK)
        # The logs are float32.
        self.assertAlmostEqual(design.mode["length"], 1.3, delta=1e-3)
        self.assertEqual(design.record["parameters"][0]["verdict"], "identified")
        self.assertIn(design.verdict, ("gap_closed", "gap_narrowed"))

    def test_a_state_that_no_log_shows_is_estimated(self):
        class AngleAlone(gymnasium.ObservationWrapper):
            def __init__(self):
                super().__init__(make_pendulum())
                self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float64)

            def observation(self, observation):
                return self.unwrapped.state[:1].copy()

        def set_state(env, observation, hidden):
            env.unwrapped.state = np.array([observation[0], hidden[0]])

        env = AngleAlone()
        set_length(env, {"length": 0.8})
        random = np.random.default_rng(1)
        episodes = []
        for episode in range(4):
            seen, done = [env.reset(seed=episode)[0]], []
            for k in range(60):
                torque = random.uniform(-2, 2, 1) if k % 5 == 0 else torque
                done.append(torque)
                seen.append(env.step(torque)[0])
            episodes.append((np.array(seen), np.array(done)))
        logs = oted.Logs.from_episodes(episodes, period=0.05, observation_names=["angle"], action_names=["torque"])
        sim = oted.GymSimulator(AngleAlone, name="AngleAlone", version="1", nominal={"length": 1.0}, set_parameters=set_length,
                                set_state=set_state, hidden={"rate": "angle"}, observation_names=["angle"],
                                action_names=["torque"])
        design = oted.fit(sim, logs, GEARS, settings={**TINY, "design.trajectories.rows": 128}, **QUICK)
        self.assertAlmostEqual(design.mode["length"], 0.8, delta=5e-3)

    def test_the_wrapped_hoppers_design_is_that_of_the_built_in_task(self):
        all_of_them = oted.read_logs(HOPPER)
        begin = all_of_them.episodes[0][0]
        rows = slice(begin, begin + 60)
        logs = oted.Logs.from_transitions(all_of_them.observations[rows], all_of_them.actions[rows],
                                          all_of_them.next_observations[rows], period=0.008)
        ours = oted.fit(Hopper.make(), logs, {"friction": oted.Param("env/friction", 0.2, 2.0)}, settings=TINY, **QUICK)
        theirs = oted.fit("Hopper-v5", logs, {"friction": oted.Param("geom/*/friction[0]", 0.2, 2.0)}, settings=TINY,
                          **QUICK)
        for key in ("mode", "std"):
            np.testing.assert_allclose(ours.rows()[0][key], theirs.rows()[0][key], rtol=1e-4)

    def test_without_states_the_design_is_algorithm_1(self):
        tiny = {"clone.hidden": "16", "clone.max_steps": 40, "clone.check_interval": 20, "selection.n_seeds": 1,
                "design.adversarial.n_iterations": 3, "design.adversarial.n_sims": 4, "design.adversarial.n_steps": 20,
                "design.discriminator.hidden": "16", "design.discriminator.steps": 5, "design.discriminator.batch": 32,
                "selection.n_sims": 2, "selection.n_steps": 20, "selection.judge_steps": 20, "report.motion": "false"}
        with self.assertWarnsRegex(UserWarning, "cannot be set to a logged state .its oted.GymSimulator has no set_state"):
            design = oted.fit(pendulum(set_state=None), pendulum_logs(), GEARS, settings=tiny, **QUICK)
        self.assertEqual(design.record["settings"][0]["method"], "paper")

    def test_run_directories_go_on_and_know_their_environment_by_name_and_version(self):
        logs, run = pendulum_logs(), self.folder / "run"
        design = oted.fit(pendulum(), logs, GEARS, out=run, settings=TINY, **QUICK)
        before = (run / "design.json").stat().st_mtime_ns
        self.assertEqual(oted.fit(pendulum(), logs, GEARS, out=run, settings=TINY, **QUICK).record, design.record)
        self.assertEqual((run / "design.json").stat().st_mtime_ns, before)
        with self.assertRaisesRegex(oted.Error, "remove"):
            oted.fit(pendulum(version="2"), logs, GEARS, out=run, settings=TINY, **QUICK)
        self.assertFalse((run / "export/designed.xml").exists())
        self.assertTrue((run / "export/q.json").is_file())
        with self.assertRaisesRegex(oted.UsageError, "no MuJoCo model"):
            design.to_mjcf(self.folder / "designed.xml")

        loaded = oted.load(run)
        env = oted.make_env(loaded)
        self.assertEqual(env.parameters, design.mode)
        np.testing.assert_array_equal(env.reset(seed=1)[0], oted.make_env(design).reset(seed=1)[0])
        evaluation = oted.evaluate(lambda seen: np.zeros((len(seen), 1)), loaded, episodes=2)
        self.assertEqual(evaluation.lengths, [200, 200])
        small = {"sac.hidden": "16", "sac.learning_starts": 100, "sac.eval_interval": 150, "sac.eval_episodes": 1,
                 "report.motion": "false"}
        agent = oted.train(loaded, steps=300, agents=1, progress=False, settings=small)
        self.assertEqual(agent.predict(np.zeros(3))[0].shape, (1,))
        # One run directory holds the agents of one call; another call has its own.
        with self.assertRaisesRegex(oted.UsageError, "other data, settings .* choose another out,"):
            oted.train(loaded, steps=450, agents=1, progress=False, settings=small)
        there = self.folder / "longer"
        longer = oted.train(loaded, steps=450, agents=1, progress=False, settings=small, out=there)
        self.assertEqual(longer.path, there / "policy.onnx")
        self.assertEqual(oted.load(there).record["parameters"], loaded.record["parameters"])
        before = longer.path.stat().st_mtime_ns
        again = oted.train(loaded, steps=450, agents=1, progress=False, settings=small, out=there)
        self.assertEqual(again.path.stat().st_mtime_ns, before)
        another = oted.fit(pendulum(), logs, GEARS, out=self.folder / "another", seed=5, settings=TINY, **QUICK)
        with self.assertRaisesRegex(oted.UsageError, "holds another design"):
            oted.train(another, steps=450, agents=1, progress=False, settings=small, out=there)

        other = subprocess.run([sys.executable, "-c", f"import oted; oted.make_env(oted.load({str(run)!r}))"],
                               env={**os.environ, "PYTHONPATH": FOLDER}, capture_output=True, text=True)
        self.assertIn("'python:Pendulum@1' is an environment of a Python program and not known here", other.stderr)


class Errors(InFolder):
    def test_what_is_no_simulator_is_said_at_once(self):
        def made(**keywords):
            return lambda: pendulum(**keywords)

        class Image(gymnasium.Env):
            observation_space = gymnasium.spaces.Box(0, 255, (4, 4, 3), np.uint8)
            action_space = gymnasium.spaces.Discrete(2)

        for call, error in (
                (made(version="1 beta"), "version: got '1 beta'"), (made(nominal=None), "wanted both"),
                (made(observation_names=["a", "b"]), "wanted 3"), (made(rates={"rate": "angle"}), "'angle' is no observation"),
                (made(set_state=None, hidden={"x": None}), "hidden"), (made(control_period=-1.0), "control_period"),
                (lambda: oted.GymSimulator(Image, name="Image", version="1"), "flat Box"),
                (lambda: oted.GymSimulator(lambda: 3, name="Three", version="1"), "wanted a gymnasium.Env"),
                (lambda: oted.describe(pendulum(), {"l": oted.Param("env/lenght", 0.5, 2)}), "did you mean 'env/length'"),
                (made(nominal={"length": float("nan")}), "nominal: 'length': got nan"), (made(nominal=[1]), "nominal: got"),
                (made(nominal={"length": "a"}), "nominal: 'length': got 'a'"), (made(rates=["x"]), "rates: got"),
                (made(hidden=["a"]), "hidden: got"), (made(set_state=3), "set_state: got 3, wanted a function"),
                (made(max_episode_steps="a"), "max_episode_steps: got 'a'"), (made(control_period=True), "control_period: got True"),
                (made(observation_names="abc"), "observation_names: got 'abc'"),
                (lambda: oted.describe(pendulum(nominal={"length": 0.0}, set_parameters=lambda env, values: None), GEARS),
                 "absolute")):
            with self.assertRaisesRegex(oted.UsageError, error):
                call()

    def test_an_environment_that_cannot_be_made_is_the_cause_of_ours(self):
        def make():
            raise RuntimeError("no such gripper")

        with self.assertRaisesRegex(oted.DataError, "python:None@1.*RuntimeError: no such gripper") as caught:
            oted.GymSimulator(make, name="None", version="1")
        self.assertIsInstance(caught.exception.__cause__, RuntimeError)

    def test_an_exception_of_the_users_code_is_the_cause_of_ours(self):
        class Failing(gymnasium.Wrapper):
            def step(self, action):
                raise RuntimeError("the gripper is on fire")

        sim = oted.GymSimulator(lambda: Failing(make_pendulum()), name="Failing", version="1", set_state=set_pendulum,
                                nominal={"length": 1.0}, set_parameters=set_length,
                                observation_names=["cos", "sin", "rate"], action_names=["torque"])
        calls = [lambda: oted.fit(sim, pendulum_logs(), GEARS, settings=TINY, **QUICK),
                 lambda: oted.check(pendulum_logs(), sim, parameters=GEARS)]
        for call in calls:
            with self.assertRaisesRegex(oted.DataError, "python:Failing@1.*RuntimeError: the gripper is on fire") as caught:
                call()
            cause = caught.exception.__cause__
            self.assertIsInstance(cause, RuntimeError)
            frames = []
            traceback = cause.__traceback__
            while traceback is not None:
                frames.append(traceback.tb_frame.f_code.co_name)
                traceback = traceback.tb_next
            self.assertEqual(frames[-1], "step")

    def test_ctrl_c_stops_within_a_unit_of_work_and_leaves_nothing_half_done(self):
        # Every step takes a hundredth of a second: the units of work last minutes.
        code = f"""
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
sys.argv = ["x", {FOLDER!r}]
sys.path.insert(0, {str(pathlib.Path(__file__).parent)!r})
import test_gym as t
class Slow(t.gymnasium.Wrapper):
    def step(self, action):
        time.sleep(0.01)
        print("step", flush=True) if not getattr(self, "said", False) else None
        self.said = True
        return super().step(action)
sim = t.oted.GymSimulator(lambda: Slow(t.make_pendulum()), name="Slow", version="1", nominal={{"length": 1.0}},
                          set_parameters=t.set_length, set_state=t.set_pendulum,
                          observation_names=["cos", "sin", "rate"], action_names=["torque"])
t.oted.fit(sim, t.pendulum_logs(), t.GEARS, out={str(self.folder / 'run')!r}, progress=False)
"""
        process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.assertEqual(process.stdout.readline().strip(), "step")
        time.sleep(0.5)
        begun = time.monotonic()
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
        self.assertLess(time.monotonic() - begun, 20)  # two seconds, on a machine that does other work
        self.assertIn("KeyboardInterrupt", error)
        self.assertFalse((self.folder / "run/design.json").exists())


if __name__ == "__main__":
    unittest.main()
