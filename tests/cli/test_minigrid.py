"""Demonstrations, designs and agents in the grid worlds.

    test_minigrid.py PATH/TO/oted [TestMinigrid.test_name ...]
"""

import json
import shutil
import unittest

import gymnasium
import h5py
import minari
import numpy as np
import onnxruntime

import program
from program import USAGE, ProgramTest, oted


TASK = "MiniGrid-Obstacles-10x10"
DENSITY = "density=env/density:0:0.6:absolute"


class TestMinigrid(ProgramTest):
    def setUp(self):
        super().setUp()
        self.demos = self.folder / "demos.hdf5"

    def collect(self, *words):
        return oted("collect", "--task", TASK, "--param", DENSITY, "--out", self.demos, *words)

    def share_of_walls(self, truth):
        result = self.collect("--policy", "medium", "--episodes", "60", "--truth", f"density={truth}")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        with h5py.File(self.demos) as file:
            images = file["observations"][:, :147].reshape(-1, 7, 7, 3)
            self.assertEqual(file["observations"].shape[1], 148)
            self.assertEqual(set(np.unique(file["actions"])), {0, 1, 2})
            self.assertEqual(int(np.sum(file["terminals"])) + int(np.sum(file["timeouts"])), 60)
        # The cells straight ahead, as far as the room's first columns and rows lie there.
        return np.mean(images[:, 3, 3:6, 0] == 2)

    def test_demonstrations_show_the_density_that_was_asked_for(self):
        low, high = self.share_of_walls(0.05), self.share_of_walls(0.4)
        self.assertLess(low + 0.1, high)

    def test_minari_reads_images_directions_and_discrete_actions(self):
        """Minari is the oracle of its own format; what it reads is what the D4RL layout holds."""
        result = self.collect("--policy", "medium", "--episodes", "4")
        self.assertEqual(result.returncode, 0, result.stderr)
        folder = self.folder / "grid-medium-v0"
        result = oted("collect", "--task", TASK, "--param", DENSITY, "--policy", "medium", "--episodes", "4",
                           "--out", folder)
        self.assertEqual(result.returncode, 0, result.stderr)
        data = minari.MinariDataset(folder / "data")
        self.assertEqual(data.action_space, gymnasium.spaces.Discrete(3))
        self.assertEqual(data.observation_space["image"].shape, (7, 7, 3))
        self.assertEqual(data.observation_space["direction"], gymnasium.spaces.Discrete(4))
        flat = []
        for episode in data.iterate_episodes():
            image = np.asarray(episode.observations["image"])
            self.assertEqual(image.dtype, np.uint8)
            self.assertTrue(data.observation_space["image"].contains(image[0]))
            self.assertEqual(len(image), len(episode.actions) + 1)
            flat.append(np.column_stack([image[:-1].reshape(len(episode.actions), -1),
                                         episode.observations["direction"][:-1], episode.actions]))
        with h5py.File(self.demos) as logs:
            np.testing.assert_array_equal(np.concatenate(flat), np.column_stack([logs["observations"], logs["actions"]]))
        info = oted("data", "info", folder)
        self.assertEqual(info.returncode, 0, info.stderr)
        back = self.folder / "back.npz"
        self.assertEqual(oted("data", "convert", folder, back).returncode, 0)
        with h5py.File(self.demos) as logs:
            np.testing.assert_array_equal(np.load(back)["observations"], logs["observations"])

    def test_refusals(self):
        self.assertOneLine(self.collect("--policy", "exprt"), USAGE, "exprt", "did you mean 'expert'")
        self.assertOneLine(self.collect("--policy", "expert", "--truth", "density=0.7"), USAGE, "density", "0.6")
        self.assertFalse(self.demos.exists())
        out = self.folder / "out"
        self.assertOneLine(oted("behavior", "--task", TASK, "--out", out), USAGE, "oted collect")
        self.assertEqual(self.collect("--policy", "expert").returncode, 0)
        words = ("--task", TASK, "--param", DENSITY, "--data", self.demos, "--out", out)
        self.assertOneLine(oted("train", *words, "--set", "agents.algorithm=sac"), USAGE, "discrete actions", "ppo")
        self.assertFalse(out.exists())
        self.assertOneLine(oted("design", *words, "--set", "design.method=images", "--set", "design.adversarial.evidence=sas"),
                           USAGE, "images", "sa")

    def config(self, *lines):
        file = self.folder / "m.toml"
        file.write_text("\n".join([
            "[task]", f'name = "{TASK}"', "[data]", f'path = "{self.demos}"', "[parameters]",
            'density = { field = "env/density", range = [0.0, 0.6], scale = "absolute" }',
            "[truth]", "density = 0.4", "[selection]", "n_seeds = 2", "n_sims = 4", "judge_steps = 20",
            "[clone]", "max_steps = 200", "[design.images]", "n_iterations = 25", "n_sims = 64",
            "[design.adversarial]", "n_sims = 64", "[design.discriminator]", "steps = 20", "[design]", *lines, "[agents]", "selection_episodes = 4",
            "target_episodes = 50", "[ppo]", "n_steps = 12000", "eval_interval = 6000", "learning_rate = 0.001",
            "batch_size = 256", "n_epochs = 4", "hidden = [32]", "filters = [8, 8]"]))
        return file

    def run_small(self, *lines):
        result = self.collect("--policy", "expert", "--episodes", "30", "--truth", "density=0.4")
        self.assertEqual(result.returncode, 0, result.stderr)
        out = self.folder / "run"
        result = oted("run", self.config(*lines), "--out", out, "--quiet")
        self.assertEqual(result.returncode, 0, result.stderr)
        return out, result

    def test_a_run_designs_the_density_from_images_and_trains_agents_in_it(self):
        out, result = self.run_small()
        self.assertNotIn("constant_channels", result.stderr)
        evaluation = json.loads((out / "evaluation.json").read_text())
        returns = {p["name"]: p["mean_return"] for p in evaluation["policies"]}
        self.assertEqual(list(returns), ["random", "clone", "ppo_nominal", "oted_ppo", "expert"])
        self.assertEqual(returns["expert"], max(returns.values()))
        scores = {p["name"]: p["score"] for p in evaluation["policies"]}
        self.assertEqual((scores["random"], scores["expert"]), (0, 100))
        self.assertIn("OTED-PPO", result.stdout)
        self.agents_are_whole(out)
        design = json.loads((out / "design.json").read_text())
        # Far from the nominal 0.2, with settings so small.
        self.assertLess(abs(design["parameters"][0]["mode"] - 0.4), 0.12)
        self.assertTrue((out / "export" / "q.json").exists())
        self.assertFalse((out / "export" / "designed.xml").exists())
        page = (out / "report.html").read_text()
        self.assertEqual(page.count('<svg class="cells"'), 24, "eight of the logs and of either simulator")
        images = json.loads((out / "motion" / "replay.json").read_text())["images"]
        with h5py.File(self.demos) as logs:
            first = logs["observations"][0, :147:3].astype(int).tolist()
        self.assertEqual(images["logged"][0], first)
        share = {name: np.mean(np.array(images[name]) == 2) for name in ("nominal", "designed")}
        self.assertGreater(share["designed"], share["nominal"])

    def agents_are_whole(self, out):
        agent = json.loads((out / "agents" / "1" / "agent.json").read_text())
        self.assertEqual(agent["algorithm"], "ppo")
        curves = (out / "agents" / "1" / "curves.csv").read_text()
        for key in ("eval/mean_reward", "rollout/ep_rew_mean", "train/policy_gradient_loss", "train/value_loss"):
            self.assertIn(f",{key},", curves)
        selected = json.loads((out / "policy_selection.json").read_text())["selected"]
        self.assertEqual((out / "policy.onnx").read_bytes(), (out / "agents" / str(selected) / "policy.onnx").read_bytes())
        # One policy, two files: the same episodes, drawn or most probable.
        for how in ("sampled", "most_probable"):
            results = []
            for file in ("policy.npz", "policy.onnx"):
                result = oted("evaluate", "--policy", out / "agents" / "1" / file, "--task", TASK, "--episodes", "20",
                                   "--json", "--set", f"ppo.evaluate={how}")
                self.assertEqual((result.returncode, result.stderr), (0, ""))
                results.append(json.loads(result.stdout)["episodes"])
            self.assertEqual(results[0], results[1])
        # The graph holds the encoding: raw observations in, as onnxruntime runs it.
        session = onnxruntime.InferenceSession(out / "policy.onnx", providers=["CPUExecutionProvider"])
        with h5py.File(self.demos) as logs:
            action, logits = session.run(["action", "logits"], {"observation": logs["observations"][:50].astype(np.float32)})
        np.testing.assert_array_equal(action[:, 0], np.argmax(logits, axis=1))
        self.assertEqual(logits.shape, (50, 3))
        # What is missing is made again, byte for byte, at another number of threads.
        before = {name: (out / name).read_bytes() for name in ("agents/1/policy.npz", "policy_selection.json", "policy.onnx")}
        for folder in ("agents", "nominal"):
            shutil.rmtree(out / folder)
        for name in ("policy_selection.json", "policy.onnx"):
            (out / name).unlink()
        result = oted("select-policy", "--out", out, "--threads", "1", "--quiet")
        self.assertEqual(result.returncode, 0, result.stderr)
        for name, content in before.items():
            self.assertEqual((out / name).read_bytes(), content, name)

    def test_the_categorical_designer_answers_with_a_grid_value(self):
        out, _ = self.run_small('designer = "categorical"')
        q = json.loads((out / "design" / "default" / "1" / "q.json").read_text())
        self.assertEqual(q["kind"], "categorical")
        self.assertAlmostEqual(sum(q["probabilities"][0]), 1)
        self.assertAlmostEqual(q["mode"][0] / 0.05, round(q["mode"][0] / 0.05))
        self.assertLess(abs(q["mode"][0] - 0.4), 0.16)

    def test_grid_settings_are_of_grid_worlds_and_change_what_is_drawn(self):
        file = self.config("[grid]", 'obstacle = "lava"', 'observation = "grid"')
        result = oted("collect", "--task", file, "--policy", "expert", "--out", self.demos)
        self.assertEqual(result.returncode, 0, result.stderr)
        with h5py.File(self.demos) as logs:
            self.assertEqual(logs["observations"].shape[1], 301)
            self.assertIn(9, logs["observations"][:, :300:3], "lava")
        file.write_text('[task]\nname = "Hopper-v5"\n[grid]\nobstacle = "lava"\n')
        self.assertOneLine(oted("collect", "--task", file, "--policy", "random", "--out", self.demos), USAGE, "[grid]",
                           "Hopper-v5")


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
