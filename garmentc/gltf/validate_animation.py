"""Checks of animations."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from garmentc.errors import GarmentcError
from garmentc.gltf.bind import moved_at_most
from garmentc.gltf.finding import Finding, error, warning
from garmentc.gltf.glb_asset import Channel, GlbAsset
from garmentc.gltf.posing import evaluate_network, pose_key_network, state_at_time

_KEY_TOLERANCE = 2e-3
"""Metres that vertices may move between baked morph weights and the network at the animated joints."""

_TIMES_CHECKED = 50


def animation_findings(asset: GlbAsset) -> Iterator[Finding]:
    for index, animation in enumerate(asset.animations):
        for number, channel in enumerate(animation.channels):
            where = f"animations/{index}/channels/{number}"
            if channel.path == "rotation" and channel.interpolation != "CUBICSPLINE":
                yield from _quaternions(channel, where)
            if channel.path == "weights" and channel.interpolation != "CUBICSPLINE":
                yield from _baked_keys(asset, index, channel, where)


def _quaternions(channel: Channel, where: str) -> Iterator[Finding]:
    off = np.abs(np.linalg.norm(channel.values.astype(np.float64), axis=1) - 1)
    if off.max() > 1e-4:
        yield error(
            "rotation-norm", where, f"the quaternion of keyframe {off.argmax()} is {off.max():.3g} off length 1"
        )
    flips = np.flatnonzero((channel.values[1:] * channel.values[:-1]).sum(axis=1) < 0)
    if len(flips):
        message = (
            f"the quaternion changes sign at keyframe {flips[0] + 1}; simple engines would turn the long way round"
        )
        yield warning("rotation-sign", where, message)


def _baked_keys(asset: GlbAsset, animation: int, channel: Channel, where: str) -> Iterator[Finding]:
    """Morph weights of an animation are the network's, or the garment moves differently with and without it.

    Targets beyond the network's outputs are the animation's own. What all its weights have in common is not compared
    where targets are balanced: it moves nothing.
    """
    network = pose_key_network(asset, channel.node)
    if network is None or len(network.layers[-1].bias) > channel.values.shape[1]:
        return
    times, apart = [], []
    chosen = np.unique(np.linspace(0, len(channel.times) - 1, _TIMES_CHECKED).astype(int))
    for time in map(float, channel.times[chosen]):
        state = state_at_time(asset, time, animation)
        try:
            keys = evaluate_network(asset, network, state)
        except GarmentcError:
            return  # the network itself has a finding
        times.append(time)
        apart.append(keys - state.weights[channel.node][: len(keys)])
    moved = moved_at_most(asset, channel.node, np.array(apart))
    worst = int(moved.argmax())
    if moved[worst] > _KEY_TOLERANCE:
        message = (
            f"the weights at {times[worst]:.3f} s move vertices by up to {moved[worst] * 1000:.3g} mm"
            " against the network's"
        )
        yield warning("baked-keys", where, message)
