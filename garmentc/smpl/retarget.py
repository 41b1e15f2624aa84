"""A BVH motion on the body's skeleton, by bone directions.

Every joint's world rotation G(t), relative to the source's zero pose, is combined with a constant alignment Q that
takes the body's T-pose onto the source's zero pose; the body's joint then turns by G(t) Q.

    limbs        Q turns the bone of the T-pose onto the bone of the zero pose along the shortest arc
    feet         Q keeps soles flat; where the zero pose spreads the legs, soles are at right angles to the shins
    trunk, head  Q only changes axes: both rests are upright, but skeletons put these joints at different places

Proportions stay the body's own. The path of the hips is scaled by the ratio of leg lengths, so no length unit is
needed.
"""

from __future__ import annotations

from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import Diagnostic, GarmentcError
from garmentc.smpl.bvh import BvhClip, read_bvh
from garmentc.smpl.bvh_skeletons import SkeletonMap, match_skeleton
from garmentc.smpl.motion import Motion
from garmentc.smpl.rotations import (
    axis_angle_to_matrix,
    matrix_to_quaternion,
    quaternion_to_axis_angle,
    quaternion_to_matrix,
    slerp,
)
from garmentc.smpl.skeleton import JOINT_NAMES, PARENTS
from garmentc.smpl.up_axis import Z_UP_TO_Y_UP, detect_up

_ID = {name: k for k, name in enumerate(JOINT_NAMES)}
_SIDES = ("left", "right")
_BONES = {"hip": "knee", "knee": "ankle", "shoulder": "elbow", "elbow": "wrist"}

LEAST_UPRIGHT = np.radians(35.0)
"""How far the zero pose may lean from a figure that stands along the axes."""

FLAT_SOLE = np.radians(12.0)
"""A shin of the zero pose that is this near to vertical stands on a flat sole."""

COLLAR_UP, COLLAR_DOWN, COLLAR_FRONT = 0.33, 0.13, 0.15
"""Share of the upper arm's angle that the collar bone takes where the recording holds it still."""


def read_bvh_motion(path: Path, joints: NDArray[Any], up: str | None = None) -> Motion:
    """A .bvh file as a motion of the body with rest joints (24, 3), in T-pose.

    up  "y" or "z": the file's vertical axis; None takes the one that the spine points along on average

    Raises GarmentcError where the file is malformed (with its line) or its skeleton is not known.
    """
    clip, warnings = _without_t_pose_frame(read_bvh(path), path)
    found = match_skeleton(clip.names, path)
    world = _world_rotations(clip, found, joints, path)
    hips = (clip.positions[:, found.joints["left_hip"]] + clip.positions[:, found.joints["right_hip"]]) / 2
    hips = hips * (_leg_length(joints, _ID) / _leg_length(clip.rest, found.joints))

    spine = detect_up(world[:, 0])
    axis = up or spine.axis
    if up is None and not spine.sure:
        text = f"{axis.upper()} is taken as up, but that is not sure; say which with --motion-up"
        warnings = (*warnings, Diagnostic("motion-up-unsure", text, str(path)))
    if axis == "z":
        world, hips = Z_UP_TO_Y_UP @ world, hips @ Z_UP_TO_Y_UP.T
    local = world.copy()
    local[:, 1:] = np.swapaxes(world[:, PARENTS[1:]], -1, -2) @ world[:, 1:]
    rest_hips = (joints[_ID["left_hip"]] + joints[_ID["right_hip"]]) / 2
    return Motion(
        name=path.stem,
        poses=quaternion_to_axis_angle(matrix_to_quaternion(local)),
        trans=hips - world[:, 0] @ (rest_hips - joints[0]) - joints[0],  # the pelvis turns about its rest position
        fps=clip.fps,
        source=f"BVH, {found.convention} skeleton, {axis.upper()} up",
        warnings=warnings,
    )


