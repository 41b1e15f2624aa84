"""Posed bodies, computed once: training draws from such a pool, because posing a body costs as much as a step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from garmentc.smpl.nearest import closest_on_surface
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.training.outfit_sample import PosableBody, body_normals

CLEAN_OFFSET = 0.005
"""A body vertex moved this far (metres) along its normal and then inside the body marks a self-intersection."""


@dataclass(frozen=True)
class PosedBodies:
    """T poses of one body.

    poses       (T, 24, 3) axis-angle
    transforms  (T, 24, 3, 4) float32
    vertices    (T, V, 3) float32
    normals     (T, V, 3) float32
    trees       T search trees over the vertices
    faces       (F, 3)
    """

    poses: NDArray[Any]
    transforms: NDArray[Any]
    vertices: NDArray[Any]
    normals: NDArray[Any]
    trees: tuple[cKDTree, ...]
    faces: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.poses)

    def nearest(
        self, chosen: NDArray[Any], points: NDArray[Any], *, surface: bool = False
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Nearest body vertices and their normals, each (B, N, 3), of points (B, N, 3) in the poses `chosen` (B,).

        surface  the closest points of the surface instead, exactly, with normals interpolated between its vertices:
                 a plane through the nearest vertex misses the skin by a millimetre where that curves
        """
        find = self._on_surface if surface else self._at_vertices
        found = [find(t, p) for t, p in zip(chosen, points, strict=True)]
        return np.stack([point for point, _ in found]), np.stack([normal for _, normal in found])

    def _at_vertices(self, pose: int, points: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        index = self.trees[pose].query(points)[1]
        return self.vertices[pose][index], self.normals[pose][index]

    def _on_surface(self, pose: int, points: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        closest = closest_on_surface(points, self.vertices[pose], self.faces)
        corners = self.normals[pose][self.faces[closest.face]]
        normal = (closest.barycentric[:, :, None] * corners).sum(axis=1)
        unit = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        return closest.point.astype(np.float32), unit.astype(np.float32)


def pose_body(body: PosableBody, poses: NDArray[Any]) -> PosedBodies:
    """The body in `poses` (T, 24, 3)."""
    transforms, vertices, normals, trees = _pose(body, poses)
    return PosedBodies(poses, transforms, vertices, normals, trees, body.faces)


def random_bodies(body: PosableBody, count: int, seed: tuple[int, ...], max_overlap: float = 0.004) -> PosedBodies:
    """`count` sampled poses of a body, without those where more than `max_overlap` of it sinks into itself.

    Vertices that already touch in the rest pose (toes, armpits, crotch) are not counted.
    """
    rng = np.random.default_rng(seed)
    at_rest = _overlapping(*_pose(body, np.zeros((1, 24, 3))))[0]
    kept: list[PosedBodies] = []
    while sum(map(len, kept)) < count:
        poses = sample_poses(max(8, count // 2), int(rng.integers(1 << 31)))
        sunk = _overlapping(*_pose(body, poses)) & ~at_rest
        clean = np.flatnonzero(sunk.mean(axis=1) <= max_overlap)[: count - sum(map(len, kept))]
        kept.append(pose_body(body, poses[clean]))
    return joined(kept)


def joined(parts: Sequence[PosedBodies]) -> PosedBodies:
    """All poses of `parts`, which are of one body, in order."""
    return PosedBodies(
        np.concatenate([part.poses for part in parts]),
        np.concatenate([part.transforms for part in parts]),
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.normals for part in parts]),
        tuple(tree for part in parts for tree in part.trees),
        parts[0].faces,
    )


def _pose(
    body: PosableBody, poses: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], tuple[cKDTree, ...]]:
    transforms = body.transforms(poses)
    vertices = body.posed(poses, transforms).astype(np.float32)
    normals = body_normals(vertices, body.faces).astype(np.float32)
    trees = tuple(cKDTree(v, balanced_tree=False) for v in vertices)
    return np.ascontiguousarray(transforms[:, :, :3]).astype(np.float32), vertices, normals, trees


def _overlapping(
    _: NDArray[Any], vertices: NDArray[Any], normals: NDArray[Any], trees: tuple[cKDTree, ...]
) -> NDArray[np.bool_]:
    """(T, V): vertices that lie inside another part of the body when moved outward by CLEAN_OFFSET."""
    moved = vertices + CLEAN_OFFSET * normals
    inside = []
    for v, n, m, tree in zip(vertices, normals, moved, trees, strict=True):
        nearest = tree.query(m)[1]
        inside.append(((m - v[nearest]) * n[nearest]).sum(axis=1) < 0)
    return np.stack(inside)
