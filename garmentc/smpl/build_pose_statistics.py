"""Derives the pose statistics that ship with garmentc from recorded motion.

    python -m garmentc.smpl.build_pose_statistics pose_statistics.npz CLIP...

CLIP is motion as `read_motion` reads it (AMASS .npz or BVH). pose_statistics.LICENSE.md names the clips of the shipped
file and their terms.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.pose_statistics import POSED, PoseStatistics
from garmentc.smpl.read_motion import read_motion
from garmentc.smpl.rotations import axis_angle_to_matrix, matrix_to_quaternion, quaternion_to_axis_angle
from garmentc.smpl.skeleton import JOINT_NAMES

_TAIL = 0.001
"""Share of the frames beyond each limit: single glitches of a recording."""


def pose_statistics(clips: Sequence[NDArray[np.float64]]) -> PoseStatistics:
    """Statistics of clips of poses (T, 24, 3), axis-angle; every clip counts the same, however long it is.

    The mirror image of each pose is counted too. Headings are taken off: the root keeps its tilt.
    """
    rows, weights = [], []
    for clip in clips:
        poses = without_heading(clip)
        for side in (poses, mirrored(poses)):
            rows.append(side[:, :POSED].reshape(len(side), -1))
            weights.append(np.full(len(side), 0.5 / len(side) / len(clips)))
    samples, weight = np.concatenate(rows), np.concatenate(weights)
    mean = weight @ samples
    centred = samples - mean
    values, axes = np.linalg.eigh((centred * weight[:, None]).T @ centred)
    largest = values.argsort()[::-1]
    factor = axes[:, largest] * np.sqrt(np.maximum(values[largest], 0.0))
    # Left and right go equally far: which of them is larger is a matter of rounding, so the first such entry counts.
    far = np.abs(factor) > 0.99 * np.abs(factor).max(axis=0)
    factor *= np.sign(factor[far.argmax(axis=0), np.arange(factor.shape[1])])
    low, high = np.quantile(samples, [_TAIL, 1 - _TAIL], axis=0)
    return PoseStatistics(*(array.astype(np.float32) for array in (mean, factor, low, high)))


def mirrored(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """The poses (T, 24, 3) as seen in a mirror: left and right change places, turns about Y and Z change sign."""
    swap = {"left": "right", "right": "left"}
    names = [name.split("_") for name in JOINT_NAMES]
    partner = [JOINT_NAMES.index("_".join([swap.get(part[0], part[0]), *part[1:]])) for part in names]
    return poses[:, partner] * [1.0, -1.0, -1.0]


def without_heading(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """The poses (T, 24, 3), each turned about the vertical so that the pelvis faces +Z."""
    roots = axis_angle_to_matrix(poses[:, 0])
    angle = -np.arctan2(roots[:, 0, 2], roots[:, 2, 2])
    zero = np.zeros_like(angle)
    turned = poses.copy()
    back = axis_angle_to_matrix(np.stack([zero, angle, zero], axis=1))
    turned[:, 0] = quaternion_to_axis_angle(matrix_to_quaternion(back @ roots))
    return turned


def main(arguments: Sequence[str]) -> None:
    """Write the file."""
    target, *clips = map(Path, arguments)
    statistics = pose_statistics([np.asarray(read_motion(clip).poses, np.float64) for clip in sorted(clips)])
    np.savez(target, **vars(statistics))


if __name__ == "__main__":
    main(sys.argv[1:])
