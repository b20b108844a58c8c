"""Channels logged at times and rates of their own, made rows of one grid, by the rules of docs/file_formats.md#from-times-to-rows.

Quaternions must not change sign between two samples: make their signs agree before."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from oted import _given
from oted._engine import core
from oted.errors import UsageError
from oted.logs import Logs, _array, _patterns

Array = NDArray[np.float64]


@dataclasses.dataclass
class Channel:
    """One number over time. name: what the task calls it, "joint/elbow/qpos"; times [s]."""

    name: str
    times: ArrayLike
    values: ArrayLike
    source: str = ""  # for errors: topic and field

    def arrays(self) -> tuple[str, str, Array, Array]:
        _given.text("channel: name", self.name, "a text, such as 'joint/elbow/qpos'")
        _given.text(f"channel '{self.name}': source", self.source)
        times, values = (_array(f"channel '{self.name}'", given, 1) for given in (self.times, self.values))
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
    unwrap: Sequence[str] = (),
) -> Logs:
    """The rows of one recording; several recordings are joined by +. period [s] is the task's control period. A gap of more
    than most_gap typical steps of a state ends an episode. unwrap: states [rad] that are kept within one turn, by name or
    pattern."""
    given = [[_arrays(channel) for channel in _given.listed(what, channels, "a list of channels")]
             for what, channels in (("states", states), ("actions", actions))]
    return Logs._of(core.logs_from_streams(given[0], given[1], _given.seconds("period", period),
                                           _given.number("most_gap", most_gap), _patterns(unwrap)))


def _arrays(channel: Channel) -> tuple[str, str, Array, Array]:
    if not isinstance(channel, Channel):
        raise UsageError(f"got {type(channel).__name__}, wanted oted.streams.Channel(name, times, values)")
    return channel.arrays()
