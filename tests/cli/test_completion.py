"""oted completion: what bash offers for a command line, asked of a real bash.

    test_completion.py PATH/TO/oted [TestClass.test_name ...]
"""

import os
import subprocess
import unittest

import program
from program import USAGE, ProgramTest, oted

# Does what TAB does: calls the function that `complete` knows for the program, with the line up to the cursor.
TAB = r"""
source <("$OTED" completion bash)
[[ $(complete -p oted) == 'complete -o default -F _oted oted' ]] || exit 1
PATH="$(dirname "$OTED"):$PATH"
COMP_POINT=${#COMP_LINE}
_oted
printf '%s\n' "${COMPREPLY[@]}"
"""


class CompletionTest(ProgramTest):
    def offered(self, line):
        shell = subprocess.run(["bash", "--norc", "-c", TAB], capture_output=True, text=True, timeout=60, cwd=self.folder,
                               env={**os.environ, "OTED": program.OTED, "COMP_LINE": line})
        self.assertEqual((shell.returncode, shell.stderr), (0, ""), line)
        return [word for word in shell.stdout.split("\n") if word]

    def test_commands_are_those_of_the_help(self):
        helped = self.succeed("--help").stdout.partition("Before a design:\n")[2]
        commands = [line.split()[0] for line in helped.splitlines() if line.startswith("  ") and line[2] != " "]
        self.assertGreater(len(commands), 20)
        self.assertEqual(sorted(self.offered("oted ")), sorted(commands))
        self.assertEqual(self.offered("oted da"), ["data"])
        self.assertEqual(sorted(self.offered("oted data ")), ["check", "convert", "info"])

    def test_options_are_those_of_the_commands_help(self):
        for command in (["design"], ["data", "check"], ["reproduce", "table1"]):
            helped = self.succeed(*command, "--help").stdout.partition("\nSettings (")[0]
            for option in self.offered(f"oted {' '.join(command)} --"):
                self.assertIn(option, helped)
        self.assertEqual(self.offered("oted design --ta"), ["--task"])
        self.assertEqual(self.offered("oted design arm.toml --quiet --gr"), ["--grow"])
        self.assertNotIn("--grow", self.offered("oted data check --"))

    def test_values_that_have_names(self):
        self.assertEqual(self.offered("oted design --task Walker2d-"), ["Walker2d-v2", "Walker2d-v4", "Walker2d-v5"])
        self.assertIn("arm", self.offered("oted design --preset "))
        self.assertEqual(self.offered("oted behavior --algorithm "), ["sac", "crossq"])
        self.assertEqual(self.offered("oted run --device c"), ["cpu", "cuda"])
        self.assertEqual(self.offered("oted completion "), ["bash", "zsh", "fish"])
        self.assertEqual(self.offered("oted reproduce table2 --design-method tr"), ["trajectories", "transitions"])
        # An option that takes several goes on; one that takes one does not.
        self.assertIn("hopper", self.offered("oted reproduce table1 --task halfcheetah "))
        self.assertEqual(self.offered("oted run --device cpu "), [])

    def test_settings_and_their_values(self):
        self.assertEqual(self.offered("oted design --set design.trajectories.win"), ["design.trajectories.window="])
        # bash keeps what stands before the last '='.
        self.assertEqual(self.offered("oted design --set design.method=tra"), ["trajectories", "transitions"])
        self.assertEqual(self.offered("oted design --set run.strict="), ["true", "false"])
        self.assertEqual(self.offered("oted run --device=cu"), ["cuda"])

    def test_nothing_is_offered_where_a_file_belongs_so_that_bash_offers_files(self):
        for line in ("oted design ", "oted design --data ", "oted init ", "oted report runs/", "oted no_such_command "):
            self.assertEqual(self.offered(line), [], line)

    def test_an_unknown_shell_is_refused(self):
        self.assertOneLine(oted("completion", "tcsh"), USAGE, "tcsh", "bash")


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
