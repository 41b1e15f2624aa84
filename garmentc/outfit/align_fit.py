"""How well an outfit sits on a body: what every guess about units, axes, origin, pose and gender is judged by.

Cloth hugs the skin from outside. So a guess is scored by the mean distance of points on the cloth from the body, where
points inside the body count several times and far points (skirts, hoods, brims) count only so much.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.nearest import signed_distance

INSIDE_COST = 4.0
"""A millimetre inside the body is as bad as this many outside."""

EXPONENT = 0.7
"""Of the power mean: the smaller, the less loose parts matter."""

FAR = 0.25
"""Metres beyond which a point does not count more."""


@dataclass(frozen=True)
class ClothSample:
    """Points spread evenly over an outfit's surface, in file coordinates.

    points   (S, 3)
    normals  (S, 3) unit normals of the triangles they lie on, as the file winds them
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]

    @property
    def radius(self) -> float:
        """Root mean square distance from the centre, file units."""
        return float(np.sqrt(((self.points - self.points.mean(axis=0)) ** 2).sum(axis=1).mean()))

    def thinned(self, count: int) -> ClothSample:
        """About `count` of the points."""
        step = max(1, len(self.points) // count)
        return ClothSample(self.points[::step], self.normals[::step])


def sample_cloth(vertices: NDArray[np.float64], triangles: NDArray[np.int32], count: int) -> ClothSample:
    """`count` points on the surface, equally spaced along the running sum of triangle areas: no random numbers.

    Inside their triangles they follow the R2 sequence (Roberts 2018), folded over the diagonal.
    """
    corners = vertices[triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double_area = np.linalg.norm(cross, axis=1)
    total = np.cumsum(double_area)
    index = np.arange(count)
    triangle = np.minimum(np.searchsorted(total, (index + 0.5) / count * total[-1]), len(triangles) - 1)
    u, v = np.modf(index * 0.7548776662466927)[0], np.modf(index * 0.5698402909980532)[0]
    u, v = np.where(u + v > 1, [1 - u, 1 - v], [u, v])
    chosen = corners[triangle]
    points = chosen[:, 0] + u[:, None] * (chosen[:, 1] - chosen[:, 0]) + v[:, None] * (chosen[:, 2] - chosen[:, 0])
    return ClothSample(points, cross[triangle] / np.maximum(double_area[triangle], 1e-300)[:, None])


@dataclass(frozen=True)
class Skin:
    """The body as discs, one around each vertex and together as large as the surface: quick to measure against.

    vertices  (V, 3)
    normals   (V, 3) outward
    radii     (V,)
    joints    (24, 3) joints in the same pose
    """

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    radii: NDArray[np.float64]
    joints: NDArray[np.float64]

    @classmethod
    def of(cls, vertices: NDArray[Any], faces: NDArray[Any], joints: NDArray[Any]) -> Skin:
        """The skin of a body with `vertices` (V, 3), `faces` (F, 3) and `joints` (24, 3)."""
        corners = vertices[faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        around = np.zeros((len(vertices), 3))
        area = np.zeros(len(vertices))
        share = np.linalg.norm(cross, axis=1) / 6
        for k in range(3):
            area += np.bincount(faces[:, k], share, minlength=len(vertices))
            for axis in range(3):
                around[:, axis] += np.bincount(faces[:, k], cross[:, axis], minlength=len(vertices))
        normals = around / np.maximum(np.linalg.norm(around, axis=1, keepdims=True), 1e-300)
        return cls(np.ascontiguousarray(vertices, dtype=np.float64), normals, np.sqrt(area / np.pi), joints)

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.vertices)

    def nearest(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """The vertices nearest to `points` (N, 3)."""
        index: NDArray[np.int64] = self._tree.query(points)[1]
        return index

    def height(self, points: NDArray[np.float64], nearest: NDArray[np.int64]) -> NDArray[np.float64]:
        """Signed distance (N,) of `points` (N, 3) to the disc of vertex `nearest` (N,), negative inside."""
        offset = points - self.vertices[nearest]
        up = np.einsum("ij,ij->i", offset, self.normals[nearest])
        aside = np.sqrt(np.maximum(np.einsum("ij,ij->i", offset, offset) - up**2, 0))
        return np.copysign(np.hypot(up, np.maximum(aside - self.radii[nearest], 0)), up)

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signed distance of `points` (..., 3) to the skin, negative inside, right within millimetres; at most FAR."""
        flat = points.reshape(-1, 3)
        distance = np.full(len(flat), FAR)
        nearest = self._tree.query(flat, distance_upper_bound=FAR)[1]
        near = np.flatnonzero(nearest < len(self.vertices))
        distance[near] = np.minimum(self.height(flat[near], nearest[near]), FAR)
        return distance.reshape(points.shape[:-1])


def misfit(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Power mean of signed distances (..., S), metres; returns (...,).

    It favours what is close: a skirt is placed by its waistband, not by its hem. And it is a length, so that outfits
    read in different units compare by misfit / size.
    """
    cost = np.minimum(np.where(distance > 0, distance, -INSIDE_COST * distance), FAR)
    mean: NDArray[np.float64] = (cost**EXPONENT).mean(axis=-1) ** (1 / EXPONENT)
    return mean


@dataclass(frozen=True)
class Fit:
    """How an outfit sits on its body, measured exactly at `measured` of its vertices.

    mean_gap, median_gap, p95_gap  of the unsigned distance, metres
    inside                         share of vertices inside the body
    depth                          the deepest one, metres
    """

    mean_gap: float
    median_gap: float
    p95_gap: float
    inside: float
    depth: float
    measured: int


def measure_fit(vertices: NDArray[np.float64], body_vertices: NDArray[Any], faces: NDArray[Any], most: int) -> Fit:
    """The fit of `vertices` (N, 3); above `most` of them an even selection is measured."""
    chosen = vertices[:: max(1, -(-len(vertices) // most))]
    distance = signed_distance(chosen, body_vertices, faces)
    gap = np.abs(distance)
    return Fit(
        mean_gap=float(gap.mean()),
        median_gap=float(np.median(gap)),
        p95_gap=float(np.percentile(gap, 95)),
        inside=float((distance < 0).mean()),
        depth=float(max(0.0, -distance.min())),
        measured=len(chosen),
    )
