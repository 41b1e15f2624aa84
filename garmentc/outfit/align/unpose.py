"""From the pose an outfit was modelled in to the T-pose: linear blend skinning undone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.outfit import Outfit
from garmentc.outfit.topology import edges, unit_rows, weld
from garmentc.smpl.body import BodyModel
from garmentc.smpl.nearest import surface_body_weights
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skinning import joint_transforms

STRETCH = 2.0
"""Edges that unposing makes this many times longer (or shorter, squared) get smoother weights."""

ROUNDS = 60


def unpose(
    outfit: Outfit, body: BodyModel, pose: NDArray[np.float64], betas: NDArray[Any] | None = None
) -> tuple[Outfit, NDArray[np.float64]]:
    """`outfit`, worn by `body` in `pose` (24, 3), in the T-pose; and the blend weights (V, 24) that took it there.

    Each vertex has the weights of the closest skin of the posed body, and goes back by the inverse of its blended
    transform. In the armpits and between the legs neighbours may be closest to different limbs; where that tears an
    edge the weights are averaged over the mesh around it, until no edge more than doubles.
    Normals follow (by the transposed transform) and are split where vertices that share one turn differently.
    """
    joints = body.joints(betas).astype(np.float64)
    transforms = joint_transforms(axis_angle_to_matrix(pose), joints)
    on_body = _blended(body.weights.astype(np.float64), transforms)
    worn = np.einsum("nij,nj->ni", on_body[..., :3], body.shaped(betas)) + on_body[..., 3]
    weights = surface_body_weights(outfit.vertices, worn, body).astype(np.float64)

    welded = weld(outfit)
    member = np.flatnonzero(welded.vertex_of >= 0)
    first = np.zeros(len(welded.vertices), dtype=np.int64)
    first[welded.vertex_of[member[::-1]]] = member[::-1]
    smooth = _untorn(welded.vertices, edges(welded.triangles), weights[first], transforms)
    weights[member] = smooth[welded.vertex_of[member]]

    blended = _blended(weights, transforms)
    vertices = _inverse(blended, outfit.vertices)
    normals, tri_vn = _unposed_normals(outfit, blended)
    return replace(outfit, vertices=vertices, normals=normals, tri_vn=tri_vn), weights


def _untorn(
    vertices: NDArray[np.float64],
    mesh_edges: NDArray[np.int32],
    weights: NDArray[np.float64],
    transforms: NDArray[np.float64],
) -> NDArray[np.float64]:
    """`weights` (N, 24), averaged with their neighbours' around every edge (E, 2) that unposing would tear."""
    weights = weights.copy()
    length = np.linalg.norm(vertices[mesh_edges[:, 0]] - vertices[mesh_edges[:, 1]], axis=1)
    unposed = _inverse(_blended(weights, transforms), vertices)
    neighbours = _averaging(mesh_edges, len(vertices))
    near = np.arange(len(mesh_edges))  # only edges at vertices that changed can be torn anew
    for _ in range(ROUNDS):
        start, end = mesh_edges[near].T
        after = np.linalg.norm(unposed[start] - unposed[end], axis=1)
        torn = (after > STRETCH * length[near]) | (after < length[near] / STRETCH**2)
        if not torn.any():
            break
        marked = np.zeros(len(vertices), dtype=bool)
        marked[mesh_edges[near[torn]]] = True
        marked[mesh_edges[marked[mesh_edges].any(axis=1)]] = True
        near = np.flatnonzero(marked[mesh_edges].any(axis=1))
        index = np.flatnonzero(marked)
        weights[index] = (weights[index] + neighbours[index] @ weights) / 2
        unposed[index] = _inverse(_blended(weights[index], transforms), vertices[index])
    return weights


def _averaging(mesh_edges: NDArray[np.int32], count: int) -> Any:
    """Sparse (count, count) matrix that takes the mean over the neighbours by `mesh_edges` (E, 2)."""
    from scipy.sparse import coo_matrix

    rows, columns = np.concatenate([mesh_edges, mesh_edges[:, ::-1]]).T
    degree = np.bincount(rows, minlength=count)
    return coo_matrix((1 / degree[rows], (rows, columns)), shape=(count, count)).tocsr()


def _blended(weights: NDArray[np.float64], transforms: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3, 4) blended transforms. Not a matrix product: BLAS's last bits depend on the number of threads."""
    blended: NDArray[np.float64] = np.einsum("nj,jk->nk", weights, transforms[:, :3, :].reshape(-1, 12))
    return blended.reshape(-1, 3, 4)


def _inverse(blended: NDArray[np.float64], vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rest positions (N, 3) that `blended` (N, 3, 4) takes to `vertices` (N, 3)."""
    rest = np.linalg.solve(blended[..., :3], (vertices - blended[..., 3])[..., None])[..., 0]
    return rest.astype(np.float64, copy=False)


def _unposed_normals(outfit: Outfit, blended: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Normals of the T-pose and their corner indices: one per (vertex, normal) pair that corners use."""
    used = outfit.tri_vn >= 0
    if not used.any():
        return outfit.normals, outfit.tri_vn
    pairs = np.stack([outfit.tri_v[used], outfit.tri_vn[used]], axis=1)
    unique, inverse = np.unique(pairs, axis=0, return_inverse=True)
    vertex, normal = unique.T
    # Positions go by the inverse of M, so normals go by the transpose of M.
    turned = np.einsum("nji,nj->ni", blended[vertex, :, :3], outfit.normals[normal])
    tri_vn = outfit.tri_vn.copy()
    tri_vn[used] = inverse.reshape(-1)
    return unit_rows(turned), tri_vn
