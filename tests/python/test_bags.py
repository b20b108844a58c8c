"""Bags and MCAP files: test_bags.py [FOLDER], which holds the package oted where it is not installed. What is read was
written by rosbags, mcap and protobuf themselves."""

import json
import pathlib
import sys
import unittest

if len(sys.argv) > 1 and not sys.argv[1].startswith("-"):
    sys.path.insert(0, str(pathlib.Path(sys.argv.pop(1)).resolve()))

import numpy as np  # noqa: E402
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2  # noqa: E402
from mcap.writer import CompressionType  # noqa: E402
from mcap.writer import Writer as McapWriter  # noqa: E402
from mcap_protobuf.schema import register_schema  # noqa: E402
from rosbags.rosbag2 import StoragePlugin  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

import oted  # noqa: E402
from oted.bags import bag_topics, read_bag  # noqa: E402
from robot_bag import RobotBag  # noqa: E402
from support import InFolder  # noqa: E402

START = 1_700_000_000_000_000_000  # [ns]


def elbow(t):
    return np.sin(2 * np.pi * t)


def shoulder(t):
    return 0.3 * t * t - 1


def write_bag(path, plugin, *, unset_stamps=False):
    """Joint states at 500 Hz with jitter and names in changing order, commands at 100 Hz; 2 s. Recorded 12 ms late."""
    random = np.random.default_rng(0)
    with RobotBag(path, plugin) as bag:
        for k in range(1000):
            t = 0.002 * k + random.uniform(-2e-4, 2e-4)
            order = random.permutation(2)
            names, values = np.array(["elbow", "panda_1"])[order], np.array([elbow(t), shoulder(t)])[order]
            stamp = START + round(t * 1e9)
            bag.state(0 if unset_stamps else stamp, stamp + 12_000_000, names, values, np.zeros(2))
        for k in range(200):
            bag.command(START + round(0.01 * k * 1e9), np.array([float(k)]))


