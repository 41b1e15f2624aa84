"""Texture coordinates like a sewing pattern: front and back panels laid flat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garmentc.simulation.body_field import Array
from garmentc.simulation.surface import Faces, boundary_edges, compact, face_normals

_GAP = 0.02
_SMOOTHING = 20
_ROUNDS = 30


@dataclass(frozen=True)
class Panels:
    """Flat cloth.

    texcoords  (T, 2) metres, v up the body; panels lie side by side and do not overlap
    corners    (F, 3) int32 into `texcoords`
    panel      (F,) int32: the panel of each triangle
    """

    texcoords: Array
    corners: Faces
    panel: NDArray[np.int32]


def lay_flat(vertices: Array, triangles: Faces, part: NDArray[np.int32], partner: NDArray[np.int32]) -> Panels:
    """Cut every garment at its sides into a front and a back and flatten them as rigidly as possible.

    part     (F,) garment of each triangle
    partner  (F,) as of `pair_triangles`; both halves of a quad go to the same panel
    """
    panel = _panels(vertices, triangles, part, partner)
    texcoords, corners = [], np.zeros_like(triangles)
    start, offset = 0, 0.0
    for index in range(panel.max() + 1):
        chosen = panel == index
        places, local = compact(vertices, triangles[chosen])
        flat = _flatten(places, local)
        flat += [offset - flat[:, 0].min(), -flat[:, 1].min()]
        offset = float(flat[:, 0].max()) + _GAP
        texcoords.append(flat)
        corners[chosen] = local + start
        start += len(flat)
    return Panels(np.concatenate(texcoords), corners, panel)


def _panels(
    vertices: Array, triangles: Faces, part: NDArray[np.int32], partner: NDArray[np.int32]
) -> NDArray[np.int32]:
    from scipy.sparse import coo_array, eye_array
    from scipy.sparse.csgraph import connected_components

    count = len(triangles)
    a, b = _neighbours(triangles)
    adjacency = coo_array((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(count, count)).tocsr()
    spread = adjacency + eye_array(count)
    degree = np.asarray(spread.sum(1))
    normal = face_normals(vertices, triangles)
    forward = normal[:, 2] / np.maximum(np.linalg.norm(normal, axis=1), 1e-30)
    for _ in range(_SMOOTHING):
        forward = (spread @ forward) / degree
    paired = partner >= 0
    forward[paired] = 0.5 * (forward[paired] + forward[partner[paired]])
    front = forward > 0
    for _ in range(2):
        same = (front[a] == front[b]) & (part[a] == part[b])
        graph = coo_array((np.ones(same.sum()), (a[same], b[same])), shape=(count, count))
        _, piece = connected_components(graph, directed=False)
        # Crumbs go to the panel around them.
        size = np.bincount(piece)
        largest = np.zeros(part.max() + 1, dtype=np.int64)
        np.maximum.at(largest, part, size[piece])
        front = front ^ (size[piece] < 0.08 * largest[part])
    _, first, number = np.unique(piece, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    return np.asarray(rank[number].astype(np.int32))


def _neighbours(triangles: Faces) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of triangles that share a side."""
    sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    order = np.lexsort(sides.T)
    twin = np.nonzero((sides[order][1:] == sides[order][:-1]).all(1))[0]
    return order[twin] % len(triangles), order[twin + 1] % len(triangles)


def _flatten(vertices: Array, triangles: Faces) -> Array:
    """(V, 2) by least-squares conformal maps, then as-rigid-as-possible rounds (Liu et al. 2008); metres."""
    import igl

    rim = np.unique(boundary_edges(triangles))
    far = rim[np.argmax(np.linalg.norm(vertices[rim] - vertices[rim[0]], axis=1))]
    pins = np.array([rim[0], far])
    targets = np.array([[0.0, 0.0], [np.linalg.norm(vertices[far] - vertices[rim[0]]), 0.0]])
    flat = np.asarray(igl.lscm(vertices, triangles.astype(np.int64), pins, targets)[0])
    area = np.linalg.norm(face_normals(vertices, triangles), axis=1).sum()
    signed = _signed_areas(flat, triangles).sum()
    flat = flat * np.sqrt(area / np.abs(signed)) * [1.0, np.sign(signed)]
    flat = _rigid_rounds(vertices, triangles, flat)
    # Turn it so that the body's up is up.
    height = vertices[:, 1] - vertices[:, 1].mean()
    slope = ((flat - flat.mean(0)) * height[:, None]).sum(0)
    cosine, sine = slope[1] / np.linalg.norm(slope), slope[0] / np.linalg.norm(slope)
    return np.asarray(flat @ np.array([[cosine, sine], [-sine, cosine]]))


def _signed_areas(flat: Array, triangles: Faces) -> Array:
    one, two = flat[triangles[:, 1]] - flat[triangles[:, 0]], flat[triangles[:, 2]] - flat[triangles[:, 0]]
    return np.asarray(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])


def _rigid_rounds(vertices: Array, triangles: Faces, flat: Array) -> Array:
    import igl

    data = igl.ARAPData()
    data.max_iter = _ROUNDS
    data.with_dynamics = True  # nothing is pinned, so inertia makes the system definite
    igl.arap_precomputation(vertices, triangles.astype(np.int64), 2, np.zeros(0, np.int32), data)
    return np.asarray(igl.arap_solve(np.zeros((0, 2)), data, flat))
