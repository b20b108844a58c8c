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
PLAIN = ("sac.n_lanes=1", "sac.multi_step=1", "sac.learning_rate=3e-4", "sac.normalize_observations=false", "sac.hidden=256,256",
         "sac.batch_size=256")
SMALL = (*PLAIN, "sac.hidden=64,64", "sac.batch_size=64")
LEARNERS = {
    "default": Learner("SAC, the default", "#1f8a4c", "sac", every=20_000),
    "default-one-step": Learner("SAC, the default, rewards of one step", None, "sac", ("sac.multi_step=1",), every=20_000),
    "crossq": Learner("CrossQ", "#1b6ca8", "crossq"),
    "crossq-starts-1000": Learner("CrossQ, 1,000 random steps first", "#8db9dc", "crossq", ("crossq.learning_starts=1000",)),
    "sac": Learner("SAC", "#c2571a", "sac", PLAIN),
    "stable-baselines3": Learner("Stable-Baselines3's SAC", "#5b5b5b"),
    "sac-small": Learner("SAC, small", None, "sac", SMALL),
    "sac-small-normalized": Learner("SAC, small, observations normalised", None, "sac",
                                    (*SMALL, "sac.normalize_observations=true")),
    "stable-baselines3-small": Learner("Stable-Baselines3's SAC, small", width=64, batch=64),
}
# What is compared at equal steps: our SAC and Stable-Baselines3's, a setting and its default.
PAIRS = (("sac", "stable-baselines3"), ("sac-small", "stable-baselines3-small"), ("sac-small-normalized", "sac-small"))
