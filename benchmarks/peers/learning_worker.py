"""Stable-Baselines3's SAC for learning_curves.py: learning_worker.py TASK SEED STEPS EVERY EPISODES WIDTH BATCH

One JSON line per evaluation: step, mean return of EPISODES episodes of the mean action, CPU and wall seconds of learning.
"""

import json
import os
import sys
import time

os.environ["PYGAME_HIDE_SUPPORT_PROMPT"] = "1"

import gymnasium
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.evaluation import evaluate_policy


class Evaluations(BaseCallback):
    def __init__(self, task, every, episodes, seed):
        super().__init__()
        self.environment = gymnasium.make(task)
        self.environment.reset(seed=1000 + seed)
        self.every, self.episodes = every, episodes
        self.cpu, self.wall = time.process_time(), time.perf_counter()

    def _on_step(self):
        if self.num_timesteps % self.every:
            return True
        cpu, wall = time.process_time(), time.perf_counter()
        mean_return, _ = evaluate_policy(self.model, self.environment, self.episodes, deterministic=True)
        print(json.dumps({"step": self.num_timesteps, "mean_return": float(mean_return), "cpu_seconds": cpu - self.cpu,
                          "wall_seconds": wall - self.wall}), flush=True)
        # Looking does not count.
        self.cpu += time.process_time() - cpu
        self.wall += time.perf_counter() - wall
        return True


def main():
    task, (seed, steps, every, episodes, width, batch) = sys.argv[1], map(int, sys.argv[2:8])
    torch.set_num_threads(1)
    model = SAC("MlpPolicy", task, learning_starts=1000, batch_size=batch, seed=seed, device="cpu",
                policy_kwargs={"net_arch": [width, width]})
    model.learn(total_timesteps=steps, callback=Evaluations(task, every, episodes, seed))


main()
