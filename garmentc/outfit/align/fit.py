"""How well an outfit sits on a body: what every guess about units, axes, origin, pose and gender is judged by.

Cloth hugs the skin from outside. So a guess is scored by a mean distance of points on the cloth from the body, where
points inside the body count several times and far points (skirts, hoods, brims) less than their distance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.align.skin import REACH
from garmentc.smpl.nearest import signed_distance

INSIDE_COST = 4.0
"""A millimetre inside the body is as bad as this many outside."""

LOOSE = 0.08
"""Metres: an outfit with a larger median gap doesn't fit the body."""

SUNK = 0.4
"""Nor does one with a larger share of its vertices inside."""

EXPONENT = 0.7
"""Of the power mean: the smaller, the less loose parts matter."""


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


def surface_area(vertices: NDArray[np.float64], triangles: NDArray[np.int32]) -> float:
    """The area of all triangles, in square file units."""
    return float(_double_normals(vertices, triangles)[1].sum() / 2)


def sample_cloth(vertices: NDArray[np.float64], triangles: NDArray[np.int32], count: int) -> ClothSample:
    """`count` points on the surface, equally spaced along the running sum of triangle areas: no random numbers.

    Inside their triangles they follow the R2 sequence (Roberts 2018), folded over the diagonal.
    """
    corners = vertices[triangles]
    cross, double_area = _double_normals(vertices, triangles)
    total = np.cumsum(double_area)
    index = np.arange(count)
    triangle = np.minimum(np.searchsorted(total, (index + 0.5) / count * total[-1]), len(triangles) - 1)
    u, v = np.modf(index * 0.7548776662466927)[0], np.modf(index * 0.5698402909980532)[0]
    u, v = np.where(u + v > 1, [1 - u, 1 - v], [u, v])
    chosen = corners[triangle]
    points = chosen[:, 0] + u[:, None] * (chosen[:, 1] - chosen[:, 0]) + v[:, None] * (chosen[:, 2] - chosen[:, 0])
    return ClothSample(points, cross[triangle] / np.maximum(double_area[triangle], 1e-300)[:, None])


def _double_normals(
    vertices: NDArray[np.float64], triangles: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(F, 3) normals as long as twice the triangles' area, and (F,) their length."""
    corners = vertices[triangles]
    cross: NDArray[np.float64] = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return cross, np.linalg.norm(cross, axis=1)


def misfit(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Power mean of signed distances (..., S), metres; returns (...,).

    It favours what is close: a skirt is placed by its waistband, not by its hem. And it is a length, so that outfits
    read in different units compare by misfit / size.
    """
    return _power_mean(np.minimum(np.where(distance > 0, distance, -INSIDE_COST * distance), REACH))


def unevenness(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Power mean of the differences of signed distances (..., S) from their median, metres; returns (...,).

    Snug cloth lies equally close all over the body that it was made for.
    """
    return _power_mean(np.abs(distance - np.median(distance, axis=-1, keepdims=True)))


def _power_mean(lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    mean: NDArray[np.float64] = (lengths**EXPONENT).mean(axis=-1) ** (1 / EXPONENT)
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

    @property
    def on_body(self) -> bool:
        return self.median_gap <= LOOSE and self.inside <= SUNK


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
