"""How a pose becomes the numbers that a network sees. All are zero at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.rig import ENCODING_GRAVITY_AXIS_ANGLE, encode_pose
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_COUNT, PARENTS


@dataclass(frozen=True)
class PoseEncoding:
    """`encode` makes poses (..., 24, 3) numbers (..., width)."""

    width: int
    encode: Callable[[NDArray[Any]], NDArray[Any]]


def _with_gravity(columns: int) -> Callable[[NDArray[Any]], NDArray[Any]]:
    def encode(poses: NDArray[Any]) -> NDArray[Any]:
        rotations = axis_angle_to_matrix(poses) - np.eye(3, dtype=poses.dtype)
        joints = rotations[..., 1:, :, :columns].reshape(*poses.shape[:-2], -1)
        return np.concatenate([rotations[..., 0, 1, :], joints], axis=-1)

    return encode


def _plain(poses: NDArray[Any]) -> NDArray[Any]:
    return poses.reshape(*poses.shape[:-2], 3 * JOINT_COUNT)


def _gravity_in_every_joint(poses: NDArray[Any]) -> NDArray[Any]:
    """Up in the frame of every joint, which is how a sleeve or a trouser leg knows where it hangs."""
    rotations = axis_angle_to_matrix(poses)
    frames = [rotations[..., 0, :, :]]
    for joint in range(1, JOINT_COUNT):
        frames.append(frames[PARENTS[joint]] @ rotations[..., joint, :, :])
    up = np.stack(frames, axis=-3)[..., 1, :] - np.eye(3, dtype=poses.dtype)[1]
    both = np.concatenate([up[..., 1:, :], poses[..., 1:, :]], axis=-1)
    return np.concatenate([up[..., 0, :], both.reshape(*poses.shape[:-2], -1)], axis=-1)


_OTHERS = JOINT_COUNT - 1

POSE_ENCODINGS = {
    ENCODING_GRAVITY_AXIS_ANGLE: PoseEncoding(3 * JOINT_COUNT, encode_pose),
    "gravity_6d": PoseEncoding(3 + 6 * _OTHERS, _with_gravity(2)),
    "gravity_matrix": PoseEncoding(3 + 9 * _OTHERS, _with_gravity(3)),
    "gravity_joints": PoseEncoding(3 + 6 * _OTHERS, _gravity_in_every_joint),
    "axis_angle": PoseEncoding(3 * JOINT_COUNT, _plain),
}
"""The first is what bundles and glTF files have: up in the pelvis' frame, then the joints as axis-angle.

Then two or three columns of the joints' rotation matrices less those at rest (Zhou et al. 2019), with the same gravity.
Then up in the frame of every joint beside its axis-angle. Last the paper's: all 24 axis-angles, heading included.
"""
