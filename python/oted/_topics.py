"""What every recording is: topics and their messages."""

import os
from collections.abc import Sequence
from typing import Any, NamedTuple

Paths = Sequence[str | os.PathLike[str]]


class Topic(NamedTuple):
    name: str
    type: str
    encoding: str  # as MCAP calls it: protobuf, json, cdr, ros1


class Message(NamedTuple):
    topic: str
    recorded: int  # [ns]
    published: int  # [ns]; where a format has no such time, recorded
    value: Any
