"""Numbers and times of decoded messages, whatever decoded them: ROS messages, protobuf messages, and JSON's objects."""

import datetime
import numbers
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from oted.errors import DataError, UsageError

# What the fields of a joint are called in a task.
JOINT_FIELDS = {"position": "qpos", "velocity": "qvel", "effort": "qfrc_actuator"}
# Fields beside an array that name its numbers.
NAMES = ("name", "names", "joint_names")
# Where a message says when it was measured.
STAMPS = (("header", "stamp"), ("header", "timestamp"), ("stamp",), ("timestamp",))
# How the two numbers of a time are called: ROS 2, ROS 1, protobuf, JSON in Foxglove's schemas.
CLOCKS = (("sec", "nanosec"), ("secs", "nsecs"), ("seconds", "nanos"), ("sec", "nsec"))
NANOSECONDS = 1_000_000_000

Step = str | int


class _Missing:
    """What a message does not have, though another of its topic may."""


MISSING = _Missing()


def steps_of(path: str) -> list[Step]:
    """"joints[2].position" is joints, 2, position. @throws UsageError"""
    steps: list[Step] = []
    for part in path.split("."):
        found = re.fullmatch(r"([^\[\]]+)((?:\[\d+\])*)", part)
        if found is None:
            raise UsageError(f"field '{path}': wanted names and indices, such as position, data[2] or joints.position")
        steps += [found[1], *(int(index) for index in re.findall(r"\d+", found[2]))]
    return steps


def names_of(message: Any) -> list[str]:
    """The fields of a message."""
    if isinstance(message, Mapping):
        return [str(name) for name in message]
    descriptor = getattr(message, "DESCRIPTOR", None)
    if descriptor is not None:
        return [field.name for field in descriptor.fields]
    return [name for name in getattr(message, "__dict__", {}) if not name.startswith("_")]


def _has(message: Any, name: str) -> bool:
    """Whether messages of this one's type have the field."""
    if isinstance(message, Mapping):
        return name in message
    descriptor = getattr(message, "DESCRIPTOR", None)
    if descriptor is not None:
        return name in descriptor.fields_by_name
    return not name.startswith("_") and name in getattr(message, "__dict__", {})


def _child(message: Any, name: str) -> Any:
    """A field, or MISSING. @throws UsageError where no message of the type has it"""
    if isinstance(message, Mapping):
        return message.get(name, MISSING)
    descriptor = getattr(message, "DESCRIPTOR", None)
    if descriptor is not None:
        field = descriptor.fields_by_name.get(name)
        if field is not None:
            return MISSING if field.has_presence and not message.HasField(name) else getattr(message, name)
    elif _has(message, name):
        return getattr(message, name)
    raise UsageError(f"no field '{name}'; there are {', '.join(names_of(message)) or 'none'}")


def _is_message(value: Any) -> bool:
    return isinstance(value, Mapping) or hasattr(value, "DESCRIPTOR") or hasattr(value, "__dataclass_fields__")


def _is_list(value: Any) -> bool:
    return isinstance(value, np.ndarray) or (isinstance(value, Sequence) and not isinstance(value, (str, bytes)))


def _is_number(value: Any) -> bool:
    return isinstance(value, (float, int, numbers.Real, np.bool_))  # the first two are quick


def _is_map(value: Any) -> bool:
    """Numbers by name: an object of JSON, a map of protobuf."""
    return isinstance(value, Mapping) and bool(value) and all(_is_number(one) for one in value.values())


def _names_beside(owner: Any, n: int) -> list[str] | None:
    """What a message calls the n numbers of an array of its own."""
    for name in NAMES:
        if not _has(owner, name):
            continue
        found = _child(owner, name)
        if _is_list(found) and len(found) == n and all(isinstance(one, str) for one in found):
            return [str(one) for one in found]
    return None


def _own_name(message: Any) -> str | None:
    """What one of several messages in a list calls itself."""
    if not _has(message, "name"):
        return None
    name = _child(message, "name")
    return name if isinstance(name, str) and name else None


