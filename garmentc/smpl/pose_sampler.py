"""Random plausible poses: what passes measure on and what networks train on without motion capture.

Every number here is an anatomical range of motion, chosen by hand; none is fitted to recorded motion, so recorded
motion stays unseen. Joints are not drawn one by one: limbs share an amplitude, knees follow hips, the trunk bends as
one, and the two sides are alike, opposite or independent. Arms are aimed (direction and twist), not boxed per axis.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.rotations import axis_angle_to_matrix, matrix_to_quaternion, quaternion_to_axis_angle
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES

_JOINT = {name: k for k, name in enumerate(JOINT_NAMES)}
_Floats = NDArray[Any]


def sample_poses(count: int, seed: int) -> NDArray[np.float64]:
    """`count` poses (count, 24, 3), axis-angle in radians at heading zero; the same seed gives the same."""
    rng = np.random.default_rng(seed)
    amplitude = rng.uniform(0.25, 1.0, count)
    poses = np.zeros((count, JOINT_COUNT, 3))
    _trunk(poses, rng, amplitude)
    _legs(poses, rng, amplitude)
    _arms(poses, rng, amplitude)
    return poses


def _between(rng: np.random.Generator, low: float, high: float, amount: _Floats) -> _Floats:
    """Bell-shaped draws in [low, high] degrees, shrunk towards 0 by `amount` in [0, 1]; radians."""
    centred = rng.beta(2.0, 2.0, amount.shape)
    return np.radians(low + (high - low) * centred) * amount


def _trunk(poses: _Floats, rng: np.random.Generator, amplitude: _Floats) -> None:
    bend, side, twist = (_between(rng, *limits, amplitude) for limits in ((-25, 75), (-35, 35), (-45, 45)))
    for joint, share in (("spine1", 0.4), ("spine2", 0.3), ("spine3", 0.3)):
        poses[:, _JOINT[joint]] = np.stack([bend, twist, side], axis=1) * share
    nod, turn, tilt = (_between(rng, *limits, amplitude) for limits in ((-35, 40), (-60, 60), (-25, 25)))
    for joint in ("neck", "head"):
        poses[:, _JOINT[joint]] = np.stack([nod, turn, tilt], axis=1) * 0.5
    lean = 0.5 * bend + _between(rng, -25, 35, amplitude)
    poses[:, 0] = np.stack([lean, np.zeros_like(lean), _between(rng, -25, 25, amplitude)], axis=1)


def _legs(poses: _Floats, rng: np.random.Generator, amplitude: _Floats) -> None:
    count = len(poses)
    stride = rng.uniform(0, 1, count)
    shared = _between(rng, -10, 105, amplitude)  # both thighs lifted: sitting, squatting
    step = _between(rng, -40, 40, amplitude)  # one forward, one back: walking, lunging
    style = rng.integers(0, 3, count)  # 0 stride, 1 squat, 2 one leg lifted
    lifted_side = rng.integers(0, 2, count)
    for index, (side, sign) in enumerate((("left", 1.0), ("right", -1.0))):
        one = np.where(lifted_side == index, np.abs(shared), 0.3 * step)
        flexion = np.select([style == 0, style == 1], [0.25 * shared + sign * step, shared], one)
        spread = _between(rng, -4, 38, amplitude) * np.where(style == 1, 1.0, 0.6)
        turn = _between(rng, -25, 30, amplitude)
        hip = _euler(np.clip(-flexion, np.radians(-110), np.radians(25)), sign * turn, sign * spread)
        poses[:, _JOINT[f"{side}_hip"]] = hip
        follow = np.clip(flexion, 0, None) * rng.uniform(0.2, 1.4, count)
        knee = np.clip(follow + stride * _between(rng, 0, 70, amplitude), 0, np.radians(135))
        poses[:, _JOINT[f"{side}_knee"], 0] = knee
        ankle = (
            _between(rng, -25, 40, amplitude),
            _between(rng, -15, 15, amplitude),
            _between(rng, -12, 12, amplitude),
        )
        poses[:, _JOINT[f"{side}_ankle"]] = np.stack(ankle, axis=1) * [1, sign, sign]
        poses[:, _JOINT[f"{side}_foot"], 0] = _between(rng, -50, 45, amplitude)


def _arms(poses: _Floats, rng: np.random.Generator, amplitude: _Floats) -> None:
    count = len(poses)
    coupling = rng.integers(0, 3, count)  # 0 independent, 1 alike, 2 alike but one hangs
    draws = [_arm(rng, amplitude) for _ in range(2)]
    hanging = (np.radians(rng.uniform(-78, -55, count)), np.radians(rng.uniform(-15, 25, count)), *draws[1][2:])
    alike = [np.where(coupling == 0, right, left) for left, right in zip(*draws, strict=True)]
    right_arm = [np.where(coupling == 2, low, same) for low, same in zip(hanging, alike, strict=True)]
    for side, sign, arm in (("left", 1.0, draws[0]), ("right", -1.0, right_arm)):
        elevation, forward, twist, elbow, forearm = arm
        raised = np.clip(elevation, 0, None)
        collar = np.stack([np.zeros(count), -0.15 * forward, 0.3 * raised + 0.1 * np.minimum(elevation, 0)], axis=1)
        poses[:, _JOINT[f"{side}_collar"]] = collar * [1, sign, sign]
        shoulder = _aimed(elevation * 0.85, forward * 0.85, twist)
        poses[:, _JOINT[f"{side}_shoulder"]] = shoulder * [1, sign, sign]
        bent = np.stack([0.4 * forearm, -elbow, 0.1 * elbow], axis=1)
        poses[:, _JOINT[f"{side}_elbow"]] = bent * [1, sign, sign]
        wrist = (0.5 * forearm, _between(rng, -25, 25, amplitude), _between(rng, -35, 45, amplitude))
        poses[:, _JOINT[f"{side}_wrist"]] = np.stack(wrist, axis=1) * [1, sign, sign]


def _arm(rng: np.random.Generator, amplitude: _Floats) -> tuple[_Floats, ...]:
    """Elevation (0 = level), forward, twist of the upper arm, elbow flexion, forearm twist; left arm, radians."""
    count = len(amplitude)
    low = np.radians(rng.uniform(-80, -45, count))
    anywhere = np.radians(rng.uniform(-75, 65, count))
    elevation = np.where(rng.random(count) < 0.55, low, anywhere)
    forward = np.radians(-25 + 110 * rng.beta(1.6, 2.6, count))
    twist = _between(rng, -55, 55, amplitude)
    elbow = np.radians(135) * rng.beta(1.2, 2.2, count)
    return elevation, forward, twist, elbow, _between(rng, -60, 60, amplitude)


def _aimed(elevation: _Floats, forward: _Floats, twist: _Floats) -> _Floats:
    """Left shoulder rotation that takes the T-pose arm (+X) to a direction, turned about the arm first by `twist`."""
    zero = np.zeros_like(elevation)
    aim = axis_angle_to_matrix(np.stack([zero, -forward, zero], axis=1))
    lift = axis_angle_to_matrix(np.stack([zero, zero, elevation], axis=1))
    spin = axis_angle_to_matrix(np.stack([twist, zero, zero], axis=1))
    return quaternion_to_axis_angle(matrix_to_quaternion(aim @ lift @ spin))


def _euler(x: _Floats, y: _Floats, z: _Floats) -> _Floats:
    """Rotation by z, then x, then y (abduct, flex, turn), as axis-angle."""
    zero = np.zeros_like(x)
    turns = [np.stack(v, axis=1) for v in ((zero, y, zero), (x, zero, zero), (zero, zero, z))]
    first, second, third = (axis_angle_to_matrix(v) for v in turns)
    return quaternion_to_axis_angle(matrix_to_quaternion(second @ third @ first))
