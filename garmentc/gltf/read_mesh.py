"""Meshes of a file from anywhere to numpy arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.cursor import Cursor
from garmentc.gltf.glb_asset import Mesh, Primitive
from garmentc.gltf.read_accessors import AccessorReader
from garmentc.gltf.read_pose_keys import network_in_extension

_TRIANGLES = 4
_MOST_INFLUENCE_SETS = 4


def read_mesh(entry: Cursor, reader: AccessorReader, root: Cursor) -> Mesh:
    """One mesh with all its primitives, which must be triangle lists with equally many morph targets."""
    materials = len(list(root.get("materials")))
    primitives = tuple(_read_primitive(primitive, reader, materials) for primitive in entry.get("primitives"))
    if not primitives:
        raise entry.error("has no primitives")
    morphs = len(primitives[0].morph_positions)
    if any(len(primitive.morph_positions) != morphs for primitive in primitives):
        raise entry.error("has primitives with different numbers of morph targets")
    weights = entry.get("weights").numbers(morphs, (0.0,) * morphs)
    names = (
        entry.get("extras").get("targetNames") if isinstance(entry.get("extras").value, dict) else Cursor(None, "", "")
    )
    return Mesh(
        name=entry.get("name").text(""),
        primitives=primitives,
        weights=weights,
        target_names=tuple(name.text() for name in names),
        pose_keys=network_in_extension(entry, reader, len(list(root.get("nodes")))),
    )


def _read_primitive(entry: Cursor, reader: AccessorReader, material_count: int) -> Primitive:
    if entry.get("mode").integer(_TRIANGLES) != _TRIANGLES:
        raise entry.error("is no list of triangles", "triangulate the mesh before exporting it")
    if entry.get("extensions").get("KHR_draco_mesh_compression").given:
        raise entry.error("is compressed by Draco, which garmentc does not read", "give the uncompressed file")
    attributes = entry.get("attributes")
    targets = list(entry.get("targets"))
    positions = _floats(attributes.get("POSITION"), reader, ("VEC3",), None)
    size = len(positions)

    def optional(name: str, kinds: tuple[str, ...]) -> NDArray[np.float32] | None:
        where = attributes.get(name)
        return _floats(where, reader, kinds, size) if where.given else None

    joints, weights = _influences(attributes, reader, size)
    has_normals = any(target.get("NORMAL").given for target in targets)
    storage = {name: reader.storage(where) for name, where in attributes.items()}
    for number, target in enumerate(targets):
        storage |= {f"targets/{number}/{name}": reader.storage(where) for name, where in target.items()}
    if entry.get("indices").given:
        storage["indices"] = reader.storage(entry.get("indices"))
    material = entry.get("material")
    return Primitive(
        positions=positions,
        triangles=_triangles(entry, reader, size),
        normals=optional("NORMAL", ("VEC3",)),
        tangents=optional("TANGENT", ("VEC4",)),
        texcoords=optional("TEXCOORD_0", ("VEC2",)),
        colors=optional("COLOR_0", ("VEC3", "VEC4")),
        joints=joints,
        weights=weights,
        morph_positions=_morphs(targets, "POSITION", reader, size),
        morph_normals=_morphs(targets, "NORMAL", reader, size) if has_normals else None,
        material=material.index(material_count) if material.given else None,
        storage=storage,
    )


def _floats(where: Cursor, reader: AccessorReader, kinds: tuple[str, ...], count: int | None) -> NDArray[np.float32]:
    """A vertex attribute; whole numbers that are no fractions (KHR_mesh_quantization) become floats too."""
    return reader.array(where, kinds, count).astype(np.float32, copy=False)


def _morphs(targets: list[Cursor], name: str, reader: AccessorReader, count: int) -> NDArray[np.float32]:
    values = np.zeros((len(targets), count, 3), dtype=np.float32)
    for number, target in enumerate(targets):
        if target.get(name).given:
            values[number] = _floats(target.get(name), reader, ("VEC3",), count)
    return values


def _influences(
    attributes: Cursor, reader: AccessorReader, count: int
) -> tuple[NDArray[np.int32] | None, NDArray[np.float32] | None]:
    """All sets JOINTS_n and WEIGHTS_n side by side."""
    joints: list[NDArray[Any]] = []
    weights: list[NDArray[Any]] = []
    for number in range(_MOST_INFLUENCE_SETS):
        joint_set, weight_set = attributes.get(f"JOINTS_{number}"), attributes.get(f"WEIGHTS_{number}")
        if joint_set.given != weight_set.given:
            raise attributes.error(f"must have JOINTS_{number} and WEIGHTS_{number}, or neither")
        if not joint_set.given:
            break
        indices = reader.array(joint_set, ("VEC4",), count, scale=False)
        if indices.dtype not in (np.uint8, np.uint16):
            raise joint_set.error("must be unsigned 8-bit or 16-bit numbers")
        joints.append(indices.astype(np.int32))
        weights.append(_floats(weight_set, reader, ("VEC4",), count))
    if not joints:
        return None, None
    return np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)


def _triangles(entry: Cursor, reader: AccessorReader, count: int) -> NDArray[np.uint32]:
    where = entry.get("indices")
    flat = reader.array(where, ("SCALAR",), scale=False) if where.given else np.arange(count, dtype=np.uint32)
    if flat.dtype.kind != "u" or len(flat) % 3 or flat.max() >= count:
        raise where.error(f"must be a list of triangles of {count} vertices")
    return flat.reshape(-1, 3).astype(np.uint32)
