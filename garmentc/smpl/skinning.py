"""Forward kinematics and linear blend skinning (SMPL, Loper et al. 2015, equations 2-4)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.skeleton import PARENTS


def joint_transforms(
    rotations: NDArray[Any],
    joints: NDArray[Any],
    translation: NDArray[Any] | None = None,
    parents: NDArray[np.int32] = PARENTS,
) -> NDArray[Any]:
    """Transforms that take rest positions to posed positions, one per joint.

    rotations    (..., K, 3, 3) relative to the parent; the rest pose is the identity
    joints       (K, 3) rest joint positions, metres
    translation  (..., 3) added to everything
    returns      (..., K, 4, 4)
    """
    batch = rotations.shape[:-3]
    count = len(parents)
    world = np.zeros((*batch, count, 4, 4), dtype=np.result_type(rotations, joints))
    world[..., 3, 3] = 1
    for k, parent in enumerate(parents):
        if parent < 0:
            world[..., k, :3, :3] = rotations[..., k, :, :]
            world[..., k, :3, 3] = joints[k] if translation is None else joints[k] + translation
        else:
            above = world[..., parent, :3, :3]
            world[..., k, :3, :3] = above @ rotations[..., k, :, :]
            world[..., k, :3, 3] = above @ (joints[k] - joints[parent]) + world[..., parent, :3, 3]
    world[..., :3, 3] -= np.einsum("...kij,kj->...ki", world[..., :3, :3], joints)
    return world


def skin(vertices: NDArray[Any], weights: NDArray[Any], transforms: NDArray[Any]) -> NDArray[Any]:
    """Linear blend skinning.

    vertices    (N, 3) or (..., N, 3)
    weights     (N, K), rows sum to 1
    transforms  (..., K, 4, 4)
    returns     (..., N, 3)
    """
    x, y, z, offset = np.moveaxis(transforms[..., :3, :], -1, 0)  # columns of the 3x4 matrices
    blended = weights @ np.concatenate([x, y, z, offset], axis=-1)
    posed: NDArray[Any] = (
        vertices[..., 0:1] * blended[..., 0:3]
        + vertices[..., 1:2] * blended[..., 3:6]
        + vertices[..., 2:3] * blended[..., 6:9]
        + blended[..., 9:12]
    )
    return posed
