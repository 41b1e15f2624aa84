"""The body's skin, in any pose, in a form that is quick to measure against."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import unit_rows
from garmentc.smpl.body import BodyModel
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skinning import joint_transforms

REACH = 0.25
"""Metres: distances are measured as far as this, and no further."""


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
        height: NDArray[np.float64] = np.copysign(np.hypot(up, np.maximum(aside - self.radii[nearest], 0)), up)
        return height

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signed distance of `points` (..., 3) to the skin, negative inside, within millimetres; at most REACH."""
        flat = points.reshape(-1, 3)
        distance = np.full(len(flat), REACH)
        nearest = self._tree.query(flat, distance_upper_bound=REACH)[1]
        near = np.flatnonzero(nearest < len(self.vertices))
        distance[near] = np.minimum(self.height(flat[near], nearest[near]), REACH)
        return distance.reshape(points.shape[:-1])


def posed_joints(pose: NDArray[np.float64], joints: NDArray[Any]) -> NDArray[np.float64]:
    """Where `pose` (24, 3) takes the rest `joints` (24, 3)."""
    transforms = joint_transforms(axis_angle_to_matrix(pose), joints)
    turned: NDArray[np.float64] = np.einsum("kij,kj->ki", transforms[:, :3, :3], joints) + transforms[:, :3, 3]
    return turned


@dataclass(frozen=True)
class RestBody:
    """A body of one shape, ready to be posed many times; float64, without pose correctives.

    surface  its skin in the T-pose
    weights  (V, 24) blend weights of the skin's vertices
    """

    model: BodyModel
    surface: Skin
    weights: NDArray[np.float64]

    @classmethod
    def of(cls, model: BodyModel, betas: NDArray[Any] | None) -> RestBody:
        """The body `model` with shape `betas`."""
        surface = Skin.of(model.shaped(betas), model.faces, model.joints(betas))
        return cls(model, surface, model.weights.astype(np.float64))

    def thinned(self, step: int) -> RestBody:
        """The body with every `step`-th vertex of its skin."""
        whole = self.surface
        radii = whole.radii[::step] * np.sqrt(step)
        thin = Skin(whole.vertices[::step].copy(), whole.normals[::step], radii, whole.joints)
        return RestBody(self.model, thin, self.weights[::step].copy())

    def skin(self, pose: NDArray[np.float64] | None = None) -> Skin:
        """The skin in `pose` (24, 3), or in the T-pose."""
        if pose is None:
            return self.surface
        rest = self.surface
        transforms = joint_transforms(axis_angle_to_matrix(pose), rest.joints)
        # Not a matrix product: for so small a one, waking BLAS's threads takes longer than the sums.
        blended = np.einsum("nj,jk->nk", self.weights, transforms[:, :3, :].reshape(-1, 12)).reshape(-1, 3, 4)
        vertices = np.einsum("nij,nj->ni", blended[..., :3], rest.vertices) + blended[..., 3]
        normals = unit_rows(np.einsum("nij,nj->ni", blended[..., :3], rest.normals))
        return Skin(vertices, normals, rest.radii, posed_joints(pose, rest.joints))
