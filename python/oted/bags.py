"""ROS 1 and ROS 2 bags (SQLite and MCAP) and MCAP files of ROS 2 as logs. Needs rosbags; no ROS."""

import os
import pathlib
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from oted._needs import need
from oted.errors import DataError, UsageError
from oted.logs import Logs
from oted.streams import Channel, to_logs

# What the fields of sensor_msgs/JointState are called in a task.
JOINT_FIELDS = {"position": "qpos", "velocity": "qvel", "effort": "qfrc_actuator"}


def read_bag(
    path: str | os.PathLike[str],
    *,
    states: Sequence[str],
    actions: Sequence[str],
    period: float,
    time: str = "header",
    names: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
    offset: Mapping[str, float] | None = None,
    shift: Mapping[str, float] | None = None,
    most_gap: float = 3.0,
    messages: Sequence[str | os.PathLike[str]] = (),
) -> Logs:
    """One recording. states and actions: "TOPIC:FIELD", such as "/joint_states:position" and "/commands:data"; also
    "TOPIC:FIELD[2]" and "TOPIC:pose.position.x". The numbers of an array become a channel each.

    A JointState's numbers are matched by the names in each message, whatever their order, and called joint/NAME/qpos,
    joint/NAME/qvel, joint/NAME/qfrc_actuator; others TOPIC:FIELD[i]. names renames channels ("joint/panda_1/qpos":
    "joint/shoulder/qpos") or joints ("panda_1": "shoulder"). scale and offset correct a channel, after renaming:
    value * scale + offset. shift [s] is added to the times of a topic.

    period [s]: the task's control period. time: "header" (stamps in the messages) or "log" (when they were recorded).
    messages: files or folders with .msg files of types that the bag does not describe. oted.streams has the rule by which
    rows are made."""
    if time not in ("header", "log"):
        raise UsageError(f"time: got '{time}', wanted 'header' or 'log'")
    wanted = [_split(text) for text in (*states, *actions)]
    samples = _read(pathlib.Path(path), {topic for topic, _ in wanted}, wanted, time, messages)
    renamed = dict(names or {})
    channels: dict[str, list[Channel]] = {}
    for text, (topic, _) in zip((*states, *actions), wanted):
        found = samples.get(text)
        if not found:
            raise DataError(f"'{path}': '{text}' has no numbers; the field is empty in every message of that topic")
        channels[text] = []
        for name in found:
            called = _called(name, renamed)
            stamps = np.array([stamp for stamp, _ in found[name]], dtype=np.int64)
            # Nanoseconds since 1970 do not fit a double.
            seconds = (stamps - _first_stamp(samples)) * 1e-9 + (shift or {}).get(topic, 0.0)
            values = np.array([value for _, value in found[name]], dtype=np.float64)
            values = values * (scale or {}).get(called, 1.0) + (offset or {}).get(called, 0.0)
            channels[text].append(Channel(called, seconds, values, text))
    return to_logs([c for text in states for c in channels[text]], [c for text in actions for c in channels[text]],
                   period, most_gap=most_gap)


def bag_topics(path: str | os.PathLike[str], messages: Sequence[str | os.PathLike[str]] = ()) -> list[dict[str, Any]]:
    """Topics with type, number of messages and median rate [1/s]: what to name in read_bag."""
    with _open(pathlib.Path(path), messages) as reader:
        stamps: dict[str, list[int]] = defaultdict(list)
        for connection, stamp, _ in reader.messages():
            stamps[connection.topic].append(stamp)
        found = []
        for connection in reader.connections:
            steps = np.diff(np.array(stamps[connection.topic], dtype=np.int64)) * 1e-9
            rate = 1 / float(np.median(steps)) if len(steps) and np.median(steps) > 0 else 0.0
            found.append({"topic": connection.topic, "type": connection.msgtype,
                          "messages": len(stamps[connection.topic]), "rate": rate})
        return found


Samples = dict[str, dict[str, list[tuple[int, float]]]]


def _first_stamp(samples: Samples) -> int:
    return min(rows[0][0] for channels in samples.values() for rows in channels.values() if rows)


