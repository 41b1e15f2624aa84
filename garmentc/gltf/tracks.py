"""A motion as keyframe tracks: what an animation holds, before it is written, and the keyframes it can do without."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.asset import Clip
from garmentc.rig import Rig
from garmentc.smpl.rotations import axis_angle_to_quaternion
from garmentc.smpl.skeleton import JOINT_COUNT, PARENTS

_AT_REST = 1e-7
"""Metres: what the rounding of a network's numbers may leave of its zero at rest."""


@dataclass(frozen=True)
class Track:
    """Keyframes of one property.

    path    "rotation", "translation" or "weights"
    joint   whose property it is; None for the morph weights
    frames  (K,) increasing frame numbers, the first and the last frame of the motion among them
    values  (K, C) float32: quaternions x, y, z, w; metres; or morph weights
    mesh    whose morph weights they are
    """

    path: str
    joint: int | None
    frames: NDArray[np.intp]
    values: NDArray[np.float32]
    mesh: int = 0


def clip_tracks(clip: Clip, rigs: Sequence[Rig], root: NDArray[Any], tolerance: float) -> tuple[Track, ...]:
    """The tracks of a clip; properties that stay as they are at rest have none.

    rigs       of all meshes, with the same joints
    root       (3,) rest position of the pelvis node
    tolerance  metres: leaving out the keyframes of one track moves no vertex further at any frame of the motion,
               interpolated as engines do; 0 keeps every keyframe
    """
    tracks = []
    weights = clip_keys(clip, rigs)
    moving = [_own(keys, rig.driven_count) if rig.balanced else keys for rig, keys in zip(rigs, weights, strict=True)]
    sizes = [np.array([largest_row(shape) for shape in rig.blend_shapes]) for rig in rigs]
    quaternions = continuous(axis_angle_to_quaternion(clip.motion.poses.astype(np.float64)))
    swells = [float((np.abs(keys) @ size).max()) for keys, size in zip(moving, sizes, strict=True)]
    reach = np.max([joint_reach(rig, swell) for rig, swell in zip(rigs, swells, strict=True)], axis=0)
    for joint in range(JOINT_COUNT):
        rotation = quaternions[:, joint]
        if np.any(rotation[:, :3] != 0):
            frames = kept_frames(rotation, slerp, rotation_angle, tolerance / reach[joint])
            tracks.append(Track("rotation", joint, frames, continuous(rotation[frames]).astype(np.float32)))
    translation = clip.motion.trans.astype(np.float64)
    if np.any(translation != 0):
        frames = kept_frames(translation, lerp, _distance, tolerance)
        tracks.append(Track("translation", 0, frames, (root + translation[frames]).astype(np.float32)))
    for mesh, (keys, own, size) in enumerate(zip(weights, moving, sizes, strict=True)):
        if np.any(np.abs(own) @ size > _AT_REST):
            frames = kept_frames(own, lerp, partial(_moved, size), tolerance)
            tracks.append(Track("weights", None, frames, keys[frames].astype(np.float32), mesh))
    return tuple(tracks)


def clip_keys(clip: Clip, rigs: Sequence[Rig]) -> tuple[NDArray[Any], ...]:
    """Morph weights (T, M) of each rig along a clip."""
    poses = clip.motion.poses.astype(np.float64)
    given = [*clip.keys, *(None for _ in rigs[len(clip.keys) :])]
    return tuple(rig.pose_keys(poses) if keys is None else keys for rig, keys in zip(rigs, given, strict=True))


def _own(keys: NDArray[Any], driven: int) -> NDArray[Any]:
    """Keys (T, M) less what the first `driven` ones of a frame have in common, which moves nothing where their blend
    shapes are balanced."""
    own = keys.copy()
    own[:, :driven] -= keys[:, :driven].mean(axis=-1, keepdims=True)
    return own


