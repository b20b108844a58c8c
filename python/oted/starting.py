"""A first task file, from a model and logs."""

import json
import os
from collections.abc import Sequence
from typing import Any

from oted import _given
from oted._engine import core

Path = str | os.PathLike[str]


class Proposal:
    """A task file that was written, and what it rests on. `record` is all of oted.init/1 (docs/file_formats.md)."""

    def __init__(self, record: dict[str, Any]) -> None:
        self.record = record
        self.path: str = record["task_file"]
        self.columns: dict[str, str] = {entry["column"]: entry["path"] for entry in record["columns"]}
        self.guessed: list[str] = record["guessed"]
        self.suspicious: list[str] = record["suspicious"]

    def __repr__(self) -> str:
        with open(self.path, encoding="utf-8") as file:
            return file.read()


def init(model: Path, logs: Path | Sequence[Path], out: Path = "task.toml", *, period: float | None = None,
         threads: int | None = None) -> Proposal:
    """`oted init`: a first task file from a model and logs. It matches columns with joints, actuators and sensors by
    name, and picks parameters that the logs can show. period: [s] between two rows, where the logs do not say."""
    files = [_given.path("logs", one, "files; write what is in memory with Logs.save('log.csv')")
             for one in (logs if isinstance(logs, (list, tuple)) else [logs])]
    seconds = 0.0 if period is None else _given.seconds("period", period)
    n_threads = 0 if threads is None else _given.whole("threads", threads, 0)
    return Proposal(json.loads(core.init(_given.path("model", model), files, _given.path("out", out), seconds, n_threads)))