def _split(text: str) -> tuple[str, str]:
    topic, colon, field = text.partition(":")
    if not colon or not topic or not field:
        raise UsageError(f"got '{text}', wanted TOPIC:FIELD, such as /joint_states:position")
    return topic, field


def _called(name: str, renamed: Mapping[str, str]) -> str:
    if name in renamed:
        return renamed[name]
    parts = name.split("/")
    if len(parts) == 3 and parts[0] == "joint" and parts[1] in renamed:
        return "/".join([parts[0], renamed[parts[1]], parts[2]])
    return name


def _open(path: pathlib.Path, messages: Sequence[str | os.PathLike[str]]) -> Any:
    if not path.exists():
        raise DataError(f"no bag at '{path}'; check the path")
    reader_module = need("rosbags.highlevel", "a bag", "rosbags")
    typesys: Any = need("rosbags.typesys", "a bag", "rosbags")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for given in messages:
        folder = pathlib.Path(given)
        for file in [folder] if folder.is_file() else sorted(folder.rglob("*.msg")):
            # package/msg/Type.msg is package/msg/Type
            kind = "/".join([file.parent.parent.name, "msg", file.stem]) if file.parent.name == "msg" else file.stem
            store.register(typesys.get_types_from_msg(file.read_text(encoding="utf-8"), kind))
    try:
        return reader_module.AnyReader([path], default_typestore=store)
    except Exception as e:  # the library raises many kinds
        raise DataError(f"'{path}': rosbags cannot open it ({e}); is it a bag's folder, a .bag or a .mcap file?") from e


def _read(path: pathlib.Path, topics: set[str], wanted: Sequence[tuple[str, str]], time: str,
          messages: Sequence[str | os.PathLike[str]]) -> Samples:
    samples: Samples = {f"{topic}:{field}": {} for topic, field in wanted}
    fields: dict[str, list[str]] = defaultdict(list)
    for topic, field in wanted:
        if field not in fields[topic]:
            fields[topic].append(field)
    try:
        with _open(path, messages) as reader:
            connections = [c for c in reader.connections if c.topic in topics]
            missing = topics - {c.topic for c in connections}
            if missing:
                raise DataError(f"'{path}' has no topic '{min(missing)}'; it has "
                                f"{', '.join(sorted({c.topic for c in reader.connections}))}")
            for connection, stamp, raw in reader.messages(connections=connections):
                message = reader.deserialize(raw, connection.msgtype)
                when = _stamp(message, stamp) if time == "header" else stamp
                for field in fields[connection.topic]:
                    _take(samples[f"{connection.topic}:{field}"], message, connection.topic, field, when)
    except (DataError, UsageError):
        raise
    except Exception as e:
        raise DataError(f"'{path}': rosbags cannot read it ({type(e).__name__}: {e}); is the recording complete?") from e
    return samples


def _stamp(message: Any, recorded: int) -> int:
    header = getattr(message, "header", None)
    if header is None or (header.stamp.sec == 0 and header.stamp.nanosec == 0):
        return recorded  # a stamp that nobody set
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def _take(into: dict[str, list[tuple[int, float]]], message: Any, topic: str, field: str, when: int) -> None:
    plain, bracket, rest = field.partition("[")
    value = message
    for part in plain.split("."):
        try:
            value = getattr(value, part)
        except AttributeError as e:
            raise UsageError(f"'{topic}' has no field '{plain}'; the message has "
                             f"{', '.join(k for k in vars(value) if not k.startswith('_'))}") from e
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
    by_name = getattr(message, "name", None) if plain in JOINT_FIELDS else None
    if by_name is not None and len(by_name) == len(numbers):
        labels = [f"joint/{joint}/{JOINT_FIELDS[plain]}" for joint in by_name]
    else:
        labels = [f"{topic}:{plain}" if np.ndim(value) == 0 else f"{topic}:{plain}[{i}]" for i in range(len(numbers))]
    chosen = range(len(numbers)) if not bracket else [int(rest.rstrip("]"))]
    for i in chosen:
        if i >= len(numbers):
            raise UsageError(f"'{topic}:{field}': the message has {len(numbers)} numbers")
        into.setdefault(labels[i], []).append((when, float(numbers[i])))
