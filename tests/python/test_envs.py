"""Environments of the Python package, beside Gymnasium's: test_envs.py FOLDER, which holds the package oted, "" where it is
installed."""

import os
import subprocess
import sys
import unittest
import warnings

from support import PENDULUM, InFolder, take_package

FOLDER = take_package(__doc__)

import gymnasium  # noqa: E402
import numpy as np  # noqa: E402

import oted  # noqa: E402


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

    def test_in_a_forked_process_threads_are_an_error_and_no_hang(self):
        code = """
import os, signal
import numpy as np, oted
one, two = (oted.make_vec_env("Hopper-v5", 4, threads=threads) for threads in (1, 2))
for env in (one, two): env.reset(seed=1)
child = os.fork()
if child == 0:
    signal.alarm(60)
    one.step(np.zeros((4, 3)))
    for call in (lambda: two.step(np.zeros((4, 3))), lambda: two.reset(seed=1)):
        try: call()
        except oted.UsageError as e: print(e, flush=True)
else:
    assert os.waitpid(child, 0)[1] == 0
    two.step(np.zeros((4, 3)))
    print("the parent goes on")
"""
        done = subprocess.run([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": FOLDER}, capture_output=True,
                              text=True, timeout=120, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        said = "a simulator with several threads does not survive a fork; make it in the child process, or with one thread"
        self.assertEqual(done.stdout.splitlines(), [said, said, "the parent goes on"])

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

    def test_a_closed_environment_says_so(self):
        single, vector = oted.make_env("Hopper-v5", render_mode="rgb_array"), oted.make_vec_env("Hopper-v5", 2)
        for env, actions in ((single, np.zeros(3)), (vector, np.zeros((2, 3)))):
            env.reset(seed=1)
            env.step(actions)
            for _ in range(2):
                env.close()
            for kind in (oted.UsageError, gymnasium.error.ClosedEnvironmentError):
                for call in (lambda: env.step(actions), env.reset):
                    with self.assertRaisesRegex(kind, "the environment is closed"):
                        call()
        with self.assertRaisesRegex(oted.UsageError, "the environment is closed"):
            single.render()

    def test_a_masked_action_is_refused(self):
        single, vector = oted.make_env("Hopper-v5"), oted.make_vec_env("Hopper-v5", 2)
        for env, hidden in ((single, [0, 1, 0]), (vector, [[0, 0, 0], [1, 0, 0]])):
            env.reset(seed=1)
            with self.assertRaisesRegex(oted.UsageError, "row 1 is masked"):
                env.step(np.ma.array(np.zeros(np.shape(hidden)), mask=hidden))

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


if __name__ == "__main__":
    unittest.main()
