"""Arrays out of files that nobody has checked yet: read without running anything, then checked by name and shape."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError

LARGEST_ARRAY = 2**30
"""Bytes. The largest array of a real body file (SMPL-X posedirs, float64) takes an eighth of it."""

Shape = tuple[int | str, ...]
"""An expected shape: numbers are exact, letters stand for any size."""


def read_npz(path: Path, wanted: Iterable[str]) -> dict[str, NDArray[Any]]:
    """Those of the `wanted` arrays that the .npz file holds. Other arrays are not even unpacked.

    Raises GarmentcError where the file is no .npz, or a wanted array is damaged, huge, or made of Python objects.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            return {key: _read_member(archive, members[key], key, path) for key in wanted if key in members}
    except OSError as error:
        raise GarmentcError(f"cannot be read: {error.strerror or error}", path) from None
    except zipfile.BadZipFile:
        raise GarmentcError("is not a whole .npz file; write it again with numpy.savez", path) from None


def _read_member(archive: zipfile.ZipFile, info: zipfile.ZipInfo, key: str, path: Path) -> NDArray[Any]:
    if info.file_size > LARGEST_ARRAY:
        raise GarmentcError(f"the array '{key}' unpacks to {info.file_size / 2**30:.1f} GiB; the limit is 1 GiB", path)
    try:
        with archive.open(info) as file:
            version = np.lib.format.read_magic(file)
            read_header = (
                np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            )
            dtype = read_header(file)[2]
        if dtype.hasobject:
            raise GarmentcError(
                f"the array '{key}' holds Python objects, which are never loaded; save it as a plain number array", path
            )
        with archive.open(info) as file:
            return np.asarray(np.lib.format.read_array(file, allow_pickle=False))
    except (ValueError, EOFError, MemoryError, RuntimeError, NotImplementedError, zlib.error) as error:
        raise GarmentcError(f"the array '{key}' is damaged ({error}); write the file again", path) from None


def shape_text(shape: Iterable[int | str]) -> str:
    """For messages: "24 x 3"."""
    return " x ".join(map(str, shape)) or "a single number"


def numbers(arrays: Mapping[str, Any], key: str, shape: Shape, path: Path) -> NDArray[np.float64]:
    """`arrays[key]` as float64, checked: there, numeric, of the expected shape, finite.

    Raises GarmentcError naming file, key and both shapes.
    """
    if key not in arrays:
        raise GarmentcError(f"the array '{key}' is missing", path)
    array = np.asarray(arrays[key])
    if array.dtype.kind not in "fiub":
        raise GarmentcError(f"the array '{key}' holds no numbers (dtype {array.dtype})", path)
    fits = array.ndim == len(shape) and all(
        isinstance(want, str) or size == want for size, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        raise GarmentcError(f"'{key}' has shape {shape_text(array.shape)}, expected {shape_text(shape)}", path)
    converted = array.astype(np.float64, copy=False)
    if not np.isfinite(converted).all():
        where = " ".join(map(str, np.argwhere(~np.isfinite(converted))[0]))
        raise GarmentcError(f"'{key}' holds NaN or infinity (first at index {where})", path)
    return converted
