"""Channels logged at times and rates of their own, made rows of one grid, by the rules of docs/file_formats.md#from-times-to-rows.

Angles must not wrap and quaternions must not change sign between two samples: unwrap them before."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from oted._engine import core
from oted.errors import UsageError
from oted.logs import Logs

Array = NDArray[np.float64]


@dataclasses.dataclass
class Channel:
    """One number over time. name: what the task calls it, "joint/elbow/qpos"; times [s]."""

    name: str
    times: ArrayLike
    values: ArrayLike
    source: str = ""  # for errors: topic and field

    def arrays(self) -> tuple[str, str, Array, Array]:
        times, values = (np.ascontiguousarray(given, dtype=np.float64) for given in (self.times, self.values))
        if times.shape != values.shape or times.ndim != 1:
            raise UsageError(f"channel '{self.name}'" + (f" ({self.source})" if self.source else "") + f": got {times.shape} "
                             f"times and {values.shape} values, wanted a time for each value")
        return self.name, self.source, times, values


def to_logs(
    states: Sequence[Channel],
    actions: Sequence[Channel],
    period: float,
    *,
    most_gap: float = core.MOST_GAP,
) -> Logs:
    """The rows of one recording; several recordings are joined by +. period [s] is the task's control period. A gap of more
    than most_gap typical steps of a state ends an episode."""
    return Logs._of(core.logs_from_streams([channel.arrays() for channel in states],
                                           [channel.arrays() for channel in actions], float(period), float(most_gap)))
