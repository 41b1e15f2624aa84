"""Distance fields around a body at rest: what clothes are grown from.

A garment starts as an implicit solid: the body's offset surface joined with lofted tubes (trunk, sleeves, trouser
legs, skirt) where cloth leaves the body. Fields are negative inside and close to a signed distance near the surface;
exactness is not needed here, because the finished vertices are checked against the exact distance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.body import BodyModel

Array = NDArray[np.float64]
Field = Callable[[Array], Array]
"""Points (P, 3) to values (P,)."""

DIRECTION_COUNT = 48
"""Half-planes that bound one cross-section of a loft."""

SLICE = 0.01
"""Distance between cross-sections of a loft, metres."""

_ACROSS = {0: [1, 2], 1: [0, 2], 2: [0, 1]}
_LEFT_ARM = (16, 18, 20, 22)


@dataclass(frozen=True)
class RestBody:
    """A body of one shape in its T-pose, with what the outfit generator asks of it.

    vertices (V, 3) and joints (24, 3) metres, faces (F, 3), weights (V, 24).
    """

    vertices: Array
    faces: NDArray[np.int32]
    weights: Array
    joints: Array

    @staticmethod
    def of(body: BodyModel, betas: NDArray[Any]) -> RestBody:
        return RestBody(
            body.shaped(betas).astype(np.float64),
            body.faces,
            body.weights.astype(np.float64),
            body.joints(betas).astype(np.float64),
        )

    @cached_property
    def _samples(self) -> tuple[Any, Array, Array]:
        """A KD-tree on vertices, edge midpoints and face centres, with their normals and spacing."""
        from scipy.spatial import cKDTree

        corners = self.vertices[self.faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        at_vertex = np.zeros_like(self.vertices)
        for k in range(3):
            np.add.at(at_vertex, self.faces[:, k], normal)
        edges = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]])
        edges = edges[edges[:, 0] < edges[:, 1]]
        points = np.concatenate([self.vertices, self.vertices[edges].mean(1), corners.mean(1)])
        normals = np.concatenate([at_vertex, at_vertex[edges].sum(1), normal])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        return cKDTree(points), points, normals

    def distance(self, points: Array) -> Array:
        """About the signed distance (P,) of points (P, 3): point to the tangent plane of the nearest sample."""
        tree, samples, normals = self._samples
        _, index = tree.query(points)
        offset = points - samples[index]
        height = (offset * normals[index]).sum(1)
        beside = np.maximum((offset**2).sum(1) - height**2, 0)
        return np.asarray(
            np.where(height < 0, -1.0, 1.0) * np.sqrt(height**2 + np.maximum(np.sqrt(beside) - 0.006, 0) ** 2)
        )

    def exact_distance(self, points: Array) -> Array:
        """Signed distance (P,) of points (P, 3) to the surface, exact, negative inside."""
        import igl

        return np.asarray(igl.signed_distance(points, self.vertices, self.faces.astype(np.int64))[0])

    def closest(self, points: Array) -> tuple[Array, Array]:
        """Exact signed distance (P,) and the unit direction (P, 3) that leads away from the body."""
        import igl

        signed, _, nearest, normal = igl.signed_distance(
            points, self.vertices, self.faces.astype(np.int64), sign_type=igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
        )
        away = (points - nearest) * np.sign(signed)[:, None]
        length = np.linalg.norm(away, axis=1, keepdims=True)
        return signed, np.where(length > 1e-5, away / np.maximum(length, 1e-9), normal)

    def share(self, joints: tuple[int, ...]) -> Array:
        """Blend weight (V,) that vertices have on `joints` together."""
        return np.asarray(self.weights[:, joints].sum(1))

    @cached_property
    def crotch(self) -> float:
        """Height where the legs part: the highest y below the hips where the mid-plane is 6 mm clear of the body."""
        hip, knee = self.joints[1, 1], self.joints[4, 1]
        heights = np.arange(hip, knee, -0.004)
        depth = np.linspace(-0.12, 0.12, 61)
        grid = np.stack(np.meshgrid([0.0], heights, depth, indexing="ij"), -1)[0]
        clear = self.distance(grid.reshape(-1, 3)).reshape(len(heights), -1).min(1) > 0.006
        blocked = np.nonzero(~clear)[0]
        return float(heights[min(blocked[-1] + 1, len(heights) - 1)] if len(blocked) else hip)

    @cached_property
    def armpit(self) -> float:
        """Height of the armpits: lowest upper-arm vertex just outside the shoulder joint."""
        upper = (self.share(_LEFT_ARM) > 0.3) & (np.abs(self.vertices[:, 0] - self.joints[16, 0] - 0.02) < 0.03)
        return float(self.vertices[upper, 1].min()) if upper.any() else float(self.joints[16, 1] - 0.07)


@dataclass(frozen=True)
class Loft:
    """A tube around a bone axis: convex cross-sections, so cloth bridges the hollows of the body.

    along        index of the axis coordinate (1 for trunk and legs, 0 for arms, 2 for feet)
    sign         +1 where the tube runs towards positive coordinates, -1 towards negative ones
    start        axis coordinate (times sign) of the first section
    centres      (S, 3) section centres
    support      (S, D) metres: half-plane p . direction <= support
    capped       True where the tube ends with its last section; else that section goes on
    """

    along: int
    sign: float
    start: float
    centres: Array
    support: Array
    capped: bool = False

    def field(self, points: Array, fade: float = 0.06) -> Array:
        """Field (P,) of the tube; it narrows over the first `fade` metres so that it leaves the body gently."""
        place = self.sign * points[:, self.along] - self.start
        section = np.clip(place / SLICE, 0, len(self.support) - 1)
        value = np.full(len(points), 0.5)
        near = place > -0.02
        low = np.minimum(section[near].astype(int), len(self.support) - 2)
        t = (section[near] - low)[:, None]
        centre = self.centres[low] * (1 - t) + self.centres[low + 1] * t
        across = (points[near] - centre)[:, _ACROSS[self.along]]
        angle = np.arange(DIRECTION_COUNT) * (2 * np.pi / DIRECTION_COUNT)
        value_near = np.full(near.sum(), -1.0)
        for k in range(DIRECTION_COUNT):
            bound = self.support[low, k] * (1 - t[:, 0]) + self.support[low + 1, k] * t[:, 0]
            np.maximum(value_near, across @ np.array([np.cos(angle[k]), np.sin(angle[k])]) - bound, out=value_near)
        value[near] = value_near + 0.25 * np.maximum(fade - place[near], 0)
        if self.capped:
            value = np.maximum(value, place - SLICE * (len(self.support) - 1))
        return value


def loft(
    body: RestBody,
    part: NDArray[np.bool_],
    axis: Array,
    along: int,
    sign: float,
    start: float,
    end: float,
    clearance: float,
    slope: float,
    capped: bool = False,
) -> Loft:
    """Loft around the vertices `part` of the body.

    axis       (K, 3) polyline that the sections are centred on
    start, end axis coordinates (times sign), start < end
    clearance  metres between body and tube
    slope      radius change per metre where the body falls away: 0 hangs straight, > 0 flares, < 0 follows the body
    """
    count = max(int(np.ceil((end - start) / SLICE)) + 1, 2)
    place = start + SLICE * np.arange(count)
    order = np.argsort(sign * axis[:, along])
    centres = np.stack([np.interp(place, sign * axis[order, along], axis[order, k]) for k in range(3)], 1)
    centres[:, along] = sign * place
    across = _ACROSS[along]
    angle = np.arange(DIRECTION_COUNT) * (2 * np.pi / DIRECTION_COUNT)
    directions = np.stack([np.cos(angle), np.sin(angle)])
    vertices = body.vertices[part]
    position = sign * vertices[:, along]
    support = np.full((count, DIRECTION_COUNT), np.nan)
    for i in range(count):
        near = np.abs(position - place[i]) < 1.5 * SLICE
        if near.any():
            support[i] = ((vertices[near] - centres[i])[:, across] @ directions).max(0)
    known = ~np.isnan(support[:, 0])
    for k in range(DIRECTION_COUNT):
        support[:, k] = np.interp(place, place[known], support[known, k])
    # Cloth hangs from the widest place above it: in each direction take the largest earlier support, sloped.
    for i in range(1, count):
        shift = (centres[i] - centres[i - 1])[across] @ directions
        support[i] = np.maximum(support[i], support[i - 1] - shift + slope * SLICE)
    from scipy.ndimage import gaussian_filter1d

    support = gaussian_filter1d(support, 2.0, axis=0, mode="nearest")
    return Loft(along, sign, start, centres, support + clearance, capped)


def smooth_union(a: Array, b: Array, radius: float) -> Array:
    """Polynomial smooth minimum: the union of two solids with a fillet of about `radius`."""
    h = np.maximum(radius - np.abs(a - b), 0) / radius
    return np.minimum(a, b) - h * h * radius * 0.25
