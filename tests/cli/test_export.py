"""The results of a design in other tools' formats: MJCF, q(z) as JSON, mujoco.sysid's parameter files.

    test_export.py PATH/TO/oted [TestClass.test_name ...]
"""

import copy
import json
import os
import pathlib
import shutil
import subprocess
import unittest

import gymnasium
import jsonschema
import mujoco
import numpy as np
import program
from mujoco.sysid._src.parameter import ParameterDict

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
ASSETS = pathlib.Path(gymnasium.__file__).parent / "envs/mujoco/assets"
AIR = "air=opt/density:0:2:absolute"  # [kg/m^3], 0 in the model
PARAMETERS = [word for text in (program.FRICTION, program.GRAVITY, AIR) for word in ("--param", text)]
SETTINGS = program.sets([s for s in program.TINY if "n_seeds" not in s] + ["selection.n_seeds=3"])


def schema(name):
    return json.loads((ROOT / "docs/schemas" / name).read_text())


def write_run(folder, *words):
    return program.oted("design", "--task", "Hopper-v5", "--threads", "1", *SETTINGS, "--out", folder, *words)


class ExportTest(program.HopperTest):
    """One small design, made once; each test may export from it, and changes copies only."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.designed = cls.shared / "designed"
        cls.printed = write_run(cls.designed, "--data", cls.demos, *PARAMETERS)
        assert cls.printed.returncode in (0, program.NO_SIMULATOR), cls.printed.stderr
        cls.design = json.loads((cls.designed / "design.json").read_text())
        cls.modes = {member["seed"]: member["mode"] for member in cls.design["mixture"]}
        best = [parameter["mode"] for parameter in cls.design["parameters"]]
        cls.best = next(seed for seed, mode in cls.modes.items() if mode == best)

    def export(self, *words):
        result = program.oted("export", self.designed, *words)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        return result.stdout

    def copy_of_the_run(self):
        """Beside the run: its run.toml names the data relative to itself."""
        return pathlib.Path(shutil.copytree(self.designed, self.shared / f"copy-{self.folder.name}"))


class TestModel(ExportTest):
    def assertHasValues(self, path, mode):
        """The file's model is Gymnasium's with friction and gravity multiplied and the air's density set, by hand."""
        got, wanted = mujoco.MjModel.from_xml_path(str(path)), mujoco.MjModel.from_xml_path(str(ASSETS / "hopper.xml"))
        wanted.geom_friction[:, 0] *= mode[0]
        wanted.opt.gravity[2] *= mode[1]
        wanted.opt.density = mode[2]
        np.testing.assert_allclose(got.geom_friction, wanted.geom_friction, rtol=1e-12)
        np.testing.assert_allclose(got.opt.gravity, wanted.opt.gravity, rtol=1e-12)
        np.testing.assert_allclose(got.opt.density, wanted.opt.density, rtol=1e-12)
        np.testing.assert_allclose(got.body_mass, wanted.body_mass, rtol=1e-12)
        np.testing.assert_array_equal(got.actuator_gainprm, wanted.actuator_gainprm)
        return wanted

    def test_python_loads_the_best_seeds_mode(self):
        path = self.folder / "here/model.xml"
        self.assertEqual(self.export("--mjcf", path), f"designed model, seed {self.best}: {path}\n")
        self.assertHasValues(path, self.modes[self.best])
        self.assertFalse((self.folder / "here/q.json").exists(), "nothing else was asked for")

    def test_gymnasium_takes_the_file(self):
        path = self.folder / "model.xml"
        self.export("--mjcf", path)
        env = gymnasium.make("Hopper-v5", xml_file=str(path))
        env.reset(seed=1)
        observation, *_ = env.step(np.zeros(3))
        self.assertTrue(np.all(np.isfinite(observation)))
        env.close()

    def test_each_member(self):
        self.export("--mjcf", self.folder / "model.xml", "--member", "all")
        self.assertEqual({p.name for p in self.folder.iterdir()}, {f"model-{seed}.xml" for seed in (1, 2, 3)})
        for seed, mode in self.modes.items():
            self.assertHasValues(self.folder / f"model-{seed}.xml", mode)
        self.export("--mjcf", self.folder / "two.xml", "--member", "2")
        self.assertEqual((self.folder / "two.xml").read_bytes(), (self.folder / "model-2.xml").read_bytes())

    def test_its_comment_says_what_made_it(self):
        text = (self.designed / "export/designed.xml").read_text()
        comment = text[text.index("<!--"):text.index("-->")]
        for needle in ("Hopper-v5", self.design["fingerprint"], f"design seed {self.best} of 3", "run.seed 1",
                       "demos.hdf5", self.design["verdict"]):
            self.assertIn(needle, comment)
        for p in self.design["parameters"]:
            low, high = p["interval90"]
            line = next(line for line in comment.splitlines() if line.startswith(f"  {p['name']} = "))
            for needle in (f"{p['mode']:.6g}", f"[{low:.4g}, {high:.4g}]", p["verdict"], p["field"]):
                self.assertIn(needle, line)
        self.assertNotIn(str(self.shared), text, "no path of this machine where the model names no asset")

    def test_refusals(self):
        nothing = program.oted("export", self.folder)
        self.assertOneLine(nothing, program.USAGE, "design.json", "oted design")
        unknown = program.oted("export", self.designed, "--mjcf", self.folder / "m.xml", "--member", "7")
        self.assertOneLine(unknown, program.USAGE, "'7'", "best, all", "1, 2, 3")
        self.assertOneLine(program.oted("export", self.designed, "--q", self.folder / "q.json", "--member", "2"), program.USAGE,
                           "--mjcf")
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_neither_the_run_nor_what_it_was_made_from_is_overwritten(self):
        (self.designed / "report.html").touch()
        files = [self.designed / "design.json", self.designed / "design/default/1/q.json", self.designed / "report.html",
                 self.demos]
        before = [path.read_bytes() for path in files]
        link = self.folder / "link.json"
        link.symlink_to(self.designed / "design.json")
        for path in [*files, link]:
            for flag in ("--q", "--mjcf", "--sysid"):
                self.assertOneLine(program.oted("export", self.designed, flag, path), program.USAGE, path.name, "name another file")
        self.assertEqual([path.read_bytes() for path in files], before)

    def test_two_products_need_two_files_and_streams_are_none(self):
        one = self.folder / "one"
        for more in (["--q", f"{self.folder}/./one"], ["--sysid", one]):
            self.assertOneLine(program.oted("export", self.designed, "--mjcf", one, *more), program.USAGE, "two exports")
        self.assertOneLine(program.oted("export", self.designed, "--mjcf", self.folder / "m.xml", "--member", "all", "--q",
                                        self.folder / "m-2.xml"), program.USAGE, "two exports")
        stream = self.folder / "stream"
        stream.symlink_to("/proc/self/fd/1")
        with open(self.folder / "said", "w") as said:
            done = subprocess.run([program.OTED, "export", self.designed, "--q", stream], stdout=said, stderr=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, program.USAGE, done.stderr)
        self.assertTrue(stream.is_symlink())
        self.assertOneLine(program.oted("export", self.designed, "--q", self.designed / "q.json"), program.USAGE, "files of the run")
        self.assertOneLine(program.oted("export", self.designed, "--mjcf", ""), program.USAGE, "--mjcf names no file")
        self.assertOneLine(program.oted("export", self.designed, "--q", "-"), program.USAGE, "--q got '-', wanted a file")

    def test_a_link_leads_to_the_file_that_is_written(self):
        target, link = self.folder / "target.json", self.folder / "link"
        link.symlink_to(target)
        self.export("--q", link)
        self.assertTrue(link.is_symlink())
        self.assertEqual(json.loads(target.read_text())["kind"], "mixture")

    def test_a_model_that_changed_since_the_design_is_refused(self):
        (self.folder / "assets").mkdir()
        text = (ASSETS / "hopper.xml").read_text()
        self.assertIn('friction="2.0"', text)
        (self.folder / "assets/hopper.xml").write_text(text.replace('friction="2.0"', 'friction="1.9"'))
        result = subprocess.run([program.OTED, "export", self.designed, "--mjcf", self.folder / "m.xml"],
                                capture_output=True, text=True, env={**os.environ,
                                                                     "OTED_ASSETS": str(self.folder / "assets")})
        self.assertOneLine(result, program.DATA_OR_MODEL, "Hopper-v5", "SHA-256")
        self.assertFalse((self.folder / "m.xml").exists())

    def test_a_design_of_other_parameters_is_refused(self):
        run = self.copy_of_the_run()
        text = (run / "run.toml").read_text()
        program.write_run_toml(run / "run.toml", text.replace("opt/gravity[2]", "body/*/mass"))
        self.assertOneLine(program.oted("export", run), program.DATA_OR_MODEL, "design.json", "'gravity'")
        (run / "run.toml").write_text(text)
        (run / "design.json").write_text('{"schema": "oted.design/1"}')
        self.assertOneLine(program.oted("export", run), program.DATA_OR_MODEL, "design.json", "no seal")


