"""Demonstrations in robomimic's HDF5 layout, which Isaac Lab writes too, as logs. Needs h5py."""

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oted import _given
from oted._needs import need
from oted.errors import DataError, UsageError
from oted.logs import Logs

Array = NDArray[np.float64]


def read_robomimic(
    path: str | os.PathLike[str],
    *,
    observations: Sequence[str],
    actions: Sequence[str] = ("actions",),
    period: float | None = None,
    episodes: Sequence[str] | None = None,
    mask: str | None = None,
    names: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
    offset: Mapping[str, float] | None = None,
    unwrap: Sequence[str] = (),
) -> Logs:
    """A file with data/demo_0/obs/..., data/demo_0/actions and so on.

    observations: arrays below data/DEMO, such as "obs/robot0_joint_pos", or "robot0_joint_pos" where it lies in obs; their
    columns become channels "robot0_joint_pos[0]", ... names renames them: {"robot0_joint_pos[0]": "joint/shoulder/qpos"}.
    scale and offset correct a channel, after renaming: value * scale + offset; unwrap is as oted.Logs has it. actions: arrays of what was commanded.
    period [s] between two rows: where it is not given, it is 1 / control_freq of the file's env_args. episodes: names of
    demos; mask: those of a filter key, such as "train". Without next_obs a demo's last action is not used."""
    h5py: Any = need("h5py", "a robomimic file")
    path = _given.path("path", path)
    for what, arrays, example in (("observations", observations, "robot0_joint_pos"), ("actions", actions, "actions")):
        if not _given.texts(what, arrays, f"['{example}']"):
            raise UsageError(f"{what}: got none, wanted a list of arrays, such as ['{example}']")
    episodes = None if episodes is None else _given.texts("episodes", episodes, "['demo_0']")
    called_so = _given.texts_by_name("names", names, "{'robot0_joint_pos[0]': 'joint/shoulder/qpos'}")
    factors, zeros = (_given.numbers_by_name(what, given, "{'joint/shoulder/qpos': -1}")
                      for what, given in (("scale", scale), ("offset", offset)))
    try:
        file = h5py.File(path, "r")
    except OSError as e:
        raise DataError(f"'{path}' cannot be opened as HDF5 ({e}); check the path") from e
    with file:
        data = file.get("data")
        if not isinstance(data, h5py.Group):
            raise DataError(f"'{path}' has no group 'data': it is no robomimic file; read D4RL's and Minari's with oted.read_logs")
        parts: list[tuple[Array, Array]] = []
        channels: list[str] = []
        commands: list[str] = []
        for demo in _chosen(file, data, path, episodes, mask):
            seen = [_columns(h5py, data[demo], name, path) for name in observations]
            done = [_columns(h5py, data[demo], name, path) for name in actions]
            rows = _matrix(seen, f"'{path}', {demo}")
            last = [_next(h5py, data[demo], name) for name in observations]
            if all(array is not None for array in last) and len(rows) == len(done[0][0]):
                rows = np.vstack([rows, _matrix([(array, "") for array in last], f"'{path}', {demo}, next_obs")[-1:]])
            parts.append((rows, _matrix(done, f"'{path}', {demo}")))
            channels, commands = _called(seen), _called(done)
        seconds = period if period is not None else _period(data, path)
    renamed, called = ([called_so.get(name, name) for name in names_] for names_ in (channels, commands))
    _given.known("names", called_so, [*channels, *commands])
    _given.known("scale", factors, [*renamed, *called])
    _given.known("offset", zeros, [*renamed, *called])
    factor, zero = ([np.array([given.get(name, rest) for name in names_]) for names_ in (renamed, called)]
                    for given, rest in ((factors, 1.0), (zeros, 0.0)))
    return Logs.from_episodes([(seen * factor[0] + zero[0], done * factor[1] + zero[1]) for seen, done in parts],
                              period=seconds, observation_names=renamed, action_names=called, unwrap=unwrap)


def _chosen(file: Any, data: Any, path: Any, episodes: Sequence[str] | None, mask: str | None) -> list[str]:
    def number(name: str) -> tuple[int, str]:
        digits = name.rpartition("_")[2]
        return (int(digits) if digits.isdigit() else -1, name)

    demos = sorted(data.keys(), key=number)
    if mask is not None:
        mask, keys = _given.text("mask", mask), file.get("mask")
        if keys is None or mask not in keys:
            raise UsageError(f"mask: '{path}' has no filter key '{mask}'; it has {', '.join(keys or []) or 'none'}")
        episodes = [name.decode() if isinstance(name, bytes) else str(name) for name in keys[mask][()]]
    for name in episodes or ():
        if name not in data:
            raise UsageError(f"episodes: '{path}' has no demo '{name}'; it has {', '.join(demos[:5])}, ...")
    chosen = list(demos if episodes is None else episodes)
    if not chosen:
        raise DataError(f"'{path}' holds no demos; was the recording finished?")
    return chosen


def _columns(h5py: Any, demo: Any, name: str, path: Any) -> tuple[Array, str]:
    for place in (name, f"obs/{name}"):
        found = demo.get(place)
        if isinstance(found, h5py.Dataset):
            if found.dtype.kind not in "fiub" or found.ndim not in (1, 2):
                raise UsageError(f"'{path}': {place} is of shape {found.shape} and type {found.dtype}, wanted rows of numbers")
            array = np.asarray(found[()], dtype=np.float64)
            return (array[:, None] if array.ndim == 1 else array), name.removeprefix("obs/")
    there: list[str] = []
    demo.visititems(lambda at, what: there.append(at) if isinstance(what, h5py.Dataset) else None)
    raise UsageError(f"'{path}', {demo.name}: no array '{name}'; there are {', '.join(there)}")


def _next(h5py: Any, demo: Any, name: str) -> Array | None:
    found = demo.get(f"next_obs/{name.removeprefix('obs/')}")
    if not isinstance(found, h5py.Dataset):
        return None
    array = np.asarray(found[()], dtype=np.float64)
    return array[:, None] if array.ndim == 1 else array


def _matrix(arrays: Sequence[tuple[Any, str]], where: str) -> Array:
    lengths = {len(array) for array, _ in arrays}
    if len(lengths) != 1:
        raise DataError(f"{where}: arrays have {', '.join(str(n) for n in sorted(lengths))} rows, wanted as many in each")
    return np.hstack([array for array, _ in arrays])


def _called(arrays: Sequence[tuple[Array, str]]) -> list[str]:
    return [name if array.shape[1] == 1 else f"{name}[{k}]" for array, name in arrays for k in range(array.shape[1])]


def _period(data: Any, path: Any) -> float:
    try:
        frequency = float(json.loads(data.attrs["env_args"])["env_kwargs"]["control_freq"])
        return 1 / frequency
    except (KeyError, TypeError, ValueError, ZeroDivisionError) as e:
        raise UsageError(f"'{path}' does not say its control rate (env_args, control_freq); give period [s]") from e
