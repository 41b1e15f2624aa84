"""Motions in stretches that are simulated side by side. Each has a way in, so where it begins does not matter."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.motion import Motion
from garmentc.smpl.rotations import axis_angle_to_matrix, axis_angle_to_quaternion, quaternion_to_axis_angle, slerp
from garmentc.smpl.skinning import joint_transforms

_SLOWEST = 24.0
"""Frames a second: between those of slower motions there is too much way, and others are put in."""

_POSES_ALONE = 6.0
"""Frames a second: those of even slower motions are poses, each of them by itself."""

_WAY_IN, _PAUSE = 1.0, 0.25
"""Seconds in which the body comes from its pose at rest to the first one, and stays there, before anything is shown."""

_LONGEST, _OVERLAP = 8.0, 0.5
"""Seconds that a stretch shows at most, and in which it goes over into the next one."""

_BEFORE = 1.5
"""Seconds of the motion between that way in and what a stretch shows, where it does not begin at the beginning."""

_FASTEST = 15.0
"""m/s: where a whole body goes faster from one frame to the next, the motion has been cut there."""

_SIDE_BY_SIDE = 16
"""Stretches: what processors' registers and caches hold. The same on all machines: sums of matrices depend on it."""

_APART = 4
"""Stretches: up to so many, each is done by itself; side by side they would take as long."""


@dataclass(frozen=True)
class Stretches:
    """S stretches of motions, each K frames long.

    poses   (K, S, 24, 3) axis-angle, radians
    trans   (K, S, 3) metres
    fps     frames a second, or 0 where every frame is a pose by itself
    frames  (K, S) which frame of the motions that is, counted through all of them, or -1 where it is none,
    shares  (K, S) and how much it counts: those of every frame of the motions sum to 1
    """

    poses: NDArray[np.float64]
    trans: NDArray[np.float64]
    fps: float
    frames: NDArray[np.intp]
    shares: NDArray[np.float32]

    @classmethod
    def of(cls, motions: Sequence[Motion], joints: NDArray[Any]) -> list[Stretches]:
        """All stretches of `motions`, of the body with its `joints` (24, 3) at rest; as many as fit side by side."""
        by_rate: dict[float, list[Stretches]] = {}
        begin = 0
        for motion in motions:
            single = _poses_alone(motion) if motion.fps < _POSES_ALONE else _of_takes(motion, joints)
            counted = [replace(each, frames=np.where(each.frames < 0, -1, begin + each.frames)) for each in single]
            by_rate.setdefault(counted[0].fps, []).extend(counted)
            begin += len(motion)
        groups = []
        for stretches in by_rate.values():
            stretches.sort(key=lambda stretch: len(stretch.poses))
            count = len(stretches) if len(stretches) <= _APART else int(np.ceil(len(stretches) / _SIDE_BY_SIDE))
            ends = np.linspace(0, len(stretches), count + 1).astype(int).tolist()
            groups += [_side_by_side(stretches[begin:end]) for begin, end in itertools.pairwise(ends)]
        return groups

    def ahead(self, number: int) -> NDArray[np.float64]:
        """Metres (3, S) that bodies go from one of the K frames to the next; none from the last, and from poses."""
        if not self.fps or number + 1 >= len(self.trans):
            return np.zeros((3, self.trans.shape[1]))
        way: NDArray[np.float64] = (self.trans[number + 1] - self.trans[number]).T
        return way


def _side_by_side(stretches: Sequence[Stretches]) -> Stretches:
    """Single stretches together, made equally long: what is at the end stays there."""
    length = max(len(stretch.poses) for stretch in stretches)
    longer = [_lengthened(stretch, length) for stretch in stretches]
    return Stretches(
        np.concatenate([stretch.poses for stretch in longer], axis=1),
        np.concatenate([stretch.trans for stretch in longer], axis=1),
        longer[0].fps,
        np.concatenate([stretch.frames for stretch in longer], axis=1),
        np.concatenate([stretch.shares for stretch in longer], axis=1),
    )


def _poses_alone(motion: Motion) -> list[Stretches]:
    """Every frame by itself."""
    poses, trans = np.asarray(motion.poses, np.float64), np.asarray(motion.trans, np.float64)
    return [
        Stretches(pose[None, None], place[None, None], 0.0, np.array([[frame]]), np.ones((1, 1), np.float32))
        for frame, (pose, place) in enumerate(zip(poses, trans, strict=True))
    ]


