"""What is simulated, and what of it may vary."""

import dataclasses
import json
import os
import pathlib
import sys
import tempfile
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from oted import _given, _toml
from oted._engine import core
from oted.errors import UsageError

# A name, a file, a Task, MuJoCo's own mujoco.MjSpec, or a GymSimulator.
TaskLike = Any
ParametersLike = Any

_TASKS = "a name such as 'Hopper-v5', a .toml file, an oted.Task or an oted.GymSimulator"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Task:
    """A task on a model of your own. docs/task_files.md explains each key; what is None has its default.

    model: an MJCF or URDF file, or a mujoco.MjSpec. control_period [s] is the time between two actions. constants: numbers
    of the model that are known and differ between recordings, {"payload": {"field": "body/hand/mass", "scale": "absolute"}};
    Logs.with_constants says what they were.
    """

    model: Any
    control_period: float
    name: str | None = None
    observations: Sequence[str] | None = None
    unobserved: Sequence[str] | None = None
    actions: Sequence[str] | None = None
    action_range: Sequence[float] | None = None
    motors: Sequence[str] | None = None
    start: str | None = None
    start_qpos: Sequence[float] | None = None
    start_noise: float | None = None
    reward: str | None = None
    terminate: str | None = None
    max_episode_steps: int | None = None
    quantities: Mapping[str, str] | None = None
    constants: Mapping[str, Mapping[str, Any]] | None = None

    def to_toml(self, folder: pathlib.Path | None = None) -> str:
        """[task] as a task file has it. A MjSpec is written into `folder` as model.xml first."""
        entries = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        quantities = _given.by_name("quantities", entries.pop("quantities"), "{'height': 'body/torso/z'}")
        constants = _given.by_name("constants", entries.pop("constants"), "{'payload': {'field': 'body/hand/mass'}}")
        entries["model"] = _model_file(self.model, folder)
        text = _toml.section("task", entries)
        for name, table in (("task.quantities", quantities), ("task.constants", constants)):
            if table:
                text += _toml.section(name, table)
        return text


@dataclasses.dataclass(frozen=True)
class Param:
    """A parameter of the simulator: a path of the model, and the range in which it is looked for.

    The range is in multiples of nominal (scale "nominal") or in the model's unit ("absolute"). log searches in the
    logarithm. prior is (mean, standard deviation), what is believed before any log is read.
    docs/parameters.md lists the paths.
    """

    path: str
    low: float
    high: float
    _: dataclasses.KW_ONLY
    log: bool = False
    scale: str = "nominal"
    prior: tuple[float, float] | None = None

    def to_toml(self) -> dict[str, Any]:
        what = f"parameter of '{_given.text('path of a parameter', self.path)}'"
        entry: dict[str, Any] = {"field": self.path, "range": [_given.number(f"{what}: {end}", value) for end, value in
                                                               (("low", self.low), ("high", self.high))]}
        if not isinstance(self.log, (bool, np.bool_)):
            raise UsageError(f"{what}: log: got {_given.short(self.log)}, wanted True or False")
        if self.scale != "nominal":
            entry["scale"] = self.scale
        if self.log:
            entry["log"] = True
        if self.prior is not None:
            if not isinstance(self.prior, Sequence) or len(self.prior) != 2:
                raise UsageError(f"{what}: got prior {_given.short(self.prior)}, wanted (mean, standard deviation)")
            mean, deviation = (_given.number(f"{what}: prior", value) for value in self.prior)
            entry["prior"] = {"mean": mean, "std": deviation}
        return entry


def _model_file(model: Any, folder: pathlib.Path | None) -> str:
    if isinstance(model, (str, os.PathLike)):
        text = os.fspath(model)
        if str(text).lstrip().startswith("<"):
            raise UsageError("model: got XML, wanted its file or a mujoco.MjSpec; give mujoco.MjSpec.from_string(text)")
        return text if text.startswith("package:") else os.path.abspath(text)
    if not hasattr(model, "to_xml"):
        kind = type(model).__name__
        remedy = ("an MjModel does not know the XML that it came from: give its file, or the mujoco.MjSpec that it was "
                  "compiled from" if kind == "MjModel" else "give the model's file or a mujoco.MjSpec")
        raise UsageError(f"model: got {kind}, wanted a path or a mujoco.MjSpec; {remedy}")
    if folder is None:
        folder = pathlib.Path(tempfile.mkdtemp(prefix="oted-model-"))
    spec = model.copy()
    spec.compile()  # what is wrong with it shows here, in MuJoCo's own words
    base = pathlib.Path(spec.modelfiledir or ".").resolve()
    spec.meshdir = str(base / (spec.meshdir or ""))
    spec.texturedir = str(base / (spec.texturedir or ""))
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "model.xml"
    text = spec.to_xml()
    if not file.is_file() or file.read_text() != text:
        file.write_text(text)
    return str(file.resolve())


