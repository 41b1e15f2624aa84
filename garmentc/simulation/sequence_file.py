"""One sequence in one .npz file: the same sequence always gives the same bytes.

Any numpy reads the file (`numpy.load`, no pickles). docs/dataset.md describes its arrays.

Posed vertices take most of the room. They are stored relative to the frame's `trans`, rounded to multiples of STEP, as
16-bit numbers; then as differences between frames, low bytes and high bytes apart, which is what makes them compress.
"""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.schema import check_schema
from garmentc.simulation.sequence import REASONS, STRAIN_PERCENTILES, QualityTrack, Sequence, SequenceFacts, Texcoords
from garmentc.smpl.arrays import numbers, read_npz

STEP = 2.0**-14
"""Metres between stored positions: they are off by at most half of it (0.031 mm) along each axis."""

REACH = 2.0
"""Metres from `trans` that 16 bits reach. Cloth further away is stored as float32 instead."""

_ZIP_EPOCH = (1980, 1, 1, 0, 0, 0)
_COMPRESSION = 6
_ARRAYS = ("facts", "template", "faces", "triangle_part", "uv", "uv_corners", "betas", "poses", "trans")
_POSED = ("vertices_int16", "vertices_float32")
_QUALITY = tuple(field.name for field in fields(QualityTrack))


def sequence_bytes(sequence: Sequence) -> bytes:
    """The file of `sequence`. Raises ValueError where a number in it is not finite."""
    facts = asdict(sequence.facts)
    arrays: dict[str, NDArray[Any]] = {
        "facts": np.frombuffer(json.dumps(facts, sort_keys=True, allow_nan=False).encode(), np.uint8),
        "template": sequence.template.astype(np.float32),
        "faces": sequence.faces.astype(np.int32),
        "triangle_part": sequence.triangle_part.astype(np.int32),
        "betas": sequence.betas.astype(np.float32),
        "poses": sequence.poses.astype(np.float32),
        "trans": sequence.trans.astype(np.float32),
    }
    if sequence.texcoords is not None:
        arrays |= {"uv": sequence.texcoords.uv, "uv_corners": sequence.texcoords.corners}
    arrays |= _encoded(sequence.vertices, arrays["trans"])
    arrays |= {name: getattr(sequence.quality, name) for name in _QUALITY}
    for name, array in arrays.items():
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise ValueError(f"{name} holds NaN or infinity")
    return _archive(arrays)


