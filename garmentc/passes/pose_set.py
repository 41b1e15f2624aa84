"""The poses that passes fit to, and the others that they are measured on."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.blas import single_threaded_blas
from garmentc.rig import KeyNetwork
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES

FIT_COUNT = 1024
CHECK_COUNT = 48
_FIT_SEED, _CHECK_SEED, _SHAKEN_SEED = 1, 2, 3

_TRUNK = ("spine1", "spine2", "spine3", "neck", "head")
_AT_THE_TRUNK = tuple(f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "collar", "shoulder"))
_SHAKEN_JOINTS = [JOINT_NAMES.index(name) for name in (*_TRUNK, *_AT_THE_TRUNK)]
"""What sampled poses turn together and people do not."""

_MOST_SHAKEN = np.radians(17)
"""Standard deviation of the turn about each axis in the pose that is shaken most."""


@dataclass(frozen=True, eq=False)
class PoseSet:
    """Axis-angle poses, radians.

    fit    (P, 24, 3) what a pass may adapt itself to
    check  (Q, 24, 3) what its error is measured on: none of them is in `fit`
    baked  (T, 24, 3) all frames of the animations
    """

    fit: NDArray[Any]
    check: NDArray[Any]
    baked: NDArray[Any] = field(default_factory=lambda: np.zeros((0, JOINT_COUNT, 3)))

    def some(self, count: int) -> NDArray[np.float64]:
        """At most `count` of the poses to fit, spread over them."""
        count = min(count, len(self.fit))
        return np.asarray(self.fit[_spread(len(self.fit), count, 0.5)], np.float64)

    def some_shaken(self, count: int) -> NDArray[np.float64]:
        """At most `count` of the poses to fit, each with its trunk's joints turned at random, some more, some less.

        Recorded people bend one vertebra and not the next, and lift a shoulder without the arm. Sampled poses do not,
        and what is chosen on them alone may fail there.
        """
        poses = self.some(count).copy()
        rng = np.random.default_rng(_SHAKEN_SEED)
        amount = _MOST_SHAKEN * rng.uniform(0, 1, (len(poses), 1, 1))
        poses[:, _SHAKEN_JOINTS] += amount * rng.normal(size=(len(poses), len(_SHAKEN_JOINTS), 3))
        return poses


def plausible_poses(motion: NDArray[Any] | None = None, fit: int = FIT_COUNT, check: int = CHECK_COUNT) -> PoseSet:
    """Sampled poses, the same in every run; frames of `motion` (T, 24, 3) join them, at most a quarter of each set.

    A motion's frames are spread evenly over it, and the frames to check lie between those to fit.
    """
    poses = PoseSet(sample_poses(fit, _FIT_SEED), sample_poses(check, _CHECK_SEED))
    if motion is None or not len(motion):
        return poses
    return PoseSet(
        np.concatenate([poses.fit, motion[_spread(len(motion), fit // 4, 0.25)]]),
        np.concatenate([poses.check, motion[_spread(len(motion), check // 4, 0.75)]]),
        motion,
    )


@lru_cache(maxsize=1)
def keys_to_fit(network: KeyNetwork, poses: PoseSet) -> NDArray[np.float64]:
    """Keys (P, M) of the poses to fit. Several passes, one after the other, ask for those of the same network."""
    with single_threaded_blas():
        keys: NDArray[np.float64] = network(np.asarray(poses.fit, np.float64))
    keys.setflags(write=False)
    return keys


def farthest_apart(poses: NDArray[Any], count: int) -> NDArray[Any]:
    """At most `count` of `poses` (P, 24, 3), as different as they come, whatever way the root looks.

    Each is the one that is farthest from those before it (Gonzalez 1985).
    """
    angles = poses[:, 1:].reshape(len(poses), -1)
    rows, distance = [0], np.full(len(poses), np.inf)
    while len(rows) < min(count, len(poses)):
        distance = np.minimum(distance, np.linalg.norm(angles - angles[rows[-1]], axis=1))
        rows.append(int(distance.argmax()))
    return poses[rows]


def _spread(length: int, count: int, phase: float) -> NDArray[np.intp]:
    """At most `count` rising frame numbers below `length`, `phase` of a step away from the step's start."""
    count = min(count, length)
    return ((np.arange(count) + phase) * (length / count)).astype(np.intp)