def _without_t_pose_frame(clip: BvhClip, path: Path) -> tuple[BvhClip, tuple[Diagnostic, ...]]:
    """The CMU conversions begin with a made-up T-pose; the motion jumps away from it within one frame."""
    if len(clip.rotations) < 3:
        return clip, ()
    steps = np.swapaxes(clip.rotations[:2], -1, -2) @ clip.rotations[1:3]
    jump, after = np.arccos(np.clip((np.trace(steps, axis1=-2, axis2=-1) - 1) / 2, -1, 1)).max(axis=1)
    if jump < np.radians(30) or after > jump / 3:
        return clip, ()
    message = f"the first frame is left out: it stands apart from the motion by {np.degrees(jump):.0f} degrees"
    kept = BvhClip(clip.names, clip.rest, clip.rotations[1:], clip.positions[1:], clip.fps)
    return kept, (Diagnostic("t-pose-frame-dropped", message, str(path)),)


def _leg_length(positions: NDArray[Any], index: dict[str, int]) -> float:
    hip, knee, ankle = (
        np.array([positions[index[f"{side}_{joint}"]] for side in _SIDES]) for joint in ("hip", "knee", "ankle")
    )
    return float(np.linalg.norm(knee - hip, axis=1).sum() + np.linalg.norm(ankle - knee, axis=1).sum())


def _world_rotations(clip: BvhClip, found: SkeletonMap, joints: NDArray[Any], path: Path) -> NDArray[np.float64]:
    """World rotations (T, 24, 3, 3) of the body's joints, in the file's axes."""
    alignment = _rest_alignment(clip.rest, found.joints, joints, path)
    world = {joint: clip.rotations[:, k] @ alignment[joint] for joint, k in found.joints.items()}
    for joint, far in found.twist.items():
        near = found.joints[joint]
        half = _half_twist(clip.rotations[:, near], clip.rotations[:, far], clip.rest[far] - clip.rest[near])
        world[joint] = clip.rotations[:, near] @ half @ alignment[joint]
    _complete_trunk(world)
    for side in _SIDES:
        world.setdefault(f"{side}_foot", world[f"{side}_ankle"])
        world.setdefault(f"{side}_hand", world[f"{side}_wrist"])
        _complete_collar(world, side)
    return np.stack([world[name] for name in JOINT_NAMES], axis=1)


def _rest_alignment(
    rest: NDArray[np.float64], index: dict[str, int], joints: NDArray[Any], path: Path
) -> dict[str, NDArray[np.float64]]:
    """Q (3, 3) of each joint: the body's T-pose to the source's zero pose."""
    axes = _rest_axes(rest, index, path)
    down = axes @ np.array([0.0, -1.0, 0.0])
    alignment = dict.fromkeys(JOINT_NAMES, axes)
    for side in _SIDES:
        for start, end in _BONES.items():
            start, end = f"{side}_{start}", f"{side}_{end}"
            bone = rest[index[end]] - rest[index[start]]
            if not bone.any():
                raise GarmentcError(f"the bone from {start} to {end} has no length", path)
            alignment[start] = _shortest_arc(axes @ (joints[_ID[end]] - joints[_ID[start]]), bone) @ axes
        alignment[f"{side}_wrist"] = alignment[f"{side}_hand"] = alignment[f"{side}_elbow"]
        shin = rest[index[f"{side}_ankle"]] - rest[index[f"{side}_knee"]]
        flat = shin @ down > np.cos(FLAT_SOLE) * np.linalg.norm(shin)
        sole = axes if flat else _shortest_arc(down, shin) @ axes
        alignment[f"{side}_ankle"] = alignment[f"{side}_foot"] = sole
    return alignment


