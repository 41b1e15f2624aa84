"""How far leaving out keyframes moves the outfit: measured, not bounded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.asset import Clip
from garmentc.gltf.tracks import Track, clip_keys, lerp, slerp
from garmentc.rig import Rig
from garmentc.smpl.rotations import quaternion_to_axis_angle

_VERTICES = 128
"""Vertices that are measured, evenly spread over the rig's."""


def keyframe_error(clip: Clip, rigs: Sequence[Rig], tracks: tuple[Track, ...], root: NDArray[np.float64]) -> float:
    """Metres between the clip and its tracks: the most over all frames of the motion and a sample of vertices.

    rigs  of all meshes
    root  (3,) rest position of the pelvis node, which translation tracks contain
    """
    all_keys = clip_keys(clip, rigs)
    errors = []
    for mesh, (rig, keys) in enumerate(zip(rigs, all_keys, strict=True)):
        own = tuple(track for track in tracks if track.joint is not None or track.mesh == mesh)
        errors.append(_error(clip, rig, keys, own, root))
    return max(errors)


def _error(
    clip: Clip, rig: Rig, meant_keys: NDArray[Any], tracks: tuple[Track, ...], root: NDArray[np.float64]
) -> float:
    count = len(clip.motion)
    chosen = np.unique(np.linspace(0, rig.vertex_count - 1, _VERTICES).astype(int))
    sample = replace(
        rig, template=rig.template[chosen], weights=rig.weights[chosen], blend_shapes=rig.blend_shapes[:, chosen]
    )
    poses = np.zeros((count, *clip.motion.poses.shape[1:]))
    translation = np.zeros((count, 3))
    keys = np.zeros((count, rig.morph_count))
    for track in tracks:
        values = _at_all_frames(track, count)
        if track.path == "rotation":
            poses[:, track.joint] = quaternion_to_axis_angle(values)
        elif track.path == "translation":
            translation = values - root
        else:
            keys = values
    meant = sample.posed(clip.motion.poses, clip.motion.trans, meant_keys)
    given = sample.posed(poses, translation, keys)
    return float(np.linalg.norm(meant - given, axis=-1).max())


def _at_all_frames(track: Track, count: int) -> NDArray[np.float64]:
    """The track's values (T, C), interpolated as engines do."""
    values = track.values.astype(np.float64)
    if len(values) == 1:
        return values.repeat(count, axis=0)
    frames = np.arange(count)
    before = np.minimum(np.searchsorted(track.frames, frames, side="right") - 1, len(values) - 2)
    start, end = track.frames[before], track.frames[before + 1]
    interpolate = slerp if track.path == "rotation" else lerp
    return interpolate(values[before], values[before + 1], ((frames - start) / (end - start))[:, None])
