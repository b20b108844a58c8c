"""What the paper compares with: baselines beside the agents of a run, and oted reproduce table1.

    test_baselines.py PATH/TO/oted [TestClass.test_name ...]
"""

import json
import pathlib
import shutil
import unittest

import program

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
GAIN = "gain=actuator/*/gainprm[0]:0.2:2.0"
ALL = "baselines.run=dr,is,bc_dr,f_brc,mbop,td3_bc,rebrac"


class BaselinesTest(program.HopperTest):
    def run_hopper(self, verb, *more, data=None):
        return program.oted(verb, "--task", "Hopper-v5", "--data", data or self.demos, "--param", GAIN, "--out", self.out,
                        "--threads", "2", "--quiet", *program.sets(program.TINY + program.TINY_OFFLINE), *more)

    def test_a_run_shows_them_in_table_evaluation_and_report(self):
        result = self.run_hopper("run", "--truth", "gain=1.2", "--set", ALL)
        self.assertIn(result.returncode, (0, program.NO_SIMULATOR), result.stderr)
        for words in ("clone of logs and data under DR (BC+DR)", "SAC, domain randomisation (DR)", "SAC, interval search (IS)"):
            self.assertIn(words, result.stdout)
        names = [p["name"] for p in json.loads((self.out / "evaluation.json").read_text())["policies"]]
        self.assertEqual(names, ["random", "clone", "f_brc", "mbop", "td3_bc", "rebrac", "bc_dr", "sac_dr", "sac_is", "sac_nominal", "oted_sac"])
        page = (self.out / "report.html").read_text()
        self.assertIn("agent 1, domain randomisation", page)
        self.assertIn("SAC, interval search (IS)", page)
        for name in ("dr/1", "is/1", "bc_dr"):
            for file in ("policy.npz", "policy.onnx", "curves.csv"):
                self.assertTrue((self.out / "baselines" / name / file).is_file(), (name, file))
        self.assertIn("interval/low/gain", (self.out / "baselines/is/1/curves.csv").read_text())
        self.assertIn("F-BRC learned from the logs", page)
        for name in ("f_brc", "mbop", "td3_bc", "rebrac"):
            self.assertEqual((self.out / "baselines" / name / "policy.onnx").is_file(), name != "mbop", name)
        self.assertIn("train/dynamics_loss", (self.out / "baselines/mbop/curves.csv").read_text())
        # A planner's file, and another, on their own.
        result = program.oted("evaluate", "--policy", self.out / "baselines/mbop/policy.npz", "--task", "Hopper-v5",
                          "--episodes", "2")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        result = program.oted("evaluate", "--policy", self.out / "baselines/bc_dr/policy.onnx", "--task", "Hopper-v5",
                          "--episodes", "2")
        self.assertEqual((result.returncode, result.stderr), (0, ""))

    def test_without_a_truth_they_are_trained_all_the_same(self):
        result = self.run_hopper("train", "--set", "baselines.run=is")
        self.assertIn(result.returncode, (0, program.NO_SIMULATOR), result.stderr)
        self.assertTrue((self.out / "baselines/is/1/policy.onnx").is_file())
        self.assertFalse((self.out / "baselines/dr").exists())
        self.assertFalse((self.out / "evaluation.json").exists())

    def test_they_take_discrete_actions_and_images(self):
        config = self.folder / "grid.toml"
        config.write_text("\n".join([
            "[task]", 'name = "MiniGrid-Obstacles-10x10"', "[data]", f'path = "{ROOT}/examples/data/minigrid-expert.hdf5"',
            "[parameters]", 'density = { field = "env/density", range = [0.0, 0.6], scale = "absolute" }',
            "[truth]", "density = 0.26", "[selection]", "n_seeds = 1", "n_sims = 2", "judge_steps = 4",
            "[clone]", "max_steps = 40", "check_interval = 20", "[design.images]", "n_iterations = 2",
            "n_sims = 8", "[design.adversarial]", "n_sims = 8", "[design.discriminator]", "steps = 4", "[agents]", "n_agents = 1", "selection_episodes = 2", "target_episodes = 4",
            "[ppo]", "n_steps = 2048", "eval_interval = 2048", "hidden = [8]", "filters = [4]", "n_epochs = 1",
            "batch_size = 256", "eval_episodes = 4", "[baselines]", 'run = ["dr", "is", "bc_dr"]', "is_reference = 0.9"]))
        result = program.oted("run", config, "--out", self.out, "--quiet")
        self.assertIn(result.returncode, (0, program.NO_SIMULATOR), result.stderr)
        names = [p["name"] for p in json.loads((self.out / "evaluation.json").read_text())["policies"]]
        self.assertEqual(names, ["random", "clone", "bc_dr", "ppo_dr", "ppo_is", "ppo_nominal", "oted_ppo", "expert"])
        shutil.rmtree(self.out)
        config.write_text(config.read_text().replace('"bc_dr"]', '"bc_dr", "td3_bc"]'))
        self.assertRefused(program.oted("run", config, "--out", self.out, "--quiet"), program.USAGE, "td3_bc", "discrete actions")
        config.write_text(config.read_text().replace("is_reference", "is_step").replace(', "td3_bc"', ""))
        self.assertRefused(program.oted("run", config, "--out", self.out, "--quiet"), program.USAGE, "baselines.is_reference")

    def test_wrong_requests_are_refused_before_anything_is_written(self):
        for setting, named in (("baselines.run=domain", "dr, is, bc_dr, f_brc, mbop, td3_bc, rebrac"),
                               ("baselines.run=mbpo", "did you mean 'mbop'"), ("mbop.horizon=0", "[1, 1000]"), ("baselines.run=dr,dr", "twice"),
                               ("baselines.run=bcdr", "did you mean 'bc_dr'"),
                               ("agents.nominal_at=1,1", "got 2 parameter values, wanted 1"),
                               ("agents.nominal_at=3", "widen its range"), ("agents.train_in=mode", "modes")):
            self.assertRefused(self.run_hopper("run", "--set", setting), program.USAGE, named)
        self.assertRefused(self.run_hopper("run", "--set", "baselines.run=is", "--set", "baselines.is_shrink=0.3"), program.USAGE,
                           "is_shrink", "is_grow")