class TestQ(ExportTest):
    def validator(self, name):
        jsonschema.Draft202012Validator.check_schema(schema(name))
        return jsonschema.Draft202012Validator(schema(name))

    def test_what_is_written_follows_the_published_schemas(self):
        q, design = self.validator("oted.q.1.schema.json"), self.validator("oted.design.1.schema.json")
        mixture = json.loads((self.designed / "export/q.json").read_text())
        self.assertEqual(mixture["kind"], "mixture")
        q.validate(mixture)
        singles = sorted(self.designed.glob("design/*/*/q.json"))
        self.assertEqual(len(singles), 3)
        for path in singles:
            q.validate(json.loads(path.read_text()))
        design.validate(self.design)

    def test_the_schemas_name_every_field_and_refuse_what_is_missing_or_of_another_type(self):
        for name, document in (("oted.q.1.schema.json", json.loads((self.designed / "export/q.json").read_text())),
                               ("oted.q.1.schema.json",
                                json.loads((self.designed / "design/default/1/q.json").read_text())),
                               ("oted.design.1.schema.json", self.design)):
            validator, definition = self.validator(name), schema(name)
            properties = definition.get("properties") or definition["$defs"][document["kind"]]["properties"]
            self.assertEqual(set(document) - set(properties), set(), name)
            for key in document:
                for broken in (None, {"neither": "nor"}):
                    changed = copy.deepcopy(document)
                    changed[key] = broken
                    self.assertFalse(validator.is_valid(changed), f"{name}: {key} = {broken}")
                required = (definition.get("required") if "properties" in definition else
                            definition["$defs"][document["kind"]]["required"])
                changed = {k: v for k, v in document.items() if k != key}
                self.assertEqual(validator.is_valid(changed), key not in required, f"{name} without {key}")

    def test_the_mixture_holds_each_seeds_q(self):
        mixture = json.loads((self.designed / "export/q.json").read_text())
        self.assertEqual(mixture["best_seed"], self.best)
        self.assertEqual(mixture["parameters"], ["friction", "gravity", "air"])
        self.assertEqual(mixture["fields"], ["geom/*/friction[0]", "opt/gravity[2]", "opt/density"])
        self.assertEqual(mixture["nominal"], [1, 1, 0])
        self.assertAlmostEqual(sum(c["weight"] for c in mixture["components"]), 1)
        low, high = np.array(mixture["bounds"]).T
        for component in mixture["components"]:
            self.assertEqual(component["mode"], self.modes[component["seed"]])
            # The documented transform, by NumPy: the mode is z at the mean of x.
            z = low + (high - low) / (1 + np.exp(-np.array(component["mean"])))
            np.testing.assert_allclose(z, component["mode"], rtol=1e-12)


