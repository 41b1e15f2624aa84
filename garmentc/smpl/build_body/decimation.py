"""One coarse mesh for every body: 7,002 vertices instead of 13,380."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.build_body.t_pose import TPosed
from garmentc.smpl.skeleton import JOINT_NAMES

TRIANGLE_COUNT = 14000

_ID = {name: k for k, name in enumerate(JOINT_NAMES)}


@dataclass(frozen=True)
class CoarseMesh:
    """vertices: sparse (7002, 13380) barycentric coordinates on the fine mesh; triangles (14000, 3)."""

    vertices: Any  # scipy.sparse.csr_matrix
    triangles: NDArray[np.int64]


def decimate(body: TPosed, triangles: NDArray[np.int64], weights: NDArray[np.float64]) -> CoarseMesh:
    """Decimate the neutral T-posed body by quadric error, sparing the trunk and limbs that clothes lie on.

    `weights` (13380, 24) tell the body parts. Each coarse vertex is carried over to other bodies by the triangle of
    the fine mesh that it lies on.
    """
    import fast_simplification
    import scipy.sparse
    import trimesh

    warped = _density_warp(body, weights)
    points, faces = fast_simplification.simplify(
        warped.astype(np.float32), triangles.astype(np.int32), target_count=TRIANGLE_COUNT, agg=2
    )[:2]
    fine = trimesh.Trimesh(warped, triangles, process=False)
    nearest, _, triangle = trimesh.proximity.closest_point(fine, points.astype(np.float64))
    barycentric = np.clip(trimesh.triangles.points_to_barycentric(fine.triangles[triangle], nearest), 0, 1)
    barycentric /= barycentric.sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(len(points)), 3)
    entries = (barycentric.ravel(), (rows, triangles[triangle].ravel()))
    return CoarseMesh(scipy.sparse.csr_matrix(entries, shape=(len(points), len(body.vertices))), faces.astype(np.int64))


def _density_warp(body: TPosed, weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shrink head, hands and feet towards neck and wrists, so that fewer triangles are spent there."""
    head = weights[:, _ID["head"]] + 0.6 * weights[:, _ID["neck"]]
    hands = weights[:, [_ID[f"{side}_{part}"] for part in ("wrist", "hand") for side in ("left", "right")]].sum(axis=1)
    feet = weights[:, [_ID[f"{side}_{part}"] for part in ("ankle", "foot") for side in ("left", "right")]].sum(axis=1)
    scale = 1 - 0.55 * head - 0.45 * hands - 0.2 * feet
    wrist = np.where(body.vertices[:, :1] > 0, body.joints[_ID["left_wrist"]], body.joints[_ID["right_wrist"]])
    centre = np.where((head > 0.01)[:, None], body.joints[_ID["neck"]], wrist)
    warped: NDArray[np.float64] = centre + (body.vertices - centre) * scale[:, None]
    return warped


def four_largest(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights (V, 24) with all but the four largest of each row removed; rows sum to 1."""
    largest = np.argsort(-weights, axis=1)[:, :4]
    kept = np.zeros_like(weights)
    np.put_along_axis(kept, largest, np.take_along_axis(weights, largest, axis=1), axis=1)
    rows: NDArray[np.float64] = kept / kept.sum(axis=1, keepdims=True)
    return rows
