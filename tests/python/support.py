"""What the tests of the Python package share."""

import pathlib
import tempfile
import unittest


class InFolder(unittest.TestCase):
    """A folder of its own for each test, with a blank in its name."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="oted test ")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
