"""Writes recordings of the real double pendulum as a LeRobot set, by LeRobot's own package: write_lerobot.py OUT. What it
imports for cameras alone need not be there."""

import csv
import gzip
import inspect
import pathlib
import shutil
import sys
from unittest import mock

import numpy as np

for name in ("torchvision", "torchvision.transforms", "torchvision.transforms.v2", "torchvision.transforms.v2.functional"):
    sys.modules.setdefault(name, mock.MagicMock(__spec__=mock.MagicMock()))
from lerobot.datasets.lerobot_dataset import CODEBASE_VERSION, LeRobotDataset  # noqa: E402

FIT = pathlib.Path(__file__).resolve().parents[2] / "examples/real/double_pendulum/fit.csv.gz"
RATE = 500


def recordings():
    with gzip.open(FIT, "rt", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    names, table = rows[0], rows[1:]
    labels = np.array([row[0] for row in table])
    values = np.array([row[2:] for row in table], dtype=np.float64)
    return names[2:6], names[6:], [values[labels == label] for label in dict.fromkeys(labels)]


def main(out):
    states, actions, episodes = recordings()
    shutil.rmtree(out, ignore_errors=True)
    features = {"observation.state": {"dtype": "float32", "shape": (len(states),), "names": states},
                "action": {"dtype": "float32", "shape": (len(actions),), "names": actions}}
    data = LeRobotDataset.create("local/double_pendulum", fps=RATE, features=features, root=out, use_videos=False)
    as_argument = "task" in inspect.signature(data.add_frame).parameters
    for rows in episodes:
        for row in rows.astype(np.float32):
            frame = {"observation.state": row[:len(states)], "action": row[len(states):]}
            if as_argument:
                data.add_frame(frame, task="swing")
            else:
                data.add_frame({**frame, "task": "swing"})
        data.save_episode()
    getattr(data, "finalize", lambda: None)()
    print(f"LeRobot {CODEBASE_VERSION}: {len(episodes)} episodes in {out}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(pathlib.Path(sys.argv[1]))
