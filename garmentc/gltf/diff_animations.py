"""Differences of animations, compared at all keyframes of both: how many keyframes there are does not count."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.difference import Difference, DiffTolerances, apart, unequal
from garmentc.gltf.glb_asset import Animation, GlbAsset
from garmentc.gltf.posing import state_at_time
from garmentc.gltf.state import State
from garmentc.smpl.rotations import quaternion_to_matrix


def animation_differences(left: GlbAsset, right: GlbAsset, tolerances: DiffTolerances) -> Iterator[Difference]:
    names = [animation.name for animation in left.animations], [animation.name for animation in right.animations]
    yield from unequal("animations", *names)
    if len(left.animations) != len(right.animations):
        return
    for index, (a, b) in enumerate(zip(left.animations, right.animations, strict=True)):
        where = f"animations/{index}"
        durations = np.array([[a.duration]]), np.array([[b.duration]])
        yield from apart(f"{where}/duration", *durations, tolerances.time, " s")
        times = _keyframe_times(a, b)
        states = [(state_at_time(left, time, index), state_at_time(right, time, index)) for time in times]
        yield from _states(where, left, states, tolerances)


def _keyframe_times(a: Animation, b: Animation) -> list[float]:
    times = [channel.times for animation in (a, b) for channel in animation.channels]
    return [float(time) for time in np.unique(np.concatenate([np.zeros(1, np.float32), *times]))]


def _states(
    where: str, asset: GlbAsset, states: list[tuple[State, State]], tolerances: DiffTolerances
) -> Iterator[Difference]:
    def both(path: str, index: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        left, right = (np.array([getattr(pair[side], path)[index] for pair in states]) for side in (0, 1))
        return left, right

    for index, node in enumerate(asset.nodes):
        a, b = both("rotation", index)
        # Matrices of rotations an angle apart differ by sqrt(8) sin(angle / 2) in length.
        matrices = quaternion_to_matrix(a), quaternion_to_matrix(b)
        yield from apart(f"{where}/{node.name}/rotation", *matrices, tolerances.rotation * 2**0.5, " rad", 0.5**0.5)
        moved = both("translation", index)
        yield from apart(f"{where}/{node.name}/translation", *moved, tolerances.position, " mm", 1000.0)
    for index in asset.mesh_nodes:
        a, b = both("weights", index)
        yield from apart(
            f"{where}/{asset.nodes[index].name}/weights", a.reshape(-1, 1), b.reshape(-1, 1), tolerances.key
        )
