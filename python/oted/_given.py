"""What a call was given, looked at before the compiled module sees it: one line says what is wrong with it."""

import datetime
import os
import pathlib
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oted.errors import UsageError

MOST_INT = 2**31 - 1
MOST_SEED = 2**64 - 1
# What NumPy makes a number of, though it is none.
_TIMES = (datetime.date, datetime.timedelta, np.datetime64, np.timedelta64)
_FLAGS = (int, float, np.bool_, np.integer, np.floating)


def unmasked(what: str, given: Any) -> Any:
    """The same, where no element is masked: NumPy would take what lies below the mask."""
    row = _masked_row(given)
    if row is not None:
        raise UsageError(f"{what}: row {row} is masked, wanted numbers without a mask; fill such rows in, or leave them out")
    return given


def _masked_row(given: Any) -> int | None:
    if isinstance(given, np.ma.MaskedArray):
        hidden = np.atleast_1d(np.ma.getmaskarray(given))
        return int(np.argwhere(hidden)[0][0]) if hidden.any() else None
    if isinstance(given, (list, tuple)):
        return next((row for row, one in enumerate(given) if isinstance(one, (list, tuple, np.ma.MaskedArray))
                     and _masked_row(one) is not None), None)
    return None


def numbers(what: str, given: Any, wanted: str = "numbers") -> NDArray[np.float64]:
    """An array of any shape."""
    unmasked(what, given)
    try:
        array = np.asarray(given)
        loses = _what_is_lost(array)
        if loses is not None:
            raise TypeError(loses)
        return np.asarray(array, dtype=np.float64, order="C")
    except (TypeError, ValueError, OverflowError) as e:
        raise UsageError(f"{what}: got {short(given)}, wanted {wanted} ({e})") from e


def _what_is_lost(array: NDArray[Any]) -> str | None:
    is_object = array.dtype.kind == "O"
    if np.iscomplexobj(array) or (is_object and any(isinstance(v, (complex, np.complexfloating)) for v in array.flat)):
        return "they are complex"
    if array.dtype.kind in "mM" or (is_object and any(isinstance(v, _TIMES) for v in array.flat)):
        return "they are times"
    return None


def number(what: str, given: Any) -> float:
    if (not isinstance(given, (int, float, np.number, np.ndarray)) or np.ndim(given) != 0
            or np.asarray(given).dtype.kind == "b"):
        raise UsageError(f"{what}: got {short(given)}, wanted a number")
    return float(numbers(what, given))


def finite(what: str, given: Any, remedy: str = "") -> float:
    value = number(what, given)
    if not np.isfinite(value):
        raise UsageError(f"{what}: got {short(given)}, wanted a finite number" + (f"; {remedy}" if remedy else ""))
    return value


def seconds(what: str, given: Any) -> float:
    value = number(what, given)
    if not 0 < value < np.inf:
        raise UsageError(f"{what}: got {short(given)}, wanted seconds, above 0")
    return value


def whole(what: str, given: Any, least: int, most: int = MOST_INT) -> int:
    if isinstance(given, bool) or not isinstance(given, (int, np.integer)) or not least <= given <= most:
        too_much = isinstance(given, (int, np.integer)) and given > most
        wanted = f"from {least} to {most}" if too_much else f"of at least {least}"
        raise UsageError(f"{what}: got {short(given)}, wanted a whole number {wanted}")
    return int(given)


def seed(given: Any) -> int:
    return whole("seed", given, 0, MOST_SEED)


def flags(what: str, given: Any, each: str = "row") -> NDArray[np.bool_]:
    """Of an array or a list: booleans, or numbers that are 0 or 1. each: what one of them is of."""
    unmasked(what, given)
    array = np.asarray(given) if hasattr(given, "__array__") else None
    if array is not None and array.ndim == 1 and array.dtype.kind in "biuf":
        every: Any = array
        is_flag = (array == 0) | (array == 1)
    else:
        every = listed(what, given, f"a flag for each {each}, True or False")
        is_flag = np.array([isinstance(flag, _FLAGS) and flag in (0, 1) for flag in every], dtype=bool)
    if not is_flag.all():
        i = int(np.argmin(is_flag))
        raise UsageError(f"{what}: got {short(every[i])} in {each} {i}, wanted True or False, or 1 or 0")
    return np.asarray(every, dtype=bool)


def text(what: str, given: Any, wanted: str = "a text") -> str:
    if not isinstance(given, str):
        raise UsageError(f"{what}: got {short(given)}, wanted {wanted}")
    try:
        given.encode()
    except UnicodeEncodeError as e:
        raise UsageError(f"{what}: got {short(given)}, wanted a text that UTF-8 can hold; name it anew") from e
    return given


def path(what: str, given: Any, wanted: str = "the path of a file") -> str:
    found = os.fspath(given) if isinstance(given, (str, os.PathLike)) else given
    if not isinstance(found, str) or not found or "\0" in found:
        raise UsageError(f"{what}: got {short(given)}, wanted {wanted}")
    return text(what, found)


def paths(what: str, given: Any) -> list[str]:
    """A list of files or folders; a path by itself is none."""
    if isinstance(given, (str, os.PathLike)):
        raise UsageError(f"{what}: got {short(given)}, wanted a list of paths")
    return [path(what, one) for one in listed(what, given, "a list of paths")]


def folder(what: str, given: Any) -> pathlib.Path:
    """Of a run, there or not."""
    found = pathlib.Path(path(what, given, "the path of a folder"))
    if found.exists() and not found.is_dir():
        raise UsageError(f"{what}: '{found}' is a file; name a folder")
    return found


def texts(what: str, given: Any, example: str) -> list[str]:
    """A list of names; a text by itself is none."""
    found = listed(what, given, f"a list of names, such as {example}")
    if isinstance(given, str) or not all(isinstance(name, str) for name in found):
        raise UsageError(f"{what}: got {short(given)}, wanted a list of names, such as {example}")
    return [text(what, name) for name in found]


def listed(what: str, given: Any, wanted: str) -> list[Any]:
    if not isinstance(given, Iterable) or (isinstance(given, np.ndarray) and given.ndim == 0):
        raise UsageError(f"{what}: got {short(given)}, wanted {wanted}")
    return list(given)


def by_name(what: str, given: Any, example: str) -> dict[str, Any]:
    """A dict whose keys are texts; nothing for None."""
    if given is None:
        return {}
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        raise UsageError(f"{what}: got {short(given)}, wanted a dict such as {example}")
    return {text(what, key): value for key, value in given.items()}


def numbers_by_name(what: str, given: Any, example: str) -> dict[str, float]:
    return {name: finite(f"{what}: '{name}'", value) for name, value in by_name(what, given, example).items()}


def texts_by_name(what: str, given: Any, example: str) -> dict[str, str]:
    return {name: text(f"{what}: '{name}'", value) for name, value in by_name(what, given, example).items()}


def known(what: str, names: Iterable[str], there: Collection[str], kind: str = "channel") -> None:
    """Refuses a name of something that is not there, which would change nothing."""
    for name in names:
        if name not in there:
            raise UsageError(f"{what}: no {kind} '{name}'; there are {', '.join(there) or 'none'}")


def function(what: str, given: Any, example: str) -> None:
    if given is not None and not callable(given):
        raise UsageError(f"{what}: got {short(given)}, wanted a function, {example}")


def short(given: Any) -> str:
    try:
        shown = " ".join(repr(given).split())
    except Exception:  # such as an integer of too many digits
        return type(given).__name__
    return shown if len(shown) < 60 else f"{type(given).__name__} {shown[:50]}..."
