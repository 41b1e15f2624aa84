"""A-poses: the few angles in which modelled bodies differ from the T-pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.align.skin import posed_joints
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES, MIRROR


@dataclass(frozen=True)
class Turn:
    """One angle of the A-pose: `joint` turns about its `axis` (0 x, 1 y, 2 z), its twin on the right mirrors it.

    `usual` is the standard deviation, in radians, that modelled poses are expected to have.
    """

    joint: int
    axis: int
    sign: int
    usual: float


TURNS = {
    "collar down": Turn(JOINT_NAMES.index("left_collar"), 2, -1, 0.3),
    "shoulder down": Turn(JOINT_NAMES.index("left_shoulder"), 2, -1, 0.8),
    "shoulder forward": Turn(JOINT_NAMES.index("left_shoulder"), 1, -1, 0.2),
    "elbow bend": Turn(JOINT_NAMES.index("left_elbow"), 1, -1, 0.5),
    "hip spread": Turn(JOINT_NAMES.index("left_hip"), 2, 1, 0.15),
    "hip forward": Turn(JOINT_NAMES.index("left_hip"), 0, -1, 0.1),
    "knee bend": Turn(JOINT_NAMES.index("left_knee"), 0, 1, 0.1),
}

NO_TURNS, ALL_TURNS = (np.full(len(TURNS), fitted) for fitted in (False, True))

LIMBS_MOVED_BY = {
    JOINT_NAMES.index(joint): np.array([JOINT_NAMES.index(name) for name in moved])
    for joint, moved in {
        "left_collar": ("left_shoulder", "left_elbow"),
        "left_shoulder": ("left_shoulder", "left_elbow"),
        "left_elbow": ("left_elbow",),
        "left_hip": ("left_hip", "left_knee"),
        "left_knee": ("left_knee",),
    }.items()
}
"""The limbs whose cloth tells about the turn of a joint. Not the hands: wide skirts reach them."""


def a_pose(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """The pose (24, 3) with the angles of `TURNS` (7,), radians, the same on both sides."""
    pose = np.zeros((JOINT_COUNT, 3))
    for turn, angle in zip(TURNS.values(), angles, strict=True):
        pose[turn.joint, turn.axis] = turn.sign * angle
    pose += pose[MIRROR] * [1, -1, -1]
    return pose


def largest_turn(angles: NDArray[np.float64]) -> float:
    """Radians by which the limb that moved most has moved, given `angles` (7,); raised arms don't count.

    Collar and shoulder count together: cloth cut for other shoulders turns them against each other.
    """
    collar, shoulder, *others = angles
    return float(max(collar + shoulder, np.abs(others).max()))


def arms_lowered(pose: NDArray[np.float64], joints: NDArray[Any]) -> float:
    """Degrees by which the upper arms hang below those of the T-pose, the mean of both sides."""
    turned = posed_joints(pose, joints)
    lowered = []
    for side in ("left", "right"):
        shoulder, elbow = JOINT_NAMES.index(f"{side}_shoulder"), JOINT_NAMES.index(f"{side}_elbow")
        fall = [np.arctan2(*_drop(at[shoulder], at[elbow])) for at in (joints, turned)]
        lowered.append(fall[1] - fall[0])
    return float(np.degrees(np.mean(lowered)))


def _drop(shoulder: NDArray[Any], elbow: NDArray[Any]) -> tuple[float, float]:
    return float(shoulder[1] - elbow[1]), float(abs(elbow[0] - shoulder[0]))
