"""Recordings of robots as logs: MCAP files with protobuf, JSON or ROS messages, and ROS 1 and ROS 2 bags. Needs the
packages of oted[bags]; no ROS."""

import os
import pathlib
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from oted import _given, _messages
from oted._engine import core
from oted._mcap import McapFile
from oted._rosbags import RosBag
from oted._topics import Message, Paths
from oted.errors import DataError, UsageError
from oted.logs import Logs
from oted.streams import Channel, to_logs

Array = NDArray[np.float64]
Clock = str | Mapping[str, str]


def read_bag(
    path: str | os.PathLike[str],
    *,
    states: Sequence[str],
    actions: Sequence[str],
    period: float,
    time: Clock = "header",
    names: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
    offset: Mapping[str, float] | None = None,
    shift: Mapping[str, float] | None = None,
    most_gap: float = core.MOST_GAP,
    unwrap: Sequence[str] = (),
    messages: Paths = (),
) -> Logs:
    """One recording. states and actions: "TOPIC:FIELD", such as "/joint_states:position" and "/commands:data"; also
    "TOPIC:FIELD[2]", "TOPIC:pose.position.x", and "TOPIC:joints.position" of a list of messages. The numbers of an array,
    a list or a map become a channel each.

    Numbers are matched by the names in each message, whatever their order, where the message has them: in a list beside
    the numbers (name, names, joint_names), in the elements of a list (name), or as the keys of a map. position, velocity
    and effort are then called joint/NAME/qpos, joint/NAME/qvel, joint/NAME/qfrc_actuator, others TOPIC:FIELD[NAME]; without
    names TOPIC:FIELD[i]. names renames channels ("joint/panda_1/qpos": "joint/shoulder/qpos") or joints ("panda_1":
    "shoulder"). scale and offset correct a channel, after renaming: value * scale + offset. shift [s] is added to the times
    of a topic. unwrap: channels [rad] that the log keeps within one turn, by name or pattern, after renaming and scaling
    (`joint/*/qpos`).

    period [s]: the task's control period. time: "header" (stamps in the messages: header.stamp, stamp or timestamp; where
    nobody set one, the time of recording), "log" (when they were recorded), "publish" (MCAP alone), or ":FIELD", a field
    that holds a time stamp or seconds; or {TOPIC: one of these}. messages: files or folders with .msg files of ROS types
    that the recording does not describe. oted.streams makes the rows."""
    seen, done = (_given.texts(what, given, f"['{example}']") for what, given, example in (
        ("states", states, "/joint_states:position"), ("actions", actions, "/commands:data")))
    wanted = [_split(text) for text in (*seen, *done)]
    topics = list(dict.fromkeys(topic for topic, _ in wanted))
    changes = _Corrections.of(names, scale, offset, shift)
    _given.known("shift", changes.shift, topics, "topic")
    samples = _read(_path(path), wanted, _clocks(time, topics), messages)
    changes.check(list(dict.fromkeys(name for found in samples.values() for name in found)))
    channels: dict[str, list[Channel]] = {}
    for text, (topic, _) in zip((*seen, *done), wanted):
        found = samples[text]
        channels[text] = []
        for name in found:
            stamps = np.array([stamp for stamp, _ in found[name]], dtype=np.int64)
            # Nanoseconds since 1970 do not fit a double.
            seconds = (stamps - _first_stamp(samples)) * 1e-9 + changes.shift.get(topic, 0.0)
            called, values = changes.channel(name, np.array([value for _, value in found[name]], dtype=np.float64))
            channels[text].append(Channel(called, seconds, values, text))
    return to_logs([c for text in seen for c in channels[text]], [c for text in done for c in channels[text]],
                   period, most_gap=most_gap, unwrap=unwrap)


def bag_topics(path: str | os.PathLike[str], messages: Paths = ()) -> list[dict[str, Any]]:
    """Topics with type, encoding, number of messages, median rate [1/s], and the fields that hold numbers in the first
    message: what to name in read_bag. A topic that cannot be decoded has no fields."""
    with _open(_path(path), messages) as recording:
        topics = recording.topics()
        stamps: dict[str, list[int]] = defaultdict(list)
        for message in recording.messages([topic.name for topic in topics], decoded=False):
            stamps[message.topic].append(message.recorded)
        found = []
        for topic in topics:
            steps = np.diff(np.array(stamps[topic.name], dtype=np.int64)) * 1e-9
            rate = 1 / float(np.median(steps)) if len(steps) and np.median(steps) > 0 else 0.0
            try:
                first = next(recording.messages([topic.name]), None)
                fields = [] if first is None else list(_messages.number_paths(first.value))
            except (DataError, UsageError):
                fields = []
            found.append({"topic": topic.name, "type": topic.type, "encoding": topic.encoding,
                          "messages": len(stamps[topic.name]), "rate": rate, "fields": fields})
        return found


Samples = dict[str, dict[str, list[tuple[int, float]]]]


def _first_stamp(samples: Samples) -> int:
    return min(rows[0][0] for channels in samples.values() for rows in channels.values() if rows)


def _split(text: str) -> tuple[str, str]:
    topic, colon, field = text.partition(":")
    if not colon or not topic or not field:
        raise UsageError(f"got '{text}', wanted TOPIC:FIELD, such as /joint_states:position")
    return topic, field


