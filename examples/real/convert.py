"""Makes the logs of a set from its makers' repository (README.md names commits and licences).

    examples/real/convert.py so101_arm SAGE                      # a checkout of isaac-sim2real/sage at 4ffd262
    examples/real/convert.py so101_others SAGE                   # all its other recordings, which are not in this repository
    examples/real/convert.py servo_pendulum BAM                  # a checkout of Rhoban/bam at af22604
    examples/real/convert.py double_pendulum_a0 DOUBLE_PENDULUM  # of dfki-ric-underactuated-lab/double_pendulum at 1e8544e
    examples/real/convert.py double_pendulum_c0 DOUBLE_PENDULUM

The arm's rows are even as they are. The others come onto an even grid: commands hold until the next row, readings are
interpolated; a recording is cut where no row came for more than 20 ms. Needs numpy.
"""

import csv
import gzip
import json
import pathlib
import shutil
import sys

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
SO101_JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
SO101_LONGEST = 60.0  # [s] of each recording
SO101 = {
    "fit": ("large_amplitude", "random_waypoints", "oscillation_med_freq", "chirp_sweep", "workspace_sweep", "reach_and_return"),
    "held_out": ("fast_transitions", "figure_eight", "diagonal_sweep", "symmetric_motion", "prbs_excitation"),
}
SO101_OTHERS = ("multisine", "step_response", "friction_gravity", "circular_motion", "coupled_joints", "trapezoidal_profile")
NOMINAL_GAIN = 400  # the firmware gain that the model's kp stands for
SERVO = {  # motion, firmware gain
    "fit": [(motion, gain) for gain in (100, 400, 800) for motion in ("sin_sin", "up_and_down")],
    "held_out": [(motion, 200) for motion in ("sin_sin", "up_and_down", "sin_time_square")] +
                [("sin_time_square", gain) for gain in (100, 400, 800)],
}


DOUBLE_PENDULUMS = {  # recordings by their numbers
    "double_pendulum_a0": ("design_A.0/20220815", {"fit": "00 01 02 04 11 12", "held_out": "03 05 13"}),
    "double_pendulum_c0": ("design_C.0/20220914", {"fit": "00 01 02 04 06 12", "held_out": "03 05 13"}),
}
SHORTEST_PART = 1.5  # [s]


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


def so101(checkout, folder, parts):
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
    for part, names in parts.items():
        write(folder / f"{part}.csv.gz", head, [episode(name) for name in names])


def so101_others(checkout):
    """None that so101_arm has: six to fit, chosen by their names, all others held out."""
    seen = set(SO101["fit"] + SO101["held_out"] + SO101_OTHERS)
    rest = [path.name for path in sorted((checkout / "output/real/so101/custom").iterdir()) if path.name not in seen]
    folder = HERE / "so101_others"
    folder.mkdir(exist_ok=True)
    for name in ("model.xml", "task.toml", "LICENSE"):
        shutil.copy(HERE / "so101_arm" / name, folder)
    so101(checkout, folder, {"fit": SO101_OTHERS, "held_out": rest})


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


def double_pendulum(checkout, name):
    folder, parts = DOUBLE_PENDULUMS[name]
    columns = ["time", "pos_meas1", "pos_meas2", "vel_meas1", "vel_meas2", "tau_con1", "tau_con2"]

    def episodes(number):
        path = checkout / "data/experiment_records" / folder / f"sys_id/trajectory_{number}.csv"
        with open(path) as file:
            rows = np.array([[float(row[column]) for column in columns] for row in csv.DictReader(file)])
        unbroken = np.split(rows, np.flatnonzero(np.diff(rows[:, 0]) > 0.02) + 1)
        long = [part for part in unbroken if part[-1, 0] - part[0, 0] > SHORTEST_PART]
        return [(number if len(long) == 1 else f"{number}-{k + 1}", even(part[:, 0], part[:, 1:5], part[:, 5:], 0.002))
                for k, part in enumerate(long)]

    head = ["episode", "time"] + [f"joint/{joint}/{field}" for field in ("qpos", "qvel") for joint in ("shoulder", "elbow")]
    head += ["actuator/shoulder", "actuator/elbow"]
    for part, numbers in parts.items():
        write(HERE / name / f"{part}.csv.gz", head, [one for number in numbers.split() for one in episodes(number)])


MAKERS = {
    "so101_arm": lambda source: so101(source, HERE / "so101_arm", SO101),
    "so101_others": so101_others,
    "servo_pendulum": servo,
    **{name: lambda source, name=name: double_pendulum(source, name) for name in DOUBLE_PENDULUMS},
}

if __name__ == "__main__":
    if len(sys.argv) != 3 or sys.argv[1] not in MAKERS:
        raise SystemExit(__doc__)
    MAKERS[sys.argv[1]](pathlib.Path(sys.argv[2]))
