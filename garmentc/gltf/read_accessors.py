"""Accessors of a file from anywhere to numpy arrays: every offset, count and index checked before it is used."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.accessors import COMPONENT_TYPES, ELEMENT_TYPES
from garmentc.gltf.cursor import Cursor
from garmentc.gltf.glb_asset import Storage
from garmentc.gltf.meshopt import EXTENSION, decompress

_DTYPES = {code: np.dtype("<" + name) for name, code in COMPONENT_TYPES.items()}
_COMPONENTS = {name: count for count, name in ELEMENT_TYPES.items()} | {"MAT2": 4, "MAT3": 9}

MAX_ELEMENTS = 2**26
"""Of an accessor without a buffer view; one with a view is bounded by the size of the file."""

MAX_RESOLVED_BYTES = 16 * 2**30
"""Of all accessors: sparse ones can ask for any amount of memory with a few bytes."""


@dataclass
class AccessorReader:
    """Resolves the accessors of one document, up to MAX_RESOLVED_BYTES.

    view_uses  by buffer view that was read: where in the document it was first asked for
    """

    root: Cursor
    binary: memoryview
    _accessors: list[Cursor] = field(init=False)
    _views: list[Cursor] = field(init=False)
    view_uses: dict[int, str] = field(default_factory=dict)
    _resolved_bytes: int = 0
    _decoded: dict[str, memoryview] = field(default_factory=dict)
    _decoded_bytes: int = 0
    _users: Counter[int] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self._accessors = list(self.root.get("accessors"))
        self._views = list(self.root.get("bufferViews"))
        for accessor in self._accessors:
            self._users.update(view for view, _ in self._parts_of(accessor))
        buffers = list(self.root.get("buffers"))
        embedded = [buffer for buffer in buffers if not _is_fallback(buffer)]
        if len(embedded) > 1 or embedded != buffers[:1] or any(buffer.get("uri").given for buffer in embedded):
            raise self.root.get("buffers").error("must be one embedded buffer", "pack the file as a single .glb")
        for buffer in embedded:
            buffer.get("byteLength").integer(low=1, high=len(self.binary))

    def index(self, where: Cursor) -> int:
        """An accessor index."""
        return where.index(len(self._accessors))

    def array(
        self, where: Cursor, kinds: tuple[str, ...], count: int | None = None, scale: bool = True
    ) -> NDArray[Any]:
        """The accessor that `where` names, (n, components), or (n,) for SCALAR.

        kinds  element types that are allowed
        count  number of elements it must have
        scale  normalised integers become float32 fractions; other integers stay as they are
        """
        accessor = self._accessors[self.index(where)]
        kind = accessor.get("type").text()
        if kind not in kinds:
            raise where.error(f"must be an accessor of type {' or '.join(kinds)}, not {kind}")
        size = accessor.get("count").integer(low=1)
        if count is not None and size != count:
            raise where.error(f"must have {count} elements, not {size}")
        values = self._resolve(accessor, size, _COMPONENTS[kind])
        for view, _ in self._parts_of(accessor):
            self.view_uses.setdefault(view, where.pointer)
        if scale and accessor.get("normalized").flag() and values.dtype.kind in "iu":
            fractions = values.astype(np.float32) / np.float32(np.iinfo(values.dtype).max)
            values = np.maximum(fractions, np.float32(-1))
        return values[:, 0] if kind == "SCALAR" else values

    def storage(self, where: Cursor) -> Storage:
        accessor = self._accessors[self.index(where)]
        sparse = accessor.get("sparse").get("count")
        return Storage(
            component=self._dtype(accessor).name,
            normalized=accessor.get("normalized").flag(),
            bytes=sum(self._share(view, needed) for view, needed in self._parts_of(accessor)),
            sparse=sparse.integer() if sparse.given else None,
        )

    def _share(self, view: int, needed: int) -> int:
        """Bytes of a view in the file that are an accessor's: all, or its part of a view that accessors share.

        needed  bytes of the view, uncompressed, that the accessor reads
        """
        if self._users[view] < 2:
            return self.view_size(view)
        return round(self.view_size(view) * min(1.0, needed / self._views[view].get("byteLength").integer(low=1)))

    def view_size(self, view: int) -> int:
        """Bytes that a view takes in the file."""
        stored = self._views[view].get("extensions").get(EXTENSION)
        return (stored if stored.given else self._views[view]).get("byteLength").integer()

    def _parts_of(self, accessor: Cursor) -> list[tuple[int, int]]:
        """The buffer views that an accessor reads from, and how many bytes of each."""
        sparse = accessor.get("sparse")
        count = accessor.get("count").integer(low=1)
        element = _COMPONENTS.get(accessor.get("type").text(), 1) * self._dtype(accessor).itemsize
        parts = []
        if accessor.get("bufferView").given:
            view = accessor.get("bufferView").index(len(self._views))
            parts.append((view, count * (self._views[view].get("byteStride").integer(0) or element)))
        if sparse.given:
            indices, values = sparse.get("indices"), sparse.get("values")
            entries, size = sparse.get("count").integer(), self._dtype(indices).itemsize
            parts.append((indices.get("bufferView").index(len(self._views)), entries * size))
            parts.append((values.get("bufferView").index(len(self._views)), entries * element))
        return parts

    def view_bytes(self, where: Cursor) -> bytes:
        """All bytes of the buffer view that `where` names."""
        data, offset, length, _ = self._view(where)
        self.view_uses.setdefault(where.index(len(self._views)), where.pointer)
        return bytes(data[offset : offset + length])

    def _resolve(self, accessor: Cursor, count: int, components: int) -> NDArray[Any]:
        dtype = self._dtype(accessor)
        self._resolved_bytes += count * components * dtype.itemsize
        if self._resolved_bytes > MAX_RESOLVED_BYTES:
            raise accessor.error(f"asks for more than {MAX_RESOLVED_BYTES >> 30} GiB")
        if accessor.get("bufferView").given:
            values = self._elements(accessor, dtype, count, components).copy()
        elif count > MAX_ELEMENTS:
            raise accessor.error(f"has no data and asks for {count} elements")
        else:
            values = np.zeros((count, components), dtype)
        sparse = accessor.get("sparse")
        if sparse.given:
            entries = sparse.get("count").integer(low=1, high=count)
            where = self._elements(sparse.get("indices"), self._dtype(sparse.get("indices")), entries, 1)[:, 0]
            if where.dtype.kind != "u" or where.max() >= count or np.any(where[1:] <= where[:-1]):
                raise sparse.error(f"must have increasing indices below {count}")
            values[where] = self._elements(sparse.get("values"), dtype, entries, components)
        if dtype.kind == "f" and not (np.isfinite(values.min()) and np.isfinite(values.max())):
            raise accessor.error("holds NaN or infinite values")
        return values

    def _elements(self, where: Cursor, dtype: np.dtype[Any], count: int, components: int) -> NDArray[Any]:
        """A view (count, components) into the binary chunk."""
        data, start, length, stride = self._view(where.get("bufferView"))
        offset = where.get("byteOffset").integer(0)
        element = components * dtype.itemsize
        step = stride or element
        if step < element:
            raise where.error(f"has elements of {element} bytes in a stride of {step}")
        if offset + (count - 1) * step + element > length:
            raise where.error("reaches beyond its buffer view")
        return np.ndarray((count, components), dtype, data, start + offset, (step, dtype.itemsize))

    def _view(self, where: Cursor) -> tuple[memoryview, int, int, int]:
        """What a buffer view is in, its byte offset there, its length and stride (0: tightly packed)."""
        view = self._views[where.index(len(self._views))]
        stride = view.get("byteStride").integer(0, high=252)
        compressed = view.get("extensions").get(EXTENSION)
        if compressed.given:
            data = self._decompressed(view, compressed)
            return data, 0, len(data), stride
        if view.get("extensions").get("KHR_meshopt_compression").given:
            raise view.error(
                "is compressed by KHR_meshopt_compression, which garmentc does not read", "use EXT instead"
            )
        view.get("buffer").index(1)
        offset = view.get("byteOffset").integer(0, high=len(self.binary))
        length = view.get("byteLength").integer(low=1, high=len(self.binary) - offset)
        return self.binary, offset, length, stride

    def _decompressed(self, view: Cursor, compressed: Cursor) -> memoryview:
        """The bytes of a view with EXT_meshopt_compression."""
        if view.pointer not in self._decoded:
            compressed.get("buffer").index(1)
            offset = compressed.get("byteOffset").integer(0, high=len(self.binary))
            length = compressed.get("byteLength").integer(low=1, high=len(self.binary) - offset)
            count, stride = (
                compressed.get("count").integer(low=1),
                compressed.get("byteStride").integer(low=1, high=256),
            )
            self._decoded_bytes += count * stride
            if self._decoded_bytes > MAX_RESOLVED_BYTES:
                raise view.error(f"asks for more than {MAX_RESOLVED_BYTES >> 30} GiB")
            if view.get("byteLength").integer() != count * stride:
                raise view.error(f"must have {count * stride} bytes, {stride} for each of {count}")
            mode, filter = compressed.get("mode").text(), compressed.get("filter").text("NONE")
            try:
                data = decompress(self.binary[offset : offset + length], count, stride, mode, filter)
            except ValueError as error:
                raise compressed.error(f"cannot be decompressed: {error}") from error
            self._decoded[view.pointer] = data
        return self._decoded[view.pointer]

    def _dtype(self, accessor: Cursor) -> np.dtype[Any]:
        code = accessor.get("componentType").integer()
        if code not in _DTYPES:
            raise accessor.error(f"has component type {code}, which glTF does not know")
        return _DTYPES[code]


def _is_fallback(buffer: Cursor) -> bool:
    """True for the buffer that compressed views would be in, had they not been compressed."""
    return buffer.get("extensions").get(EXTENSION).get("fallback").flag()
