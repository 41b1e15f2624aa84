"""From stored positions to metres: what the skin does to a mesh in the rest pose."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.glb_asset import GlbAsset, Primitive
from garmentc.gltf.state import rest_state, world_matrices


def rest_joint_matrices(asset: GlbAsset, mesh_node: int) -> NDArray[np.float64]:
    """(J, 4, 4): what each joint does to a stored position at rest; (1, 4, 4) for a mesh without a skin.

    In a sound file all are equal: the identity, or the dequantization that was folded into them.
    """
    world = world_matrices(asset, rest_state(asset))
    skin_index = asset.nodes[mesh_node].skin
    if skin_index is None:
        return world[[mesh_node]]
    skin = asset.skins[skin_index]
    matrices: NDArray[np.float64] = world[list(skin.joints)] @ skin.inverse_bind_matrices.astype(np.float64)
    return matrices


def dense_weights(primitive: Primitive, joint_count: int) -> NDArray[np.float32]:
    """Blend weights (S, J) of all influence sets together; zeros where the primitive has none."""
    dense = np.zeros((len(primitive.positions), joint_count), dtype=np.float32)
    if primitive.joints is not None and primitive.weights is not None:
        rows = np.arange(len(dense))
        for joint, weight in zip(primitive.joints.T, primitive.weights.T, strict=True):
            dense[rows, joint] += weight
    return dense


def morph_sizes(asset: GlbAsset, mesh_node: int) -> NDArray[np.float64]:
    """(M,) the farthest that each morph target moves a vertex at weight 1, metres at rest."""
    mesh = asset.nodes[mesh_node].mesh
    if mesh is None:
        return np.zeros(0)
    linear = rest_joint_matrices(asset, mesh_node)[0, :3, :3]
    sizes = np.zeros(asset.meshes[mesh].morph_count)
    for primitive in asset.meshes[mesh].primitives:
        for morph, deltas in enumerate(primitive.morph_positions):
            sizes[morph] = max(sizes[morph], _largest_row(deltas @ linear.T))
    return sizes


def moved_at_most(asset: GlbAsset, mesh_node: int, weights: NDArray[Any]) -> NDArray[np.float64]:
    """(T,) metres that weights (T, K) of the first K morph targets move any vertex at rest, or more.

    The sum of what each target moves, or that of what each differs from the mean, and the mean of all together, which
    is next to nothing where targets sum to nothing: whichever is less.
    """
    count = weights.shape[1]
    mesh = asset.nodes[mesh_node].mesh
    sizes = morph_sizes(asset, mesh_node)[:count]
    if mesh is None or not len(sizes):
        return np.zeros(len(weights))
    linear = rest_joint_matrices(asset, mesh_node)[0, :3, :3]
    primitives = asset.meshes[mesh].primitives
    sums = [part.morph_positions[:count].sum(axis=0, dtype=np.float64) for part in primitives]
    together = max(_largest_row(each @ linear.T) for each in sums)
    mean = weights.mean(axis=1)
    apart = np.abs(weights - mean[:, None]) @ sizes + np.abs(mean) * together
    least: NDArray[np.float64] = np.minimum(np.abs(weights) @ sizes, apart)
    return least


def _largest_row(rows: NDArray[Any]) -> float:
    return float(np.linalg.norm(rows, axis=1).max())
