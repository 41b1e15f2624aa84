"""Posed bodies, computed once: training draws poses from this pool, because posing a body costs as much as a step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

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
    """

    poses: NDArray[Any]
    transforms: NDArray[Any]
    vertices: NDArray[Any]
    normals: NDArray[Any]
    trees: tuple[cKDTree, ...]

    def __len__(self) -> int:
        return len(self.poses)

    def nearest(self, chosen: NDArray[Any], points: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Nearest body vertices and their normals, each (B, N, 3), of points (B, N, 3) in the poses `chosen` (B,)."""
        found = [self.trees[t].query(p)[1] for t, p in zip(chosen, points, strict=True)]
        return (
            np.stack([self.vertices[t][i] for t, i in zip(chosen, found, strict=True)]),
            np.stack([self.normals[t][i] for t, i in zip(chosen, found, strict=True)]),
        )


def pose_body(body: PosableBody, count: int, seed: int, max_overlap: float = 0.004) -> PosedBodies:
    """`count` sampled poses of a body, without those where more than `max_overlap` of it sinks into itself.

    Vertices that already touch in the rest pose (toes, armpits, crotch) are not counted.
    """
    kept: list[PosedBodies] = []
    at_rest = _overlapping(*_pose(body, np.zeros((1, 24, 3))))[0]
    total, attempt = 0, 0
    while total < count:
        poses = sample_poses(max(8, count // 4), seed + 1_000_003 * attempt)
        attempt += 1
        posed = _pose(body, poses)
        sunk = _overlapping(*posed) & ~at_rest
        clean = np.flatnonzero(sunk.mean(axis=1) <= max_overlap)[: count - total]
        total += len(clean)
        transforms, vertices, normals, trees = posed
        kept.append(
            PosedBodies(
                poses[clean], transforms[clean], vertices[clean], normals[clean], tuple(trees[t] for t in clean)
            )
        )
    return PosedBodies(
        np.concatenate([k.poses for k in kept]),
        np.concatenate([k.transforms for k in kept]),
        np.concatenate([k.vertices for k in kept]),
        np.concatenate([k.normals for k in kept]),
        tuple(tree for k in kept for tree in k.trees),
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
