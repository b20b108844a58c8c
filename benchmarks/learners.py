"""The agents whose learning learning_curves.py compares, in the order of its tables, and where they learn."""

import dataclasses

from study_data import TASKS


@dataclasses.dataclass(frozen=True)
class Learner:
    title: str
    colour: str | None = None  # of its curves; without one it is in the tables alone
    algorithm: str | None = None  # of this program; none: Stable-Baselines3's SAC
    settings: tuple = ()  # of this program's, besides
    width: int = 256  # of Stable-Baselines3's two hidden layers
    batch: int = 256  # of Stable-Baselines3's
    every: int = 10_000  # control steps between evaluations


# The nominal simulators, and the quickstart's target: a Hopper with half the friction, weaker and heavier.
PLACES = {**TASKS, "quickstart": "examples/quickstart.toml"}
# Stable-Baselines3's settings, where those of `oted` are others.
PLAIN = ("sac.n_starts=1", "sac.average_over=1", "sac.n_lanes=1", "sac.multi_step=1", "sac.learning_rate=3e-4", "sac.normalize_observations=false", "sac.hidden=256,256",
         "sac.batch_size=256")
PLAIN_CROSSQ = ("crossq.n_starts=1", "crossq.average_over=1", "crossq.n_lanes=1", "crossq.updates_per_step=1", "crossq.hidden=256,256",
                "crossq.critic_hidden=256,256", "crossq.batch_size=256")
ONE_START = ("sac.n_starts=1", "sac.average_over=1")
LEARNERS = {
    "default": Learner("the default", "#1f8a4c", "sac", ("sac.n_starts=3", "sac.average_over=1000"), every=20_000),
    "one-start": Learner("the default from one start, weights not averaged", "#7a3fa0", "sac", ONE_START, every=20_000),
    "crossq-default": Learner("CrossQ", "#c23b7a", "crossq", every=50_000),
    "crossq": Learner("CrossQ, settings of its paper", "#1b6ca8", "crossq", PLAIN_CROSSQ),
    "sac": Learner("SAC, settings of Stable-Baselines3", "#c2571a", "sac", PLAIN),
    "stable-baselines3": Learner("Stable-Baselines3's SAC", "#5b5b5b"),
}
# What is compared at equal steps.
PAIRS = (("sac", "stable-baselines3"),)
