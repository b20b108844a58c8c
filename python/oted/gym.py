"""A Gymnasium environment of yours as the simulator that is designed."""

import itertools
import json
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from oted import _given
from oted._engine import core
from oted.errors import DataError, Error, UsageError

Array = NDArray[np.float64]
Env = gymnasium.Env[Any, Any]
_MADE: dict[str, "GymSimulator"] = {}
# By number, so that compiled objects hold no Python object: the collector would not see the way back to them.
_LANES: dict[int, "Lanes"] = {}
_NUMBERS = itertools.count()


class GymSimulator:
    """Takes the place of a task: oted.fit(oted.GymSimulator(...), logs, {"length": oted.Param("env/length", 0.5, 2.0)}).

    make_env() gives a new environment with a flat Box of observations, and a flat Box of actions or a Discrete. It is
    called once for each lane that is stepped side by side, some hundred times.

    name and version say which environment this is. Nothing else does: results of another version are not used again, so
    raise the version when the environment or a function given here changes.

    nominal: the numbers that can be parameters, {"length": 1.0}, in units of yours. A parameter's path is env/NAME; its
    range is in multiples of the nominal number, or with scale="absolute" the number itself.
    set_parameters(env, values): sets all of them, {"length": 1.2}, on an environment that may have had any others.
    It is called after make_env, and before and after every reset.

    set_state(env, observation): puts the environment into the state that shows the observation, right after a reset with a
    fixed seed; gives False where the observation determines none. Without it the design starts at resets and acts with
    the clone (Algorithm 1). hidden: numbers of the state that no observation shows, {"hinge rate": "hinge angle"}, each
    with the observation whose rate of change it is, or None. Then it is set_state(env, observation, hidden), with an array
    of theirs, which the design estimates.
    observe(env): what the environment shows now. Without it, what was asked for is what is shown after set_state.

    observation_names, action_names: as the logs have them; obs_0, obs_1, ... and act_0, ... without. observation_units.
    rates: {"hinge velocity": "hinge angle"}, observations that are the rate of change of others: it helps the design to
    tell noise from motion. control_period [s]: between two actions; the environment's dt where it has one.
    max_episode_steps: the environment's own where it has one.
    """

    def __init__(
        self,
        make_env: Callable[[], Any],
        *,
        name: str,
        version: str,
        nominal: Mapping[str, float] | None = None,
        set_parameters: Callable[[Any, dict[str, float]], None] | None = None,
        set_state: Callable[..., bool | None] | None = None,
        hidden: Mapping[str, str | None] | None = None,
        observe: Callable[[Any], Any] | None = None,
        observation_names: Sequence[str] | None = None,
        observation_units: Sequence[str] | None = None,
        action_names: Sequence[str] | None = None,
        rates: Mapping[str, str] | None = None,
        control_period: float | None = None,
        max_episode_steps: int | None = None,
    ) -> None:
        for what, text in (("name", name), ("version", version)):
            if not isinstance(text, str) or not re.fullmatch(r"[A-Za-z0-9_.+-]+", text):
                raise UsageError(f"{what}: got {text!r}, wanted a text of letters, digits and _ . + -")
        if not callable(make_env):
            raise UsageError(f"make_env: got {type(make_env).__name__}, wanted a function that makes an environment, such as "
                             "lambda: gymnasium.make('Pendulum-v1')")
        if (nominal is None) != (set_parameters is None):
            raise UsageError("got one of nominal and set_parameters, wanted both, or neither for an environment without "
                             "parameters of its own")
        for what, given, example in (("set_parameters", set_parameters, "set_parameters(env, values)"),
                                     ("set_state", set_state, "set_state(env, observation)"), ("observe", observe, "observe(env)")):
            _given.function(what, given, example)
        hidden = _given.by_name("hidden", hidden, "{'hinge rate': 'hinge angle'}")
        if hidden and set_state is None:
            raise UsageError("hidden: got numbers of the state that nothing sets; give set_state(env, observation, hidden)")
        self.task = f"python:{name}@{version}"
        self._make_env = make_env
        self._nominal = _given.numbers_by_name("nominal", nominal, "{'length': 1.0}")
        self._set_parameters = set_parameters
        self._set_state = set_state
        self._has_hidden = bool(hidden)
        self._observe = observe
        self._idle: list[Env] = []
        try:
            env = self._take()
        except Error:
            raise
        except Exception as e:
            raise DataError(f"'{self.task}': make_env or set_parameters failed: {type(e).__name__}: {e}") from e
        self.observation_space: Any = env.observation_space
        self.action_space: Any = env.action_space
        names = _names("observation_names", observation_names, self._box("observation", self.observation_space), "obs")
        units = [] if observation_units is None else _given.texts("observation_units", observation_units, "['rad', 'rad/s']")
        if units and len(units) != len(names):
            raise UsageError(f"observation_units: got {len(units)}, wanted one for each of {len(names)} observations")
        self._facts: dict[str, Any] = {
            "observation_names": names, "observation_units": units, "rate_of": _rate_of(names, rates),
            "hidden": [{"name": key, "rate_of": -1 if of is None else _place("hidden", names, of)}
                       for key, of in hidden.items()],
            "has_state": set_state is not None,
            "numbers": [{"name": key, "nominal": value} for key, value in self._nominal.items()],
            "control_period": _period(env, control_period), "max_episode_steps": _most_steps(env, max_episode_steps),
            **self._actions(action_names)}
        self._give_back(env)
        self.register()

    def register(self) -> None:
        """Makes the name mean this simulator in this process, as oted.load of a run directory needs it. Making one does so;
        of several with one name and version it is the one that was used last."""
        _MADE[self.task] = self
        core.register_gym_simulator(self.task, json.dumps(self._facts))

    def __repr__(self) -> str:
        return f"GymSimulator('{self.task}')"

    def close(self) -> None:
        """Closes the environments that nothing uses now."""
        while self._idle:
            self._idle.pop().close()

    def _actions(self, names: Sequence[str] | None) -> dict[str, Any]:
        space = self.action_space
        if isinstance(space, gymnasium.spaces.Discrete):
            if int(space.start) != 0:
                raise UsageError(f"action space {space}: wanted one that starts at 0; wrap the environment")
            return {"action_names": _names("action_names", names, 1, "act"), "action_low": [],
                    "action_high": [], "n_discrete_actions": int(space.n)}
        n = self._box("action", space)
        if not (np.isfinite(space.low).all() and np.isfinite(space.high).all()):
            raise UsageError(f"action space {space}: wanted finite bounds; wrap the environment with RescaleAction")
        return {"action_names": _names("action_names", names, n, "act"), "n_discrete_actions": 0,
                "action_low": space.low.astype(float).tolist(), "action_high": space.high.astype(float).tolist()}

    @staticmethod
    def _box(what: str, space: Any) -> int:
        if not isinstance(space, gymnasium.spaces.Box) or len(space.shape) != 1:
            raise UsageError(f"{what} space {space}: wanted a flat Box; wrap the environment, for example with "
                             "gymnasium.wrappers.FlattenObservation")
        return int(space.shape[0])

    def _take(self) -> Env:
        """An environment with nominal parameters."""
        env = self._idle.pop() if self._idle else self._make_env()
        if not isinstance(env, gymnasium.Env):
            raise UsageError(f"make_env gave {type(env).__name__}, wanted a gymnasium.Env")
        self._apply(env, self._nominal)
        return env

    def _give_back(self, env: Env) -> None:
        self._idle.append(env)

    def _apply(self, env: Env, values: Mapping[str, float]) -> None:
        if self._set_parameters is not None:
            self._set_parameters(env, dict(values))


