"""The GLB container (glTF 2.0 section 4): a JSON chunk and one binary chunk.

The binary chunk comes after the JSON that describes it, so its bytes are spooled to a nameless file first: memory stays
flat however large the asset is, and nothing is left behind when the work is interrupted.
"""

from __future__ import annotations

import dataclasses
import json
import mmap
import os
import shutil
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any

from garmentc.errors import GarmentcError
from garmentc.output import written_whole

_MAGIC = b"glTF"
_JSON = b"JSON"
_BINARY = b"BIN\0"
_HEADER = struct.Struct("<4sII")
_CHUNK = struct.Struct("<I4s")
_LARGEST_FILE = 2**32 - 1
"""The container's lengths are 32-bit."""


class BinaryChunk:
    """The binary chunk while it grows. Every part starts at a multiple of four bytes."""

    def __init__(self, spool: IO[bytes]) -> None:
        self._spool = spool
        self.length = 0

    def append(self, data: bytes | memoryview) -> int:
        """Write a part and return its byte offset in the chunk."""
        offset = self.length
        size = memoryview(data).nbytes
        self._spool.write(data)
        self._spool.write(bytes(-size % 4))
        self.length = offset + size + -size % 4
        return offset

    def copy_to(self, file: IO[bytes]) -> None:
        self._spool.seek(0)
        shutil.copyfileobj(self._spool, file, 1 << 20)


@contextmanager
def glb_writer(path: str | os.PathLike[str]) -> Iterator[tuple[Any, BinaryChunk]]:
    """An empty pygltflib.GLTF2 document and its binary chunk; the block fills both, and leaving it writes the file.

    A failure of any kind leaves a former file at `path` whole. Raises GarmentcError where the file cannot be written.
    """
    from pygltflib import GLTF2, Buffer

    target = Path(os.path.realpath(path))
    with written_whole(path) as file:
        with TemporaryFile(dir=None if target.exists() and not target.is_file() else target.parent) as spool:
            document = GLTF2()
            chunk = BinaryChunk(spool)
            yield document, chunk
            embedded = [Buffer(byteLength=chunk.length)] if chunk.length else []
            document.buffers = [*embedded, *document.buffers]
            _write_container(file, document_json(document), chunk, path)
        file.flush()
        if target.is_file():
            os.fsync(file.fileno())


def document_json(document: Any) -> bytes:
    """Compact JSON of pygltflib dataclasses, empty properties left out.

    pygltflib's own writer copies every leaf, accepts NaN and writes defaults; this one raises ValueError for NaN and
    TypeError for whatever is not plain JSON (numpy scalars, for instance).
    """
    return json.dumps(_plain(document), ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode(
        errors="replace"
    )


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) or type(value).__name__ == "Attributes":
        return {key: _plain(entry) for key, entry in vars(value).items() if _is_given(entry)}
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return value


def _is_given(value: Any) -> bool:
    return value is not None and not (isinstance(value, (list, dict)) and not value)


def _write_container(file: IO[bytes], text: bytes, chunk: BinaryChunk, path: str | os.PathLike[str]) -> None:
    text += b" " * (-len(text) % 4)
    total = _HEADER.size + _CHUNK.size + len(text) + (_CHUNK.size + chunk.length if chunk.length else 0)
    if total > _LARGEST_FILE:
        raise GarmentcError(
            f"would have {total / 2**30:.1f} GiB, and a .glb ends at 4 GiB; compile with fewer morphs or --profile web",
            path,
        )
    file.write(_HEADER.pack(_MAGIC, 2, total))
    file.write(_CHUNK.pack(len(text), _JSON))
    file.write(text)
    if chunk.length:
        file.write(_CHUNK.pack(chunk.length, _BINARY))
        chunk.copy_to(file)


@dataclass(frozen=True)
class GlbChunks:
    """The parsed JSON and the memory-mapped binary chunk of a .glb; the mapping lives as long as the view."""

    document: Any
    binary: memoryview
    json_bytes: int


def read_chunks(path: str | os.PathLike[str]) -> GlbChunks:
    """Open a .glb.

    Raises GarmentcError where the file is missing, cut short or not a GLB.
    """
    try:
        with Path(path).open("rb") as file:
            if os.fstat(file.fileno()).st_size < _HEADER.size + _CHUNK.size:
                raise GarmentcError("is too short to be a .glb file; compile or export it again", path)
            data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    except OSError as error:
        raise GarmentcError(f"cannot be read: {error.strerror}; check the path", path) from error
    text, binary = _chunks(data, path)
    return GlbChunks(_parse_json(text, path), binary, len(text))


def _chunks(data: memoryview, path: str | os.PathLike[str]) -> tuple[bytes, memoryview]:
    magic, version, length = _HEADER.unpack_from(data)
    if magic != _MAGIC:
        raise GarmentcError("is not a .glb file (no glTF header); give a binary glTF", path)
    if version != 2:
        raise GarmentcError(f"has glTF version {version}, only 2 is supported; export it as glTF 2.0", path)
    if length != len(data):
        raise GarmentcError(f"has {len(data)} bytes where its header says {length}; it is cut short or damaged", path)
    texts: list[bytes] = []
    binaries: list[memoryview] = []
    at = _HEADER.size
    while at < len(data):
        if at + _CHUNK.size > len(data):
            raise GarmentcError("ends inside a chunk header; it is damaged, export it again", path)
        size, kind = _CHUNK.unpack_from(data, at)
        at += _CHUNK.size
        if at + size > len(data):
            raise GarmentcError("has a chunk that runs past its end; it is damaged, export it again", path)
        if kind == _JSON:
            texts.append(bytes(data[at : at + size]))
        elif kind == _BINARY:
            binaries.append(data[at : at + size])
        at += size
    if len(texts) != 1 or len(binaries) > 1:
        raise GarmentcError("must have one JSON chunk and at most one binary chunk; export it again", path)
    return texts[0], binaries[0] if binaries else data[:0]


def _parse_json(text: bytes, path: str | os.PathLike[str]) -> Any:
    def refuse(constant: str) -> Any:
        raise ValueError(f"{constant} is no JSON number")

    try:
        return json.loads(text.decode("utf-8"), parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise GarmentcError(f"has a JSON chunk that cannot be read: {error}; it is damaged", path) from error
