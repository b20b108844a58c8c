"""One rollout of any model by MuJoCo's own Python bindings, for a comparison with our simulator of a task file.

usage: model_rollouts.py MODEL N_SUBSTEPS STATE.npz OUT.npz EXPRESSION...

STATE.npz holds `state` (an integration state) and `actions` (steps, nu). Each EXPRESSION is Python over `m` (mjModel), `d`
(mjData), `a` (the action, None at the start) and rate(key, value), which divides the change since its last call by
the control period; it gives a number or an array. The values are taken after mj_forward, at the start and after
every action: OUT.npz has `values` (steps + 1, total length). A model ending in .mjb is a compiled one.
"""

import sys

import mujoco
import numpy as np

model_path, substeps, state_path, out_path, *expressions = sys.argv[1:]
mujoco.set_mju_user_warning(lambda text: None)
compiled = model_path.endswith(".mjb")
m = mujoco.MjModel.from_binary_path(model_path) if compiled else mujoco.MjModel.from_xml_path(model_path)
d = mujoco.MjData(m)
given = np.load(state_path)
mujoco.mj_setState(m, d, given["state"], mujoco.mjtState.mjSTATE_INTEGRATION)
kept = {}


def rate(key, value):
    change = value - kept.get(key, value)
    kept[key] = float(value)
    return change / (int(substeps) * m.opt.timestep)


def measure(a):
    mujoco.mj_forward(m, d)
    names = {"np": np, "mujoco": mujoco, "m": m, "d": d, "a": a, "rate": rate}
    return np.concatenate([np.atleast_1d(eval(expression, names)).copy() for expression in expressions])


rows = [measure(None)]
for action in given["actions"]:
    d.ctrl[:] = action
    for _ in range(int(substeps)):
        mujoco.mj_step(m, d)
    rows.append(measure(action))
np.savez(out_path, values=np.array(rows, dtype=float))