def _path(given: Any) -> pathlib.Path:
    return pathlib.Path(_given.path("path", given, "the path of an MCAP file or of a bag"))


class _Corrections(NamedTuple):
    """What the user says of channels and clocks."""

    names: dict[str, str]
    scale: dict[str, float]
    offset: dict[str, float]
    shift: dict[str, float]

    @classmethod
    def of(cls, names: Any, scale: Any, offset: Any, shift: Any) -> "_Corrections":
        channel = "{'joint/shoulder/qpos': -1}"
        return cls(_given.texts_by_name("names", names, "{'panda_1': 'shoulder'}"),
                   _given.numbers_by_name("scale", scale, channel), _given.numbers_by_name("offset", offset, channel),
                   _given.numbers_by_name("shift", shift, "{'/joint_states': -0.01}"))

    def check(self, there: list[str]) -> None:
        """@throws UsageError where one is of a channel that is not there, and would change nothing"""
        joints = [joint for joint in map(_joint_of, there) if joint is not None]
        _given.known("names", [name for name in self.names if name not in joints], there)
        called = [self._called(name) for name in there]
        _given.known("scale", self.scale, called)
        _given.known("offset", self.offset, called)

    def channel(self, name: str, values: Array) -> tuple[str, Array]:
        called = self._called(name)
        return called, values * self.scale.get(called, 1.0) + self.offset.get(called, 0.0)

    def _called(self, name: str) -> str:
        joint = _joint_of(name)
        if name in self.names or joint not in self.names:
            return self.names.get(name, name)
        return f"joint/{self.names[joint]}/{name.rpartition('/')[2]}"


def _joint_of(name: str) -> str | None:
    """Of joint/NAME/qpos."""
    parts = name.split("/")
    return parts[1] if len(parts) == 3 and parts[0] == "joint" else None


def _open(path: pathlib.Path, messages: Paths) -> McapFile | RosBag:
    messages = _given.paths("messages", messages)
    if not path.exists():
        raise DataError(f"no bag at '{path}'; check the path")
    return McapFile(path, messages) if path.is_file() and path.suffix == ".mcap" else RosBag(path, messages)


def _clocks(time: Any, topics: Sequence[str]) -> dict[str, str]:
    """How each topic's messages are timed."""
    if isinstance(time, str):
        return dict.fromkeys(topics, time)
    if time is None:
        raise UsageError("time: got None, wanted 'header', 'log', 'publish', or ':FIELD'; leave it out for 'header'")
    given = _given.texts_by_name("time", time, "{'/imu': 'log'}")
    _given.known("time", given, topics, "topic")
    return {topic: given.get(topic, "header") for topic in topics}


def _clock(how: str, topic: str, has_publish_times: bool) -> Callable[[Message], int]:
    """When a message of the topic counts as measured."""
    if how == "header":
        return lambda message: _messages.header_stamp(message.value) or message.recorded
    if how == "log":
        return lambda message: message.recorded
    if how == "publish" and has_publish_times:
        return lambda message: message.published
    if how == "publish":
        raise UsageError("time: 'publish' is a time that MCAP files alone have; wanted 'header' or 'log' for this bag")
    if how.startswith(":") and len(how) > 1:
        return lambda message: _messages.stamp_at(message.value, topic, how[1:])
    raise UsageError(f"time: got '{how}', wanted 'header', 'log', 'publish', or ':FIELD'")


def _read(path: pathlib.Path, wanted: Sequence[tuple[str, str]], time: Mapping[str, str], messages: Paths) -> Samples:
    samples: Samples = {f"{topic}:{field}": {} for topic, field in wanted}
    fields = {topic: {field: _messages.steps_of(field) for its, field in wanted if its == topic} for topic, _ in wanted}
    n_messages = dict.fromkeys(fields, 0)
    seen: dict[str, list[str]] = {}
    with _open(path, messages) as recording:
        topics = recording.topics()
        missing = fields.keys() - {topic.name for topic in topics}
        if missing:
            raise DataError(f"'{path}' has no topic '{min(missing)}'; it has {', '.join(topic.name for topic in topics)}")
        clocks = {topic: _clock(time[topic], topic, recording.has_publish_times) for topic in fields}
        for message in recording.messages(list(fields)):
            topic = message.topic
            when = clocks[topic](message)
            if n_messages[topic] == 0:
                seen[topic] = _messages.names_of(message.value)
            n_messages[topic] += 1
            for field, steps in fields[topic].items():
                into = samples[f"{topic}:{field}"]
                try:
                    found = _messages.channels(message.value, topic, steps)
                except UsageError as e:
                    raise UsageError(f"'{path}', '{topic}:{field}': {e}") from e
                for channel, value in found:
                    into.setdefault(channel, []).append((when, value))
    for text, channels in samples.items():
        topic = text.partition(":")[0]
        if channels:
            continue
        if n_messages[topic] == 0:
            raise DataError(f"'{path}': topic '{topic}' has no messages; was it recorded?")
        raise DataError(f"'{path}': '{text}' has no numbers; the field is empty or missing in every message of that topic, "
                        f"whose first has {', '.join(seen[topic]) or 'no fields'}")
    return samples
