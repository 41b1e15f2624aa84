"""The pose layouts of SMPL, SMPL-H and SMPL-X files, and their way to the 24 joints of SMPL.

The three models share their first 22 joints. What follows is in SMPL two hand joints, in SMPL-H 30 finger joints,
in SMPL-X the jaw, two eyes and 30 finger joints. An outfit follows the 24 joints, so fingers and faces are left out
and the two hand joints continue their wrists.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.rotations import axis_angle_to_quaternion, quaternion_to_axis_angle
from garmentc.smpl.skeleton import JOINT_COUNT

BODY_JOINT_COUNT = 22
"""Joints that SMPL, SMPL-H and SMPL-X have in common: pelvis to right_wrist."""

LAYOUTS = {66: "SMPL without hands", 72: "SMPL", 156: "SMPL-H", 165: "SMPL-X"}
"""Numbers in a pose, and the model it belongs to."""


def to_smpl_pose(poses: NDArray[Any]) -> NDArray[Any]:
    """Poses (..., 66 | 72 | 156 | 165) to (..., 24, 3), each rotation at most pi long."""
    width = poses.shape[-1]
    kept = JOINT_COUNT if width == 3 * JOINT_COUNT else BODY_JOINT_COUNT
    joints = np.zeros((*poses.shape[:-1], JOINT_COUNT, 3), dtype=poses.dtype)
    joints[..., :kept, :] = poses[..., : 3 * kept].reshape(*poses.shape[:-1], kept, 3)
    return shortest(joints)


def shortest(poses: NDArray[Any]) -> NDArray[Any]:
    """The same rotations, axis-angle (..., 3), each at most pi long; those that already are stay bit for bit."""
    long = np.linalg.norm(poses, axis=-1, keepdims=True) > np.pi
    return np.where(long, quaternion_to_axis_angle(axis_angle_to_quaternion(poses)), poses)


def dropped_joints(poses: NDArray[Any]) -> bool:
    """True where `to_smpl_pose` leaves out rotations that are not zero (moving fingers, jaw or eyes)."""
    return poses.shape[-1] > 3 * JOINT_COUNT and bool(poses[..., 3 * BODY_JOINT_COUNT :].any())
