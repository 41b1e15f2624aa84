"""Morph weights that stay within 0 and 1, as tools that keep them there expect."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.mixed_shapes import mixed_keys
from garmentc.passes.pose_set import PoseSet, keys_to_fit
from garmentc.passes.report import PassReport
from garmentc.rig import KeyNetwork, Rig

_POSES_AT_ONCE = 4096
_SMALL = 0.05
"""Shapes that move no vertex by more than this share of what the largest does are small."""
_LARGEST_BAKED = 0.999
"""In frames of the animations: 1, less the rounding of the network."""


@dataclass(frozen=True)
class NonnegativeWeights:
    """largest  what the largest weight is in the poses to fit; in other poses there is room from there to 1"""

    largest: float = 0.8

    def __post_init__(self) -> None:
        if not 0 < self.largest <= 1:
            raise GarmentcError(f"the largest weight is {self.largest}; choose one above 0 and up to 1")


def nonnegative_weights(rig: Rig, options: NonnegativeWeights, poses: PoseSet) -> tuple[Rig, PassReport]:
    """Add one blend shape, so that all that are driven sum to nothing, and take the least of their keys off each.

    What sums to nothing may be added to any pose: the outfit moves as before, and no key is negative in any pose. In
    the frames of the animations none is above 1 either. With keys y and shapes D, scaled so that all keys go as far,

        y_i' = y_i                                    D_i' = D_i - u_i sum_j D_j
        y_b' = -sum_j u_j y_j / (1 - sum_j u_j)       D_b' = -(1 - sum_j u_j) sum_j D_j

    has the same sum of y_i D_i, and sum_i D_i' + D_b' = 0, for any u. With u = 0, D_b' would be larger than any other,
    and with it the rounding of whatever stores it. So u_i = 1 / (h + sqrt(h)) for the h largest shapes: these and D_b'
    are then the corners of a regular simplex where the D_i are orthonormal. For small shapes u_i = 0: they keep their
    zeros. Normals are mixed alike. Shapes that only animations use, after those, have amounts from 0 to 1 anyway.
    """
    if rig.keys is None:
        return rig, PassReport("nonnegative weights", "no blend shapes, so none")
    with single_threaded_blas():
        balanced, detail = _nonnegative(rig, rig.keys, options.largest, poses)
    return balanced, PassReport("nonnegative weights", detail)


def _nonnegative(rig: Rig, network: KeyNetwork, largest: float, poses: PoseSet) -> tuple[Rig, str]:
    """The rig, and what the report says of it."""
    count = rig.driven_count
    shapes, others = np.split(rig.blend_shapes, [count])
    keys = keys_to_fit(network, poses)
    animated = _keys(rig, poses.baked) if rig.animation_keys is None else rig.animation_keys
    extreme, shares = _extremes_and_shares(np.concatenate([keys, animated[:, :count]]), shapes)
    mix = np.concatenate([np.eye(count), [-shares / (1 - shares.sum())]]) / extreme
    mix[:, ~shapes.any(axis=(1, 2))] = 0  # the key of a shape that moves nothing would be rounding
    scale = max(_largest(keys, mix) / largest, _largest(animated[:, :count], mix) / _LARGEST_BAKED) or 1.0
    network = mixed_keys(network, mix / scale)
    last = replace(network.layers[-1], activation="nonnegative")
    normals = rig.blend_normals
    if normals is not None:
        normals = np.concatenate([_balanced(normals[:count], scale * extreme, shares), normals[count:]])
    if rig.animation_keys is not None:
        animated = np.concatenate([_from_zero(animated[:, :count] @ mix.T / scale), animated[:, count:]], axis=1)
    balanced = replace(
        rig,
        blend_shapes=np.concatenate([_balanced(shapes, scale * extreme, shares), others]),
        blend_normals=normals,
        keys=replace(network, layers=(*network.layers[:-1], last)),
        animation_keys=None if rig.animation_keys is None else animated,
    )
    detail = f"one blend shape more, weights up to {_largest(keys, mix) / scale:.2f} in {len(keys)} poses"
    return balanced, detail


def _keys(rig: Rig, poses: NDArray[Any]) -> NDArray[np.float64]:
    """Keys (P, M) of poses (P, 24, 3), some thousand at a time."""
    blocks = [poses[start : start + _POSES_AT_ONCE] for start in range(0, len(poses), _POSES_AT_ONCE)]
    none = np.zeros((0, rig.morph_count))
    return np.concatenate([none, *(rig.pose_keys(np.asarray(block, np.float64)) for block in blocks)])


def _extremes_and_shares(
    keys: NDArray[np.float64], shapes: NDArray[Any]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(M,) how far each of keys (P, M) goes from 0, and (M,) u of `nonnegative_weights`.

    A small shape is taken to go as far as moves a vertex by _SMALL of what the largest does: no small key, or one that
    no pose uses and that the rounding of the network makes, shall decide how much is added to all.
    """
    extreme = np.abs(keys).max(axis=0, initial=0)
    length = np.sqrt([np.einsum("ni,ni->n", shape, shape).max() for shape in shapes])
    moved = extreme * length
    least = _SMALL * moved.max()
    large = moved > least
    count = max(1, large.sum())
    extreme = np.where(large, extreme, np.divide(least, length, out=np.ones_like(length), where=length * least > 0))
    return extreme, np.where(large, 1 / (count + np.sqrt(count)), 0.0)


def _largest(keys: NDArray[np.float64], mix: NDArray[np.float64]) -> float:
    """The largest weight over poses, from keys (P, M) and `mix` (M + 1, M)."""
    return float(_from_zero(keys @ mix.T).max(initial=0))


def _from_zero(keys: NDArray[np.float64]) -> NDArray[np.float64]:
    """Keys (P, M) less the least of each pose, as the activation `nonnegative` has them."""
    raised: NDArray[np.float64] = keys - keys.min(axis=1, keepdims=True)
    return raised


def _balanced(deltas: NDArray[Any], scale: NDArray[np.float64], shares: NDArray[np.float64]) -> NDArray[np.float32]:
    """(M + 1, N, 3) that sum to nothing, from (M, N, 3), each times its `scale` (M,) less its share of all of them."""
    total = np.zeros(deltas.shape[1:])
    for delta, amount in zip(deltas, scale, strict=True):
        total += amount * delta
    balanced = np.empty((len(deltas) + 1, *deltas.shape[1:]), dtype=np.float32)
    for row, delta, amount, share in zip(balanced[:-1], deltas, scale, shares, strict=True):
        row[:] = amount * delta - share * total
    balanced[-1] = (shares.sum() - 1) * total
    return balanced
