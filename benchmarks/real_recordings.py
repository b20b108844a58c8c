"""How designs predict recordings of real robots that no fit has seen (examples/real), beside the nominal model.

    benchmarks/real_recordings.py [--sets double_pendulum simple_pendulum] [--methods auto least-squares] [--table]

Each cell is one `oted design` on the fit recordings. The judge is this script, with MuJoCo's Python bindings and nothing of
oted: windows of 1 s begin every 0.25 s in the held-out recordings, the logged actions are taken open loop, and every model
starts from the same state, a parabola through the logged positions of 0.05 s about the start. The error is the root mean
square of the joint positions over the first 0.1, 0.5 and 1 s; printed are ratios to the nominal model's, geometric means over
joints. A cell that is in results/real_recordings.jsonl is not made again. Needs mujoco and numpy (requirements-test.txt).

The method mujoco.sysid is MuJoCo's own identification, judged alike (rival_sysid_real.py):

    .venv-bench/bin/python benchmarks/real_recordings.py --methods mujoco.sysid      # requirements-sysid.txt
"""

import argparse
import csv
import gzip
import pathlib
import subprocess
import tempfile
import time

import mujoco
import numpy as np

from study_data import ROOT, add_record, records

STUDY = ROOT / "benchmarks/results/real_recordings.jsonl"
MARKS = (0.1, 0.5, 1.0)  # [s]
RIVAL = "mujoco.sysid"
SETS = {  # control period [s], held-out recordings by name
    "double_pendulum": (0.002, {"sine": ("143524", "143704", "144003"), "swing-up": ("154548",)}),
    "simple_pendulum": (0.005, {"all": None}),
}


def episodes(path):
    """{name: (positions, actions)} of a log on an even grid."""
    with gzip.open(path, "rt") as file:
        rows = list(csv.reader(file))
    head = rows[0]
    position = [i for i, name in enumerate(head) if name.endswith("/qpos")]
    action = [i for i, name in enumerate(head) if name.startswith("actuator/")]
    found = {}
    for row in rows[1:]:
        found.setdefault(row[0], []).append(row)
    return {name: (np.array([[float(r[i]) for i in position] for r in of]),
                   np.array([[float(r[i]) for i in action] for r in of])) for name, of in found.items()}


def start_state(positions, k, period):
    """Position and velocity at row k: a least-squares parabola through the rows within 0.025 s."""
    half = max(2, round(0.025 / period))
    around = positions[k - half:k + half + 1]
    t = np.arange(-half, half + 1) * period
    fit = np.polyfit(t, around, 2)
    return fit[2], fit[1]


def errors(model_file, logs, period):
    """Root mean square error per mark and joint."""
    model = mujoco.MjModel.from_xml_path(str(model_file))
    data = mujoco.MjData(model)
    substeps, n = round(period / model.opt.timestep), round(1.0 / period)
    squares = []
    for positions, actions in logs:
        for k in range(max(12, round(0.025 / period)), len(positions) - n - round(0.025 / period), round(0.25 / period)):
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:] = start_state(positions, k, period)
            square = np.empty((n, positions.shape[1]))
            for t in range(n):
                data.ctrl[:] = actions[k + t]
                mujoco.mj_step(model, data, substeps)
                square[t] = (data.qpos - positions[k + t + 1]) ** 2
            squares.append(square)
    mean = np.mean(squares, axis=0)
    return {mark: np.sqrt(mean[:round(mark / period)].mean(axis=0)) for mark in MARKS}


def design(folder, method, oted, out):
    """The designed model's file, and the program's exit code."""
    command = [str(oted), "design", str(folder / "task.toml"), "--out", str(out), "--quiet", "--set", f"design.method={method}"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode not in (0, 4):
        raise SystemExit(done.stderr)
    # A design that does not surely predict better is judged as well.
    subprocess.run([str(oted), "export", str(out), "--mjcf", f"{out}/export/designed.xml"], check=True, capture_output=True)
    return out / "export/designed.xml", done.returncode


def rival(folder, period, out):
    import rival_sysid_real  # in an environment of its own: requirements-sysid.txt

    rival_sysid_real.fit(folder, list(episodes(folder / "fit.csv.gz").values()), period, start_state, out / "designed.xml")
    return out / "designed.xml", 0


def make(name, method, oted):
    period, parts = SETS[name]
    folder = ROOT / "examples/real" / name
    with tempfile.TemporaryDirectory() as out:
        begin, cpu = time.monotonic(), time.process_time()
        place = pathlib.Path(out)
        model, code = rival(folder, period, place) if method == RIVAL else design(folder, method, oted, place)
        seconds = time.monotonic() - begin
        logs = episodes(folder / "held_out.csv.gz")
        cell = {"set": name, "method": method, "exit_code": code, "seconds": round(seconds), "ratios": {}, "nominal": {}}
        if method == RIVAL:
            cell["cpu_seconds"] = round(time.process_time() - cpu)
        for part, wanted in parts.items():
            chosen = [of for episode, of in logs.items() if wanted is None or episode in wanted]
            nominal = errors(folder / "model.xml", chosen, period)
            designed = errors(model, chosen, period)
            cell["nominal"][part] = {str(mark): [round(float(v), 4) for v in nominal[mark]] for mark in MARKS}
            cell["ratios"][part] = {
                str(mark): round(float(np.exp(np.mean(np.log(designed[mark] / nominal[mark])))), 3) for mark in MARKS}
    return cell


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", nargs="*", default=list(SETS), choices=list(SETS))
    parser.add_argument("--methods", nargs="*", default=["auto", "least-squares"])
    parser.add_argument("--oted", default=ROOT / "build/release/oted")
    parser.add_argument("--table", action="store_true", help="print what is there and run nothing")
    arguments = parser.parse_args()
    for name in arguments.sets:
        for method in arguments.methods:
            cell = f"{name}-{method}"
            if not arguments.table and cell not in records(STUDY):
                add_record(STUDY, cell, make(name, method, arguments.oted))
    print("| set | held out | method | 0.1 s | 0.5 s | 1 s |\n|---|---|---|---|---|---|")
    for record in records(STUDY).values():
        for part, ratio in record["ratios"].items():
            print(f"| {record['set']} | {part} | {record['method']} | " +
                  " | ".join(f"{ratio[str(mark)]:.2f}" for mark in MARKS) + " |")


if __name__ == "__main__":
    main()
