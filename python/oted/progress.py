"""What a run tells while it works: dicts with "kind" progress (stage, job, done, total, note), scalar (run, key, step,
value) or warning (message). A callback gets each of them, on the thread that called."""

import sys
import warnings
from collections.abc import Callable
from typing import Any

from oted.errors import UsageError

Event = dict[str, Any]
Callback = Callable[[Event], None]


class Bars:
    """One tqdm bar per stage, in a notebook or a terminal; a line for each stage where tqdm is not installed."""

    def __init__(self) -> None:
        self._stage: str | None = None
        self._bar: Any = None
        self._jobs: dict[str, tuple[int, int]] = {}
        try:
            from tqdm.auto import tqdm

            self._tqdm: Any = tqdm
        except ImportError:
            self._tqdm = None

    def __call__(self, event: Event) -> None:
        if event["kind"] != "progress":
            return
        if event["stage"] != self._stage:
            self.close()
            self._stage, self._jobs = event["stage"], {}
            if self._tqdm is None:
                print(f"oted: {self._stage} ...", file=sys.stderr)
            else:
                self._bar = self._tqdm(desc=self._stage, leave=True)
        self._jobs[event["job"]] = (event["done"], event["total"])
        if self._bar is not None:
            self._bar.total = sum(total for _, total in self._jobs.values())
            self._bar.n = sum(done for done, _ in self._jobs.values())
            self._bar.set_postfix_str(event["note"], refresh=False)
            self._bar.refresh()

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


class Log:
    """The scalars of a run into anything with a method log(dict), such as a Weights & Biases run:
    callback=oted.progress.Log(wandb.init())."""

    def __init__(self, run: Any) -> None:
        self._run = run

    def __call__(self, event: Event) -> None:
        if event["kind"] == "scalar":
            self._run.log({f"{event['run']}/{event['key']}": event["value"], f"{event['run']}/step": event["step"]})


class TensorBoard:
    """The scalars of a run into a TensorBoard writer (add_scalar). The run directory holds event files already."""

    def __init__(self, writer: Any) -> None:
        self._writer = writer

    def __call__(self, event: Event) -> None:
        if event["kind"] == "scalar":
            self._writer.add_scalar(f"{event['run']}/{event['key']}", event["value"], event["step"])


def handler(progress: bool, callback: Callback | None) -> tuple[Callback, Callable[[], None]]:
    """(what gets every event, what ends the bars)."""
    if callback is not None and not callable(callback):
        raise UsageError(f"callback: got {type(callback).__name__}, wanted a function of a dict")
    bars = Bars() if progress else None

    def handle(event: Event) -> None:
        if event["kind"] == "warning":
            warnings.warn(event["message"], stacklevel=2)
        if bars is not None:
            bars(event)
        if callback is not None:
            callback(event)

    return handle, bars.close if bars is not None else lambda: None
