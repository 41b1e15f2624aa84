"""Telling poses, for outfits that come without an animation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.rotations import axis_angle_to_quaternion, multiply_quaternions, quaternion_to_axis_angle
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES

_Turns = tuple[tuple[str, tuple[float, float, float]], ...]

# Joint and degrees about x (bend), y (twist), z (sideways), done in the order z, y, x. Legs and arms mirror themselves.
_ARMS_DOWN: _Turns = (("left_shoulder", (0, 0, -62)), ("right_shoulder", (0, 0, 62)))
_POSES: dict[str, _Turns] = {
    "arms up": (
        ("left_collar", (0, 0, 12)),
        ("right_collar", (0, 0, -12)),
        ("left_shoulder", (0, 0, 50)),
        ("right_shoulder", (0, 0, -50)),
    ),
    "step": (
        ("left_hip", (-38, 0, 3)),
        ("left_knee", (22, 0, 0)),
        ("right_hip", (20, 0, -3)),
        ("right_knee", (18, 0, 0)),
        ("right_ankle", (8, 0, 0)),
        ("spine1", (4, 0, 0)),
        ("left_shoulder", (24, 0, -62)),
        ("right_shoulder", (-28, 0, 62)),
        ("left_elbow", (0, -18, 0)),
        ("right_elbow", (0, 24, 0)),
    ),
    "sit": (
        ("left_hip", (-82, 0, 8)),
        ("right_hip", (-82, 0, -8)),
        ("left_knee", (84, 0, 0)),
        ("right_knee", (84, 0, 0)),
        ("left_shoulder", (-26, 0, -58)),
        ("right_shoulder", (-26, 0, 58)),
        ("left_elbow", (0, -30, 0)),
        ("right_elbow", (0, 30, 0)),
    ),
    "twist": (
        ("spine1", (0, 16, 0)),
        ("spine2", (0, 16, 0)),
        ("spine3", (0, 14, 0)),
        ("neck", (0, 10, 0)),
        ("left_hip", (0, 0, 8)),
        ("right_hip", (0, 0, -8)),
        ("left_shoulder", (0, 0, -35)),
        ("right_shoulder", (0, 0, 35)),
    ),
    "bend": (
        ("pelvis", (32, 0, 0)),
        ("spine1", (16, 0, 0)),
        ("spine2", (14, 0, 0)),
        ("spine3", (8, 0, 0)),
        ("left_hip", (-30, 0, 3)),
        ("right_hip", (-30, 0, -3)),
        *_ARMS_DOWN,
    ),
    "stand": (*_ARMS_DOWN, ("left_elbow", (0, -8, 0)), ("right_elbow", (0, 8, 0))),
}


def telling_poses() -> dict[str, NDArray[np.float64]]:
    """Poses (24, 3), axis-angle in radians, by their names; the most telling first."""
    return {name: _pose(turns) for name, turns in _POSES.items()}


def _pose(turns: _Turns) -> NDArray[np.float64]:
    pose = np.zeros((JOINT_COUNT, 3))
    for joint, degrees in turns:
        x, y, z = (axis_angle_to_quaternion(row) for row in np.diag(np.radians(degrees)))
        turned = multiply_quaternions(x, multiply_quaternions(y, z))
        pose[JOINT_NAMES.index(joint)] = quaternion_to_axis_angle(turned)
    return pose
