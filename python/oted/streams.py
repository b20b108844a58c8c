"""Channels logged at times and rates of their own, made rows of one grid. The rule:

- Rows are `period` apart, from the moment when every channel has begun to the moment when the first state ends.
- A state is interpolated linearly between its neighbours in time; nothing is extrapolated.
- An action is the last one commanded at or before the row (zero-order hold).
- Where two neighbours of a state are more than `most_gap` of its median periods apart, no row lies between them: the
  episode ends before the gap and another begins behind it.
- A sample whose time does not rise is dropped; where it is more than one in a hundred, that is an error.

Angles must not wrap and quaternions must not change sign between two samples: unwrap them before."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from oted.errors import DataError, UsageError
from oted.logs import Logs

Array = NDArray[np.float64]
MOST_OUT_OF_ORDER = 0.01


@dataclasses.dataclass
class Channel:
    """One number over time. name: what the task calls it, "joint/elbow/qpos"; times [s]."""

    name: str
    times: ArrayLike
    values: ArrayLike
    source: str = ""  # for errors: topic and field

    def sound(self) -> tuple[Array, Array]:
        """Times that rise, and the values there. @throws DataError"""
        times, values = (np.asarray(given, dtype=np.float64) for given in (self.times, self.values))
        what = f"channel '{self.name}'" + (f" ({self.source})" if self.source else "")
        if times.shape != values.shape or times.ndim != 1:
            raise UsageError(f"{what}: got {times.shape} times and {values.shape} values, wanted a time for each value")
        if len(times) < 2:
            raise DataError(f"{what} has {len(times)} samples, wanted at least 2; is its topic recorded?")
        finite = np.isfinite(times) & np.isfinite(values)
        if not finite.all():
            raise DataError(f"{what}: {int((~finite).sum())} of {len(times)} samples are not finite; leave them out")
        highest = np.maximum.accumulate(times)
        rises = np.concatenate([[True], times[1:] > highest[:-1]])
        n_bad = int((~rises).sum())
        if n_bad > MOST_OUT_OF_ORDER * len(times):
            raise DataError(f"{what}: {n_bad} of {len(times)} time stamps do not rise; use the recording's own times "
                            "(time='log'), or repair the clock")
        return times[rises], values[rises]


def to_logs(
    states: Sequence[Channel],
    actions: Sequence[Channel],
    period: float,
    *,
    most_gap: float = 3.0,
) -> Logs:
    """The rows of one recording, by the rule above; several recordings are joined by +. period [s] is the task's control
    period."""
    if not states or not actions:
        raise UsageError(f"got {len(states)} states and {len(actions)} actions, wanted at least one of each")
    if not period > 0:
        raise UsageError(f"period: got {period}, wanted a positive number of seconds")
    seen = [channel.sound() for channel in states]
    done = [channel.sound() for channel in actions]
    # From here on times are small: float64 resolves 0.2 microseconds in a time since 1970.
    start = max(times[0] for times, _ in [*seen, *done])
    end = min(times[-1] for times, _ in seen)
    n = int(np.floor((end - start) / period + 1e-9)) + 1
    if n < 2:
        raise DataError(f"the channels overlap for {max(end - start, 0):.3g} s, wanted at least two periods of {period} s; "
                        "are their clocks the same? (time='log' takes the recording's)")
    grid = start + period * np.arange(n)
    grid[-1] = min(grid[-1], end)
    keep = np.ones(n, dtype=bool)
    for times, _ in seen:
        keep &= ~_in_gap(grid, times, most_gap)
    observations = np.column_stack([np.interp(grid - start, times - start, values) for times, values in seen])
    at = grid + 1e-6 * period  # a hair's breadth before a row is at it
    commanded = np.column_stack([values[np.searchsorted(times, at, side="right") - 1] for times, values in done])
    # Rows of one stretch; a stretch of one row holds no transition.
    breaks = np.flatnonzero(np.diff(keep.astype(np.int8), prepend=0, append=0))
    runs = [(a, b) for a, b in breaks.reshape(-1, 2) if b - a >= 2]
    if not runs:
        raise DataError(f"no two rows of the grid lie outside of gaps; is a period of {period} s right?")
    rows = np.concatenate([np.arange(a, b) for a, b in runs])
    return Logs(observations[rows], commanded[rows], episode_ends=list(np.cumsum([b - a for a, b in runs])),
                period=period, observation_names=[c.name for c in states], action_names=[c.name for c in actions])


def _in_gap(grid: Array, times: Array, most_gap: float) -> NDArray[np.bool_]:
    steps = np.diff(times)
    allowed = most_gap * float(np.median(steps))
    after = np.clip(np.searchsorted(times, grid, side="left"), 1, len(times) - 1)
    between = (grid > times[after - 1]) & (grid < times[after])
    inside: NDArray[np.bool_] = between & (steps[after - 1] > allowed)
    return inside
