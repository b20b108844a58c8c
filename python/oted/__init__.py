"""oted fits a MuJoCo simulator to logged trajectories, says how far to trust it, and trains agents in it.

    logs = oted.read_logs("logs.csv", task="arm.toml")
    design = oted.fit("arm.toml", logs, parameters={"friction": oted.Param("geom/*/friction[0]", 0.2, 2.0)}, out="runs/arm")
    design.table()
    env = oted.make_env(design)

Everything lies in the run directory that the program `oted` makes and reads, with the same bytes.
"""

import importlib
from typing import TYPE_CHECKING, Any

from oted._engine import core as _module
from oted.errors import DataError, Error, InternalError, Interrupted, MissingPackage, UsageError

if TYPE_CHECKING:
    from oted import bags, lerobot, progress, robomimic, sb3, streams
    from oted.agents import Agent, Evaluation, evaluate, train
    from oted.checks import Check, check
    from oted.design import Design, Validation, Verdict, load
    from oted.envs import make_env, make_vec_env, register
    from oted.fitting import fit
    from oted.gym import GymSimulator
    from oted.logs import Logs, read_logs
    from oted.starting import Proposal, init
    from oted.task import Param, Task, describe
    from oted.viewer import view

__version__: str = _module.version

# Imported where first used: `import oted` stays quick.
_PLACES = {
    "oted.agents": ("Agent", "Evaluation", "evaluate", "train"),
    "oted.checks": ("Check", "check"),
    "oted.design": ("Design", "Validation", "Verdict", "load"),
    "oted.envs": ("make_env", "make_vec_env", "register"),
    "oted.fitting": ("fit",),
    "oted.gym": ("GymSimulator",),
    "oted.logs": ("Logs", "read_logs"),
    "oted.starting": ("Proposal", "init"),
    "oted.task": ("Param", "Task", "describe"),
    "oted.viewer": ("view",),
}
_SUBMODULES = ("bags", "lerobot", "progress", "robomimic", "sb3", "streams")
_MODULES = {name: module for module, names in _PLACES.items() for name in names}

__all__ = [
    "Agent", "Check", "DataError", "Design", "Error", "Evaluation", "GymSimulator", "InternalError", "Interrupted", "Logs",
    "MissingPackage", "Param", "Proposal", "Task", "UsageError", "Validation", "Verdict", "check", "describe", "evaluate", "fit",
    "bags", "init", "lerobot", "load", "make_env", "make_vec_env", "progress", "read_logs", "register", "robomimic", "streams",
    "train", "view",
]


def __getattr__(name: str) -> Any:
    if name in _SUBMODULES:
        try:
            return importlib.import_module(f"oted.{name}")
        except MissingPackage as e:  # hasattr says no, and the message the pip line
            raise AttributeError(str(e)) from e
    if name not in _MODULES:
        raise AttributeError(f"module 'oted' has no attribute '{name}'")
    found = getattr(importlib.import_module(_MODULES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*globals(), *_MODULES, *_SUBMODULES])
