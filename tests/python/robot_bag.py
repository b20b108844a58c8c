"""A ROS 2 bag as a robot's driver records it, written by rosbags."""

import numpy as np
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore


class RobotBag:
    """Joint states and commands; to be used in a `with` statement. Stamps are in ns; 0 is a stamp that was not set."""

    def __init__(self, path, plugin):
        self._store = get_typestore(Stores.ROS2_HUMBLE)
        self._writer = Writer(path, version=9, storage_plugin=plugin)

    def __enter__(self):
        self._writer.open()
        self._states, self._commands = (self._writer.add_connection(topic, kind, typestore=self._store) for topic, kind in (
            ("/joint_states", "sensor_msgs/msg/JointState"), ("/commands", "std_msgs/msg/Float64MultiArray")))
        return self

    def __exit__(self, *_):
        self._writer.close()

    def _write(self, connection, received, message):
        self._writer.write(connection, received, self._store.serialize_cdr(message, message.__msgtype__))

    def state(self, stamp, received, names, positions, velocities):
        types = self._store.types
        header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9), "")
        self._write(self._states, received, types["sensor_msgs/msg/JointState"](header, list(names), positions, velocities, np.zeros(0)))

    def command(self, received, numbers):
        types = self._store.types
        self._write(self._commands, received, types["std_msgs/msg/Float64MultiArray"](types["std_msgs/msg/MultiArrayLayout"]([], 0), numbers))
