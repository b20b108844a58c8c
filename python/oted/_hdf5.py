"""HDF5 by h5py, for the compiled module (python/h5py_files.cc). Refuses what the program's own reader refuses: links to
other files, and arrays that claim more than a file of this size can hold."""

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oted._needs import need
from oted.errors import DataError

MOST_COMPRESSION = 1100  # a byte of deflate holds at most 1,032
MOST_BYTES = 1 << 36
DAMAGED = "the file is damaged: download or write it again"


class Reader:
    """The arrays of an open file."""

    def __init__(self, path: str) -> None:
        self._h5py: Any = need("h5py", "reading HDF5")
        self._path = path
        if not self._h5py.is_hdf5(path):
            raise DataError(f"'{path}' is not an HDF5 file; give a dataset in D4RL's or Minari's layout, .npz or .csv")
        try:
            self._file = self._h5py.File(path, "r")
        except OSError as e:
            raise DataError(f"'{path}' is an HDF5 file that cannot be opened ({e}); download or write it again") from e
        self._bytes = os.path.getsize(path)

    def _fail(self, name: str, what: str, remedy: str) -> DataError:
        return DataError(f"'{self._path}': {name} {what}; {remedy}")

    def has(self, name: str) -> bool:
        group = self._file
        parts = name.split("/")
        for depth, part in enumerate(parts):
            if not isinstance(group, self._h5py.Group) or part not in group:
                return False
            if isinstance(group.get(part, getlink=True), self._h5py.ExternalLink):
                raise self._fail("/".join(parts[:depth + 1]), "is a link to another file",
                                 "copy that file's content into this one")
            group = group[part]
        return True

    def is_group(self, name: str) -> bool:
        return isinstance(self._file[name], self._h5py.Group)

    def holds_bytes(self, name: str) -> bool:
        return bool(self._array(name).dtype == np.uint8)

    def names(self, group: str) -> list[str]:
        return sorted(self._file[group].keys(), key=lambda text: text.encode())

    def shape(self, name: str) -> list[int]:
        array = self._array(name)
        if array.dtype.kind not in "fiub":
            raise self._fail(name, "does not hold numbers", "store it as float, integer or bool")
        if array.ndim < 1:
            raise self._fail(name, "is not an array", "store one row per transition")
        if array.is_virtual or array.external:
            raise self._fail(name, "keeps its values in other files", "copy them into this one")
        size = array.nbytes
        stored = array.id.get_storage_size()
        most = stored * (MOST_COMPRESSION if array.compression else 1)
        if size > MOST_BYTES or stored > self._bytes or size > max(most, 1 << 16):
            raise self._fail(name, f"claims {size} bytes but stores {stored} in a file of {self._bytes}", DAMAGED)
        return list(array.shape)

    def read(self, name: str) -> NDArray[np.float64]:
        return np.ascontiguousarray(self._array(name)[()], dtype=np.float64)

    def _array(self, name: str) -> Any:
        array = self._file[name]
        if not isinstance(array, self._h5py.Dataset):
            raise self._fail(name, "is not an array", "flatten nested spaces into one array, as D4RL's layout wants")
        return array


class Writer:
    """The arrays of one new file."""

    def __init__(self, path: str) -> None:
        h5py: Any = need("h5py", "writing HDF5")
        try:
            self._file = h5py.File(path, "w")
        except OSError as e:
            raise DataError(f"'{path}': cannot be written ({e}); is its folder writable?") from e

    def group(self, name: str) -> None:
        self._file.create_group(name)

    def attribute(self, group: str, name: str, value: int) -> None:
        self._file[group].attrs[name] = np.int64(value)

    def write(self, name: str, values: NDArray[np.float64], shape: list[int], kind: str) -> None:
        width = int(np.prod(shape[1:]))
        chunk = (min(max(64000 // max(width, 1), 1), shape[0]), *shape[1:])
        self._file.create_dataset(name, data=values.reshape(shape).astype(kind), chunks=chunk, shuffle=True,
                                  compression="gzip", compression_opts=4, track_times=False)

    def close(self) -> None:
        self._file.close()
