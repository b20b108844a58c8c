"""LeRobot's data sets (v2.0, v2.1, v3.0) as logs. Needs pyarrow."""

import json
import os
import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from oted._needs import need
from oted.errors import DataError, UsageError
from oted.logs import Logs


def read_lerobot(
    path: str | os.PathLike[str],
    *,
    episodes: Sequence[int] | None = None,
    state: str = "observation.state",
    action: str = "action",
    observation_names: Sequence[str] | None = None,
    action_names: Sequence[str] | None = None,
    scale: float | Sequence[float] = 1.0,
    unwrap: Sequence[str] = (),
) -> Logs:
    """A data set's folder. Rows are taken as evenly spaced at its fps: its float32 time stamps lose milliseconds. Cameras
    are not read. scale multiplies states and actions, such as pi / 180 for arms that log degrees: nothing is guessed.
    unwrap: as oted.Logs has it, after scaling.

    An action that is the next measured position, as teleoperation often logs it, makes the controller part of the
    simulator."""
    folder = pathlib.Path(path)
    try:
        info = json.loads((folder / "meta" / "info.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as e:
        raise DataError(f"'{folder}' is no LeRobot data set: meta/info.json cannot be read ({e})") from e
    parquet = need("pyarrow.parquet", "a LeRobot data set", "pyarrow")
    wanted = None if episodes is None else {int(i) for i in episodes}
    rows: dict[int, list[tuple[int, Any, Any]]] = {}
    files = sorted((folder / "data").glob("*/*.parquet"))
    if not files:
        raise DataError(f"'{folder}' has no data/*/*.parquet; is the download complete?")
    for file in files:
        try:
            table = parquet.read_table(file, columns=["episode_index", "frame_index", state, action])
        except Exception as e:  # pyarrow raises many kinds
            raise DataError(f"'{file}': pyarrow cannot read {state} and {action} ({e}); the columns are "
                            f"{', '.join(info.get('features', {}))}") from e
        if table.num_rows == 0:
            continue
        index = table["episode_index"].to_numpy()
        frames = table["frame_index"].to_numpy()
        seen, done = (np.stack(table[name].to_numpy(zero_copy_only=False)) for name in (state, action))
        for episode in np.unique(index):
            if wanted is None or int(episode) in wanted:
                mine = index == episode
                rows.setdefault(int(episode), []).append((int(frames[mine][0]), seen[mine], done[mine]))
    if wanted is not None and wanted - rows.keys():
        raise UsageError(f"episode {min(wanted - rows.keys())} is not in '{folder}'")
    factor = np.asarray(scale, dtype=np.float64)
    parts = []
    for episode in sorted(rows):
        pieces = sorted(rows[episode], key=lambda piece: piece[0])
        seen, done = (np.vstack([piece[k] for piece in pieces]).astype(np.float64) * factor for k in (1, 2))
        parts.append((seen, done))
    return Logs.from_episodes(
        parts, period=1 / float(info["fps"]),
        observation_names=list(observation_names or _names(info, state, parts[0][0].shape[1])),
        action_names=list(action_names or _names(info, action, parts[0][1].shape[1])), unwrap=unwrap)


def _names(info: dict[str, Any], feature: str, n: int) -> list[str]:
    names = info.get("features", {}).get(feature, {}).get("names")
    if isinstance(names, dict):  # {"motors": [...]}
        names = [name for group in names.values() for name in group]
    if not isinstance(names, list) or len(names) != n:
        return []
    return [str(name) for name in names]
