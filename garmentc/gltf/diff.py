"""What differs between two .glb files, in meaning rather than in bytes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from garmentc.gltf.diff_animations import animation_differences
from garmentc.gltf.diff_materials import material_differences
from garmentc.gltf.diff_meshes import mesh_differences
from garmentc.gltf.difference import Difference, DiffTolerances, apart, unequal
from garmentc.gltf.glb_asset import GlbAsset
from garmentc.gltf.posing import evaluate_network, pose_key_network, state_at_pose
from garmentc.gltf.state import rest_state, world_matrices
from garmentc.smpl.pose_sampler import sample_poses

_DEFAULT = DiffTolerances()
_POSES = 16
"""Poses at which two pose-key networks are compared."""


def diff_glb(left: GlbAsset, right: GlbAsset, tolerances: DiffTolerances = _DEFAULT) -> tuple[Difference, ...]:
    """All differences, from the coarse to the fine; none where the files mean the same within the tolerances.

    How things are stored (quantized or not, sparse or not, order of influences, left-out keyframes) does not count, nor
    do the generator's name and the asset's extras.
    """
    structure = tuple(_structure(left, right))
    if structure:
        return structure
    checks = (_joints, mesh_differences, _pose_keys, animation_differences, material_differences)
    return tuple(difference for check in checks for difference in check(left, right, tolerances))


def _structure(left: GlbAsset, right: GlbAsset) -> Iterator[Difference]:
    yield from unequal("nodes", [node.name for node in left.nodes], [node.name for node in right.nodes])
    yield from unequal("nodes/parents", [node.parent for node in left.nodes], [node.parent for node in right.nodes])
    yield from unequal("nodes/meshes", [node.mesh for node in left.nodes], [node.mesh for node in right.nodes])
    yield from unequal("skins", [skin.joints for skin in left.skins], [skin.joints for skin in right.skins])
    yield from unequal("meshes", len(left.meshes), len(right.meshes))
    for index, (a, b) in enumerate(zip(left.meshes, right.meshes, strict=False)):
        where = f"meshes/{index}"
        yield from unequal(f"{where}/name", a.name, b.name)
        yield from unequal(f"{where}/primitives", len(a.primitives), len(b.primitives))
        yield from unequal(f"{where}/targets", a.morph_count, b.morph_count)
        yield from unequal(f"{where}/extras/targetNames", a.target_names, b.target_names)


def _joints(left: GlbAsset, right: GlbAsset, tolerances: DiffTolerances) -> Iterator[Difference]:
    a, b = (world_matrices(asset, rest_state(asset)) for asset in (left, right))
    yield from apart("nodes/translation", a[:, :3, 3], b[:, :3, 3], tolerances.position, " mm", 1000)
    yield from apart("nodes/rotation", a[:, :3, :3], b[:, :3, :3], tolerances.rotation)


def _pose_keys(left: GlbAsset, right: GlbAsset, tolerances: DiffTolerances) -> Iterator[Difference]:
    for index in left.mesh_nodes:
        where = f"nodes/{index}/pose_keys"
        a, b = pose_key_network(left, index), pose_key_network(right, index)
        if a is None or b is None:
            yield from unequal(where, a is not None, b is not None)
            continue
        yield from unequal(f"{where}/encoding", a.encoding, b.encoding)
        if a.encoding != b.encoding:
            continue
        states = [(state_at_pose(left, pose), state_at_pose(right, pose)) for pose in sample_poses(_POSES, seed=0)]
        keys = [(evaluate_network(left, a, x), evaluate_network(right, b, y)) for x, y in states]
        outputs = np.array([x for x, _ in keys]), np.array([y for _, y in keys])
        yield from apart(where, outputs[0].T, outputs[1].T, tolerances.key * _POSES**0.5)
