"""Which moments of an outfit a preview shows: frames of its animation, or else telling poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.gltf.glb_asset import GlbAsset
from garmentc.gltf.posing import animation_number, smpl_joints, state_at_pose, state_at_time
from garmentc.gltf.state import State
from garmentc.preview.poses import telling_poses
from garmentc.smpl.rotations import quaternion_to_axis_angle


@dataclass(frozen=True)
class Moment:
    """An asset in a pose, and what the picture is called.

    grounded  the heights of its joints mean something; built-in poses are to be put on the floor first
    """

    label: str
    state: State
    grounded: bool


def choose_moments(asset: GlbAsset, count: int, animation: str | None = None) -> tuple[Moment, ...]:
    """`count` moments, spread evenly over an animation; without one, the asset in built-in poses.

    animation  a name, or a number counting from 0; the first one by default
    Raises GarmentcError where there is no such animation, or too few built-in poses.
    """
    if asset.animations:
        number = animation_number(asset, animation or "0")
        times = (np.arange(count) + 0.5) / count * asset.animations[number].duration
        states = [state_at_time(asset, float(time), number) for time in times]
        return tuple(Moment(f"{time:.2f} s", state, True) for time, state in zip(times, states, strict=True))
    if animation is not None:
        raise GarmentcError("has no animation; leave out --animation, or compile it with --motion", asset.path)
    poses = telling_poses()
    if count > len(poses):
        raise GarmentcError(f"has no animation, and there are only {len(poses)} poses; ask for fewer", asset.path)
    chosen = list(poses.items())[:count]
    return tuple(Moment(name, state_at_pose(asset, pose), False) for name, pose in chosen)


def body_pose(asset: GlbAsset, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The pose (24, 3) of the SMPL joints, axis-angle, and how far (3,) the pelvis is from its place at rest."""
    joints = smpl_joints(asset)
    rest = np.asarray(asset.nodes[joints[0]].translation, np.float64)
    return quaternion_to_axis_angle(state.rotation[joints]), state.translation[joints[0]] - rest
