"""The lint of lint_sizes.py finds planted violations, and leaves alone what only looks like one."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

import lint_sizes

LINT = pathlib.Path(__file__).with_name("lint_sizes.py")
BODY = "  Step();\n" * 79  # with the name's line and the brace's: 81


def lint(files):
    """What the lint finds in a tree that holds these files."""
    with tempfile.TemporaryDirectory() as root:
        (pathlib.Path(root) / "oted").mkdir()
        for path, text in files.items():
            file = pathlib.Path(root) / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
        return lint_sizes.violations(root)


def in_header(text):
    return lint({"oted/base/a.h": f"#pragma once\nnamespace oted {{\n{text}\n}}  // namespace oted\n"})


def in_source(text):
    return lint({"oted/base/a.h": "#pragma once\n", "oted/base/a.cc": f"namespace oted {{\n{text}\n}}\n"})


LONG_LISTS = [
    "void F(int a, int b, int c, int d, int e, int f, int g);",
    "template <class T, int n>\nT F(int a, int b, int c, int d, int e, int f, std::span<const T> g = {});",
    "class C {\n public:\n  C(int a, int b, int c, int d, int e, int f, int g) : a_{a}, b_(b) {}\n};",
    "struct S {\n  static std::vector<int> F(int a, int b, int c, int d, int e, int f, int g) { return {}; }\n};",
    "inline int F(int a, int b,\n             int c, int d, int e, int f, int g) { return a; }",
    "struct S {\n  void operator()(int a, int b, int c, int d, int e, int f, int g) const;\n};",
]

FINE_IN_HEADERS = [
    "void F(int a, int b, int c, int d, int e, int f);",
    "void F(std::map<int, std::pair<int, int>> a, std::function<void(int, int, int, int, int, int, int)> b);",
    "using F = std::function<void(int, int, int, int, int, int, int)>;",
    "// void F(int a, int b, int c, int d, int e, int f, int g);",
    'inline std::string F() { return "f(a, b, c, d, e, f, g)"; }',
    "inline void F() { G(1, 2, 3, 4, 5, 6, 7); }",
    "enum class E { kA, kB, kC, kD, kE, kF, kG };",
    "inline constexpr int kTable[] = {1, 2, 3, 4, 5, 6, 7};",
    "void GemmWith(int a, int b, int c, int d, int e, int f, int g);",
]


class LintSizesTest(unittest.TestCase):
    def test_long_parameter_lists_of_headers_are_found(self):
        for text in LONG_LISTS:
            with self.subTest(text=text):
                found = in_header(text)
                self.assertEqual(len(found), 1, found)
                self.assertIn("7 parameters", *found.values())

    def test_what_only_looks_like_a_long_list_passes(self):
        for text in FINE_IN_HEADERS:
            with self.subTest(text=text):
                self.assertEqual(in_header(text), {})

    def test_a_sources_own_functions_may_have_long_lists(self):
        self.assertEqual(in_source("void F(int a, int b, int c, int d, int e, int f, int g) {}"), {})

    def test_a_function_of_81_lines_is_found_and_one_of_80_passes(self):
        for head in ("void F() {", "C::C(int a) : a_{a}, b_(2) {", "int F(int a)\n    const {", "auto C::operator()(int a) {"):
            with self.subTest(head=head):
                self.assertEqual(len(in_source(f"{head}\n{BODY}}}")), 1)
                shorter = BODY[: -len("  Step();\n") * (1 + head.count("\n"))]
                self.assertEqual(in_source(f"{head}\n{shorter}}}"), {})

    def test_a_lambda_counts_as_part_of_its_function(self):
        self.assertEqual(len(in_source(f"void F() {{\n  const auto g = [&] {{\n{BODY}  }};\n}}")), 1)

    def test_the_lines_of_a_class_are_not_one_functions(self):
        methods = "".join(f"  void F{i}() {{\n{BODY[:90]}  }}\n" for i in range(20))
        self.assertEqual(in_source(f"class C {{\n public:\n{methods}}};"), {})

    def test_a_source_without_a_header_of_its_own_is_found(self):
        self.assertEqual(list(lint({"oted/base/a.cc": "int a;\n"})), ["oted/base/a.cc"])
        self.assertEqual(lint({"oted/base/a_test.cc": "int a;\n", "cli/a.cc": "int a;\n"}), {})

    def test_a_source_of_461_lines_is_found_and_a_test_passes(self):
        lines = "// a line\n" * 460
        self.assertEqual(lint({"oted/base/a.h": lines}), {})
        self.assertEqual(list(lint({"oted/base/a.h": lines + "//\n"})), ["oted/base/a.h lines"])
        self.assertEqual(lint({"oted/base/a_test.cc": lines + "//\n"}), {})

    def test_a_loose_file_is_found(self):
        self.assertEqual(list(lint({"oted/a.h": "#pragma once\n"})), ["oted/a.h"])

    def test_the_program_fails_on_a_violation_and_prints_it(self):
        with tempfile.TemporaryDirectory() as root:
            (pathlib.Path(root) / "oted/base").mkdir(parents=True)
            (pathlib.Path(root) / "oted/base/a.cc").write_text("int a;\n")
            done = subprocess.run([sys.executable, LINT, root], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("oted/base/a.cc:1: has no header", done.stdout)

    def test_a_folder_without_sources_is_refused_rather_than_passed(self):
        with tempfile.TemporaryDirectory() as empty:
            done = subprocess.run([sys.executable, LINT, empty], capture_output=True, text=True)
            self.assertNotEqual(done.returncode, 0)


if __name__ == "__main__":
    unittest.main()
