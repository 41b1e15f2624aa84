"""PC2 point caches, and PC16: CLOTH3D's variant of them with half-precision numbers."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError

_HEADER = struct.Struct("<12siiffi")
"""Signature, version, number of points, start frame, sample rate, number of samples."""

_SIGNATURE = b"POINTCACHE2\0"


def read_point_cache(path: Path) -> NDArray[np.float32]:
    """Vertices (T, N, 3) in a .pc2 (float32) or .pc16 (float16) file.

    Raises GarmentcError where the file is no point cache or is cut short.
    """
    kind: type[np.floating[Any]] = np.float16 if path.suffix.lower() == ".pc16" else np.float32
    try:
        data = path.read_bytes()
    except OSError as error:
        raise GarmentcError(f"cannot be read: {error.strerror or error}", path) from None
    if len(data) < _HEADER.size or not data.startswith(_SIGNATURE[:11]):
        raise GarmentcError("is no point cache: it does not start with POINTCACHE2", path)
    _, _, points, _, _, samples = _HEADER.unpack_from(data)
    size = points * samples * 3 * np.dtype(kind).itemsize
    if points < 0 or samples < 0 or len(data) - _HEADER.size < size:
        raise GarmentcError(f"is cut short: it says {samples} frames of {points} points", path)
    values = np.frombuffer(data, kind, points * samples * 3, _HEADER.size).astype(np.float32)
    if not np.isfinite(values).all():
        raise GarmentcError("holds NaN or infinity", path)
    return values.reshape(samples, points, 3)
