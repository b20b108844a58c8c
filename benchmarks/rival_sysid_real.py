"""MuJoCo's own identification (mujoco.sysid of the wheel) on the real recordings, for real_recordings.py.

It gets what helps it: windows of half a second (that of the judge's middle mark), spread evenly over the fit recordings,
each from the judge's own smoothed start state; controls held over the period; joint positions and velocities as sensors,
scaled by their spread over all windows; and the task file's parameters and bounds, but for delays and sensors' zeros. From the nominal values and two
uniform draws, the lowest cost kept.
"""

import contextlib
import fnmatch
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


def spec_of(folder, gain=1.0):
    """The model with sensors, for recordings whose firmware had this gain; the model's name tells the gain to modifiers."""
    spec = mujoco.MjSpec.from_file(str(folder / "model.xml"))
    spec.modelname = str(gain)
    for actuator in spec.actuators:
        if actuator.biastype == mujoco.mjtBias.mjBIAS_AFFINE and actuator.biasprm[1] != 0:  # a servo
            actuator.gainprm[0] *= gain
            actuator.biasprm[1] *= gain
    for kind in ("JOINTPOS", "JOINTVEL"):
        for joint in spec.joints:
            spec.add_sensor(type=getattr(mujoco.mjtSensor, f"mjSENS_{kind}"), objtype=mujoco.mjtObj.mjOBJ_JOINT,
                            objname=joint.name, name=f"{joint.name}_{kind}")
    return spec


def places(field, spec):
    """(owner, object, array, index) of the numbers that a path names ("body/*/mass", "actuator/servo/kp")."""
    owner, name, array = field.split("/")
    array, _, index = array.partition("[")
    index = index.rstrip("]")
    things = {"joint": spec.joints, "body": spec.bodies, "actuator": spec.actuators}[owner]
    names = [thing.name for thing in things if fnmatch.fnmatchcase(thing.name, name)]
    where = slice(None) if index in ("", "*") else slice(int(index), int(index) + 1)
    arrays = [(array, where)]
    if array == "kp":
        arrays = [("gainprm", slice(0, 1)), ("biasprm", slice(1, 2))]
    if array == "inertia":
        arrays.append(("fullinertia", where))  # where the model gives all six: what is not given is NaN, and stays so
    return [(owner, name, array, where) for name in names for array, where in arrays]


def modifier(entry, spec):
    """The value that the model has, and what sets the numbers of an entry of the task file."""
    is_absolute = entry.get("scale") == "absolute"
    fields = entry["field"] if isinstance(entry["field"], list) else [entry["field"]]
    numbers = {place[:3] + (str(place[3]),): (place, np.array(getattr(getattr(spec, place[0])(place[1]), place[2]), dtype=float))
               for field in fields for place in places(field, spec)}

    def change(of, parameter):
        value = float(parameter.value[0])
        for (owner, name, array, where), nominal in numbers.values():
            thing = getattr(of, owner)(name)
            scale = float(of.modelname) if array in ("gainprm", "biasprm") and not is_absolute else 1.0
            if nominal.ndim == 0:
                setattr(thing, array, value if is_absolute else value * float(nominal))
                continue
            changed = np.array(getattr(thing, array), dtype=float)
            changed[where] = value if is_absolute else scale * value * nominal[where]
            setattr(thing, array, changed)

    (_, _, _, where), nominal = next(iter(numbers.values()))
    start = float(nominal if nominal.ndim == 0 else nominal[where][0]) if is_absolute else 1.0
    return start, change


def searched(task):
    """The parameters that are numbers of the model: mujoco.sysid has no word for a delay of the actions here."""
    return {name: entry for name, entry in task["parameters"].items() if not str(entry["field"]).startswith(("action/", "obs/"))}


def parameters(task, spec):
    result = sysid.ParameterDict()
    for name, entry in searched(task).items():
        start, change = modifier(entry, spec)
        low, high = entry["range"]
        result.add(sysid.Parameter(name, min(max(start, low), high), low, high, modifier=change))
    return result


def sequences(folder, logs, period, start_state):
    """The windows, in sysid's words: a group for each gain of the firmware."""
    model = spec_of(folder).compile()
    substeps, n = round(period / model.opt.timestep), round(WINDOW / period)
    half = max(12, round(0.025 / period))
    begins = [(k, i) for k, log in enumerate(logs) for i in range(half, len(log.positions) - n - half, n)]
    begins = [begins[i] for i in np.unique(np.linspace(0, len(begins) - 1, N_WINDOWS).astype(int))]
    sensor_map = sysid.TimeSeries.compute_all_sensor_mapping(model)
    control_map = sysid.TimeSeries.compute_all_control_mapping(model)
    groups = {}
    for k, i in begins:
        positions, actions, gain = logs[k]
        names, initial, control, sensors = groups.setdefault(gain, ([], [], [], []))
        states = [start_state(positions, row, period) for row in range(i, i + n + 1)]
        initial.append(sysid.create_initial_state(model, *states[0], np.zeros(model.na)))
        rows = i + np.minimum(np.arange(n * substeps + 1) // substeps, n)
        control.append(sysid.TimeSeries(np.arange(len(rows)) * model.opt.timestep, actions[rows], control_map))
        seen = np.hstack([positions[i:i + n + 1], [velocity for _, velocity in states]])
        sensors.append(sysid.TimeSeries(np.arange(n + 1) * period, seen, sensor_map))
        names.append(f"{k}-{i}")
    found = [sysid.ModelSequences(f"gain {gain}", spec_of(folder, gain), *group) for gain, group in groups.items()]
    return found, substeps, n


def fit(folder, logs, period, start_state, out):
    """Writes the identified model to `out`. @return its parameters"""
    task = tomllib.loads((folder / "task.toml").read_text())
    groups, substeps, n = sequences(folder, logs, period, start_state)
    scale = np.std(np.vstack([sensor.data for group in groups for sensor in group.sensordata]), axis=0)
    n_joints = len(spec_of(folder).joints)

    def compare(params, predicted, measured, model, return_pred_all, state=None):
        rows = state[-n * substeps:][substeps - 1::substeps, 1:1 + 2 * n_joints]  # time, qpos, qvel
        return (measured.data[1:] - rows) / scale, predicted, measured

    residual = sysid.build_residual_fn(models_sequences=groups, n_threads=1, modify_residual=compare, resample_true=False)
    generator, best = random.Random(1), None
    for k in range(N_STARTS):
        initial = parameters(task, spec_of(folder))
        if k > 0:
            initial.update_from_vector(np.array([generator.uniform(*entry["range"]) for entry in searched(task).values()]))
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
    return {name: float(value) for name, value in zip(searched(task), best[2])}
