"""Arrays out of an inert pickle: numpy arrays, scipy sparse matrices and chumpy arrays, built here from their bytes."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.smpl.arrays import LARGEST_ARRAY
from garmentc.smpl.inert_pickle import Call

DEEPEST = 8
"""Chumpy arrays may wrap arrays; real files do so once or twice."""

_PLAIN_TYPE = re.compile(r"[biuf]\d{1,2}|[SU]\d{1,4}")


class _Malformed(Exception):
    """The notes do not describe an array; the message says what they do describe."""


def to_array(value: Any, key: str, path: Path) -> NDArray[Any]:
    """The array (sparse matrices dense) that `value`, an entry of an inert pickle, describes.

    Raises GarmentcError where it describes none.
    """
    try:
        return _array(value, DEEPEST)
    except (_Malformed, ValueError, TypeError, IndexError, KeyError, MemoryError, OverflowError) as error:
        raise GarmentcError(f"'{key}' is no array of numbers ({error})", path) from None


def _array(value: Any, depth: int) -> NDArray[Any]:
    if depth == 0:
        raise _Malformed("nested too deeply")
    if isinstance(value, bool | int | float | str | bytes):
        return np.asarray(value)
    if isinstance(value, list | tuple):
        if not all(isinstance(item, bool | int | float) for item in value):
            raise _Malformed("a list of other things")
        return np.asarray(value)
    if not isinstance(value, Call):
        raise _Malformed(type(value).__name__)
    call = _unwrapped(value)
    name = call.function.name
    if name == "_reconstruct":
        return _numpy_array(call.state)
    if name == "_frombuffer":
        data, dtype, shape, order = call.arguments
        return _from_bytes(data, dtype, shape, fortran=order == "F")
    if name == "scalar":
        dtype, data = call.arguments
        return _from_bytes(data, dtype, (), fortran=False)
    if name.endswith(("_matrix", "_array")):
        return _sparse(name, call.state, depth - 1)
    if name == "Ch":
        return _array(call.state["x"], depth - 1)
    if name == "Select":
        picked: NDArray[Any] = _array(call.state["a"], depth - 1).reshape(-1)[_array(call.state["idxs"], depth - 1)]
        shape = call.state.get("preferred_shape")
        return picked if shape is None else picked.reshape(_shape(_array(shape, depth - 1).tolist()))
    raise _Malformed(str(call.function))


def _unwrapped(call: Call) -> Call:
    """Protocols 0 and 1 make objects through `copy_reg._reconstructor(class, object, None)`."""
    if call.function.name != "_reconstructor":
        return call
    return Call(call.arguments[0], (), call.state)


def _numpy_array(state: Any) -> NDArray[Any]:
    """From ndarray.__setstate__'s argument: version (may be left out), shape, dtype, is_fortran, data."""
    shape, dtype, fortran, data = state[-4:]
    return _from_bytes(data, dtype, shape, bool(fortran))


def _shape(value: Any) -> tuple[int, ...]:
    shape = tuple(value) if isinstance(value, list | tuple) else (value,)
    if not all(isinstance(size, int) and size >= 0 for size in shape) or len(shape) > 8:
        raise _Malformed("its shape makes no sense")
    if math.prod(shape) * 8 > LARGEST_ARRAY:
        raise _Malformed(f"it claims {math.prod(shape)} elements")
    return shape


def _from_bytes(data: Any, dtype: Any, shape: Any, fortran: bool) -> NDArray[Any]:
    plain, sizes, raw = _dtype(dtype), _shape(shape), _bytes(data)
    if plain.itemsize * math.prod(sizes) != len(raw):
        raise _Malformed(f"{len(raw)} bytes for shape {sizes} of {plain}")
    return np.frombuffer(raw, plain).reshape(sizes, order="F" if fortran else "C")


def _dtype(value: Any) -> np.dtype[Any]:
    """From `numpy.dtype('f8', False, True)` and its state, whose second entry is the byte order."""
    name = value.arguments[0]
    if not isinstance(name, str) or not _PLAIN_TYPE.fullmatch(name):
        what = "Python objects" if isinstance(name, str) and name.startswith("O") else "an unusual type"
        raise _Malformed(f"it holds {what}")
    plain = np.dtype(name)
    return plain.newbyteorder(">") if value.state is not None and value.state[1] == ">" else plain


def _bytes(value: Any) -> bytes:
    """Bytes, in each of the ways that a pickle spells them."""
    if isinstance(value, str):
        return value.encode("latin-1")
    if isinstance(value, bytes):
        return value
    if isinstance(value, Call) and str(value.function) == "_codecs.encode" and value.arguments[1:] == ("latin1",):
        return _bytes(value.arguments[0])
    if isinstance(value, Call) and value.function.name in ("bytes", "bytearray"):
        return _bytes(value.arguments[0]) if value.arguments else b""
    raise _Malformed(f"its bytes are a {type(value).__name__}")


def _sparse(name: str, state: dict[str, Any], depth: int) -> NDArray[Any]:
    """A scipy.sparse matrix, dense. Entries at the same place add up, as in scipy."""
    rows, columns = _shape(_array(state["_shape"], depth).tolist())
    data = _array(state["data"], depth)
    if name.startswith("coo"):
        row, column = (_array(part, depth) for part in state.get("coords") or (state["row"], state["col"]))
    else:
        inner, starts = _array(state["indices"], depth), _array(state["indptr"], depth).astype(np.int64)
        if starts[0] != 0 or starts[-1] != len(data) or (np.diff(starts) < 0).any():
            raise _Malformed("its index pointers do not fit")
        outer = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        row, column = (inner, outer) if name.startswith("csc") else (outer, inner)
    dense = np.zeros((rows, columns))
    if len(row) != len(data) or len(column) != len(data) or (len(row) and min(row.min(), column.min()) < 0):
        raise _Malformed("its indices do not fit")
    np.add.at(dense, (row, column), data)
    return dense
