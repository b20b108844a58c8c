"""MuJoCo's own identification (mujoco.sysid of the wheel) on the real recordings, for real_recordings.py.

It gets what helps it: windows of half a second (that of the judge's middle mark), spread evenly over the fit recordings,
each from the judge's own smoothed start state; controls held over the period; joint positions and velocities as sensors,
scaled by their spread over all windows; and the task file's parameters and bounds. From the nominal values and two
uniform draws, the lowest cost kept.
"""

import contextlib
import io
import os
import random
import tomllib

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import mujoco
import numpy as np
from mujoco import sysid

WINDOW = 0.5  # [s]
N_WINDOWS = 120
N_STARTS = 3


def spec_of(folder):
    spec = mujoco.MjSpec.from_file(str(folder / "model.xml"))
    for kind in ("JOINTPOS", "JOINTVEL"):
        for joint in spec.joints:
            spec.add_sensor(type=getattr(mujoco.mjtSensor, f"mjSENS_{kind}"), objtype=mujoco.mjtObj.mjOBJ_JOINT,
                            objname=joint.name, name=f"{joint.name}_{kind}")
    return spec


def modifier(field, is_absolute, spec):
    """What sets one number, or all of an array, of the object that a path names ("body/link2/inertia[*]")."""
    owner, name, array = field.split("/")
    array, _, index = array.partition("[")
    index = index.rstrip("]")

    def values(of):
        return getattr(getattr(of, owner)(name), array)

    nominal = np.array(values(spec), dtype=float)

    def change(of, parameter):
        value = float(parameter.value[0])
        thing = getattr(of, owner)(name)
        if nominal.ndim == 0:
            setattr(thing, array, value if is_absolute else value * float(nominal))
            return
        changed = np.array(getattr(thing, array), dtype=float)
        where = slice(None) if index == "*" else slice(int(index or 0), int(index or 0) + 1)
        changed[where] = value if is_absolute else value * nominal[where]
        setattr(thing, array, changed)

    start = float(np.ravel(nominal)[0 if index in ("", "*") else int(index)]) if is_absolute else 1.0
    return start, change


def parameters(task, spec):
    result = sysid.ParameterDict()
    for name, entry in task["parameters"].items():
        start, change = modifier(entry["field"], entry.get("scale") == "absolute", spec)
        low, high = entry["range"]
        result.add(sysid.Parameter(name, min(max(start, low), high), low, high, modifier=change))
    return result


def sequences(spec, logs, period, start_state):
    """The windows, in sysid's words. `logs`: (positions, actions) of each recording."""
    model = spec.compile()
    substeps, n = round(period / model.opt.timestep), round(WINDOW / period)
    half = max(12, round(0.025 / period))
    begins = [(k, i) for k, (positions, _) in enumerate(logs) for i in range(half, len(positions) - n - half, n)]
    begins = [begins[i] for i in np.unique(np.linspace(0, len(begins) - 1, N_WINDOWS).astype(int))]
    sensor_map = sysid.TimeSeries.compute_all_sensor_mapping(model)
    control_map = sysid.TimeSeries.compute_all_control_mapping(model)
    initial, control, sensors = [], [], []
    for k, i in begins:
        positions, actions = logs[k]
        states = [start_state(positions, row, period) for row in range(i, i + n + 1)]
        initial.append(sysid.create_initial_state(model, *states[0], np.zeros(model.na)))
        rows = i + np.minimum(np.arange(n * substeps + 1) // substeps, n)
        control.append(sysid.TimeSeries(np.arange(len(rows)) * model.opt.timestep, actions[rows], control_map))
        seen = np.hstack([positions[i:i + n + 1], [velocity for _, velocity in states]])
        sensors.append(sysid.TimeSeries(np.arange(n + 1) * period, seen, sensor_map))
    names = [f"{k}-{i}" for k, i in begins]
    return sysid.ModelSequences("logs", spec, names, initial, control, sensors), substeps, n


def fit(folder, logs, period, start_state, out):
    """Writes the identified model to `out`. @return its parameters"""
    task = tomllib.loads((folder / "task.toml").read_text())
    group, substeps, n = sequences(spec_of(folder), logs, period, start_state)
    scale = np.std(np.vstack([sensor.data for sensor in group.sensordata]), axis=0)
    n_joints = len(spec_of(folder).joints)

    def compare(params, predicted, measured, model, return_pred_all, state=None):
        rows = state[-n * substeps:][substeps - 1::substeps, 1:1 + 2 * n_joints]  # time, qpos, qvel
        return (measured.data[1:] - rows) / scale, predicted, measured

    residual = sysid.build_residual_fn(models_sequences=[group], n_threads=1, modify_residual=compare, resample_true=False)
    generator, best = random.Random(1), None
    for k in range(N_STARTS):
        initial = parameters(task, spec_of(folder))
        if k > 0:
            initial.update_from_vector(np.array([generator.uniform(*entry["range"]) for entry in task["parameters"].values()]))
        with contextlib.redirect_stdout(io.StringIO()):  # its optimiser's own verbose flag cannot be reached
            _, result = sysid.optimize(initial, residual, verbose=False, max_iters=30)
        cost = float(np.sum(np.concatenate(residual(result.x, initial)[0])**2))
        if best is None or cost < best[0]:
            best = (cost, initial, result.x)
    found, spec = best[1], spec_of(folder)
    found.update_from_vector(best[2])
    for parameter in found.values():
        parameter.modifier(spec, parameter)
    spec.compile()
    out.write_text(spec.to_xml())
    return {name: float(value) for name, value in zip(task["parameters"], best[2])}
