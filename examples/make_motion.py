"""Make the example motion: steps on the spot, a turn, both arms raised. Run `python examples/make_motion.py`.

Every curve is written by hand below; nothing is recorded. The file has AMASS's layout, but Y is up.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl import load_body
from garmentc.smpl.rotations import (
    axis_angle_to_quaternion,
    multiply_quaternions,
    quaternion_to_axis_angle,
)
from garmentc.smpl.skeleton import JOINT_NAMES

Curve = NDArray[np.float64]

FPS = 30
SECONDS = 4.0
STEP = 0.62
"""Seconds from one step to the next."""


def ease(time: Curve, start: float, end: float) -> Curve:
    """0 before `start`, 1 after `end`, smooth between (zero speed and acceleration at both)."""
    t = np.clip((time - start) / (end - start), 0, 1)
    return t**3 * (10 - 15 * t + 6 * t * t)


def turned(*steps: tuple[str, Curve | float], count: int) -> Curve:
    """Axis-angle (T, 3) of rotations by degrees about fixed axes, the first step applied first."""
    total = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    for axis, degrees in steps:
        vector = np.zeros((count, 3))
        vector[:, "xyz".index(axis)] = np.radians(degrees)
        total = multiply_quaternions(axis_angle_to_quaternion(vector), total)
    return quaternion_to_axis_angle(total)


def make_poses(time: Curve) -> Curve:
    """(T, 24, 3) axis-angle."""
    count = len(time)
    poses = np.zeros((count, 24, 3))

    def joint(name: str, *steps: tuple[str, Curve | float]) -> None:
        poses[:, JOINT_NAMES.index(name)] = turned(*steps, count=count)

    walking = ease(time, 0.1, 0.7) * (1 - ease(time, 2.2, 2.8))
    turn = ease(time, 1.0, 2.7)
    raised = ease(time, 2.3, 3.2) * (1 - 0.25 * ease(time, 3.3, 3.9))
    phase = np.pi * time / STEP
    left = walking * np.maximum(np.sin(phase), 0) ** 1.5
    right = walking * np.maximum(-np.sin(phase), 0) ** 1.5
    swing = walking * np.sin(phase)

    joint("pelvis", ("z", 2.5 * swing), ("x", 2 * walking), ("y", 80 * turn))
    joint("spine1", ("z", -2 * swing), ("y", 4 * swing))
    joint("spine2", ("y", 4 * swing), ("x", -4 * raised))
    joint("spine3", ("y", 3 * swing), ("x", -4 * raised))
    joint("neck", ("y", -5 * swing + 10 * walking * np.sin(np.pi * turn)), ("x", -6 * raised))
    joint("head", ("y", -4 * swing), ("x", -6 * raised))
    for side, lift, sign in (("left", left, 1.0), ("right", right, -1.0)):
        # Hips turned out a little: thighs that rub would leave no room for cloth.
        joint(f"{side}_hip", ("x", -38 * lift - 3), ("z", sign * 4))
        joint(f"{side}_knee", ("x", 62 * lift + 6))
        joint(f"{side}_ankle", ("x", 14 * lift - 3), ("z", -sign * 3))
        forward = -sign * 16 * swing
        joint(f"{side}_collar", ("z", sign * (-6 + 18 * raised)))
        joint(
            f"{side}_shoulder",
            ("z", sign * (-56 + 78 * raised)),
            ("x", -forward * (1 - raised) - 6),
        )
        joint(f"{side}_elbow", ("y", -sign * (18 + 12 * lift + 14 * np.sin(np.pi * raised))))
        joint(f"{side}_wrist", ("z", sign * (-6 + 14 * raised)))
    return poses


def main() -> None:
    from scipy.ndimage import gaussian_filter1d

    time = np.arange(round(SECONDS * FPS)) / FPS
    poses = make_poses(time)
    body = load_body(None, "female")
    # The lowest foot stands on the floor, y = 0.
    height = -body.posed(poses)[..., 1].min(1)
    trans = np.zeros((len(time), 3))
    trans[:, 1] = gaussian_filter1d(height, 1.5, mode="nearest")
    folder = Path(__file__).resolve().parent / "motions"
    folder.mkdir(exist_ok=True)
    np.savez_compressed(
        folder / "step_turn_raise.npz",
        poses=poses.reshape(len(time), 72).astype(np.float32),
        trans=trans.astype(np.float32),
        betas=np.zeros(10, np.float32),
        gender=np.array("female"),
        mocap_framerate=np.float64(FPS),
        up_axis=np.array("Y"),
    )


if __name__ == "__main__":
    main()
