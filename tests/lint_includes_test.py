"""The lint of lint_includes.py finds planted violations, and leaves alone what only looks like one."""

import contextlib
import pathlib
import subprocess
import sys
import tempfile
import unittest

import lint_includes

LINT = pathlib.Path(__file__).with_name("lint_includes.py")


@contextlib.contextmanager
def tree(path, text):
    """A repository that holds one file."""
    with tempfile.TemporaryDirectory() as root:
        (pathlib.Path(root) / "oted").mkdir()
        file = pathlib.Path(root) / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
        yield root


def lint(path, text):
    """What the lint finds in a tree that holds one file."""
    with tree(path, text) as root:
        return lint_includes.violations(root)


def run_lint(root):
    return subprocess.run([sys.executable, LINT, root], capture_output=True, text=True)


FORBIDDEN = [
    ("oted/base/a.cc", '#include "oted/data/dataset.h"\n'),
    ("oted/base/a.cc", '#include "oted/sim/simulator.h"\n'),
    ("oted/data/a.cc", '#include "oted/sim/simulator.h"\n'),
    ("oted/data/a.cc", '#include "oted/nn/mlp.h"\n'),
    ("oted/sim/a.cc", '#include "oted/nn/mlp.h"\n'),
    ("oted/sim/a.cc", '#include "oted/sim/mujoco/tasks.h"\n'),
    ("oted/sim/mujoco/a.cc", '#include "oted/rl/sac.h"\n'),
    ("oted/nn/a.cc", '#include "oted/sim/simulator.h"\n'),
    ("oted/nn/a_test.cc", '#include "oted/sim/mujoco/tasks.h"\n'),
    ("oted/rl/a.cc", '#include "oted/stages/design/designer.h"\n'),
    ("oted/rl/a.cc", '#include "oted/sim/mujoco/tasks.h"\n'),
    ("oted/stages/design/a.cc", '#include "oted/stages/clone/clone.h"\n'),
    ("oted/stages/design/a_test.cc", '#include "oted/stages/clone/clone.h"\n'),
    ("oted/matching/a.cc", '#include "oted/stages/design/designer.h"\n'),
    ("oted/rl/a.cc", '#include "oted/matching/designer.h"\n'),
    ("oted/base/a.cc", '#include "oted/base/testing.h"\n'),
    ("cli/a.cc", '#include "oted/base/testing.h"\n'),
    ("oted/stages/design/a.cc", '#include "oted/run/pipeline.h"\n'),
    ("oted/stages/design/a.cc", '#include "oted/report/html.h"\n'),
    ("oted/report/a.cc", '#include "oted/nn/mlp.h"\n'),
    ("oted/report/a.cc", '#include "oted/stages/design/designer.h"\n'),
    ("oted/run/pipeline.cc", '#include "oted/report/html.h"\n'),
    ("oted/run/pipeline.cc", '#include "cli/verbs/run.h"\n'),
    ("examples/a.cc", '#include "cli/verbs/run.h"\n'),
    ("oted/stages/design/rivals/a.cc", '#include "oted/stages/clone/clone.h"\n'),
    ("oted/loose.cc", '#include "oted/base/error.h"\n'),
    ("oted/newcomer/a.cc", '#include "oted/base/error.h"\n'),
    ("oted/data/a.h", "#pragma once\n#include <torch/torch.h>\n"),
    ("oted/sim/a.h", "#pragma once\n#include <ATen/ATen.h>\n"),
    ("oted/stages/agent/a.cc", "#include <c10/util/Exception.h>\n"),
    ("cli/a.cc", "#include <torch/torch.h>\n"),
    ("oted/sim/a.cc", "#include <mujoco/mujoco.h>\n"),
    ("oted/rl/a.cc", "#include <mujoco/mjbatch.h>\n"),
    ("cli/a.cc", '#  include "mujoco.h"\n'),
    ("oted/base/a.cc", '#include "tests/helpers.h"\n'),
    ("oted/base/a_test.cc", '#include "benchmarks/timer.h"\n'),
    ("cli/a.cc", '#include "benchmarks/timer.h"\n'),
    ("tests/a.cc", '#include "examples/task.h"\n'),
    ("oted/base/a.cc", '#include "error.h"\n'),
    ("oted/base/a.h", "int Answer();\n"),
    ("tests/a.h", "#ifndef A_H\n#define A_H\n#endif\n"),
    ("oted/base/a.h", "// #pragma once\nint Answer();\n"),
    ("oted/base/a.cc", "#include <iostream>\n"),
    ("oted/base/a.cc", 'void F() { std::cout << "x"; }\n'),
    ("oted/rl/a.cc", "void F() { std::cerr << 1; }\n"),
    ("oted/base/a.cc", 'void F() { printf("x"); }\n'),
    ("oted/base/a.cc", 'void F() { std::printf("x"); }\n'),
    ("oted/base/a.cc", 'void F() { fprintf(stderr, "x"); }\n'),
    ("oted/base/a.cc", 'void F() { fmt::print("x"); }\n'),
    ("oted/base/a.cc", "void F() { exit(1); }\n"),
    ("oted/base/a.cc", "void F() { std::exit(1); }\n"),
    ("oted/base/a.cc", "void F() { ::abort(); }\n"),
    ("oted/data/a.cc", "void F() { ::_exit(0); }\n"),
    ("oted/data/child_process.cc", 'void F() { std::printf("x"); }\n'),
    ("oted/base/a.cc", "int n = 1'000'000; void F() { std::terminate(); }\n"),
]

