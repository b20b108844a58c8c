"""How designs predict recordings of real robots that no fit has seen (examples/real), beside the nominal model.

    benchmarks/real_recordings.py [--sets double_pendulum simple_pendulum] [--methods auto least-squares] [--table]

Each cell is one `oted design` on the fit recordings. The judge is this script, with MuJoCo's Python bindings and nothing of
oted: windows of 1 s begin every 0.25 s in the held-out recordings, the logged actions are taken open loop, and every model
starts from the same state, a parabola through the logged positions of 0.05 s about the start. The error is the root mean
square of the joint positions over the first 0.1, 0.5 and 1 s; printed are ratios to the nominal model's, geometric means over
joints; the file has the largest of any single recording, too (worst). What MJCF cannot carry is taken from the design's
q.json: a delay of the actions, the zero of a position sensor that is added to what the model shows. A column `gain` multiplies
the stiffness of every servo. A cell that is in results/real_recordings.jsonl is not made again. Needs mujoco and numpy
(requirements-test.txt).

The method init is auto with the task file that `oted init` writes from the model and the fit recordings alone, as it is: its
parameters in place of those of the folder's task.toml. It knows nothing of a column `gain`.

The method mujoco.sysid is MuJoCo's own identification, judged alike (rival_sysid_real.py):

    .venv-bench/bin/python benchmarks/real_recordings.py --methods mujoco.sysid      # requirements-sysid.txt
"""

import argparse
import csv
import gzip
import json
import pathlib
import re
import resource
import subprocess
import tempfile
import time
import typing

import mujoco
import numpy as np

from study_data import ROOT, add_record, records

STUDY = ROOT / "benchmarks/results/real_recordings.jsonl"
MARKS = (0.1, 0.5, 1.0)  # [s]
RIVAL = "mujoco.sysid"
INIT = "init"
SETS = {  # control period [s], held-out recordings by name
    "double_pendulum": (0.002, {"sine": ("143524", "143704", "144003"), "swing-up": ("154548",)}),
    "double_pendulum_a0": (0.002, {"all": None}),
    "double_pendulum_c0": (0.002, {"all": None}),
    "simple_pendulum": (0.005, {"all": None}),
    "so101_arm": (0.02, {"waypoints": ("fast_transitions", "figure_eight", "diagonal_sweep", "symmetric_motion"),
                         "jumps": ("prbs_excitation",)}),
    "so101_others": (0.02, {"all": None}),
    "servo_pendulum": (0.005, {"new gain": ("sin_sin-200", "up_and_down-200", "sin_time_square-200"),
                               "new motion": ("sin_time_square-100", "sin_time_square-400", "sin_time_square-800")}),
}


class Log(typing.NamedTuple):
    positions: np.ndarray
    actions: np.ndarray
    gain: float  # of the firmware, in multiples of the model's


class Judged(typing.NamedTuple):
    """A model, and what of it MJCF cannot carry."""

    path: pathlib.Path
    delay: float = 0.0  # of the actions [rows]
    zeros: dict[str, float] = {}  # what a joint's sensor shows at position 0


def episodes(path):
    """{name: Log} of a log on an even grid."""
    with gzip.open(path, "rt") as file:
        rows = list(csv.reader(file))
    head = rows[0]
    found = {}
    for row in rows[1:]:
        found.setdefault(row[0], []).append(row)

    def columns(of, wanted):
        return np.array([[float(row[i]) for i, name in enumerate(head) if wanted(name)] for row in of])

    return {name: Log(columns(of, lambda n: n.endswith("/qpos")), columns(of, lambda n: n.startswith("actuator/")),
                      float(of[0][head.index("gain")]) if "gain" in head else 1.0) for name, of in found.items()}


def start_state(positions, k, period):
    """Position and velocity at row k: a least-squares parabola through the rows within 0.025 s."""
    half = max(2, round(0.025 / period))
    around = positions[k - half:k + half + 1]
    t = np.arange(-half, half + 1) * period
    fit = np.polyfit(t, around, 2)
    return fit[2], fit[1]


def late(actions, delay):
    """The actions as they act `delay` time steps later; a step that they change in gets their mean over it."""
    steps, part = int(delay), delay - int(delay)

    def shifted(n):
        return np.vstack([np.repeat(actions[:1], n, axis=0), actions[:len(actions) - n]])

    return (1 - part) * shifted(steps) + part * shifted(steps + 1)


def with_gain(model, gain, stiffness):
    for i in range(model.nu):
        if model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_AFFINE and stiffness[i] != 0:  # a servo
            model.actuator_gainprm[i, 0], model.actuator_biasprm[i, 1] = gain * stiffness[i], -gain * stiffness[i]


