"""Checks of the pose-key network and its two copies."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from garmentc.errors import GarmentcError
from garmentc.gltf.bind import moved_at_most
from garmentc.gltf.finding import Finding, error, warning
from garmentc.gltf.glb_asset import GlbAsset, PoseKeyNetwork
from garmentc.gltf.pose_keys import EXTENSION
from garmentc.gltf.posing import evaluate_network, pose_key_network
from garmentc.gltf.state import rest_state

_REST_TOLERANCE = 1e-6
"""Metres that the network may move a vertex at rest."""


def pose_key_findings(asset: GlbAsset) -> Iterator[Finding]:
    if any(mesh.pose_keys for mesh in asset.meshes) and EXTENSION not in asset.extensions_used:
        yield error("extension-listed", "extensionsUsed", f"{EXTENSION} is used and not listed")
    if EXTENSION in asset.extensions_required:
        message = f"{EXTENSION} is listed, so engines that do not know it refuse the file"
        yield error("extension-required", "extensionsRequired", message)
    for index in asset.mesh_nodes:
        network = pose_key_network(asset, index)
        if network is not None:
            yield from _network(asset, index, network)


def _network(asset: GlbAsset, index: int, network: PoseKeyNetwork) -> Iterator[Finding]:
    node = asset.nodes[index]
    mesh = asset.meshes[node.mesh or 0]
    where = f"meshes/{node.mesh}/extensions/{EXTENSION}"
    if mesh.pose_keys is None:
        yield warning("pose-key-copies", where, "the extension is missing; the copy in the node's extras is used")
    elif node.pose_keys is None:
        yield warning("pose-key-copies", f"nodes/{index}/extras", "there is no copy of the pose keys here")
    elif not _same(mesh.pose_keys, node.pose_keys):
        yield error(
            "pose-key-copies", where, "the extension and the copy in the node's extras are not the same network"
        )
    outputs = len(network.layers[-1].bias)
    if outputs > mesh.morph_count:
        yield error("pose-key-outputs", where, f"{outputs} outputs for only {mesh.morph_count} morph targets")
        return
    skin = None if node.skin is None else asset.skins[node.skin]
    if skin is None or network.joints != skin.joints:
        yield error("pose-key-joints", where, "the joints are not those of the skin, in its order")
        return
    try:
        keys = evaluate_network(asset, network, rest_state(asset))
    except GarmentcError as failure:
        yield error("pose-key-encoding", where, failure.message)
        return
    [moved] = moved_at_most(asset, index, keys[None])
    if moved > _REST_TOLERANCE:
        yield error(
            "pose-key-rest", where, f"the network moves vertices by up to {moved * 1000:.3g} mm in the rest pose"
        )


def _same(a: PoseKeyNetwork, b: PoseKeyNetwork) -> bool:
    return (
        (a.encoding, a.joints, len(a.layers)) == (b.encoding, b.joints, len(b.layers))
        and all(x.activation == y.activation for x, y in zip(a.layers, b.layers, strict=True))
        and all(np.array_equal(x.weight, y.weight) for x, y in zip(a.layers, b.layers, strict=True))
        and all(np.array_equal(x.bias, y.bias) for x, y in zip(a.layers, b.layers, strict=True))
    )
