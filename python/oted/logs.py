"""Logged trajectories: what a design is fitted to."""

import os
import pathlib
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from oted import _given, _rows
from oted._engine import core
from oted._needs import need
from oted.errors import UsageError
from oted.task import TaskLike, study

Array = NDArray[np.float64]


def _maybe(name: str, given: ArrayLike | None, ndim: int) -> Array | None:
    return None if given is None else _array(name, given, ndim)


def _flags(name: str, given: ArrayLike | None) -> Array | None:
    return None if given is None else _given.flags(name, given).astype(np.float64)


def _array(name: str, given: ArrayLike, ndim: int) -> Array:
    array = _given.numbers(name, given)
    if array.ndim == 1 and ndim == 2:
        array = array[:, None]
    if array.ndim != ndim:
        raise UsageError(f"{name}: got an array of shape {array.shape}, wanted {ndim} dimensions")
    return array


class Logs:
    """Rows of logs, in the order in which they were logged. Row k of an episode holds the observation s_k and the action
    a_k that was commanded then and held until row k + 1. An episode's last row gives its final observation; its action
    is not read.

    observations: (rows, channels). actions: (rows, actions).
    episode_ends: one past the last row of each episode; episode: a label per row instead. Without both: one episode.
    terminated: one flag per episode: it ended in a terminal state, not by a time limit or the end of the log.
    times: [s] per row. period: [s] between two rows; with both, rows come at one per period, by the rules that hold for CSV
    (docs/file_formats.md#from-times-to-rows): observations linearly, the action in force, an end where rows are missing.
    unwrap: angles [rad] that the log keeps within one turn, by name or pattern (`joint/*/qpos`).
    """

    def __init__(
        self,
        observations: ArrayLike,
        actions: ArrayLike,
        *,
        episode_ends: Sequence[int] | None = None,
        episode: ArrayLike | None = None,
        terminated: Sequence[bool] | None = None,
        times: ArrayLike | None = None,
        period: float | None = None,
        rewards: ArrayLike | None = None,
        qpos: ArrayLike | None = None,
        qvel: ArrayLike | None = None,
        observation_names: Sequence[str] = (),
        action_names: Sequence[str] = (),
        unwrap: Sequence[str] = (),
    ) -> None:
        seen = _array("observations", observations, 2)
        ends = _rows.episode_ends(len(seen), episode_ends, episode)
        flags = (np.zeros(len(ends), dtype=bool) if terminated is None else
                 _given.flags("terminated", terminated, "episode"))
        if len(flags) != len(ends):
            raise UsageError(f"terminated: got {len(flags)} flags, wanted one for each of the {len(ends)} episodes")
        runs = list(zip([0, *ends[:-1]], ends, flags.tolist()))
        self._set(core.logs_from_rows(
            seen, _array("actions", actions, 2), runs, _maybe("times", times, 1), _maybe("rewards", rewards, 1),
            _maybe("qpos", qpos, 2), _maybe("qvel", qvel, 2), _names("observation_names", observation_names),
            _names("action_names", action_names), _period(period), _patterns(unwrap)))

    def _set(self, data: "core.Dataset", path: str | None = None) -> None:
        self._data = data
        self._path = path

    @classmethod
    def _of(cls, data: "core.Dataset", path: str | None = None) -> "Logs":
        logs = cls.__new__(cls)
        logs._set(data, path)
        return logs

    @classmethod
    def from_episodes(cls, episodes: Iterable[tuple[ArrayLike, ArrayLike]], **keywords: Any) -> "Logs":
        """From (observations (T + 1, d), actions (T, a) or (T + 1, a)) for each episode."""
        all_observations: list[Array] = []
        all_actions: list[Array] = []
        ends: list[int] = []
        for i, pair in enumerate(_given.listed("episodes", episodes, "a list of (observations, actions)")):
            try:
                observations, actions = pair
            except (TypeError, ValueError) as e:
                raise UsageError(f"episode {i}: wanted (observations, actions)") from e
            seen, done = _array(f"observations of episode {i}", observations, 2), _array(f"actions of {i}", actions, 2)
            if len(seen) - len(done) not in (0, 1):
                raise UsageError(f"episode {i}: got {len(seen)} observations and {len(done)} actions, wanted as many, or "
                                 "one observation more")
            if all_actions and (seen.shape[1], done.shape[1]) != (all_observations[0].shape[1], all_actions[0].shape[1]):
                raise UsageError(f"episode {i}: got {seen.shape[1]} observations and {done.shape[1]} actions, the first has "
                                 f"{all_observations[0].shape[1]} and {all_actions[0].shape[1]}")
            if len(done) < len(seen):
                done = np.vstack([done, np.zeros((1, done.shape[1]))])
            all_observations.append(seen)
            all_actions.append(done)
            ends.append(len(seen) + (ends[-1] if ends else 0))
        if not ends:
            raise UsageError("no episodes were given")
        return cls(np.vstack(all_observations), np.vstack(all_actions), episode_ends=ends, **keywords)

    @classmethod
    def from_transitions(
        cls,
        observations: ArrayLike,
        actions: ArrayLike,
        next_observations: ArrayLike,
        *,
        terminals: ArrayLike | None = None,
        timeouts: ArrayLike | None = None,
        rewards: ArrayLike | None = None,
        period: float | None = None,
        observation_names: Sequence[str] = (),
        action_names: Sequence[str] = (),
        unwrap: Sequence[str] = (),
    ) -> "Logs":
        """From D4RL's arrays, one row per transition: an episode ends after each terminal and each timeout."""
        return cls._of(core.logs_from_transitions(
            _array("observations", observations, 2), _array("actions", actions, 2),
            _array("next_observations", next_observations, 2), _flags("terminals", terminals),
            _flags("timeouts", timeouts), _maybe("rewards", rewards, 1), _names("observation_names", observation_names),
            _names("action_names", action_names), _period(period), _patterns(unwrap)))

    @classmethod
    def from_pandas(
        cls,
        frame: Any,
        *,
        observations: Sequence[str],
        actions: Sequence[str],
        episode: str | None = None,
        time: str | None = None,
        period: float | None = None,
        reward: str | None = None,
        terminated: str | None = None,
        observation_names: Sequence[str] | None = None,
        action_names: Sequence[str] | None = None,
        unwrap: Sequence[str] = (),
    ) -> "Logs":
        """From a DataFrame of pandas, Polars or pyarrow, or any mapping of columns, one row as in Logs. The columns keep
        their names, by which a task finds them; give others where the task has others. `episode` groups the rows, wherever
        they stand, as groupby does. A column of times is numbers [s] or time stamps; with `period` rows come at one per
        period, and missing ones are filled in or end the episode. `terminated` names a column of flags, read in each
        episode's last row."""
        def found(name: str) -> NDArray[Any]:
            try:
                values = frame[name]
            except Exception as e:
                raise UsageError(f"the frame has no column '{name}'") from e
            return _rows.column(f"column '{name}'", values)

        for what, names in (("observations", observations), ("actions", actions)):
            if not _given.texts(what, names, "['hip', 'knee']"):
                raise UsageError(f"{what}: wanted a list of columns")
        if not len(found(observations[0])):
            raise UsageError(f"column '{observations[0]}' has no rows, wanted a frame with at least one")
        labels = None if episode is None else _rows.labels(f"column '{episode}'", found(episode))
        order = slice(None) if labels is None else _rows.together(labels)

        def column(name: str) -> NDArray[Any]:
            return found(name)[order]

        def matrix(names: Sequence[str]) -> Array:
            return np.column_stack([_array(f"column '{name}'", column(name), 1) for name in names])

        labels = None if labels is None else labels[order]
        flags = None
        if terminated is not None:
            ends = _rows.episode_ends(len(found(observations[0])), None, labels)
            flags = _given.flags(f"column '{terminated}'", found(terminated))[order][np.array(ends) - 1]
        return cls(matrix(observations), matrix(actions), episode=labels,
                   times=None if time is None else _rows.seconds(f"column '{time}'", found(time))[order], period=period,
                   rewards=None if reward is None else _array(f"column '{reward}'", column(reward), 1), terminated=flags,
                   observation_names=observations if observation_names is None else observation_names,
                   action_names=actions if action_names is None else action_names, unwrap=unwrap)

    def __len__(self) -> int:
        return len(self._data)

    @property
    def observations(self) -> Array:
        """(transitions, channels)"""
        return self._data.observations

    @property
    def actions(self) -> Array:
        """(transitions, actions)"""
        return self._data.actions

    @property
    def next_observations(self) -> Array:
        """(transitions, channels): what each action led to."""
        return self._data.next_observations

    @property
    def rewards(self) -> Array | None:
        rewards = self._data.rewards
        return rewards if len(rewards) else None

    @property
    def episodes(self) -> list[tuple[int, int, bool]]:
        """(begin, end, terminated) of each, rows of transitions."""
        return self._data.episodes()

    @property
    def observation_names(self) -> list[str]:
        return self._data.observation_names

    @property
    def action_names(self) -> list[str]:
        return self._data.action_names

    @property
    def period(self) -> float | None:
        """[s] between two rows, where it is known."""
        return self._data.period or None

    @property
    def path(self) -> str | None:
        """The file that these logs are, unchanged; None where they were made or chosen in memory."""
        return self._path

    @property
    def remarks(self) -> list[str]:
        """What the reader inferred, left out or changed, by its documented rules."""
        return [*self._data.warnings, *self._data.remarks]

    def select(self, episodes: Sequence[int]) -> "Logs":
        """The episodes of these numbers, from 0, in that order."""
        n = len(self.episodes)
        chosen = _given.listed("episodes", episodes, "a list of numbers from 0")
        for i in chosen:
            if isinstance(i, bool) or not isinstance(i, (int, np.integer)) or not 0 <= i < n:
                raise UsageError(f"episode {i!r} does not exist; there are {n}, from 0")
        return Logs._of(self._data.select(chosen))

    @property
    def constants(self) -> dict[str, Array]:
        """What is known of the recording that each row is of; NaN where it is as in the model."""
        values = self._data.constants
        return {name: values[:, k] for k, name in enumerate(self._data.constant_names)}

    def with_constants(self, **values: float) -> "Logs":
        """The same with what is known of this recording: values of constants that the task declares ([task.constants],
        oted.Task(constants=...)). Join recordings by +; what one of them does not say is there as in the model."""
        data = self._data.copy()
        for name, value in values.items():
            data.set_constant(_given.text("constant", name), _given.finite(
                f"constant '{name}'", value, "leave it out where it is as in the model"))
        return Logs._of(data)

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError("oted.Logs cannot be pickled or deep-copied: logs.save(path), and oted.read_logs(path) there")

    def __add__(self, other: "Logs") -> "Logs":
        """Both, one after the other; no episode goes on across the seam. Where both have names, channels go by them."""
        if not isinstance(other, Logs):
            return NotImplemented
        data = self._data.copy()
        data.append(other._data)
        return Logs._of(data)

    def to_pandas(self) -> Any:
        """A pandas DataFrame of rows, as from_pandas reads them: `episode` (from 0), `time` [s] within it where the period is
        known, a column for each observation and action (observation_0, ... where they have no names), `reward` where there
        is one, `terminated`. An episode's last row has its final observation, and NaN for action and reward."""
        frames = need("pandas", "a table")
        seen = self.observation_names or [f"observation_{k}" for k in range(self.observations.shape[1])]
        done = self.action_names or [f"action_{k}" for k in range(self.actions.shape[1])]
        episodes = []
        for number, (begin, end, terminated) in enumerate(self.episodes):
            rows = np.vstack([self.observations[begin:end], self.next_observations[end - 1:end]])
            columns: dict[str, Any] = {"episode": number}
            if self.period:
                columns["time"] = self.period * np.arange(len(rows))
            columns |= dict(zip(seen, rows.T))
            columns |= dict(zip(done, np.vstack([self.actions[begin:end], np.full((1, len(done)), np.nan)]).T))
            if self.rewards is not None:
                columns["reward"] = np.append(self.rewards[begin:end], np.nan)
            episodes.append(frames.DataFrame(columns | {"terminated": terminated}))
        return frames.concat(episodes, ignore_index=True)

    def save(self, path: str | os.PathLike[str], task: TaskLike = None) -> None:
        """Writes .npz, .hdf5, .csv or .csv.gz; with a task, in the order of its channels. A table alone keeps names and
        times."""
        file = _given.path("path", path)
        if task is None and self.observation_names and not file.endswith((".csv", ".csv.gz")):
            warnings.warn(f"'{file}' keeps no names of channels: whoever reads it takes them in the order of the "
                          "task; save with task=..., or as .csv", stacklevel=2)
        core.write_logs(self._data, file, study(task))

    def __repr__(self) -> str:
        seen, done = self.observations.shape[1], self.actions.shape[1]
        return (f"Logs({len(self)} transitions, {len(self.episodes)} episodes, {seen} observations, {done} actions"
                + (f", {self._path!r}" if self._path else "") + ")")


