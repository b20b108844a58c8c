"""Other people's agents in our environments, unchanged: test_training.py [FOLDER], which holds the package oted where it is
not installed. Needs stable-baselines3; sbx's part is left out where sbx is not installed."""

import importlib.util
import pathlib
import sys
import unittest
import warnings

if len(sys.argv) > 1 and not sys.argv[1].startswith("-"):
    sys.path.insert(0, str(pathlib.Path(sys.argv.pop(1)).resolve()))

import gymnasium  # noqa: E402
import numpy as np  # noqa: E402
from stable_baselines3 import PPO, SAC  # noqa: E402
from stable_baselines3.common.env_checker import check_env  # noqa: E402
from stable_baselines3.common.env_util import make_vec_env  # noqa: E402
from stable_baselines3.common.monitor import Monitor  # noqa: E402
from stable_baselines3.common.vec_env import VecNormalize  # noqa: E402

import oted  # noqa: E402

PARAMETERS = {"gravity": oted.Param("opt/gravity[2]", 0.2, 2.0), "delay": oted.Param("action/delay", 0, 2, scale="absolute")}


class StableBaselines(unittest.TestCase):
    def test_its_checker_passes(self):
        for name, keywords in (("Hopper-v5", {}), ("HalfCheetah-v5", {"parameters": PARAMETERS, "sample": {"delay": 1}})):
            with warnings.catch_warnings():
                # It asks for actions in [-1, 1] of float32 and for observations of float32; Gymnasium's own have float64.
                warnings.simplefilter("error")
                warnings.filterwarnings("ignore", message=".*float32.*")
                check_env(oted.make_env(name, **keywords))

    def test_its_agents_learn_in_the_single_environment(self):
        SAC("MlpPolicy", Monitor(oted.make_env("Hopper-v5")), seed=1, device="cpu", learning_starts=50).learn(150)

    def test_its_agents_and_wrappers_take_the_vector_environment(self):
        env = VecNormalize(oted.sb3.make_vec_env("Hopper-v5", 4, parameters=PARAMETERS, sample={"gravity": 1.2}))
        agent = PPO("MlpPolicy", env, seed=1, device="cpu", n_steps=128, batch_size=128).learn(1024)
        self.assertGreater(len(agent.ep_info_buffer), 5)  # episodes ended and were told

    def test_the_same_seed_trains_the_same_agent_as_in_gymnasiums_environments(self):
        """The vector environment is Gymnasium's to the last bit of what Stable-Baselines3 sees of it: float32."""
        def train(env):
            agent = PPO("MlpPolicy", env, seed=3, device="cpu", n_steps=64, batch_size=64)
            agent.learn(512)
            return np.concatenate([p.detach().numpy().ravel() for p in agent.policy.parameters()])

        def theirs():
            env = gymnasium.make("Hopper-v5")
            env = gymnasium.wrappers.TransformAction(env, lambda a: np.asarray(a, dtype=np.float64), env.action_space)
            return gymnasium.wrappers.TransformObservation(
                env, lambda o: o.astype(np.float32), gymnasium.spaces.Box(-np.inf, np.inf, (11,), np.float32))

        ours = train(oted.sb3.make_vec_env("Hopper-v5", 2))
        np.testing.assert_array_equal(ours, train(make_vec_env(theirs, 2)))


class CleanRl(unittest.TestCase):
    """What CleanRL's scripts do with environments."""

    def test_its_wrappers_take_a_registered_environment(self):
        oted.register("Hopper-v5", "OtedClean-v0", parameters=PARAMETERS, sample={"gravity": 0.8})

        def make():
            env = gymnasium.wrappers.RecordEpisodeStatistics(gymnasium.wrappers.FlattenObservation(gymnasium.make("OtedClean-v0")))
            env = gymnasium.wrappers.NormalizeObservation(gymnasium.wrappers.ClipAction(env))
            return gymnasium.wrappers.NormalizeReward(env, gamma=0.99)

        envs = gymnasium.vector.SyncVectorEnv([make] * 3)
        self.run_loop(envs)

    def test_its_loop_takes_the_vector_environment(self):
        self.run_loop(gymnasium.wrappers.vector.RecordEpisodeStatistics(oted.make_vec_env("Hopper-v5", 3)))
        mode = gymnasium.vector.AutoresetMode.SAME_STEP
        self.run_loop(gymnasium.wrappers.vector.RecordEpisodeStatistics(
            oted.make_vec_env("Hopper-v5", 3, autoreset_mode=mode)), final_obs=True)

    def run_loop(self, envs, final_obs=False):
        self.assertIsInstance(envs.single_action_space, gymnasium.spaces.Box)
        observations, _ = envs.reset(seed=1)
        returns = []
        random = np.random.default_rng(0)
        for _ in range(200):
            actions = random.uniform(-1, 1, (envs.num_envs, *envs.single_action_space.shape)).astype(np.float32)
            next_observations, rewards, terminations, truncations, infos = envs.step(actions)
            self.assertEqual((rewards.shape, terminations.dtype, truncations.dtype), ((3,), np.bool_, np.bool_))
            if "episode" in infos:
                returns += [infos["episode"]["r"][i] for i in np.flatnonzero(infos["_episode"])]
            real_next = next_observations.copy()
            if final_obs:
                for i in np.flatnonzero(terminations | truncations):
                    real_next[i] = infos["final_obs"][i]
            self.assertTrue(np.isfinite(real_next).all())
            observations = next_observations
        self.assertGreater(len(returns), 5)
        self.assertEqual(observations.shape[0], 3)


@unittest.skipUnless(importlib.util.find_spec("sbx"), "sbx is not installed")
class Sbx(unittest.TestCase):
    def test_its_agents_take_both_environments(self):
        import sbx
        sbx.SAC("MlpPolicy", oted.make_env("Hopper-v5"), seed=1, learning_starts=50).learn(150)
        sbx.PPO("MlpPolicy", oted.sb3.make_vec_env("Hopper-v5", 4), seed=1, n_steps=64, batch_size=64).learn(512)


if __name__ == "__main__":
    unittest.main()