class Bags(InFolder):
    def check(self, path, late=0.0, **keywords):
        logs = read_bag(path, states=["/joint_states:position"], actions=["/commands:data"], period=0.02,
                        names={"panda_1": "shoulder"}, **keywords)
        self.assertEqual(sorted(logs.observation_names), ["joint/elbow/qpos", "joint/shoulder/qpos"])
        columns = {name: logs.observations[:, i] for i, name in enumerate(logs.observation_names)}
        # The curves are unwrapped by hand: where the grid begins follows from the first row.
        t0 = np.sqrt((columns["joint/shoulder/qpos"][1] + 1) / 0.3) - 0.02
        t = t0 + 0.02 * np.arange(len(logs))
        # Linear interpolation over 2.4 ms: at most h^2 / 8 of the second derivative, 2.9e-5 of the faster one.
        np.testing.assert_allclose(columns["joint/elbow/qpos"], elbow(t), atol=1e-4)
        np.testing.assert_allclose(columns["joint/shoulder/qpos"], shoulder(t), atol=1e-4)
        np.testing.assert_allclose(logs.actions[:, 0], np.floor((t + late) / 0.01), atol=1.01)
        self.assertEqual(logs.period, 0.02)
        return logs

    def test_a_bag_of_either_storage_is_the_motion_that_was_recorded(self):
        for name, plugin in (("sqlite", StoragePlugin.SQLITE3), ("mcap", StoragePlugin.MCAP)):
            write_bag(self.folder / name, plugin)
            self.check(self.folder / name)

    def test_stamps_that_nobody_set_fall_back_to_the_times_of_recording(self):
        write_bag(self.folder / "bag", StoragePlugin.SQLITE3, unset_stamps=True)
        self.check(self.folder / "bag", late=0.012)

    def test_topics_are_listed_with_rates(self):
        write_bag(self.folder / "bag", StoragePlugin.MCAP)
        found = {topic["topic"]: topic for topic in bag_topics(self.folder / "bag")}
        self.assertEqual(found["/joint_states"]["messages"], 1000)
        self.assertAlmostEqual(found["/commands"]["rate"], 100, delta=0.1)

    def test_signs_units_and_clocks_are_corrected_as_said(self):
        write_bag(self.folder / "bag", StoragePlugin.MCAP)
        plain = self.check(self.folder / "bag")
        logs = read_bag(self.folder / "bag", states=["/joint_states:position"], actions=["/commands:data"], period=0.02,
                        scale={"joint/elbow/qpos": -2.0}, offset={"joint/elbow/qpos": 1.0})
        i, j = (names.observation_names.index("joint/elbow/qpos") for names in (logs, plain))
        np.testing.assert_allclose(logs.observations[:, i], 1 - 2 * plain.observations[:, j], atol=1e-12)

    def test_an_angle_that_is_kept_within_a_turn_goes_on_where_that_is_said(self):
        def hinge(t):
            return 9 * t + np.sin(3 * t)

        with RobotBag(self.folder / "bag", StoragePlugin.MCAP) as bag:
            for k in range(1000):
                stamp = START + 2_000_000 * k + 700_000 * (k % 2)  # uneven: rows lie between samples
                t = (stamp - START) * 1e-9
                bag.state(stamp, stamp, np.array(["hinge", "slide"]), np.array([np.remainder(hinge(t), 2 * np.pi), t]), np.zeros(2))
                bag.command(stamp, np.zeros(1))
        how = {"states": ["/joint_states:position"], "actions": ["/commands:data"], "period": 0.02}
        logs = read_bag(self.folder / "bag", unwrap=["joint/h*/qpos"], **how)
        i, j = (logs.observation_names.index(f"joint/{name}/qpos") for name in ("hinge", "slide"))
        # Linear interpolation over 3.4 ms: h^2 / 8 of 9 rad/s^2.
        np.testing.assert_allclose(logs.observations[:, i], hinge(logs.observations[:, j]), atol=2e-5)
        self.assertTrue(any("'joint/hinge/qpos'" in remark for remark in logs.remarks), logs.remarks)
        wrapped = read_bag(self.folder / "bag", **how)
        self.assertGreater(np.abs(np.diff(wrapped.observations[:, i])).max(), 3)
        for given in (["joint/knee/qpos"], "joint/hinge/qpos"):
            with self.assertRaisesRegex(oted.UsageError, "unwrap"):
                read_bag(self.folder / "bag", unwrap=given, **how)

    def test_errors_name_topic_and_field(self):
        write_bag(self.folder / "bag", StoragePlugin.MCAP)
        for states, error in ((["/joint_state:position"], "/joint_states"), (["/joint_states:postion"], "position"),
                              (["/joint_states"], "TOPIC:FIELD"), (["/joint_states:effort"], "no numbers")):
            with self.assertRaisesRegex(oted.Error, error):
                read_bag(self.folder / "bag", states=states, actions=["/commands:data"], period=0.02)
        with self.assertRaises(oted.DataError):
            read_bag(self.folder / "none", states=["/a:b"], actions=["/c:d"], period=0.02)

    def test_corrections_of_what_is_not_there_are_refused_and_not_left_out(self):
        write_bag(self.folder / "bag", StoragePlugin.MCAP)
        how = {"states": ["/joint_states:position"], "actions": ["/commands:data"], "period": 0.02}
        renamed = {"names": {"panda_1": "shoulder"}}
        for given, said in (
                ({"names": {"panda_2": "shoulder"}}, "names: no channel 'panda_2'; there are .*joint/panda_1/qpos"),
                ({"scale": {"joint/ellbow/qpos": 2}}, "scale: no channel 'joint/ellbow/qpos'; there are .*joint/elbow/qpos"),
                ({**renamed, "scale": {"joint/panda_1/qpos": 2}}, "scale: no channel .*joint/shoulder/qpos"),
                ({"offset": {"elbow": 2}}, "offset: no channel 'elbow'"),
                ({"shift": {"/joint_state": 2}}, "shift: no topic '/joint_state'; there are /joint_states, /commands"),
                ({"time": {"/joint_state": "log"}}, "time: no topic"), ({"time": {"/joint_states": 3}}, "time: '/joint_states': got 3"),
                ({"time": None}, "time: got None"), ({"time": 3}, "time: got 3"), ({"scale": [1]}, r"scale: got \[1\], wanted a dict"),
                ({"scale": {"joint/elbow/qpos": "x"}}, "scale: 'joint/elbow/qpos': got 'x', wanted a number"),
                ({"names": ["y"]}, "names: got .*wanted a dict"), ({"states": [3]}, r"states: got \[3\]"),
                ({"states": None}, "states: got None"), ({"actions": "/commands:data"}, "actions: got '/commands:data'"),
                ({"messages": "x.msg"}, "messages: got 'x.msg'"), ({"period": True}, "period: got True")):
            with self.subTest(said), self.assertRaisesRegex(oted.UsageError, said) as raised:
                read_bag(self.folder / "bag", **{**how, **given})
            self.assertEqual(len(str(raised.exception).splitlines()), 1)
        for call in (lambda: read_bag(3, **how), lambda: bag_topics(3), lambda: bag_topics("\udc80")):
            with self.assertRaisesRegex(oted.UsageError, "path: got"):
                call()

    def test_a_damaged_bag_is_a_data_error(self):
        write_bag(self.folder / "bag", StoragePlugin.MCAP)
        file = next((self.folder / "bag").glob("*.mcap"))
        file.write_bytes(file.read_bytes()[:20_000])
        with self.assertRaises(oted.DataError):
            self.check(self.folder / "bag")


