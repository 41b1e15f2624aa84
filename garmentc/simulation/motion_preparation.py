"""Recorded motions made fit for cloth: arms clear of the trunk, a way in from rest, frames without room marked.

Recorded people were slimmer than the bodies that re-enact them. Where an arm sinks into the trunk there is no place for
cloth, and what is simulated there is worthless or tangles for good.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.evaluation.open_arms import open_arms
from garmentc.outfit.topology import vertex_normals
from garmentc.smpl.body import BodyModel
from garmentc.smpl.motion import Motion
from garmentc.smpl.rotations import (
    axis_angle_to_matrix,
    axis_angle_to_quaternion,
    matrix_to_quaternion,
    quaternion_to_axis_angle,
    slerp,
)

_SCREENED = 40
"""Frames at which an opening of the arms is tried."""
_STRIDE = 3
"""One in so many frames of a motion is asked."""
_SAMPLED = 4
"""One in so many vertices of the body is asked: they lie about a centimetre apart."""


@dataclass(frozen=True)
class PreparationOptions:
    """How motions are prepared.

    fps            the motion is resampled to this
    arms           degrees that the arms are opened (Santesteban et al. 2021: 15), in steps of `arms_step` up to
                   `arms_most` where that makes more frames clear
    overlap_depth  metres: a frame is not clear where the body runs deeper into itself
    overlap_share  for more than this share of its vertices
    lead_in        frames from rest to the first pose, at least
    lead_in_speed  degrees per frame that a joint turns at most on the way there; it takes more frames if it must
    hold           frames that the first pose is held for, so that the cloth comes to rest
    """

    fps: float = 30.0
    arms: float = 15.0
    arms_step: float = 5.0
    arms_most: float = 35.0
    overlap_depth: float = 0.01
    overlap_share: float = 0.002
    lead_in: int = 20
    lead_in_speed: float = 4.0
    hold: int = 8


@dataclass(frozen=True)
class PreparedMotion:
    """A motion to simulate.

    motion    starts at rest: zero pose, heading and translation
    lead_in   frames before the motion proper
    clear     (T,) frames to keep: part of the motion proper, with a body that doesn't run into itself
    arms      degrees that the arms were opened by
    bridged   frames of the motion proper that were not clear and replaced by a turn between their clear neighbours
    """

    motion: Motion
    lead_in: int
    clear: NDArray[np.bool_]
    arms: float
    bridged: int


def prepare_motion(
    motion: Motion, body: BodyModel, betas: NDArray[Any] | None = None, options: PreparationOptions | None = None
) -> PreparedMotion:
    """Make `motion` fit for the cloth of `body` with shape `betas`.

    Resampled, turned to heading 0 at the start, arms opened until they are clear; frames that still aren't are bridged,
    and those that aren't clear after that are marked; a lead-in from rest is put before.
    """
    options = options or PreparationOptions()
    even = motion if motion.fps == options.fps else motion.resampled(options.fps)
    pelvis = np.asarray(body.joints(betas)[0], np.float64)
    poses, trans = _from_heading_zero(np.asarray(even.poses, np.float64), np.asarray(even.trans, np.float64), pelvis)
    overlap = SelfOverlap.of(body, betas, options)
    opening = _clearing_angle(poses, overlap, options)
    poses = open_arms(poses, opening)
    clear = overlap.clear_throughout(poses)
    if 0 < np.count_nonzero(~clear) < len(poses) - 1:
        bridged_poses, bridged_trans = _bridged(poses, trans, clear)
        again = clear.copy()
        again[~clear] = overlap.clear_throughout(bridged_poses)[~clear]
    else:
        bridged_poses, bridged_trans, again = poses, trans, clear
    way_poses, way_trans = way_in(bridged_poses[0], bridged_trans[0], options)
    ready = replace(
        even,
        poses=np.concatenate([way_poses, bridged_poses]),
        trans=np.concatenate([way_trans, bridged_trans]),
    )
    kept = np.concatenate([np.zeros(len(way_poses), dtype=bool), again])
    return PreparedMotion(ready, len(way_poses), kept, opening, int(np.count_nonzero(~clear)))


@dataclass(frozen=True)
class SelfOverlap:
    """Finds poses in which a body runs into itself.

    Where two parts of a closed surface overlap, the surface winds twice around the points in both. A vertex of one part
    is counted where the point `depth` below its skin is such a point: there the other part reaches at least that deep.
    Vertices that count at rest too (lips, toes, armpits) are left out.
    """

    body: BodyModel
    betas: NDArray[Any] | None
    depth: float
    share: float
    at_rest: NDArray[np.bool_]

    @staticmethod
    def of(body: BodyModel, betas: NDArray[Any] | None, options: PreparationOptions) -> SelfOverlap:
        """With the depth and share that `options` give."""
        rest = _overlapped(body.shaped(betas), body.faces, options.overlap_depth)
        return SelfOverlap(body, betas, options.overlap_depth, options.overlap_share, rest)

    def shares(self, poses: NDArray[Any]) -> NDArray[np.float64]:
        """Share of the body's vertices that count, in each of `poses` (T, 24, 3)."""
        shares = np.zeros(len(poses))
        for index, pose in enumerate(poses):
            posed = np.asarray(self.body.posed(pose, self.betas), np.float64)
            shares[index] = (_overlapped(posed, self.body.faces, self.depth) & ~self.at_rest).mean()
        return shares

    def clear(self, poses: NDArray[Any]) -> NDArray[np.bool_]:
        """Which of `poses` (T, 24, 3) are clear, (T,)."""
        return self.shares(poses) <= self.share

    def clear_throughout(self, poses: NDArray[Any]) -> NDArray[np.bool_]:
        """As `clear`, for the frames of a motion: those between two clear ones close by are not asked.

        Every third frame is; in a thirtieth of a second no limb moves far.
        """
        frames = np.arange(len(poses))
        asked = np.union1d(frames[::_STRIDE], frames[-1:])
        answers = self.clear(poses[asked])
        before = np.searchsorted(asked, frames, side="right") - 1
        clear: NDArray[np.bool_] = answers[before] & answers[np.searchsorted(asked, frames)]
        doubtful = np.setdiff1d(frames[~clear], asked)
        clear[doubtful] = self.clear(poses[doubtful])
        return clear


