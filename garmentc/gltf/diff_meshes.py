"""Differences of meshes: triangles, vertex attributes and morph targets, compared in metres at rest."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.bind import dense_weights, rest_joint_matrices
from garmentc.gltf.difference import Difference, DiffTolerances, apart, unequal
from garmentc.gltf.glb_asset import GlbAsset, Primitive

_TURNS = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1]])
_MILLIMETRES = (" mm", 1000.0)


def mesh_differences(left: GlbAsset, right: GlbAsset, tolerances: DiffTolerances) -> Iterator[Difference]:
    for index in left.mesh_nodes:
        mesh = left.nodes[index].mesh
        if mesh is None:
            continue
        matrices = rest_joint_matrices(left, index)[0], rest_joint_matrices(right, index)[0]
        joints = _joint_count(left, index), _joint_count(right, index)
        pairs = zip(left.meshes[mesh].primitives, right.meshes[mesh].primitives, strict=True)
        for number, (a, b) in enumerate(pairs):
            where = f"meshes/{mesh}/primitives/{number}"
            if len(a.positions) != len(b.positions) or len(a.triangles) != len(b.triangles):
                yield from unequal(f"{where}/vertices", len(a.positions), len(b.positions))
                yield from unequal(f"{where}/triangles", len(a.triangles), len(b.triangles))
                continue
            yield from _geometry(where, a, b, matrices, tolerances)
            weights = dense_weights(a, max(joints)), dense_weights(b, max(joints))
            yield from apart(f"{where}/WEIGHTS", *weights, tolerances.weight)


def _joint_count(asset: GlbAsset, mesh_node: int) -> int:
    skin = asset.nodes[mesh_node].skin
    return 1 if skin is None else len(asset.skins[skin].joints)


def _geometry(
    where: str,
    a: Primitive,
    b: Primitive,
    matrices: tuple[NDArray[np.float64], NDArray[np.float64]],
    tolerances: DiffTolerances,
) -> Iterator[Difference]:
    changed = int((_from_lowest(a.triangles) != _from_lowest(b.triangles)).any(axis=1).sum())
    if changed:
        yield Difference(f"{where}/indices", f"{changed} of {len(a.triangles)} triangles differ")
    linear, offset = zip(*((matrix[:3, :3].T, matrix[:3, 3]) for matrix in matrices), strict=True)
    positions = a.positions @ linear[0] + offset[0], b.positions @ linear[1] + offset[1]
    yield from apart(f"{where}/POSITION", *positions, tolerances.position, *_MILLIMETRES)
    yield from _optional(f"{where}/NORMAL", _unit(a.normals), _unit(b.normals), tolerances.normal)
    yield from _optional(f"{where}/TANGENT", _unit(a.tangents), _unit(b.tangents), tolerances.normal)
    yield from _optional(f"{where}/TEXCOORD_0", a.texcoords, b.texcoords, tolerances.texcoord)
    yield from _optional(f"{where}/COLOR_0", a.colors, b.colors, tolerances.color)
    for morph, (x, y) in enumerate(zip(a.morph_positions, b.morph_positions, strict=True)):
        deltas = x @ linear[0], y @ linear[1]
        yield from apart(f"{where}/targets/{morph}/POSITION", *deltas, tolerances.position, *_MILLIMETRES)
    if a.morph_normals is None or b.morph_normals is None:
        yield from unequal(f"{where}/targets/NORMAL", a.morph_normals is not None, b.morph_normals is not None)
        return
    for morph, (x, y) in enumerate(zip(a.morph_normals, b.morph_normals, strict=True)):
        yield from apart(f"{where}/targets/{morph}/NORMAL", x, y, tolerances.normal)


def _from_lowest(triangles: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Triangles (F, 3) turned so that their lowest index comes first: compression turns them, and nobody can see it."""
    turned: NDArray[np.uint32] = triangles[np.arange(len(triangles))[:, None], _TURNS[triangles.argmin(axis=1)]]
    return turned


def _optional(where: str, a: NDArray[Any] | None, b: NDArray[Any] | None, tolerance: float) -> Iterator[Difference]:
    if a is None or b is None:
        yield from unequal(where, a is not None, b is not None)
    else:
        yield from apart(where, a, b, tolerance)


def _unit(normals: NDArray[np.float32] | None) -> NDArray[Any] | None:
    """Quantized normals and tangents are not quite of unit length, and engines normalise them."""
    if normals is None:
        return None
    length = np.linalg.norm(normals[:, :3], axis=1, keepdims=True)
    return np.concatenate([normals[:, :3] / np.where(length > 0, length, 1), normals[:, 3:]], axis=1)
