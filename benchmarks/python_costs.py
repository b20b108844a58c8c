"""What logs and environments cost that go through Python: python benchmarks/python_costs.py [FOLDER], which holds the
package oted where it is not installed. Needs mcap and mcap-protobuf-support."""

import json
import pathlib
import sys
import tempfile
import time

if len(sys.argv) > 1:
    sys.path.insert(0, str(pathlib.Path(sys.argv.pop(1)).resolve()))

import gymnasium
import numpy as np
from google.protobuf import struct_pb2
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema

import oted

N_MESSAGES, N_STEPS = 20_000, 20_000


def seconds(call):
    """Of this process, the best of three: what else the machine does can only add to it."""
    best = np.inf
    for _ in range(3):
        begun = time.process_time()
        call()
        best = min(best, time.process_time() - begun)
    return best


def write(path, encoding):
    """Seven joints at 500 Hz."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = register_schema(writer, struct_pb2.ListValue) if encoding == "protobuf" else 0
        channel = writer.register_channel("/joints", encoding, schema)
        for k in range(N_MESSAGES):
            values = [0.001 * k + i for i in range(7)]
            data = (json.dumps({"position": values}).encode() if encoding == "json" else struct_pb2.ListValue(
                values=[struct_pb2.Value(number_value=v) for v in values]).SerializeToString())
            writer.add_message(channel, 2_000_000 * k, data, 2_000_000 * k)
        writer.finish()


def rollout(env):
    def run():
        env.reset(seed=1)
        action = np.zeros(env.action_space.shape, env.action_space.dtype)
        for _ in range(N_STEPS):
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
    return run


with tempfile.TemporaryDirectory() as folder:
    for encoding, field in (("protobuf", "values.number_value"), ("json", "position")):
        path = pathlib.Path(folder) / f"{encoding}.mcap"
        write(path, encoding)
        text = f"/joints:{field}"
        taken = seconds(lambda: oted.bags.read_bag(path, states=[text], actions=[text], period=0.01))
        print(f"MCAP, {encoding}: {N_MESSAGES / taken:,.0f} messages of seven joints per CPU second")
for name in ("Pendulum-v1", "Hopper-v5"):
    def make(name=name):
        return gymnasium.make(name, disable_env_checker=True)
    wrapped = oted.GymSimulator(make, name=name, version="1")
    steps = {"Gymnasium itself": make(), "as the simulator": oted.make_env(wrapped)}
    if name == "Hopper-v5":
        steps["the built-in task"] = oted.make_env(name)
    print(f"{name}: " + ", ".join(f"{what} {N_STEPS / seconds(rollout(env)):,.0f}" for what, env in steps.items())
          + " steps per CPU second")
