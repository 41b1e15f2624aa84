"""Pose keys from a deep network's first hidden layer: they tell more poses apart than its last one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.mixed_shapes import gram, mixed_keys, mixed_shapes
from garmentc.passes.part_of_rig import spread_vertices
from garmentc.passes.pose_set import PoseSet, keys_to_fit
from garmentc.passes.posed_error import posed_error
from garmentc.passes.report import PassReport
from garmentc.rig import KeyNetwork, Rig
from garmentc.smpl.skeleton import JOINT_COUNT

_MEASURED = 4096
"""Vertices whose movement says how much is kept."""


@dataclass(frozen=True)
class HiddenKeys:
    """When to do it.

    ridge     of the least squares that fit the new keys to the old, relative to the new ones' mean square
    faithful  share of the squared movement that must be kept; a network whose later layers do more stays as it is
    """

    ridge: float = 0.03
    faithful: float = 0.9


def hidden_keys(rig: Rig, options: HiddenKeys, poses: PoseSet) -> tuple[Rig, PassReport]:
    """Replace M pose keys by the M principal combinations of the units in the network's first hidden layer.

    A trained network's last keys have a few dozen principal combinations: enough for what it has learned to predict,
    too few for what cloth does that is simulated for this outfit alone. Its first layer has learned what matters about
    a pose, too, and has more. The blend shapes become what fits the network's movement best (ridge least squares over
    the poses to fit), so the outfit moves nearly as before, and the network that is written to files has one hidden
    layer.
    """
    if rig.keys is None or len(rig.keys.layers) < 3 or rig.keys.layers[0].activation != "relu":
        return rig, PassReport("hidden keys", "no hidden layers that could say more")
    with single_threaded_blas():
        keys = keys_to_fit(rig.keys, poses)
        if not keys.any():
            return rig, PassReport("hidden keys", "no pose keys that move")
        network = KeyNetwork(rig.keys.layers[:1], rig.keys.encoding)
        moment, axes, units = _principal(network, np.asarray(poses.fit, np.float64), rig.morph_count)
        weights = units.T @ keys / len(keys) / (moment + options.ridge * moment.mean())[:, None]
        some = spread_vertices(rig.vertex_count, _MEASURED)
        left, products = keys - units @ weights, gram(np.take(rig.blend_shapes, some, axis=1))
        kept = 1 - _squared(left, products) / max(_squared(keys, products), np.finfo(float).tiny)
        if kept < options.faithful:
            return rig, PassReport("hidden keys", "the network's own are kept: its first layer says too little")
        shapes = mixed_shapes(weights, rig.blend_shapes)
        hidden = replace(rig, blend_shapes=shapes, blend_normals=None, keys=mixed_keys(network, axes.T))
    detail = f"{len(axes)} units of the first layer, {100 * kept:.1f} % of the squared movement kept"
    return hidden, PassReport("hidden keys", detail, posed_error(rig, hidden, poses.check))


def _principal(
    network: KeyNetwork, poses: NDArray[np.float64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Mean squares (r,) of at most `count` principal combinations, the combinations of U units (U, r), and how much of
    each is in `poses` (P, r)."""
    units = network(poses) - network(np.zeros((JOINT_COUNT, 3)))
    moment, axes = np.linalg.eigh(units.T @ units / len(units))
    largest = slice(None, -count - 1, -1)
    moment, axes = moment[largest], axes[:, largest]
    return moment, axes, units @ axes


def _squared(keys: NDArray[np.float64], products: NDArray[np.float64]) -> float:
    """Sum over poses of the squared movement by `keys` (P, M), from the shapes' Gram matrix (M, M)."""
    return float(np.sum((keys @ products) * keys))
