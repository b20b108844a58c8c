"""What the tests of the Python package share."""

import pathlib
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
HOPPER = str(ROOT / "examples/data/hopper-quickstart.hdf5")
PENDULUM = """<mujoco><option timestep="0.01"/><worldbody><body><joint name="hinge" type="hinge" axis="0 1 0" damping="0.1"/>
<geom name="rod" type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02"/></body></worldbody>
<actuator><motor name="motor" joint="hinge" ctrlrange="-1 1"/></actuator></mujoco>"""


def take_package(doc):
    """The first argument, a folder that holds the package oted ("" where it is installed), which is imported from there."""
    if len(sys.argv) < 2:
        sys.exit(doc)
    folder = sys.argv.pop(1)
    if folder:
        sys.path.insert(0, str(pathlib.Path(folder).resolve()))
    return folder


def take_program(doc):
    """The second argument, the program's path; before take_package."""
    if len(sys.argv) < 3:
        sys.exit(doc)
    return str(pathlib.Path(sys.argv.pop(2)).resolve())


class InFolder(unittest.TestCase):
    """A folder of its own for each test, with a blank in its name."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="oted test ")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
