"""Synthetic assets for the glTF tests: a gown and a belt around a real skeleton, with local blend shapes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from garmentc.gltf.asset import Asset, Clip, GltfOptions
from garmentc.outfit.corners import CornerPrimitive
from garmentc.outfit.outfit import Material
from garmentc.rig import ENCODING_GRAVITY_AXIS_ANGLE, ENCODING_WIDTHS, DenseLayer, KeyNetwork, Rig
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.motion import Motion

JOINTS = load_default_body().joints()


def tube(columns: int, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A gown with a seam down its back: welded vertices (N, 3), triangles (F, 3), and (F, 3, 2) texture coordinates."""
    u, v = np.meshgrid(np.arange(columns + 1) / columns, np.arange(rows) / (rows - 1))
    angle, radius = 2 * np.pi * u, 0.16 + 0.12 * (1 - v) + 0.35 * np.clip(v - 0.8, 0, 1)
    points = np.stack([radius * np.cos(angle), v - 0.55, 0.8 * radius * np.sin(angle)], axis=-1)
    texcoords = np.stack([u, 1 - v], axis=-1).reshape(-1, 2)
    first = (np.arange(rows - 1)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
    right, above = first + 1, first + columns + 1
    corners = np.concatenate([np.stack([first, above, right], 1), np.stack([right, above, above + 1], 1)])
    welded_of = np.arange(rows)[:, None] * columns + np.arange(columns + 1) % columns  # the last column is the first
    return points[:, :-1].reshape(-1, 3), welded_of.reshape(-1)[corners], texcoords[corners]


def vertex_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], np.cross(b - a, c - a))
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def make_rig(morphs: int = 8, influences: int = 4, columns: int = 24, rows: int = 20, normals: bool = True) -> Rig:
    random = np.random.default_rng(7)
    vertices, triangles, _ = tube(columns, rows)
    distance = np.linalg.norm(vertices[:, None] - JOINTS, axis=-1)
    weights = np.exp(-((distance / 0.25) ** 2)) + 1e-6 * np.exp(-distance)
    smallest = np.argsort(-weights, axis=1)[:, influences:]
    np.put_along_axis(weights, smallest, 0, axis=1)
    weights = (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)
    outward = vertex_normals(vertices, triangles)
    shapes = np.zeros((morphs, len(vertices), 3), dtype=np.float32)
    turned = np.zeros_like(shapes)
    for shape, turn in zip(shapes, turned, strict=True):
        from_centre = np.linalg.norm(vertices - vertices[random.integers(len(vertices))], axis=1)
        bump = np.clip(1 - (from_centre / 0.2) ** 2, 0, None)[:, None] ** 2
        shape[:] = bump * (0.04 * outward + random.normal(0, 0.015, 3))
        turn[:] = bump * random.normal(0, 0.2, 3)
    return Rig(
        template=vertices,
        triangles=triangles.astype(np.int32),
        joints=JOINTS,
        weights=weights,
        blend_shapes=shapes,
        keys=make_keys(morphs, random) if morphs else None,
        blend_normals=turned if normals else None,
    )


def make_keys(morphs: int, random: np.random.Generator, encoding: str = ENCODING_GRAVITY_AXIS_ANGLE) -> KeyNetwork:
    def layer(inputs: int, outputs: int, activation: str) -> DenseLayer:
        weight = random.normal(0, 1.2 / np.sqrt(inputs), (outputs, inputs)).astype(np.float32)
        return DenseLayer(weight, random.normal(0, 0.1, outputs).astype(np.float32), activation)

    first = layer(ENCODING_WIDTHS[encoding], 32, "relu")
    network = KeyNetwork((first, layer(32, 24, "normalized_relu"), layer(24, morphs, "linear")), encoding)
    last = network.layers[-1]
    at_rest = network(np.zeros((24, 3))).astype(np.float32)
    return replace(network, layers=(*network.layers[:-1], replace(last, bias=last.bias - at_rest)))


def make_motion(frames: int = 30, fps: float = 30.0, name: str = "walk") -> Motion:
    random = np.random.default_rng(3)
    seconds = np.arange(frames)[:, None, None] / fps
    axes = random.normal(size=(24, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    poses = 0.5 * np.sin(4 * seconds + random.uniform(0, 6, (24, 1))) * axes
    t = seconds[:, 0]
    trans = np.concatenate([0.2 * np.sin(3 * t), 0.1 * np.cos(5 * t), 0.3 * t], axis=1)
    return Motion(name=name, poses=poses, trans=trans, fps=fps)


def make_primitives(
    rig: Rig, columns: int = 24, rows: int = 20, parts: int = 2, uv: bool = True
) -> tuple[CornerPrimitive, ...]:
    """The gown cut across into `parts` primitives, corners split where the texture has a seam."""
    _, triangles, texcoords = tube(columns, rows)
    outward = vertex_normals(rig.template, rig.triangles)
    height = rig.template[triangles].mean(axis=1)[:, 1]
    part_of = np.searchsorted(np.linspace(height.min(), height.max(), parts + 1)[1:-1], height)
    primitives = []
    for part in range(parts):
        chosen = part_of == part
        corner = np.concatenate([triangles[chosen].reshape(-1, 1), texcoords[chosen].reshape(-1, 2)], axis=1)
        unique, local = np.unique(corner if uv else corner[:, :1], axis=0, return_inverse=True)
        vertices = unique[:, 0].astype(np.int32)
        primitives.append(
            CornerPrimitive(
                material=part,
                vertices=vertices,
                obj_vertices=vertices,
                triangles=local.reshape(-1, 3).astype(np.uint32),
                tri_index=np.flatnonzero(chosen).astype(np.int32),
                texcoords=unique[:, 1:].astype(np.float32) if uv else None,
                normals=outward[vertices].astype(np.float32),
                colors=None,
            )
        )
    return tuple(primitives)


def make_asset(
    morphs: int = 8,
    influences: int = 4,
    parts: int = 2,
    normals: bool = True,
    uv: bool = True,
    columns: int = 24,
    rows: int = 20,
    **options: Any,
) -> Asset:
    rig = make_rig(morphs, influences, columns, rows, normals=normals)
    return Asset(
        name="gown",
        rig=rig,
        primitives=make_primitives(rig, columns, rows, parts=parts, uv=uv),
        materials=tuple(Material(name=f"cloth {part}") for part in range(parts)),
        clips=(Clip(make_motion()),),
        options=GltfOptions(influences=influences, **options),
    )


def corner_vertices(asset: Asset) -> np.ndarray:
    """Welded vertex of every written vertex, primitive after primitive."""
    return np.concatenate([primitive.vertices for primitive in asset.primitives])