class _Walk:
    """Follows a path through a message, every element of a list that it meets, and collects what lies at its end."""

    def __init__(self, topic: str, steps: Sequence[Step]) -> None:
        self._topic = topic
        self._steps = steps
        self.found: list[tuple[str, float]] = []

    def follow(self, value: Any, at: int, label: str, owner: Any, element: str | None) -> None:
        """at: how many steps are done; element: the name of the list's element that holds the value."""
        if value is MISSING or value is None:
            return
        if at == len(self._steps):
            self._end(value, label, owner, element)
            return
        step = self._steps[at]
        if isinstance(step, int):
            self._pick(value, step, at, label, owner)
        elif _is_message(value):
            child = f"{label}.{step}" if label else step
            self.follow(_child(value, step), at + 1, child, value, element)
        elif _is_list(value):
            for i, one in enumerate(value):
                name = _own_name(one) if _is_message(one) else None
                self.follow(one, at, f"{label}[{i if name is None else name}]", owner, name)
        else:
            raise UsageError(f"'{label}' has no field '{step}', as it is {type(value).__name__}")

    def _pick(self, value: Any, index: int, at: int, label: str, owner: Any) -> None:
        if not _is_list(value):
            raise UsageError(f"'{label}' is no list, so there is no '{label}[{index}]'")
        if index >= len(value):
            raise UsageError(f"'{label}' has {len(value)} numbers, so there is no '{label}[{index}]'")
        if at + 1 < len(self._steps) or not _is_number(value[index]):
            self.follow(value[index], at + 1, f"{label}[{index}]", owner, None)
            return
        names = _names_beside(owner, len(value))
        self._add(value[index], label, names[index] if names else None, f"[{index}]")

    def _end(self, value: Any, label: str, owner: Any, element: str | None) -> None:
        if _is_number(value):
            self._add(value, label, element, "", inside=True)
        elif _is_map(value):
            for name, one in value.items():
                self._add(one, label, str(name), f".{name}")
        elif _is_list(value):
            names = _names_beside(owner, len(value))
            for i, one in enumerate(value):
                self._number(one, f"{label}[{i}]")
                self._add(one, label, names[i] if names else None, f"[{i}]")
        else:
            self._number(value, label)

    def _number(self, value: Any, label: str) -> None:
        if _is_number(value):
            return
        if _is_message(value):
            raise UsageError(f"'{label}' is a message, wanted a number; name a field of it: "
                             f"{', '.join(names_of(value)) or 'it has none'}")
        raise UsageError(f"'{label}' holds {type(value).__name__}, wanted numbers")

    def _add(self, value: Any, label: str, name: str | None, suffix: str, inside: bool = False) -> None:
        """inside: the name is in the label already."""
        field = label.rpartition(".")[2]
        if name is not None and field in JOINT_FIELDS:
            channel = f"joint/{name}/{JOINT_FIELDS[field]}"
        elif name is not None and not inside:
            channel = f"{self._topic}:{label}[{name}]"
        else:
            channel = f"{self._topic}:{label}{suffix}"
        self.found.append((channel, float(value)))


def channels(message: Any, topic: str, steps: Sequence[Step]) -> list[tuple[str, float]]:
    """What lies at the end of a path, by the channel's name; nothing where this message lacks it.

    Arrays, the elements of lists and the entries of maps are a channel each. Numbers that a message names go by their
    names, whatever their order: joint/NAME/qpos, qvel and qfrc_actuator of joints, else TOPIC:FIELD[NAME].
    @throws UsageError where no message of the type has such numbers"""
    walk = _Walk(topic, steps)
    walk.follow(message, 0, "", message, None)
    return walk.found


def _field_of(value: Any, path: Sequence[str]) -> Any:
    for name in path:
        if not _is_message(value) or not _has(value, name):
            return MISSING
        value = _child(value, name)
    return value


def nanoseconds(value: Any) -> int | None:
    """A time with a unit: two numbers, as ROS and protobuf have it, or the text of a moment, as protobuf's JSON has it."""
    if isinstance(value, str):
        found = re.fullmatch(r"(\d{4}-\d\d-\d\d[Tt]\d\d:\d\d:\d\d)(?:\.(\d{1,9})\d*)?([Zz]|[+-]\d\d:\d\d)", value)
        if found is None:
            return None
        moment = datetime.datetime.fromisoformat(found[1] + ("+00:00" if found[3] in "Zz" else found[3]))
        return int(moment.timestamp()) * NANOSECONDS + int((found[2] or "0").ljust(9, "0"))
    if not _is_message(value):
        return None
    for whole, part in CLOCKS:
        if _has(value, whole) and _has(value, part):
            return int(_child(value, whole)) * NANOSECONDS + int(_child(value, part))
    return None


def header_stamp(message: Any) -> int | None:
    """When a message says that it was measured [ns]; nothing where it does not, or where nobody set its stamp."""
    for path in STAMPS:
        stamp = nanoseconds(_field_of(message, path))
        if stamp:
            return stamp
    return None


def stamp_at(message: Any, topic: str, path: str) -> int:
    """The time in a field [ns]. A number counts as seconds. @throws DataError"""
    value = _field_of(message, path.split("."))
    if _is_number(value) and np.isfinite(value):
        return round(float(value) * NANOSECONDS)
    stamp = nanoseconds(value)
    if stamp is None:
        raise DataError(f"a message of topic '{topic}' has no time in field '{path}', wanted seconds or a time stamp")
    return stamp


def number_paths(message: Any) -> Iterator[str]:
    """Every path of a message at whose end there are numbers."""
    def below(value: Any, path: str, depth: int) -> Iterator[str]:
        if _is_number(value) or _is_map(value):
            yield path
        elif nanoseconds(value) is not None or depth > 8:
            return
        elif _is_list(value):
            if isinstance(value, np.ndarray) or all(_is_number(one) for one in value):
                yield from [path] if len(value) else []
            elif all(_is_message(one) for one in value):
                yield from below(value[0], path, depth + 1)
            else:
                for i, one in enumerate(value):
                    yield from below(one, f"{path}[{i}]", depth + 1)
        elif _is_message(value):
            for name in names_of(value):
                yield from below(_child(value, name), f"{path}.{name}" if path else name, depth + 1)

    yield from below(message, "", 0)