def _of_takes(motion: Motion, joints: NDArray[Any]) -> list[Stretches]:
    """Stretches, one by one, of all takes of `motion`."""
    cuts = [0, *_cuts(motion, joints), len(motion)]
    takes = [_of_take(motion.clipped(*ends), ends[0]) for ends in itertools.pairwise(cuts)]
    return list(itertools.chain(*takes))


def _cuts(motion: Motion, joints: NDArray[Any]) -> list[int]:
    """The frames that do not follow the one before."""
    turned = axis_angle_to_matrix(np.asarray(motion.poses, np.float64))
    transforms = joint_transforms(turned, np.asarray(joints, np.float64))
    places = np.einsum("tjik,jk->tji", transforms[..., :3, :3], joints) + transforms[..., :3, 3] + motion.trans[:, None]
    way = np.linalg.norm(np.diff(places.mean(axis=1), axis=0), axis=1)
    cuts: list[int] = (1 + np.flatnonzero(way > _FASTEST / motion.fps)).tolist()
    return cuts


def _of_take(take: Motion, begin: int) -> list[Stretches]:
    """Stretches, one by one, of a motion without cuts that begins at frame `begin` of another."""
    between = 1
    if take.fps < _SLOWEST:
        between = int(np.ceil(_SLOWEST / take.fps))
        take = take.resampled(between * take.fps)
    count = int(np.ceil(len(take) / (_LONGEST * take.fps)))
    shown = int(np.ceil(len(take) / count))
    stretches = [_stretch(take, first, first + shown) for first in range(0, len(take), shown)]
    return [_every(stretch, between, begin) for stretch in stretches]


def _stretch(take: Motion, first: int, end: int) -> Stretches:
    """The stretch that shows frames `first` to `end` (exclusive) of `take`: it comes in before, and goes out after."""
    overlap = max(1, round(_OVERLAP * take.fps))
    early, late = max(first - round(_BEFORE * take.fps), 0), min(end + overlap, len(take))
    whole = with_way_in(take.clipped(early, late))
    frames = np.arange(late - len(whole), late)
    # In the overlap one comes as the other goes.
    comes = np.clip((frames - first + 1) / (overlap + 1), 0, 1) if first else frames >= 0
    goes = np.clip((end + overlap - frames) / (overlap + 1), 0, 1) if end < len(take) else 1
    poses, trans = np.asarray(whole.poses, np.float64), np.asarray(whole.trans, np.float64)
    shares = np.asarray(comes * goes, np.float32)
    return Stretches(poses[:, None], trans[:, None], take.fps, frames[:, None], shares[:, None])


def _every(stretch: Stretches, between: int, begin: int) -> Stretches:
    """A stretch in which every `between`th frame counts, and the first is frame `begin` of another motion."""
    frames, left = np.divmod(stretch.frames, between)
    shares = np.where(left == 0, stretch.shares, np.float32(0))
    return replace(stretch, frames=np.where(shares > 0, begin + frames, -1), shares=shares)


def _lengthened(stretch: Stretches, length: int) -> Stretches:
    """The same stretch, `length` frames long: the body stays where it is at the end."""
    more = length - len(stretch.poses)
    return replace(
        stretch,
        poses=np.concatenate([stretch.poses, np.repeat(stretch.poses[-1:], more, axis=0)]),
        trans=np.concatenate([stretch.trans, np.repeat(stretch.trans[-1:], more, axis=0)]),
        frames=np.concatenate([stretch.frames, np.full((more, 1), -1)]),
        shares=np.concatenate([stretch.shares, np.zeros((more, 1), np.float32)]),
    )


def with_way_in(take: Motion) -> Motion:
    """The take after a way in from the pose at rest, in its first heading and at its first speed.

    Cloth must not begin with a jump.
    """
    count, pause = round(_WAY_IN * take.fps), round(_PAUSE * take.fps)
    share = np.concatenate([np.arange(count) / count, np.ones(pause)])
    share = share * share * (3 - 2 * share)  # no speed at either end
    first = np.asarray(take.poses[0], np.float64)
    root = axis_angle_to_matrix(first[0])
    rest = np.zeros_like(first)
    rest[0, 1] = np.arctan2(root[0, 2], root[2, 2])
    start, end = (
        np.broadcast_to(axis_angle_to_quaternion(pose), (len(share), len(first), 4)) for pose in (rest, first)
    )
    poses = quaternion_to_axis_angle(slerp(start, end, np.broadcast_to(share[:, None], start.shape[:2])))
    step = take.trans[min(1, len(take) - 1)] - take.trans[0]
    trans = take.trans[0] + np.arange(-len(share), 0)[:, None] * step
    return replace(take, poses=np.concatenate([poses, take.poses]), trans=np.concatenate([trans, take.trans]))
