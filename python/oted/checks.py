"""What can be told of logs before a design."""

import html
import json
import os
from collections.abc import Iterator
from typing import Any

from oted import _given
from oted._engine import core
from oted.logs import Logs, file_of
from oted.task import ParametersLike, TaskLike, study


class Check:
    """Findings, each a dict with check, severity, what, meaning, remedy, channels. `record` is all of
    oted.data_check/1 (docs/file_formats.md)."""

    def __init__(self, record: dict[str, Any]) -> None:
        self.record = record
        self.findings: list[dict[str, Any]] = record["findings"]

    @property
    def errors(self) -> list[dict[str, Any]]:
        return [finding for finding in self.findings if finding["severity"] == "error"]

    @property
    def warnings(self) -> list[dict[str, Any]]:
        return [finding for finding in self.findings if finding["severity"] == "warning"]

    @property
    def gap(self) -> str | None:
        """Whether the nominal simulator differs from the logs: none, small or clear; None without a task."""
        gap = self.record.get("gap")
        return gap["verdict"] if isinstance(gap, dict) and "verdict" in gap else None

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter(self.findings)

    def __repr__(self) -> str:
        lines = [f"{f['severity']}: {f['check']}: {f['what']}"
                 + (f"\n    do: {f['remedy']}" if f["severity"] != "note" and f.get("remedy") else "")
                 for f in self.findings] or ["no findings"]
        return "\n".join([*lines, f"gap: {self.gap}"] if self.gap else lines)

    def _repr_html_(self) -> str:
        rows = "".join(
            "<tr>" + "".join(f"<td style='text-align:left'>{html.escape(str(f.get(key) or ''))}</td>"
                             for key in ("severity", "check", "what", "meaning", "remedy")) + "</tr>"
            for f in self.findings)
        head = "".join(f"<th>{name}</th>" for name in ("severity", "check", "what", "meaning", "remedy"))
        gap = f"<p>Gap between logs and nominal simulator: <b>{html.escape(self.gap)}</b></p>" if self.gap else ""
        return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>{gap}"


def check(
    logs: Logs | str | os.PathLike[str],
    task: TaskLike = None,
    *,
    parameters: ParametersLike = None,
    seed: int = 1,
    threads: int | None = None,
) -> Check:
    """The checks of `oted data check`: defects of the logs, what they mean, what to do. With a task also the one-step
    error and whether there is a gap; with parameters their effect on the logged episodes."""
    seed = _given.seed(seed)
    in_memory = isinstance(logs, Logs)
    what = study(task, parameters, data=None if in_memory else {"path": file_of(logs)}, threads=threads)
    return Check(json.loads(core.check_logs(logs._data if isinstance(logs, Logs) else None, what, seed)))
