#!/usr/bin/env python3
"""MuJoCo's own identification (mujoco.sysid of the wheel) on the data of design_accuracy.py: error, seconds, intervals.

  .venv-bench/bin/python benchmarks/rival_sysid.py [--oted build/release/oted] [--only SUBSTRING] [--table]

The environment is that of requirements-sysid.txt. Two ways of calling it:

  documented  windows of 20 control steps, its default residual: position and velocity sensors of the joints, each
              scaled by its own size in the window
  informed    what a user finds out who knows its source: windows of one control step, controls held over the period
              (it resamples them linearly otherwise), states compared in place of sensors (which lag by a physics step),
              one scale for each signal over all windows

Each from its nominal start and two uniform draws, the lowest cost kept. As the observations hold it, the first
observation of a window is its exact state, root x zero. Errors in multiples of the nominal value.
"""

import argparse
import contextlib
import io
import os
import pathlib
import random
import statistics
import tempfile
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import gymnasium
import h5py
import mujoco
import numpy as np
from mujoco import sysid

from study_data import (HIGH, LOW, PARAMETERS, ROOT, TASKS, cells_of, commit, logs, name_of, number, records_of,
                        run_missing, truth)

MODELS = {"hopper": ("hopper.xml", 4, 10.0), "halfcheetah": ("half_cheetah.xml", 5, np.inf),
          "walker2d": ("walker2d_v5.xml", 4, 10.0)}  # file, physics steps per control step, clip of observed velocities
WAYS = {"documented": 20, "informed": 1}  # control steps per window
N_WINDOWS = 250
N_STARTS = 3


def cells():
    return cells_of([f"sysid-{way}" for way in WAYS])


def model_spec(task):
    assets = pathlib.Path(gymnasium.__file__).parent / "envs/mujoco/assets"
    spec = mujoco.MjSpec.from_file(str(assets / MODELS[task][0]))
    # In the order of the observations. Root x is not observed, and a signal that stands still would be divided by zero.
    for kind, joints in (("JOINTPOS", spec.joints[1:]), ("JOINTVEL", spec.joints)):
        for joint in joints:
            spec.add_sensor(type=getattr(mujoco.mjtSensor, f"mjSENS_{kind}"), objtype=mujoco.mjtObj.mjOBJ_JOINT,
                            objname=joint.name, name=f"{joint.name}_{kind}")
    return spec


def parameters(spec):
    """Multipliers. The modifiers set values from the model as it was read: sysid changes one spec again and again."""
    friction = [float(geom.friction[0]) for geom in spec.geoms]
    gain = [float(actuator.gainprm[0]) for actuator in spec.actuators]
    gravity = float(spec.option.gravity[2])

    def set_friction(s, p):
        for geom, value in zip(s.geoms, friction):
            geom.friction[0] = value * float(p.value[0])

    def set_gain(s, p):
        for actuator, value in zip(s.actuators, gain):
            actuator.gainprm[0] = value * float(p.value[0])

    def set_gravity(s, p):
        s.option.gravity[2] = gravity * float(p.value[0])

    result = sysid.ParameterDict()
    for name, modifier in zip(PARAMETERS, (set_friction, set_gain, set_gravity)):
        result.add(sysid.Parameter(name, 1.0, LOW, HIGH, modifier=modifier))
    return result


def read(path):
    with h5py.File(ROOT / path, "r") as file:
        return {name: np.asarray(file[name][()], dtype=np.float64)
                for name in ("observations", "next_observations", "actions", "terminals", "timeouts")}


def windows(arrays, n_steps, clip, seed):
    """Rows at which windows begin, within episodes, in random order, N_WINDOWS at most; observed states only."""
    ends = np.flatnonzero((arrays["terminals"].ravel() > 0) | (arrays["timeouts"].ravel() > 0)) + 1
    begins, begin = [], 0
    n_velocities = (arrays["observations"].shape[1] + 1) // 2
    for end in [*ends, len(arrays["actions"])]:
        begins += list(range(begin, end - n_steps + 1, n_steps))
        begin = end
    begins = [b for b in begins if np.abs(arrays["observations"][b, -n_velocities:]).max() < clip]
    random.Random(seed).shuffle(begins)
    return begins[:N_WINDOWS]


