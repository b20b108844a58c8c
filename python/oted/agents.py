"""Agents: trained in a designed simulator, and judged anywhere."""

import json
import os
import pathlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from oted import _given, _toml
from oted._engine import core
from oted.design import Design
from oted.errors import UsageError
from oted.fitting import run_stage
from oted.progress import Callback
from oted.task import ParametersLike, TaskLike, needed, study, threads_toml

Array = NDArray[np.float64]
Policy = Callable[[Array], ArrayLike]

# What a run directory holds of agents.
OF_AGENTS = ("agents", "nominal", "policy.onnx", "policy_selection.json", "evaluation.json", "report.html", "report.json")


class Agent:
    """A policy file, ours (.npz) or any feed-forward ONNX, that acts in a task."""

    def __init__(self, path: str | os.PathLike[str], task: TaskLike) -> None:
        self.path = pathlib.Path(_given.path("path", path))
        self._policy = core.Policy(str(self.path), study_of(task))

    def predict(self, observation: ArrayLike, deterministic: bool = True) -> tuple[Array, None]:
        """(action, None), as Stable-Baselines3's predict, of one observation or of a batch. Always the deterministic
        action."""
        array = _given.numbers("observation", observation)
        actions: Array = self._policy.act(np.atleast_2d(array))
        return (actions[0] if array.ndim == 1 else actions), None

    def __call__(self, observations: ArrayLike) -> Array:
        return self.predict(observations)[0]

    def __repr__(self) -> str:
        return f"Agent('{self.path}')"


class Evaluation:
    """Episodes of a policy: returns, lengths, and what they amount to. A diverged episode counts as the lowest return."""

    def __init__(self, record: dict[str, Any]) -> None:
        self.record = record
        self.mean_return: float = record["mean_return"]
        self.std_return: float = record["std_return"]
        self.score: float | None = record["score"]  # D4RL's normalised score
        self.returns: list[float] = record["returns"]
        self.lengths: list[int] = record["lengths"]
        self.n_diverged: int = record["n_diverged"]

    def __repr__(self) -> str:
        return f"Evaluation({self.mean_return:.4g} +- {self.std_return:.3g} over {len(self.returns)} episodes)"


def study_of(task: TaskLike | Design, parameters: ParametersLike = None, threads: int | None = None) -> "core.Study":
    """Of a task, which may not be None, or of a design's run directory: its task, parameters and logs."""
    if isinstance(task, Design):
        if parameters is not None:
            raise UsageError("parameters: a design has its own; leave them out")
        return core.Study.of_run(str(task.path), threads_toml(threads))
    return study(needed(task), parameters, threads=threads)


def place(task: Any, what: "core.Study", at: Mapping[str, float] | str | None) -> list[float]:
    """Where to put a simulator's parameters: "mode" or "nominal" of a design, or values by name, nominal elsewhere."""
    specs = json.loads(core.describe(what))["parameters"]
    nominal = {p["name"]: float(p["nominal"]) for p in specs}
    if isinstance(at, Mapping):
        unknown = [name for name in at if name not in nominal]
        if unknown:
            raise UsageError(f"'{unknown[0]}' is no parameter; there are {', '.join(nominal) or 'none'}")
        return [_given.number(f"'{name}'", at.get(name, value)) for name, value in nominal.items()]
    if at == "nominal" or (at is None and not isinstance(task, Design)):
        return list(nominal.values())
    if not isinstance(task, Design):
        raise UsageError(f"got {at!r} for parameters, which only a design has; give values by name, {{'friction': 0.7}}")
    if at not in (None, "mode"):
        raise UsageError(f"got {at!r} for parameters, wanted 'mode', 'nominal', or values by name, {{'friction': 0.7}}; "
                         "an environment also takes sample='modes' or 'samples'")
    return list(task.mode.values())


def train(
    design: Design,
    *,
    steps: int | None = None,
    algorithm: str | None = None,
    agents: int | None = None,
    train_in: str | None = None,
    threads: int | None = None,
    settings: Mapping[str, Any] | None = None,
    out: str | os.PathLike[str] | None = None,
    progress: bool = True,
    callback: Callback | None = None,
) -> Agent:
    """Trains agents in the designed simulators and selects one in them: `oted select-policy` in the design's run
    directory. steps: control steps of each agent. algorithm: "crossq", "sac" or "ppo". train_in: "modes", "samples" or
    "best". out: a run directory for it, in which the design is copied: one holds the agents of one call. Like fit, it
    goes on where it was stopped. For other libraries' agents see oted.make_env."""
    if not isinstance(design, Design):
        raise UsageError(f"design: got {type(design).__name__}, wanted what oted.fit or oted.load('runs/arm') gives")
    there = design.path if out is None else _given.folder("out", out)
    if there.resolve() != design.path.resolve():
        copy = Design(there) if (there / "design.json").is_file() else design._copied(there, without=OF_AGENTS)
        if copy.record != design.record:
            raise UsageError(f"out: '{there}' holds another design; name another folder, or train oted.load('{there}')")
        design = copy
    chosen = algorithm
    given: dict[str, Any] = {"agents.algorithm": algorithm, "agents.n_agents": agents, "agents.train_in": train_in,
                             "run.threads": threads}
    if steps is not None:
        if chosen is None:
            is_discrete = json.loads(core.describe(study_of(design)))["n_discrete_actions"] > 0
            chosen = "ppo" if is_discrete else "sac"
        given[f"{chosen}.n_steps"] = steps
    words = _toml.assignments({k: v for k, v in given.items() if v is not None}) + _toml.assignments(settings)
    run_stage(None, design.path, words, "select-policy", "oted.train", progress, callback)
    return Agent(design.path / "policy.onnx", design)


def evaluate(
    policy: Agent | Policy | str | os.PathLike[str] | Any,
    task: TaskLike | Design,
    *,
    parameters: ParametersLike = None,
    at: Mapping[str, float] | str | None = None,
    episodes: int = 20,
    seed: int = 1,
    threads: int | None = None,
) -> Evaluation:
    """Runs a policy in a simulator: `oted evaluate --policy`. policy: an Agent, a policy file, a function of a batch of
    observations (n, channels) that gives actions (n, actions), or what has Stable-Baselines3's predict. at: the parameters' values by name; of a design also
    "mode" (the default) or "nominal"."""
    if isinstance(policy, Agent):
        policy = policy.path
    acts: Any = _given.path("policy", policy) if isinstance(policy, (str, os.PathLike)) else policy
    predict: Any = getattr(policy, "predict", None)
    if callable(predict):
        acts = lambda observations: predict(observations, deterministic=True)[0]  # noqa: E731
    if not isinstance(acts, str) and not callable(acts):
        raise UsageError(f"policy: got {type(policy).__name__}, wanted an Agent, a file, or a function of observations")
    episodes, seed = _given.whole("episodes", episodes, 1), _given.seed(seed)
    what = study_of(task, parameters, threads)
    return Evaluation(json.loads(core.evaluate(acts, what, place(task, what, at), episodes, seed)))