def _archive(arrays: dict[str, NDArray[Any]]) -> bytes:
    """An .npz whose bytes depend on the arrays alone: no dates, no permissions of this machine."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=_COMPRESSION) as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.ascontiguousarray(array), version=(1, 0), allow_pickle=False)
            info = zipfile.ZipInfo(f"{name}.npy", _ZIP_EPOCH)
            info.compress_type, info.create_system, info.external_attr = zipfile.ZIP_DEFLATED, 3, 0o644 << 16
            archive.writestr(info, member.getvalue())
    return buffer.getvalue()


def _encoded(vertices: NDArray[Any], trans: NDArray[np.float32]) -> dict[str, NDArray[Any]]:
    if not np.isfinite(vertices).all():
        raise ValueError("vertices hold NaN or infinity")
    relative = vertices.astype(np.float64) - trans[:, None]
    if np.abs(relative).max(initial=0.0) >= REACH - STEP:
        return {"vertices_float32": vertices.astype(np.float32)}
    steps = np.rint(relative / STEP).astype(np.int16).view(np.uint16)
    changes = np.diff(steps, axis=0, prepend=np.zeros_like(steps[:1]))  # wraps around, and back when it is summed up
    return {"vertices_int16": np.stack([changes & 255, changes >> 8]).astype(np.uint8)}


def _decoded(planes: NDArray[np.uint8], trans: NDArray[np.float32]) -> NDArray[np.float32]:
    changes = planes[0].astype(np.uint16) | (planes[1].astype(np.uint16) << 8)
    steps = np.cumsum(changes, axis=0, dtype=np.uint16).view(np.int16)
    vertices: NDArray[np.float32] = (steps * STEP + trans[:, None].astype(np.float64)).astype(np.float32)
    return vertices


def read_facts(path: Path) -> SequenceFacts:
    """Only the facts of the sequence in `path`. Raises as `read_sequence`."""
    return _facts(read_npz(path, ["facts"]), path)


def read_quality(path: Path) -> QualityTrack:
    """Only the quality of the frames in `path`. Raises as `read_sequence`."""
    arrays = read_npz(path, _QUALITY)
    return _quality(arrays, len(numbers(arrays, "rejected", ("T",), path)), path)


def read_sequence(path: Path) -> Sequence:
    """The sequence in `path`. Nothing in the file is executed.

    Raises GarmentcError where the file is missing, damaged, or its arrays do not fit together.
    """
    arrays = read_npz(path, [*_ARRAYS, *_POSED, *_QUALITY])
    facts = _facts(arrays, path)
    template = numbers(arrays, "template", ("N", 3), path).astype(np.float32)
    faces = _indices(arrays, "faces", ("F", 3), len(template), path)
    poses = numbers(arrays, "poses", ("T", 24, 3), path).astype(np.float32)
    frames, count = len(poses), len(template)
    trans = numbers(arrays, "trans", (frames, 3), path).astype(np.float32)
    texcoords = None
    if "uv" in arrays:
        uv = numbers(arrays, "uv", ("T", 2), path).astype(np.float32)
        texcoords = Texcoords(uv, _indices(arrays, "uv_corners", (len(faces), 3), len(uv), path))
    if "vertices_int16" in arrays:
        planes = numbers(arrays, "vertices_int16", (2, frames, count, 3), path)
        vertices = _decoded(planes.astype(np.uint8), trans)
    else:
        vertices = numbers(arrays, "vertices_float32", (frames, count, 3), path).astype(np.float32)
    part = _indices(arrays, "triangle_part", (len(faces),), max(len(facts.parts), 1), path)
    betas = numbers(arrays, "betas", ("S",), path).astype(np.float32)
    quality = _quality(arrays, frames, path)
    return Sequence(facts, template, faces, part, texcoords, betas, poses, trans, vertices, quality)


def _facts(arrays: dict[str, NDArray[Any]], path: Path) -> SequenceFacts:
    if "facts" not in arrays:
        raise GarmentcError("is no sequence of a dataset: the array 'facts' is missing", path)
    try:
        document = json.loads(arrays["facts"].astype(np.uint8).tobytes())
    except ValueError as error:
        raise GarmentcError(f"the array 'facts' is damaged ({error}); make the file again", path) from None
    check_schema(document, "sequence", path)
    lists = {name: tuple(document[name]) for name in ("parts", "tightness")}
    return SequenceFacts(**{**document, **lists})


def _indices(
    arrays: dict[str, NDArray[Any]], key: str, shape: tuple[int | str, ...], limit: int, path: Path
) -> NDArray[np.int32]:
    index = numbers(arrays, key, shape, path).astype(np.int32)
    if index.size and (index.min() < 0 or index.max() >= limit):
        raise GarmentcError(f"'{key}' refers to entry {index.max()} of {limit}; make the file again", path)
    return index


def _quality(arrays: dict[str, NDArray[Any]], frames: int, path: Path) -> QualityTrack:
    _indices(arrays, "rejected", (frames,), 1 << len(REASONS), path)
    kinds = {"rejected": np.uint16, "crossings": np.int32}
    shapes = {"strain": (frames, len(STRAIN_PERCENTILES))}
    return QualityTrack(
        **{
            name: numbers(arrays, name, shapes.get(name, (frames,)), path).astype(kinds.get(name, np.float32))
            for name in _QUALITY
        }
    )
