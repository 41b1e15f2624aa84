"""Where an outfit comes too close to its body in a set of poses."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_COUNT, PARENTS
from garmentc.smpl.skinning import joint_transforms

REACH = 0.015
"""Metres: vertices farther out than this are in no danger."""

DEPTH = 0.03
"""Metres: deeper ones belong to limbs that are stuck in each other, where no movement of cloth helps."""

CLOSEST = 0.001
"""Metres: what even the tightest cloth should keep."""

_SHARED_WEIGHT = 0.2
_FAR = 1.0


@dataclass(frozen=True)
class Contacts:
    """Clearances of N vertices in P poses, to first order in a displacement of the rest vertices.

    clearance  (P, N) float32 metres to the skin, negative inside; 1 where there is no skin near to care about
    gradient   (P, N, 3) float32: a displacement u of the rest vertex changes the clearance by gradient . u
    """

    clearance: NDArray[np.float32]
    gradient: NDArray[np.float32]

    def of_poses(self, rows: slice) -> Contacts:
        """The contacts in some of the poses."""
        return Contacts(self.clearance[rows], self.gradient[rows])


def find_contacts(
    rig: Rig, body: BodyModel, betas: NDArray[Any] | None, poses: NDArray[Any], depth: float = DEPTH
) -> Contacts:
    """Contacts of the posed rig with the posed body in `poses` (P, 24, 3), down to `depth` metres inside.

    The skin is taken as the plane of the triangle whose centre is nearest: nine times in ten within 0.3 mm of the
    exact distance, and ten times as fast. A contact counts only where vertex and skin hang on the same or
    neighbouring joints: a hand on the trousers and an arm pressed to the ribs are not the cloth's fault, and cloth
    blown away from them would look worse.
    """
    from scipy.spatial import cKDTree

    poses = np.asarray(poses, np.float32)
    weights = rig.weights.astype(np.float32)
    near_joints = body.weights.astype(np.float32)[body.faces].mean(axis=1) @ _neighbouring_joints()
    reachable = near_joints @ weights.max(axis=0) > _SHARED_WEIGHT  # the others cannot be in contact with any vertex
    faces, near_joints = body.faces[reachable], near_joints[reachable]
    skins = body.astype(np.float32).posed(poses, betas)
    transforms = joint_transforms(axis_angle_to_matrix(poses), rig.joints.astype(np.float32))[:, :, :3]
    rest = rest_vertices(rig, poses)
    clearance = np.full(rest.shape[:2], _FAR, dtype=np.float32)
    gradient = np.zeros(rest.shape, dtype=np.float32)

    def find(index: int) -> None:
        blended = (weights @ transforms[index].reshape(JOINT_COUNT, 12)).reshape(-1, 3, 4)
        points = np.einsum("nij,nj->ni", blended[:, :, :3], rest[index]) + blended[:, :, 3]
        centers, normals = _planes(skins[index], faces)
        nearest = cKDTree(centers, balanced_tree=False).query(points, distance_upper_bound=2 * depth)[1]
        found = np.flatnonzero(nearest < len(centers))
        nearest = nearest[found]
        normal = normals[nearest]
        distance = np.einsum("ni,ni->n", normal, points[found] - centers[nearest])
        shared = np.einsum("nj,nj->n", weights[found], near_joints[nearest])
        close = (distance < REACH) & (distance > -depth) & (shared > _SHARED_WEIGHT)
        rows = found[close]
        clearance[index, rows] = distance[close]
        gradient[index, rows] = np.einsum("nij,ni->nj", blended[rows, :, :3], normal[close])

    with ThreadPoolExecutor(os.cpu_count()) as pool:  # each pose fills its own rows: the order does not matter
        list(pool.map(find, range(len(poses))))
    return Contacts(clearance, gradient)


def wanted_clearance(rig: Rig, body: BodyModel, betas: NDArray[Any] | None, clearance: float) -> NDArray[np.float32]:
    """Clearance (N,) in metres that vertices should keep in every pose: `clearance`, less where they have less at rest.

    It grows with that at rest, so layers stay in order, and is never under CLOSEST.
    """
    at_rest = find_contacts(rig, body, betas, np.zeros((1, JOINT_COUNT, 3))).clearance[0]
    wanted: NDArray[np.float32] = clearance * -np.expm1(-np.maximum(at_rest, 0) / clearance)
    return np.maximum(CLOSEST, wanted)


def rest_vertices(rig: Rig, poses: NDArray[Any]) -> NDArray[np.float32]:
    """Rest vertices (P, N, 3), moved by the blend shapes of `poses` (P, 24, 3) but not skinned."""
    flat = rig.blend_shapes.reshape(rig.morph_count, -1).astype(np.float32)
    moved: NDArray[np.float32] = (rig.pose_keys(poses) @ flat).reshape(len(poses), -1, 3)
    return rig.template.astype(np.float32) + moved


def _neighbouring_joints() -> NDArray[np.float32]:
    """(24, 24): 1 for joints at most two bones apart."""
    step = np.eye(JOINT_COUNT)
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            step[joint, parent] = step[parent, joint] = 1
    return (step @ step > 0).astype(np.float32)


def _planes(vertices: NDArray[Any], faces: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Centres (F, 3) and unit normals (F, 3) of triangles."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return (a + b + c) / 3, normals / np.maximum(length, np.finfo(normals.dtype).tiny)
