"""The design: a simulator fitted to logs."""

import os
import pathlib
import tempfile
from collections.abc import Mapping
from typing import Any

from oted import _given, _toml
from oted._engine import core
from oted.design import Design
from oted.errors import DataError, UsageError
from oted.logs import Logs, file_of, write_logs
from oted.progress import Callback, handler
from oted.task import ParametersLike, TaskLike, needed, study

PathLike = str | os.PathLike[str]


def fit(
    task: TaskLike,
    logs: Logs | PathLike | None = None,
    parameters: ParametersLike = None,
    *,
    out: PathLike | None = None,
    seeds: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: bool = True,
    callback: Callback | None = None,
) -> Design:
    """Finds the distribution q(z) over the parameters with which the simulator moves as the logs do: `oted design`.

    task: "Hopper-v5", a task file (.toml), or an oted.Task. A file's own [data], [parameters] and settings hold unless
    they are given here. logs: oted.Logs or a file. parameters: {"friction": oted.Param(path, low, high)}, a preset
    such as "arm", or parameters of mujoco.sysid. out: the run directory; repeat a call to resume it. Without it
    the directory is temporary, until Design.save. seeds: seeded designs. seed: of every random stream; the same seed
    gives the same bytes, at any number of threads and by the program as well. settings: {"design.method": "paper"}
    and the like, as --set takes them (docs/configuration.md). callback: oted.progress.

    Ctrl-C stops between two units of work and raises KeyboardInterrupt; the same call goes on from there.
    """
    needed(task)
    if not os.fspath(task if isinstance(task, (str, os.PathLike)) else "").endswith(".toml"):  # a file says them itself
        if logs is None:
            raise UsageError("logs: wanted oted.Logs or a file")
        if parameters is None or (isinstance(parameters, Mapping) and not parameters):
            raise UsageError("parameters: wanted {'friction': oted.Param(path, low, high)} or presets; "
                             "oted.describe(task)['offers'] lists the paths")
    folder = _given.folder("out", tempfile.mkdtemp(prefix="oted-") if out is None else out)
    path = _logs_path(logs, task, folder)
    what = study(task, parameters, data={"path": path} if path else None, folder=folder / "given")
    given = {"run.seed": seed, "run.threads": threads, "selection.n_seeds": seeds}
    words = _toml.assignments({key: v for key, v in given.items() if v is not None}) + _toml.assignments(settings)
    run_stage(what, folder, words, "design", "oted.fit", progress, callback)
    return Design(folder, temporary=out is None)


def run_stage(
    what: "core.Study | None", folder: pathlib.Path, words: list[str], stage: str, command: str, progress: bool,
    callback: Callback | None,
) -> None:
    """One stage in a run directory. what: a study, or None for the directory's own run.toml."""
    handle, close = handler(progress, callback)
    try:
        core.run_stage(what, str(folder), words, stage, command, handle)
    finally:
        close()


def _logs_path(logs: Logs | PathLike | None, task: TaskLike, folder: pathlib.Path) -> str | None:
    if logs is None:
        return None
    if not isinstance(logs, Logs):
        return file_of(logs)
    if logs.path is not None:
        return logs.path
    given = folder / "given"
    try:
        given.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise DataError(f"out: '{folder}' cannot be made: {e.strerror}; name another folder") from e
    return write_logs(logs, given.resolve(), study(task, folder=given))
