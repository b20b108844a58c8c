"""What the columns of a table of logs say: which rows are an episode, and when they were logged."""

import datetime
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from oted import _given
from oted.errors import DataError, UsageError


def column(what: str, given: Any) -> NDArray[Any]:
    """What a frame's column, or a list, holds."""
    _given.unmasked(what, given)
    try:
        return np.asarray(given.to_numpy() if hasattr(given, "to_numpy") else given)
    except (TypeError, ValueError) as e:
        raise UsageError(f"{what}: got {_given.short(given)}, wanted a column ({e})") from e


def labels(what: str, given: Any) -> NDArray[Any]:
    """Of each row. A missing one would make an episode of each row that lacks it."""
    found = column(what, given)
    if found.dtype.kind == "O":
        missing = np.array([_is_missing(what, row, label) for row, label in enumerate(found)], dtype=bool)
    else:
        missing = found != found
    if missing.any():
        row = int(np.argwhere(missing)[0][0])
        raise UsageError(f"{what}: row {row} has no label (got {found[row]!r}); fill it in, or leave the row out")
    return found


def _is_missing(what: str, row: int, label: Any) -> bool:
    try:
        hash(label)
    except TypeError as e:
        raise DataError(f"{what}: row {row} has the label {_given.short(label)}, wanted a number or a text") from e
    same = label == label
    return label is None or not isinstance(same, (bool, np.bool_)) or not same  # pandas.NA gives neither


def episode_ends(n_rows: int, given: Sequence[int] | None, of_rows: ArrayLike | None) -> list[int]:
    if given is not None and of_rows is not None:
        raise UsageError("got episode_ends and episode, which say the same; give one")
    if of_rows is not None:
        return _ends_of_labels(n_rows, labels("episode", of_rows))
    if given is None:
        return [n_rows]
    found = [_given.whole("episode_ends", int(end) if isinstance(end, float) and end.is_integer() else end, 1)
             for end in _given.listed("episode_ends", given, "whole numbers, one past the last row of each episode")]
    if not found or found[-1] != n_rows or any(b <= a for a, b in zip([0, *found], found)):
        raise UsageError(f"episode_ends: got {found[:5]}..., wanted rising numbers up to the {n_rows} rows")
    return found


def _ends_of_labels(n_rows: int, of_rows: NDArray[Any]) -> list[int]:
    if of_rows.shape != (n_rows,):
        raise UsageError(f"episode: got shape {of_rows.shape}, wanted a label for each of {n_rows} rows")
    ends = [*(int(i) + 1 for i in np.flatnonzero(of_rows[1:] != of_rows[:-1])), n_rows]
    begun: set[Any] = set()
    for begin in [0, *ends[:-1]] if n_rows else []:
        label = of_rows[begin].item() if hasattr(of_rows[begin], "item") else of_rows[begin]
        if label in begun:
            raise UsageError(f"episode: label {label!r} comes again at row {begin}, after another; sort the rows by it")
        begun.add(label)
    return ends


def together(of_rows: NDArray[Any]) -> NDArray[np.int64]:
    """The order in which the rows of a label stand together, labels in the order in which they come first."""
    first: dict[Any, int] = {}
    return np.argsort([first.setdefault(label, len(first)) for label in of_rows.tolist()], kind="stable")


def seconds(what: str, values: NDArray[Any]) -> NDArray[np.float64]:
    """From numbers [s], or from time stamps, with or without a time zone."""
    if values.dtype.kind == "O" and any(isinstance(value, datetime.datetime) for value in values):
        values = np.array([_utc(what, row, value) for row, value in enumerate(values)])
    if values.dtype.kind not in "mM":
        return _given.numbers(what, values, "seconds or time stamps")
    if np.isnat(values).any():
        raise UsageError(f"{what}: row {int(np.flatnonzero(np.isnat(values))[0])} has no time; fill it in, or leave the row out")
    nanoseconds = values.astype(values.dtype.kind + "8[ns]").astype(np.int64)
    since: NDArray[np.float64] = (nanoseconds - nanoseconds[0]) * 1e-9
    return since


def _utc(what: str, row: int, stamp: Any) -> np.datetime64:
    if hasattr(stamp, "to_datetime64"):  # pandas, which knows nanoseconds
        moment: np.datetime64 = stamp.to_datetime64()
        return moment
    if not isinstance(stamp, datetime.datetime):
        raise UsageError(f"{what}: got {_given.short(stamp)} in row {row}, wanted a time stamp as in other rows")
    return np.datetime64(stamp if stamp.tzinfo is None else stamp.astimezone(datetime.UTC).replace(tzinfo=None), "ns")
