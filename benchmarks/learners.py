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
# Contenders for the default. A start of 60,000 steps is where the default's seeds differ most.
STARTS = ("sac.n_starts=3", "sac.start_steps=60000", "sac.average_over=1000")
# Networks of half the width, batches of half the size, a quarter of an update a step: some thirty times the steps in a second.
NARROW = ("crossq.n_lanes=16", "crossq.updates_per_step=0.25", "crossq.hidden=128,128", "crossq.critic_hidden=128,128",
          "crossq.batch_size=128", "crossq.average_over=1000", "crossq.n_starts=3")
LEARNERS = {
    "default": Learner("the default", "#1f8a4c", "sac", every=20_000),
    "default-starts": Learner("the default, best of three starts, averaged weights", "#7a3fa0", "sac", STARTS, every=20_000),
    "crossq-128": Learner("CrossQ, 2x128, a quarter of an update a step, best of three starts, averaged weights", "#c23b7a",
                          "crossq", NARROW, every=50_000),
    "crossq": Learner("CrossQ", "#1b6ca8", "crossq"),
    "sac": Learner("SAC, settings of Stable-Baselines3", "#c2571a", "sac", PLAIN),
    "stable-baselines3": Learner("Stable-Baselines3's SAC", "#5b5b5b"),
}
# What is compared at equal steps.
PAIRS = (("sac", "stable-baselines3"),)