def _overlapped(vertices: NDArray[Any], faces: NDArray[Any], depth: float) -> NDArray[np.bool_]:
    """Every fourth vertex of a closed mesh: whether the surface winds twice at `depth` below it."""
    import igl

    v = np.ascontiguousarray(vertices, np.float64)
    below = v - depth * vertex_normals(v, faces)
    below = np.ascontiguousarray(below[::_SAMPLED])
    twice: NDArray[np.bool_] = igl.fast_winding_number(v, np.ascontiguousarray(faces, np.int64), below) > 1.5
    return twice


def _clearing_angle(poses: NDArray[Any], overlap: SelfOverlap, options: PreparationOptions) -> float:
    """The smallest opening of the arms with the most clear frames, degrees."""
    screened = poses[np.unique(np.linspace(0, len(poses) - 1, _SCREENED).round().astype(np.intp))]
    best, most = options.arms, -1
    for opening in np.arange(options.arms, options.arms_most + 1e-9, options.arms_step):
        count = int(np.count_nonzero(overlap.clear(open_arms(screened, float(opening)))))
        if count > most:
            best, most = float(opening), count
        if most == len(screened):
            break
    return best


def _from_heading_zero(
    poses: NDArray[np.float64], trans: NDArray[np.float64], pelvis: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The motion turned about the vertical and moved, so that it starts above the origin and faces +Z.

    Cloth neither knows where it is nor which way is north. The pelvis (3,) is where the root rotation's centre is.
    """
    roots = axis_angle_to_matrix(poses[:, 0])
    forward = roots[0] @ np.array([0.0, 0.0, 1.0])
    turn = axis_angle_to_matrix(np.array([0.0, -np.arctan2(forward[0], forward[2]), 0.0]))
    turned = poses.copy()
    turned[:, 0] = quaternion_to_axis_angle(matrix_to_quaternion(turn @ roots))
    moved = (trans + pelvis) @ turn.T - pelvis
    moved[:, [0, 2]] -= moved[0, [0, 2]]
    return turned, moved


def _bridged(
    poses: NDArray[np.float64], trans: NDArray[np.float64], clear: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frames that are not `clear` (T,) replaced by a turn between the nearest clear ones; held at the ends."""
    index = np.arange(len(poses))
    good = np.flatnonzero(clear)
    after = np.minimum(np.searchsorted(good, index), len(good) - 1)
    before = np.maximum(np.searchsorted(good, index, side="right") - 1, 0)
    start, end = good[before], good[after]
    share = np.where(end > start, (index - start) / np.maximum(end - start, 1), 0.0)
    return _between(poses[start], poses[end], share), trans[start] + (trans[end] - trans[start]) * share[:, None]


def way_in(
    pose: NDArray[np.float64], trans: NDArray[np.float64], options: PreparationOptions
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frames from rest to the first pose (24, 3) and translation (3,), easing in and out, and the pause there."""
    widest = np.degrees(np.linalg.norm(pose, axis=1)).max()
    count = max(options.lead_in, int(np.ceil(1.5 * widest / options.lead_in_speed)))  # easing is 1.5 times as fast
    share = ease(np.concatenate([np.arange(count) / count, np.ones(options.hold)]))
    rest, goal = np.zeros((len(share), *pose.shape)), np.broadcast_to(pose, (len(share), *pose.shape))
    return _between(rest, goal, share), share[:, None] * trans


def _between(start: NDArray[Any], end: NDArray[Any], share: NDArray[Any]) -> NDArray[np.float64]:
    """Poses (T, 24, 3) a `share` (T,) of the way from `start` to `end`, joint by joint on the shorter arc."""
    quaternions = axis_angle_to_quaternion(start), axis_angle_to_quaternion(end)
    return quaternion_to_axis_angle(slerp(*quaternions, np.broadcast_to(share[:, None], start.shape[:2])))


def ease(share: NDArray[Any]) -> NDArray[np.float64]:
    """From 0 to 1 with no speed at either end: 3 s^2 - 2 s^3."""
    eased: NDArray[np.float64] = share * share * (3 - 2 * share)
    return eased
