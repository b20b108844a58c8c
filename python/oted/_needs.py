"""Packages that only some functions need."""

import importlib
from types import ModuleType

from oted.errors import MissingPackage


def need(module: str, what: str, package: str | None = None) -> ModuleType:
    """The module, or an error with the pip line that gets it."""
    try:
        return importlib.import_module(module)
    except ImportError as e:
        name = package or module.partition(".")[0]
        raise MissingPackage(f"{what} needs {name}, which cannot be imported ({e}): pip install {name}") from e
