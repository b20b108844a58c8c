"""Loads the compiled module: checks MuJoCo's version first, and tells the module where other packages' files are."""

import ctypes
import importlib
import importlib.metadata
import importlib.util
import pathlib
from types import ModuleType
from typing import TYPE_CHECKING

__all__ = ["core", "folder_of"]

MUJOCO = "4.0.0"  # libmujoco's soname is its full version: no other one loads


def folder_of(package: str) -> pathlib.Path | None:
    """Where a package lies, without importing it."""
    spec = importlib.util.find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        return None
    return pathlib.Path(list(spec.submodule_search_locations)[0])


def _load_mujoco() -> None:
    try:
        found = importlib.metadata.version("mujoco-core")
    except importlib.metadata.PackageNotFoundError:
        found = "none"
    if found != MUJOCO:
        raise ImportError(f"oted needs mujoco-core {MUJOCO}, got {found}: pip install mujoco-core=={MUJOCO}")
    # The module names its library relative to itself, which fails where the two packages lie in different folders.
    folder = folder_of("mujoco")
    library = folder / f"libmujoco.so.{MUJOCO}" if folder else None
    if library is not None and library.is_file():
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)


def _plotly_js() -> pathlib.Path:
    packaged = pathlib.Path(__file__).parent / "plotly" / "plotly.min.js.gz"
    if packaged.is_file():
        return packaged
    folder = folder_of("plotly")
    return (folder or pathlib.Path("plotly")) / "package_data" / "plotly.min.js"


def _load() -> ModuleType:
    _load_mujoco()
    core = importlib.import_module("oted._core")
    gymnasium = folder_of("gymnasium") or pathlib.Path("gymnasium")
    core.set_package_folders(str(gymnasium / "envs/mujoco/assets"), str(gymnasium.parent), str(_plotly_js()))
    return core


if TYPE_CHECKING:
    from oted import _core as core
else:
    core = _load()