class TestSysid(ExportTest):
    def read(self, path):
        return {p.name: p for p in ParameterDict.load_from_disk(path).values()}

    def test_mujoco_sysid_reads_names_bounds_nominal_and_designed_values(self):
        parameters = self.read(self.designed / "export/parameters.yaml")
        self.assertEqual(list(parameters), ["friction", "gravity", "air"])
        for p, mode in zip(self.design["parameters"], self.modes[self.best]):
            read = parameters[p["name"]]
            self.assertEqual([float(v[0]) for v in (read.value, read.nominal, read.min_value, read.max_value)],
                             [mode, p["nominal"], *p["bounds"]])
            self.assertIs(read.frozen, False)

    def test_a_file_that_was_exported_gives_the_same_design(self):
        result = write_run(self.out, "--data", self.demos, "--params", self.designed / "export/parameters.yaml")
        self.assertEqual(result.returncode, self.printed.returncode, result.stderr)
        self.assertEqual((self.out / "design.json").read_bytes(), (self.designed / "design.json").read_bytes())
        self.assertEqual(program.files_below(self.out / "export"), program.files_below(self.designed / "export"))

    def test_a_file_that_mujoco_sysid_saved_needs_its_fields_named(self):
        parameters = ParameterDict.load_from_disk(self.designed / "export/parameters.yaml")
        parameters["gravity"].min_value = np.array([0.5])
        path = self.folder / "saved.yaml"
        parameters.save_to_disk(path)
        self.assertRefused(write_run(self.out, "--data", self.demos, "--params", path), program.USAGE, "saved.yaml", "'air'",
                           "field = ")
        config = self.folder / "mine.toml"
        config.write_text(f'[data]\npath = "{self.demos}"\n[parameters]\nsysid = "saved.yaml"\n'
                          'air = { field = "opt/density", scale = "absolute" }\n'
                          'friction = { field = "geom/*/friction[0]", range = [0.4, 1.6] }\n'
                          'gravity = { field = "opt/gravity[2]" }\n')
        result = program.oted("clone", config, "--task", "Hopper-v5", "--out", self.out, *SETTINGS)
        self.assertEqual(result.returncode, 0, result.stderr)
        text = (self.out / "run.toml").read_text()
        ranges = {line.split(" = ")[0]: json.loads(line[line.index("range = ") + 8:line.index("]", line.index("range")) + 1])
                  for line in text.splitlines() if "range = " in line and "field = " in line}
        self.assertEqual(ranges, {"air": [0, 2], "friction": [0.4, 1.6], "gravity": [0.5, 2]})

    def test_a_file_of_another_model_is_refused(self):
        path = self.folder / "other.yaml"
        text = (self.designed / "export/parameters.yaml").read_text()
        self.assertIn("nominal: [0.0]", text)
        path.write_text(text.replace("nominal: [0.0]", "nominal: [1.2]"))
        self.assertRefused(write_run(self.out, "--data", self.demos, "--params", path), program.USAGE, "'air'", "1.2")

    def test_damaged_files(self):
        path = self.folder / "params.yaml"
        for text in ("", "friction", "friction: [1", "friction: {name: friction}", "\x00\x01\xff", "*: a", "&a [*a]"):
            path.write_bytes(text.encode("latin1"))
            self.assertRefused(write_run(self.out, "--data", self.demos, "--params", path), program.DATA_OR_MODEL,
                               "params.yaml")


