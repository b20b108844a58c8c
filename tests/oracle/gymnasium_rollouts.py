"""Rollouts of a Gymnasium MuJoCo task, for a comparison with our simulators.

usage: gymnasium_rollouts.py TASK OUT.npz [--scale friction=0.6 --scale gain=1.3 --scale gravity=1.2 --scale mass=1.5]
                             [--policy policy.npz] [--episodes 100]

Writes the integration state at every start, and after it the actions, observations, rewards and terminations:
  states (episodes, n_state), lengths (episodes,), actions (steps, nu), observations (steps, n_obs), rewards (steps,),
  terminals (steps,); of the model body_mass (nbody,), body_ipos, body_inertia (nbody, 3), body_iquat (nbody, 4)
The first episode has 1,000 steps and ignores termination; episodes that end as the task says follow. Actions are
random, or a trained policy's with noise: little in some episodes, which then last, and much in others, which do not.
"""

import argparse
import os
import tempfile

import gymnasium
import mujoco
import numpy as np

N_LONG_STEPS = 1000
NOISE = (0.02, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)  # standard deviations on a trained policy's actions, in turn over the episodes


def modify(model, name, z):
    """Multiplies one model parameter by z, as a Gymnasium user would."""
    if name == "friction":
        model.geom_friction[:, 0] *= z
    elif name == "gain":
        model.actuator_gainprm[:, 0] *= z
    elif name == "gravity":
        model.opt.gravity[2] *= z
    elif name == "mass":
        model.body_mass[1:] *= z
        mujoco.mj_setConst(model, mujoco.MjData(model))
    else:
        raise SystemExit(f"unknown parameter {name}")


def use_legacy_capsules(model):
    """Gymnasium's v4 model with the capsules of MuJoCo before 2.1.1: cylinders that are longer by r/2 at each end.

    Every body here is made of capsules of one density; their masses and inertia tensors add up about the body's origin.
    """
    total = mujoco.mj_getTotalmass(model)
    fixed_total = bool(np.isclose(total, 14))  # HalfCheetah's settotalmass
    for body in range(1, model.nbody):
        mass, first_moment, tensor = 0.0, np.zeros(3), np.zeros((3, 3))
        geoms = np.flatnonzero(model.geom_bodyid == body)
        for geom in geoms:
            assert model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE
            r, length = model.geom_size[geom, 0], 2 * model.geom_size[geom, 1] + model.geom_size[geom, 0]
            m = 1000 * np.pi * r**2 * length
            axes = np.zeros(9)
            mujoco.mju_quat2Mat(axes, model.geom_quat[geom])
            axes, at = axes.reshape(3, 3), model.geom_pos[geom]
            across = m * (r**2 / 4 + length**2 / 12)
            tensor += axes @ np.diag([across, across, m * r**2 / 2]) @ axes.T
            tensor += m * (at @ at * np.eye(3) - np.outer(at, at))
            mass += m
            first_moment += m * at
        centre = first_moment / mass
        tensor -= mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        model.body_mass[body], model.body_ipos[body] = mass, centre
        if len(geoms) == 1:
            model.body_inertia[body] = np.diag(axes.T @ tensor @ axes)
        else:
            moments, axes = np.linalg.eigh(tensor)
            axes[:, 2] *= np.linalg.det(axes)
            mujoco.mju_mat2Quat(model.body_iquat[body], axes.ravel())
            model.body_inertia[body] = moments
    if fixed_total:
        mujoco.mj_setTotalmass(model, 14)
    mujoco.mj_setConst(model, mujoco.MjData(model))


def load_policy(path):
    """The mean action of a policy.npz (docs/file_formats.md), as a function of the raw observation."""
    with np.load(path) as arrays:
        policy = dict(arrays)
    low, high = policy["action_low"], policy["action_high"]
    widths = [len(policy["observation_mean"]), *policy["hidden"].astype(int), 2 * len(low)]
    parameters, layers = policy["parameters"].astype(float), []
    for n_in, n_out in zip(widths, widths[1:]):
        weight, bias, parameters = np.split(parameters, [n_in * n_out, (n_in + 1) * n_out])
        layers.append((weight.reshape(n_in, n_out), bias))
    assert parameters.size == 0, "the file holds more parameters than its layers have"

    def act(observation):
        x = (observation - policy["observation_mean"]) / policy["observation_scale"]
        for weight, bias in layers[:-1]:
            x = np.maximum(x @ weight + bias, 0)
        weight, bias = layers[-1]
        return (low + high) / 2 + (high - low) / 2 * np.tanh((x @ weight + bias)[: len(low)])

    return act


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("task")
    parser.add_argument("out")
    parser.add_argument("--scale", action="append", default=[])
    parser.add_argument("--policy")
    parser.add_argument("--episodes", type=int, default=100)
    args = parser.parse_args()

    # Gymnasium has no v2: it is v4 with lighter capsules.
    env = gymnasium.make(args.task.replace("-v2", "-v4"))
    base = env.unwrapped
    if args.task.endswith("-v2"):
        use_legacy_capsules(base.model)
    for assignment in args.scale:
        name, z = assignment.split("=")
        modify(base.model, name, float(z))
    n_state = mujoco.mj_stateSize(base.model, mujoco.mjtState.mjSTATE_INTEGRATION)
    rng = np.random.default_rng(1)
    policy = load_policy(args.policy) if args.policy else None
    states, lengths, actions, observations, rewards, terminals = [], [], [], [], [], []

    def choose(observation, noise):
        # Some actions beyond +-1: the physics clamps them, the control cost does not.
        if policy is None:
            return rng.uniform(-1.2, 1.2, base.model.nu)
        return policy(observation) + noise * rng.standard_normal(base.model.nu)

    def rollout(step, observation, n_steps, stop, noise):
        state = np.empty(n_state)
        mujoco.mj_getState(base.model, base.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        states.append(state)
        length = 0
        for length in range(1, n_steps + 1):
            action = choose(observation, noise)
            observation, reward, terminated, truncated, _ = step(action)
            actions.append(action)
            observations.append(observation)
            rewards.append(reward)
            terminals.append(float(terminated))
            if stop and (terminated or truncated):
                break
        lengths.append(float(length))

    observation, _ = base.reset(seed=1)
    rollout(base.step, observation, N_LONG_STEPS, stop=False, noise=NOISE[0])
    for episode in range(args.episodes):
        observation, _ = env.reset(seed=100 + episode)
        # HalfCheetah never ends: a tenth of an episode each is enough, with one whole one for the truncation.
        whole = episode == 0 or not args.task.startswith("HalfCheetah")
        rollout(env.step, observation, N_LONG_STEPS if whole else N_LONG_STEPS // 10, stop=True,
                noise=NOISE[episode % len(NOISE)])

    model = base.model
    np.savez(args.out, states=states, lengths=lengths, actions=actions, observations=observations, rewards=rewards,
             terminals=terminals, body_mass=model.body_mass, body_ipos=model.body_ipos, body_iquat=model.body_iquat,
             body_inertia=model.body_inertia)


if __name__ == "__main__":
    # The mujoco package writes warnings at load time into a log file in the working directory.
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        main()
        os.chdir("/")
