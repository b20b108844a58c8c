"""lint_names.py notices what it is for, and nothing else."""

import pathlib
import tempfile
import unittest

from lint_names import violations

ONE = "namespace oted {\nnamespace {\nconstexpr int kMost = 3;\nstruct Place {};\ndouble Median(int a) {\n  return a;\n}\n}  // namespace\n}\n"


class LintNames(unittest.TestCase):
    def found(self, files):
        with tempfile.TemporaryDirectory() as folder:
            for name, text in files.items():
                path = pathlib.Path(folder, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text)
            return violations(pathlib.Path(folder))

    def test_each_kind_of_name_that_two_files_of_a_library_share_is_told(self):
        found = self.found({"oted/data/a.cc": ONE, "oted/data/b.cc": ONE})
        self.assertEqual(len(found), 3)
        for line, name in zip(found, ("Median(int a) {", "Place", "kMost")):
            self.assertEqual(line, f"oted/data/a.cc and oted/data/b.cc both name {name}; give one another name")

    def test_methods_of_the_design_are_one_library(self):
        self.assertEqual(len(self.found({"oted/stages/design/a/a.cc": ONE, "oted/stages/design/b/b.cc": ONE})), 3)

    def test_other_libraries_tests_and_overloads_are_none_of_its_business(self):
        other = "namespace {\ndouble Median(double a) {\n  return a;\n}\n}  // namespace\n"
        self.assertEqual(self.found({"oted/data/a.cc": ONE, "oted/sim/a.cc": ONE, "oted/data/a_test.cc": ONE,
                                     "oted/data/c.cc": other}), [])


if __name__ == "__main__":
    unittest.main()
