"""Make room between arms and trunk: recorded people were slimmer than the body that re-enacts them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.rotations import axis_angle_to_matrix, matrix_to_quaternion, quaternion_to_axis_angle
from garmentc.smpl.skeleton import JOINT_NAMES


def open_arms(poses: NDArray[Any], degrees: float) -> NDArray[Any]:
    """Poses (..., 24, 3) with both upper arms turned away from the trunk, about the body's front-back axis.

    Santesteban et al. 2021 prepare their motions so, by 15 degrees.
    """
    opened = np.array(poses)
    for name, sign in (("left_shoulder", 1), ("right_shoulder", -1)):
        joint = JOINT_NAMES.index(name)
        turn = axis_angle_to_matrix(np.array([0.0, 0.0, sign * np.radians(degrees)]))
        arm = turn @ axis_angle_to_matrix(np.asarray(poses, np.float64)[..., joint, :])
        opened[..., joint, :] = quaternion_to_axis_angle(matrix_to_quaternion(arm))
    return opened
