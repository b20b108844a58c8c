"""What the studies share: tasks, parameters, targets and logs (shipped ones, noisy copies and drawn targets, each made by one
`oted` command, so that all read the same bytes), and the file of a study: JSON lines, one for each cell.
"""

import fcntl
import json
import os
import pathlib
import random
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent
PARAMETERS = {
    "friction": "geom/*/friction[0]",
    "gain": "actuator/*/gainprm[0]",
    "gravity": "opt/gravity[2]",
}
LOW, HIGH = 0.2, 2.0
TASKS = {"hopper": "Hopper-v5", "halfcheetah": "HalfCheetah-v5", "walker2d": "Walker2d-v5"}
DATA = ("medium", "medium-noisy")  # noisy: standard deviation NOISE on every observation, no full states
NOISE = 0.02
# Trajectory matching alone. Neither the clone nor the classifiers have a say in q, its intervals or its verdicts: they are kept
# short. The form is what auto begins with; outside the family auto tries others too, and the verdicts stay those of this one.
MATCHING_ALONE = ("design.method=trajectories", "clone.max_steps=100", "design.discriminator.steps=1", "selection.judge_steps=20",
                  "selection.n_sims=2", "selection.n_steps=20")


def drawn(task):
    """A target of its own for each task, anywhere in the middle nine tenths of the range."""
    generator = random.Random(f"target of {task}")
    return tuple(round(generator.uniform(LOW + 0.09, HIGH - 0.09), 2) for _ in PARAMETERS)


def truth(task, target):
    return {"nominal": (1.0, 1.0, 1.0), "shifted": (0.6, 1.3, 1.2)}.get(target) or drawn(task)


def parameter_words(fields, low=LOW, high=HIGH):
    """--param words for name -> path."""
    return [word for name, path in fields.items() for word in ("--param", f"{name}={path}:{low}:{high}")]


def collect(oted, task, fields, truth, seed, out, noise=0.0, episodes=5, absolute=None, policy=None):
    """Episodes of a policy (by default the shipped medium one), logged into `out` in the target where truth: name -> multiple
    of nominal, or the value itself of those that absolute: name -> (low, high) names. A task that is not of TASKS is a file."""
    command = [oted, "collect", "--task", TASKS.get(task, task), "--policy", policy or f"examples/policies/{task}/medium.npz",
               "--episodes", episodes, "--seed", seed, "--threads", 1, "--out", out,
               *parameter_words({name: path for name, path in fields.items() if name not in (absolute or {})}, 0.2, 3.0)]
    for name, (low, high) in (absolute or {}).items():
        command += ["--param", f"{name}={fields[name]}:{low}:{high}:absolute"] if name in fields else []
    for name, value in truth.items():
        command += ["--truth", f"{name}={value}"]
    if noise > 0:
        command += ["--noise", noise]
    subprocess.run([str(word) for word in command], cwd=ROOT, check=True, capture_output=True)


def logs(task, target, data, oted, folder):
    """The dataset's path; what is not shipped is written into `folder`."""
    noisy = data.endswith("-noisy")
    shipped = f"examples/data/{task}-medium{'-shifted' if target == 'shifted' else ''}.hdf5"
    made = pathlib.Path(folder) / f"{task}-{target}-{data}.hdf5"
    if target == "drawn":
        collect(oted, task, PARAMETERS, dict(zip(PARAMETERS, drawn(task))), 1, made, NOISE if noisy else 0)
    elif noisy:
        command = [oted, "data", "convert", shipped, made, "--noise", NOISE, "--seed", 1]
        subprocess.run([str(word) for word in command], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    else:
        return shipped
    return str(made)


def cells_of(forms):
    for task in TASKS:
        for target in ("nominal", "shifted", "drawn"):
            for data in DATA:
                for form in forms:
                    yield {"task": task, "target": target, "data": data, "form": form}


def name_of(cell):
    return "-".join(cell.values())


def run_missing(cells, study, only, run):
    """Adds run(cell) for each cell that the study lacks and whose name contains `only`; yields its name and record."""
    for cell in cells:
        name = name_of(cell)
        if name not in records(study) and only in name:
            record = run(cell)
            add_record(study, name, record)
            yield name, record


def records_of(cells, study):
    """The records of those cells that the study has, in the order of the cells."""
    there = records(study)
    return [there[name] for name in map(name_of, cells) if name in there]


def records(study):
    """The study's file: name of a cell -> its record, in the order of the names."""
    if not study.exists():
        return {}
    lines = [json.loads(line) for line in study.read_text().splitlines()]
    return {line.pop("cell"): line for line in lines}


def add_record(study, name, record):
    """Puts the record of one cell, new or not, into the study's file, which appears whole. Several processes may add at once."""
    study.parent.mkdir(parents=True, exist_ok=True)
    folder = os.open(study.parent, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        there = records(study) | {name: record}
        text = "".join(json.dumps({"cell": cell} | there[cell], separators=(",", ":")) + "\n" for cell in sorted(there))
        beside = study.with_name(f".{study.name}.{os.getpid()}")
        beside.write_text(text)
        beside.replace(study)
    finally:
        os.close(folder)


def commit():
    return subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True,
                          check=False).stdout.strip()


def number(error):
    return f"{error:.3f}" if error >= 0.001 else f"{error:.0e}"
