"""Motions out of nothing: from sampled pose to sampled pose, with pauses in which cloth comes to rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.simulation.motion_preparation import PreparationOptions, SelfOverlap, ease
from garmentc.smpl.body import BodyModel
from garmentc.smpl.motion import Motion
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.pose_statistics import draw_poses
from garmentc.smpl.rotations import axis_angle_to_quaternion, multiply_quaternions, quaternion_to_axis_angle, slerp

_TRIES_PER_POSE = 8

POSE_SOURCES = {"ranges": sample_poses, "statistics": draw_poses}
"""Where poses come from: hand-made ranges of motion, or the statistics of recorded motion."""


@dataclass(frozen=True)
class WalkOptions:
    """How fast the body goes from pose to pose.

    fps      frames a second
    speed    degrees a second: the joint that has farthest to go turns this fast on average
    quickest, slowest   seconds of a transition
    hold     (least, most) seconds that a pose is held
    poses    a name of POSE_SOURCES
    """

    fps: float = 30.0
    speed: float = 90.0
    quickest: float = 0.5
    slowest: float = 1.6
    hold: tuple[float, float] = (0.1, 0.5)
    poses: str = "ranges"


def pose_walk(
    frame_count: int,
    seed: int,
    body: BodyModel | None = None,
    betas: NDArray[Any] | None = None,
    options: WalkOptions | None = None,
) -> Motion:
    """A motion of `frame_count` frames through sampled poses, at heading zero, the pelvis in its place.

    Every joint takes the shorter arc between two sampled poses, so it stays within the ranges of motion that they are
    drawn from (they are convex but for the twist of an arm), and starts and stops gently. The root tilts
    with the poses. Where a `body` with shape `betas` is given, poses in which it runs into itself are not walked to.

    The same arguments give the same motion. Raises GarmentcError where the body leaves no clear pose.
    """
    options = options or WalkOptions()
    rng = np.random.default_rng([0x3A1C, seed])
    overlap = None if body is None else SelfOverlap.of(body, betas, PreparationOptions())
    shortest = options.quickest + options.hold[0]
    enough = int(np.ceil(frame_count / (options.fps * shortest))) + 2
    drawn = iter(POSE_SOURCES[options.poses](_TRIES_PER_POSE * enough, int(rng.integers(1 << 31))))
    frames: list[NDArray[np.float64]] = []
    here = _next_pose(drawn, overlap)
    total = 0
    while total < frame_count:
        there = _next_pose(drawn, overlap)
        share = _shares(here, there, rng.uniform(*options.hold), options)
        shape = (len(share), len(here))
        frames.append(slerp(np.broadcast_to(here, (*shape, 4)), there, np.broadcast_to(share[:, None], shape)))
        total += len(share)
        here = there
    poses = quaternion_to_axis_angle(np.concatenate(frames)[:frame_count])
    return Motion(f"pose walk {seed}", poses, np.zeros((frame_count, 3)), options.fps, source="sampled poses")


def _next_pose(drawn: Any, overlap: SelfOverlap | None) -> NDArray[np.float64]:
    """The next clear pose as quaternions (24, 4)."""
    for pose in drawn:
        if overlap is None or overlap.clear(pose[None])[0]:
            return axis_angle_to_quaternion(pose)
    raise GarmentcError("nearly every sampled pose makes this body run into itself; use a slimmer body (smaller betas)")


def _shares(
    here: NDArray[np.float64], there: NDArray[np.float64], hold: float, options: WalkOptions
) -> NDArray[np.float64]:
    """How far each frame of a pause at `here` and a transition is on its way; the last one is short of `there`."""
    turn = multiply_quaternions(there, here * [-1, -1, -1, 1])
    widest = np.degrees(np.linalg.norm(quaternion_to_axis_angle(turn), axis=1).max())
    seconds = float(np.clip(widest / options.speed, options.quickest, options.slowest))
    count = max(round(seconds * options.fps), 1)
    return np.concatenate([np.zeros(round(hold * options.fps)), ease(np.arange(count) / count)])
