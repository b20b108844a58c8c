"""oted evaluate --policy: a policy file on its own, ours or another program's, against Gymnasium and onnxruntime.

    test_evaluate.py PATH/TO/oted [TestClass.test_name ...]
"""

import hashlib
import json
import unittest

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

import program
from program import DATA_OR_MODEL, ROOT, USAGE, ProgramTest, oted

POLICIES = ROOT / "examples/policies"


def layers_of(policy):
    """(weight, bias) of each layer of a policy.npz."""
    widths = [len(policy["observation_mean"]), *policy["hidden"].astype(int), 2 * len(policy["action_low"])]
    at = 0
    for n_in, n_out in zip(widths, widths[1:]):
        weight = policy["parameters"][at:at + n_in * n_out].reshape(n_in, n_out)
        bias = policy["parameters"][at + n_in * n_out:at + (n_in + 1) * n_out]
        at += (n_in + 1) * n_out
        yield weight.astype(np.float32), bias.astype(np.float32)


def write_foreign(path, policy, last="Tanh"):
    """The mean action of a policy.npz as another program would export it: MatMul, Add, Relu, a fixed batch of one."""
    n_actions = len(policy["action_low"])
    nodes, constants, x = [], [], "obs"
    layers = list(layers_of(policy))
    for k, (weight, bias) in enumerate(layers):
        final = k + 1 == len(layers)
        if final:
            weight, bias = weight[:, :n_actions], bias[:n_actions]
        constants += [numpy_helper.from_array(weight, f"w{k}"), numpy_helper.from_array(bias, f"b{k}")]
        nodes += [helper.make_node("MatMul", [x, f"w{k}"], [f"m{k}"]), helper.make_node("Add", [f"m{k}", f"b{k}"], [f"a{k}"]),
                  helper.make_node(last if final else "Relu", [f"a{k}"], ["out" if final else f"r{k}"])]
        x = f"r{k}"
    graph = helper.make_graph(
        nodes, "actor", [helper.make_tensor_value_info("obs", TensorProto.FLOAT, [1, layers[0][0].shape[0]])],
        [helper.make_tensor_value_info("out", TensorProto.FLOAT, [1, n_actions])], constants)
    onnx.save_model(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), path)


