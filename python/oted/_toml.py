"""Configurations as TOML text, in the words of docs/configuration.md."""

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from oted import _given
from oted.errors import UsageError


def value(v: Any, what: str = "setting") -> str:
    """One value as TOML has it; a mapping becomes an inline table. what: how errors call it."""
    if isinstance(v, (bool, np.bool_)):
        return "true" if v else "false"
    if isinstance(v, (str, os.PathLike)):
        return json.dumps(_given.text(what, os.fspath(v)), ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(v, (int, np.integer)):
        return str(int(v))
    if isinstance(v, (float, np.floating)):
        return repr(float(v))
    if isinstance(v, Mapping):
        return "{ " + ", ".join(f"{value(str(k), what)} = {value(x, what)}" for k, x in v.items()) + " }"
    if isinstance(v, (Sequence, np.ndarray)):
        return "[" + ", ".join(value(x, what) for x in v) + "]"
    raise UsageError(f"{what}: got {type(v).__name__}, wanted a number, a text, a list or a dict of these")


def section(name: str, entries: Mapping[str, Any]) -> str:
    """A table; entries that are None are left out."""
    lines = [f"{value(key, name)} = {value(v, str(key))}" for key, v in entries.items() if v is not None]
    return f"[{name}]\n" + "\n".join(lines) + "\n"


def assignments(settings: Mapping[str, Any] | None) -> list[str]:
    """Settings as --set has them: {"design.method": "paper"} is design.method=paper."""
    words = []
    if not isinstance(settings or {}, Mapping):
        raise UsageError(f"settings: got {settings!r}, wanted a dict as {{'design.method': 'paper'}}")
    for key, v in (settings or {}).items():
        if not isinstance(key, str) or "." not in key:
            raise UsageError(f"settings: got {key!r}, wanted section.key as in docs/configuration.md, 'design.method'")
        words.append(_given.text("settings", f"{key}={v if isinstance(v, str) else value(v)}"))
    return words
