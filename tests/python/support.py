"""What the tests of the Python package share."""

import pathlib
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
HOPPER = str(ROOT / "examples/data/hopper-quickstart.hdf5")
PENDULUM = """<mujoco><option timestep="0.01"/><worldbody><body><joint name="hinge" type="hinge" axis="0 1 0" damping="0.1"/>
<geom name="rod" type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02"/></body></worldbody>
<actuator><motor name="motor" joint="hinge" ctrlrange="-1 1"/></actuator></mujoco>"""


class InFolder(unittest.TestCase):
    """A folder of its own for each test, with a blank in its name."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="oted test ")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