class TestEvaluate(ProgramTest):
    def evaluate(self, *words, task="HalfCheetah-v5"):
        result = oted("evaluate", "--task", task, "--episodes", "3", "--json", *words)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        return json.loads(result.stdout)

    def test_figures_are_those_of_the_episodes(self):
        path = POLICIES / "hopper/expert.npz"
        result = self.evaluate("--policy", path, task="Hopper-v5")
        returns = [e["return"] for e in result["episodes"]]
        self.assertEqual(len(returns), 3)
        self.assertAlmostEqual(result["mean_return"], np.mean(returns))
        self.assertAlmostEqual(result["std_return"], np.std(returns, ddof=1))
        self.assertEqual((result["min_return"], result["max_return"]), (min(returns), max(returns)))
        self.assertAlmostEqual(result["score"], 100 * (np.mean(returns) + 20.272305) / (3234.3 + 20.272305))
        self.assertAlmostEqual(result["mean_length"], np.mean([e["length"] for e in result["episodes"]]))
        self.assertEqual(result["n_diverged"], 0)
        self.assertEqual(result["schema"], "oted.policy_evaluation/1")
        self.assertEqual(result["policy_sha256"], hashlib.sha256(path.read_bytes()).hexdigest())
        self.assertGreater(result["mean_return"], 1000, "an expert")

    def test_another_programs_export_does_as_the_policy(self):
        path = POLICIES / "hopper/medium.npz"
        write_foreign(self.folder / "actor.onnx", np.load(path))
        ours = self.evaluate("--policy", path, task="Hopper-v5")
        theirs = self.evaluate("--policy", self.folder / "actor.onnx", task="Hopper-v5")
        self.assertAlmostEqual(ours["mean_return"], theirs["mean_return"], delta=0.02 * abs(ours["mean_return"]))
        self.assertNotEqual(ours["mean_return"], 0)

    def test_the_hash_of_a_policy_is_also_of_its_weights_in_another_file(self):
        path = self.folder / "actor.onnx"
        hashes, models = [], []
        for name in ("medium", "expert"):
            write_foreign(path, np.load(POLICIES / f"hopper/{name}.npz"))
            weights = self.folder / "actor.data"
            weights.unlink(missing_ok=True)
            onnx.save_model(onnx.load(path), path, save_as_external_data=True, location=weights.name, size_threshold=0)
            models.append(path.read_bytes())
            printed = "".join(f"{hashlib.sha256(p.read_bytes()).hexdigest()}  {p.name}\n" for p in (path, weights))
            hashes.append(self.evaluate("--policy", path, task="Hopper-v5")["policy_sha256"])
            self.assertEqual(hashes[-1], hashlib.sha256(printed.encode()).hexdigest())
        self.assertEqual(models[0], models[1], "the weights alone tell the policies apart")
        self.assertNotEqual(hashes[0], hashes[1])

    def test_seed_threads_and_parameters(self):
        words = ("--policy", POLICIES / "hopper/medium.npz")
        run = lambda *more: self.evaluate(*words, *more, task="Hopper-v5")["episodes"]
        self.assertEqual(run("--threads", "1"), run("--threads", "2"))
        self.assertNotEqual(run("--seed", "1"), run("--seed", "2"))
        gravity = ("--param", "gravity=opt/gravity[2]:0.2:2.0")
        self.assertEqual(run(), run(*gravity))
        self.assertNotEqual(run(), run(*gravity, "--truth", "gravity=1.3"))
        self.assertOneLine(oted("evaluate", "--task", "Hopper-v5", *words, *gravity, "--truth", "gravity=3"), USAGE, "'gravity'")
        self.assertOneLine(oted("evaluate", "--task", "Hopper-v5", *words, "--truth", "gravity=1"), USAGE, "gravity", "--param")

    def test_text(self):
        result = oted("evaluate", "--task", "Hopper-v2", "--policy", POLICIES / "hopper/expert.npz", "--episodes", "2")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        for word in ("Hopper-v2, 2 episodes", "return", "score", "control steps", "0 diverged"):
            self.assertIn(word, result.stdout)

    def test_refusals(self):
        policy = POLICIES / "hopper/expert.npz"
        self.assertOneLine(oted("evaluate", "--policy", policy), USAGE, "--task")
        self.assertOneLine(oted("evaluate", "--task", "Walker2d-v5", "--policy", policy), DATA_OR_MODEL, "11", "17")
        self.assertOneLine(oted("evaluate", "--task", "Hopper-v5", "--policy", "no.onnx"), DATA_OR_MODEL, "no.onnx")
        self.assertOneLine(oted("evaluate", "--task", "Hopper-v5", "--policy", "p.zip"), DATA_OR_MODEL, ".npz or .onnx")
        for text in ("0", "all", "-1", "2.5"):
            self.assertOneLine(oted("evaluate", "--task", "Hopper-v5", "--policy", policy, f"--episodes={text}"), USAGE, text)
        write_foreign(self.folder / "odd.onnx", np.load(policy), last="Sin")
        self.assertOneLine(oted("evaluate", "--task", "Hopper-v5", "--policy", self.folder / "odd.onnx"), DATA_OR_MODEL,
                           "odd.onnx", "'Sin'", "Tanh")
        broken = dict(np.load(policy))
        broken["parameters"] = np.full_like(broken["parameters"], 3e38)
        write_foreign(self.folder / "nan.onnx", broken, last="Identity")
        self.assertOneLine(oted("evaluate", "--task", "Hopper-v5", "--policy", self.folder / "nan.onnx"), DATA_OR_MODEL,
                           "nan.onnx", "not finite")


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
