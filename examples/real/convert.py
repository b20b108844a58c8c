"""Makes the logs of so101_arm and servo_pendulum from their makers' repositories (README.md names commits and licences).

    examples/real/convert.py so101_arm SAGE        # a checkout of isaac-sim2real/sage at 4ffd262
    examples/real/convert.py servo_pendulum BAM    # a checkout of Rhoban/bam at af22604

The arm's rows are even as they are. The servo's come onto an even grid: commands hold until the next row, readings are
interpolated. Needs numpy.
"""

import csv
import gzip
import json
import pathlib
import sys

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
SO101_JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
SO101_LONGEST = 60.0  # [s] of each recording
SO101 = {
    "fit": ("large_amplitude", "random_waypoints", "oscillation_med_freq", "chirp_sweep", "workspace_sweep", "reach_and_return"),
    "held_out": ("fast_transitions", "figure_eight", "diagonal_sweep", "symmetric_motion", "prbs_excitation"),
}
NOMINAL_GAIN = 400  # the firmware gain that the model's kp stands for
SERVO = {  # motion, firmware gain
    "fit": [(motion, gain) for gain in (100, 400, 800) for motion in ("sin_sin", "up_and_down")],
    "held_out": [(motion, 200) for motion in ("sin_sin", "up_and_down", "sin_time_square")] +
                [("sin_time_square", gain) for gain in (100, 400, 800)],
}


def even(times, read, held, period):
    """Rows of an even grid: its times, what was read, what was commanded."""
    grid = np.arange(times[0], times[-1], period)
    rows = np.searchsorted(times, grid, side="right") - 1
    readings = np.column_stack([np.interp(grid, times, column) for column in read.T])
    return np.column_stack([grid - grid[0], readings, held[rows]])


def write(path, head, episodes):
    with gzip.GzipFile(path, "wb", mtime=0) as packed:
        lines = [",".join(head)]
        for name, rows in episodes:
            lines += [",".join([name] + [f"{value:.7g}" for value in row]) for row in rows]
        packed.write(("\n".join(lines) + "\n").encode())


def so101(checkout):
    def episode(name):
        folder = checkout / "output/real/so101/custom" / name
        with open(folder / "state_motor.csv") as states, open(folder / "control.csv") as commands:
            states, commands = list(csv.DictReader(states)), list(csv.DictReader(commands))
        times = np.array([float(row["timestamp"]) for row in states]) * 1e-6
        read = np.array([json.loads(row["positions"])[:5] + json.loads(row["velocities"])[:5] for row in states])
        held = np.array([json.loads(row["positions"])[:5] for row in commands])
        n = np.searchsorted(times, SO101_LONGEST)
        return name, np.column_stack([times - times[0], read, held])[:n]

    head = ["episode", "time"] + [f"joint/{joint}/{field}" for field in ("qpos", "qvel") for joint in SO101_JOINTS]
    head += [f"actuator/{joint}" for joint in SO101_JOINTS]
    for part, names in SO101.items():
        write(HERE / f"so101_arm/{part}.csv.gz", head, [episode(name) for name in names])


def servo(checkout):
    logs = {}
    for path in sorted((checkout / "bam/data.bak/raw").glob("*.json")):
        log = json.loads(path.read_text())
        logs[log["trajectory"], log["kp"]] = log["entries"]

    def episode(motion, gain):
        def column(name):
            return np.array([entry[name] for entry in logs[motion, gain]])

        held = np.column_stack([column("goal_position"), np.full(len(column("timestamp")), gain / NOMINAL_GAIN)])
        return f"{motion}-{gain}", even(column("timestamp"), column("position")[:, None], held, 0.005)

    head = ["episode", "time", "joint/servo/qpos", "actuator/servo", "gain"]
    for part, wanted in SERVO.items():
        write(HERE / f"servo_pendulum/{part}.csv.gz", head, [episode(*one) for one in wanted])


if __name__ == "__main__":
    if len(sys.argv) != 3 or sys.argv[1] not in ("so101_arm", "servo_pendulum"):
        raise SystemExit(__doc__)
    (so101 if sys.argv[1] == "so101_arm" else servo)(pathlib.Path(sys.argv[2]))