class Lanes:
    """Environments side by side, for the compiled simulator."""

    def __init__(self, simulator: GymSimulator, n: int) -> None:
        self._simulator = simulator
        self._envs: list[Env | None] = [None] * n
        self._values = [dict(simulator._nominal) for _ in range(n)]
        self._n_seen = int(simulator.observation_space.shape[0])
        self._is_discrete = isinstance(simulator.action_space, gymnasium.spaces.Discrete)

    def release(self) -> None:
        for env in self._envs:
            if env is not None:
                self._simulator._give_back(env)
        self._envs = []

    def _env(self, lane: int) -> Env:
        env = self._envs[lane]
        if env is None:
            env = self._envs[lane] = self._simulator._take()
            self._simulator._apply(env, self._values[lane])
        return env

    def _seen(self, observation: Any) -> Array:
        seen = np.asarray(observation, dtype=np.float64)
        if seen.shape != (self._n_seen,):
            raise UsageError(f"an observation has the shape {seen.shape}, wanted {(self._n_seen,)} as the space says")
        return seen

    def set_parameters(self, lane: int, values: list[float]) -> None:
        self._values[lane] = dict(zip(self._simulator._nominal, values))
        self._simulator._apply(self._env(lane), self._values[lane])

    def reset(self, lane: int, seed: int) -> Array:
        env = self._env(lane)
        self._simulator._apply(env, self._values[lane])
        observation, _ = env.reset(seed=seed)
        self._simulator._apply(env, self._values[lane])  # an environment may build its world anew
        return self._seen(observation)

    def set_state(self, lane: int, observation: Array, hidden: Array) -> Array | None:
        """What the environment shows then; None where it has no such state. The reset takes back whatever the last
        episode left behind, clocks of wrappers among it."""
        simulator = self._simulator
        self.reset(lane, 0)
        env = self._env(lane)
        assert simulator._set_state is not None
        given = (observation.copy(), hidden) if simulator._has_hidden else (observation.copy(),)
        if simulator._set_state(env, *given) is False:
            return None
        if simulator._observe is None:
            return observation
        seen = self._seen(simulator._observe(env))
        if not np.isfinite(seen).all():
            raise DataError(f"after set_state the environment shows {seen}; set_state gives False where an observation "
                            "determines no state")
        return seen

    def step(self, lanes: list[int], actions: Array) -> Array:
        """(lanes, observation, reward, terminated, truncated)"""
        rows = np.empty((len(lanes), self._n_seen + 3))
        for row, lane, action in zip(rows, lanes, actions):
            observation, reward, terminated, truncated, _ = self._env(lane).step(
                int(action[0]) if self._is_discrete else action)
            row[:-3] = self._seen(observation)
            row[-3:] = float(reward), bool(terminated), bool(truncated)
        return rows


