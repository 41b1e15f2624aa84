"""Normals that move with the blend shapes, so that light follows folds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import vertex_normals
from garmentc.passes.key_reach import key_reach
from garmentc.passes.pose_set import PoseSet
from garmentc.passes.report import PassReport
from garmentc.rig import Rig


@dataclass(frozen=True)
class MorphNormals:
    """No settings."""


def morph_normals(rig: Rig, options: MorphNormals, poses: PoseSet) -> tuple[Rig, PassReport]:
    """Add normal deltas: how far each blend shape turns the normals of the template.

    Engines add them as they add positions, linearly, but a normal turns along a curve. So the delta is the chord to
    the shape at its typical amount (see `key_reach`), divided by that amount: right there, close elsewhere.
    Vertices whose triangles do not move get exactly 0.
    """
    if not rig.morph_count:
        return rig, PassReport("morph normals", "no blend shapes, so none")
    amounts = key_reach(rig.pose_keys(np.asarray(poses.fit, np.float64)))
    template = rig.template.astype(np.float64)
    rest = vertex_normals(template, rig.triangles)
    normals = np.empty(rig.blend_shapes.shape, dtype=np.float32)
    for shape, delta, amount in zip(rig.blend_shapes, normals, amounts, strict=True):
        delta[:] = normal_delta(template, shape, float(amount), rig.triangles, rest)
    turn = float(np.abs(normals).max())
    detail = f"{rig.morph_count} sets of normal deltas, the largest entry is {turn:.2f}"
    return replace(rig, blend_normals=normals), PassReport("morph normals", detail)


def normal_delta(
    template: NDArray[np.float64],
    shape: NDArray[Any],
    amount: float,
    triangles: NDArray[np.int32],
    rest: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Change (N, 3) of the normals `rest` of `template` (N, 3) for one unit of `shape` (N, 3), met at `amount`.

    A large mesh is not computed where the shape does not move it.
    """
    moving = (shape != 0).any(axis=1)[triangles].any(axis=1)
    touched = np.zeros(len(template), dtype=bool)
    touched[triangles[moving]] = True
    local = triangles[touched[triangles].any(axis=1)]  # every triangle around a touched vertex
    moved = vertex_normals(template + amount * shape.astype(np.float64), local)
    return np.where(touched[:, None], (moved - rest) / amount, 0)
