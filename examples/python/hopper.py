"""From logs to a designed simulator in Python, in a minute: five Hopper demonstrations of a robot with half the friction,
weaker motors and more weight. Run it in the repository's root:

    python examples/python/hopper.py
"""

import numpy as np

import oted


def main() -> None:
    logs = oted.read_logs("examples/data/hopper-quickstart.hdf5", task="Hopper-v5")
    print(oted.check(logs, "Hopper-v5"))
    design = oted.fit("Hopper-v5", logs, {
        "friction": oted.Param("geom/*/friction[0]", 0.2, 2.0),
        "gain": oted.Param("actuator/*/gainprm[0]", 0.2, 2.0),
        "gravity": oted.Param("opt/gravity[2]", 0.2, 2.0),
    }, seeds=2)
    print(design)  # near friction 0.5, gain 0.7, gravity 1.3

    env = oted.make_vec_env(design, num_envs=4, sample="samples")
    env.reset(seed=0)
    total = np.zeros(4)
    for _ in range(100):
        _, rewards, _, _, _ = env.step(env.action_space.sample())
        total += rewards
    print("reward of 100 random steps in each of 4 designed simulators:", total.round(1))


if __name__ == "__main__":
    main()
