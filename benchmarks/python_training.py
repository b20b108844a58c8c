"""How fast Stable-Baselines3 trains in our vector environment and in Gymnasium's own, one after the other in each round:
python benchmarks/python_training.py [--package FOLDER] [--rounds 5]. Needs stable-baselines3."""

import argparse
import pathlib
import sys
import time

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--package", help="the folder that holds the package oted, where it is not installed")
parser.add_argument("--rounds", type=int, default=5)
parser.add_argument("--lanes", type=int, default=8)
parser.add_argument("--steps", type=int, default=8192, help="of each training")
parser.add_argument("--tasks", nargs="+", default=["Hopper-v5", "HalfCheetah-v5", "Walker2d-v5"])
given = parser.parse_args()
if given.package:
    sys.path.insert(0, str(pathlib.Path(given.package).resolve()))

import numpy as np  # noqa: E402
import torch  # noqa: E402
from stable_baselines3 import PPO  # noqa: E402
from stable_baselines3.common.env_util import make_vec_env  # noqa: E402

import oted  # noqa: E402

torch.set_num_threads(1)


def step(env):
    env.reset()
    actions = np.zeros((given.lanes, *env.action_space.shape), dtype=np.float32)
    for _ in range(given.steps // given.lanes):
        env.step(actions)


def train(env):
    PPO("MlpPolicy", env, seed=1, device="cpu", n_steps=256, batch_size=256, n_epochs=4).learn(given.steps)


for task in given.tasks:
    envs = {"oted": oted.sb3.make_vec_env(task, given.lanes), "Gymnasium": make_vec_env(task, given.lanes)}
    for what, run in (("steps alone", step), ("PPO", train)):
        rates = {name: [] for name in envs}
        run(envs["Gymnasium"])  # torch's own first steps are nobody's
        for _ in range(given.rounds):
            for name, env in envs.items():
                begun = time.process_time()
                run(env)
                rates[name].append(given.steps / (time.process_time() - begun))
        median = {name: float(np.median(values)) for name, values in rates.items()}
        ratios = np.divide(rates["oted"], rates["Gymnasium"])
        print(f"{task}, {what}: oted {median['oted']:,.0f}, Gymnasium {median['Gymnasium']:,.0f} steps per CPU second; "
              f"ratio of each round {ratios.min():.2f} to {ratios.max():.2f}", flush=True)
