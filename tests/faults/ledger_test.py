"""A campaign that was stopped goes on where it was; one of another program begins anew.

    ledger_test.py
"""

import pathlib
import tempfile
import types
import unittest

from campaign import Ledger


class TestLedger(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.program = pathlib.Path(folder.name) / "program"
        self.program.write_text("one")
        self.path = pathlib.Path(folder.name) / "tried.jsonl"
        self.done = []

    def attempt(self, ledger, *names):
        campaign = types.SimpleNamespace(failures=[])
        for name in names:
            def what(name=name):
                self.done.append(name)
                campaign.failures += [f"{name} failed"] if name.startswith("bad") else []
            ledger.attempt(name, campaign, what)
        return campaign.failures

    def test_what_was_tried_is_not_tried_again_and_its_failures_stay(self):
        self.attempt(Ledger(self.path, self.program), "a", "bad b")
        with open(self.path, "a") as file:
            file.write('{"try": "c", "fai')  # stopped while it was written
        again = Ledger(self.path, self.program)
        self.assertTrue(again.goes_on)
        self.assertEqual(self.attempt(again, "a", "bad b", "c"), ["bad b failed"])
        self.assertEqual(self.done, ["a", "bad b", "c"])
        self.assertEqual(list(Ledger(self.path, self.program).tried), ["a", "bad b", "c"])

    def test_another_program_begins_anew(self):
        self.attempt(Ledger(self.path, self.program), "a")
        self.program.write_text("two")
        again = Ledger(self.path, self.program)
        self.assertFalse(again.goes_on)
        self.attempt(again, "a")
        self.assertEqual(self.done, ["a", "a"])

    def test_one_that_is_through_begins_anew(self):
        ledger = Ledger(self.path, self.program)
        self.attempt(ledger, "a")
        ledger.close()
        self.assertFalse(Ledger(self.path, self.program).goes_on)


if __name__ == "__main__":
    unittest.main()