def _patterns(given: Sequence[str]) -> list[str]:
    return _given.texts("unwrap", given, "['joint/hip/qpos']")


def _names(what: str, given: Sequence[str]) -> list[str]:
    return _given.texts(what, given, "['joint/hip/qpos']")


def _period(given: float | None) -> float:
    """0 where it is not known."""
    return 0.0 if given is None else _given.seconds("period", given)


_BAG = "oted.bags.read_bag, which is told the topics (oted.bags.bag_topics lists them)"
_READERS = {".mcap": _BAG, ".bag": _BAG, ".db3": _BAG,
            ".parquet": "oted.Logs.from_pandas(pandas.read_parquet(path), observations=[...], actions=[...])"}
_FOLDERS = {"metadata.yaml": _BAG, "meta/info.json": "oted.lerobot.read_lerobot"}


def file_of(logs: Any) -> str:
    """The path of what should be a file of logs."""
    if isinstance(logs, (str, os.PathLike)):
        path = pathlib.Path(_given.path("logs", logs, "oted.Logs or a file"))
        reader = _READERS.get(path.suffix)
        if path.is_dir():
            reader = next((its for mark, its in _FOLDERS.items() if (path / mark).exists()), reader)
        if reader is not None:
            raise UsageError(f"'{path}' is read by {reader}")
        return os.fspath(logs)
    remedy = {"list": "join several by +: oted.read_logs('a.csv') + oted.read_logs('b.csv')",
              "tuple": "join several by +: oted.read_logs('a.csv') + oted.read_logs('b.csv')",
              "ndarray": "oted.Logs(observations, actions) makes logs of arrays",
              "DataFrame": "oted.Logs.from_pandas(frame, observations=[...], actions=[...]) makes logs of it"}
    kind = type(logs).__name__
    raise UsageError(f"logs: got {kind}, wanted oted.Logs or a file" + (f"; {remedy[kind]}" if kind in remedy else ""))


def write_logs(logs: Logs, folder: str | os.PathLike[str], what: "core.Study") -> str:
    """The path of a file of the logs in `folder`, in the order of the task's channels. A table alone holds constants."""
    path = os.path.join(folder, "logs.csv.gz" if logs.constants else "logs.npz")
    core.write_logs(logs._data, path, what)
    return path


def read_logs(
    path: str | os.PathLike[str],
    task: TaskLike = None,
    *,
    episodes: int | None = None,
    format: str | None = None,
    action_delay: int = 0,
    unwrap: Sequence[str] = (),
) -> Logs:
    """Reads .hdf5 (D4RL or Minari), .npz, .csv, .csv.gz, or a Minari folder, by the program's own readers; with a task,
    in its channels' order and at its control period. `episodes`: the first so many. unwrap: as Logs has it."""
    chosen = {"episodes": None if episodes is None else str(_given.whole("episodes", episodes, 1)), "format": format,
              "action_delay": action_delay or None, "unwrap": _patterns(unwrap) or None}
    data = core.read_logs(study(task, data={"path": file_of(path), **chosen}))
    plain = all(v is None for v in chosen.values())
    return Logs._of(data, os.fspath(path) if plain else None)
