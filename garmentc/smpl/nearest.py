"""The body surface nearest to points: distances, and the body's blend weights carried over to cloth.

`body_vertices` are those of the body as it stands, shaped and perhaps posed; `body` brings its faces and weights.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.body import BodyModel


@dataclass(frozen=True)
class ClosestPoints:
    """Where a triangle mesh is closest to N points.

    distance     (N,) metres, unsigned
    face         (N,) index of the triangle
    point        (N, 3) the closest point itself
    barycentric  (N, 3) its coordinates in that triangle, in [0, 1], rows sum to 1
    """

    distance: NDArray[np.float64]
    face: NDArray[np.int64]
    point: NDArray[np.float64]
    barycentric: NDArray[np.float64]


def closest_on_surface(points: NDArray[Any], vertices: NDArray[Any], faces: NDArray[Any]) -> ClosestPoints:
    """Exact closest points on the triangle mesh `vertices` (V, 3), `faces` (F, 3) to `points` (N, 3)."""
    import igl

    p, v, f = _as_igl(points), _as_igl(vertices), np.ascontiguousarray(faces, dtype=np.int64)
    squared, face, closest = igl.point_mesh_squared_distance(p, v, f)
    corners = v[f[face]]
    return ClosestPoints(np.sqrt(squared), face, closest, _barycentric(closest, corners))


def signed_distance(points: NDArray[Any], vertices: NDArray[Any], faces: NDArray[Any]) -> NDArray[np.float64]:
    """Exact distance of `points` (N, 3) to a closed mesh, metres, negative inside; returns (N,).

    The sign comes from the pseudonormal of the closest face, edge or vertex (Baerentzen and Aanaes 2005), which is
    exact for a watertight surface that does not intersect itself. Where posed limbs pass through each other it is the
    side of the nearest sheet of skin.
    """
    import igl

    p, v, f = _as_igl(points), _as_igl(vertices), np.ascontiguousarray(faces, dtype=np.int64)
    distance: NDArray[np.float64] = igl.signed_distance(p, v, f, sign_type=igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL)[0]
    return distance


def nearest_vertex(points: NDArray[Any], vertices: NDArray[Any]) -> NDArray[np.int64]:
    """Index of the nearest of `vertices` (V, 3) to each of `points` (N, 3); returns (N,)."""
    import igl

    elements = np.arange(len(vertices), dtype=np.int64)[:, None]
    index: NDArray[np.int64] = igl.point_mesh_squared_distance(_as_igl(points), _as_igl(vertices), elements)[1]
    return index


def nearest_body_weights(points: NDArray[Any], body_vertices: NDArray[Any], body: BodyModel) -> NDArray[Any]:
    """Blend weights (N, 24) of the body vertex nearest to each point: the baseline "nearest" that others must beat.

    points         (N, 3) metres
    body_vertices  (V, 3) the body in the pose and shape that the points belong to
    """
    weights: NDArray[Any] = body.weights[nearest_vertex(points, body_vertices)]
    return weights


def surface_body_weights(points: NDArray[Any], body_vertices: NDArray[Any], body: BodyModel) -> NDArray[Any]:
    """Blend weights (N, 24) at the closest point of the body's surface, interpolated within its triangle.

    Continuous along the skin, where `nearest_body_weights` jumps from vertex to vertex. Shapes as there; rows sum to 1.
    """
    closest = closest_on_surface(points, body_vertices, body.faces)
    weights: NDArray[Any] = np.einsum("nk,nkj->nj", closest.barycentric, body.weights[body.faces[closest.face]])
    return weights.astype(body.dtype)


def _as_igl(array: NDArray[Any]) -> NDArray[np.float64]:
    return np.ascontiguousarray(array, dtype=np.float64)


def _barycentric(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Barycentric coordinates (N, 3) of `points` (N, 3) that lie in triangles `corners` (N, 3, 3).

    Least squares over the two edges (Ericson 2005, section 3.4), clipped to the triangle. A triangle without area has
    no such coordinates: its nearest corner gets everything.
    """
    edge_1, edge_2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    offset = points - corners[:, 0]
    d11 = np.einsum("ij,ij->i", edge_1, edge_1)
    d12 = np.einsum("ij,ij->i", edge_1, edge_2)
    d22 = np.einsum("ij,ij->i", edge_2, edge_2)
    d1, d2 = np.einsum("ij,ij->i", offset, edge_1), np.einsum("ij,ij->i", offset, edge_2)
    determinant = d11 * d22 - d12 * d12
    flat = determinant <= 1e-12 * np.maximum(d11, d22) ** 2
    safe = np.where(flat, 1, determinant)
    second, third = (d22 * d1 - d12 * d2) / safe, (d11 * d2 - d12 * d1) / safe
    coordinates: NDArray[np.float64] = np.clip(np.stack([1 - second - third, second, third], axis=1), 0, 1)
    if flat.any():
        corner = np.linalg.norm(corners[flat] - points[flat, None], axis=-1).argmin(axis=1)
        coordinates[flat] = np.eye(3)[corner]
    coordinates /= coordinates.sum(axis=1, keepdims=True)
    return coordinates