def _moved(sizes: NDArray[Any], a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Metres that a vertex moves at most between morph weights (K, M) and (K, M)."""
    moved: NDArray[Any] = np.abs(a - b) @ sizes
    return moved


def kept_frames(
    values: NDArray[Any],
    interpolate: Callable[[NDArray[Any], NDArray[Any], NDArray[Any]], NDArray[Any]],
    difference: Callable[[NDArray[Any], NDArray[Any]], NDArray[Any]],
    tolerance: float,
) -> NDArray[np.intp]:
    """Frames to keep, so that interpolating between them differs from `values` (T, C) by at most `tolerance`.

    From each kept frame the longest step is searched by doubling and halving. The first and last frames are kept.
    """
    last = len(values) - 1
    if tolerance <= 0 or last < 2:
        return np.arange(last + 1)

    middles = interpolate(values[:-2], values[2:], np.full((last - 1, 1), 0.5))
    one_dropped = difference(middles, values[1:-1]) <= tolerance  # most steps end here: checked for all at once

    def fits(start: int, end: int) -> bool:
        if end - start == 2:
            return bool(one_dropped[start])
        inner = np.arange(start + 1, end)
        amount = ((inner - start) / (end - start))[:, None]
        between = interpolate(values[start], values[end], amount)
        return bool(np.all(difference(between, values[inner]) <= tolerance))

    kept = [0]
    while kept[-1] < last:
        start, step = kept[-1], 1
        while start + 2 * step <= last and fits(start, start + 2 * step):
            step *= 2
        low, high = start + step, min(start + 2 * step, last + 1)  # low fits; high is too far, or past the end
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if fits(start, middle) else (low, middle)
        kept.append(low)
    return np.array(kept)


def continuous(quaternions: NDArray[Any]) -> NDArray[Any]:
    """The same rotations (T, ..., 4) with signs such that neighbours in time are on the same side."""
    dots = (quaternions[1:] * quaternions[:-1]).sum(axis=-1, keepdims=True)
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
    return np.concatenate([quaternions[:1], quaternions[1:] * signs])


def slerp(a: NDArray[Any], b: NDArray[Any], amount: NDArray[Any]) -> NDArray[Any]:
    """Spherical interpolation the shorter way round (glTF 2.0, appendix C.4). (..., 4), (..., 4), (K, 1) to (K, 4)."""
    near = b * np.where((a * b).sum(axis=-1, keepdims=True) < 0, -1.0, 1.0)
    half_chord = np.linalg.norm(a - near, axis=-1, keepdims=True) / 2
    angle = 2 * np.arcsin(np.minimum(1, half_chord))
    sine = np.where(angle < 1e-6, 1, np.sin(angle))
    arc = (np.sin((1 - amount) * angle) * a + np.sin(amount * angle) * near) / sine
    return np.where(angle < 1e-6, lerp(a, near, amount), arc)


def lerp(a: NDArray[Any], b: NDArray[Any], amount: NDArray[Any]) -> NDArray[Any]:
    line: NDArray[Any] = a + amount * (b - a)
    return line


def rotation_angle(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Radians between rotations (K, 4) and (K, 4)."""
    sign = np.where((a * b).sum(axis=-1, keepdims=True) < 0, -1.0, 1.0)
    return np.asarray(4 * np.arcsin(np.minimum(1, np.linalg.norm(a - sign * b, axis=-1) / 2)))


def largest_row(rows: NDArray[Any]) -> float:
    """The largest Euclidean length of rows (n, 3)."""
    return float(np.sqrt(np.einsum("ni,ni->n", rows, rows).max()))


def _distance(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(np.linalg.norm(a - b, axis=-1))


def joint_reach(rig: Rig, swell: float) -> NDArray[np.float64]:
    """Metres from each joint to the farthest point that turning it can move, in any pose. (24,)

    That is the chain of bones to a vertex's own joint, stretched out, and from there to the vertex; a joint that pulls
    no vertex counts as a hand's breadth, for something may be attached to it.

    swell  metres that blend shapes move a vertex at most
    """
    joints = rig.joints.astype(np.float64)
    reach = np.full(JOINT_COUNT, 0.1)
    for joint in range(JOINT_COUNT):
        pulled = rig.template[rig.weights[:, joint] > 0]
        if len(pulled):
            reach[joint] = max(0.1, largest_row(pulled - joints[joint]) + swell)
    for joint in range(JOINT_COUNT - 1, 0, -1):  # children come after their parents
        parent, bone = PARENTS[joint], float(np.linalg.norm(joints[joint] - joints[PARENTS[joint]]))
        reach[parent] = max(reach[parent], reach[joint] + bone)
    return reach
