"""An agent of Stable-Baselines3 or of sbx for learning_curves.py: learning_worker.py PACKAGE TASK SEED STEPS SECONDS EVERY EPISODES SETTINGS

Trains for STEPS control steps or SECONDS of CPU time, whichever comes first. SETTINGS is JSON: what is not an argument of the
algorithm is `algorithm`, `n_envs` (environments stepped one after the other), `width` (of the two hidden layers) and `normalize`
(observations by their running mean and spread). One JSON line per evaluation: step, mean return of EPISODES episodes of the mean
action, CPU and wall seconds of learning.
"""

import json
import os
import sys
import time

os.environ["PYGAME_HIDE_SUPPORT_PROMPT"] = "1"

from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecNormalize


class Evaluations(BaseCallback):
    def __init__(self, environment, statistics, every, episodes, seconds):
        super().__init__()
        self.environment, self.statistics = environment, statistics
        self.every, self.episodes, self.seconds, self.next = every, episodes, seconds, every
        self.cpu, self.wall = time.process_time(), time.perf_counter()

    def _on_step(self):
        if self.num_timesteps < self.next:
            return True
        self.next += self.every
        cpu, wall = time.process_time(), time.perf_counter()
        if self.statistics is not None:
            self.environment.obs_rms = self.statistics.obs_rms
        mean_return, _ = evaluate_policy(self.model, self.environment, self.episodes, deterministic=True)
        print(json.dumps({"step": self.num_timesteps, "mean_return": float(mean_return), "cpu_seconds": cpu - self.cpu,
                          "wall_seconds": wall - self.wall}), flush=True)
        # Looking does not count.
        self.cpu += time.process_time() - cpu
        self.wall += time.perf_counter() - wall
        return cpu - self.cpu < self.seconds


def algorithms(package):
    if package == "sbx":
        import jax
        import sbx

        jax.config.update("jax_platforms", "cpu")
        return sbx, {}
    import stable_baselines3
    import torch

    torch.set_num_threads(1)
    return stable_baselines3, {"device": "cpu"}


def main():
    package, task = sys.argv[1:3]
    seed, steps, seconds, every, episodes = map(int, sys.argv[3:8])
    settings = json.loads(sys.argv[8])
    name, width = settings.pop("algorithm"), settings.pop("width")
    normalize = settings.pop("normalize", False)
    training, looked_at = make_vec_env(task, settings.pop("n_envs", 1), seed=seed), make_vec_env(task, 1, seed=1000 + seed)
    if normalize:
        training = VecNormalize(training, norm_reward=False)
        looked_at = VecNormalize(looked_at, training=False, norm_reward=False)
    module, device = algorithms(package)
    model = getattr(module, name)("MlpPolicy", training, seed=seed, policy_kwargs={"net_arch": [width, width]}, **settings, **device)
    model.learn(total_timesteps=steps, callback=Evaluations(looked_at, training if normalize else None, every, episodes, seconds))


main()
