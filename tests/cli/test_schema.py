"""The JSON schema of the task file says what the program does: it takes what the program takes, and refuses a wrong key and a
wrong type as the program does. (program.py holds it against every task file that a test of the program writes.)

    test_schema.py PATH/TO/oted [TestClass.test_name ...]
"""

import json
import re
import tomllib
import unittest

import program
from program import ROOT, USAGE, ProgramTest, oted, task_file_validator

TASK = '[task]\nname = "Hopper-v5"\n[parameters]\nfriction = { field = "geom/*/friction[0]", range = [0.5, 2.0] }\n'
# Sections that are added to TASK; whether both take the whole.
CASES = [
    ('[design]\nmethod = "trajectories"\n[design.trajectories]\nwindow = 8\n', True),
    ('[design.settings.short]\nmethod = "trajectories"\ntrajectories.window = 4\n', True),
    ('[data]\nepisodes = 3\n[report]\nmotion = false\n', True),
    ('[data]\nepisodes = "all"\n[report]\nmotion = "auto"\n', True),
    ('[sac]\nn_steps = 1e5\n', True),
    ('[truth]\nfriction = 1\n', True),
    ('[desing]\nmethod = "auto"\n', False),
    ('[design]\nmetod = "auto"\n', False),
    ('[design]\nmethod = "newton"\n', False),
    ('[design]\nmethod = 3\n', False),
    ('[design.trajectories]\nwindow = "eight"\n', False),
    ('[design.trajectories]\nwindow = 2.5\n', False),
    ('[design.trajectories]\nwindows = 8\n', False),
    ('[design.settings.short]\nwindow = 4\n', False),
    ('[data]\nepisodes = true\n', False),
    ('[data]\nobservations = "x"\n', False),
    ('[data]\nobservations = [1]\n', False),
    ('[report]\nmotion = 1\n', False),
    ('[run]\nseed = -1\n', False),
    ('[run]\nstrict = "yes"\n', False),
    ('[sac]\nn_steps = 0\n', False),
    ('[truth]\nfriction = "one"\n', False),
]
# Lines of [parameters].
PARAMETERS = [
    ('preset = "arm"', True),
    ('preset = ["arm", "gripper"]', True),
    ('a = { field = ["geom/*/friction[0]", "opt/gravity[2]"] }', True),
    ('a = { field = "opt/gravity[2]", range = [1, 2], scale = "absolute", unit = "m", log = true }', True),
    ('preset = 1', False),
    ('a = "opt/gravity[2]"', False),
    ('a = { range = [0.5, 2.0] }', False),
    ('a = { field = "opt/gravity[2]", rnage = [0.5, 2.0] }', False),
    ('a = { field = "opt/gravity[2]", range = [0.5] }', False),
    ('a = { field = "opt/gravity[2]", scale = "log" }', False),
    ('a = { field = "opt/gravity[2]", log = 1 }', False),
    ('a = { field = [] }', False),
    ('a = { field = "opt/gravity[2]", prior = { mean = 1.0 } }', False),
]


class SchemaTest(ProgramTest):
    def test_the_published_schema_is_the_programs(self):
        published = ROOT / "docs/schemas/oted.task.1.schema.json"
        self.assertEqual(published.read_text(), self.succeed("schema").stdout, f"run: oted schema >{published.relative_to(ROOT)}")

    def test_it_takes_the_task_files_of_the_examples_and_of_the_pages(self):
        texts = {str(path): path.read_text() for path in (ROOT / "examples").rglob("*.toml")}
        self.assertGreater(len(texts), 5)
        for path in texts:
            first = texts[path].splitlines()[0]
            self.assertTrue(first.startswith("#:schema "), path)
            self.assertTrue((ROOT / path).parent.joinpath(first.removeprefix("#:schema ")).is_file(), path)
        for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
            for i, block in enumerate(re.findall(r"^```toml\n(.*?)^```", page.read_text(), re.S | re.M)):
                lines_of_parameters = re.search(r"^\[", block, re.M) is None
                texts[f"{page.name}, block {i}"] = "[parameters]\n" * lines_of_parameters + block
        self.assertGreater(len(texts), 12)
        for name, text in texts.items():
            with self.subTest(name):
                task_file_validator().validate(tomllib.loads(text))

    def both(self, text, taken):
        """Holds schema and program against the same text."""
        path = self.folder / "task.toml"
        path.write_text(text)
        result = oted("params", "list", path)
        self.assertEqual(result.returncode, 0 if taken else USAGE, text + result.stderr)
        self.assertEqual(task_file_validator().is_valid(tomllib.loads(text)), taken, text)

    def test_it_takes_and_refuses_what_the_program_does(self):
        for section, taken in CASES:
            with self.subTest(section):
                self.both(TASK + section, taken)
        for line, taken in PARAMETERS:
            with self.subTest(line):
                self.both(TASK + line + "\n", taken)

    def test_it_has_every_setting_that_the_help_has(self):
        text = self.succeed("run", "--help").stdout.partition("\nSettings (")[2]
        schema, n = json.loads(self.succeed("schema").stdout), 0
        for line in text.splitlines():
            if section := re.match(r"\[([\w.]+)\]$", line):
                place = schema
                for word in section[1].split("."):
                    place = place["properties"][word]
            elif setting := re.match(r"  (\w+) .*\[default: ", line):
                self.assertIn(setting[1], place["properties"], line)
                self.assertIn("description", place["properties"][setting[1]])
                n += 1
        self.assertGreater(n, 100)


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
