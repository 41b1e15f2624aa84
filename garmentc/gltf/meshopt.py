"""EXT_meshopt_compression: buffer views that the loader decompresses, byte for byte.

Nothing is rounded here (the extension's filters are not used): a compressed file means exactly what the plain one does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.gltf.glb import BinaryChunk

EXTENSION = "EXT_meshopt_compression"

ATTRIBUTES, TRIANGLES, INDICES = "ATTRIBUTES", "TRIANGLES", "INDICES"
MODES = (ATTRIBUTES, TRIANGLES, INDICES)
FILTERS = ("NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL")

LARGEST_STRIDE = 256


def codec() -> Any:
    """The package meshopt. Raises GarmentcError with the line that installs it."""
    try:
        import meshopt  # type: ignore[import-untyped]
    except ImportError:
        message = "meshopt compression needs the package meshopt; run: pip install 'garmentc[meshopt]'"
        raise GarmentcError(message) from None
    return meshopt


@dataclass
class _Stream:
    """Arrays of one kind, one after the other, in the buffer view with number `index`."""

    view: Any
    index: int
    mode: str
    parts: list[NDArray[Any]] = field(default_factory=list)
    length: int = 0


@dataclass
class MeshoptWriter:
    """Gathers arrays of one kind into one buffer view, and compresses all views at the end.

    Few views make short JSON, and long ones compress better.
    """

    document: Any
    chunk: BinaryChunk
    _streams: dict[tuple[Any, ...], _Stream] = field(default_factory=dict)

    def add(self, array: NDArray[Any], mode: str, use: str, target: int | None = None) -> tuple[int, int]:
        """Rows (n, ...), or indices (n,); returns the buffer view and the offset in it.

        use     arrays of the same use, and of the same type, share a view
        target  of the view, and with ATTRIBUTES also that it tells its stride: vertex attributes
        """
        from pygltflib import BufferView

        stride = int(array[0].nbytes)
        key = use, mode, array.dtype.str, stride, target
        if key not in self._streams:
            told = stride if target is not None and mode == ATTRIBUTES else None
            self.document.bufferViews.append(BufferView(target=target, byteStride=told))
            index = len(self.document.bufferViews) - 1
            self._streams[key] = _Stream(self.document.bufferViews[index], index, mode)
        stream = self._streams[key]
        offset = stream.length
        stream.parts.append(array)
        stream.length += array.nbytes
        return stream.index, offset

    def finish(self) -> bool:
        """Write all views; returns whether one was compressed.

        What a view takes without compression is counted in a second buffer, which exists on paper only.
        """
        from pygltflib import Buffer

        fallback = 0
        for stream in self._streams.values():
            array = (
                _in_fours(np.concatenate(stream.parts)) if stream.mode == ATTRIBUTES else np.concatenate(stream.parts)
            )
            view, packed = stream.view, _compressed(array, stream.mode)
            view.byteLength = array.nbytes
            if packed is None:
                view.buffer, view.byteOffset = 0, self.chunk.append(np.ascontiguousarray(array).data.cast("B"))
                continue
            data, extension = packed
            extension["byteOffset"] = self.chunk.append(data)
            view.buffer, view.byteOffset, view.extensions = 1, fallback, {EXTENSION: extension}
            fallback += array.nbytes + -array.nbytes % 4
        if fallback:
            self.document.buffers = [Buffer(byteLength=fallback, extensions={EXTENSION: {"fallback": True}})]
        return fallback > 0


def compressed_size(array: NDArray[Any], mode: str) -> int:
    """Bytes that rows (n, ...) or indices (n,) take on their own; their own size where they cannot be compressed."""
    packed = _compressed(_in_fours(array) if mode == ATTRIBUTES else array, mode)
    return array.nbytes if packed is None else len(packed[0])


def _in_fours(array: NDArray[Any]) -> NDArray[Any]:
    """The rows (n, ...) as they are, or, where their size is no multiple of four bytes, regrouped and padded to one."""
    stride = int(array[0].nbytes)
    if stride % 4 == 0:
        return array
    row = math.lcm(stride, 4)
    raw = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
    return np.concatenate([raw, np.zeros(-len(raw) % row, np.uint8)]).reshape(-1, row)


def _compressed(array: NDArray[Any], mode: str) -> tuple[bytes, dict[str, Any]] | None:
    """The bytes and the extension object, which still lacks their offset.

    None where the format cannot hold the array, or it would not become smaller.
    """
    stride = int(array[0].nbytes)
    if mode == ATTRIBUTES and (stride % 4 or stride > LARGEST_STRIDE):
        return None
    # Version 0: version 1 of the vertex codec belongs to KHR_meshopt_compression.
    data: bytes = codec().encode_gltf_buffer(array, mode, version=0)
    if len(data) >= array.nbytes:
        return None
    return data, {"buffer": 0, "byteLength": len(data), "byteStride": stride, "count": len(array), "mode": mode}


def decompress(data: memoryview, count: int, stride: int, mode: str, filter: str) -> memoryview:
    """The bytes (count * stride) that were compressed. Raises ValueError where `data` is not what it should be."""
    if mode not in MODES or filter not in FILTERS:
        raise ValueError(f"the mode {mode} with the filter {filter} is not known")
    if mode == ATTRIBUTES and (stride % 4 or not 0 < stride <= LARGEST_STRIDE):
        raise ValueError(f"the stride {stride} is not one of the vertex codec's")
    if mode != ATTRIBUTES and (stride not in (2, 4) or filter != "NONE"):
        raise ValueError(f"indices cannot have a stride of {stride} and the filter {filter}")
    decoded: NDArray[Any] = codec().decode_gltf_buffer(bytes(data), count, stride, mode, filter)
    return memoryview(np.ascontiguousarray(decoded).tobytes())
