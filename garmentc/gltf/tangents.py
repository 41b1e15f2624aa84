"""Tangents for normal maps (glTF 2.0 section 3.7.2.1): engines that make their own do not agree with one another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.corners import CornerPrimitive
from garmentc.outfit.topology import corner_angles, unit_rows


def vertex_tangents(vertices: NDArray[np.float64], corners: CornerPrimitive) -> NDArray[np.float32]:
    """Unit tangents (S, 4): the direction in which u grows, and the sign of the bitangent in w.

    As in MikkTSpace, the tangents of the triangles around a vertex are laid into its tangent plane and averaged by
    corner angle. Where a texture is mirrored across a vertex, that vertex takes the side with the larger angle.

    vertices  (S, 3) positions of the primitive's vertices
    """
    assert corners.texcoords is not None
    triangles, normals = corners.triangles.astype(np.int64), corners.normals.astype(np.float64)
    along_u, sign = _triangle_tangents(vertices, corners.texcoords.astype(np.float64), triangles)
    owner = triangles.reshape(-1)
    angle = corner_angles(vertices, triangles).reshape(-1)
    flat = _into_plane(along_u.repeat(3, axis=0), normals[owner]) * angle[:, None]
    summed = np.stack([np.bincount(owner, flat[:, axis], len(vertices)).astype(float) for axis in range(3)], axis=1)
    sides = np.bincount(owner, np.repeat(sign, 3) * angle, len(vertices))
    tangents = _into_plane(summed, normals)
    lost = ~tangents.any(axis=1)  # no area in the texture: any direction will do
    tangents[lost] = _into_plane(np.eye(3)[np.abs(normals[lost]).argmin(axis=1)], normals[lost])
    return np.concatenate([tangents, np.where(sides < 0, -1.0, 1.0)[:, None]], axis=1).astype(np.float32)


def _triangle_tangents(
    vertices: NDArray[np.float64], texcoords: NDArray[np.float64], triangles: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit direction of growing u (F, 3), zero where it is unknown, and 1 or -1 where the texture is mirrored."""
    first, second = (vertices[triangles[:, k]] - vertices[triangles[:, 0]] for k in (1, 2))
    du, dv = (
        np.stack([texcoords[triangles[:, k], axis] - texcoords[triangles[:, 0], axis] for k in (1, 2)])
        for axis in (0, 1)
    )
    area = du[0] * dv[1] - du[1] * dv[0]
    along_u = (first * dv[1][:, None] - second * dv[0][:, None]) * np.sign(area)[:, None]
    return unit_rows(along_u), -np.sign(area)  # v grows downwards, so an upright texture has a negative area


def _into_plane(vectors: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors in the planes across `normals`; zero where nothing is left."""
    inside = vectors - normals * np.einsum("ni,ni->n", vectors, normals)[:, None]
    inside[np.linalg.norm(inside, axis=1) < 1e-9] = 0
    return unit_rows(inside)
