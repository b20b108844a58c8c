"""Episodes of the Python package minigrid with random actions, for a comparison with our grid worlds.

usage: minigrid_dump.py OUT.npz STEPS CASE...

A case is a task's name and settings of ours, "MiniGrid-FourRooms-v0 see_through_walls=true": the package's environment
of that name, or one of the two below. For each of them, with one row per observation (an episode's first row is its
reset, its action means nothing):
  CASE/starts (episodes, size, size, 6)   the grid [x][y]: encoded cell, and what a box there contains (0: nothing)
  CASE/lengths (episodes,)                rows of each episode
  CASE/numbers (rows, 7)                  action, terminated, truncated, direction, x, y, number of balls
  CASE/balls (rows, 2 most)               places of the moving balls, padded
  CASE/rewards (rows,)                    of the step that led here
  CASE/images (rows, 147)                 and CASE/grids (rows, 3 size^2) where the case says observation=grid
"""

import os
import sys

os.environ["PYGAME_HIDE_SUPPORT_PROMPT"] = "1"

import gymnasium  # noqa: E402
import minigrid  # noqa: E402,F401  registers the environments
import numpy as np  # noqa: E402
from minigrid.core.grid import Grid  # noqa: E402
from minigrid.core.mission import MissionSpace  # noqa: E402
from minigrid.core.world_object import Ball, Box, Door, Floor, Goal, Key, Lava, Wall  # noqa: E402
from minigrid.envs import DynamicObstaclesEnv  # noqa: E402
from minigrid.minigrid_env import MiniGridEnv  # noqa: E402
from minigrid.wrappers import FullyObsWrapper  # noqa: E402

COLOURS = ("red", "green", "blue", "purple", "yellow", "grey")


class Obstacles(DynamicObstaclesEnv):
    """A room with obstacles at a density, on the package's own rules."""

    def __init__(self, size, density, obstacle, collision):
        self.density, self.kind, self.collision = density, obstacle, collision
        super().__init__(size=size)

    def _gen_grid(self, width, height):
        super()._gen_grid(width, height)
        for ball in self.obstacles:
            self.grid.set(*ball.cur_pos, None)
        self.obstacles = []
        free = [(x, y) for x in range(1, width - 1) for y in range(1, height - 1)][1:-1]
        for x, y in free:
            if self.np_random.random() < self.density:
                thing = {"wall": Wall, "lava": Lava, "ball": Ball}[self.kind]()
                self.put_obj(thing, x, y)
                if self.kind == "ball":
                    self.obstacles.append(thing)

    def step(self, action):
        if self.collision == "block" and not self.obstacles:
            return MiniGridEnv.step(self, action)
        observation, reward, terminated, truncated, info = super().step(action)
        if self.collision == "block" and reward == -1:
            # Into a ball: nothing else in such a step can end the episode.
            reward, terminated = 0, False
        return observation, reward, terminated, truncated, info


class Objects(MiniGridEnv):
    """Every object of the package, anywhere."""

    def __init__(self, size):
        super().__init__(mission_space=MissionSpace(mission_func=lambda: ""), grid_size=size, max_steps=200)

    def _gen_grid(self, width, height):
        self.grid = Grid(width, height)
        self.grid.wall_rect(0, 0, width, height)
        self.place_agent()
        draw = self.np_random.integers
        for x in range(1, width - 1):
            for y in range(1, height - 1):
                if (x, y) == tuple(self.agent_pos) or draw(10) < 6:
                    continue
                colour = COLOURS[draw(6)]
                # Few colours of doors and keys, so that some fit.
                lock = COLOURS[draw(2)]
                inside = (None, Key(lock), Ball(colour))[draw(3)]
                thing = (Wall(), Floor(colour), Door(lock, is_open=True), Door(lock), Door(lock, is_locked=True),
                         Key(lock), Key(lock), Ball(colour), Box(colour, inside), Box(colour, inside), Goal(), Lava())
                self.put_obj(thing[draw(len(thing))], x, y)


def encode(cell):
    return (1, 0, 0) if cell is None else cell.encode()


def start(env):
    cells = [[env.grid.get(x, y) for y in range(env.height)] for x in range(env.width)]
    return [[[*encode(c), *(encode(c.contains) if c is not None and c.contains is not None else (0, 0, 0))]
             for c in column] for column in cells]


def make(case):
    name, *assignments = case.split()
    settings = dict(assignment.split("=") for assignment in assignments)
    if name == "Objects":
        env = Objects(10)
    elif "-v" in name:
        env = gymnasium.make(name).unwrapped
    else:
        env = Obstacles(int(name.split("x")[-1]), float(settings["density"]), settings["obstacle"],
                        settings["collision"])
    env.see_through_walls = settings["see_through_walls"] == "true"
    env.max_steps = int(settings.get("max_steps", env.max_steps))
    return env, settings.get("observation") == "grid"


def record(case, steps, seed, arrays):
    env, whole = make(case)
    full = FullyObsWrapper(env) if whole else None
    rng = np.random.default_rng(seed)
    # Forward half of the time: turning alone leads nowhere.
    weights = np.ones(env.action_space.n)
    weights[2] = max(2.0, env.action_space.n / 2)
    actions = rng.choice(env.action_space.n, size=steps, p=weights / weights.sum()).tolist()
    starts, lengths, numbers, balls, rewards, images, grids = [], [], [], [], [], [], []

    def keep(action, observation, reward, terminated, truncated):
        places = [int(c) for ball in getattr(env, "obstacles", []) for c in ball.cur_pos]
        x, y = env.agent_pos
        numbers.append((action, terminated, truncated, observation["direction"], x, y, len(places) // 2))
        balls.append(places)
        rewards.append(float(reward))
        images.append(observation["image"].reshape(-1))
        if whole:
            grids.append(full.observation(observation)["image"].reshape(-1))

    done = True
    for action in actions:
        if done:
            observation, _ = env.reset(seed=seed * 10_000 + len(starts))
            starts.append(start(env))
            lengths.append(1)
            keep(0, observation, 0, False, False)
        observation, reward, terminated, truncated, _ = env.step(action)
        keep(action, observation, reward, terminated, truncated)
        lengths[-1] += 1
        # Now and then an episode goes on after its end.
        done = (terminated or truncated) and rng.random() < 0.8

    most = max(map(len, balls))
    balls = [places + [0] * (most - len(places)) for places in balls]
    for name, values, kind in (("starts", starts, np.uint8), ("lengths", lengths, np.int64),
                               ("numbers", numbers, np.uint8), ("balls", balls, np.uint8),
                               ("rewards", rewards, np.float64), ("images", images, np.uint8),
                               ("grids", grids, np.uint8)):
        arrays[f"{case}/{name}"] = np.array(values, dtype=kind)


def main():
    out, steps, *cases = sys.argv[1:]
    arrays = {}
    for seed, case in enumerate(cases):
        record(case, int(steps), seed + 1, arrays)
    np.savez(out, **arrays)


if __name__ == "__main__":
    main()
