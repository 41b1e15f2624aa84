"""Vertices of a .glb in a state: morphed, skinned and placed as an engine does it, in float64.

Nothing here goes through garmentc.rig: agreement with the rig says that the file is right.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.glb_asset import GlbAsset, Primitive
from garmentc.gltf.state import State, world_matrices

_BLOCK = 1 << 16


def world_positions(
    asset: GlbAsset, state: State, mesh_nodes: Sequence[int] | None = None
) -> tuple[NDArray[np.float64], ...]:
    """Positions (S, 3), metres, of every primitive of the mesh nodes, all in the file's order (glTF section 3.7.3)."""
    world = world_matrices(asset, state)
    positions = []
    for index in asset.mesh_nodes if mesh_nodes is None else mesh_nodes:
        node = asset.nodes[index]
        assert node.mesh is not None
        matrices = world[[index]]
        if node.skin is not None:
            skin = asset.skins[node.skin]
            matrices = world[list(skin.joints)] @ skin.inverse_bind_matrices.astype(np.float64)
        for primitive in asset.meshes[node.mesh].primitives:
            positions.append(_moved(primitive, state.weights[index], matrices, skinned=node.skin is not None))
    return tuple(positions)


def world_mesh(
    asset: GlbAsset, state: State, mesh_nodes: Sequence[int] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """All primitives of the mesh nodes as one mesh: positions (S, 3), metres, and triangles (F, 3)."""
    nodes = asset.mesh_nodes if mesh_nodes is None else mesh_nodes
    positions = world_positions(asset, state, nodes)
    primitives = [primitive for index in nodes for primitive in asset.meshes[asset.nodes[index].mesh or 0].primitives]
    starts = np.cumsum([0] + [len(part) for part in positions[:-1]])
    triangles = [
        primitive.triangles.astype(np.int64) + start for primitive, start in zip(primitives, starts, strict=True)
    ]
    return np.concatenate([np.zeros((0, 3)), *positions]), np.concatenate([np.zeros((0, 3), np.int64), *triangles])


def _moved(
    primitive: Primitive, weights: NDArray[np.float64], matrices: NDArray[np.float64], skinned: bool
) -> NDArray[np.float64]:
    moved = np.empty((len(primitive.positions), 3))
    active = np.flatnonzero(weights)
    for start in range(0, len(moved), _BLOCK):
        block = slice(start, start + _BLOCK)
        vertices = primitive.positions[block].astype(np.float64)
        for morph in active:
            vertices += weights[morph] * primitive.morph_positions[morph, block]
        if skinned and primitive.joints is not None and primitive.weights is not None:
            blended = np.zeros((len(vertices), 3, 4))
            for joint, weight in zip(primitive.joints[block].T, primitive.weights[block].T, strict=True):
                blended += weight.astype(np.float64)[:, None, None] * matrices[joint, :3]
        else:
            blended = matrices[0, :3]
        moved[block] = (blended[..., :3] @ vertices[:, :, None])[..., 0] + blended[..., 3]
    return moved
