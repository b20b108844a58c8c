"""MCAP files: protobuf, JSON and ROS messages, side by side."""

import json
import pathlib
from collections.abc import Callable, Collection, Iterator
from typing import Any

from oted._needs import need
from oted._rosbags import typestore
from oted._topics import Message, Paths, Topic
from oted.errors import DataError, Error

READABLE = "protobuf, json, cdr (ROS 2) or ros1"
Decoder = Callable[[bytes], Any]


class McapFile:
    """One file. Use it in a with statement."""

    has_publish_times = True

    def __init__(self, path: pathlib.Path, messages: Paths) -> None:
        self._path = path
        self._messages = messages
        self._decoders: dict[int, Decoder] = {}
        self._mcap: Any = need("mcap.reader", "an MCAP file", "mcap")

    def __enter__(self) -> "McapFile":
        try:
            self._file = self._path.open("rb")
        except OSError as e:
            raise DataError(f"'{self._path}' cannot be read: {e.strerror}") from e
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def topics(self) -> list[Topic]:
        """In the order of their names. A topic of several channels counts once."""
        found: dict[str, Topic] = {}
        for schema, channel in self._channels():
            found.setdefault(channel.topic, Topic(channel.topic, schema.name if schema else "", channel.message_encoding))
        return [found[name] for name in sorted(found)]

    def messages(self, topics: Collection[str], *, decoded: bool = True) -> Iterator[Message]:
        """In order of their times of recording. @throws DataError where one cannot be read"""
        counts: dict[str, int] = {}
        for schema, channel, record in self._records(topics):
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            value = None
            if decoded:
                try:
                    if channel.id not in self._decoders:
                        self._decoders[channel.id] = self._decoder(schema, channel)
                    value = self._decoders[channel.id](record.data)
                except Error:
                    raise
                except Exception as e:  # every decoder raises kinds of its own
                    raise DataError(
                        f"'{self._path}': message {counts[channel.topic]} of topic '{channel.topic}' cannot be decoded as "
                        f"{channel.message_encoding} ({type(e).__name__}: {_line(e)}); leave the topic out, or record it "
                        "again") from e
            yield Message(channel.topic, record.log_time, record.publish_time, value)

    def _channels(self) -> list[tuple[Any, Any]]:
        summary = self._guarded(lambda: self._reader().get_summary())
        if summary is not None and summary.channels:
            return [(summary.schemas.get(channel.schema_id), channel) for channel in summary.channels.values()]
        found = {channel.id: (schema, channel) for schema, channel, _ in self._records(None)}
        return [found[key] for key in sorted(found)]

    def _reader(self) -> Any:
        self._file.seek(0)
        return self._mcap.make_reader(self._file, validate_crcs=True)

    def _records(self, topics: Collection[str] | None) -> Iterator[tuple[Any, Any, Any]]:
        records = self._guarded(lambda: iter(self._reader().iter_messages(topics=None if topics is None else set(topics))))
        while (record := self._guarded(lambda: next(records, None))) is not None:
            yield record

    def _guarded(self, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except Exception as e:  # mcap raises many kinds: its own, struct.error, and those of lz4 and zstandard
            what = f"{type(e).__name__}: {_line(e)}"
            raise DataError(f"'{self._path}': mcap cannot read it ({what}): it is damaged, or its recorder did not close it; "
                            f"'mcap recover' keeps what is whole") from e

    def _decoder(self, schema: Any, channel: Any) -> Decoder:
        encoding = channel.message_encoding
        if encoding == "protobuf":
            support: Any = need("mcap_protobuf.decoder", f"topic '{channel.topic}'", "mcap-protobuf-support")
            found: Decoder | None = support.DecoderFactory().decoder_for(encoding, schema)
            if found is None:
                raise DataError(f"'{self._path}': topic '{channel.topic}' holds protobuf messages without a schema, which "
                                "nobody can read; record it with its FileDescriptorSet")
            return found
        if encoding == "json":
            return _from_json
        if encoding in ("cdr", "ros1"):
            store, kind = typestore(self._messages, schema.data.decode() if schema else "", schema.name if schema else "",
                                    schema.encoding if schema else "")
            read = store.deserialize_cdr if encoding == "cdr" else store.deserialize_ros1
            return lambda data: read(data, kind)
        raise DataError(f"'{self._path}': topic '{channel.topic}' holds messages in the encoding '{encoding}', wanted "
                        f"{READABLE}; record or convert it in one of these, or read it yourself for oted.streams.to_logs")


def _from_json(data: bytes) -> Any:
    found = json.loads(data)
    if not isinstance(found, dict):
        raise ValueError(f"got {type(found).__name__}, wanted an object")
    return found


def _line(e: Exception) -> str:
    return " ".join(str(e).split())[:200]