def task_toml(task: TaskLike, folder: pathlib.Path | None = None) -> tuple[str, str]:
    """(TOML, the file that its paths are relative to): of a task file all that it says."""
    if task is None:
        return "", ""
    if isinstance(task, Task):
        return task.to_toml(folder), ""
    if isinstance(task, (str, os.PathLike)):
        text = _given.path("task", task, _TASKS)
        if text.endswith(".toml"):
            try:
                return pathlib.Path(text).read_text(encoding="utf-8"), text
            except OSError as e:
                raise UsageError(f"task '{text}' cannot be read: {e.strerror}; check the path") from e
        if text.endswith((".xml", ".urdf", ".mjcf")):
            raise UsageError(f"task: '{text}' is a model; give oted.Task(model='{text}', control_period=...), or let "
                             f"'oted init {text} LOGS' write a task file")
        if os.path.isfile(os.path.join(text, "design.json")):
            raise UsageError(f"task: '{text}' is a run directory; give oted.load('{text}')")
        return _toml.section("task", {"name": text}), ""
    gym = sys.modules.get("oted.gym")  # who has such a simulator has imported it
    if gym is not None and isinstance(task, gym.GymSimulator):
        task.register()
        return _toml.section("task", {"name": task.task}), ""
    if hasattr(task, "to_xml"):
        raise UsageError("task: a mujoco.MjSpec alone lacks the control period: oted.Task(model=spec, control_period=...)")
    raise UsageError(f"task: got {type(task).__name__}, wanted {_TASKS}")


def needed(task: TaskLike) -> TaskLike:
    """The same, of a call that does nothing without one."""
    if task is None:
        raise UsageError(f"task: got None, wanted {_TASKS}")
    return task


def study(
    task: TaskLike,
    parameters: ParametersLike = None,
    *,
    data: Mapping[str, Any] | None = None,
    threads: int | None = None,
    folder: pathlib.Path | None = None,
) -> "core.Study":
    """What a call says of a run, for the compiled module."""
    given = parameters_toml(parameters)
    if data:
        given += _toml.section("data", data)
    return core.Study(*task_toml(task, folder), given + threads_toml(threads))


def threads_toml(threads: int | None) -> str:
    """[run]."""
    return "" if threads is None else _toml.section("run", {"threads": threads})


def parameters_toml(parameters: ParametersLike) -> str:
    """[parameters]. Takes {name: Param}, names of presets, a parameter file of mujoco.sysid that `oted export` wrote, or
    (ParameterDict of mujoco.sysid, {name: path}): what its parameters do is in Python functions, so the path is needed."""
    if parameters is None:
        return ""
    if isinstance(parameters, os.PathLike) or (isinstance(parameters, str) and parameters.endswith((".yaml", ".yml"))):
        return _toml.section("parameters", {"sysid": os.path.abspath(parameters)})
    if isinstance(parameters, str):
        return _toml.section("parameters", {"preset": parameters})
    paths: Mapping[str, str] = {}
    if isinstance(parameters, tuple) and len(parameters) == 2 and isinstance(parameters[1], Mapping):
        parameters, paths = parameters
    entries: dict[str, Any] = {}
    if isinstance(parameters, Mapping) or hasattr(parameters, "items"):
        for name, parameter in parameters.items():
            if getattr(parameter, "frozen", False):
                continue
            entries[name] = (_sysid(name, parameter, paths) if hasattr(parameter, "min_value") else
                             _declared(name, parameter))
        return _toml.section("parameters", entries)
    if isinstance(parameters, Sequence) and all(isinstance(name, str) for name in parameters):
        return _toml.section("parameters", {"preset": list(parameters)})
    raise UsageError("parameters: wanted {name: oted.Param(path, low, high)}, names of presets, or a mujoco.sysid "
                     f"ParameterDict; got {type(parameters).__name__}")


def _declared(name: str, parameter: Any) -> dict[str, Any]:
    if isinstance(parameter, Param):
        return parameter.to_toml()
    if isinstance(parameter, (tuple, list)) and len(parameter) == 3:
        return Param(*parameter).to_toml()
    if isinstance(parameter, Mapping):
        return dict(parameter)
    raise UsageError(f"parameter '{name}': wanted oted.Param(path, low, high), got {parameter!r}")


def _sysid(name: str, parameter: Any, paths: Mapping[str, str]) -> dict[str, Any]:
    path = paths.get(name) or getattr(parameter, "field", None)
    if not path:
        raise UsageError(f"parameter '{name}' of mujoco.sysid: its effect is a Python function; say which field it is: "
                         f"parameters=(params, {{'{name}': 'geom/*/friction[0]'}})")
    low, high = (_one(name, getattr(parameter, key)) for key in ("min_value", "max_value"))
    return Param(path, low, high, scale="absolute").to_toml()


def _one(name: str, numbers: Any) -> float:
    flat = list(numbers) if hasattr(numbers, "__len__") else [numbers]
    if len(flat) != 1:
        raise UsageError(f"parameter '{name}' of mujoco.sysid has {len(flat)} numbers, wanted one: declare each by itself")
    return float(flat[0])


def describe(task: TaskLike, parameters: ParametersLike = None) -> dict[str, Any]:
    """What a task's simulator is: names, units, bounds and period, its parameters, and under "offers" every field that
    can be one."""
    record: dict[str, Any] = json.loads(core.describe(study(needed(task), parameters)))
    return record