def _rest_axes(rest: NDArray[np.float64], index: dict[str, int], path: Path) -> NDArray[np.float64]:
    """The turn by right angles (3, 3) that takes left, up and front of the body to those of the zero pose."""
    hips = rest[[index["left_hip"], index["right_hip"]]]
    left, up = hips[0] - hips[1], rest[index["head"]] - hips.mean(axis=0)
    front = np.cross(left, up)
    if not front.any():
        raise GarmentcError("the skeleton's zero pose is flat; export the BVH with a T-pose at zero rotation", path)
    x, z = left / np.linalg.norm(left), front / np.linalg.norm(front)
    figure = np.stack([x, np.cross(z, x), z], axis=1)
    turns = [
        turn
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
        if np.linalg.det(turn := np.eye(3)[:, order] * signs) > 0
    ]
    best = max(turns, key=lambda turn: float(np.sum(turn * figure)))
    lean = np.arccos(np.clip((np.sum(best * figure) - 1) / 2, -1, 1))
    if lean > LEAST_UPRIGHT:
        raise GarmentcError(
            f"the skeleton's zero pose is no standing figure (it leans {np.degrees(lean):.0f} degrees); "
            "export the BVH with a T-pose at zero rotation",
            path,
        )
    return best


def _shortest_arc(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The smallest rotation that takes direction a to direction b."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis = np.cross(a, b)
    sine, cosine = float(np.linalg.norm(axis)), float(a @ b)
    if sine < 1e-12:
        if cosine > 0:
            return np.eye(3)
        axis, sine = np.cross(a, np.eye(3)[np.argmin(np.abs(a))]), 0.0
    return axis_angle_to_matrix(axis / np.linalg.norm(axis) * np.arctan2(sine, cosine))


def _between(start: NDArray[np.float64], end: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Rotations (T, 3, 3) a share of the way from `start` to `end`."""
    quaternions = slerp(matrix_to_quaternion(start), matrix_to_quaternion(end), np.full(len(start), share))
    return quaternion_to_matrix(quaternions)


def _half_twist(near: NDArray[np.float64], far: NDArray[np.float64], bone: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations (T, 3, 3) about `bone` by half of the twist from `near` to `far`; the bend between them is left out."""
    axis = bone / np.linalg.norm(bone)
    quaternion = matrix_to_quaternion(np.swapaxes(near, -1, -2) @ far)
    half_angle = np.arctan2(quaternion[:, :3] @ axis, quaternion[:, 3])
    return axis_angle_to_matrix(half_angle[:, None] * axis)


def _complete_trunk(world: dict[str, NDArray[np.float64]]) -> None:
    """Fill in missing spine joints and neck: a short spine ends at the chest and bends evenly."""
    spine = [world[joint] for joint in ("spine1", "spine2", "spine3") if joint in world]
    if len(spine) < 3:
        chest = spine[-1] if spine else world["pelvis"]
        world["spine1"] = spine[0] if len(spine) == 2 else _between(world["pelvis"], chest, 1 / 3)
        world["spine2"] = _between(world["spine1"], chest, 0.5)
        world["spine3"] = chest
    world.setdefault("neck", _between(world["spine3"], world["head"], 0.5))


def _complete_collar(world: dict[str, NDArray[np.float64]], side: str) -> None:
    """Let a collar that the recording holds still, as optical recordings do, follow the upper arm by a share.

    The arm itself is not changed: its world rotation is what was recorded.
    """
    chest = world["spine3"]
    if f"{side}_collar" in world and np.abs(world[f"{side}_collar"] - chest).max() > 0.01:
        return
    sign = 1.0 if side == "left" else -1.0
    arm = np.swapaxes(chest, -1, -2) @ world[f"{side}_shoulder"] @ np.array([sign, 0.0, 0.0])
    lift, forward = np.arcsin(np.clip(arm[:, 1:].T, -1, 1))
    share = np.where(lift < 0, COLLAR_DOWN, COLLAR_UP)
    turn = np.stack([np.zeros_like(lift), -sign * COLLAR_FRONT * forward, sign * share * lift], axis=-1)
    world[f"{side}_collar"] = chest @ axis_angle_to_matrix(turn)
