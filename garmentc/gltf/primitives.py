"""Mesh primitives: vertex attributes, morph targets and triangles (glTF 2.0 section 3.7.2)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.accessors import AccessorWriter
from garmentc.gltf.asset import GltfOptions, RiggedMesh
from garmentc.gltf.positions import PositionCodec
from garmentc.gltf.skin import add_influences, largest_influences
from garmentc.gltf.tangents import vertex_tangents
from garmentc.outfit.corners import CornerPrimitive
from garmentc.rig import Rig


def add_mesh(
    writer: AccessorWriter, shown: RiggedMesh, options: GltfOptions, codec: PositionCodec, materials: dict[int, int]
) -> int:
    """Add a mesh; returns its index.

    materials  index of each used material in the document
    """
    from pygltflib import Mesh

    influences = largest_influences(shown.rig.weights, options.influences)
    primitives = [
        _add_primitive(writer, shown, options, codec, primitive, influences, materials[primitive.material])
        for primitive in shown.primitives
    ]
    mesh = Mesh(name=shown.name, primitives=primitives)
    if shown.rig.morph_count:
        mesh.weights = [0.0] * shown.rig.morph_count
        mesh.extras = {"targetNames": list(shown.target_names)}
    writer.document.meshes.append(mesh)
    return len(writer.document.meshes) - 1


def _add_primitive(
    writer: AccessorWriter,
    shown: RiggedMesh,
    options: GltfOptions,
    codec: PositionCodec,
    corners: CornerPrimitive,
    influences: tuple[NDArray[np.uint8], NDArray[np.float64]],
    material: int,
) -> Any:
    from pygltflib import Attributes, Primitive

    rig, quantize = shown.rig, options.quantize
    attributes = Attributes()
    positions = codec.positions(rig.template[corners.vertices])
    attributes.POSITION = writer.attribute(
        positions, normalized=quantize and codec.normalized, bounds=True, label="the template"
    )
    normals = _normals(corners.normals, quantize)
    attributes.NORMAL = writer.attribute(normals, normalized=quantize, label="the normals")
    if corners.texcoords is not None:
        texcoords = _texcoords(corners.texcoords, quantize)
        normalized = texcoords.dtype == np.uint16
        attributes.TEXCOORD_0 = writer.attribute(texcoords, normalized=normalized, label="the texture coordinates")
    if corners.texcoords is not None and shown.materials[corners.material].normal_texture is not None:
        tangents = _normals(vertex_tangents(rig.template[corners.vertices], corners), quantize)
        attributes.TANGENT = writer.attribute(tangents, normalized=quantize, label="the tangents")
    if corners.colors is not None:
        attributes.COLOR_0 = writer.attribute(_colors(corners.colors), normalized=True, label="the vertex colours")
    joints, weights = influences
    add_influences(writer, attributes, joints[corners.vertices], weights[corners.vertices], quantize)
    return Primitive(
        attributes=attributes,
        targets=[_add_target(writer, rig, options, codec, corners, morph) for morph in range(rig.morph_count)],
        indices=writer.indices(corners.triangles),
        material=material,
        mode=None,
    )


def _add_target(
    writer: AccessorWriter, rig: Rig, options: GltfOptions, codec: PositionCodec, corners: CornerPrimitive, morph: int
) -> Any:
    from pygltflib import Attributes

    quantize = options.quantize
    add = writer.sparse_attribute if options.sparse else writer.attribute
    moved = codec.deltas(rig.blend_shapes[morph][corners.vertices])
    fractions = quantize and codec.normalized
    target = Attributes(POSITION=add(moved, normalized=fractions, bounds=True, label=f"blend shape {morph}"))
    if rig.blend_normals is not None:
        turned = _normal_deltas(rig.blend_normals[morph][corners.vertices], quantize)
        fractions = turned.dtype == np.int8
        target.NORMAL = add(turned, normalized=fractions, label=f"the normals of blend shape {morph}")
    return target


def _normals(normals: NDArray[Any], quantize: bool) -> NDArray[Any]:
    """Normals, their deltas, or tangents; as 8-bit fractions they are half a degree off at most."""
    if not quantize:
        return normals.astype(np.float32, copy=False)
    return np.clip(np.round(normals * 127), -127, 127).astype(np.int8)


def _normal_deltas(deltas: NDArray[Any], quantize: bool) -> NDArray[Any]:
    """As `_normals`; beyond 1, where fractions end, float32 in steps of 1/128, whose bytes compress well."""
    if quantize and np.abs(deltas).max() > 1:
        return (np.round(deltas * 128) / 128).astype(np.float32)
    return _normals(deltas, quantize)


def _texcoords(texcoords: NDArray[Any], quantize: bool) -> NDArray[Any]:
    """16-bit fractions where all lie in the unit square (a tiled texture's do not), else float32."""
    if quantize and texcoords.min() >= 0 and texcoords.max() <= 1:
        return np.round(texcoords.astype(np.float64) * 65535).astype(np.uint16)
    return texcoords.astype(np.float32, copy=False)


def _colors(colors: NDArray[Any]) -> NDArray[np.uint16]:
    """Linear colours in [0, 1] as 16-bit fractions: eight bits would show bands in the darks."""
    return np.round(np.clip(colors.astype(np.float64), 0, 1) * 65535).astype(np.uint16)
