"""What moves in a .glb: the local transforms of its nodes and its morph weights, and where that puts the nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.glb_asset import GlbAsset


@dataclass(frozen=True)
class State:
    """All nodes of an asset at one moment, float64.

    translation  (n, 3) metres, relative to the parent node
    rotation     (n, 4) quaternions x, y, z, w
    scale        (n, 3)
    weights      (M,) morph weights by mesh node
    """

    translation: NDArray[np.float64]
    rotation: NDArray[np.float64]
    scale: NDArray[np.float64]
    weights: dict[int, NDArray[np.float64]]


def rest_state(asset: GlbAsset) -> State:
    """The file as it is loaded. A node's own weights win over its mesh's (glTF 2.0 section 3.7.2.2)."""
    weights = {}
    for index in asset.mesh_nodes:
        node = asset.nodes[index]
        own = node.weights if node.weights is not None else asset.meshes[node.mesh or 0].weights
        weights[index] = np.array(own, dtype=np.float64)
    return State(
        translation=np.array([node.translation for node in asset.nodes], dtype=np.float64).reshape(-1, 3),
        rotation=np.array([node.rotation for node in asset.nodes], dtype=np.float64).reshape(-1, 4),
        scale=np.array([node.scale for node in asset.nodes], dtype=np.float64).reshape(-1, 3),
        weights=weights,
    )


def world_matrices(asset: GlbAsset, state: State) -> NDArray[np.float64]:
    """Global transforms of all nodes, (n, 4, 4)."""
    local = _local_matrices(asset, state)
    world = np.zeros_like(local)
    done = [False] * len(local)
    for index in range(len(local)):
        chain = []
        at: int | None = index
        while at is not None and not done[at]:
            chain.append(at)
            at = asset.nodes[at].parent
        for link in reversed(chain):
            parent = asset.nodes[link].parent
            world[link] = local[link] if parent is None else world[parent] @ local[link]
            done[link] = True
    return world


def _local_matrices(asset: GlbAsset, state: State) -> NDArray[np.float64]:
    x, y, z, w = (state.rotation / np.linalg.norm(state.rotation, axis=1, keepdims=True)).T
    local = np.zeros((len(asset.nodes), 4, 4))
    local[:, 0, 0], local[:, 0, 1], local[:, 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    local[:, 1, 0], local[:, 1, 1], local[:, 1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    local[:, 2, 0], local[:, 2, 1], local[:, 2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    local[:, :3, :3] *= state.scale[:, None]
    local[:, :3, 3] = state.translation
    local[:, 3, 3] = 1
    for index, node in enumerate(asset.nodes):
        if node.matrix is not None:
            local[index] = node.matrix
    return local