def errors(judged, logs, period):
    """Root mean square error per mark and joint."""
    model = mujoco.MjModel.from_xml_path(str(judged.path))
    model.actuator_delay[:] = 0  # commands before a window are the log's, which `late` knows and the model does not
    data = mujoco.MjData(model)
    stiffness = -model.actuator_biasprm[:, 1].copy()
    zeros = np.array([judged.zeros.get(model.joint(j).name, 0.0) for j in range(model.njnt)])
    substeps, n = round(period / model.opt.timestep), round(1.0 / period)
    squares = []
    for log in logs:
        with_gain(model, log.gain, stiffness)
        positions, actions = log.positions - zeros, late(np.repeat(log.actions, substeps, axis=0), judged.delay * substeps)
        for k in range(max(12, round(0.025 / period)), len(positions) - n - round(0.025 / period), round(0.25 / period)):
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:] = start_state(positions, k, period)
            square = np.empty((n, positions.shape[1]))
            for t in range(n):
                for action in actions[(k + t) * substeps:(k + t + 1) * substeps]:
                    data.ctrl[:] = action
                    mujoco.mj_step(model, data)
                square[t] = (data.qpos - positions[k + t + 1]) ** 2
            squares.append(square)
    mean = np.mean(squares, axis=0)
    return {mark: np.sqrt(mean[:round(mark / period)].mean(axis=0)) for mark in MARKS}


def ratios(designed, nominal):
    """Geometric mean over joints, per mark."""
    return {str(mark): round(float(np.exp(np.mean(np.log(designed[mark] / nominal[mark])))), 3) for mark in MARKS}


def design(folder, method, oted, out):
    """The designed model, and the program's exit code."""
    task = folder / "task.toml"
    if method == INIT:
        task, method = out.parent / f"{out.name}.toml", "auto"
        subprocess.run([str(oted), "init", str(folder / "model.xml"), str(folder / "fit.csv.gz"), "--out", str(task)], check=True,
                       capture_output=True)
    command = [str(oted), "design", str(task), "--out", str(out), "--quiet", "--set", f"design.method={method}"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode not in (0, 4):
        raise RuntimeError(done.stderr.strip())
    # A design that does not surely predict better is judged as well.
    xml, q = out / "export/designed.xml", out / "export/q.json"
    subprocess.run([str(oted), "export", str(out), "--mjcf", str(xml), "--q", str(q)], check=True, capture_output=True)
    q = json.loads(q.read_text())
    best = next(one for one in q["components"] if one["seed"] == q["best_seed"])
    values = dict(zip(q["fields"], best["mode"]))
    zeros = {field.split("/")[2]: value for field, value in values.items() if re.fullmatch("obs/joint/[^/]+/qpos/bias", field)}
    return Judged(xml, values.get("action/delay", 0.0), zeros), done.returncode


def rival(folder, period, out):
    out.mkdir()
    import rival_sysid_real  # in an environment of its own: requirements-sysid.txt

    rival_sysid_real.fit(folder, list(episodes(folder / "fit.csv.gz").values()), period, start_state, out / "designed.xml")
    return Judged(out / "designed.xml"), 0


def processor_time():
    """Of this process and those that it waited for [s]."""
    return time.process_time() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime


def make(name, method, oted):
    period, parts = SETS[name]
    folder = ROOT / "examples/real" / name
    with tempfile.TemporaryDirectory() as out:
        begin, cpu = time.monotonic(), processor_time()
        place = pathlib.Path(out) / "run"
        model, code = rival(folder, period, place) if method == RIVAL else design(folder, method, oted, place)
        seconds, cpu = time.monotonic() - begin, processor_time() - cpu
        logs = episodes(folder / "held_out.csv.gz")
        cell = {"set": name, "method": method, "exit_code": code, "seconds": round(seconds), "cpu_seconds": round(cpu),
                "ratios": {}, "worst": {}, "nominal": {}}
        for part, wanted in parts.items():
            chosen = [of for episode, of in logs.items() if wanted is None or episode in wanted]
            own = Judged(folder / "model.xml")
            nominal = errors(own, chosen, period)
            designed = errors(model, chosen, period)
            of_each = [ratios(errors(model, [one], period), errors(own, [one], period)) for one in chosen]
            cell["worst"][part] = {mark: max(ratio[mark] for ratio in of_each) for mark in of_each[0]}
            cell["nominal"][part] = {str(mark): [round(float(v), 4) for v in nominal[mark]] for mark in MARKS}
            cell["ratios"][part] = ratios(designed, nominal)
    return cell


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    there = [name for name in SETS if (ROOT / "examples/real" / name).exists()]
    parser.add_argument("--sets", nargs="*", default=there, choices=list(SETS))
    parser.add_argument("--methods", nargs="*", default=["auto", "least-squares"])
    parser.add_argument("--oted", default=ROOT / "build/release/oted")
    parser.add_argument("--table", action="store_true", help="print what is there and run nothing")
    arguments = parser.parse_args()
    for name in arguments.sets:
        for method in arguments.methods:
            cell = f"{name}-{method}"
            if arguments.table or cell in records(STUDY):
                continue
            try:
                add_record(STUDY, cell, make(name, method, arguments.oted))
            except RuntimeError as error:  # a method that does not take such logs
                print(f"{cell}: {error}")
    print("| set | held out | method | 0.1 s | 0.5 s | 1 s |\n|---|---|---|---|---|---|")
    for record in records(STUDY).values():
        for part, ratio in record["ratios"].items():
            print(f"| {record['set']} | {part} | {record['method']} | " +
                  " | ".join(f"{ratio[str(mark)]:.2f}" for mark in MARKS) + " |")


if __name__ == "__main__":
    main()
