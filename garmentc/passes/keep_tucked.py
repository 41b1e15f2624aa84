"""Let what is tucked into a garment that its rim holds move with that garment."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.limit_influences import largest_weights
from garmentc.passes.pose_set import PoseSet
from garmentc.passes.posed_error import posed_error
from garmentc.passes.report import PassReport
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel
from garmentc.smpl.nearest import closest_on_surface

_BESIDE, _BENEATH = 0.5, 0.8
"""Cosines between the way to the closest cloth and its normal: from the first on a vertex begins to be beneath it, from
the second it is. What sticks out above a rim looks at it from the side."""


@dataclass(frozen=True)
class KeepTucked:
    """reach       metres: cloth farther beneath hangs by itself
    influences  joints that may move a vertex
    """

    reach: float = 0.03
    influences: int = 4


def keep_tucked(
    rig: Rig,
    options: KeepTucked,
    poses: PoseSet,
    held: NDArray[np.bool_],
    body: BodyModel,
    betas: NDArray[Any] | None = None,
) -> tuple[Rig, PassReport]:
    """Give vertices between the skin and `held` cloth (N,) the weights and blend shapes of the place that covers them.

    A shirt's tails in a skirt or in trousers are seen only where they come through, and neither networks nor the passes
    before this one know of layers. With the movement of what covers them they stay beneath it.
    """
    rows, triangles, barycentric, share = _tucked(rig, held, options.reach, body.shaped(betas), body.faces)
    if not len(rows):
        return rig, PassReport("keep tucked", "nothing is tucked into held cloth")
    weights, shapes = rig.weights.copy(), rig.blend_shapes.copy()
    covering = np.einsum("nk,nkj->nj", barycentric, rig.weights[triangles])
    mixed = share[:, None] * covering + (1 - share[:, None]) * rig.weights[rows]
    weights[rows] = largest_weights(mixed, options.influences)
    corners = zip(barycentric.T[:, :, None], triangles.T, strict=True)
    moved = sum(amount * rig.blend_shapes[:, corner] for amount, corner in corners)
    shapes[:, rows] = share[:, None] * moved + (1 - share[:, None]) * rig.blend_shapes[:, rows]
    kept = replace(rig, weights=weights, blend_shapes=shapes, blend_normals=None)
    detail = f"{len(rows)} vertices move with the cloth that covers them; moved {posed_error(rig, kept, poses.check)}"
    return kept, PassReport("keep tucked", detail)


def _tucked(
    rig: Rig, held: NDArray[np.bool_], reach: float, skin: NDArray[Any], faces: NDArray[Any]
) -> tuple[NDArray[np.intp], NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
    """Rows of what held cloth covers (n,), the triangles (n, 3) that do and where (n, 3), and how fully (n,)."""
    template = rig.template.astype(np.float64)
    cover, others = rig.triangles[held[rig.triangles].all(axis=1)], np.flatnonzero(~held)
    if not len(cover) or not len(others):
        return np.zeros(0, np.intp), np.zeros((0, 3), np.int32), np.zeros((0, 3)), np.zeros(0)
    closest = closest_on_surface(template[others], template, cover)
    near = closest.distance < reach
    others, triangles = others[near], cover[closest.face[near]]
    point, barycentric = closest.point[near], closest.barycentric[near]
    inner = closest_on_surface(template[others], skin, faces).distance
    outer = closest_on_surface(point, skin, faces).distance
    a, b, c = (template[triangles[:, k]] for k in range(3))
    normal, way = np.cross(b - a, c - a), template[others] - point
    sizes = np.linalg.norm(normal, axis=1) * np.linalg.norm(way, axis=1)
    cosine = np.abs(np.einsum("ni,ni->n", normal, way)) / np.maximum(sizes, np.finfo(float).tiny)
    share = np.clip((cosine - _BESIDE) / (_BENEATH - _BESIDE), 0, 1) * (inner < outer)
    rows = np.flatnonzero(share)
    return others[rows], triangles[rows], barycentric[rows], share[rows]
