"""Gymnasium environments of a task or of a designed simulator, stepped by the compiled library: parameters fixed or drawn
for each episode, with the delays and sensors that they say."""

import json
import warnings
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from oted import _given
from oted._engine import core
from oted.agents import place, study_of
from oted.design import Design
from oted.errors import UsageError
from oted.task import ParametersLike, TaskLike

Array = NDArray[np.float64]
SAMPLES = ("modes", "samples")
NO_COPY = ("an environment cannot be pickled or copied: make it where it is stepped, from a design or the path of one, which can "
           "be pickled")


class ClosedEnvironment(UsageError, gymnasium.error.ClosedEnvironmentError):
    """What Gymnasium's own vector environments raise, too."""

    def __init__(self, call: str) -> None:
        super().__init__(f"{call}: the environment is closed; make another one")


class _Simulators:
    """Lanes and what their episodes begin with, shared by the single and the vector environment."""

    def __init__(self, task: Any, parameters: ParametersLike, sample: str | Mapping[str, float] | None, n_lanes: int,
                 threads: int) -> None:
        what = study_of(task, parameters)
        self.facts: dict[str, Any] = json.loads(core.describe(what))
        if not self.facts["has_reward"]:
            again = (" and call oted.fit again with the same out: the design stays" if isinstance(task, Design) else "")
            warnings.warn(f"task '{self.facts['task']}' has no reward: every step gives 0; name one, "
                          f"oted.Task(..., reward='...'){again}", stacklevel=4)
        self.lanes = core.Lanes(what, n_lanes, threads)
        self._design = task if isinstance(task, Design) else None
        self._sample = sample if isinstance(sample, str) and sample in SAMPLES else None
        if self._sample is not None and self._design is None:
            raise UsageError(f"sample: '{sample}' needs a design; give values by name, or None for nominal")
        self.fixed: Array | None = None
        if self._sample is None:
            self.fixed = np.asarray(place(task, what, sample), dtype=np.float64)
        self.z = np.tile(np.asarray(self.lanes.nominal(), dtype=np.float64), (n_lanes, 1))
        self._own = [np.random.default_rng() for _ in range(n_lanes)]
        self._noise: Any = self.lanes.gymnasium_noise()  # None, or (scale, whether velocities are normal)
        self._start: Array = self.lanes.pose(0)  # of a lane that was never reset: the task's start state
        if self.fixed is not None:
            for lane in range(n_lanes):
                self._place(lane, self.fixed)

    @property
    def observation_space(self) -> Any:
        return gymnasium.spaces.Box(-np.inf, np.inf, (int(np.prod(self.facts["observation_shape"])),), np.float64)

    @property
    def action_space(self) -> gymnasium.Space[Any]:
        if self.facts["n_discrete_actions"] > 0:
            return gymnasium.spaces.Discrete(self.facts["n_discrete_actions"])
        low, high = (np.asarray(self.facts[key], dtype=np.float32) for key in ("action_low", "action_high"))
        return gymnasium.spaces.Box(low, high, dtype=np.float32)

    def _place(self, lane: int, z: Array) -> None:
        self.lanes.set_parameters(lane, z)
        self.z[lane] = z

    def seed(self, lane: int, seed: int) -> None:
        self._own[lane] = np.random.default_rng([seed, 0x07ED])

    def reset(self, lane: int, random: np.random.Generator, start: Mapping[str, Any] | None = None) -> None:
        """A new episode. `random` draws the start of Gymnasium's own tasks as Gymnasium does; everything else comes from a
        stream of its own, so that both stay in step."""
        own = self._own[lane]
        if self._sample is not None and self._design is not None:
            if self._sample == "modes":
                modes = self._design.modes
                self._place(lane, modes[own.integers(len(modes))])
            else:
                # A draw comes from one seed's q, whichever this turn's is.
                n_seeds = len(self._design.modes)
                draws = self._design.draw(n_seeds, int(own.integers(2**62)))
                self._place(lane, draws[own.integers(n_seeds)])
        seed = int(own.integers(2**62))
        if start:
            if not isinstance(start, Mapping) or start.keys() != {"qpos", "qvel"}:
                raise UsageError(f"options: got {start!r}, wanted {{'qpos': ..., 'qvel': ...}}")
            qpos, qvel = (_given.numbers(key, start[key]) for key in ("qpos", "qvel"))
            self.lanes.reset_to(lane, qpos, qvel, seed)
        elif self._noise is not None:
            scale, is_normal = self._noise
            n = len(self._start)
            qpos = self._start + random.uniform(low=-scale, high=scale, size=n)
            qvel = scale * random.standard_normal(n) if is_normal else random.uniform(low=-scale, high=scale, size=n)
            self.lanes.reset_to(lane, qpos, qvel, seed)
        else:
            self.lanes.reset(lane, seed)

    def info(self, lane: int) -> dict[str, Any]:
        return {"parameters": {p["name"]: float(v) for p, v in zip(self.facts["parameters"], self.z[lane])}}


