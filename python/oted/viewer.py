"""The designed simulator in MuJoCo's viewer, with the logged motion as a ghost."""

import argparse
import json
import os
import threading
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oted._engine import core
from oted._needs import need
from oted.agents import study_of
from oted.design import Design, load
from oted.errors import DataError, UsageError

Poses = NDArray[np.float64]
GHOST = (0.25, 0.55, 1.0, 0.35)  # red, green, blue, opacity


def motion(design: Design, episode: int = 1, seconds: float = 1.0) -> tuple[Poses, Poses, float]:
    """Positions, a row of qpos for each logged step: as logged, and as the designed simulator moves under the logged
    actions, which begins anew at the logged state every `seconds`, with earlier actions on their way through its delays.
    And the time between two rows [s]. A coordinate that no observation shows, such as the distance walked, adds up the
    logged velocities; others that no log shows stay as in the start state."""
    what = study_of(design)
    logs = core.read_logs(what)
    episodes = logs.episodes()
    if not 1 <= episode <= len(episodes):
        raise UsageError(f"episode: got {episode}, wanted 1 to {len(episodes)}, the episodes of the logs")
    begin, end, _ = episodes[episode - 1]
    period = float(json.loads(core.describe(what))["control_period"])
    between = max(1, round(seconds / period))

    lanes = core.Lanes(what, 1, 1)
    lanes.set_parameters(0, np.asarray(list(design.mode.values()), dtype=np.float64))
    if not lanes.can_replay:
        raise UsageError("the logs do not show enough of the state to replay them; look at the report")
    logged: Poses = lanes.logged_poses(logs, begin, end)
    clear = np.isfinite(logged).all(axis=1)
    if not clear.any():
        raise DataError(f"no row of episode {episode} shows a state of the model; compare units and columns")
    for row in map(int, np.flatnonzero(~clear)):  # a clipped velocity: the pose before it, at the beginning the one after it
        logged[row] = logged[row - 1] if row > 0 else logged[int(np.argmax(clear))]

    lanes.set_to_row(0, logs, begin + int(np.argmax(clear)))
    moved = np.zeros_like(logged[0])
    next_start = begin
    designed: list[Poses] = []
    for row in range(begin, end):
        if row >= next_start and lanes.set_to_row(0, logs, row):
            next_start = row + between
            moved = logged[row - begin] - lanes.pose(0)  # in coordinates that the observation does not show
        designed.append(lanes.pose(0) + moved)
        lanes.step([0], np.ascontiguousarray(logs.actions[row][None], dtype=np.float64))
    return logged, np.array(designed), period


def _add_ghost(mujoco: Any, model: Any, data: Any, scene: Any) -> None:
    """The robot as `data` has it, see-through, in place of what the scene held."""
    scene.ngeom = 0
    mujoco.mjv_addGeoms(model, data, mujoco.MjvOption(), mujoco.MjvPerturb(), int(mujoco.mjtCatBit.mjCAT_DYNAMIC), scene)
    for i in range(scene.ngeom):
        scene.geoms[i].rgba[:] = GHOST


def _passive_viewer() -> Any:
    """mujoco.viewer, once it is known that a window can open: it would wait for ever for one that cannot."""
    viewer = need("mujoco.viewer", "oted view")
    glfw = need("glfw", "oted view")
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")) or not glfw.init():
        raise DataError("there is no display to open a window on; set DISPLAY, or look at the report's films")
    return viewer


def view(design: Design | str | os.PathLike[str], *, episode: int = 1, seconds: float = 1.0, speed: float = 1.0,
         rounds: int | None = None) -> None:
    """Shows an episode of the logs in MuJoCo's viewer until its window is closed: the designed simulator, and as a ghost
    the logged motion. Every `seconds` the simulator begins anew at the logged state. speed: 1 is real time. rounds: how
    often the episode is shown; None: for ever. Needs mujoco and a display."""
    found = design if isinstance(design, Design) else load(design)
    viewer = _passive_viewer()
    mujoco = need("mujoco", "oted view")
    logged, designed, period = motion(found, episode, seconds)
    model = found.to_spec().compile()
    data, ghost = mujoco.MjData(model), mujoco.MjData(model)
    others = set(threading.enumerate())
    with viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False) as window:
        shown = 0
        while window.is_running() and (rounds is None or shown < rounds):
            for there, here in zip(logged, designed):
                begun = time.monotonic()
                if not window.is_running():
                    break
                with window.lock():
                    ghost.qpos[:], data.qpos[:] = there, here
                    mujoco.mj_forward(model, ghost)
                    mujoco.mj_forward(model, data)
                    _add_ghost(mujoco, model, ghost, window.user_scn)
                window.sync()
                time.sleep(max(0.0, begun + period / speed - time.monotonic()))
            shown += 1
    # MuJoCo closes the window in a thread of its own, which must not meet the end of the interpreter.
    for thread in set(threading.enumerate()) - others:
        thread.join(10)


def main(words: list[str]) -> None:
    """oted view RUN_DIR"""
    parser = argparse.ArgumentParser(prog="oted view", description=view.__doc__)
    parser.add_argument("run_dir", help="run directory of a finished design")
    parser.add_argument("--episode", type=int, default=1, help="of the logs [default: 1]")
    parser.add_argument("--seconds", type=float, default=1.0, help="after which the simulator begins anew [default: 1]")
    parser.add_argument("--speed", type=float, default=1.0, help="1 is real time")
    given = parser.parse_args(words)
    view(given.run_dir, episode=given.episode, seconds=given.seconds, speed=given.speed)
