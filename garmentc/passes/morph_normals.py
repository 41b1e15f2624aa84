"""Normals that move with the blend shapes, so that light follows folds."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import corner_angles
from garmentc.passes.key_reach import shape_reach
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
    if rig.keys is None or not rig.morph_count:
        return rig, PassReport("morph normals", "no blend shapes, so none")
    amounts = shape_reach(rig, poses)
    surface = _Surface.of(rig.template.astype(np.float64), rig.triangles)
    rest = surface.normals(surface.sides)
    normals = np.empty(rig.blend_shapes.shape, dtype=np.float32)

    def fill(delta: NDArray[np.float32], shape: NDArray[np.float32], amount: Any) -> None:
        moved = surface.normals(surface.sides + amount * _sides(shape, rig.triangles))
        delta[:] = (moved - rest) / amount

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(fill, normals, rig.blend_shapes, amounts.astype(np.float32)))
    detail = f"{rig.morph_count} sets of normal deltas, the largest entry is {np.abs(normals).max():.2f}"
    return replace(rig, blend_normals=normals), PassReport("morph normals", detail)


@dataclass(frozen=True)
class _Surface:
    """A triangle mesh for many shapes of it.

    sides    (2, F, 3) float32: two sides of each triangle at rest
    weigher  sparse (N, F): sums the normals of the triangles around a vertex by their rest corner angles. It takes
             normals as long as twice the triangle's area and undoes the rest area, so that a triangle needs no square
             root; a triangle that grows then weighs more, which only matters where it also turns
    """

    sides: NDArray[np.float32]
    weigher: Any

    @classmethod
    def of(cls, template: NDArray[np.float64], triangles: NDArray[np.int32]) -> _Surface:
        from scipy.sparse import csr_matrix

        sides = _sides(template, triangles)
        area = np.linalg.norm(np.cross(*sides), axis=1)
        share = corner_angles(template, triangles) / np.where(area > 0, area, 1)[:, None]
        column = np.repeat(np.arange(len(triangles)), 3)
        shape = (len(template), len(triangles))
        weigher = csr_matrix((share.ravel().astype(np.float32), (triangles.ravel(), column)), shape=shape)
        return cls(sides.astype(np.float32), weigher)

    def normals(self, sides: NDArray[np.float32]) -> NDArray[np.float32]:
        """Unit normals (N, 3) of the mesh with these sides; 0 where there is no area."""
        (ax, ay, az), (bx, by, bz) = sides.transpose(0, 2, 1)
        across = np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)
        sums: NDArray[np.float32] = self.weigher @ across
        length = np.sqrt(np.einsum("ni,ni->n", sums, sums))[:, None]
        sums /= np.where(length > 0, length, 1)
        return sums


def _sides(points: NDArray[Any], triangles: NDArray[np.int32]) -> NDArray[Any]:
    """(2, F, 3): from the first corner of each triangle to the second, and to the third."""
    first, second, third = np.take(points, triangles.T, axis=0)
    return np.stack([second - first, third - first])
