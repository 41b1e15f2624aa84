"""Animations (glTF 2.0 section 3.11)."""

from __future__ import annotations

from typing import Any

import numpy as np

from garmentc.gltf.accessors import AccessorWriter
from garmentc.gltf.tracks import Track


def add_animation(
    writer: AccessorWriter, name: str, tracks: tuple[Track, ...], fps: float, joints: list[int], mesh_nodes: list[int]
) -> None:
    """Add an animation with one channel for each track; nothing where there is no track.

    Tracks with the same frames share one accessor of times, in seconds from the first frame.
    """
    from pygltflib import Animation, AnimationChannel, AnimationChannelTarget, AnimationSampler

    if not tracks:
        return
    times: dict[bytes, int] = {}
    animation = Animation(name=name)
    for track in tracks:
        frames = track.frames.tobytes()
        if frames not in times:
            seconds = (track.frames / fps).astype(np.float32)
            times[frames] = writer.plain(seconds, bounds=True, label="keyframe times", rows=seconds)
        node = mesh_nodes[track.mesh] if track.joint is None else joints[track.joint]
        sampler = AnimationSampler(input=times[frames], output=_output(writer, track), interpolation=None)
        target = AnimationChannelTarget(node=node, path=track.path)
        animation.channels.append(AnimationChannel(sampler=len(animation.samplers), target=target))
        animation.samplers.append(sampler)
    writer.document.animations.append(animation)


def _output(writer: AccessorWriter, track: Track) -> Any:
    values = track.values.reshape(-1) if track.path == "weights" else track.values  # weights are scalars in a row
    return writer.plain(values, label=f"the {track.path} of the motion", rows=track.values)