def sequences(task, arrays, begins, n_steps, held):
    spec = model_spec(task)
    model = spec.compile()
    frame_skip = MODELS[task][1]
    period = model.opt.timestep * frame_skip
    initial, control, sensors = [], [], []
    sensor_map = sysid.TimeSeries.compute_all_sensor_mapping(model)
    control_map = sysid.TimeSeries.compute_all_control_mapping(model)
    for b in begins:
        shown = np.vstack([arrays["observations"][b:b + 1], arrays["next_observations"][b:b + n_steps]])
        qpos = np.hstack([np.zeros((n_steps + 1, 1)), shown[:, :model.nq - 1]])
        qvel = shown[:, model.nq - 1:]
        initial.append(sysid.create_initial_state(model, qpos[0], qvel[0], np.zeros(model.na)))
        # The last control is dropped by sysid: one more row than there are steps.
        actions = np.vstack([arrays["actions"][b:b + n_steps], arrays["actions"][b + n_steps - 1:b + n_steps]])
        if held:
            rows = np.minimum(np.arange(n_steps * frame_skip + 1) // frame_skip, n_steps)
            control.append(sysid.TimeSeries(np.arange(len(rows)) * model.opt.timestep, actions[rows], control_map))
        else:
            control.append(sysid.TimeSeries(np.arange(n_steps + 1) * period, actions, control_map))
        sensors.append(sysid.TimeSeries(np.arange(n_steps + 1) * period, shown, sensor_map))
    return sysid.ModelSequences("logs", spec, [f"w{b}" for b in begins], initial, control, sensors), model


def residual_function(task, arrays, begins, n_steps, informed):
    group, model = sequences(task, arrays, begins, n_steps, held=informed)
    options = {"models_sequences": [group], "n_threads": 1}
    if informed:
        frame_skip, clip = MODELS[task][1:]
        scale = np.maximum(arrays["observations"].std(axis=0), 1e-3)

        def compare_states(params, predicted, measured, model, return_pred_all, state=None):
            rows = state[-n_steps * frame_skip:][frame_skip - 1::frame_skip, 1:1 + model.nq + model.nv]
            shown = np.hstack([rows[:, 1:model.nq], np.clip(rows[:, model.nq:], -clip, clip)])
            return (measured.data[1:] - shown) / scale, predicted, measured
        options |= {"modify_residual": compare_states, "resample_true": False}
    return sysid.build_residual_fn(**options)


def run(cell, oted):
    way = cell["form"].removeprefix("sysid-")
    n_steps, informed = WAYS[way], way == "informed"
    with tempfile.TemporaryDirectory() as folder:
        arrays = read(logs(cell["task"], cell["target"], cell["data"], oted, folder))
    begins = windows(arrays, n_steps, MODELS[cell["task"]][2], 1)
    start, cpu = time.monotonic(), time.process_time()
    residual = residual_function(cell["task"], arrays, begins, n_steps, informed)
    generator, best = random.Random(1), None
    starts = []
    for k in range(N_STARTS):
        initial = parameters(model_spec(cell["task"]))
        if k > 0:
            initial.update_from_vector(np.array([generator.uniform(LOW, HIGH) for _ in PARAMETERS]))
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # its optimiser's own verbose flag cannot be reached
                _, result = sysid.optimize(initial, residual, verbose=False, max_iters=30)
        except Exception as error:  # a start at which the physics breaks down ends it; the others go on
            starts.append({"error": f"{type(error).__name__}: {error}"[:200]})
            continue
        final = np.concatenate(residual(result.x, initial)[0])
        cost = float(np.sum(final**2))
        starts.append({"cost": cost, "x": [float(v) for v in result.x]})
        if np.isfinite(cost) and (best is None or cost < best[0]):
            best = (cost, result, residual(result.x, initial)[0])
    seconds, cpu = time.monotonic() - start, time.process_time() - cpu
    true = truth(cell["task"], cell["target"])
    record = dict(cell, truth=true, starts=starts, seconds=seconds, cpu_seconds=cpu, n_windows=len(begins), window=n_steps,
                  command=f"benchmarks/rival_sysid.py --only {name_of(cell)}", commit=commit())
    if best is not None:
        half_width = sysid.calculate_intervals(best[2], best[1].jac, alpha=0.1)[1]
        errors = [abs(float(x) - value) for x, value in zip(best[1].x, true)]
        record |= {"x": [float(v) for v in best[1].x], "half_width_90": [float(v) for v in half_width], "errors": errors,
                   "mean_error": statistics.mean(errors)}
    return record


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", default=ROOT / "build/release/oted", type=pathlib.Path, help="writes the noisy data")
    parser.add_argument("--out", default=ROOT / "benchmarks/results/rival_sysid.jsonl", type=pathlib.Path)
    parser.add_argument("--only", default="", help="cells whose name contains this")
    parser.add_argument("--table", action="store_true", help="print the table of what is there; run nothing")
    arguments = parser.parse_args()
    if not arguments.table:
        oted = arguments.oted.resolve()
        for name, record in run_missing(cells(), arguments.out, arguments.only, lambda cell: run(cell, oted)):
            print(f"{name}: {record.get('mean_error')}", flush=True)
    print("| task | target | data | method | friction | gain | gravity | mean error | 90 % half-widths | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for r in records_of(cells(), arguments.out):
        found = "mean_error" in r
        print(f"| {TASKS[r['task']]} | {r['target']} | {r['data']} | {r['form']} | "
              + (" | ".join(number(e) for e in r["errors"]) if found else "- | - | -")
              + f" | **{number(r['mean_error']) if found else 'no result'}** | "
              + (" ".join(number(w) for w in r["half_width_90"]) if found else "-") + f" | {r['cpu_seconds']:.0f} |")


if __name__ == "__main__":
    main()
