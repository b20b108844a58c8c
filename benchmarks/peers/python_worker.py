"""One Python peer of sac_peers.py: python_worker.py PACKAGE updates|training|environments TASK

A line "SECONDS" on stdin runs a slice of that much CPU time and is answered by "COUNT CPU_SECONDS WALL_SECONDS".
"""

import os
import sys
import time

os.environ["PYGAME_HIDE_SUPPORT_PROMPT"] = "1"


class Slices:
    """Asks for the next slice, and knows when it is over."""

    def __init__(self):
        print("ready", flush=True)
        self.next()

    def next(self):
        line = sys.stdin.readline()
        if not line:
            os._exit(0)
        self.seconds = float(line)
        self.count = 0
        self.cpu, self.wall = time.process_time(), time.perf_counter()

    def tick(self, n=1):
        self.count += n
        cpu = time.process_time() - self.cpu
        if cpu >= self.seconds:
            print(self.count, cpu, time.perf_counter() - self.wall, flush=True)
            self.next()


def agent(package, task):
    """SAC with the settings that all share: those of Stable-Baselines3."""
    if package == "sbx":
        import jax

        from sbx import SAC

        jax.config.update("jax_platforms", "cpu")
    else:
        import torch
        from stable_baselines3 import SAC

        torch.set_num_threads(1)
    return SAC("MlpPolicy", task, learning_starts=1000, batch_size=256, seed=1,
               policy_kwargs={"net_arch": [256, 256]}, **({} if package == "sbx" else {"device": "cpu"}))


def updates(package, task):
    model = agent(package, task)
    model.learn(total_timesteps=1100)
    slices = Slices()
    while True:
        model.train(gradient_steps=1, batch_size=256)
        slices.tick()


def training(package, task):
    from stable_baselines3.common.callbacks import BaseCallback

    class Pause(BaseCallback):
        slices = None

        def _on_step(self):
            if self.num_timesteps == 1100:
                self.slices = Slices()
            elif self.num_timesteps > 1100:
                self.slices.tick()
            return True

    agent(package, task).learn(total_timesteps=10**8, callback=Pause())


def environments(package, task):
    import numpy as np

    random = np.random.default_rng(1)
    if package == "gymnasium":
        import gymnasium

        env = gymnasium.make(task)
        env.reset(seed=1)
        actions = random.uniform(-1, 1, (1000, *env.action_space.shape)).astype(np.float32)
        slices = Slices()
        while True:
            for action in actions:
                _, _, terminated, truncated, _ = env.step(action)
                if terminated or truncated:
                    env.reset()
                slices.tick()
    import envpool

    n = int(package.split("-")[1])
    env = envpool.make(task.replace("-v5", "-v4"), env_type="gymnasium", num_envs=n, num_threads=1)
    env.reset()
    actions = random.uniform(-1, 1, (1000, n, *env.action_space.shape))
    slices = Slices()
    while True:
        for action in actions:
            env.step(action)  # begins anew where an episode has ended
            slices.tick(n)


if __name__ == "__main__":
    {"updates": updates, "training": training, "environments": environments}[sys.argv[2]](sys.argv[1], sys.argv[3])