class Table1Test(program.HopperTest):
    def records(self):
        """By cell."""
        lines = self.out.with_name(f"{self.out.name}.jsonl").read_text().splitlines()
        return {record["cell"]: record for record in map(json.loads, lines)}

    def table1(self, *more, data=ROOT / "examples/data"):
        return program.oted("reproduce", "table1", "--task", "hopper", "--dataset", "medium", "--parameters", "gain",
                        "--steps", "200",
                        "--data", data, "--out", self.out, "--quiet", "--threads", "2",
                        *program.sets(program.TINY + program.TINY_OFFLINE), *more)

    def test_every_number_is_that_of_a_run_with_the_same_seed(self):
        result = self.table1("--seed", "3")
        self.assertEqual(result.returncode, 0, result.stderr)
        run = self.folder / "run"
        words = ("run", "--task", "Hopper-v5", "--data", ROOT / "examples/data/hopper-medium.hdf5", "--param", GAIN,
                 "--truth", "gain=1", "--seed", "3", "--out", run, "--quiet", "--set", ALL,
                 "--set", "agents.nominal_at=0.77")
        ran = program.oted(*words, *program.sets(program.TINY + program.TINY_OFFLINE))
        self.assertIn(ran.returncode, (0, program.NO_SIMULATOR), ran.stderr)
        of_run = {p["name"]: p for p in json.loads((run / "evaluation.json").read_text())["policies"]}
        records = self.records()
        for cell, name in (("hopper-medium-bc", "clone"), ("hopper-medium-f_brc", "f_brc"), ("hopper-medium-mbop", "mbop"),
                           ("hopper-medium-td3_bc", "td3_bc"), ("hopper-medium-rebrac", "rebrac"), ("hopper-gain-dr", "sac_dr"), ("hopper-gain-is", "sac_is"),
                           ("hopper-medium-gain-bc_dr", "bc_dr"), ("hopper-gain-nominal", "sac_nominal"),
                           ("hopper-medium-gain-oted", "oted_sac")):
            record = records[cell]
            self.assertEqual(record["schema"], "oted.table1_cell/1")
            self.assertIn("reproduce table1", record["command"])
            self.assertEqual(record["steps"], None if cell.count("-") == 2 and "medium" in cell else 200)
            (seed,) = record["seeds"]
            self.assertEqual(seed["seed"], 3)
            self.assertGreaterEqual(seed["seconds"], 0)
            for key in ("mean_return", "std_return", "score"):
                self.assertEqual(seed[key], of_run[name][key], (cell, key))
        score = {name: f"{p['score']:.1f}" for name, p in of_run.items()}
        self.assertIn(f"| hopper-medium | gain | {score['clone']} | 29.0 | {score['f_brc']} | 99.4 | {score['mbop']} | 48.8 | "
                      f"{score['td3_bc']} | 60.4 (3.5) | {score['rebrac']} | 102.3 (0.2) | {score['sac_dr']} | 73.9 | {score['sac_is']} | 20.9 | "
                      f"{score['bc_dr']} | 30.0 (0.1) | {score['oted_sac']} | 94.2 (8.6) | {score['sac_nominal']} |",
                      result.stdout)
        self.assertTrue((self.out / "runs/hopper-medium-gain-oted/3/report.html").is_file())
        self.assertTrue((self.out / "runs/hopper-gain-dr/3/agents/1/curves.csv").is_file())
        # What is finished is not run again, and another seed is added to it.
        before = program.files_below(self.folder)
        again = self.table1("--seed", "3")
        self.assertEqual((again.returncode, again.stdout), (0, result.stdout), again.stderr)
        self.assertEqual(program.files_below(self.folder), before)
        more = self.table1("--seed", "3", "--seeds", "2", "--methods", "bc")
        self.assertEqual(more.returncode, 0, more.stderr)
        record = self.records()["hopper-medium-bc"]
        self.assertEqual([seed["seed"] for seed in record["seeds"]], [3, 4])
        self.assertEqual(record["seeds"][0], records["hopper-medium-bc"]["seeds"][0])
        self.assertIn("; 2) | 29.0 |", more.stdout)
        self.assertOneLine(self.table1("--methods", "bc", "--set", "clone.max_steps=50"), program.USAGE, "assignments",
                           "another --out")

    def test_wrong_requests_are_one_line(self):
        for words, code, named in ((("--methods", "cql"), program.USAGE, "bc|f_brc|mbop|td3_bc|rebrac|dr|is|bc_dr|oted|nominal"),
                                   (("--guess", "mass=2"), program.USAGE, "friction="),
                                   (("--guess", "gain=4"), program.USAGE, "gain")):
            self.assertRefused(self.table1(*words), code, named)
        self.assertRefused(self.table1("--methods", "bc", data=self.folder), program.DATA_OR_MODEL, "hopper-medium.hdf5")


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
