"""Recordings of ROS 2 as a robot's driver makes them: joint states and commands, to be written in a `with` statement.
Stamps are in ns; 0 is a stamp that was not set."""

import numpy as np
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
STATE, COMMAND = "sensor_msgs/msg/JointState", "std_msgs/msg/Float64MultiArray"


class RobotBag:
    """A bag, written by rosbags."""

    def __init__(self, path, plugin):
        self._writer = Writer(path, version=9, storage_plugin=plugin)

    def __enter__(self):
        self._writer.open()
        self._states, self._commands = (self._writer.add_connection(topic, kind, typestore=STORE) for topic, kind in (
            ("/joint_states", STATE), ("/commands", COMMAND)))
        return self

    def __exit__(self, *_):
        self._writer.close()

    def _write(self, connection, received, message):
        self._writer.write(connection, received, STORE.serialize_cdr(message, message.__msgtype__))

    def state(self, stamp, received, names, positions, velocities):
        types = STORE.types
        header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9), "")
        self._write(self._states, received, types[STATE](header, list(names), positions, velocities, np.zeros(0)))

    def command(self, received, numbers):
        types = STORE.types
        self._write(self._commands, received, types[COMMAND](types["std_msgs/msg/MultiArrayLayout"]([], 0), numbers))


class RobotMcap:
    """An MCAP file alone, written by MCAP's own packages."""

    def __init__(self, path):
        self._file = open(path, "wb")

    def __enter__(self):
        from mcap_ros2.writer import Writer as McapWriter
        self._writer = McapWriter(self._file)
        self._states, self._commands = (
            self._writer.register_msgdef(kind, STORE.generate_msgdef(kind, ros_version=2)[0]) for kind in (STATE, COMMAND))
        return self

    def __exit__(self, *_):
        self._writer.finish()
        self._file.close()

    def state(self, stamp, received, names, positions, velocities):
        header = {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": ""}
        self._writer.write_message("/joint_states", self._states, {
            "header": header, "name": list(names), "position": list(positions), "velocity": list(velocities), "effort": []},
            log_time=received, publish_time=received)

    def command(self, received, numbers):
        self._writer.write_message("/commands", self._commands, {
            "layout": {"dim": [], "data_offset": 0}, "data": list(numbers)}, log_time=received, publish_time=received)
