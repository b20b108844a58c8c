"""ROS 1 and ROS 2 bags, and definitions of ROS messages, by rosbags. No ROS."""

import pathlib
from collections.abc import Collection, Iterator
from typing import Any

from oted._needs import need
from oted._topics import Message, Paths, Topic
from oted.errors import DataError, Error


def _store(messages: Paths) -> Any:
    """ROS 2's common types, and those of the user's files."""
    typesys: Any = need("rosbags.typesys", "a bag", "rosbags")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for given in messages:
        folder = pathlib.Path(given)
        for file in [folder] if folder.is_file() else sorted(folder.rglob("*.msg")):
            # package/msg/Type.msg is package/msg/Type
            kind = "/".join([file.parent.parent.name, "msg", file.stem]) if file.parent.name == "msg" else file.stem
            store.register(typesys.get_types_from_msg(file.read_text(encoding="utf-8"), kind))
    return store


def typestore(messages: Paths, definition: str, kind: str, encoding: str) -> tuple[Any, str]:
    """What decodes one type of messages, and what it calls it. encoding: of the definition, ros1msg, ros2msg or ros2idl;
    without a definition the common types and the user's files must have it."""
    typesys: Any = need("rosbags.typesys", "a topic of ROS messages", "rosbags")
    parts = kind.split("/")
    name = f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else kind
    if not definition:
        return _store(messages), name
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    if encoding == "ros2idl":
        types: dict[str, Any] = {}
        separator = "=" * 80 + "\n"
        for text in definition.split(separator) if definition.startswith(f"{separator}IDL: ") else [definition]:
            if text:
                types.update(typesys.get_types_from_idl(text.partition("\n")[2] if text.startswith("IDL: ") else text))
    else:
        types = typesys.get_types_from_msg(definition, name)
    store.register(types)
    return store, name


class RosBag:
    """A bag's folder, or a .bag. Use it in a with statement."""

    has_publish_times = False

    def __init__(self, path: pathlib.Path, messages: Paths) -> None:
        self._path = path
        reader: Any = need("rosbags.highlevel", "a bag", "rosbags")
        store = _store(messages)
        try:
            self._reader = reader.AnyReader([path], default_typestore=store)
        except Exception as e:  # the library raises many kinds
            raise DataError(f"'{path}': rosbags cannot open it ({e}); is it a bag's folder, a .bag or a .mcap file?") from e

    def __enter__(self) -> "RosBag":
        try:
            self._reader.open()
        except Exception as e:
            raise DataError(f"'{self._path}': rosbags cannot open it ({type(e).__name__}: {e}); is the recording "
                            "complete?") from e
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.close()

    def topics(self) -> list[Topic]:
        encoding = "cdr" if self._reader.is2 else "ros1"
        found = {c.topic: Topic(c.topic, c.msgtype, encoding) for c in self._reader.connections}
        return [found[name] for name in sorted(found)]

    def messages(self, topics: Collection[str], *, decoded: bool = True) -> Iterator[Message]:
        try:
            connections = [c for c in self._reader.connections if c.topic in topics]
            for connection, stamp, raw in self._reader.messages(connections=connections):
                value = self._reader.deserialize(raw, connection.msgtype) if decoded else None
                yield Message(connection.topic, stamp, stamp, value)
        except Error:
            raise
        except Exception as e:
            raise DataError(f"'{self._path}': rosbags cannot read it ({type(e).__name__}: {e}); is the recording "
                            "complete?") from e