class OtedEnv(gymnasium.Env[Array, Any]):
    """One simulator. info has "parameters" after reset. A simulation that breaks down is cut (truncated, reward 0, the
    observation before), with info["diverged"]. reset(options={"qpos": ..., "qvel": ...}) begins at a state of yours."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(
        self,
        task: TaskLike | Design,
        *,
        parameters: ParametersLike = None,
        sample: str | Mapping[str, float] | None = None,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 480,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise UsageError(f"render_mode: got '{render_mode}', wanted 'rgb_array' or None")
        self._sims = _Simulators(task, parameters, sample, 1, 1)
        self.observation_space = self._sims.observation_space
        self.action_space = self._sims.action_space
        self.render_mode = render_mode
        self._size = (_given.whole("width", width, 1), _given.whole("height", height, 1))
        self._ended = True
        self._closed = False
        period = self._sims.facts["control_period"]
        self.metadata = {**self.metadata, "render_fps": round(1 / period) if period else 10}

    @property
    def dt(self) -> float:
        """The control period [s]."""
        period: float = self._sims.facts["control_period"]
        return period

    @property
    def parameters(self) -> dict[str, float]:
        """Of the episode at hand."""
        parameters: dict[str, float] = self._sims.info(0)["parameters"]
        return parameters

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        if self._closed:
            raise ClosedEnvironment("reset")
        super().reset(seed=seed)
        if seed is not None:
            self._sims.seed(0, seed)
        self._sims.reset(0, self.np_random, options)
        self._ended = False
        observation: Array = self._sims.lanes.observations()[0]
        return observation, self._sims.info(0)

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        if self._closed:
            raise ClosedEnvironment("step")
        if self._ended:
            raise UsageError("step: no episode has begun, or its physics broke down; call reset() first")
        lanes = self._sims.lanes
        lanes.step([0], _given.numbers("action", action).reshape(1, -1))
        status = int(lanes.status()[0])
        terminated, diverged = status == core.TERMINATED, status == core.DIVERGED
        truncated = diverged or status == core.TRUNCATED
        self._ended = diverged
        return (lanes.observations()[0], float(lanes.rewards()[0]), terminated, truncated,
                {"diverged": True} if diverged else {})

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError(NO_COPY)

    def close(self) -> None:
        self._closed = True

    def render(self) -> Any:
        if self._closed:
            raise ClosedEnvironment("render")
        if self.render_mode is None:
            return None
        return self._sims.lanes.draw(0, self._sims.z[0], *self._size)


class OtedVectorEnv(gymnasium.vector.VectorEnv[Array, Any, Any]):
    """Many simulators in one call; the same numbers as so many OtedEnv, seeded seed, seed + 1, ..."""

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": [], "autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        task: TaskLike | Design,
        num_envs: int = 1,
        *,
        parameters: ParametersLike = None,
        sample: str | Mapping[str, float] | None = None,
        threads: int = 1,
        autoreset_mode: "gymnasium.vector.AutoresetMode | str" = gymnasium.vector.AutoresetMode.NEXT_STEP,
    ) -> None:
        num_envs, threads = _given.whole("num_envs", num_envs, 1), _given.whole("threads", threads, 1)
        try:
            self.mode = gymnasium.vector.AutoresetMode(autoreset_mode)
        except ValueError as e:
            raise UsageError(f"autoreset_mode: got {autoreset_mode!r}, wanted one of gymnasium.vector.AutoresetMode") from e
        self._sims = _Simulators(task, parameters, sample, num_envs, threads)
        self.num_envs = num_envs
        self.single_observation_space = self._sims.observation_space
        self.single_action_space = self._sims.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata = {**self.metadata, "autoreset_mode": self.mode}
        self._randoms = [np.random.default_rng() for _ in range(num_envs)]
        self._done = np.ones(num_envs, dtype=bool)
        self._all = list(range(num_envs))

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """options={"reset_mask": (num_envs,) bool} resets those alone."""
        if self.closed:
            raise ClosedEnvironment("reset")
        seeds: list[int | None]
        if seed is None:
            seeds = [None] * self.num_envs
        elif isinstance(seed, (int, np.integer)):
            seeds = [int(seed) + i for i in self._all]
        else:
            seeds = _given.listed("seed", seed, "a whole number, or a list of them")
        if len(seeds) != self.num_envs:
            raise UsageError(f"seed: got {len(seeds)} seeds, wanted {self.num_envs}")
        mask = np.ones(self.num_envs, dtype=bool)
        if options:
            if not isinstance(options, Mapping) or options.keys() != {"reset_mask"}:
                raise UsageError(f"options: got {options!r}, wanted {{'reset_mask': ...}}")
            mask = np.asarray(options["reset_mask"], dtype=bool)
            if mask.shape != (self.num_envs,):
                raise UsageError(f"reset_mask: got shape {mask.shape}, wanted {(self.num_envs,)}")
        for lane, own in enumerate(seeds):
            if own is not None:
                self._randoms[lane] = gymnasium.utils.seeding.np_random(own)[0]
                self._sims.seed(lane, own)
            if mask[lane]:
                self._sims.reset(lane, self._randoms[lane])
        self._done[mask] = False
        return self._sims.lanes.observations(), {"parameters": self._sims.z.copy()}

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError(NO_COPY)

    def step(self, actions: Any) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        if self.closed:
            raise ClosedEnvironment("step")
        lanes = self._sims.lanes
        begin = self._done
        running = self._all if not begin.any() else [int(i) for i in np.flatnonzero(~begin)]
        given = _given.numbers("actions", actions)
        if given.shape[:1] != (self.num_envs,):
            raise UsageError(f"step: got actions of shape {given.shape}, wanted one for each of {self.num_envs} environments")
        lanes.step(running, given.reshape(self.num_envs, -1))
        rewards: Array = lanes.rewards()
        status = lanes.status()
        terminated = status == core.TERMINATED
        truncated = (status == core.TRUNCATED) | (status == core.DIVERGED)
        for flags in (terminated, truncated):
            flags[begin] = False
        rewards[begin] = 0
        info: dict[str, Any] = {}
        diverged = (status == core.DIVERGED) & ~begin
        if diverged.any():
            info["diverged"] = info["_diverged"] = diverged
        for lane in np.flatnonzero(begin):
            self._sims.reset(int(lane), self._randoms[lane])
        done = terminated | truncated
        if self.mode is gymnasium.vector.AutoresetMode.SAME_STEP and done.any():
            last = lanes.observations()
            info["final_obs"] = np.array([last[i] if done[i] else None for i in self._all], dtype=object)
            info["_final_obs"] = done.copy()
            for lane in np.flatnonzero(done):
                self._sims.reset(int(lane), self._randoms[lane])
            self._done = np.zeros(self.num_envs, dtype=bool)
        elif self.mode is gymnasium.vector.AutoresetMode.NEXT_STEP:
            self._done = done
        elif done.any():  # disabled: the caller resets
            self._done = np.zeros(self.num_envs, dtype=bool)
        info["parameters"] = self._sims.z.copy()
        return lanes.observations(), rewards, terminated, truncated, info


def make_env(task: TaskLike | Design, **keywords: Any) -> OtedEnv:
    """A Gymnasium environment of a task or a design. sample says where the parameters are:

    None            a design's mode, a task's nominal values
    "mode"          a design's mode
    "modes"         a mode of the seeds' q, drawn for each episode (Algorithm 2)
    "samples"       a sample of q for each episode
    "nominal"       the model as it was given
    {"friction": 0.7}  these, and nominal values elsewhere

    Further keywords: parameters (of a task), render_mode="rgb_array", width, height. At nominal parameters Hopper,
    HalfCheetah and Walker2d give Gymnasium's own numbers to the last bit, from the same seed."""
    return OtedEnv(task, **keywords)


def make_vec_env(task: TaskLike | Design, num_envs: int = 1, **keywords: Any) -> OtedVectorEnv:
    """Many at once, stepped in C++. Keywords as make_env's, and threads, autoreset_mode (Gymnasium's; NEXT_STEP)."""
    return OtedVectorEnv(task, num_envs, **keywords)


def register(task: TaskLike | Design, id: str, **keywords: Any) -> None:
    """Makes gymnasium.make(id) and gymnasium.make_vec(id) give these environments, in this process."""
    given = {"task": task, **keywords}
    gymnasium.register(id, entry_point="oted.envs:OtedEnv", vector_entry_point="oted.envs:OtedVectorEnv", kwargs=given)


# gymnasium.make("oted.envs:oted/Simulator-v0", task=oted.load("runs/hopper"))
gymnasium.register("oted/Simulator-v0", entry_point="oted.envs:OtedEnv", vector_entry_point="oted.envs:OtedVectorEnv")