def robot_types():
    """Joint {name, position, optional velocity}; State {timestamp, joints, pose.position.x, wrench, temperature by name};
    Command {data}, made as protoc makes them."""
    field = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(name="robot.proto", package="robot", syntax="proto3",
                                              dependency=["google/protobuf/timestamp.proto"])

    def message(name, *fields, within=None):
        made = (file.message_type if within is None else within.nested_type).add(name=name)
        for number, (label, kind, key) in enumerate(fields, 1):
            added = made.field.add(name=key, number=number,
                                   label=field.LABEL_REPEATED if label == "repeated" else field.LABEL_OPTIONAL)
            if label == "optional":
                made.oneof_decl.add(name=f"_{key}")
                added.proto3_optional, added.oneof_index = True, len(made.oneof_decl) - 1
            if isinstance(kind, str):
                added.type, added.type_name = field.TYPE_MESSAGE, kind
            else:
                added.type = kind
        return made

    number, text = field.TYPE_DOUBLE, field.TYPE_STRING
    message("Joint", ("", text, "name"), ("", number, "position"), ("optional", number, "velocity"))
    message("Vector", ("", number, "x"), ("", number, "y"))
    message("Pose", ("", ".robot.Vector", "position"))
    state = message("State", ("", ".google.protobuf.Timestamp", "timestamp"), ("repeated", ".robot.Joint", "joints"),
                    ("", ".robot.Pose", "pose"), ("repeated", number, "wrench"),
                    ("repeated", ".robot.State.TemperatureEntry", "temperature"), ("", text, "mode"))
    message("TemperatureEntry", ("", text, "key"), ("", number, "value"), within=state).options.map_entry = True
    message("Command", ("repeated", number, "data"))
    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(timestamp_pb2.DESCRIPTOR.serialized_pb)
    pool.Add(file)
    return {name: message_factory.GetMessageClass(pool.FindMessageTypeByName(f"robot.{name}"))
            for name in ("State", "Command")}


ROBOT = robot_types()
N = 200
T = 0.01 * np.arange(N)  # both topics at 100 Hz, so that every row is a message


def stamp_of(t):
    return START + round(t * 1e9)


