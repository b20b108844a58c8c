"""Stable-Baselines3's SAC on the batches of sac_worker: sac_losses.py TASK FOLDER

FOLDER is what `sac_worker losses` left: parameters, and batches with their noise and our losses. Loads the parameters into an agent of
Stable-Baselines3, has its own train() make the same gradient steps from the same batches and noise, and prints one JSON object: for each
loss ours and theirs, step by step.
"""

import json
import os
import pathlib
import sys

os.environ["PYGAME_HIDE_SUPPORT_PROMPT"] = "1"

import numpy
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.type_aliases import ReplayBufferSamples

LOSSES = ("critic_loss", "actor_loss", "ent_coef", "ent_coef_loss")


def load(layers, flat):
    """Flat parameters, for each layer weight (in, out) and bias, into linear layers; a list is one layer in parts."""
    at = 0
    for parts in layers:
        parts = parts if isinstance(parts, list) else [parts]
        n_in, widths = parts[0].in_features, [part.out_features for part in parts]
        weight = torch.tensor(flat[at:at + n_in * sum(widths)]).reshape(n_in, sum(widths))
        at += weight.numel()
        bias = torch.tensor(flat[at:at + sum(widths)])
        at += bias.numel()
        for part, w, b in zip(parts, weight.split(widths, 1), bias.split(widths)):
            part.weight.data.copy_(w.T)
            part.bias.data.copy_(b)
    assert at == len(flat)


def linear(network):
    return [layer for layer in network if isinstance(layer, torch.nn.Linear)]


class Given:
    """A replay buffer whose every draw is `batch`."""

    def sample(self, batch_size, env=None):
        del env
        of = lambda name: torch.tensor(self.batch[name]).reshape(batch_size, -1)
        observations = torch.tensor(self.batch["observations"]).reshape(2 * batch_size, -1)
        actions = of("joint")[:, observations.shape[1]:]
        return ReplayBufferSamples(observations[:batch_size], actions, observations[batch_size:], (of("discounts") == 0).float(), of("rewards"))


def main():
    task, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    torch.set_num_threads(1)
    model = SAC("MlpPolicy", task, batch_size=256, device="cpu", policy_kwargs={"net_arch": [256, 256]})
    start = numpy.load(folder / "start.npz")
    actor = model.actor
    load([*linear(actor.latent_pi), [actor.mu, actor.log_std]], start["sac/actor/parameters"])
    for i in range(2):
        load(linear(getattr(model.critic, f"qf{i}")), start[f"sac/critic{i}/parameters"])
        load(linear(getattr(model.critic_target, f"qf{i}")), start[f"sac/target{i}"])
    model.replay_buffer = Given()
    model.set_logger(Logger(folder=None, output_formats=[]))
    noise = []
    torch.distributions.normal._standard_normal = lambda shape, **_: noise.pop(0).reshape(shape)
    ours, theirs = [], []
    for step in range(len(list(folder.glob("*.npz"))) - 1):
        batch = numpy.load(folder / f"{step}.npz")
        model.replay_buffer.batch = batch
        n = len(batch["rewards"])
        used = 2 * n * model.action_space.shape[0]  # the last one of an odd number is not
        noise[:] = torch.tensor(batch["noise"][:used]).reshape(2, n, -1)
        model.train(gradient_steps=1, batch_size=n)
        assert not noise
        ours.append(batch["losses"].tolist())
        theirs.append([float(model.logger.name_to_value[f"train/{name}"]) for name in LOSSES])
        model.logger.name_to_value.clear()
        model.logger.name_to_count.clear()
    print(json.dumps({name: {"ours": [o[i] for o in ours], "theirs": [t[i] for t in theirs]} for i, name in enumerate(LOSSES)}))


main()
