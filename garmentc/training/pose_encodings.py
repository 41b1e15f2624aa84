"""How a pose becomes the numbers that a network sees. All are zero at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.rig import ENCODING_WIDTHS, encode_pose
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_COUNT


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


_OTHERS = JOINT_COUNT - 1

POSE_ENCODINGS = {
    **{name: PoseEncoding(width, partial(encode_pose, encoding=name)) for name, width in ENCODING_WIDTHS.items()},
    "gravity_6d": PoseEncoding(3 + 6 * _OTHERS, _with_gravity(2)),
    "gravity_matrix": PoseEncoding(3 + 9 * _OTHERS, _with_gravity(3)),
    "axis_angle": PoseEncoding(3 * JOINT_COUNT, _plain),
}
"""First those that bundles and glTF files can have (`garmentc.rig.ENCODING_WIDTHS`).

Then two or three columns of the joints' rotation matrices less those at rest (Zhou et al. 2019), and gravity at the
pelvis. Last the paper's: all 24 axis-angles, heading included.
"""
