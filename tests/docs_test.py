"""What the documentation names exists: every test in docs/faq.md, every file that a relative link leads to, every figure of
docs/speed.md, every curve of docs/learning.svg.

    docs_test.py
"""

import pathlib
import re
import subprocess
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
# `oted/sim/rollout_test.cc`: `Suite.Name`, `Suite.Other`
EVIDENCE = re.compile(r"`(?P<file>[\w/]+\.(?:cc|h|py))`: (?P<tests>`[\w.]+`(?:, `[\w.]+`)*)")
# [text](target), not an image's data and not a web address
LINK = re.compile(r"\]\((?!https?:|#|mailto:)([^)#\s]+)[^)]*\)")
CODE = re.compile(r"^ *```.*?^ *```", re.S | re.M)  # a lambda in C++ looks like a link


def defines(text, test):
    """Whether a source file's text defines Suite.Name (GoogleTest) or TestClass.test_name (unittest)."""
    suite, name = test.split(".")
    return (re.search(rf"\bTEST(?:_F|_P)?\(\s*{suite},\s*{name}\)", text) is not None or
            re.search(rf"\bclass {suite}\(", text) is not None and f"def {name}(" in text)


class TestDocs(unittest.TestCase):
    def test_every_test_that_the_faq_names_exists(self):
        found = list(EVIDENCE.finditer((ROOT / "docs/faq.md").read_text()))
        self.assertGreater(len(found), 30)
        for match in found:
            path = ROOT / match["file"]
            self.assertTrue(path.is_file(), match["file"])
            for test in re.findall(r"`([\w.]+)`", match["tests"]):
                self.assertTrue(defines(path.read_text(), test), f"{match['file']} has no {test}")

    def test_every_row_of_the_faq_has_evidence_or_says_that_there_is_none(self):
        rows = [line for line in (ROOT / "docs/faq.md").read_text().splitlines() if line.startswith("| ")]
        self.assertGreater(len(rows), 30)
        for row in rows:
            cells = row.strip("| ").split(" | ")
            if cells[0] in ("complaint", "limit"):
                continue
            self.assertEqual(len(cells), 3, row)
            self.assertTrue(EVIDENCE.search(cells[2]) or cells[2].startswith("not there"), row)

    def test_relative_links_lead_somewhere(self):
        pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "benchmarks").glob("*.md")]
        for page in pages:
            for target in LINK.findall(CODE.sub("", page.read_text())):
                self.assertTrue((page.parent / target).exists(), f"{page.relative_to(ROOT)}: {target}")

    def test_the_speed_pages_tables_are_those_of_the_committed_results(self):
        page = (ROOT / "docs/speed.md").read_text()
        for script in ("sac_peers.py", "learning_curves.py"):
            tables = subprocess.run([sys.executable, ROOT / "benchmarks" / script, "--table"], check=True,
                                    capture_output=True, text=True).stdout
            rows = [line for line in tables.splitlines() if line.startswith("| ")]
            self.assertGreater(len(rows), 15)
            for row in rows:
                self.assertIn(row, page)

    def test_the_learning_curves_are_those_of_the_committed_results(self):
        drawn = subprocess.run([sys.executable, "-c", "import learning_curves as c; print(c.drawing(c.by_learner()), end='')"],
                               check=True, capture_output=True, text=True, cwd=ROOT / "benchmarks").stdout
        self.assertGreater(drawn.count("<path"), 30)
        self.assertEqual(drawn, (ROOT / "docs/learning.svg").read_text())


if __name__ == "__main__":
    unittest.main()
