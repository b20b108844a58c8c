"""Stable-Baselines3's vector environment, on the compiled library: SAC("MlpPolicy", oted.sb3.make_vec_env(design, 8))."""

from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium
import numpy as np

from oted._needs import need
from oted.envs import OtedVectorEnv

_base: Any = need("stable_baselines3.common.vec_env.base_vec_env", "oted.sb3", "stable-baselines3")


class OtedVecEnv(_base.VecEnv):  # type: ignore[misc]
    """Resets in the step in which an episode ends, as Stable-Baselines3 wants it; infos have terminal_observation."""

    def __init__(self, task: Any, num_envs: int = 1, **keywords: Any) -> None:
        self._env = OtedVectorEnv(task, num_envs, autoreset_mode=gymnasium.vector.AutoresetMode.SAME_STEP, **keywords)
        self.render_mode = None
        super().__init__(num_envs, self._env.single_observation_space, self._env.single_action_space)
        self._seed: int | None = None
        self._actions: Any = None

    def reset(self) -> Any:
        observations, _ = self._env.reset(seed=self._seed)
        self._seed = None
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        return observations.astype(np.float32)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        self._seed = seed
        return [None if seed is None else seed + i for i in range(self.num_envs)]

    def step_async(self, actions: Any) -> None:
        self._actions = actions

    def step_wait(self) -> Any:
        observations, rewards, terminated, truncated, info = self._env.step(self._actions)
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(done):
            infos[i] = {"terminal_observation": info["final_obs"][i].astype(np.float32),
                        "TimeLimit.truncated": bool(truncated[i] and not terminated[i])}
        return observations.astype(np.float32), rewards.astype(np.float32), done, infos

    def close(self) -> None:
        self._env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self._env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise AttributeError(f"'{attr_name}' cannot be set: the environments are one compiled object")

    def env_method(self, method_name: str, *arguments: Any, indices: Any = None, **keywords: Any) -> list[Any]:
        raise AttributeError(f"'{method_name}' cannot be called: the environments are one compiled object")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]

    def _get_indices(self, indices: None | int | Iterable[int]) -> Iterable[int]:
        chosen: Iterable[int] = super()._get_indices(indices)
        return chosen


def make_vec_env(task: Any, num_envs: int = 1, *, seed: int | None = None, **keywords: Any) -> Any:
    """num_envs environments of a task or a design, behind a VecMonitor, so that Stable-Baselines3 logs returns and lengths of
    episodes. seed: of the first reset. Other keywords as oted.make_vec_env's."""
    environments = need("stable_baselines3.common.vec_env.vec_monitor", "oted.sb3", "stable-baselines3").VecMonitor(
        OtedVecEnv(task, num_envs, **keywords))
    environments.seed(seed)
    return environments
