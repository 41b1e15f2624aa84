"""Which axis is up in a motion file, and turning it to Y."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.rotations import (
    axis_angle_to_quaternion,
    matrix_to_quaternion,
    multiply_quaternions,
    quaternion_to_axis_angle,
)

Z_UP_TO_Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""A quarter turn about X: (x, y, z) to (x, z, -y)."""

SURE = 0.5
"""Detection is sure where the two averages lie further apart than this; standing and walking people give about 0.95."""


@dataclass(frozen=True)
class UpAxis:
    """axis "y" or "z"; y and z: how far the body's own up direction points along them, on average, -1 to 1."""

    axis: str
    y: float
    z: float

    @property
    def sure(self) -> bool:
        return abs(self.y - self.z) > SURE


def detect_up(root: NDArray[Any]) -> UpAxis:
    """From root rotations (T, 3, 3): people mostly stay upright, so the pelvis' Y is the vertical on average."""
    _, y, z = root[:, :, 1].mean(axis=0)
    return UpAxis("z" if z > y else "y", float(y), float(z))


def turn_to_y_up(
    poses: NDArray[Any], trans: NDArray[Any], rest_pelvis: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Poses (T, 24, 3) and trans (T, 3) of a Z-up file in Y-up axes.

    The pelvis is at trans + rest_pelvis, and the rest pelvis (3,) does not turn with the world, so the translation
    has to make up for it.
    """
    quarter = matrix_to_quaternion(Z_UP_TO_Y_UP)
    turned = poses.copy()
    turned[:, 0] = quaternion_to_axis_angle(multiply_quaternions(quarter, axis_angle_to_quaternion(poses[:, 0])))
    return turned, (trans + rest_pelvis) @ Z_UP_TO_Y_UP.T - rest_pelvis
