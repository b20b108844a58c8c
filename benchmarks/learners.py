"""The agents whose learning learning_curves.py compares, in the order of its tables, and where they learn."""

import dataclasses

from study_data import TASKS


@dataclasses.dataclass(frozen=True)
class Learner:
    title: str
    colour: str | None = None  # of its curves; without one it is in the tables alone
    algorithm: str | None = None  # of this program; none: a peer's
    settings: tuple = ()  # of this program's, besides
    package: str = ""  # a peer's, and what peers/learning_worker.py is told
    peer: dict = dataclasses.field(default_factory=dict)
    every: int = 10_000  # control steps between evaluations
    threads: int = 1  # of this program; with more than one, seconds are those of the clock on the wall


# The nominal simulators, and the quickstart's target: a Hopper with half the friction, weaker and heavier.
PLACES = {**TASKS, "quickstart": "examples/quickstart.toml"}
# Stable-Baselines3's settings, where those of `oted` are others.
PLAIN = ("sac.n_starts=1", "sac.average_over=1", "sac.n_lanes=1", "sac.multi_step=1", "sac.learning_rate=3e-4", "sac.normalize_observations=false", "sac.hidden=256,256",
         "sac.batch_size=256")
PLAIN_CROSSQ = ("crossq.n_starts=1", "crossq.average_over=1", "crossq.n_lanes=1", "crossq.updates_per_step=1", "crossq.hidden=256,256",
                "crossq.critic_hidden=256,256", "crossq.batch_size=256")
# Those of `half`, without its starts and averages; and what sbx earned most with in a minute of a core, of what was tried
# (docs/speed.md).
FAST_SAC = {"algorithm": "SAC", "n_envs": 16, "gradient_steps": 8, "batch_size": 64, "width": 64, "learning_rate": 1e-3, "n_steps": 3,
            "normalize": True, "learning_starts": 1000}
FAST_CROSSQ = {"algorithm": "CrossQ", "n_envs": 64, "gradient_steps": 16, "batch_size": 128, "width": 128, "learning_starts": 5000}
LEARNERS = {
    "default": Learner("the default", "#1f8a4c", "sac", every=20_000),
    "default-two-cores": Learner("the default, on two idle cores", algorithm="sac", every=20_000, threads=2),
    "half": Learner("the default with half of its gradient steps", "#7a3fa0", "sac", ("sac.updates_per_step=0.5",), every=20_000),
    "crossq-default": Learner("CrossQ", "#c23b7a", "crossq", every=50_000),
    "crossq": Learner("CrossQ, settings of its paper", "#1b6ca8", "crossq", PLAIN_CROSSQ),
    "sac": Learner("SAC, settings of Stable-Baselines3", "#c2571a", "sac", PLAIN),
    "sbx-crossq": Learner("sbx's CrossQ, settings for minutes", "#b08d00", package="sbx", peer=FAST_CROSSQ, every=20_000),
    "sbx-sac": Learner("sbx's SAC, our settings", package="sbx", peer=FAST_SAC, every=20_000),
    "stable-baselines3-fast": Learner("Stable-Baselines3's SAC, our settings", package="stable-baselines3", peer=FAST_SAC, every=20_000),
    "stable-baselines3": Learner("Stable-Baselines3's SAC", "#5b5b5b", package="stable-baselines3",
                                 peer={"algorithm": "SAC", "learning_starts": 1000, "width": 256}),
}
# What is compared at equal steps.
PAIRS = (("sac", "stable-baselines3"),)
