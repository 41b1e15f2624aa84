"""Accessors (glTF 2.0 section 3.6.2): numpy arrays into the binary chunk, described in the document."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.gltf.glb import BinaryChunk
from garmentc.gltf.meshopt import ATTRIBUTES, INDICES, TRIANGLES, MeshoptWriter, compressed_size

ARRAY_BUFFER = 34962
ELEMENT_ARRAY_BUFFER = 34963

COMPONENT_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
ELEMENT_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


@dataclass(frozen=True)
class AccessorWriter:
    """Appends arrays to a pygltflib document and its binary chunk. Methods return an index in the document.

    meshopt     compresses vertex attributes, triangles and animations
    normalized  integers stand for fractions (section 3.6.2.2)
    bounds      write min and max, which the specification asks of POSITION and of animation times
    label       what an error message calls the array
    """

    document: Any
    chunk: BinaryChunk
    meshopt: MeshoptWriter | None = None

    def plain(self, array: NDArray[Any], *, bounds: bool = False, label: str, rows: NDArray[Any] | None = None) -> int:
        """Data that is no vertex attribute, tightly packed: (n,) or (n, components).

        rows  the same data as it may be compressed, a row for each keyframe; None leaves it plain
        """
        array = _checked(array, label)
        if self.meshopt is not None and rows is not None:
            view, offset = self.meshopt.add(_checked(rows, label), ATTRIBUTES, "animations")
            return self._add(array, view, bounds=bounds, offset=offset)
        return self._add(array, self.view(array), bounds=bounds)

    def indices(self, triangles: NDArray[Any]) -> int:
        """Triangles (F, 3) as uint16 where they fit; 65535 does not, for it restarts a primitive (section 3.7.2.1)."""
        flat = triangles.reshape(-1).astype("<u2" if triangles.max() < 65535 else "<u4")
        if self.meshopt is not None:
            view, offset = self.meshopt.add(flat, TRIANGLES, "indices", ELEMENT_ARRAY_BUFFER)
            return self._add(flat, view, offset=offset)
        return self._add(flat, self.view(flat, ELEMENT_ARRAY_BUFFER))

    def attribute(
        self,
        array: NDArray[Any],
        *,
        normalized: bool = False,
        bounds: bool = False,
        label: str,
        use: str = "vertices",
    ) -> int:
        """A vertex attribute (n, components), each element padded to four bytes (section 3.6.2.4)."""
        array = _checked(array, label)
        padded = _padded(array)
        if self.meshopt is not None:
            view, offset = self.meshopt.add(padded, ATTRIBUTES, use, ARRAY_BUFFER)
            return self._add(array, view, normalized=normalized, bounds=bounds, offset=offset)
        view = self.view(padded, ARRAY_BUFFER, None if padded is array else int(padded[0].nbytes))
        return self._add(array, view, normalized=normalized, bounds=bounds)

    def sparse_attribute(
        self, array: NDArray[Any], *, normalized: bool = False, bounds: bool = False, label: str
    ) -> int:
        """A vertex attribute that is mostly zero, written sparse (section 3.6.2.3) where that takes fewer bytes."""
        from pygltflib import AccessorSparseIndices, AccessorSparseValues, Sparse

        array = _checked(array, label)
        changed = np.flatnonzero(np.logical_or.reduce([column != 0 for column in array.T]))
        if len(changed) == 0:
            changed = np.array([0])  # at least one entry is required (section 3.6.2.3)
        indices = changed.astype("<u2" if len(array) <= 65536 else "<u4")
        values = array[changed]
        if not self._is_smaller_sparse(array, indices, values):
            return self.attribute(array, normalized=normalized, bounds=bounds, label=label, use="targets")
        index_view, index_offset = self._part(indices, INDICES)
        value_view, value_offset = self._part(values, ATTRIBUTES)
        sparse = Sparse(
            count=len(changed),
            indices=AccessorSparseIndices(
                bufferView=index_view, byteOffset=index_offset or None, componentType=_component_type(indices)
            ),
            values=AccessorSparseValues(bufferView=value_view, byteOffset=value_offset or None),
        )
        return self._add(array, None, normalized=normalized, bounds=bounds, sparse=sparse)

    def _is_smaller_sparse(self, array: NDArray[Any], indices: NDArray[Any], values: NDArray[Any]) -> bool:
        """True where the entries take fewer bytes in the file than the whole attribute."""
        if self.meshopt is None:
            return indices.nbytes + values.nbytes < len(array) * _stride(array)
        entries = compressed_size(indices, INDICES) + compressed_size(values, ATTRIBUTES)
        return entries < compressed_size(_padded(array), ATTRIBUTES)

    def _part(self, array: NDArray[Any], mode: str) -> tuple[int, int]:
        """Part of a sparse accessor, tightly packed: its buffer view and the offset in it."""
        return (self.view(array), 0) if self.meshopt is None else self.meshopt.add(array, mode, "sparse")

    def view(self, data: bytes | NDArray[Any], target: int | None = None, stride: int | None = None) -> int:
        """A buffer view of its own for `data`."""
        from pygltflib import BufferView

        raw = data if isinstance(data, bytes) else np.ascontiguousarray(data).data.cast("B")
        offset = self.chunk.append(raw)
        self.document.bufferViews.append(
            BufferView(buffer=0, byteOffset=offset, byteLength=len(raw), byteStride=stride, target=target)
        )
        return len(self.document.bufferViews) - 1

    def _add(
        self,
        array: NDArray[Any],
        view: int | None,
        normalized: bool = False,
        bounds: bool = False,
        sparse: Any = None,
        offset: int = 0,
    ) -> int:
        from pygltflib import Accessor

        columns = array.reshape(len(array), -1).T  # numpy is 20 times faster along these than across
        accessor = Accessor(
            bufferView=view,
            byteOffset=offset or None,
            componentType=_component_type(array),
            normalized=normalized or None,
            count=len(array),
            type=ELEMENT_TYPES[array[0].size],
            sparse=sparse,
            min=[column.min().item() for column in columns] if bounds else None,
            max=[column.max().item() for column in columns] if bounds else None,
        )
        self.document.accessors.append(accessor)
        return len(self.document.accessors) - 1


def _checked(array: NDArray[Any], label: str) -> NDArray[Any]:
    if array.dtype.kind == "f" and not (np.isfinite(array.min()) and np.isfinite(array.max())):
        raise GarmentcError(f"{label}: NaN or infinite values cannot be written; check the model bundle and the motion")
    return array.astype(array.dtype.newbyteorder("<"), copy=False)


def _padded(array: NDArray[Any]) -> NDArray[Any]:
    """The array (n, components), each element padded to a multiple of four bytes; itself where it is that already."""
    stride = _stride(array)
    if stride == array[0].nbytes:
        return array
    padded = np.zeros((len(array), stride // array.itemsize), dtype=array.dtype)
    padded[:, : array.shape[1]] = array
    return padded


def _component_type(array: NDArray[Any]) -> int:
    return COMPONENT_TYPES[array.dtype.str[1:]]


def _stride(array: NDArray[Any]) -> int:
    return (int(array[0].nbytes) + 3) // 4 * 4