class Mcap:
    """A file to be written: what a recorder does, by mcap's own writer."""

    def __init__(self, path, **keywords):
        self.path = path
        self._file = path.open("wb")
        self.writer = McapWriter(self._file, **keywords)
        self.writer.start()
        self._channels = {}

    def add(self, topic, encoding, data, log, publish=None, schema=None):
        if topic not in self._channels:
            self._channels[topic] = self.writer.register_channel(topic, encoding, schema or 0)
        self.writer.add_message(self._channels[topic], log, data, log if publish is None else publish)

    def proto(self, topic, message, log, publish=None):
        schema = None if topic in self._channels else register_schema(self.writer, type(message))
        self.add(topic, "protobuf", message.SerializeToString(), log, publish, schema)

    def json(self, topic, value, log, publish=None):
        self.add(topic, "json", json.dumps(value).encode(), log, publish)

    def close(self):
        self.writer.finish()
        self._file.close()
        return self.path


class McapFiles(InFolder):
    def write(self, *, late=0, keywords=None, stamped=True):
        """States (protobuf) and commands (protobuf and JSON) of one motion, recorded `late` nanoseconds after it."""
        file = Mcap(self.folder / "run.mcap", **(keywords or {}))
        random = np.random.default_rng(0)
        for k, t in enumerate(T):
            message = ROBOT["State"](wrench=[t, 2 * t], temperature={"elbow": 30 + t, "shoulder": 20 + t}, mode="on")
            message.pose.position.x = -t
            if stamped:
                message.timestamp.FromNanoseconds(stamp_of(t))
            for name in random.permutation(["elbow", "shoulder"]):
                joint = message.joints.add(name=name, position=elbow(t) if name == "elbow" else shoulder(t))
                if name == "elbow":
                    joint.velocity = 5 * t
            file.proto("/state", message, stamp_of(t) + late, stamp_of(t) + late // 2)
            file.proto("/cmd", ROBOT["Command"](data=[k, -k, 0.5]), stamp_of(t))
            file.json("/teleop", {"t": t, "stick": {"x": 3 * t}, "axes": [k, {"deep": 2 * k}]}, stamp_of(t))
        return file.close()

    def read(self, path, states, actions=("/cmd:data[2]",), **keywords):
        logs = read_bag(path, states=states, actions=list(actions), period=0.01, **keywords)
        seen = np.vstack([logs.observations, logs.next_observations[-1:]])
        return {name: seen[:, i] for i, name in enumerate(logs.observation_names)}, logs

    def test_fields_are_found_by_path_whatever_they_lie_in(self):
        columns, logs = self.read(self.write(), [
            "/state:joints.position", "/state:joints.velocity", "/state:pose.position.x", "/state:wrench",
            "/state:temperature", "/teleop:stick.x", "/teleop:axes[1].deep"], ["/cmd:data", "/teleop:axes[0]"])
        wanted = {
            "joint/elbow/qpos": elbow(T), "joint/shoulder/qpos": shoulder(T),  # in another order in each message
            "joint/elbow/qvel": 5 * T,  # the shoulder's is not set
            "/state:pose.position.x": -T, "/state:wrench[0]": T, "/state:wrench[1]": 2 * T,
            "/state:temperature[elbow]": 30 + T, "/state:temperature[shoulder]": 20 + T,
            "/teleop:stick.x": 3 * T, "/teleop:axes[1].deep": 2.0 * np.arange(N)}
        self.assertEqual(set(columns), set(wanted))
        for name, values in wanted.items():
            np.testing.assert_allclose(columns[name], values, atol=1e-6, err_msg=name)
        self.assertEqual(logs.action_names, ["/cmd:data[0]", "/cmd:data[1]", "/cmd:data[2]", "/teleop:axes[0]"])
        np.testing.assert_array_equal(logs.actions[:, 3], np.arange(N - 1))

    def test_every_chunking_and_compression_is_the_same_motion(self):
        plain = self.read(self.write(), ["/state:joints.position"])[0]
        for keywords in ({"compression": CompressionType.LZ4}, {"compression": CompressionType.NONE, "chunk_size": 1000},
                         {"use_chunking": False}, {"use_summary_offsets": False, "use_statistics": False}):
            columns = self.read(self.write(keywords=keywords), ["/state:joints.position"])[0]
            for name, values in plain.items():
                np.testing.assert_array_equal(columns[name], values)

    def test_the_clock_is_the_one_that_was_asked_for(self):
        path = self.write(late=20_000_000)
        for time, late in (("header", 0.0), ("log", 0.02), ("publish", 0.01), ({"/state": "publish"}, 0.01),
                           ({"/state": ":timestamp", "/cmd": "log"}, 0.0)):
            columns, logs = self.read(path, ["/state:wrench[0]"], ["/cmd:data[0]"], time=time)
            # wrench[0] is the time of measurement, data[0] counts the commands, which were not late and ended first.
            np.testing.assert_allclose(logs.observations[:-5, 0], logs.actions[:-5, 0] * 0.01 - late, atol=1e-6,
                                       err_msg=str(time))
        columns, _ = self.read(path, ["/teleop:stick.x"], ["/teleop:axes[0]"], time=":t")
        np.testing.assert_allclose(columns["/teleop:stick.x"], 3 * T, atol=1e-6)
        unset = self.write(late=20_000_000, stamped=False)
        _, logs = self.read(unset, ["/state:wrench[0]"], ["/cmd:data[0]"])
        np.testing.assert_allclose(logs.observations[:-5, 0], logs.actions[:-5, 0] * 0.01 - 0.02, atol=1e-6)
        for time, error in (("clock", "got 'clock'"), (":mode", "no time in field 'mode'"), (":no.such", "no.such")):
            with self.assertRaisesRegex(oted.Error, error):
                self.read(path, ["/state:wrench[0]"], time=time)

    def test_json_has_times_of_every_spelling_to_the_nanosecond(self):
        t = 1_700_000_000_123_456_789
        for stamp in ({"header": {"stamp": {"sec": t // 10**9, "nanosec": t % 10**9}}},
                      {"timestamp": {"sec": t // 10**9, "nsec": t % 10**9}}, {"stamp": {"secs": t // 10**9, "nsecs": t % 10**9}},
                      {"timestamp": {"seconds": t // 10**9, "nanos": t % 10**9}},
                      {"timestamp": "2023-11-14T22:13:20.123456789Z"}, {"stamp": "2023-11-14T23:13:20.123456789+01:00"}):
            from oted._messages import header_stamp
            self.assertEqual(header_stamp(stamp), t, stamp)

    def test_mixed_encodings_lie_side_by_side_and_unknown_ones_are_refused_by_topic(self):
        file = Mcap(self.folder / "mixed.mcap")
        store = get_typestore(Stores.ROS2_HUMBLE)
        types = store.types
        state = types["sensor_msgs/msg/JointState"]
        header, time = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
        definition, _ = store.generate_msgdef(state.__msgtype__, ros_version=2)
        schema = file.writer.register_schema(state.__msgtype__, "ros2msg", definition.encode())
        odd = file.writer.register_schema("robot.Odd", "flatbuffer", b"")
        for k, t in enumerate(T):
            stamp = stamp_of(t)
            message = state(header(time(stamp // 10**9, stamp % 10**9), ""), ["elbow"], np.array([elbow(t)]), np.zeros(1),
                            np.zeros(0))
            file.add("/joint_states", "cdr", bytes(store.serialize_cdr(message, state.__msgtype__)), stamp, schema=schema)
            file.proto("/cmd", ROBOT["Command"](data=[k]), stamp)
            file.json("/force", {"z": 2 * t}, stamp)
            file.add("/odd", "flatbuffer", b"\x01\x02", stamp, schema=odd)
        path = file.close()
        columns, _ = self.read(path, ["/joint_states:position", "/force:z"], ["/cmd:data"])
        np.testing.assert_allclose(columns["joint/elbow/qpos"], elbow(T), atol=1e-6)
        np.testing.assert_allclose(columns["/force:z"], 2 * T, atol=1e-6)
        with self.assertRaisesRegex(oted.DataError, "'/odd'.*'flatbuffer'.*protobuf, json"):
            self.read(path, ["/odd:x"], ["/cmd:data"])
        found = {topic["topic"]: topic for topic in bag_topics(path)}
        self.assertEqual({name: topic["encoding"] for name, topic in found.items()},
                         {"/joint_states": "cdr", "/cmd": "protobuf", "/force": "json", "/odd": "flatbuffer"})
        self.assertEqual(found["/joint_states"]["fields"], ["position", "velocity"])
        self.assertEqual((found["/cmd"]["type"], found["/cmd"]["fields"], found["/cmd"]["messages"]), ("robot.Command", ["data"], N))
        self.assertEqual((found["/odd"]["fields"], found["/odd"]["messages"]), ([], N))
        self.assertAlmostEqual(found["/force"]["rate"], 100, delta=0.1)

    def test_listed_fields_can_be_read(self):
        path = self.write()
        for topic in bag_topics(path):
            for field in topic["fields"]:
                self.assertEqual(len(self.read(path, [f"{topic['topic']}:{field}"])[1]), N - 1, field)

    def test_errors_name_topic_and_field_and_what_there_is(self):
        path = self.write()
        for states, error in ((["/state:joint.position"], "'/state:joint.position': no field 'joint'; there are .*joints"),
                              (["/state:joints.angle"], "no field 'angle'; there are name, position, velocity"),
                              (["/state:pose"], "'pose' is a message.*position"), (["/state:mode"], "'mode' holds str"),
                              (["/state:joints"], r"'joints\[0\]' is a message"), (["/state:wrench[7]"], "has 2 numbers"),
                              (["/state:wrench[x]"], "indices"), (["/teleop:speed"], "'/teleop:speed' has no numbers.*stick"),
                              (["/states:mode"], "no topic '/states'; it has /cmd, /state, /teleop")):
            with self.assertRaisesRegex(oted.Error, error):
                self.read(path, states)

    def test_damage_is_a_data_error_that_names_topic_or_remedy(self):
        path = self.write()
        whole = path.read_bytes()
        for data in (b"", whole[:4], whole[:len(whole) // 2], whole[:-5], b"no mcap at all, but long enough to be one"):
            path.write_bytes(data)
            for call in (lambda: self.read(path, ["/state:wrench"]), lambda: bag_topics(path)):
                with self.assertRaisesRegex(oted.DataError, "mcap recover"):
                    call()
        random = np.random.default_rng(1)
        n_refused = 0
        for _ in range(60):
            damaged = bytearray(whole)
            damaged[random.integers(len(damaged))] ^= 1 << random.integers(8)
            path.write_bytes(damaged)
            try:
                self.read(path, ["/state:wrench"])
            except oted.Error:
                n_refused += 1  # and nothing else
        self.assertGreater(n_refused, 20)  # a chunk's bytes have a checksum
        file = Mcap(path)
        for k in range(5):
            file.proto("/cmd", ROBOT["Command"](data=[k]), stamp_of(0.01 * k))
            file.add("/state", "json", b"{no json" if k == 3 else b'{"x": 1}', stamp_of(0.01 * k))
        file.add("/cmd", "protobuf", b"\xff\xff\xff", stamp_of(0.05))
        file.close()
        with self.assertRaisesRegex(oted.DataError, "message 4 of topic '/state' cannot be decoded as json"):
            self.read(path, ["/state:x"], ["/cmd:data"])
        with self.assertRaisesRegex(oted.DataError, "message 6 of topic '/cmd' cannot be decoded as protobuf"):
            self.read(path, ["/cmd:data"], ["/cmd:data"])


if __name__ == "__main__":
    unittest.main()
