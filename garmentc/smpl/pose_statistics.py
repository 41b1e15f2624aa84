"""Poses drawn from the statistics of recorded motion: an alternative to the hand-made ranges of `pose_sampler`.

What people did in ten clips, as a normal distribution over all joint angles together, cut off at the angles that were
seen. Poses come out like those of people who walk, reach, climb, fight and dance; nothing that the clips don't hold is
drawn, while `sample_poses` goes to the ends of what joints can do. Recorded motion that these were derived from is not
unseen any more: don't measure on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.skeleton import JOINT_COUNT

POSED = 22
"""Joints with statistics, the first so many: all but the hands."""


@dataclass(frozen=True)
class PoseStatistics:
    """Axis-angle vectors of POSED joints, P = 3 x POSED numbers in radians, the root without heading.

    mean    (P,)
    factor  (P, P) principal axes as columns, each as long as its standard deviation, longest first
    low     (P,) what almost no frame was below
    high    (P,) nor above
    """

    mean: NDArray[np.float32]
    factor: NDArray[np.float32]
    low: NDArray[np.float32]
    high: NDArray[np.float32]


@cache
def load_pose_statistics() -> PoseStatistics:
    """The shipped statistics; pose_statistics.LICENSE.md says what they were derived from."""
    with (files("garmentc.smpl") / "pose_statistics.npz").open("rb") as file, np.load(file, allow_pickle=False) as npz:
        return PoseStatistics(**{name: npz[name] for name in ("mean", "factor", "low", "high")})


def draw_poses(count: int, seed: int, statistics: PoseStatistics | None = None) -> NDArray[np.float64]:
    """`count` poses (count, 24, 3), axis-angle in radians at heading zero; the same seed gives the same."""
    statistics = statistics or load_pose_statistics()
    drawn = np.random.default_rng(seed).standard_normal((count, len(statistics.mean)))
    angles = np.tile(statistics.mean.astype(np.float64), (count, 1))
    for axis, amount in zip(statistics.factor.T.astype(np.float64), drawn.T, strict=True):
        angles += amount[:, None] * axis  # in this order, whatever the machine's linear algebra would do
    poses = np.zeros((count, JOINT_COUNT, 3))
    poses[:, :POSED] = np.clip(angles, statistics.low, statistics.high).reshape(count, POSED, 3)
    return poses
