"""What a call was given, looked at before the compiled module sees it: one line says what is wrong with it."""

import os
import pathlib
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oted.errors import UsageError


def numbers(what: str, given: Any) -> NDArray[np.float64]:
    """An array of any shape."""
    try:
        array = np.asarray(given)
        if np.iscomplexobj(array):
            raise TypeError("they are complex")
        return np.asarray(array, dtype=np.float64, order="C")
    except (TypeError, ValueError) as e:
        raise UsageError(f"{what}: got {_short(given)}, wanted numbers ({e})") from e


def number(what: str, given: Any) -> float:
    if isinstance(given, bool) or not isinstance(given, (int, float, np.number, np.ndarray)) or np.ndim(given) != 0:
        raise UsageError(f"{what}: got {_short(given)}, wanted a number")
    return float(numbers(what, given))


def whole(what: str, given: Any, least: int) -> int:
    if isinstance(given, bool) or not isinstance(given, (int, np.integer)) or given < least:
        raise UsageError(f"{what}: got {_short(given)}, wanted a whole number of at least {least}")
    return int(given)


def folder(what: str, given: Any) -> pathlib.Path:
    """Of a run, there or not."""
    if not isinstance(given, (str, os.PathLike)) or not os.fspath(given) or "\0" in str(os.fspath(given)):
        raise UsageError(f"{what}: got {_short(given)}, wanted the path of a folder")
    path = pathlib.Path(os.fspath(given))
    if path.exists() and not path.is_dir():
        raise UsageError(f"{what}: '{path}' is a file; name a folder")
    return path


def texts(what: str, given: Any, example: str) -> list[str]:
    """A list of names; a text by itself is none."""
    found = listed(what, given, f"a list of names, such as {example}")
    if isinstance(given, str) or not all(isinstance(name, str) for name in found):
        raise UsageError(f"{what}: got {_short(given)}, wanted a list of names, such as {example}")
    return found


def listed(what: str, given: Any, wanted: str) -> list[Any]:
    if not isinstance(given, Iterable):
        raise UsageError(f"{what}: got {_short(given)}, wanted {wanted}")
    return list(given)


def _short(given: Any) -> str:
    text = " ".join(repr(given).split())
    return text if len(text) < 60 else f"{type(given).__name__} {text[:50]}..."
