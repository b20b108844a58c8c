"""LeRobot's data sets (v2.0, v2.1, v3.0) as logs. Needs pyarrow."""

import json
import os
import pathlib
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oted import _given
from oted._needs import need
from oted.errors import DataError, UsageError
from oted.logs import Logs

Array = NDArray[np.float64]


def read_lerobot(
    path: str | os.PathLike[str],
    *,
    episodes: Sequence[int] | None = None,
    state: str = "observation.state",
    action: str = "action",
    observation_names: Sequence[str] | None = None,
    action_names: Sequence[str] | None = None,
    scale: float | Sequence[float] = 1.0,
    unwrap: Sequence[str] = (),
) -> Logs:
    """A data set's folder. Rows lie at frame_index / fps, as its float32 time stamps lose milliseconds: missing frames are
    filled in or end the episode (docs/file_formats.md#from-times-to-rows). Cameras are not read. scale multiplies states and actions, such as pi / 180 for arms that log degrees: nothing is guessed.
    unwrap: as oted.Logs has it, after scaling.

    An action that is the next measured position, as teleoperation often logs it, makes the controller part of the
    simulator."""
    folder = pathlib.Path(_given.path("path", path, "the path of a folder"))
    state, action = _given.text("state", state), _given.text("action", action)
    wanted = None if episodes is None else [
        _given.whole("episodes", i, 0) for i in _given.listed("episodes", episodes, "a list of numbers from 0")]
    if wanted == []:
        raise UsageError("episodes: got [], wanted numbers from 0; leave it out for all")
    features, rate = _info(folder)
    rows = _rows_of(folder, state, action, features, wanted)
    missing = sorted(set(wanted or ()) - rows.keys())
    if missing:
        raise UsageError(f"episodes: episode {missing[0]} is not in '{folder}'")
    widths = {(seen.shape[1], done.shape[1]) for pieces in rows.values() for _, seen, done in pieces}
    if len(widths) > 1:
        raise DataError(f"'{folder}': files have rows of {' and '.join(f'{n} states, {m} actions' for n, m in sorted(widths))}, "
                        "wanted as many in each; choose other episodes")
    parts = [_in_order(folder, episode, rows[episode]) for episode in sorted(rows)]
    frames, seen, done = (np.concatenate([part[k] for part in parts]) for k in range(3))
    factor = _factor(scale, seen.shape[1], done.shape[1])
    has_gaps = any((np.diff(part[0]) != 1).any() for part in parts)
    return Logs(
        seen * factor, done * factor, episode_ends=np.cumsum([len(part[0]) for part in parts]).tolist(),
        period=1 / rate, times=frames / rate if has_gaps else None,
        observation_names=_names(features, state, seen.shape[1]) if observation_names is None else observation_names,
        action_names=_names(features, action, done.shape[1]) if action_names is None else action_names, unwrap=unwrap)


def _info(folder: pathlib.Path) -> tuple[dict[str, Any], float]:
    """The features, and frames per second."""
    file = folder / "meta" / "info.json"
    try:
        info = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as e:
        raise DataError(f"'{folder}' is no LeRobot data set: meta/info.json cannot be read ({e})") from e
    features = info.get("features", {}) if isinstance(info, dict) else None
    if not isinstance(features, dict):
        what = "it" if features is None else "its features"
        raise DataError(f"'{file}': {what} should be an object of JSON; is this a LeRobot data set?")
    rate = info.get("fps")
    if isinstance(rate, bool) or not isinstance(rate, (int, float)) or not 0 < rate < np.inf:
        raise DataError(f"'{file}': got fps {_given.short(rate)}, wanted frames per second, above 0; correct the file")
    return features, float(rate)


Rows = tuple[NDArray[np.int64], Array, Array]  # frame_index, states, actions


def _rows_of(folder: pathlib.Path, state: str, action: str, features: Mapping[str, Any],
             wanted: Collection[int] | None) -> dict[int, list[Rows]]:
    """The rows of each episode, in the order of the files."""
    parquet = need("pyarrow.parquet", "a LeRobot data set", "pyarrow")
    rows: dict[int, list[Rows]] = {}
    files = sorted((folder / "data").glob("*/*.parquet"))
    if not files:
        raise DataError(f"'{folder}' has no data/*/*.parquet; is the download complete?")
    for file in files:
        try:
            table = parquet.read_table(file, columns=["episode_index", "frame_index", state, action])
        except Exception as e:  # pyarrow raises many kinds
            raise DataError(f"'{file}': pyarrow cannot read {state} and {action} ({e}); the columns are "
                            f"{', '.join(features)}") from e
        if table.num_rows == 0:
            continue
        index, frames = (_whole(file, name, table[name]) for name in ("episode_index", "frame_index"))
        seen, done = (_vectors(file, name, table[name]) for name in (state, action))
        for episode in np.unique(index).tolist():
            if wanted is None or episode in wanted:
                mine = index == episode
                rows.setdefault(episode, []).append((frames[mine], seen[mine], done[mine]))
    if not rows and wanted is None:
        raise DataError(f"'{folder}': data/*/*.parquet hold no rows; is the recording complete?")
    return rows


def _whole(file: pathlib.Path, name: str, column: Any) -> NDArray[np.int64]:
    found = column.to_numpy()
    if found.dtype.kind not in "iu":  # a null makes them floats
        raise DataError(f"'{file}': column '{name}' should hold a whole number in each row; correct the file")
    return np.asarray(found, dtype=np.int64)


def _vectors(file: pathlib.Path, name: str, column: Any) -> Array:
    """(rows, numbers)"""
    found = column.to_numpy(zero_copy_only=False)
    try:
        vectors = _given.numbers(name, np.stack([np.atleast_1d(row) for row in found]))
    except ValueError as e:
        raise DataError(f"'{file}': column '{name}' should hold as many numbers in each row ({e}); correct the file") from e
    if vectors.ndim != 2 or not np.isfinite(vectors).all():
        row = 0 if vectors.ndim != 2 else int(np.argmin(np.isfinite(vectors).all(axis=1)))
        raise DataError(f"'{file}': column '{name}' holds {_given.short(found[row])} in row {row}, wanted a list of finite "
                        "numbers; correct the file")
    return vectors


def _in_order(folder: pathlib.Path, episode: int, pieces: Sequence[Rows]) -> Rows:
    """By frame_index, whatever the order in the files."""
    frames, seen, done = (np.concatenate([piece[k] for piece in pieces]) for k in range(3))
    order = np.argsort(frames, kind="stable")
    frames = frames[order]
    twice = np.flatnonzero(np.diff(frames) == 0)
    if len(twice):
        raise DataError(f"'{folder}': episode {episode} has frame_index {frames[twice[0]]} twice; leave one of them out")
    return frames, seen[order], done[order]


def _factor(scale: Any, n_states: int, n_actions: int) -> Array:
    factor = _given.numbers("scale", scale)
    if factor.shape not in ((), (n_states,)) or factor.shape not in ((), (n_actions,)) or not np.isfinite(factor).all():
        raise UsageError(f"scale: got {_given.short(scale)}, wanted a number, or one for each channel where there are as many "
                         f"states ({n_states}) as actions ({n_actions})")
    return factor


def _names(features: Mapping[str, Any], feature: str, n: int) -> list[str]:
    found = features.get(feature)
    names = found.get("names") if isinstance(found, dict) else None
    if isinstance(names, dict):  # {"motors": [...]}
        names = [name for group in names.values() for name in (group if isinstance(group, list) else [])]
    if not isinstance(names, list) or len(names) != n:
        return []
    return [str(name) for name in names]