ALLOWED = [
    ("oted/data/a.cc", '#include "oted/base/error.h"\n#include <vector>\n'),
    ("oted/sim/mujoco/a.cc", '#include <mujoco/mjbatch.h>\n#include "oted/sim/simulator.h"\n'),
    ("oted/data/a_test.cc", '#include "oted/base/testing.h"\n#include "oted/data/testing.h"\n'),
    ("oted/stages/design/a.cc", '#include "oted/matching/designer.h"\n'),
    ("oted/sim/mujoco/a_test.cc", '#include "tests/conformance/simulator_conformance.h"\n'),
    ("benchmarks/a.cc", "#include <mujoco/mujoco.h>\n"),
    ("oted/rl/a.cc", '#include <torch/torch.h>\n#include "oted/nn/mlp.h"\n#include "oted/sim/simulator.h"\n'),
    ("oted/nn/a_test.cc", "#include <torch/torch.h>\n"),
    ("oted/stages/design/a.cc", '#include "oted/rl/sac.h"\n#include "oted/stages/design/prior.h"\n'),
    ("oted/stages/design/a_test.cc", '#include "oted/sim/mujoco/tasks.h"\n'),
    ("oted/report/a.cc", '#include "oted/data/dataset.h"\n#include <protozero/pbf_writer.hpp>\n'),
    ("oted/stages/design/rivals/a.cc", '#include "oted/stages/design/replay/windows.h"\n'),
    ("oted/run/pipeline.cc", '#include "oted/run/pipeline.h"\n#include "oted/stages/agent/train.h"\n#include "oted/sim/mujoco/a.h"\n'),
    ("examples/a/main.cc", '#include "cli/main.h"\n#include "examples/a/task.h"\n'),
    ("cli/a.cc", '#include "oted/report/html.h"\n#include <iostream>\nint F() { std::cout << 1; std::exit(1); }\n'),
    ("tests/a.cc", '#include "tests/helpers.h"\n#include "oted/run/pipeline.h"\n'),
    ("oted/base/a.cc", '// printf(), exit() and std::cout\n/* #include "oted/sim/simulator.h" */\n'),
    ("oted/base/a.cc", 'auto text = "std::cout << exit(1)"; auto raw = R"(abort() "quoted" printf(x))";\n'),
    ("oted/base/a.cc", "int n = snprintf(buffer, 8, format); loop.exit(); guard->abort(); Clean::exit(1); on_exit();\n"),
    ("oted/data/child_process.cc", "void F() { ::_exit(0); }\n"),
    ("oted/base/a_test.cc", 'TEST(A, B) { EXPECT_EXIT(exit(1), X, ""); }\n'),
    ("oted/base/a.h", "/// A header.\n#pragma once\n"),
]


class LintIncludesTest(unittest.TestCase):
    def test_every_planted_violation_is_found_where_it_is(self):
        for path, text in FORBIDDEN:
            with self.subTest(path=path, text=text):
                found = lint(path, text)
                self.assertTrue(found)
                self.assertTrue(all(line.startswith(path + ":") for line in found), found)

    def test_what_only_looks_like_a_violation_passes(self):
        for path, text in ALLOWED:
            with self.subTest(path=path, text=text):
                self.assertEqual(lint(path, text), [])

    def test_the_line_is_the_violations_own(self):
        found = lint("oted/base/a.cc", '/* two\n lines */\n\n#include "oted/nn/mlp.h"\n')
        self.assertTrue(found[0].startswith("oted/base/a.cc:4: "), found)

    def test_the_program_fails_on_a_violation_and_prints_it(self):
        with tree("oted/base/a.cc", '#include "oted/nn/mlp.h"\n') as root:
            done = run_lint(root)
        self.assertEqual(done.returncode, 1)
        self.assertIn("oted/base/a.cc:1: includes oted/nn/mlp.h", done.stdout)

    def test_the_program_passes_a_clean_tree_in_silence(self):
        with tree("oted/data/a.cc", '#include "oted/base/error.h"\n') as root:
            done = run_lint(root)
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "", ""))

    def test_a_right_that_nothing_uses_is_told(self):
        rules = {"data": {"base", "sim"}, "stages/*": {"base"}, "run": {"stages/*"}}
        with tree("oted/data/a.cc", '#include "oted/base/error.h"\n// #include "oted/sim/simulator.h"\n') as root:
            (pathlib.Path(root) / "oted/run").mkdir()
            (pathlib.Path(root) / "oted/run/a.h").write_text('#include "oted/stages/clone/clone.h"\n')
            found = lint_includes.unused_rights(root, rules)
        self.assertEqual([line.split(": ")[1] for line in found],
                         ["oted/data includes nothing of sim", "oted/stages/* includes nothing of base"])

    def test_a_folder_without_sources_is_refused_rather_than_passed(self):
        with tempfile.TemporaryDirectory() as empty:
            self.assertNotEqual(run_lint(empty).returncode, 0)


if __name__ == "__main__":
    unittest.main()