class TestRun(ExportTest):
    def test_a_design_leaves_the_exports_and_names_the_model(self):
        self.assertEqual({p.name for p in (self.designed / "export").iterdir()},
                         {"designed.xml", "q.json", "parameters.yaml", "export.json"})
        self.assertIn(f"\ndesigned model: {self.designed / 'export/designed.xml'}\n", self.printed.stdout)

    def test_without_a_flag_all_three_are_written_again_with_the_same_bytes(self):
        run = self.copy_of_the_run()
        before = program.files_below(run / "export")
        shutil.rmtree(run / "export")
        result = program.oted("export", run)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        for name in set(before) - {"export.json"}:
            self.assertIn(str(run / "export" / name), result.stdout)
        self.assertEqual(program.files_below(run / "export"), before)

    def test_later_recordings_are_predicted_by_the_simulator_that_logged_them(self):
        result = program.oted("validate", self.designed, "--data", self.demos, "--json")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        record = json.loads(result.stdout)
        self.assertEqual(record["schema"], "oted.validation/1")
        self.assertTrue(record["reaches_floor"], "the logs are the nominal simulator's own, and so is the design")
        for horizon in record["validation"]["horizons"]:
            for channel in horizon["channels"]:
                self.assertLess(channel["designed"], 1e-3, channel)
        self.assertIn(f"the design learned from '{self.demos}'", " ".join(record["warnings"]))
        task = self.folder / "later.toml"  # whose [data] says which columns are what
        task.write_text(f'[task]\nname = "Hopper-v5"\n[data]\npath = "{self.demos}"\n')
        by_task_file = json.loads(program.oted("validate", self.designed, "--data", task, "--json").stdout)
        self.assertEqual(by_task_file["validation"], record["validation"])
        self.assertOneLine(program.oted("validate", self.designed, "--data", self.demos, "--model", "other.xml"),
                           program.USAGE, "--model", "built in")
        self.assertOneLine(program.oted("validate", self.folder, "--data", self.demos), program.USAGE, "design.json")

    def test_a_seeds_design_in_the_place_of_anothers_is_refused_by_name(self):
        run = self.copy_of_the_run()
        shutil.copyfile(run / "design/default/2/q.json", run / "design/default/1/q.json")
        result = program.oted("export", run)
        self.assertEqual(result.returncode, program.DATA_OR_MODEL, result.stdout)
        self.assertRegex(result.stderr, r"\Aoted: [^\n]+design/default/1/q\.json[^\n]+\n\Z")


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