def make_lanes(task: str, n: int) -> int:
    """The number of new lanes, until release."""
    number = next(_NUMBERS)
    _LANES[number] = Lanes(_MADE[task], n)
    return number


def lanes(number: int) -> Lanes:
    return _LANES[number]


def release(number: int) -> None:
    _LANES.pop(number).release()


def _names(what: str, given: Sequence[str] | None, n: int, prefix: str) -> list[str]:
    names = [f"{prefix}_{i}" for i in range(n)] if given is None else _given.texts(what, given, "['hip', 'knee']")
    if len(names) != n or len(set(names)) != n:
        raise UsageError(f"{what}: got {len(set(names))} different names, wanted {n}")
    return names


def _place(what: str, names: list[str], name: Any) -> int:
    if name not in names:
        raise UsageError(f"{what}: {_given.short(name)} is no observation; there are {', '.join(names)}")
    return names.index(name)


def _rate_of(names: list[str], rates: Mapping[str, str] | None) -> list[int]:
    found = [-1] * len(names)
    for rate, of in _given.by_name("rates", rates, "{'hinge velocity': 'hinge angle'}").items():
        found[_place("rates", names, rate)] = _place("rates", names, of)
    return found


def _period(env: Env, given: float | None) -> float:
    """[s]; 0 where neither the user nor the environment knows it."""
    if given is not None:
        return _given.seconds("control_period", given)
    period = getattr(env.unwrapped, "dt", 0.0)
    return 0.0 if isinstance(period, (int, float)) and period == 0 else _given.seconds("control_period: the environment's dt", period)


def _most_steps(env: Env, given: int | None) -> int:
    """0 without a limit."""
    most = given if given is not None else getattr(getattr(env, "spec", None), "max_episode_steps", None)
    return 0 if most is None else _given.whole("max_episode_steps", most, 1)
