"""Is a .glb a sound garment? Checks of meaning, which the Khronos validator cannot make."""

from __future__ import annotations

from collections.abc import Iterator
from operator import eq

import numpy as np

from garmentc.gltf.bind import rest_joint_matrices
from garmentc.gltf.finding import Finding, error, warning
from garmentc.gltf.glb_asset import GlbAsset
from garmentc.gltf.skeletons import SKELETONS, skeleton_of
from garmentc.gltf.validate_animation import animation_findings
from garmentc.gltf.validate_mesh import mesh_findings
from garmentc.gltf.validate_pose_keys import pose_key_findings
from garmentc.smpl.skeleton import JOINT_NAMES, PARENTS

_BIND_TOLERANCE = 1e-5
"""Metres, or parts of 1, that joint matrices may differ from one another at rest."""


def validate_glb(asset: GlbAsset) -> tuple[Finding, ...]:
    """All findings, in the order of the file; none for a file that garmentc wrote."""
    return tuple(
        finding
        for check in (_nodes, _skins, mesh_findings, pose_key_findings, animation_findings)
        for finding in check(asset)
    )


def _nodes(asset: GlbAsset) -> Iterator[Finding]:
    if not asset.mesh_nodes:
        yield error("no-mesh", "nodes", "no node shows a mesh")
    for index, node in enumerate(asset.nodes):
        where = f"nodes/{index}"
        if abs(np.linalg.norm(node.rotation) - 1) > 1e-4:
            yield error("rotation-norm", where, f"the rotation has length {np.linalg.norm(node.rotation):.6g}, not 1")
        if node.weights is not None:
            yield warning("node-weights", where, "several tools ignore the weights of nodes; put them on the mesh")
        if node.mesh is None:
            continue
        if node.skin is None:
            yield error("no-skin", where, "the mesh has no skin, so it does not follow the body")
        elif node.parent is not None:
            yield warning("skinned-not-root", where, "a skinned mesh belongs at the root of the scene")


def _skins(asset: GlbAsset) -> Iterator[Finding]:
    for index, skin in enumerate(asset.skins):
        where = f"skins/{index}"
        names = tuple(asset.nodes[joint].name for joint in skin.joints)
        if len(names) != len(JOINT_NAMES):
            yield error("joint-count", where, f"the skin has {len(names)} joints where SMPL has {len(JOINT_NAMES)}")
        elif skeleton_of(names) is None:
            wrong, expected = _first_wrong(names)
            yield error("joint-names", where, f"joint {wrong} is {names[wrong]!r} where {expected} is expected")
        else:
            yield from _hierarchy(asset, skin.joints, where)
    for index in asset.mesh_nodes:
        if asset.nodes[index].skin is None:
            continue
        matrices = rest_joint_matrices(asset, index)
        where = f"skins/{asset.nodes[index].skin}"
        spread = np.abs(matrices - matrices[0]).max(axis=(1, 2))
        if spread.max() > _BIND_TOLERANCE:
            worst = asset.nodes[asset.skins[asset.nodes[index].skin or 0].joints[int(spread.argmax())]].name
            message = (
                f"the inverse bind matrix of {worst!r} is not the inverse of its rest transform: {spread.max():.3g} off"
            )
            yield error("bind-pose", where, message)
        linear = matrices[0, :3, :3]
        if np.abs(linear - np.eye(3) * linear[0, 0]).max() > _BIND_TOLERANCE or linear[0, 0] <= 0:
            yield error("bind-pose", where, "the inverse bind matrices turn or stretch the mesh at rest")


def _first_wrong(names: tuple[str, ...]) -> tuple[int, str]:
    """The first joint whose name is not that of the skeleton which most names are of, and what it should be."""
    closest = max(SKELETONS.values(), key=lambda skeleton: sum(map(eq, names, skeleton.joints)))
    wrong = next(k for k, name in enumerate(closest.joints) if names[k] != name)
    return wrong, repr(closest.joints[wrong])


def _hierarchy(asset: GlbAsset, joints: tuple[int, ...], where: str) -> Iterator[Finding]:
    for joint, parent in enumerate(PARENTS):
        if parent >= 0 and asset.nodes[joints[joint]].parent != joints[parent]:
            names = asset.nodes[joints[joint]].name, asset.nodes[joints[parent]].name
            message = f"{names[0]!r} does not hang on {names[1]!r}, as in SMPL"
            yield error("joint-hierarchy", where, message)
