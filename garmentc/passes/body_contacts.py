"""Where an outfit comes too close to its body in a set of poses."""

from __future__ import annotations

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


def find_contacts(
    rig: Rig, body: BodyModel, betas: NDArray[Any] | None, poses: NDArray[Any], depth: float = DEPTH
) -> Contacts:
    """Contacts of the posed rig with the posed body in `poses` (P, 24, 3), down to `depth` metres inside.

    The skin is taken as a plane at its vertex nearest to the cloth: within a millimetre of the exact distance where
    the skin is not creased, and ten times as fast. A contact counts only where vertex and skin hang on the same or
    neighbouring joints: a hand on the trousers and an arm pressed to the ribs are not the cloth's fault, and cloth
    blown away from them would look worse.
    """
    from scipy.spatial import cKDTree

    poses = np.asarray(poses, np.float32)
    skins = body.astype(np.float32).posed(poses, betas)
    to_normal = _normal_operator(body.faces, len(body.v_template))
    near_joints = body.weights.astype(np.float32) @ _neighbouring_joints()
    weights = rig.weights.astype(np.float32)
    transforms = joint_transforms(axis_angle_to_matrix(poses), rig.joints.astype(np.float32))[:, :, :3]
    rest = rig.template.astype(np.float32) + _displacements(rig, poses)
    clearance = np.full(rest.shape[:2], _FAR, dtype=np.float32)
    gradient = np.zeros(rest.shape, dtype=np.float32)
    for index, skin in enumerate(skins):
        blended = (weights @ transforms[index].reshape(JOINT_COUNT, 12)).reshape(-1, 3, 4)
        points = np.einsum("nij,nj->ni", blended[:, :, :3], rest[index]) + blended[:, :, 3]
        nearest = cKDTree(skin, balanced_tree=False).query(points, distance_upper_bound=2 * depth)[1]
        found = np.flatnonzero(nearest < len(skin))
        nearest = nearest[found]
        normal = _unit(to_normal @ _face_normals(skin, body.faces))[nearest]
        distance = np.einsum("ni,ni->n", normal, points[found] - skin[nearest])
        shared = np.einsum("nj,nj->n", weights[found], near_joints[nearest])
        close = (distance < REACH) & (distance > -depth) & (shared > _SHARED_WEIGHT)
        rows = found[close]
        clearance[index, rows] = distance[close]
        gradient[index, rows] = np.einsum("nij,ni->nj", blended[rows, :, :3], normal[close])
    return Contacts(clearance, gradient)


def wanted_clearance(rig: Rig, body: BodyModel, betas: NDArray[Any] | None, clearance: float) -> NDArray[np.float32]:
    """Clearance (N,) in metres that vertices should keep in every pose: `clearance`, less where they have less at rest.

    It grows with that at rest, so layers stay in order, and is never under CLOSEST.
    """
    at_rest = find_contacts(rig, body, betas, np.zeros((1, JOINT_COUNT, 3))).clearance[0]
    wanted: NDArray[np.float32] = clearance * -np.expm1(-np.maximum(at_rest, 0) / clearance)
    return np.maximum(CLOSEST, wanted)


def _displacements(rig: Rig, poses: NDArray[Any]) -> NDArray[np.float32]:
    flat = rig.blend_shapes.reshape(rig.morph_count, -1).astype(np.float32)
    moved: NDArray[np.float32] = (rig.pose_keys(poses) @ flat).reshape(len(poses), -1, 3)
    return moved


def _neighbouring_joints() -> NDArray[np.float32]:
    """(24, 24): 1 for joints at most two bones apart."""
    step = np.eye(JOINT_COUNT)
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            step[joint, parent] = step[parent, joint] = 1
    return (step @ step > 0).astype(np.float32)


def _normal_operator(faces: NDArray[Any], count: int) -> Any:
    """Sparse (V, F): sums the normals of the faces around each vertex."""
    from scipy.sparse import csr_matrix

    column = np.repeat(np.arange(len(faces)), 3)
    return csr_matrix((np.ones(len(column), np.float32), (faces.ravel(), column)), shape=(count, len(faces)))


def _face_normals(vertices: NDArray[Any], faces: NDArray[Any]) -> NDArray[Any]:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals: NDArray[Any] = np.cross(b - a, c - a)
    return normals


def _unit(rows: NDArray[Any]) -> NDArray[Any]:
    unit: NDArray[Any] = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-20)
    return unit
