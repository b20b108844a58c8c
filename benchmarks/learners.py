"""The agents whose learning learning_curves.py compares, in the order of its tables."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Learner:
    title: str
    colour: str | None = None  # of its curves; without one it is in the tables alone
    algorithm: str | None = None  # of this program; none: Stable-Baselines3's SAC
    settings: tuple = ()  # of this program's, besides
    width: int = 256  # of Stable-Baselines3's two hidden layers
    batch: int = 256  # of Stable-Baselines3's


SMALL = ("sac.hidden=64,64", "sac.batch_size=64")
LEARNERS = {
    "crossq": Learner("CrossQ", "#1b6ca8", "crossq"),
    "crossq-starts-1000": Learner("CrossQ, 1,000 random steps first", "#8db9dc", "crossq", ("crossq.learning_starts=1000",)),
    "sac": Learner("SAC", "#c2571a", "sac"),
    "stable-baselines3": Learner("Stable-Baselines3's SAC", "#5b5b5b"),
    "sac-small": Learner("SAC, small", None, "sac", SMALL),
    "sac-small-normalized": Learner("SAC, small, observations normalised", None, "sac",
                                    (*SMALL, "sac.normalize_observations=true")),
    "stable-baselines3-small": Learner("Stable-Baselines3's SAC, small", width=64, batch=64),
}
# What is compared at equal steps: our SAC and Stable-Baselines3's, a setting and its default.
PAIRS = (("sac", "stable-baselines3"), ("sac-small", "stable-baselines3-small"), ("sac-small-normalized", "sac-small"))
