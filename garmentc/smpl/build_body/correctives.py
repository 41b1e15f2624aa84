"""Synthetic pose correctives: linear blend skinning plus these follows dual-quaternion skinning.

Dual quaternions (Kavan et al. 2008) keep the volume of bent and twisted joints. In SMPL's form a corrective is linear
in the entries of R - I, so this is a least-squares fit over random rotations, one joint at a time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.rotations import (
    axis_angle_to_matrix,
    matrix_to_quaternion,
    multiply_quaternions,
    quaternion_to_matrix,
)
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES, PARENTS
from garmentc.smpl.skinning import joint_transforms

_Floats = NDArray[np.float64]

LARGEST_ANGLE = {
    "hip": 1.6, "knee": 1.8, "ankle": 0.6, "foot": 0.3, "spine1": 0.4, "spine2": 0.4, "spine3": 0.3, "neck": 0.5,
    "head": 0.5, "collar": 0.35, "shoulder": 1.5, "elbow": 1.8, "wrist": 0.8, "hand": 0.3,
}  # fmt: skip
"""Radians that a joint is turned at most in the samples."""

ROTATIONS_PER_JOINT = 40
DAMPING = 0.02
"""Tikhonov weight: a joint whose rotations do not explain an offset gets none."""


def fit_correctives(v_template: _Floats, joints: _Floats, weights: _Floats, seed: int = 0) -> _Floats:
    """posedirs (V, 3, 207) in metres for a body with blend weights (V, 24)."""
    random = np.random.default_rng(seed)
    posedirs = np.zeros((len(v_template), 3, 9 * (JOINT_COUNT - 1)))
    for joint in range(1, JOINT_COUNT):
        blended = np.flatnonzero((weights[:, joint] > 0.001) & (weights[:, joint] < 0.999))
        features, offsets = [], []
        for _ in range(ROTATIONS_PER_JOINT):
            axis = random.normal(size=3)
            axis /= np.linalg.norm(axis)
            angle = random.uniform(0, LARGEST_ANGLE[JOINT_NAMES[joint].split("_")[-1]])
            rotations = np.tile(np.eye(3), (JOINT_COUNT, 1, 1))
            rotations[joint] = axis_angle_to_matrix(axis * angle)
            transforms = joint_transforms(rotations, joints)
            linear = np.tensordot(weights[blended], transforms, 1)
            target = dual_quaternion_skin(v_template[blended], weights[blended], transforms)
            unskinned = np.linalg.solve(linear[:, :3, :3], (target - linear[:, :3, 3])[:, :, None])[:, :, 0]
            offsets.append(unskinned - v_template[blended])
            features.append((rotations[joint] - np.eye(3)).ravel())
        a, b = np.array(features), np.array(offsets).reshape(ROTATIONS_PER_JOINT, -1)
        solution = np.linalg.solve(a.T @ a + DAMPING * np.eye(9), a.T @ b)
        posedirs[blended, :, 9 * (joint - 1) : 9 * joint] = solution.reshape(9, -1, 3).transpose(1, 2, 0)
    return posedirs


def dual_quaternion_skin(vertices: _Floats, weights: _Floats, transforms: _Floats) -> _Floats:
    """Dual-quaternion skinning of vertices (N, 3) by rigid transforms (24, 4, 4)."""
    real = matrix_to_quaternion(transforms[:, :3, :3])
    for joint in range(1, JOINT_COUNT):
        if real[joint] @ real[PARENTS[joint]] < 0:  # neighbours blend the short way round
            real[joint] = -real[joint]
    translation = np.concatenate([transforms[:, :3, 3], np.zeros((JOINT_COUNT, 1))], axis=1)
    dual = 0.5 * multiply_quaternions(translation, real)
    blended_real, blended_dual = weights @ real, weights @ dual
    norm = np.linalg.norm(blended_real, axis=1, keepdims=True)
    blended_real, blended_dual = blended_real / norm, blended_dual / norm
    turned = np.einsum("nij,nj->ni", quaternion_to_matrix(blended_real), vertices)
    moved = 2 * multiply_quaternions(blended_dual, blended_real * [-1, -1, -1, 1])[:, :3]
    skinned: _Floats = turned + moved
    return skinned
